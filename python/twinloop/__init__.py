"""Twinloop: from a handful of experiments to a twin made of readable equations and a tuned controller."""

from twinloop import autopilots, contracts, controllers, errors, objectives, pareto, systems
from twinloop._core import __version__
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop.campaign import Campaign, identify
from twinloop.errors import (
    InvalidInput,
    NoAnswer,
    NotAvailable,
    RemarkWarning,
    StoreFailure,
    SystemFailure,
    TooRisky,
    TwinloopError,
)
from twinloop.law.twin import Twin, load_twin
from twinloop.logs import load
from twinloop.remarks import Remark
from twinloop.signals import Command, RigidBody, Signals, State
from twinloop.systems import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

__all__ = [
    "Campaign",
    "Command",
    "InvalidInput",
    "Limits",
    "NoAnswer",
    "NotAvailable",
    "Remark",
    "RemarkWarning",
    "Replay",
    "RigidBody",
    "Signals",
    "State",
    "StoreFailure",
    "System",
    "SystemFailure",
    "Test",
    "TooRisky",
    "Trajectory",
    "Twin",
    "TwinloopError",
    "__version__",
    "autopilots",
    "contracts",
    "controllers",
    "errors",
    "identify",
    "load",
    "load_twin",
    "objectives",
    "pareto",
    "systems",
]

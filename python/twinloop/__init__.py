"""Twinloop: from a handful of experiments to a twin made of readable equations and a tuned controller."""

from twinloop._ground import loading as _loading  # noqa: F401 before all that takes its time

# isort: split
from twinloop import (
    autopilots,
    contracts,
    controllers,
    errors,
    flights,
    guard,
    objectives,
    options,
    pareto,
    results,
    systems,
)
from twinloop._core import __version__
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop.campaign import Campaign, identify
from twinloop.campaign.examination.log_check import check_log
from twinloop.errors import (
    InvalidInput,
    NoAnswer,
    NotAvailable,
    NotTrusted,
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
    "NotTrusted",
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
    "check_log",
    "contracts",
    "controllers",
    "errors",
    "flights",
    "guard",
    "identify",
    "load",
    "load_twin",
    "objectives",
    "options",
    "pareto",
    "results",
    "systems",
]


def __dir__() -> list[str]:
    """What users are meant to use; rooms that are loaded behind it are no part of it."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})

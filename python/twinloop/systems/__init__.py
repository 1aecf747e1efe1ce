"""Systems to experiment on: built-in plants, wrappers, and what your own must offer."""

from twinloop.systems.base import System
from twinloop.systems.fmu import FMU
from twinloop.systems.folder import Folder
from twinloop.systems.gymnasium import Gymnasium
from twinloop.systems.quadrotor import Quadrotor, gains_from_backstepping, gains_from_frequency
from twinloop.systems.rotorpy import RotorPy
from twinloop.systems.simulated import Simulated

BUILT_IN: dict[str, type[Quadrotor]] = {"quadrotor": Quadrotor}
"""Systems that can be run by name."""

__all__ = [
    "BUILT_IN",
    "FMU",
    "Folder",
    "Gymnasium",
    "Quadrotor",
    "RotorPy",
    "Simulated",
    "System",
    "gains_from_backstepping",
    "gains_from_frequency",
]

"""What autopilots call gains, and the files that they read: parameters, and chirps."""

from twinloop.autopilots.files import Autopilot
from twinloop.autopilots.parameters import Parameter
from twinloop.autopilots.sweep import Sweep

__all__ = ["Autopilot", "Parameter", "Sweep"]

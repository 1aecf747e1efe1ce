"""Elementary functions, with the same bits on every processor; NumPy's and the system's own differ in the last one."""

from __future__ import annotations

from twinloop._core import cos, exp, log, power, sin, tanh

__all__ = ["cos", "exp", "log", "power", "sin", "tanh"]

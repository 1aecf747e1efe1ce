"""A guard that watches a flight while it happens, and ends it before it does harm."""

from twinloop.guard.guard import Guard
from twinloop.guard.guarded import Guarded

__all__ = ["Guard", "Guarded"]

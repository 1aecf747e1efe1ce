"""Many campaigns at once, over seeds, presets, systems and options, on this machine or on a cluster."""

from twinloop.sweep.campaigns import Outcome, sweep
from twinloop.sweep.jobs import Job, crossed

__all__ = ["Job", "Outcome", "crossed", "sweep"]

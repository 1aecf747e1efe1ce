"""Families of controllers: bounded gains and a law, one implementation for search and real run."""

from twinloop.controllers.cascade import Cascade
from twinloop.controllers.custom import Custom, Law
from twinloop.controllers.family import Controller, Family, UnboundFamily
from twinloop.controllers.gains import FixedGain, Gain
from twinloop.controllers.lqr import lqr_gains
from twinloop.controllers.mixer import Mixer
from twinloop.controllers.pid import PID
from twinloop.controllers.state_feedback import FeedbackFamily, StateFeedback

__all__ = [
    "PID",
    "Cascade",
    "Controller",
    "Custom",
    "Family",
    "FeedbackFamily",
    "FixedGain",
    "Gain",
    "Law",
    "Mixer",
    "StateFeedback",
    "UnboundFamily",
    "lqr_gains",
]

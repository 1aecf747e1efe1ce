"""Types of what campaigns, tests and twins give back: names for annotations and `isinstance`. Nobody builds them."""

from typing import TYPE_CHECKING

from twinloop._core import Flights, Model, ModelSearch, Program, Quality, SelectedTests, Task
from twinloop._experiment.hold_back import HoldBack
from twinloop.campaign.assessment import Advice
from twinloop.campaign.certificate import Certificate, Use
from twinloop.campaign.cost import Cost
from twinloop.campaign.examination.beside import Beside
from twinloop.campaign.examination.check import Check, Checks
from twinloop.campaign.examination.correlation import Correlations
from twinloop.campaign.examination.data import DataQuality
from twinloop.campaign.examination.examination import Examination, Frequency
from twinloop.campaign.examination.frequency import Responses
from twinloop.campaign.examination.learning import ErrorMap
from twinloop.campaign.examination.log_check import Column, LogCheck
from twinloop.campaign.examination.loops import ClosedCurves, LoopCurves
from twinloop.campaign.examination.poles import Pole
from twinloop.campaign.examination.reaching import Ending, Miss
from twinloop.campaign.examination.steps import StepAnswer
from twinloop.campaign.examination.unseen import Unseen
from twinloop.campaign.examination.use import Effort, GainSlope
from twinloop.campaign.history import (
    Cause,
    Experiment,
    Failure,
    Iteration,
    Lesson,
    Planned,
    Progress,
    TestLoop,
    Withdrawal,
)
from twinloop.law.accuracy import ErrorTable, FitTable, StateFit, TestErrors
from twinloop.law.actuation import Actuation, Actuator, HiddenState
from twinloop.law.expressions import Expressions
from twinloop.law.flown import Span
from twinloop.law.law import Law
from twinloop.law.linear.margins import LoopMargins, Margins
from twinloop.law.linear.state_space import Linear
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.law.reports import Computed, Held
from twinloop.planning.proposal import Fared

if TYPE_CHECKING:
    from twinloop.faces.figures.plots import Plots

__all__ = [
    "Actuation",
    "Actuator",
    "Advice",
    "Beside",
    "Cause",
    "Certificate",
    "Check",
    "Checks",
    "ClosedCurves",
    "Column",
    "Computed",
    "CorrelatedDisturbance",
    "Correlations",
    "Cost",
    "DataQuality",
    "Effort",
    "Ending",
    "ErrorMap",
    "ErrorTable",
    "Examination",
    "Experiment",
    "Expressions",
    "Failure",
    "Fared",
    "FitTable",
    "Flights",
    "Frequency",
    "GainSlope",
    "Held",
    "HiddenState",
    "HoldBack",
    "Iteration",
    "Law",
    "Lesson",
    "Linear",
    "LogCheck",
    "LoopCurves",
    "LoopMargins",
    "Margins",
    "Miss",
    "Model",
    "ModelSearch",
    "Noise",
    "Planned",
    "Plots",
    "Pole",
    "Program",
    "Progress",
    "Quality",
    "Responses",
    "SelectedTests",
    "Span",
    "StateFit",
    "StepAnswer",
    "Task",
    "TestErrors",
    "TestLoop",
    "Unseen",
    "Use",
    "Withdrawal",
]


def __getattr__(name: str) -> object:
    """What draws campaigns, which is loaded when it is asked for."""
    if name != "Plots":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from twinloop.faces.figures.plots import Plots

    return Plots

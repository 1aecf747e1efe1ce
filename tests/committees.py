"""A small committee on a motor with an inertia, the gains that it judges, and a planner for it."""

import numpy as np

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.campaign.presets import options_of
from twinloop.planning.judging import Committee, Task
from twinloop.planning.planner import Planner
from twinloop.planning.quality import quality_of

STEPS = 40
MOTORS = ((1.0, 0.3), (0.9, 0.3), (1.15, 0.3))
"""Gain and damping of each member."""
TASK = Task(np.array([0.5, 0.0]), np.array([0.0, 0.0]), STEPS)


def signals(envelope=(-1.2, 1.2), rate=None, bounds=(-2.0, 2.0)):
    return tl.Signals(
        [
            tl.State("angle", "rad", 1.0, envelope=envelope),
            tl.State("rate", "rad/s", 3.0, derivative_of="angle", envelope=rate),
        ],
        [tl.Command("torque", "N m", bounds, scale=1.0)],
        0.05,
    )


def family_of(known):
    return tl.controllers.PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.1, 9.0, "log"), "angle.ki": (0.0, 2.0), "angle.kd": (0.05, 3.0, "log")},
    ).bind(known)


def member(known, gain, damping=0.3):
    """rate' = gain · torque − damping · rate."""
    lines = [f"r3 = r2 * {gain!r}", f"r4 = r1 * {-damping!r}", "r3 = r3 + r4"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 5, [lines])), "acceleration", known.engine)


def planner_of(known, **changes):
    options = options_of("default", {"candidates": 48, "evaluations": 256, "draws": 3, **changes})
    return Planner(
        family_of(known), TASK, quality_of("iae", known), options,
        limits=Limits(known), seed=5, workers=_core.Workers(),
    )  # fmt: skip


def committee_of(known):
    members = [member(known, *motor) for motor in MOTORS]
    return Committee(members, np.array([1e-3, 5e-3]), True)


TUNED = np.array([4.0, 0.1, 2.0])
"""Gains that hold the motor well."""

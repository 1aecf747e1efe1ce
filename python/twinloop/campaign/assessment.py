"""What a campaign's twin leaves of its flights, which controller flies, and what another experiment would bring."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.campaign.history import Cause, Experiment, Iteration, Lesson
from twinloop.campaign.presets import Options
from twinloop.campaign.setup import Setup
from twinloop.errors import NotAvailable
from twinloop.identification.sensors.noise import exact
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign

REPEATS = 32
"""Flights on the twin from which the scatter of a measurement is taken."""


@dataclass(frozen=True)
class Advice:
    """The expected benefit of another experiment, as the committee estimates it, beside the scatter of one flight.

    Args:
        before_test: number of the test that was planned last; the estimate is of that time. None: there is no such
            test.
        trusted: whether the twin followed its runs at that time and does now, nothing serious is said against it, and
            commands act in it; if not, there is no advice.
        gain: improvement of the quality if it were known which model is right, and gains that are held back could be
            flown; None without a committee.
        share: `gain` over the quality of the controller to fly; None if either is unknown.
        scatter: standard deviation of the quality of a repeated flight, by sensors' noise alone; None: it is unknown.
        stop: whether the gain is below the scatter, so that for the controller another experiment does not pay. None
            if this is unknown.
    """

    before_test: int | None
    trusted: bool
    gain: float | None
    share: float | None
    scatter: float | None
    stop: bool | None


def advice(twin: Twin, setup: Setup, lessons: Sequence[Lesson], best: Test | None) -> Advice:
    """What another experiment would bring.

    Args:
        twin: of the campaign.
        setup: of the campaign.
        lessons: of its identifications, with what was planned after each.
        best: the controller to fly, if there is any.
    """
    judged = [
        (plan, lesson)
        for lesson in lessons
        for plan in lesson.asked
        if plan.predicted is not None and math.isfinite(plan.predicted)
    ]
    gain = judged[-1][0].gain if judged else None
    # A model that does not follow its own runs, then or now, that is not to be believed, or in which all gains are as
    # good, can advise nobody.
    believed = lessons[-1].follows and not any(remark.serious for remark in lessons[-1].remarks)
    trusted = bool(judged) and judged[-1][1].follows and believed and twin.law.commanded
    scatter = None if best is None else _scatter(twin, setup, best)
    quality = None if best is None else best.predicted if best.measured is None else best.measured
    known = gain is not None and quality is not None and math.isfinite(quality) and quality > 0.0
    return Advice(
        before_test=judged[-1][0].test if judged else None,
        trusted=trusted,
        gain=gain,
        share=gain / quality if known else None,  # type: ignore[operator]
        scatter=scatter,
        stop=None if gain is None or scatter is None or not trusted else gain <= scatter,
    )


def predicted_quality(best: Test, experiments: Sequence[Experiment]) -> tuple[float | None, float | None]:
    """The quality that was predicted of a controller, and its spread.

    Where its flight was predicted, that is what was said before it: what a twin makes of a flight that it has learnt is
    no prediction. Elsewhere it is what the twin says now.

    Args:
        best: test of the controller.
        experiments: in the order of `tell`.

    Returns:
        Both; None where nobody knows.
    """
    for run in reversed(experiments):
        test = run.test
        flown = test is not None and test.number == best.number and best.measured is not None
        if test is not None and flown and test.predicted is not None:
            return test.predicted, test.spread
    return best.predicted, best.spread


@dataclass(frozen=True)
class Disturbance:
    """What moves a state beside the commands; standard deviations.

    Args:
        name: of the state.
        unit: of the state.
        white: what is added in a period, in its unit; 0: nothing that is felt.
        correlated: what is added in a second by one that is forgotten slowly, in its unit; 0: nothing that is felt.
        correlation_time: after which that is forgotten to 1/e, s.
        cause: of the correlated one: "disturbance"; "law", a model error, which comes again at the same times in
            flight after flight; or "undecided", where flights so far do not tell. None where there is none.
    """

    name: str
    unit: str
    white: float
    correlated: float
    correlation_time: float
    cause: Cause | None = None


def disturbances(twin: Twin, lesson: Lesson) -> tuple[Disturbance, ...]:
    """What moves the states beside the commands, where it is felt at all.

    Args:
        twin: of the campaign.
        lesson: the last one.

    Returns:
        One a state; none for exact readings: their noise was held at the least that is believed.
    """
    if twin.noise is None or exact(lesson.misfit):
        return ()
    slow = {each.states[0]: (each.sd, each.correlation_time) for each in twin.noise.correlated}
    found = []
    for i, (state, white) in enumerate(zip(twin.signals.states, twin.noise.moves.tolist(), strict=True)):
        size, time = slow.get(i, (0.0, 0.0))
        # Far below the sensor's noise, estimated beside it, within its correlation time it cannot be told from nothing.
        least = 0.01 * lesson.sensors[i]
        white = white if white > least else 0.0
        size = size if size * max(time, twin.signals.dt) > least else 0.0
        if white or size:
            cause = lesson.cause(state.name) if size else None
            found.append(Disturbance(state.name, state.unit, white, size, time, cause))
    return tuple(found)


def rmse(twin: Twin, experiments: Sequence[Experiment]) -> Floats:
    """Root mean square of flown minus simulated over all flights, each from where it began.

    Args:
        twin: to be compared with them.
        experiments: at least one.

    Returns:
        One a state (n_x,), in its unit.
    """
    squares, rows = np.zeros(twin.signals.n_x), 0
    for run in experiments:
        test = twin.as_flown(run.replayed, run.trajectory)
        # Without the committee's band, which `twin.simulate` would draw for each flight.
        simulated = fly(twin.model, test, limits=twin.limits).states[1:]
        flown = run.trajectory.states[1 : len(simulated) + 1]
        squares += np.square(twin.signals.difference(flown, simulated[: len(flown)])).sum(axis=0)
        rows += len(flown)
    return np.asarray(np.sqrt(squares / max(1, rows)), dtype=np.float64)


def foreseen(campaign: Campaign, test: Test) -> Trajectory | None:
    """The run that the twin of today predicts of a test, with its band; None before there is any run.

    Args:
        campaign: that asked for it.
        test: to be flown.
    """
    return campaign.twin.simulate(test) if campaign.experiments else None


def latest_lesson(campaign: Campaign) -> Lesson | None:
    """The record of the last identification; None where the preset identifies nothing, or nothing is learnt yet.

    Args:
        campaign: with or without runs.
    """
    last = campaign.history[-1] if campaign.history else None
    return last if isinstance(last, Lesson) else None


def learnt(campaign: Campaign) -> int:
    """How many of its experiments a campaign has learnt; they are the first ones.

    Args:
        campaign: to look at.
    """
    return len(campaign.history[-1].tests) if campaign.history else 0


def behind(campaign: Campaign) -> bool:
    """Whether what was learnt last was interrupted, or is not of all runs.

    Args:
        campaign: that has learnt something.
    """
    last, options = campaign.history[-1], campaign.options
    running = (
        isinstance(last, Iteration)
        and isinstance(options, Options)
        and last.generations < options.model_generations
    )
    return running or len(last.tests) < len(campaign.experiments)


def expected_quality(twin: Twin, setup: Setup, test: Test) -> float | None:
    """Quality that a twin expects to be measured of a flight, under the sensors' noise.

    Args:
        twin: that flies it.
        setup: of the campaign.
        test: to be flown.

    Returns:
        The mean; None if a flight diverges.
    """
    values = _repeated(twin, setup, test, gusts=False)
    return None if np.isnan(values).any() else float(np.mean(values))


def _scatter(twin: Twin, setup: Setup, best: Test) -> float | None:
    """Standard deviation of the quality that would be measured if the same flight were repeated, on the twin."""
    values = [value for value in _repeated(twin, setup, best, gusts=True) if not math.isnan(value)]
    return float(np.std(values)) if len(values) > 1 else None


def _repeated(twin: Twin, setup: Setup, test: Test, gusts: bool) -> list[float]:
    """Qualities that would be measured if a flight were repeated, on the twin; NaN for one that diverges."""
    draws: list[tuple[Floats | None, Floats | None]] = [(None, None)]
    if twin.noise is not None:
        stream = Unit(setup.seed).part(0).stream("repeats")
        noise, moves = twin.noise.drawn(REPEATS, test.steps, stream, twin.law.reports)
        draws = [(seen, moved if gusts else None) for seen, moved in zip(noise, moves, strict=True)]
    values = []
    for seen, moved in draws:
        run = fly(twin.model, test, noise=seen, disturbance=moved, limits=twin.limits)
        lasted = run.steps == test.steps
        values.append(setup.quality.flown(run, test.target_state) if lasted else math.nan)
    return values


def controller_to_fly(campaign: Campaign) -> tuple[Test | None, str]:
    """The best test of a campaign, if there is any, and why there is none.

    Args:
        campaign: with at least one experiment.
    """
    try:
        return campaign.best_test, ""
    except NotAvailable as reason:
        return None, str(reason)


def number_of(campaign: Campaign, best: Test) -> int | None:
    """The number of the test with the gains of a controller; None where they were tuned, and no test was made of them.

    Args:
        campaign: of the controller.
        best: its `best_test`, which has the number of a test to come where there is none yet.
    """
    made = campaign.tests[best.number : best.number + 1]
    return best.number if made and made[0].genes.tobytes() == best.genes.tobytes() else None

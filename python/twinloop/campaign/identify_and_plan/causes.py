"""Causes: whether what disturbs for long comes from outside, or is what the law is wrong about.

A gust does not know when a flight begins. What a law is wrong about does: flights of one task pass through much the
same states at much the same times. So the disturbances that the twin's observer has estimated are multiplied between
flights, time by time. The sum of the products is compared with the scatter that it has if the flights have nothing to
do with each other, however slowly each of them changes (Bartlett 1935). One flight tells nothing, and neither do two in
which a disturbance changes so slowly that its sign alone decides.

What a law is wrong about is also the same wherever two flights do the same (`neighbours.py`). So may be what commands
have come to withstand; then, and where flights pass nowhere near each other, nobody can tell.

What the past of a flight says is no surprise: where the observer is right, nothing that was read or sent before tells
an error of its next prediction (`foretold.py`), and no gust is told by a free run of the twin.

Nor does a gust know when a system moves, as play and friction do, which are other ones under other gains. So its
size is multiplied in the same way with the speed of the twin's free run, which no gust has touched. What comes at
single moments, far larger than it is otherwise, is rather an impact. And what is small may be the inaccuracy of the law
(`exactness.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Cause, Experiment
from twinloop.campaign.identify_and_plan.exactness import driven, may_be_inexactness, shows
from twinloop.campaign.identify_and_plan.foretold import features_of, foretold, in_scales
from twinloop.campaign.identify_and_plan.likeness import Likeness, in_pieces
from twinloop.campaign.identify_and_plan.neighbours import alike_nearby
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.campaign.replaying import whole
from twinloop.identification.identified import Identified
from twinloop.identification.records import Run
from twinloop.identification.sensors.offsets import moved
from twinloop.identification.sensors.reported import as_sensed
from twinloop.identification.settings import IdentificationOptions
from twinloop.law.flight import drawn_runs
from twinloop.law.reports import reports_of
from twinloop.signals import Signals

Predictions = Sequence[tuple[Floats, Floats, Floats]]
"""Of each run whitened errors and states (n + 1, n_x), and correlated disturbances (n + 1, chains)."""
SURE = 3.0
"""Standard deviations of unrelated flights by which the products of a model error must be larger."""
AT_MOST = 0.5
"""Correlation between flights that something from outside must not have, even if the products are too small by luck."""
BY_LUCK = 2.0
"""Standard deviations of unrelated series by which products may be too small by luck, or too large."""
PEAKED = 4.5
"""Kurtosis from which a disturbance comes at single moments; 3 is that of a normal one."""
LATEST = 12
"""Flights that are compared, the last ones."""


def runs_of(identified: Identified, experiments: Sequence[Experiment], signals: Signals) -> list[Run]:
    """Flights as a twin takes them: with all sensors read at once, and without what is computed of readings.

    Args:
        identified: with the sensors' offsets.
        experiments: that were flown.
        signals: of the system.
    """
    reports = reports_of(identified.model, signals.n_x)
    logged = [
        Run.of(run.trajectory.states, run.trajectory.commands).continued(signals) for run in experiments
    ]
    return moved([as_sensed(run, reports, signals) for run in logged], signals, identified.offsets)


def observed(
    identified: Identified,
    experiments: Sequence[Experiment],
    signals: Signals,
    limits: Limits,
    workers: _core.Workers,
) -> Predictions | None:
    """What the observer of a twin makes of flights; None where the twin diverges under it.

    Args:
        identified: with the twin's model and its chains.
        experiments: at least one.
        signals: of the system.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    runs = runs_of(identified, experiments, signals)
    return _core.predictions(
        identified.model,
        limits.engine,
        [chain.engine for chain in identified.chains],
        [run.engine for run in runs],
        workers=workers,
    )


def causes_of(
    identified: Identified,
    experiments: Sequence[Experiment],
    signals: Signals,
    limits: Limits,
    options: IdentificationOptions,
    workers: _core.Workers,
) -> dict[int, Cause]:
    """Causes of the correlated disturbances of a twin, by the state that each of them drives.

    Args:
        identified: with the twin's model and its chains.
        experiments: that it was learnt from.
        signals: of the system.
        limits: where a run counts as diverged.
        options: of the identification; without causes whatever disturbs is taken to come from outside.
        workers: how the work is carried out.
    """
    disturbed = {
        chain.states[0]: place
        for place, chain in enumerate(identified.chains)
        if chain.motion.correlated > 0.0
    }
    if not options.causes:
        return dict.fromkeys(disturbed, "disturbance")
    flights = [run for run in distinct(experiments) if run.test is not None][-LATEST:]
    found = (
        observed(identified, flights, signals, limits, workers) if disturbed and len(flights) > 1 else None
    )
    if found is None:
        return dict.fromkeys(disturbed, "undecided")
    seen = [
        _Seen(run, errors, gusts, alone(identified.members[0], run, limits, workers))
        for run, (errors, _, gusts) in zip(flights, found, strict=True)
    ]
    drives = driven(identified.model, runs_of(identified, flights, signals), signals)
    causes: dict[int, Cause] = {}
    for state, place in disturbed.items():
        chain = identified.chains[place]
        causes[state] = _cause(seen, state, place, limits)
        if options.exactness and causes[state] == "disturbance":
            missed = [(flight.run.trajectory.states, flight.free[0]) for flight in seen if flight.free]
            if may_be_inexactness(chain, drives) or not shows(missed, chain, limits):
                causes[state] = "undecided"
    return causes


@dataclass(frozen=True, eq=False)
class _Seen:
    """A flight as the twin's observer has seen it, and as the twin flies it by itself.

    Args:
        run: the flight.
        errors: whitened errors of predictions (n + 1, n_x).
        gusts: correlated disturbances (n + 1, chains).
        free: states (n + 1, n_x) and commands (n, n_u) of the free run; None where it does not last.
    """

    run: Experiment
    errors: Floats
    gusts: Floats
    free: tuple[Floats, Floats] | None


def _cause(seen: Sequence[_Seen], state: int, place: int, limits: Limits) -> Cause:
    """The cause of what disturbs one chain, as flights tell it: from outside, where nothing speaks against that."""
    by_time = cause(_by_task(seen, place))
    if by_time == "law" or _is_foretold(seen, state, place, limits.signals):
        return "law"
    unsure = (
        by_time == "undecided"
        or comes_at_moments([flight.gusts[1:, place] for flight in seen])
        or acts_in_motion(_sizes_and_speeds(seen, place, limits))
        or not foreign(_nearby(seen, place, limits.signals))
    )
    return "undecided" if unsure else "disturbance"


def _by_task(seen: Sequence[_Seen], place: int) -> list[list[Floats]]:
    """Of each task, what disturbs one chain in each of its flights."""
    tasks: dict[bytes, list[Floats]] = {}
    for flight in seen:
        assert flight.run.test is not None
        tasks.setdefault(flight.run.test.target_state.tobytes(), []).append(flight.gusts[:, place])
    return list(tasks.values())


def _is_foretold(seen: Sequence[_Seen], state: int, place: int, signals: Signals) -> bool:
    """Whether a function of what was read and sent foretells errors of predictions, or one of free runs the gusts."""
    past = [
        (
            features_of(flight.run.trajectory.states, flight.run.trajectory.commands, signals),
            flight.errors[1:, state],
        )
        for flight in seen
    ]
    if foretold(past).beyond_luck(SURE):
        return True
    frees = [
        (features_of(*flight.free, signals), flight.gusts[1:, place])
        for flight in seen
        if flight.free is not None
    ]
    return foretold(frees).certain(SURE)


def _nearby(seen: Sequence[_Seen], place: int, signals: Signals) -> Likeness:
    """How alike what disturbs one chain is where flights are in the same states under the same commands."""
    return alike_nearby(
        [
            (
                in_scales(flight.run.trajectory.states, flight.run.trajectory.commands, signals),
                flight.gusts[1:, place],
            )
            for flight in seen
        ]
    )


def _sizes_and_speeds(seen: Sequence[_Seen], place: int, limits: Limits) -> list[tuple[Floats, Floats]]:
    """Of each flight how large what disturbs one chain is, and how fast the twin moves by itself."""
    return [
        (np.abs(flight.gusts[1:, place]), speed(flight.free[0], limits))
        for flight in seen
        if flight.free is not None
    ]


def cause(tasks: Sequence[Sequence[Floats]]) -> Cause:
    """The cause of what disturbs: whether its series resemble each other, time by time, more than unrelated ones do.

    Args:
        tasks: of each task a series for each of its flights; of two flights the longer one is cut.
    """
    alike = Likeness.of(pair for series in tasks for pair in combinations(series, 2))
    if alike.certain(SURE):
        return "law"
    return "disturbance" if foreign(alike) else "undecided"


def foreign(alike: Likeness) -> bool:
    """Whether series are certainly not what they would be if a law were wrong about them.

    Args:
        alike: how alike they are.
    """
    return alike.product + BY_LUCK * alike.by_luck < AT_MOST * alike.size


def comes_at_moments(flights: Sequence[Floats]) -> bool:
    """Whether a disturbance is far larger at single moments than it is otherwise, as an impact is.

    Args:
        flights: of each what disturbs it (n,).
    """
    series = np.concatenate([in_pieces(disturbed) for disturbed in flights])
    return is_peaked(series - series.mean(), PEAKED)


def is_peaked(series: Floats, most: float) -> bool:
    """Whether a series (n,) about 0 has few large values among small ones: a kurtosis of more than a given one.

    Args:
        series: about 0.
        most: kurtosis; 3 is that of normal values.
    """
    squares = np.square(series)
    mean = float(squares.mean())
    return bool(np.square(squares).mean() > most * (mean * mean))


def acts_in_motion(flights: Sequence[tuple[Floats, Floats]]) -> bool:
    """Whether what disturbs is the larger the faster a system moves.

    Args:
        flights: of each, how large the disturbance is and how fast the system, at the same times.
    """
    return Likeness.of((size - size.mean(), fast - fast.mean()) for size, fast in flights).certain(BY_LUCK)


def alone(
    model: _core.Model, flight: Experiment, limits: Limits, workers: _core.Workers
) -> tuple[Floats, Floats] | None:
    """States (n + 1, n_x) and commands (n, n_u) of a model flown by itself; None where it lasts less than the flight.

    Args:
        model: that is flown.
        flight: from where, and under which controller or commands.
        limits: where a run counts as diverged.
        workers: how the work is carried out.
    """
    steps = flight.trajectory.steps
    flown = whole(model, flight, limits, workers)
    runs = drawn_runs(model, flown, limits, workers=workers)
    return None if int(runs.lasted[0]) < steps else (np.asarray(runs.read[0]), np.asarray(runs.commands[0]))


def speed(states: Floats, limits: Limits) -> Floats:
    """How fast states (n + 1, n_x) move in each period, over all of them in units of their mean (n,).

    Returns:
        Root mean squares.
    """
    moved = np.square(limits.signals.difference(states[1:], states[:-1]))
    most = moved.mean(axis=0)
    return np.asarray(np.sqrt((moved / np.where(most > 0.0, most, 1.0)).sum(axis=1)))

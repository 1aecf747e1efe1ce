"""What speaks against the data or the twin as a whole: units, signs, records told twice, runs that were cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.history import Experiment
from twinloop.campaign.identify_and_plan.misses import Miss
from twinloop.campaign.identify_and_plan.readings import suspicious
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

MOVED = 20.0
"""Standard deviations of its noise that a state must have moved before it is held against its derivative."""
BENT = 5.0
"""The same about a line, which is all that a biased rate adds."""
WALKED = 3.0
"""Standard deviations of the random walk, which noise becomes when a rate is integrated, that this must have moved."""
AS_FAST = (0.5, 2.0)
"""Times as fast as its derivative says, between which a state is taken to do what was declared."""
ALIKE = 0.5
"""Correlation with its integrated derivative below which a state is taken to do something else."""
NAMED = 3
"""States that are named of those that a free run misses, those that it misses most."""


def diagnostics_of(
    experiments: Sequence[Experiment],
    signals: Signals,
    follows: bool,
    steps: int,
    misses: Sequence[Miss] = (),
    others: Sequence[int] = (),
    recurring: Sequence[str] = (),
    unmoved: Sequence[str] = (),
    without_test: bool = False,
    pieces: Sequence[int] = (),
) -> list[Remark]:
    """What speaks against the data or the twin.

    Args:
        experiments: that were learnt from.
        signals: of the system.
        follows: whether the twin follows them when it is flown by itself.
        steps: of a whole run.
        misses: states that its free runs miss by more than noise and known disturbances explain.
        others: numbers of the tests whose recorded commands are none that their controllers give.
        recurring: states whose disturbance comes again in flight after flight.
        unmoved: states that move though their equations say that nothing moves them.
        without_test: whether the flights that it does not follow are all without a test, replayed without a controller.
        pieces: steps of those in which each experiment is followed; empty: all in whole.

    Returns:
        Remarks, none where nothing does.
    """
    recorded = [run.trajectory for run in experiments]
    said = [
        *against_derivatives(recorded, signals),
        *suspicious(recorded, signals),
        *from_other_controllers(others),
        *_unmoved(unmoved),
    ]
    said += _in_pieces(experiments, pieces, signals.dt)
    if not follows:
        said += _does_not_follow(any(remark.serious for remark in said), without_test)
    elif misses:
        said += _free_run(misses, len(experiments), signals)
    return [*said, *_model_error(recurring), *_copies(experiments), *_none_complete(experiments, steps)]


def from_other_controllers(tests: Sequence[int]) -> Iterator[Remark]:
    """Tests whose recorded commands are none that their controllers give.

    Args:
        tests: their numbers.
    """
    if tests:
        yield serious(
            "other-commands",
            f"The commands recorded of test{'s' if len(tests) > 1 else ''} {', '.join(map(str, tests))} are"
            " none that its controller gives for the recorded states: check the signs, units and order of states"
            " and commands, and that the recorded controller is the one that the test names.",
        )


def _unmoved(states: Sequence[str]) -> Iterator[Remark]:
    """States that move though their equations say that nothing moves them."""
    if states:
        yield serious(
            "unmoved",
            f"In the twin nothing drives {', '.join(states)}, but the flights show motion that the"
            " controller reacts to: disturbances hide the effect of the commands. Gains for it cannot be tuned yet.",
        )


def _does_not_follow(explained: bool, without_test: bool) -> Iterator[Remark]:
    """That the twin does not follow its own flights, and why, where no remark before has explained it."""
    if explained:
        cause = "the remarks before this one say why"
    elif without_test:
        cause = (
            "those that it leaves have no test, so their recorded commands are replayed and no controller corrects the"
            " twin. It leaves them even as far as a right model of its stability could be followed. There is an effect"
            " that no term describes, or the logs show too little motion beside the sensors' noise: log larger"
            " motions, or begin a campaign without these logs"
        )
    else:
        cause = (
            "there is an effect that no term describes, such as a contact, backlash, stiction or"
            " an unmeasured state; the records show no wrong sign or unit"
        )
    yield serious(
        "does-not-follow",
        f"In free run the twin does not follow the runs that it was learnt from: {cause}.",
    )


def _in_pieces(experiments: Sequence[Experiment], pieces: Sequence[int], dt: float) -> Iterator[Remark]:
    """That flights without a test were followed in pieces, and in which."""
    short = [
        length
        for run, length in zip(experiments, pieces, strict=bool(pieces))
        if length < run.trajectory.steps
    ]
    if short:
        least, most = (f"{length * dt:.2g}" for length in (min(short), max(short)))
        yield note(
            "in-pieces",
            f"{len(short)} of the runs without a test {'was' if len(short) == 1 else 'were'} followed in pieces of"
            f" {least if least == most else f'{least} to {most}'} s, each begun at its own reading: without its"
            " controller the system is unstable, so no model could be followed for longer under recorded commands.",
        )


def _model_error(states: Sequence[str]) -> Iterator[Remark]:
    """States whose disturbance comes again in flight after flight."""
    if states:
        yield note(
            "model-error",
            f"The disturbance of {', '.join(states)} recurs at the same times in each flight. So it"
            " is a model error, not a disturbance: a term is missing there.",
        )


def _copies(experiments: Sequence[Experiment]) -> Iterator[Remark]:
    """Records that equal earlier ones."""
    copies = len(experiments) - len(distinct(experiments))
    if copies:
        yield note(
            "copies",
            f"{copies} of {len(experiments)} records are exact copies of an earlier one: each was used once.",
        )


def _none_complete(experiments: Sequence[Experiment], steps: int) -> Iterator[Remark]:
    """That no run was complete."""
    if not any(run.complete for run in experiments):
        longest = max(run.trajectory.steps for run in experiments)
        yield serious(
            "none-complete",
            f"No run was complete, the longest had {longest} of {steps} steps. Nothing is known of"
            " later times.",
        )


def _free_run(misses: Sequence[Miss], runs: int, signals: Signals) -> Iterator[Remark]:
    """Which states the twin misses when it is flown by itself, on how many runs, and by how much."""
    worst = sorted(misses, key=lambda miss: (not miss.diverges, -miss.times))
    if worst[0].diverges:
        what = f"diverges on {max(miss.flights for miss in worst if miss.diverges)}"
    else:
        named = [
            f"{signals.state_names[miss.state]} on {miss.flights} (up to {100.0 * miss.share:.2g} % of its range,"
            f" {miss.times:.2g} times what noise and disturbances explain)"
            for miss in worst[:NAMED]
        ]
        others = [f"and {len(worst) - NAMED} more"] if len(worst) > NAMED else []
        what = f"deviates more than noise and known disturbances explain: {', '.join([*named, *others])}"
    why = (
        "The cause may be an external disturbance or a model error; flights with other gains would"
        " tell. Until then trust it only to that accuracy."
        if all(miss.undecided for miss in misses)
        else "There is an effect that no term describes. Do not trust the twin outside these flights."
    )
    yield serious(
        "free-run",
        f"In free run over the {runs} run{'s' if runs > 1 else ''} that it was learnt from, the twin {what}. {why}",
    )


def against_derivatives(recorded: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """States that do not change as their declared derivatives say.

    Args:
        recorded: runs, periodic states among them as they were wrapped.
        signals: of the system.
    """
    runs = [Run.of(run.states, run.commands) for run in recorded]
    noise = guessed_noise(runs, np.array([state.scale for state in signals.states]))
    for i, rate in enumerate(signals.states):
        if rate.derivative_of is None:
            continue
        j = signals.state_names.index(rate.derivative_of)
        pairs = [_moved(run.states[:, j], run.states[:, i], signals.dt) for run in runs]
        # Integrated, white noise is a random walk: about its line it has a fifteenth of its last variance.
        walks = sum(float(noise[i]) * (signals.dt * run.steps) ** 2 / 15.0 for run in recorded)
        how = _against(
            [tuple(map(_without_line, pair)) for pair in pairs], BENT**2 * noise[j], WALKED**2 * walks
        )
        if how is None:
            how = _against(pairs, MOVED**2 * noise[j], 0.0)
        if how:
            yield serious(
                "derivative",
                f"{rate.derivative_of} {how} {rate.name}, its declared derivative, says: check their units and signs,"
                " the order of the columns, and what is declared.",
            )


def _against(pairs: Sequence[tuple[Floats, ...]], least: float, least_declared: float) -> str | None:
    """How states contradict what their derivatives say: "" if they do not, None if they moved too little to tell.

    Args:
        pairs: of each run, the state and the same by its derivative.
        least: mean square that the state must have.
        least_declared: sum of squares that its integrated derivative must have.
    """
    moved, declared = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    size, declared_size, product = (
        float(values.sum()) for values in (np.square(moved), np.square(declared), moved * declared)
    )
    if size <= len(moved) * least or declared_size <= least_declared:
        return None
    if product * product < ALIKE * ALIKE * size * declared_size:
        return "does not change as"
    if not AS_FAST[0] * declared_size < product < AS_FAST[1] * declared_size:
        return f"changes {product / declared_size:.3g} times as fast as"
    return ""


def _moved(state: Floats, rate: Floats, dt: float) -> tuple[Floats, Floats]:
    """A state over a run, and the same by its derivative, each less its mean."""
    said = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
    return state - state.mean(), said - said.mean()


def _without_line(values: Floats) -> Floats:
    """Values less their regression on a constant and time (n,)."""
    time = np.arange(len(values)) - 0.5 * (len(values) - 1)
    rest: Floats = values - values.mean()
    return rest - time * (float((time * rest).sum()) / max(float(np.square(time).sum()), 1.0))

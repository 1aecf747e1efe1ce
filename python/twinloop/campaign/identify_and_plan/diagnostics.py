"""What speaks against the data or the twin as a whole: units, signs, records told twice, runs that were cut."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from twinloop._ground.texts import two_digits
from twinloop._ground.times import moment
from twinloop.campaign.data.declared import against_derivatives
from twinloop.campaign.data.odd_one_out import Odd, said_odd
from twinloop.campaign.data.readings import at_rest, suspicious
from twinloop.campaign.data.rows import Shifted
from twinloop.campaign.data.sent import from_other_controllers
from twinloop.campaign.data.wrapped import without_turns
from twinloop.campaign.history import Experiment, called
from twinloop.campaign.identify_and_plan.contradicting import odd_log
from twinloop.campaign.identify_and_plan.elsewhere import NOWHERE, Elsewhere
from twinloop.campaign.identify_and_plan.misses import FREE_RUN, Miss
from twinloop.campaign.identify_and_plan.selection import distinct
from twinloop.campaign.identify_and_plan.track_record import NEARLY, missed_in_a_row
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

MANY = 0.25
"""Share of the drawn controllers under which laws part, above which it is said."""
NAMED = 3
"""States that are named of those that a free run misses, those that it misses most."""


@dataclass(frozen=True)
class Findings:
    """What a twin is beside the flights that it was learnt from.

    Args:
        follows: whether the twin follows them when it is flown by itself.
        misses: states that its free runs miss by more than noise and known disturbances explain.
        others: numbers of the tests whose recorded commands are none that their controllers give.
        late: commands that are recorded in other rows than the readings that they were computed from, which is said
            already.
        recurring: states whose disturbance comes again in flight after flight.
        unanswered: whether commands moved and no state did, which is said already.
        unmoved: states that move though their equations say that nothing moves them.
        without_test: whether the flights that it does not follow are all without a test, replayed without a controller.
        pieces: steps of those in which each flight is followed; empty: all in whole.
        disturbed: states with disturbances that would take free runs of a right twin as far; empty: none would.
        elsewhere: under how many controllers what is learnt is still open.
        explained: whether a law explains the flights.
        odd: the log that contradicts the others, where only a law that was made for it explains them.
    """

    follows: bool
    misses: Sequence[Miss] = ()
    others: Sequence[int] = ()
    late: Sequence[Shifted] = ()
    recurring: tuple[str, ...] = ()
    unanswered: bool = False
    unmoved: Sequence[str] = ()
    without_test: bool = False
    pieces: Sequence[int] = ()
    disturbed: Sequence[str] = ()
    elsewhere: Elsewhere = NOWHERE
    explained: bool = True
    odd: Odd | None = None


def diagnostics_of(
    experiments: Sequence[Experiment], signals: Signals, steps: int, found: Findings
) -> list[Remark]:
    """What speaks against the data or the twin.

    Args:
        experiments: that were learnt from.
        signals: of the system.
        steps: of a whole run.
        found: of the twin.

    Returns:
        Remarks, none where nothing does.
    """
    recorded, wrapped = without_turns(
        [run.trajectory for run in experiments],
        signals,
        lambda k, row: (
            f"in run {k + 1} of {len(experiments)} at {moment(experiments[k].trajectory.t[row], signals.dt)} s"
        ),
    )
    odd = found.odd if found.explained and not found.misses else odd_log(experiments, signals)
    said = [
        *wrapped,
        *said_odd(odd, called(experiments)),
        *against_derivatives(recorded, signals),
        *suspicious(recorded, signals),
        *_nothing_moved(recorded),
        *from_other_controllers(found.others),
        *_unmoved(found.unmoved),
    ]
    said += _in_pieces(experiments, found.pieces, signals.dt)
    if not found.follows:
        explained = found.unanswered or bool(found.late) or any(remark.serious for remark in said)
        said += _does_not_follow(explained, found.without_test, found.disturbed, signals)
    else:
        said += _free_run(found.misses, called(experiments), signals) if found.misses else ()
        said += _elsewhere(found.elsewhere)
    said += [*_model_error(found.recurring), *_copies(experiments), *_none_complete(experiments, steps)]
    return [*said, *_missed_predictions(experiments)]


def _nothing_moved(recorded: Sequence[Trajectory]) -> Iterator[Remark]:
    """That all runs are of a system at rest: what stays where it is follows them, and is no twin of anything."""
    if all(map(at_rest, recorded)):
        which = "the run" if len(recorded) == 1 else f"any of the {len(recorded)} runs"
        yield serious(
            "nothing-moved",
            f"Neither readings nor commands move in {which}: nothing can be learnt. Check that the log is of a run, and"
            " record one in which the commands move.",
        )


def _unmoved(states: Sequence[str]) -> Iterator[Remark]:
    """States that move though their equations say that nothing moves them."""
    if states:
        yield serious(
            "unmoved",
            f"In the twin nothing drives {', '.join(states)}, but the flights show motion that the"
            " controller reacts to: disturbances hide the effect of the commands. Gains for it cannot be tuned yet.",
        )


def _outputs_alone(signals: Signals) -> str:
    """What to do where a law of all states is none, and nothing says how fast any of them changes; empty elsewhere."""
    if len(signals.without_rates) < signals.n_x:
        return ""
    return (
        f" No rate of {', '.join(signals.state_names)} is logged: log what else moves, such as a content that fills, or"
        " declare lags=1 in the signals, which makes rates of past readings."
    )


def _does_not_follow(
    explained: bool, without_test: bool, disturbed: Sequence[str], signals: Signals
) -> Iterator[Remark]:
    """That the twin does not follow its own flights, and why, where no remark before has explained it."""
    replayed = (
        "those that it leaves have no test, so their recorded commands are replayed, and no controller corrects the"
        " twin"
    )
    if explained:
        cause = "the remarks before this one say why"
    elif without_test and disturbed:
        cause = (
            f"{replayed}. What seems to disturb {', '.join(disturbed)} would take a replay of the right law as far."
            " So these logs cannot tell wind, for example, from a model error. Fly a test of a campaign: under its"
            " controller a right twin follows. Or log calmer conditions, or larger motions"
        )
    elif without_test:
        cause = (
            f"{replayed}. It leaves them even as far as a right model of its stability could be followed. There is an"
            " effect that no term describes, or the logs show too little motion beside the sensors' noise: log larger"
            " motions, or begin a campaign without these logs"
        )
    else:
        cause = (
            "there is an effect that no term describes, such as a contact, backlash, stiction or an unmeasured state;"
            " or the records have a fault that their checks do not show"
        )
    more = "" if explained else _outputs_alone(signals)
    yield serious(
        "does-not-follow",
        f"In free run the twin does not follow the runs that it was learnt from: {cause}.{more}",
    )


def _elsewhere(found: Elsewhere) -> Iterator[Remark]:
    """Under how many controllers laws part that follow the flights equally well, the law changes, or none lasts."""
    whats = [
        (found.apart, "laws of the committee differ"),
        (found.changed, "the law differs from that of before the last flight"),
    ]
    parted = [f"under {count} {what}" for count, what in whats if count > MANY * found.drawn]
    said = []
    if found.lost > MANY * found.all_drawn:
        said.append(
            f"Under {found.lost} of {found.all_drawn} controllers drawn from the whole box of gains all laws that are"
            " known diverge: the system does, too, or they are wrong there."
        )
    if parted:
        of = (
            f"the other {found.drawn}"
            if said
            else f"{found.drawn} controllers drawn from the whole box of gains"
        )
        said.append(
            f"Of {of}, {' and '.join(parted)} by more than a fifth of the motion, or only one of two diverges."
        )
    if said:
        trust = "The flights so far do not tell what such gains do: trust the twin near the gains that flew."
        yield note("elsewhere", " ".join([*said, trust]))


def _in_pieces(experiments: Sequence[Experiment], pieces: Sequence[int], dt: float) -> Iterator[Remark]:
    """That flights without a test were followed in pieces, and in which."""
    short = [
        length
        for run, length in zip(experiments, pieces, strict=bool(pieces))
        if length < run.trajectory.steps
    ]
    if short:
        least, most = (two_digits(length * dt) for length in (min(short), max(short)))
        yield note(
            "in-pieces",
            f"{len(short)} of the runs without a test {'was' if len(short) == 1 else 'were'} followed in pieces of"
            f" {least if least == most else f'{least} to {most}'} s, each begun at its own reading: under recorded"
            " commands no controller corrects what noise and disturbances do, so no model could be followed for"
            " longer.",
        )


def _model_error(states: Sequence[str]) -> Iterator[Remark]:
    """States whose disturbance comes again in flight after flight."""
    if states:
        yield note(
            "model-error",
            f"The disturbance of {', '.join(states)} recurs at the same times in each flight. So it"
            " is a model error, not a disturbance: a term is missing there, or a constant is wrong.",
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


def _missed_predictions(experiments: Sequence[Experiment]) -> Iterator[Remark]:
    """That two predictions in a row missed to the same side: a note where they did so by less than matters."""
    missed = missed_in_a_row(experiments)
    if missed:
        how = "worse" if missed[-1].measured > missed[-1].predicted else "better"
        each = " and ".join(
            f"test {found.test} ({found.predicted:.4g} ± {two_digits(found.spread)} predicted,"
            f" {found.measured:.4g} measured)"
            for found in missed
        )
        yield (serious if missed_in_a_row(experiments, NEARLY) else note)(
            "missed-predictions",
            f"Two flights in a row came out {how} than predicted, by more than two spreads: {each}. The twin is"
            " too sure of qualities: trust neither a predicted one nor its spread until a prediction has come true.",
        )


def _of_range(share: float) -> str:
    """How far a state is missed, beside how far it went: two digits of a share of 1 or more are no percentage."""
    if not math.isfinite(share):
        return "though it stood still"
    return (
        f"up to {two_digits(100.0 * share)} % of its range"
        if share < 0.995
        else f"up to {two_digits(share)} times its range"
    )


def _on(places: Sequence[int], names: Sequence[str], most: str = "most on") -> str:
    """On which runs, the worst first."""
    worst = names[places[0]]
    return worst if len(places) == 1 else f"{len(places)} of them, {most} {worst}"


def _free_run(misses: Sequence[Miss], names: Sequence[str], signals: Signals) -> Iterator[Remark]:
    """Which states the twin misses when it is flown by itself, on which runs, and by how much."""
    runs = len(names)
    worst = sorted(misses, key=lambda miss: (not miss.diverges, -miss.times))
    if worst[0].diverges:
        lost = max((miss.flights for miss in worst if miss.diverges), key=len)
        what = f"diverges on {_on(lost, names, 'such as')}"
    else:
        named = [
            f"{signals.state_names[miss.state]} on {_on(miss.flights, names)} ({_of_range(miss.share)},"
            f" {two_digits(miss.times)} times what noise and disturbances explain)"
            for miss in worst[:NAMED]
        ]
        others = [f"and {len(worst) - NAMED} more"] if len(worst) > NAMED else []
        what = f"deviates more than noise and known disturbances explain: {', '.join([*named, *others])}"
    why = (
        "The cause may be an external disturbance or a model error; flights with other gains would"
        " tell. Until then trust it only to that accuracy."
        if all(miss.undecided for miss in misses)
        else "There is an effect that no term describes. Do not trust the twin outside these flights."
        + _outputs_alone(signals)
    )
    yield serious(
        FREE_RUN,
        f"In free run over the {runs} run{'s' if runs > 1 else ''} so far, the twin {what}. {why}",
    )

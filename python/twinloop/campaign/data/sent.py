"""Sent: the commands on record, beside those that the controller gives for the recorded states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations, product

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.data.excited import (
    NEARER,
    Excited,
    apart,
    as_excited,
    excited,
    given,
    hidden,
    hows,
    span_of,
)
from twinloop.campaign.data.righted import (
    LITTLE,
    Change,
    begun_later,
    crossed,
    exchanged_states,
    nearest,
    other_signs,
    other_units,
    with_state,
)
from twinloop.campaign.data.rows import late_commands
from twinloop.campaign.history import Experiment
from twinloop.remarks import Remark, note, serious
from twinloop.test import Test
from twinloop.trajectory import Trajectory

OTHER = 0.5
"""Share of what a command does, or all do on average, that may differ from what their controller gives, squared."""
LEVELS = 5
"""Values that commands have at most that are sent in pulses."""
EXCHANGED = 20.0
"""Times nearer to the controller's that two commands are once exchanged, in squares, where that was the fault."""
PULSES = 2.0
"""Times the span of a command that pulses may be behind or ahead of it."""


def other_commands(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose recorded commands have little to do with those of their controllers.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if not pulsed]


def in_pulses(experiments: Sequence[Experiment]) -> list[int]:
    """Numbers of the tests whose commands were sent in pulses, as a relay sends them: right in their sum alone.

    Args:
        experiments: that were learnt from; controllers are run on the readings.
    """
    return [number for number, pulsed in _unlike(experiments).items() if pulsed]


def exchanged(run: Experiment) -> tuple[int, int] | None:
    """Two commands that are those of the test's controller once their columns are exchanged; None where no two are.

    Args:
        run: of a test.
    """
    return None if run.test is None else _exchanged(*sent_and_asked(run.test, run.trajectory), run.test)


def change_that_rights(run: Experiment) -> str:
    """What of a log has to be changed so that its commands are those of the test's controller.

    Of exchanged columns, signs, units and first rows that explain the commands it is the one that does so best.

    Args:
        run: of a test.

    Returns:
        Such as "temp and level exchanged"; empty where no such change explains them.
    """
    if run.test is None:
        return ""
    test, flight = run.test, run.trajectory
    kinds = (crossed, exchanged_states, other_signs, other_units, begun_later)
    words = nearest(test, flight, chain.from_iterable(kind(test, flight) for kind in kinds))
    if words:
        return words
    # Where something else is wrong, too, two commands may still be nearer to their own.
    pair = exchanged(run)
    return "" if pair is None else f"{' and '.join(test.signals.command_names[i] for i in pair)} exchanged"


def from_other_controllers(tests: Sequence[int], change: str = "") -> Iterator[Remark]:
    """Tests whose recorded commands are none that their controllers give.

    Args:
        tests: their numbers.
        change: of a log's columns with which they would be, in words; empty: none is known.
    """
    if tests:
        hint = f" They would be with {change}." if change else ""
        yield serious(
            "other-commands",
            f"The commands recorded of test{'s' if len(tests) > 1 else ''} {', '.join(map(str, tests))} are"
            " none that its controller gives for the recorded states: check the signs, units and order of states"
            f" and commands, and that the controller that flew is the one that the test names, with its target.{hint}",
        )


def from_another_excitation(test: Test, run: Trajectory) -> Iterator[Remark]:
    """That the excitation of a test was left out, not held back, doubled or subtracted, by the recorded commands.

    Args:
        test: as it was asked for.
        run: that was recorded of it.
    """
    how, subject = excited(test, run), f"The excitation of test {test.number}"
    if how is Excited.NOT and hidden(test, run):
        yield note(
            "excitation",
            f"Nothing is seen of the excitation of test {test.number}: the commands were at their bounds where it was"
            " added. This flight tells less; a target that needs smaller commands leaves room for it.",
        )
    elif how is Excited.NOT:
        yield note(
            "excitation",
            f"{subject} was not added to the commands: this flight tells less. The test sheet says"
            " where it is and how to add it.",
        )
    elif how is Excited.WHOLE:
        yield serious(
            "excitation",
            f"{subject} was flown without holding it back: such a flight may lead further than its"
            " sheet says. Scale it by the readings, as the sheet tells; for a program that cannot do this, set"
            " hold_back = false under [options] and begin a new campaign: then the excitation stays small.",
        )
    elif how is Excited.TWICE:
        yield serious(
            "excitation",
            f"{subject} was flown twice as strong: such a flight may lead further than its sheet"
            " says. The commands of test.controller() have it already: send them as they are.",
        )
    elif how is Excited.NEGATED:
        yield note(
            "excitation",
            f"{subject} was subtracted from the commands instead of added: check the sign with which your program adds"
            " it, and the signs of the commands.",
        )


def _exchanged(sent: Floats, asked: Floats, test: Test) -> tuple[int, int] | None:
    before = apart(sent, asked, test)
    for first, second in combinations(range(sent.shape[1]), 2):
        pair = [first, second]
        crossed = sent.copy()
        crossed[:, pair] = sent[:, pair[::-1]]
        after = apart(crossed, asked, test)[pair]
        if before[pair].min() > max(LITTLE * LITTLE, EXCHANGED * after.max()):
            return first, second
    return None


def _exchanged_with_state(test: Test, run: Trajectory) -> bool:
    """Whether a command is that of the test's controller once its column is exchanged with that of a state."""
    before = apart(*sent_and_asked(test, run), test)
    for j, i in product(np.flatnonzero(before > LITTLE * LITTLE).tolist(), test.signals.measured):
        change = with_state(test, run, i, j)
        asked = [given(as_excited(test, how), change.states) for how in hows(test)]
        # Unlike of two commands, there is one column alone to be held against the controller.
        if NEARER * min(apart(change.commands, each, test)[j] for each in asked) <= before[j]:
            return True
    return False


def _unlike(experiments: Sequence[Experiment]) -> dict[int, bool]:
    """Tests in which what was sent is not what the controller gives, by number: whether it was sent in pulses."""
    found: dict[int, bool] = {}
    for run in experiments:
        if run.test is None or run.test.number in found or any(late_commands(run.test, run.trajectory)):
            continue
        sent, asked = sent_and_asked(run.test, run.trajectory)
        span = span_of(run.test)
        size = np.square((asked - asked.mean(axis=0)) / span).mean(axis=0)
        off = apart(sent, asked, run.test)
        far = (off > OTHER * np.maximum(size, size.mean())) & (off > LITTLE * LITTLE)
        if far.any():
            found[run.test.number] = _pulses(sent[:, far], asked[:, far], span[far])
        elif (
            _exchanged(sent, asked, run.test) is not None
            or _exchanged_with_state(run.test, run.trajectory)
            or nearest(run.test, run.trajectory, _of_states(run.test, run.trajectory))
        ):
            found[run.test.number] = False
    return found


def _of_states(test: Test, run: Trajectory) -> Iterator[Change]:
    """Changes that may leave commands near to their controller's, and the twin of another system."""
    yield from exchanged_states(test, run)
    yield from other_signs(test, run)


def sent_and_asked(test: Test, run: Trajectory) -> tuple[Floats, Floats]:
    """Commands on record (n, n_u), and those of the controller with its excitation as it was flown.

    An excitation that was left out, or not held back, is another fault, and is said by itself.
    """
    return run.commands, given(as_excited(test, excited(test, run)), run.states)


def _pulses(sent: Floats, asked: Floats, span: Floats) -> bool:
    """Whether few levels were sent, and until any time as much as the controller gives, up to a pulse or two."""
    if any(len(np.unique(command)) > LEVELS for command in sent.T):
        return False
    return bool((np.abs(np.cumsum(sent - asked, axis=0)) <= PULSES * span).all())

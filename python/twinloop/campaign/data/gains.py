"""Gains: with which ones a test was flown, where its recorded commands are those of its law with others.

A controller's commands follow from its readings almost exactly. So gains that a program had wrong can be read off the
record, as long as nothing else may have moved the commands: readings that were later, filtered or less noisy than the
log's, an integral that did not begin at 0, a trim, another excitation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, Integers
from twinloop._ground.elementary import product
from twinloop.campaign.data.excited import Excited, as_excited, given_in_spans, hows, span_of
from twinloop.campaign.data.mistaken import flight_of
from twinloop.controllers import PID, StateFeedback, UnboundFamily
from twinloop.controllers.riccati import solve_linear
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.history import Experiment

LINEAR = (PID, StateFeedback)
"""Families whose commands are linear in their gains, until they are clipped."""
SEEN = 5e-4
"""Share of their bounds by which commands are off at least before other gains are looked for."""
OFF = 0.02
"""The same as a share of what the controller does."""
CLEARLY = 0.04
"""Share of the square that any other cause leaves, below which other gains explain commands clearly better."""
ROUNDED = 1e-6
"""Share of the square by which commands are off below which what a cause leaves of it is rounding."""
SMALL = 0.01
"""Share of the square of what the commands do that they may leave."""
NOISES = 9.0
"""Times what noise of its own would make of the commands, in squares, that these must be off."""
EXACT = 1e-4
"""Share of that below which commands follow from the readings on record: then these are what the controller saw."""
FEW = 16
"""Values that a command has at most that is sent in levels or pulses."""
FEWEST = 20
"""Periods at least in which no command was at a bound."""
ROWS = 2000
"""Periods of a flight that are looked at."""
LATE = (-1, 0, 1, 2, 3, 5, 8)
"""Periods by which commands may have been recorded late."""
LAGS = (1, -1, -2, -3)
"""Periods to readings whose differences from the present one a filter may have added."""
TURNS = 8
"""Steps at most of the search for gains; one is enough where no command is clipped."""
GAINED = 0.99
"""Share of what was left that a step has to leave at most for the search to go on."""
STEP = 1e-3
"""Share of the range of a gain by which its effect is found."""
RIDGE = 1e-13
"""Added to normal equations of columns of size 1."""
SAME = 0.02
"""Share of a gain, or of its range if that is less, within which it is not named as another one."""
NOTHING = 1e-4
"""Share of its range by which a gain is not named as another one in any case: what is found for 0 is hardly ever 0."""
BEYOND = 1.0
"""Ranges of a gain outside its bounds up to which it is believed; one that has no negative values has none there."""


@dataclass(frozen=True, eq=False)
class FlownOtherwise(Replay):
    """Commands of a test that its law gave with other gains than those that were asked for, or that are another test's.

    Args:
        asked: the test.
        flown: the same with the gains that were flown; or the other test.
    """

    asked: Test = field(kw_only=True)
    flown: Test = field(kw_only=True)

    @property
    def genes(self) -> Floats:
        """Gains that were flown (size,), in their units."""
        return self.flown.genes

    @property
    def of_another(self) -> bool:
        """Whether another test was flown."""
        return self.flown.number != self.asked.number

    @property
    def named(self) -> list[str]:
        """Each gain that was another one than asked for, with both, in words."""
        pairs = zip(self.asked.family.gains, self.asked.genes.tolist(), self.genes.tolist(), strict=True)
        return [
            f"{gain.name} about {found:.3g} for {wanted:.3g}"
            for gain, wanted, found in pairs
            if abs(found - wanted)
            > max(
                SAME * min(gain.high - gain.low, max(abs(wanted), abs(found))),
                NOTHING * (gain.high - gain.low),
            )
        ]


def flown_otherwise(
    test: Test, run: Trajectory, controller: UnboundFamily, others: Sequence[Test] = ()
) -> FlownOtherwise | None:
    """The commands of a test that was flown with other gains than it asks for; None where that is not certain.

    Args:
        test: as it was asked for.
        run: that was recorded of it.
        controller: the family as it was described.
        others: further tests, one of which may have been flown in its place.
    """
    other = flight_of(test, run, others)
    if other is not None:
        return FlownOtherwise(test.signals, run.states[0], run.commands, asked=test, flown=other)
    genes = _gains(test, run) if isinstance(controller, LINEAR) else None
    if genes is None:
        return None
    flown = replace(test, genes=genes)
    found = FlownOtherwise(test.signals, run.states[0], run.commands, asked=test, flown=flown)
    return found if found.named else None


def from_other_gains(experiments: Sequence[Experiment]) -> Iterator[Remark]:
    """That tests were flown with other gains than they ask for, or other tests in their place.

    It is no more than a note once a later one was flown as it asks for.

    Args:
        experiments: as they count, in the order of `tell`.
    """
    last = max((place for place, each in enumerate(experiments) if each.test is not None), default=-1)
    for place, each in enumerate(experiments):
        run = each.replayed
        if not isinstance(run, FlownOtherwise):
            continue
        say = note if place < last else serious
        if run.of_another:
            yield say(
                "other-test",
                f"What was told as test {run.asked.number} is a flight of test {run.flown.number}, by its recorded"
                f" commands: withdraw it, and tell it as test {run.flown.number}. Until then it is learnt under these"
                " commands, and its quality counts for no gains.",
            )
            continue
        yield say(
            "other-gains",
            f"Test {run.asked.number} was flown with other gains than it asks for, by its recorded commands:"
            f" {', '.join(run.named)}. It is learnt under these commands, and its quality counts for no gains. Check"
            " what was set, and the signs and units of gains, states and commands.",
        )


def _gains(test: Test, run: Trajectory) -> Floats | None:
    """Gains (size,) that explain commands on record clearly better than those of a test, and than anything else."""
    record = _Record.of(test, run)
    if record is None:
        return None
    fits = [record.fitted(how) for how in hows(test)]
    genes, left = min(fits, key=lambda fit: fit[1])
    if not left < min(SMALL * record.size, CLEARLY * record.off):
        return None
    low, high = np.array([(gain.low, gain.high) for gain in test.family.gains]).T
    reach = BEYOND * (high - low)
    least = np.where(low >= 0.0, -SAME * reach, low - reach)
    if not ((genes >= least) & (genes <= high + reach)).all():
        return None
    answers = record.answers()
    noise = float(answers.sum())
    if record.off <= NOISES * noise and left > EXACT * noise:
        return None
    most = max(left / CLEARLY, ROUNDED * record.off)
    return None if record.otherwise(np.flatnonzero(answers > 0.0), most) else genes


@dataclass(frozen=True, eq=False)
class _Record:
    """What was sent in a flight whose commands are not those of its test.

    Args:
        test: as it was asked for.
        sent: commands (n, n_u), in units of their spans.
        states: readings (n + 1, n_x).
        free: periods in which neither a recorded command nor the controller's was at a bound (n,).
        off: mean square by which they are off in these.
        size: of what the controller does.
    """

    test: Test
    sent: Floats
    states: Floats
    free: NDArray[np.bool_]
    off: float
    size: float

    @staticmethod
    def of(test: Test, run: Trajectory) -> _Record | None:
        """The record of a flight; None where nothing can be said, or there is nothing to say."""
        commands, states = run.commands[:ROWS], run.states[: ROWS + 1]
        span = span_of(test)
        low, high = np.array([command.bounds for command in test.signals.commands]).T
        sent = commands / span
        asked, off = np.zeros_like(sent), np.full(sent.shape[1], np.inf)
        for how in hows(test):
            gave = given_in_spans(as_excited(test, how), states)
            apart = np.square(sent - gave).mean(axis=0)
            size = float(np.square(gave - gave.mean(axis=0)).mean())
            if apart.mean() <= max(SEEN * SEEN, OFF * OFF * size):
                return None
            if apart.mean() < off.mean():
                asked, off = gave, apart
        if any(len(np.unique(column)) <= FEW for column in commands.T[off > SEEN * SEEN]):
            return None
        near = 1e-9
        free = np.ones(len(sent), dtype=bool)
        for values in (sent, asked):
            free &= ((values > low / span + near) & (values < high / span - near)).all(axis=1)
        if free.sum() < max(FEWEST, 4 * test.family.size // sent.shape[1]):
            return None
        size = float(np.square(sent[free] - sent[free].mean(axis=0)).mean())
        found = float(np.square(sent - asked)[free].mean())
        return _Record(test, sent, states, free, found, size)

    def fitted(self, how: Excited) -> tuple[Floats, float]:
        """Gains that are nearest to what was sent, and the mean square that they leave, its parameters counted."""
        test = as_excited(self.test, how)
        widths = np.array([gain.high - gain.low for gain in test.family.gains])
        genes = test.genes.copy()
        gave = given_in_spans(test, self.states)
        least = self._left(gave)
        for _ in range(TURNS):
            columns = np.stack(
                [
                    (given_in_spans(replace(test, genes=genes + step), self.states) - gave)[self.free].ravel()
                    for step in np.diag(STEP * widths)
                ],
                axis=1,
            )
            step = _solved(columns, (self.sent - gave)[self.free].reshape(-1, 1))
            moved = genes + STEP * widths * step[:, 0]
            after = given_in_spans(replace(test, genes=moved), self.states)
            found = self._left(after)
            if not found < GAINED * least:
                break
            genes, gave, least = moved, after, found
        rows = int(self.free.sum()) * self.sent.shape[1]
        return genes, least * rows / (rows - test.family.size)

    def otherwise(self, read: Integers, most: float) -> bool:
        """Whether anything but other gains leaves no more: readings that were later or filtered, a trim.

        Args:
            read: places of the states that the controller reads.
            most: mean square.
        """
        rows = len(self.sent)
        places = np.arange(rows)
        columns = [np.ones(rows), np.linspace(-1.0, 1.0, rows)]
        for lag in LAGS:
            there = np.clip(places + lag, 0, rows)
            columns += [self.states[there, i] - self.states[:-1, i] for i in read]
        design = np.stack(columns, axis=1)
        for how in hows(self.test):
            asked = given_in_spans(as_excited(self.test, how), self.states)
            for late in LATE:
                there = np.clip(places - late, 0, rows - 1)
                used = self.free & (places - late >= 0) & (places - late < rows)
                off = (self.sent - asked[there])[used]
                rest = off - product(design[used], _solved(design[used], off))
                if float(np.square(rest).mean()) <= most:
                    return True
        return False

    def answers(self) -> Floats:
        """Mean squares of what the controller answers to noise of each state that the record does not show (n_x,)."""
        scales = np.array([state.scale for state in self.test.signals.states])
        run = Run.of(self.states, self.sent).continued(self.test.signals)
        noise = np.sqrt(guessed_noise([run], scales))
        signs = np.where(np.arange(len(self.states)) % 2, -1.0, 1.0)
        quiet = self.test.quiet()
        before, found = given_in_spans(quiet, self.states), []
        for i, sd in enumerate(noise.tolist()):
            states = self.states.copy()
            states[:, i] += sd * signs
            found.append(float(np.square(given_in_spans(quiet, states) - before)[self.free].mean()))
        return np.array(found)

    def _left(self, gave: Floats) -> float:
        return float(np.square(self.sent - gave)[self.free].mean())


def _solved(columns: Floats, right: Floats) -> Floats:
    """Least squares; of what columns cannot tell apart the smallest."""
    sizes = np.sqrt(np.square(columns).sum(axis=0))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    scaled = columns / sizes
    gram = product(scaled.T, scaled) + RIDGE * np.eye(columns.shape[1])
    found = solve_linear(gram, product(scaled.T, right))
    return np.zeros((columns.shape[1], right.shape[1])) if found is None else found / sizes[:, np.newaxis]

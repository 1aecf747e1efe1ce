"""Odd one out: one flight of several contradicts the others, and agrees once a sign, a unit or a column is changed.

No law explains flights of which one has a column with the wrong sign. A linear law of all others shows which: it
predicts those, and misses this one by as much as it moves. That alone would accuse a flight under other gains, or at
another place, where a nonlinear system has other slopes. So it is said only where the same law predicts the flight once
a column has the other sign or another unit, or two columns are exchanged.

A law that is free enough explains it all the same, with terms that turn a command round where the odd one flew. Whether
that is so, or the system is one that no linear law explains, shows in the law of the flights once it is put right
(`identify_and_plan/contradicting.py`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats, Integers
from twinloop._ground.elementary import log
from twinloop.remarks import Remark, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

WINDOWS = (1, 3, 10, 30)
"""Periods over which moves are predicted: long ones see less of the sensors' noise, short ones see what is fast."""
AGREEING = 2
"""Windows that must name the flight and the same change, while none names another flight."""
EXPLAINED = 0.25
"""Of a state's moves, mean squares, that the law may leave of each of the other flights."""
MISSED = 0.75
"""Of those of the odd one out that it leaves at least: about as much as if it predicted no move."""
TIMES = 10.0
"""By which the change lessens that."""
NEARLY = 0.1
"""Of its moves that the law may leave after the change, or twice as much as of the others."""
EXACTLY = 0.01
"""The same after a change of a unit: other loads and speeds have other slopes, by any factor, and 3.6 is near many."""
MATTERS = 4.0
"""Times that more is left without what was changed: dividing a column by 1000 must not only silence it."""
MOST = 2000
"""Rows of a flight at most: enough for a law of a few terms."""
FLIGHTS = 24
"""That are compared at most, the last ones: each with each other takes its time."""
TINY = 1e-9
"""Of a cause, squared, that may be left by the causes before it where it tells nothing of its own."""
UNITS = (180.0 / np.pi, 30.0 / np.pi, 2.0 * np.pi, 3.6, 100.0, 1000.0)
"""Ratios of units that logs are written in: degrees, rpm, turns, km/h, and powers of ten; others are near one of these,
such as 60 and 9.81, or are not found."""
Squares = Floats
"""A flight as a linear law sees it: sums of the products of 1, the means of states and commands within windows, and the
moves of the states over these (1 + 2 n_x + n_u, the same)."""


@dataclass(frozen=True, eq=False)
class _Change:
    """What may have been done wrong to the columns of a flight.

    Args:
        words: what makes it right.
        nearly: of the flight's moves that a law may leave after it.
        scaled: columns that are divided; none where two are exchanged.
        order: where each row of `Squares` has stood.
        factors: by which it is divided then.
        without: the same, infinite for causes that are scaled.
    """

    words: str
    nearly: float
    scaled: tuple[int, ...]
    order: Integers
    factors: Floats
    without: Floats

    def made(self, flight: Squares) -> Squares:
        """A flight with its columns put right."""
        right: Squares = flight[np.ix_(self.order, self.order)] / self.factors / self.factors[:, np.newaxis]
        return right

    def of(self, flight: Trajectory) -> Trajectory:
        """A flight as it was recorded, with its columns put right."""
        n_x, columns = flight.states.shape[1], self.order[1:] - 1
        factors = self.factors[1:]
        states = flight.states[:, columns[:n_x]] / factors[:n_x]
        n_u = flight.commands.shape[1]
        commands = flight.commands[:, columns[n_x : n_x + n_u] - n_x] / factors[n_x : n_x + n_u]
        return replace(flight, states=states, commands=commands)

    def matters(self, flight: Squares, law: Floats, explained: np.ndarray) -> bool:
        """Whether the law needs what was scaled: a state that it predicts, or a cause of one.

        Args:
            flight: as it was recorded.
            law: of the others.
            explained: states that it predicts (n_x,).
        """
        if not self.scaled or any(place < len(explained) and explained[place] for place in self.scaled):
            return True
        without = _left(flight / self.without / self.without[:, np.newaxis], law)
        return bool(
            (explained & (without >= np.maximum(NEARLY, MATTERS * _left(self.made(flight), law)))).any()
        )


class _Suspect(NamedTuple):
    """A flight that the law of all others misses.

    Args:
        place: among those that are compared.
        change: that makes it agree with them; None: none does.
    """

    place: int
    change: _Change | None


class Odd(NamedTuple):
    """A flight that contradicts all others.

    Args:
        place: among the flights.
        words: with what change it agrees with them.
        righted: the same flight after that.
        shrunk: by which factor its states are smaller then, logarithms of all of them together.
        compared: how many flights were compared.
    """

    place: int
    words: str
    righted: Trajectory
    shrunk: float
    compared: int


def odd_one_out(flights: Sequence[Trajectory], signals: Signals) -> Odd | None:
    """The one flight that contradicts all others; None where there is none.

    Args:
        flights: of one system.
        signals: of it.
    """
    kept = _distinct(flights, 3 * (1 + signals.n_x + signals.n_u) + max(WINDOWS))[-FLIGHTS:]
    if len(kept) < 3:
        return None
    changes = list(_changes(signals))
    squares = ([_squares(flights[place], window) for place in kept] for window in WINDOWS)
    found = [suspect for of_window in squares for suspect in _suspects(of_window, changes, signals.n_x)]
    named = Counter(suspect.change.words for suspect in found if suspect.change is not None)
    words, windows = next(iter(named.most_common(1)), ("", 0))
    if windows < AGREEING or len({suspect.place for suspect in found}) > 1:
        return None
    change = next(each.change for each in found if each.change is not None and each.change.words == words)
    place = kept[found[0].place]
    shrunk = float(log(np.abs(change.factors[1 : 1 + signals.n_x])).sum())
    return Odd(place, words, change.of(flights[place]), shrunk, len(kept))


def said_odd(odd: Odd | None, names: Sequence[str]) -> Iterator[Remark]:
    """That one flight contradicts all others.

    Args:
        odd: the one; None: there is none.
        names: what each flight is called.
    """
    if odd is not None:
        name = names[odd.place]
        yield serious(
            "odd-one-out",
            f"Without {name} one linear law explains most of the other {odd.compared - 1} flights that were compared."
            f" It does not explain {name}, but would {odd.words}: check the signs, units and order of its columns, and"
            " whether it was flown as the others were (load, speed, direction).",
        )


def _distinct(flights: Sequence[Trajectory], least: int) -> list[int]:
    """Places of the flights of at least so many steps, each record once."""
    first: dict[tuple[bytes, bytes], int] = {}
    for place, run in enumerate(flights):
        if run.steps >= least:
            first.setdefault((run.states.tobytes(), run.commands.tobytes()), place)
    return list(first.values())


def _squares(flight: Trajectory, window: int) -> Squares:
    """A flight in windows of so many periods, one from each reading on, or from some of them."""
    begins = np.arange(0, flight.steps - window + 1, max(1, flight.steps // MOST))
    signals = np.hstack([flight.states[:-1], flight.commands])
    summed = np.vstack([np.zeros(signals.shape[1]), np.cumsum(signals, axis=0)])
    means = (summed[begins + window] - summed[begins]) / window
    moves = flight.states[begins + window] - flight.states[begins]
    rows = np.hstack([np.ones((len(begins), 1)), means, moves])
    found: Squares = (rows[:, :, np.newaxis] * rows[:, np.newaxis, :]).mean(axis=0)
    return found


def _law(flights: Sequence[Squares], n_x: int) -> Floats:
    """The linear law of flights (1 + n_x + n_u, n_x), by least squares; causes that others give do not act."""
    total = np.sum(flights, axis=0)
    causes = len(total) - n_x
    sizes = np.sqrt(np.maximum(total.diagonal()[:causes], 1e-300))
    rows = total[:causes] / sizes[:, np.newaxis]
    rows[:, :causes] /= sizes
    law, waiting = np.zeros((causes, n_x)), list(range(causes))
    while waiting:
        # What all causes so far leave of the others stands on the diagonal.
        best = max(waiting, key=lambda place: rows[place, place])
        if rows[best, best] < TINY:
            break
        waiting.remove(best)
        rows[best] /= rows[best, best]
        others = np.arange(causes) != best
        rows[others] -= rows[others, best][:, np.newaxis] * rows[best]
    acting = [place for place in range(causes) if place not in waiting]
    law[acting] = rows[acting, causes:] / sizes[acting, np.newaxis]
    return law


def _left(flight: Squares, law: Floats) -> Floats:
    """Mean squares of what a law leaves of the moves, over those of the moves (n_x,); infinite where nothing moves."""
    n_x = law.shape[1]
    off = np.vstack([-law, np.eye(n_x)])
    missed = ((flight[:, :, np.newaxis] * off).sum(axis=1) * off).sum(axis=0)
    moved = flight.diagonal()[-n_x:]
    left: Floats = np.divide(np.maximum(missed, 0.0), moved, out=np.full(n_x, np.inf), where=moved > 0.0)
    return left


def _suspects(flights: Sequence[Squares], changes: Sequence[_Change], n_x: int) -> Iterator[_Suspect]:
    """Flights that the law of all others misses, where those predict one another."""
    for place, flight in enumerate(flights):
        others = [*flights[:place], *flights[place + 1 :]]
        apart = (_law([*others[:k], *others[k + 1 :]], n_x) for k in range(len(others)))
        usual = np.max([_left(other, law) for other, law in zip(others, apart, strict=True)], axis=0)
        explained, law = usual < EXPLAINED, _law(others, n_x)
        before = _left(flight, law)
        missed = explained & (before >= MISSED)
        if not missed.any():
            continue
        right = []
        for change in changes:
            after = _left(change.made(flight), law)
            agrees = (after <= np.maximum(2.0 * usual, change.nearly))[explained].all()
            healed = (TIMES * after <= before)[missed].any()
            if agrees and healed and change.matters(flight, law, explained):
                right.append((len(change.scaled) > 1, float(after[explained].max()), change))
        # To a linear law a command in another unit is all states in another one: the fewest columns are said.
        yield _Suspect(place, min(right, key=lambda each: each[:2])[2] if right else None)


def _changes(signals: Signals) -> Iterator[_Change]:
    """Another sign or unit of each column, and of a state with its derivatives; and two columns exchanged."""
    names = (*signals.state_names, *signals.command_names)
    count, n_x = len(names), signals.n_x
    for scaled in [*((place,) for place in range(count)), *_with_derivatives(signals)]:
        of = " and ".join(names[place] for place in scaled)
        for factor in (-1.0, *UNITS, *(1.0 / unit for unit in UNITS)):
            how = (
                f"divided by about {factor:.4g}"
                if factor > 1.0
                else f"multiplied by about {1.0 / factor:.4g}"
            )
            words = f"with the sign of its {of} changed" if factor < 0.0 else f"with its {of} {how}"
            factors, gone = np.ones((2, 1 + count + n_x))
            causes = [1 + place for place in scaled]
            factors[[*causes, *(1 + count + place for place in scaled if place < n_x)]] = factor
            gone[causes] = np.inf
            nearly = NEARLY if factor < 0.0 else EXACTLY
            yield _Change(words, nearly, scaled, np.arange(len(factors)), factors, factors * gone)
    for pair in chain(combinations(range(n_x), 2), combinations(range(n_x, count), 2)):
        columns = np.arange(count)
        columns[list(pair)] = pair[::-1]
        order = np.concatenate([[0], 1 + columns, 1 + count + columns[:n_x]])
        none = np.ones(len(order))
        yield _Change(
            f"with its {names[pair[0]]} and {names[pair[1]]} exchanged", NEARLY, (), order, none, none
        )


def _with_derivatives(signals: Signals) -> list[tuple[int, ...]]:
    """Places of each state with its derivatives, such as an angle and its rate."""
    found: list[tuple[int, ...]] = []
    for place, state in enumerate(signals.states):
        group, names = [place], [state.name]
        for i, other in enumerate(signals.states):
            if other.derivative_of == names[-1]:
                group.append(i)
                names.append(other.name)
        if len(group) > 1:
            found.append(tuple(group))
    return found

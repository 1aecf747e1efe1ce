"""What a store holds, by system, learner, measure and k, with the statistics over seeds."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from twinloop_exam.kinds import Learner
from twinloop_exam.learners import key
from twinloop_exam.measures import quantiles
from twinloop_exam.plan import TUNING_SEEDS
from twinloop_exam.store import Row, Store


@dataclass(frozen=True)
class Spread:
    """A measure over seeds.

    Args:
        median: over seeds.
        low: first quartile.
        high: third quartile.
        least: over seeds.
        most: over seeds.
        seeds: how many.
    """

    median: float
    low: float
    high: float
    least: float
    most: float
    seeds: int


class Results:
    """Rows of all learners on all systems, with the settings that the learners have now.

    Args:
        store: where the rows are.
        systems: names.
        learners: to be looked for.
        data: whose flights the fits were made on.
        seeds: that count; None: all that there are but those for tuning.
    """

    def __init__(
        self,
        store: Store,
        systems: Sequence[str],
        learners: Sequence[Learner],
        data: Learner,
        seeds: Sequence[int] | None = None,
    ) -> None:
        self.systems = list(systems)
        self.learners = [who.name for who in learners]
        self.seeds = seeds
        self._rows: dict[tuple[str, str], list[Row]] = {}
        for system in systems:
            for who in learners:
                rows = store.rows(system, who.name, key(who, data))
                self._rows[system, who.name] = [row for row in rows if self._counts(row)]

    def _counts(self, row: Row) -> bool:
        if row.address.learner == "optimum":
            return True
        seed = row.address.seed
        return seed not in TUNING_SEEDS if self.seeds is None else seed in self.seeds

    def rows(self, system: str, learner: str) -> list[Row]:
        """Rows of a learner on a system, by seed and k; none if it was not measured."""
        return self._rows.get((system, learner), [])

    def shared_seeds(self, system: str, learners: Sequence[str]) -> set[int]:
        """Seeds with which all of some learners were measured on a system; those without any row do not count."""
        seeds = [{row.address.seed for row in self.rows(system, who)} for who in learners]
        return set.intersection(*filter(None, seeds)) if any(seeds) else set()

    def at(self, seeds: Collection[int]) -> Results:
        """The same of some seeds only."""
        view = copy.copy(self)
        view._rows = {
            where: [row for row in rows if row.address.seed in seeds] for where, rows in self._rows.items()
        }
        return view

    def experiments(self, system: str, learner: str) -> list[int]:
        """Numbers of experiments at which a learner was measured on a system, failures included."""
        return sorted({row.k for row in self.rows(system, learner)})

    def values(self, system: str, learner: str, measure: str, k: int | None = None) -> dict[int, float]:
        """A measure by seed; with k None the largest k that a seed has it at.

        Args:
            system: name.
            learner: name.
            measure: name.
            k: experiments after Υ0.
        """
        found: dict[int, float] = {}
        for row in self.rows(system, learner):  # by k, so that the largest stays
            value = row.measures.get(measure)
            if value is not None and row.failure is None and k in (None, row.k):
                found[row.address.seed] = value
        return found

    def all_values(self, system: str, learner: str, measure: str) -> list[float]:
        """A measure at every seed and k."""
        found = [row.measures.get(measure) for row in self.rows(system, learner)]
        return [value for value in found if value is not None]

    def failures(self, system: str, learner: str, k: int) -> int:
        """Seeds that failed at k."""
        return sum(row.failure is not None and row.k == k for row in self.rows(system, learner))


def spread(values: Mapping[int, float] | Sequence[float]) -> Spread | None:
    """Statistics over seeds, by rank: some may be infinite.

    Args:
        values: by seed, or in any order.

    Returns:
        The spread; None of nothing.
    """
    numbers = list(values.values()) if isinstance(values, Mapping) else list(values)
    if not numbers:
        return None
    low, middle, high = quantiles(numbers, [0.25, 0.5, 0.75])
    return Spread(middle, low, high, min(numbers), max(numbers), len(numbers))

"""What is still to be measured, and what it will cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop_exam.kinds import Campaigner, Fitter, Flyer, Learner, Optimum, Tuner
from twinloop_exam.learners import key
from twinloop_exam.store import Address, Store
from twinloop_exam.systems import why_missing

TUNING_SEEDS = range(10)
"""For choosing settings; never reported."""
SEEDS = range(10, 35)
"""Those reported by default."""
FEW_SEEDS = range(10, 20)
"""Of ablations, and of systems that are slow to fly."""
SLOW_SYSTEMS = ("rotorpy",)


@dataclass(frozen=True)
class Job:
    """One learner on one system with one seed.

    Args:
        who: the learner.
        address: of its rows.
        ks: numbers of experiments after Υ0 at which it is still to be measured.
        last: the largest number at which it is measured at all.
        flights: whose flights a fit is made on; None for those who fly themselves.
        seconds: estimate of what it costs.
    """

    who: Learner
    address: Address
    ks: tuple[int, ...]
    last: int
    flights: Address | None
    seconds: float


@dataclass(frozen=True)
class Scope:
    """What is asked for.

    Args:
        systems: names.
        learners: to be measured.
        data: whose flights the fits are made on.
        seeds: None: the default of each system and learner.
        experiments: after Υ0, at most; None: the default of each learner.
        retry: whether failures are tried again.
    """

    systems: Sequence[str]
    learners: Sequence[Learner]
    data: Learner
    seeds: Sequence[int] | None = None
    experiments: int | None = None
    retry: bool = False

    def seeds_of(self, who: Learner, system: str) -> Sequence[int]:
        """Seeds with which a learner is measured on a system.

        Args:
            who: the learner.
            system: name.
        """
        if isinstance(who, Optimum):
            return [0]
        if self.seeds is not None:
            return self.seeds
        return FEW_SEEDS if system in SLOW_SYSTEMS or who.name.startswith("without-") else SEEDS

    def experiments_of(self, who: Learner, system: str) -> list[int]:
        """Numbers of experiments after Υ0 at which a learner is measured on a system.

        Args:
            who: the learner.
            system: name.
        """
        match who:
            case Campaigner():
                most = who.longer.get(system, who.experiments)
                return list(range((most if self.experiments is None else self.experiments) + 1))
            case Flyer():
                return list(range((who.experiments if self.experiments is None else self.experiments) + 1))
            case Fitter():
                flown = self.experiments_of(self.data, system)
                return [k for k in who.experiments if k in flown]
            case Tuner():
                return list(range(who.flights))
            case Optimum():
                return [0]


def planned(scope: Scope, store: Store) -> list[Job]:
    """Jobs that are not done, those whose flights others need first.

    Args:
        scope: what is asked for.
        store: what is done.

    Returns:
        Jobs, each with its estimated cost.
    """
    jobs = []
    for system in scope.systems:
        for who in scope.learners:
            settings = key(who, scope.data)
            seconds = _seconds(who, system, settings, store)
            wanted = scope.experiments_of(who, system)
            for seed in scope.seeds_of(who, system):
                address = Address(system, who.name, seed, settings)
                done = store.done(address, failures=not scope.retry)
                missing = tuple(k for k in wanted if k not in done)
                if not missing:
                    continue
                flights = None
                if isinstance(who, Fitter):
                    flights = Address(system, scope.data.name, seed, key(scope.data))
                # Who flies begins again from Υ0 and comes by the same experiments: equal seeds, equal bits.
                rows = len(missing) if isinstance(who, Fitter) else len(wanted)
                jobs.append(Job(who, address, missing, wanted[-1], flights, rows * seconds))
    return sorted(jobs, key=lambda job: isinstance(job.who, Fitter))


def available(
    systems: Sequence[str], learners: Sequence[Learner], say: Callable[[str], None]
) -> tuple[list[str], list[Learner]]:
    """Systems and learners that can be run here; of each other one says why not.

    Args:
        systems: names.
        learners: that were asked for.
        say: told one sentence for each that is left out.

    Returns:
        What is left of both.
    """
    reasons: Mapping[str, str | None] = {name: why_missing(name) for name in systems}
    for name, reason in reasons.items():
        if reason is not None:
            say(f"Left out, system {name}: {reason}")
    here = []
    for who in learners:
        lacking = who.why_missing()
        if lacking is None:
            here.append(who)
        else:
            say(f"Left out, learner {who.name}: {lacking}")
    return [name for name, reason in reasons.items() if reason is None], here


def _seconds(who: Learner, system: str, settings: str, store: Store) -> float:
    """Seconds a row costs: as measured here, or the learner's own guess."""
    rows = [row.seconds for row in store.rows(system, who.name, settings) if row.failure is None]
    return float(np.mean(rows)) if rows else who.seconds

"""How often the guard ends flights of the exam's systems when it should, and when it should not.

    python studies/guarded_flights.py [--smoke] [--seeds 4] [--flights 12] [--horizons 0.1 0.2 0.4]

For each system and seed a campaign learns from two flights. Then gains are drawn, from near the first controller to a
corner of their box, and flown on fresh copies of the system without and with a guard, under the same noise and gusts.
Two fallbacks are tried: the first controller, and a command that is held, the one it gives at rest on the target
(rotors at hover speed). Rows are

- inside: flights whose true states stay in the envelope; every intervention is a false one;
- leaving: flights whose true states leave it; the lead is the periods between intervention and leaving;
- frozen, NaN: as inside, but from the middle on one sensor repeats itself, or gives nothing;
- motor: as inside, but from the middle on one command arrives as 85 % of itself.

What is left is counted on true states, to the end of the test, under the fallback. The committee knows nothing of the
failures of the last rows, so the horizon says little there: they are flown with the middle one only.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

import twinloop as tl
from twinloop._experiment.envelope import outside, usages_of
from twinloop._ground.arrays import Floats
from twinloop.guard import Guard
from twinloop.guard.guarded import led_by
from twinloop_exam.systems import SUBJECTS, Subject, why_missing

SYSTEMS = ("quadrotor-0", "quadrotor", "quadrotor-noisy", "quadrotor-harsh", "rotorpy")
FAILURES = ("frozen", "NaN", "motor")
ROWS = ("inside", "leaving", *FAILURES)
AUTHORITY = 0.85
QUICK = {
    "moves": 600,
    "starts": 1,
    "committee_size": 4,
    "tuning_steps": 4,
    "generations": 0,
    "evaluations": 256,
}
"""Options of `--smoke`."""


@dataclass
class Broken:
    """What lies between a guard and a system: sensors and motors that fail in the middle.

    Args:
        guard: that flies.
        kind: what fails.
        which: state or command that does.
        after: periods.
    """

    guard: Guard
    kind: str
    which: int
    after: int
    period: int = 0
    last: float = 0.0

    def reset(self) -> None:
        """Back to the start."""
        self.period = 0
        self.guard.reset()

    def command(self, state: Floats, target: Floats) -> ArrayLike:
        """What arrives at the motors."""
        reading, fails = np.array(state), self.period >= self.after
        if not fails:
            self.last = float(reading[self.which]) if self.kind in ("frozen", "NaN") else 0.0
        elif self.kind in ("frozen", "NaN"):
            reading[self.which] = self.last if self.kind == "frozen" else np.nan
        command = np.array(self.guard.command(reading, target))
        if fails and self.kind == "motor":
            command[self.which] *= AUTHORITY
        self.period += 1
        return command


@dataclass
class Count:
    """Outcomes of one row."""

    flights: int = 0
    ended: int = 0
    left_before: int = 0
    left_with: list[int] = field(default_factory=lambda: [0, 0])
    leads: list[int] = field(default_factory=list)


def leaves(states: Floats, signals: tl.Signals) -> int | None:
    """The first period whose true state is outside."""
    beyond = outside(usages_of(signals, states))
    return int(np.argmax(beyond)) if beyond.any() else None


def flown(subject: Subject, seed: int, test: tl.Test, law: object | None) -> Floats:
    """True states of a test on a fresh copy of the system."""
    run = subject.rig(seed).run(test if law is None else led_by(law, test))  # type: ignore[arg-type]
    assert run.true_states is not None
    return run.true_states


class Unguarded:
    """A test's controller as a law, to be broken alike."""

    def __init__(self, test: tl.Test) -> None:
        self.controller = test.controller()
        self.last = np.array(test.initial_state)

    def reset(self) -> None:
        """Back to the start."""
        self.controller.reset()

    def command(self, state: Floats, target: Floats) -> Floats:
        """Holds the last reading where there is none."""
        self.last = np.where(np.isfinite(state), state, self.last)
        return self.controller.command(self.last, target)


def gains(campaign: tl.Campaign, first: Floats, random: np.random.Generator) -> Floats:
    """From near the first controller to a corner of the box, where dampings are nothing and loops are stiff."""
    family, how_far = campaign.family, random.uniform()
    corner = np.round(random.uniform(size=family.size))
    return family.from_unit((1.0 - how_far) * family.to_unit(first) + how_far * corner)


def study(
    subject: Subject, seeds: Sequence[int], flights: int, horizons: Sequence[float], smoke: bool
) -> dict[tuple[str, float], Count]:
    """Counts by row and horizon."""
    broken = tuple(horizons)[len(horizons) // 2 :][:1]
    found = {(row, horizon): Count() for row in ROWS for horizon in (broken if row in FAILURES else horizons)}
    for seed in seeds:
        rig = subject.rig(seed)
        campaign = tl.Campaign(
            rig.signals, controller=rig.controller, initial_state=rig.initial_state,
            target_state=rig.target_state, duration=rig.duration, seed=seed, threads=1,
            options=QUICK if smoke else {}, progress=None,
        )  # fmt: skip
        campaign.run(rig, 2)
        first, random = campaign.tests[0].genes, np.random.Generator(np.random.Philox([seed, 11]))
        tests = [campaign.test(gains(campaign, first, random), excitation=None) for _ in range(flights)]
        for number, test in enumerate(tests):
            copy = 1000 * (seed + 1) + number
            plain = leaves(flown(subject, copy, test, None), rig.signals)
            rows = ("leaving",) if plain is not None else ("inside", "frozen", "NaN", "motor")
            for row in rows:
                width = rig.signals.n_u if row == "motor" else rig.signals.n_x
                which = int(random.integers(width))
                for horizon in broken if row in FAILURES else horizons:
                    count = found[row, horizon]
                    one(subject, copy, test, row, which, campaign, horizon, plain, count)
    return found


def one(
    subject: Subject, copy: int, test: tl.Test, row: str, which: int,
    campaign: tl.Campaign, horizon: float, plain: int | None, count: Count,
) -> None:  # fmt: skip
    """Flies a test with a guard, once with each fallback, and counts what came of it."""
    guard = campaign.guard(test, horizon=horizon, clock=None)
    after = test.steps // 2 if row in FAILURES else test.steps
    if after < test.steps:
        alone = flown(subject, copy, test, Broken(Unguarded(test), row, which, after))  # type: ignore[arg-type]
        plain = leaves(alone, guard.signals)
    first = campaign.family.controller(campaign.tests[0].genes)
    held = first.command(test.target(0), test.target(0))
    count.flights += 1
    count.left_before += plain is not None
    for number, fallback in enumerate((first, held)):
        guard.fallback = fallback
        states = flown(subject, copy, test, Broken(guard, row, which, after))
        count.left_with[number] += leaves(states, guard.signals) is not None
    if guard.tripped_at is not None:
        count.ended += 1
        count.leads.append((after if row != "leaving" else plain or 0) - guard.tripped_at)


def line(name: str, row: str, horizon: float, count: Count) -> str:
    """A row of the table."""
    leads = [lead if row == "leaving" else -lead for lead in count.leads]
    when = "" if row == "inside" or not leads else f"{int(np.median(leads))} ({min(leads)} to {max(leads)})"
    return (
        f"| {name} | {row} | {horizon:g} | {count.flights} | {count.ended} | {when} |"
        f" {count.left_before} | {count.left_with[0]} | {count.left_with[1]} |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--smoke", action="store_true", help="one system, one seed, four flights, a quick search"
    )
    parser.add_argument("--seeds", type=int, default=4, help="campaigns of each system")
    parser.add_argument("--flights", type=int, default=12, help="drawn after each campaign")
    parser.add_argument("--horizons", type=float, nargs="+", default=[0.2, 0.4, 0.8], help="s")
    parser.add_argument("--systems", nargs="+", default=list(SYSTEMS), choices=list(SUBJECTS))
    chosen = parser.parse_args()
    print(
        "| system | flights | horizon, s | flown | ended | lead, or delay after the failure, periods: median (range) |"
        " left the envelope without guard | with, first controller | with, held command |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in chosen.systems[:1] if chosen.smoke else chosen.systems:
        if why_missing(name) is not None:
            continue
        seeds, flights = (range(1), 4) if chosen.smoke else (range(chosen.seeds), chosen.flights)
        found = study(SUBJECTS[name], seeds, flights, chosen.horizons, chosen.smoke)
        for (row, horizon), count in found.items():
            if count.flights:
                print(line(name, row, horizon, count), flush=True)


if __name__ == "__main__":
    main()

"""Interleaved timing: each contestant once a round, so that what disturbs the machine disturbs them all."""

import gc
import importlib
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from types import ModuleType

import numpy as np

RIVALS = ("numba", "pymoo")
BENCH_EXTRA = "pip install 'twinloop[bench]'"


class Disagreement(Exception):
    """Two implementations gave different numbers: nothing can be said of their speed."""


@dataclass(frozen=True)
class Spread:
    """Median and quartiles over the rounds."""

    low: float
    median: float
    high: float

    @classmethod
    def of(cls, values: np.ndarray) -> "Spread":
        return cls(*(float(x) for x in np.percentile(values, [25, 50, 75])))


@dataclass(frozen=True)
class Line:
    """One line of the report: a contestant's figure, and its CPU time as a multiple of the reference's."""

    case: str
    contestant: str
    figure: float
    unit: str
    ratio: Spread | None = None
    bar: float | None = None

    @property
    def verdict(self) -> str:
        if self.bar is None or self.ratio is None:
            return ""
        return f"≥ {self.bar:g}: " + ("reached" if self.ratio.median >= self.bar else "missed")


@dataclass
class Section:
    """A table of the report and what must be said beside it."""

    title: str
    lines: list[Line] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, object]:
        lines = [asdict(line) | {"verdict": line.verdict} for line in self.lines]
        return {"title": self.title, "lines": lines, "notes": self.notes}


Times = dict[str, np.ndarray]
"""CPU seconds of each contestant (rounds,)."""


def interleaved(contestants: Mapping[str, Callable[[], object]], rounds: int, at_least: float = 0.0) -> Times:
    """Times the contestants in turn, round after round.

    Each is repeated within a round so often that it runs `at_least` that many seconds, judged by one call.
    The first call, which compiles and fills caches, does not count.
    """
    repeats = {}
    for name, contestant in contestants.items():
        contestant()
        repeats[name] = max(1, int(at_least / max(_cpu_seconds(contestant, 1), 1e-9)))
    times: dict[str, list[float]] = {name: [] for name in contestants}
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, contestant in contestants.items():
                times[name].append(_cpu_seconds(contestant, repeats[name]))
    finally:
        gc.enable()
    return {name: np.array(values) for name, values in times.items()}


def _cpu_seconds(work: Callable[[], object], repeats: int) -> float:
    start = time.process_time()  # of the whole process: a thread that somebody started would count
    for _ in range(repeats):
        work()
    return (time.process_time() - start) / repeats


def ratio(times: Times, rival: str, ours: str) -> Spread:
    """How many times longer the rival takes, round by round."""
    return Spread.of(times[rival] / times[ours])


def fastest(times: Times, names: list[str]) -> str:
    return min(names, key=lambda name: float(np.median(times[name])))


def check_agreement(what: str, ours: np.ndarray, theirs: np.ndarray, relative: float = 1e-9) -> None:
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=relative, atol=0.0):
        raise Disagreement(f"{what}: the results differ by more than {relative:g} relative.")


def optional(name: str, section: Section) -> ModuleType | None:
    """A module that only the extra `bench` brings; if it is not there, the section says so."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in RIVALS:
            raise
        section.notes.append(f"Skipped: {package} is not installed; {BENCH_EXTRA} brings it.")
        return None

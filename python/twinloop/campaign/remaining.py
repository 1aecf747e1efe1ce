"""The remaining time of a campaign, from the time that its work has taken so far."""

from __future__ import annotations

import time
from typing import Protocol

from twinloop._ground.steps import STEPS
from twinloop.campaign.history import Progress
from twinloop.campaign.presets import AnyOptions, Options

USUAL: dict[str, tuple[str, float]] = {
    "form": ("choosing the form of the law", 2.0),
    "noise": ("estimating the noise", 1.1),
    "actuators": ("searching for lags and delays", 3.5),
    "hidden": ("searching for a hidden state", 0.3),
    "terms": ("selecting terms", 1.2),
    "evolution": ("growing terms", 2.0),
    "smoothed": ("selecting again, on smoothed states", 0.8),
    "parts": ("learning from parts of the flight", 1.9),
    "disturbances": ("weighing disturbances", 0.02),
    "committee": ("drawing a committee", 0.1),
    "gains": ("tuning gains", 7.0),
    "candidates": ("choosing the next flight", 0.4),
}
"""Each step of the preset `default` for a person, and its usual share of the time."""


class Remaining(Protocol):
    """Estimates the remaining time."""

    experiments: int
    """That each campaign will make."""
    later: int
    """Campaigns that are still to come."""

    def remaining(self, progress: Progress) -> float | None:
        """Remaining seconds; None as long as they are unknown."""
        ...


class Estimate:
    """Remaining time of a campaign of the preset `paper`, from the work so far.

    Args:
        options: of the campaign.
        experiments: that it will make.
        later: campaigns like it that are still to come.
    """

    def __init__(self, options: Options, experiments: int, later: int = 0) -> None:
        self.options = options
        self.experiments = experiments
        self.later = later
        self._seconds = {"models": 0.0, "tests": 0.0}
        self._work = {"models": 0.0, "tests": 0.0}
        self._at: tuple[str, int, int] | None = None
        self._clock = time.monotonic()

    def remaining(self, progress: Progress) -> float | None:
        """Remaining seconds; None as long as they are unknown.

        Args:
            progress: where the campaign is.
        """
        now = time.monotonic()
        at = (progress.phase, progress.iteration, progress.generation)
        if progress.phase in self._work:
            before = self._at[2] if self._at is not None and self._at[:2] == at[:2] else 0
            self._work[progress.phase] += (progress.generation - before) * self._weight(
                progress.phase, progress.iteration
            )
            self._seconds[progress.phase] += now - self._clock
        self._at, self._clock = at, now
        rates = [self._seconds[phase] / work for phase, work in self._work.items() if work > 0.0]
        if not rates:
            return None
        return sum(
            work * (self._seconds[phase] / self._work[phase] if self._work[phase] > 0.0 else max(rates))
            for phase, work in self._work_ahead(progress).items()
        )

    def _weight(self, phase: str, iteration: int) -> float:
        """Roll-outs of a generation, more or less."""
        options = self.options
        if phase == "models":
            return 2.0 * options.model_population * max(1, iteration)
        return float(options.test_population * (options.committee_size + options.mutants))

    def _work_ahead(self, progress: Progress) -> dict[str, float]:
        ahead = {"models": 0.0, "tests": 0.0}
        for iteration in range(progress.iteration + 1, self.experiments + 1):
            ahead["models"] += self.options.model_generations * self._weight("models", iteration)
        loops = self.experiments - 1 - progress.iteration + (progress.phase == "models")
        ahead["tests"] += max(0, loops) * self.options.generations_of_tests * self._weight("tests", 0)
        if progress.phase in ahead:
            missing = progress.generations - progress.generation
            ahead[progress.phase] += missing * self._weight(progress.phase, progress.iteration)
        for iteration in range(1, self.experiments + 1):
            ahead["models"] += self.later * self.options.model_generations * self._weight("models", iteration)
        loops = self.later * (self.experiments - 1)
        ahead["tests"] += loops * self.options.generations_of_tests * self._weight("tests", 0)
        return ahead


class StepEstimate:
    """Remaining time of a campaign of the preset `default`, from the time of each step so far.

    A step takes longer with more experiments. A step that has not run yet is assumed to have its usual share, or none
    if it was skipped.

    Args:
        experiments: that the campaign will make.
        later: campaigns like it that are still to come.
    """

    def __init__(self, experiments: int, later: int = 0) -> None:
        self.experiments = experiments
        self.later = later
        self._seconds: dict[str, float] = dict.fromkeys(STEPS, 0.0)
        self._work: dict[str, float] = dict.fromkeys(STEPS, 0.0)
        self._passed: set[str] = set()
        self._running: tuple[str, int] | None = None
        self._since = time.monotonic()

    def remaining(self, progress: Progress) -> float | None:
        """Remaining seconds; None as long as they are unknown.

        Args:
            progress: where the campaign is.
        """
        now, names = time.monotonic(), list[str](STEPS)
        if self._running != (progress.phase, progress.experiments):
            first = 0
            if self._running is not None and self._running[0] in STEPS:
                step, experiments = self._running
                self._seconds[step] += now - self._since
                self._work[step] += _work(experiments)
                first = names.index(step) + 1 if experiments == progress.experiments else 0
            if progress.phase in STEPS:
                self._passed |= set(names[first : names.index(progress.phase)])
            self._running, self._since = (progress.phase, progress.experiments), now
        usual = sum(USUAL[step][1] * work for step, work in self._work.items())
        if usual <= 0.0:
            return None
        pace = sum(self._seconds.values()) / usual
        rates = {
            step: self._seconds[step] / work
            if work > 0.0
            else pace * USUAL[step][1] * (step not in self._passed)
            for step, work in self._work.items()
        }
        return max(0.0, self._seconds_ahead(progress, rates, now - self._since))

    def _seconds_ahead(self, progress: Progress, rates: dict[str, float], running: float) -> float:
        names = list[str](STEPS)
        seconds = 0.0
        for experiments in range(1, self.experiments + 1):
            last = experiments == self.experiments
            steps = [name for name in names if not (last and name == "candidates")]
            whole = sum(rates[step] for step in steps) * _work(experiments)
            seconds += whole * self.later
            if experiments > progress.experiments:
                seconds += whole
            elif experiments == progress.experiments and progress.phase in steps:
                after = steps[names.index(progress.phase) + 1 :]
                seconds += max(0.0, rates[progress.phase] * _work(experiments) - running)
                seconds += sum(rates[step] for step in after) * _work(experiments)
        return seconds


def _work(experiments: int) -> float:
    """How much there is to do after so many experiments, more or less."""
    return 1.0 + experiments


def estimate(options: AnyOptions, experiments: int, later: int = 0) -> Remaining:
    """The estimate of the remaining time of campaigns.

    Args:
        options: of the campaigns.
        experiments: that each will make.
        later: campaigns like it that are still to come.
    """
    if isinstance(options, Options):
        return Estimate(options, experiments, later)
    return StepEstimate(experiments, later)


def duration(seconds: float) -> str:
    """A length of time, for a person.

    Args:
        seconds: s.

    Returns:
        Such as "42 s", "3 min 05 s" or "2 h 10 min".
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"

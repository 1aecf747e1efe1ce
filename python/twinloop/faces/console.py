"""Progress on standard error: a live table on a terminal, a plain line every few seconds elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table

from twinloop._ground.steps import STEPS
from twinloop.campaign.history import Progress
from twinloop.campaign.presets import AnyOptions
from twinloop.campaign.remaining import USUAL, duration, estimate

LINE_SECONDS = 5.0
"""Between two plain lines."""


class Watch:
    """Shows the progress of campaigns; use it as a context, and as the campaigns' progress callback.

    Args:
        options: of the campaigns.
        experiments: that each will make.
        name: what is being run.
        campaigns: how many there will be, one after the other.
        after: seconds before the first plain line: for work that is often done at once.
    """

    def __init__(
        self, options: AnyOptions, experiments: int, name: str, campaigns: int = 1, after: float = 0.0
    ) -> None:
        self.experiments = experiments
        self.label = name
        self._name, self._campaigns = name, campaigns
        self._in_steps = options.identifies
        self._estimate = estimate(options, experiments, campaigns - 1)
        self._console = Console(stderr=True)
        self._lock = threading.Lock()
        self._seen: Progress | None = None
        self._started = time.monotonic()
        self._live = self._table_on_terminal() if sys.stderr.isatty() else None
        self._phase: tuple[str, int] | None = None
        self._phase_start = (0.0, 0)
        self._last_line = self._started + after - LINE_SECONDS

    def _table_on_terminal(self) -> Live:
        # What a system prints meanwhile goes above the table, but not to where nobody sent it.
        same = sys.stdout is not None and sys.stdout.isatty()
        if self._in_steps:  # a step may take seconds: the clock goes on within it
            return Live(
                console=self._console,
                get_renderable=self._now,
                refresh_per_second=4,
                transient=True,
                redirect_stdout=same,
            )
        return Live(console=self._console, auto_refresh=False, transient=True, redirect_stdout=same)

    def __enter__(self) -> Watch:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def begin(self, campaign: int) -> None:
        """Says that a campaign begins.

        Args:
            campaign: its number, from 0.
        """
        self.label = f"{self._name}, run {campaign + 1} of {self._campaigns}"
        self._estimate.later = self._campaigns - 1 - campaign

    def __call__(self, progress: Progress) -> None:
        """Shows where the campaign is."""
        now = time.monotonic()
        if self._phase != (progress.phase, progress.iteration):
            self._phase = (progress.phase, progress.iteration)
            self._phase_start = (now, progress.evaluations)
        elapsed = now - self._phase_start[0]
        rate = (progress.evaluations - self._phase_start[1]) / elapsed if elapsed > 0.0 else None
        with self._lock:
            self._seen = progress
            remaining = self._estimate.remaining(progress)
        if self._live is not None:
            if self._in_steps:
                self._live.refresh()
            else:
                self._live.update(self._table(progress, rate, remaining), refresh=True)
        elif now - self._last_line >= LINE_SECONDS:
            self._last_line = now
            self._console.print(
                self._line(progress, rate, remaining), highlight=False, soft_wrap=True, markup=False
            )

    def say(self, line: str) -> None:
        """Says something that stays: above the table, where there is one.

        Args:
            line: for a person.
        """
        self._console.print(line, highlight=False, soft_wrap=True, markup=False)

    def _now(self) -> Table:
        """The table as it is at this moment; called from the thread that redraws it."""
        with self._lock:
            progress = self._seen
            remaining = None if progress is None else self._estimate.remaining(progress)
        if progress is None:
            table = Table.grid()
            table.add_row(self.label, style="bold")
            return table
        return self._table(progress, None, remaining)

    def _headline(
        self, progress: Progress, rate: float | None, remaining: float | None
    ) -> list[tuple[str, str]]:
        if progress.phase == "experiment":
            return [("flying experiment", f"{progress.experiments + 1} of {self.experiments}")]
        facts = [("experiments", f"{progress.experiments} of {self.experiments}")]
        if progress.phase in STEPS:
            facts.append(
                ("step", f"{progress.generation} of {progress.generations}, {USUAL[progress.phase][0]}")
            )
            if progress.archive_size:
                facts.append(("committee", str(progress.archive_size)))
            facts.append(("elapsed", duration(time.monotonic() - self._started)))
        else:
            facts += [
                ("iteration", str(progress.iteration)),
                (f"generation of {progress.phase}", f"{progress.generation} of {progress.generations}"),
                ("non-dominated", str(progress.archive_size)),
                ("evaluations/s", "–" if rate is None else f"{rate:.0f}"),
            ]
        return [*facts, ("left", "–" if remaining is None else duration(remaining))]

    def _line(self, progress: Progress, rate: float | None, remaining: float | None) -> str:
        errors = ", ".join(
            f"{test}: {free:.3g}" for test, free in zip(progress.tests, progress.closed_loop, strict=False)
        )
        parts = [f"{name} {value}" for name, value in self._headline(progress, rate, remaining)]
        if errors:
            parts.append(f"closed loop of test {errors}")
        return f"{self.label}: {'; '.join(parts)}"

    def _table(self, progress: Progress, rate: float | None, remaining: float | None) -> Table:
        outer = Table.grid(padding=(0, 3))
        facts = Table.grid(padding=(0, 2))
        facts.add_row(self.label, style="bold")
        for name, value in self._headline(progress, rate, remaining):
            facts.add_row(name, value)
        if not progress.closed_loop:
            outer.add_row(facts)
            return outer
        steps = progress.open_loop or (None,) * len(progress.closed_loop)
        columns = ["test", "open loop", "closed loop"] if progress.open_loop else ["test", "closed loop"]
        errors = Table(*columns, box=None, header_style="bold")
        for test, step, free in zip(progress.tests, steps, progress.closed_loop, strict=False):
            numbers = [free] if step is None else [step, free]
            errors.add_row(str(test), *(f"{number:.3g}" for number in numbers))
        outer.add_row(facts, errors)
        return outer

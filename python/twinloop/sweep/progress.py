"""What a person sees of jobs that are worked off: a bar on a terminal, plain lines elsewhere, and what has failed."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from twinloop.campaign.remaining import duration


class JobBar:
    """The jobs that are done, on standard error; use it as a context.

    Args:
        label: what is being worked off.
        total: jobs in all.
        pause: seconds between two plain lines, at least.
    """

    def __init__(self, label: str, total: int, pause: float = 0.0) -> None:
        self.total, self.pause, self.done = total, pause, 0
        self._console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[last]}"),
            TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
            console=self._console, transient=True, disable=not self._console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task(label, total=total, last="")
        self._begun = self._spoke = time.monotonic()

    def __enter__(self) -> JobBar:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def advance(self, name: str, failure: str | None = None, known: bool = False, result: str = "") -> None:
        """Says that a job is done.

        Args:
            name: of the job.
            failure: why it failed; None if it did not.
            known: whether it had been done before: worth no line.
            result: what came of it, in a few words.
        """
        self.done += 1
        if failure is not None:
            self._print(f"Failed: {name}: {failure}")
        self._bar.update(self._task, advance=1, last=name)
        now = time.monotonic()
        if self._console.is_terminal or known or now - self._spoke < self.pause:
            return
        self._spoke = now
        rest = duration((now - self._begun) / self.done * (self.total - self.done))
        self._print(
            f"{self.done} of {self.total}: {name}{f': {result}' if result else ''}; about {rest} left"
        )

    def _print(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)

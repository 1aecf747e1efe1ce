"""The progress that a campaign shows by itself, on a terminal; what shows it stands above and is loaded when needed."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from twinloop.campaign.history import Progress
from twinloop.campaign.presets import AnyOptions

TERMINAL = threading.Lock()
"""Held by the campaign that shows its progress: a terminal has room for one table."""


class OwnProgress:
    """Shows the work of a campaign with the remaining time, where standard error is a terminal; nothing elsewhere.

    Args:
        options: of the campaign.
    """

    def __init__(self, options: AnyOptions) -> None:
        self._options = options
        self._work: tuple[str, int] | None = None
        self._shown: Any = None
        self._open = ExitStack()

    @contextmanager
    def during(self, name: str, experiments: int) -> Iterator[None]:
        """Work whose progress may be shown; work within it belongs to it.

        Args:
            name: of the work.
            experiments: that there will be at its end.
        """
        if self._work is not None:
            yield
            return
        self._work = name, experiments
        try:
            yield
        finally:
            self._work = self._shown = None
            self._open.close()

    def __call__(self, progress: Progress) -> None:
        """Shows where the campaign is; the table appears with the first thing that it has to say."""
        if self._shown is None and self._work is not None and _at_terminal() and TERMINAL.acquire(False):
            self._open.callback(TERMINAL.release)
            name, experiments = self._work
            watch = import_module("twinloop.faces.console").Watch(self._options, experiments, name)
            self._shown = self._open.enter_context(watch)
        if self._shown is not None:
            self._shown(progress)


def _at_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()

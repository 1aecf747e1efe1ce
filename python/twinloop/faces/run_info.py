"""What may differ between equal runs: times, threads, host, command line, versions."""

from __future__ import annotations

import platform
import time
from datetime import datetime, timezone

from twinloop._ground.versions import versions
from twinloop.campaign.provenance import command_line


class Stopwatch:
    """Starts when it is made.

    Args:
        threads: that the engine may use.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._started = datetime.now(timezone.utc)
        self._clock = time.monotonic()

    def info(self) -> dict[str, object]:
        """The facts of the run so far."""
        return {
            "started": self._started.isoformat(timespec="seconds"),
            "seconds": time.monotonic() - self._clock,
            "threads": self.threads,
            "host": platform.node(),
            "machine": platform.machine(),
            "command": command_line(),
            "versions": versions(),
        }

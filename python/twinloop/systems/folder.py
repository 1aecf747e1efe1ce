"""A drop folder: test sheets go in, a rig that nobody here drives writes one log for each, and they are read."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path

from twinloop._ground.arrays import number
from twinloop._ground.writing import write_whole
from twinloop.errors import InvalidInput, NoAnswer, TwinloopError
from twinloop.logs import Log, read_log
from twinloop.signals import Signals
from twinloop.systems.base import System
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

LOOK = 0.2
"""Seconds between two looks into the folder."""
LONGEST_REASON = 10_000
"""Bytes of a file that says why a run was stopped."""


class Folder(System):
    """Writes `test-0003.json` and waits for the log of test 3, `flight-0003.csv` or `flight-0003.npz`.

    The sheet has gains, start, target, steps, period, excitation and hold-back, by name. The log has the format of
    `twinloop.load`, a row for each state; it is read once it has not changed for `settled` seconds. If the run was
    stopped, the rig writes the reason into `flight-0003.txt`, as a sentence, before the log; then the log may be
    shorter. Nothing in the folder is ever removed or overwritten: if the log of a test already exists, after a crash
    or a correction, it is read. A test has one log; to repeat a test, make another one with its gains.

    Args:
        path: of the folder; made if it does not exist.
        signals: its states, commands and period.
        timeout: seconds to wait for a log; None: no limit.
        settled: seconds for which a log must not have changed.
        columns: of a CSV file the columns of `t`, states and commands that have other names there.
        default_gains: a safe first controller, by name.

    Raises:
        InvalidInput: a path that is no folder and cannot become one, or times that cannot be used.
    """

    def __init__(
        self,
        path: str | Path,
        signals: Signals,
        *,
        timeout: float | None = None,
        settled: float = 2.0,
        columns: Mapping[str, str] | None = None,
        default_gains: Mapping[str, float] | None = None,
    ) -> None:
        if not isinstance(signals, Signals):
            raise InvalidInput(
                f"Folder, signals: expected twinloop.Signals, found {signals!r}; describe them."
            )
        self.path, self._signals = Path(path), signals
        self.log: Log | None = None
        self._columns = None if columns is None else dict(columns)
        self.timeout = None if timeout is None else number("Folder, timeout (s)", timeout, above=0.0)
        self.settled = number("Folder, settled (s)", settled, above=0.0)
        if default_gains is not None:
            self.default_gains = dict(default_gains)
        try:
            self.path.mkdir(exist_ok=True)
        except OSError as reason:
            raise InvalidInput(
                f"Folder {self.path}: expected a folder, or to be allowed to make it, found {reason.strerror}."
            ) from reason

    @property
    def signals(self) -> Signals:
        """Its states, commands and period."""
        return self._signals

    def run(self, test: Test) -> Trajectory:
        """Writes the sheet of one test, and waits for its log.

        Args:
            test: to fly.

        Returns:
            The logged run.

        Raises:
            NoAnswer: no log in time, or one that cannot be read; another call goes on waiting for it.
            InvalidInput: the test is for other signals, or the folder holds tests of another campaign.
        """
        check_signals(test, self._signals)
        digits = f"{test.number:04d}"
        self._write(self.path / f"test-{digits}.json", sheet_of(test), digits)
        return self._read(self._awaited(digits), self.path / f"flight-{digits}.txt", test)

    def _write(self, file: Path, sheet: dict[str, object], digits: str) -> None:
        """Writes a sheet, whole or not at all; one that is there must be the same."""
        text = json.dumps(sheet, indent=1) + "\n"
        if file.exists():
            if file.read_text(encoding="utf-8") != text:
                raise InvalidInput(
                    f"Folder {self.path}: expected no {file.name}, or the same, found that of another test or campaign;"
                    " take an empty folder."
                )
            return
        for log in self._logs(digits):
            raise InvalidInput(
                f"Folder {self.path}: expected no {log.name} before its test was asked for, found one; take an empty"
                " folder, or attach that log."
            )
        write_whole(file, text)

    def _logs(self, digits: str) -> list[Path]:
        logs = (self.path / f"flight-{digits}{suffix}" for suffix in (".csv", ".npz"))
        return [log for log in logs if log.exists()]

    def _awaited(self, digits: str) -> Path:
        """The log, once it has stayed as it is for a while."""
        begun, seen, since = time.monotonic(), None, 0.0  # type: float, object, float
        while True:
            logs = self._logs(digits)
            if len(logs) > 1:
                names = " and ".join(log.name for log in logs)
                raise NoAnswer(
                    f"Folder {self.path}: expected one log, found {names}; leave the right one, and go on."
                )
            now = time.monotonic()
            if logs:
                found = logs[0].stat()
                if (found.st_size, found.st_mtime_ns) != seen:
                    seen, since = (found.st_size, found.st_mtime_ns), now
                elif now - since >= self.settled:
                    return logs[0]
            elif self.timeout is not None and now - begun > self.timeout:
                raise NoAnswer(
                    f"Folder {self.path}: expected flight-{digits}.csv or .npz within {self.timeout:g} s, found none;"
                    " check the rig, and go on once the log is there."
                )
            time.sleep(min(LOOK, self.settled))

    def _read(self, log: Path, why: Path, test: Test) -> Trajectory:
        reason = ""
        if why.exists():
            with why.open("rb") as file:
                reason = " ".join(file.read(LONGEST_REASON).decode("utf-8", "replace").split())
        ended = "aborted" if why.exists() else "completed"
        try:
            self.log = read_log(log, self._signals, columns=self._columns)
            self.log.warn()
            run = self.log.trajectory(ended, reason or "the rig stopped it")
        except TwinloopError as refusal:
            raise NoAnswer(f"{refusal} Correct {log.name}, and go on.") from refusal
        if run.steps > test.steps or (ended == "completed" and run.steps < test.steps):
            advice = "cut it" if run.steps > test.steps else f"write why it was stopped into {why.name}"
            raise NoAnswer(
                f"Log {log}: expected {test.steps + 1} rows of states, found {run.steps + 1}, unchanged for"
                f" {self.settled:g} s; complete it, or {advice}, and go on."
            )
        if ended == "completed":
            return Trajectory(run.t, run.states, run.commands)
        return run


def sheet_of(test: Test) -> dict[str, object]:
    """A test as a rig needs it: names, numbers and lists.

    Args:
        test: to be flown.
    """
    signals = test.family.signals
    target = test.target_state
    excitation = test.excitation
    return {
        "campaign": test.campaign,
        "test": test.number,
        "dt": signals.dt,
        "steps": test.steps,
        "gains": test.parameters,
        "initial_state": dict(zip(signals.state_names, test.initial_state.tolist(), strict=True)),
        # A target that varies with time is a row a state.
        "target_state": dict(zip(signals.state_names, target.T.tolist(), strict=True)),
        "excitation": None
        if excitation is None
        else dict(zip(signals.command_names, excitation.T.tolist(), strict=True)),
        # Inner and outer range of each state that holds the excitation back; an end that is open is null.
        "hold_back": None if test.hold_back is None else test.hold_back.ranges(signals),
    }

"""Logs of PX4 (ULog): fields of topics, each with times of its own, brought onto one period."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput, NotAvailable, unknown
from twinloop.logs.headers import refuse_others
from twinloop.logs.samples import Samples, Window, held, interpolated, refuse_gaps, without_jumps
from twinloop.remarks import Remark, note
from twinloop.signals import Signals
from twinloop.unmeasured import logged

ADDRESS = re.compile(r"([a-z0-9_]+)(?:/([0-9]{1,3}))?\.(\S+)", re.ASCII | re.IGNORECASE)
"""A topic, which of several of that name, and a field: "vehicle_attitude.roll", "sensor_gyro/1.x"."""
EULER = ("roll", "pitch", "yaw")
"""Angles that stand in no field and are made of a topic's quaternion q, which turns by yaw, then pitch, then roll."""
HEADER = 3
"""Bytes before each message: its size (2), and its kind."""
KINDS = frozenset(bytes([kind]) for kind in b"ABCDFILMOPQRS")
"""Of messages, by the specification of the format."""
LONGEST = 10_000
"""Bytes of a message; one that is longer is taken for damage, as by pyulog."""
MOST_FIELDS = 20_000
"""Of a topic, arrays and nested ones unfolded: a few bytes of a file could ask for billions."""


class _Watched(io.BufferedReader):
    """A file that knows whether it ended within a message, and whether that had a header that makes sense.

    Where power was lost the last message was begun as all others. Damage within a file leads to a header of any bytes,
    whose message seems to go beyond the end.
    """

    cut = damaged = False
    _before = b""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        # At its right end a file has no byte of another message.
        if size is not None and 0 < len(data) < size:
            self.cut = True
            header = self._before
            if len(header) == HEADER and int.from_bytes(header[:2], "little") == size:
                self.damaged = header[2:] not in KINDS or len(data) > LONGEST
        self._before = data
        return data


def read_ulog(
    path: Path, called: str, signals: Signals, columns: Mapping[str, str] | None, window: Window
) -> tuple[Floats, Floats, Floats, tuple[Remark, ...]]:
    """Times (n + 1,) from 0, states (n + 1, n_x) and commands (n, n_u) of a log, a row each period; and remarks on it.

    Where a state that is not measured has no field, the states are those that are.

    States are interpolated between the two samples beside each time, commands are those sent last.

    Args:
        path: of the file, whose size was checked.
        called: what messages call it.
        signals: that are wanted; their `dt` is the period.
        columns: the field of each state and command.
        window: the part that is meant.

    Raises:
        InvalidInput: a damaged or hostile file, a field that is missing, samples too far apart, or no time in common.
        NotAvailable: the package pyulog is missing.
    """
    wanted = logged(signals, columns or ())
    names = (*(state.name for state in wanted), *signals.command_names)
    fields = _fields(called, names, columns)
    log, cut = _parsed(path, called, sorted({topic for topic, _, _ in fields.values()}))
    found = {name: _samples(log, called, *fields[name]) for name in names}
    start, stop = _common(called, list(found.values()), window, signals.dt)
    for samples in found.values():
        refuse_gaps(called, samples, start, stop, signals.dt)
    count = int((stop - start) / signals.dt + 1e-6)
    times = np.asarray(start + signals.dt * np.arange(count + 1), dtype=np.float64)
    states = [interpolated(found[state.name], state, times) for state in wanted]
    commands = [held(found[name], times[:-1]) for name in signals.command_names]
    remarks = [_ends_early(found.values())] if cut and window.stop is None else []
    return times - start, np.stack(states, axis=1), np.stack(commands, axis=1), tuple(remarks)


def _ends_early(found: Iterable[Samples]) -> Remark:
    until = max(float(samples.times[-1]) for samples in found)
    return note(
        "cut",
        f"The file ends within a message, as when power is lost: it can be read until {until:.6g} s after its"
        " beginning, and what came later is missing. If the flight ended badly there, take the part before that.",
    )


def _fields(
    called: str, names: Sequence[str], columns: Mapping[str, str] | None
) -> dict[str, tuple[str, int, str]]:
    """Topic, instance and field of each signal."""
    example = '{"roll": "vehicle_attitude.roll", "p": "vehicle_angular_velocity.xyz[0]"}'
    if not columns:
        raise InvalidInput(
            f"Log {called}: expected the field of each state and command, such as columns={example}, found none; name"
            " them, or write them into the section [log] of a campaign file and make a CSV:"
            f" twinloop check {called} FILE.toml -o flight.csv"
        )
    found = {}
    for name in names:
        if name not in columns:
            raise InvalidInput(f"Log {called}, columns: expected a field for {name!r}, found none; name it.")
        address = columns[name]
        match = ADDRESS.fullmatch(address) if isinstance(address, str) else None
        if match is None:
            raise InvalidInput(
                f"Log {called}, columns: expected topic.field or topic/1.field for {name!r}, found {address!r}."
            )
        found[name] = match[1], int(match[2] or 0), match[3]
    refuse_others(columns, names, f"in the columns of the log {called}")
    return found


def _parsed(path: Path, called: str, topics: list[str]) -> tuple[Any, bool]:
    """The log with these topics, as pyulog reads it, and whether it is cut; what it stumbles over is one sentence."""
    try:
        from pyulog import ULog
    except ImportError as missing:
        raise NotAvailable(
            "Logs of PX4 need the package pyulog, which is not installed: pip install 'twinloop[ulog]'."
        ) from missing

    class Bounded(ULog):  # type: ignore[misc]
        topics: ClassVar[set[str]] = set()  # also of those whose samples are not read

        class _MessageAddLogged(ULog._MessageAddLogged):  # type: ignore[misc]
            def _parse_format(self, formats: Any) -> None:
                super()._parse_format(formats)
                Bounded.topics.add(self.message_name)

            def _parse_nested_type(self, prefix: str, name: str, formats: Any) -> None:
                sizes = [max(1, size) for _, size, _ in formats[name].fields]
                if len(self.field_data) + sum(sizes) > MOST_FIELDS or prefix.count(".") > 8:
                    raise ValueError(f"more than {MOST_FIELDS} fields in {name}")
                super()._parse_nested_type(prefix, name, formats)

    try:
        # pyulog prints its warnings, and does not close what it opened where it fails.
        with _Watched(io.FileIO(path)) as file, contextlib.redirect_stdout(io.StringIO()):
            log = Bounded(file, topics)
    except OSError:
        raise
    except Exception as reason:
        raise InvalidInput(
            f"Log {called}: expected a log of PX4 (ULog), found another file or a damaged one: {reason}."
        ) from reason
    if log.file_corruption or file.damaged:
        raise InvalidInput(
            f"Log {called}: expected a whole log, found a damaged one; copy it from the card again, or save"
            " its undamaged part as CSV."
        )
    return log, file.cut


def _samples(log: Any, called: str, topic: str, instance: int, field: str) -> Samples:
    same = [data for data in log.data_list if data.name == topic]
    if not same:
        raise _no_samples(log, called, topic)
    data = next((each.data for each in same if each.multi_id == instance), None)
    address = f"{topic}/{instance}.{field}" if instance else f"{topic}.{field}"
    if data is None or "timestamp" not in data:
        raise InvalidInput(
            f"Log {called}: expected {address}, found the instances"
            f" {', '.join(str(each.multi_id) for each in same)} of {topic}; name one of them."
        )
    quaternion = [f"q[{i}]" for i in range(4)]
    if field in data:
        values = np.asarray(data[field], dtype=np.float64)
    elif field in EULER and all(part in data for part in quaternion):
        values = _angle(field, *(np.asarray(data[part], dtype=np.float64) for part in quaternion))
    else:
        angles = EULER if all(part in data for part in quaternion) else ()
        raise unknown(f"field of {topic} in the log {called}", field, [*angles, *sorted(data)])
    micro = data["timestamp"]
    expected = f"Log {called}: expected samples of {address} at increasing times"
    if (micro < log.start_timestamp).any():
        raise InvalidInput(f"{expected}, found some before the log begins; take another log.")
    times = (micro - np.uint64(log.start_timestamp)).astype(np.float64) * 1e-6
    _refuse_disorder(expected, times)
    return Samples(address, times, values)


def _no_samples(log: Any, called: str, topic: str) -> InvalidInput:
    """The error for a topic that has no samples."""
    if not log.topics:
        return InvalidInput(
            f"Log {called}: expected samples of {topic}, found no topic at all; copy the log from the card again, or"
            " take another one."
        )
    if topic in log.message_formats:
        return InvalidInput(
            f"Log {called}: expected samples of {topic}, found its format alone; have that topic logged, or name a"
            f" field of one that is: {', '.join(sorted(log.topics - {topic})) or 'none'}."
        )
    return unknown(f"topic, which the log {called} should have:", topic, sorted(log.topics))


def _refuse_disorder(expected: str, times: Floats) -> None:
    """Refuses times (m,), s after the beginning of a log, that are too few or do not increase."""
    steps = np.diff(times)
    if len(times) < 2:
        raise InvalidInput(f"{expected}, at least two, found {len(times)}; take a longer log.")
    if (steps < 0.0).any():
        place = int(np.argmax(steps < 0.0))
        raise InvalidInput(
            f"{expected}, found {times[place + 1]:.6g} s after {times[place]:.6g} s; save it as CSV, sorted."
        )
    if (steps == 0.0).any():
        again = times[1:][steps == 0.0]
        raise InvalidInput(
            f"{expected}, found {len(again)} that repeat the time of the one before, the first {again[0]:.6g} s after"
            " the beginning of the log; it logs them twice: save it as CSV without the repeated ones, or name another"
            " instance or topic."
        )


def _angle(name: str, w: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """An angle of attitudes, rad, without jumps by a turn; the last bits of the C library's arcs are rounded away."""
    if name == "pitch":
        angle = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    elif name == "roll":
        angle = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    else:
        angle = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.round(without_jumps(angle, 2.0 * np.pi), 12)


def _common(called: str, found: Sequence[Samples], window: Window, dt: float) -> tuple[float, float]:
    """From when to when all fields are there, within what is meant."""
    first, last = max(each.times[0] for each in found), min(each.times[-1] for each in found)
    start = first if window.start is None else window.start
    stop = last if window.stop is None else window.stop
    if not (first - 1e-9 <= start and start + 2.0 * dt <= stop and stop <= last + 1e-9):
        raise InvalidInput(
            f"Log {called}: expected a time of at least two periods ({2.0 * dt:g} s) within {first:.6g} to {last:.6g} s"
            f" after its beginning, where all fields are there, found {start:.6g} to {stop:.6g} s; name another one."
        )
    return float(start), float(stop)

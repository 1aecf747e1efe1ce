"""Plain forms of what the native module holds: programs as their text, models as programs in a form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from twinloop import _core
from twinloop.errors import InvalidInput
from twinloop.records.reading import (
    keys,
    read_flag,
    read_list,
    read_number,
    read_text,
    read_whole,
)

MODEL_KEYS = ("program", "form", "actuators", "hidden")
ACTUATOR_KEYS = ("lag", "delay", "rest")
HIDDEN_KEYS = ("commands", "squared", "rest", "time")
MOTION_KEYS = ("states", "settled")
TURNING_KEYS = ("turns", "gap", "damping")
HELD_KEYS = ("state", "every", "first", "age")
COMPUTED_KEYS = ("state", "of", "kept", "share")


def read_program(value: object, where: str) -> _core.Program:
    """A program from its text."""
    text = read_text(value, where)
    return _core.Program.parse(text)


def model_record(model: _core.Model) -> dict[str, Any]:
    """A model without its signals: program, form, actuators, hidden states, sensors' offsets and reports, levels."""
    record: dict[str, Any] = {
        "program": str(model.program),
        "form": model.form,
        "actuators": [_actuator_record(*actuator) for actuator in model.actuators],
        "hidden": [_hidden_record(*hidden) for hidden in model.hidden],
    }
    if model.offsets:
        record["offsets"] = model.offsets
    if model.levels:
        record["levels"] = model.levels
    held, computed = model.reports
    if held or computed:
        record["reports"] = {
            "held": [dict(zip(HELD_KEYS, one, strict=True)) for one in held],
            "computed": [dict(zip(COMPUTED_KEYS, one, strict=True)) for one in computed],
        }
    return record


def read_model(value: object, where: str, given: tuple[object, ...]) -> _core.Model:
    """The model that a record was written of, over the signals that are given."""
    engines = (getattr(value, "engine", None) for value in given)
    signals = next((engine for engine in engines if isinstance(engine, _core.Signals)), None)
    if signals is None:
        raise InvalidInput(
            f"Record {where}: expected the signals of the model beside the record, found none; pass them."
        )
    found = keys(value, MODEL_KEYS, where, optional=("offsets", "levels", "reports"))
    program = read_program(found["program"], f"{where}.program")
    actuators = [
        _actuator(item, f"{where}.actuators[{i}]")
        for i, item in enumerate(read_list(found["actuators"], f"{where}.actuators"))
    ]
    hidden = [
        _hidden(item, f"{where}.hidden[{i}]")
        for i, item in enumerate(read_list(found["hidden"], f"{where}.hidden"))
    ]
    offsets = [
        read_number(item, f"{where}.offsets[{i}]")
        for i, item in enumerate(read_list(found.get("offsets", []), f"{where}.offsets"))
    ]
    levels = [
        [read_number(value, f"{where}.levels[{i}]") for value in read_list(each, f"{where}.levels[{i}]")]
        for i, each in enumerate(read_list(found.get("levels", []), f"{where}.levels"))
    ]
    form = read_text(found["form"], f"{where}.form")
    model = _core.Model(program, form, signals, actuators or None, hidden, offsets)
    model = model.with_levels(levels) if levels else model
    return (
        model.with_reports(*_reports(found["reports"], f"{where}.reports")) if "reports" in found else model
    )


def _reports(
    value: object, where: str
) -> tuple[list[tuple[int, int, int, int]], list[tuple[int, int, float, float]]]:
    """What is given of readings, as the engine takes it, which checks it."""
    found, held, computed = keys(value, ("held", "computed"), where), [], []
    for i, item in enumerate(read_list(found["held"], f"{where}.held")):
        at = f"{where}.held[{i}]"
        one = keys(item, HELD_KEYS, at)
        state, every, first, age = (_count(read_whole(one[key], f"{at}.{key}"), at) for key in HELD_KEYS)
        held.append((state, every, first, age))
    for i, item in enumerate(read_list(found["computed"], f"{where}.computed")):
        at = f"{where}.computed[{i}]"
        one = keys(item, COMPUTED_KEYS, at)
        state, of = (_count(read_whole(one[key], f"{at}.{key}"), at) for key in COMPUTED_KEYS[:2])
        kept, share = (read_number(one[key], f"{at}.{key}") for key in COMPUTED_KEYS[2:])
        computed.append((state, of, kept, share))
    return held, computed


def _actuator_record(lag: float, delay: int, rest: float | None, ramp: float) -> dict[str, Any]:
    record: dict[str, Any] = dict(zip(ACTUATOR_KEYS, (lag, delay, rest), strict=True))
    return {**record, "ramp": ramp} if ramp else record


def _actuator(value: object, where: str) -> tuple[float, int, float | None, float]:
    found = keys(value, ACTUATOR_KEYS, where, optional=("ramp",))
    delay = read_whole(found["delay"], f"{where}.delay")
    ramp = read_number(found.get("ramp", 0.0), f"{where}.ramp")
    return read_number(found["lag"], f"{where}.lag"), _count(delay, where), _rest(found["rest"], where), ramp


def _hidden_record(
    commands: Sequence[int],
    squared: bool,
    rest: float | None,
    time: float,
    states: Sequence[int],
    settled: bool,
    turns: float,
    gap: float,
    damping: float,
) -> dict[str, Any]:
    """A hidden state; one that commands fill, or that turns into no other, as every version has written it."""
    record = dict(zip(HIDDEN_KEYS, (list(commands), squared, rest, time), strict=True))
    if states:
        record |= dict(zip(MOTION_KEYS, (list(states), settled), strict=True))
    numbers = {"turns": turns, "gap": gap, "damping": damping}
    return record | {name: value for name, value in numbers.items() if value}


def _hidden(
    value: object, where: str
) -> tuple[list[int], bool, float | None, float, list[int], bool, float, float, float]:
    found = keys(value, HIDDEN_KEYS, where, optional=(*MOTION_KEYS, *TURNING_KEYS))

    def places(key: str) -> list[int]:
        items = read_list(found.get(key, []), f"{where}.{key}")
        return [_count(read_whole(item, where), where) for item in items]

    squared, settled = (read_flag(found.get(key, False), f"{where}.{key}") for key in ("squared", "settled"))
    time = read_number(found["time"], f"{where}.time")
    turns, gap, damping = (read_number(found.get(key, 0.0), f"{where}.{key}") for key in TURNING_KEYS)
    rest = _rest(found["rest"], where)
    return places("commands"), squared, rest, time, places("states"), settled, turns, gap, damping


def _rest(value: object, where: str) -> float | None:
    return None if value is None else read_number(value, f"{where}.rest")


def _count(number: int, where: str) -> int:
    if not 0 <= number < 2**31:
        raise InvalidInput(f"Record {where}: expected a number from 0 to 2**31, found {number}.")
    return number

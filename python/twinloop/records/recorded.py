"""Plain records: values as numbers, texts, lists and dicts, which another process can read back to the bit."""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, TypeVar, Union

import numpy as np

from twinloop import _core
from twinloop._ground.texts import text
from twinloop.errors import InvalidInput, unknown
from twinloop.records.native import model_record, read_model, read_program
from twinloop.records.reading import (
    keys,
    read_array,
    read_flag,
    read_list,
    read_number,
    read_text,
    read_whole,
    shown,
)

Record = dict[str, Any]
"""Texts to numbers, texts, None, booleans, lists and dicts of them; with "kind" and "version"."""
KINDS: dict[str, type[Recorded]] = {}
"""Classes with a plain form, by the kind that their records name."""
Value = TypeVar("Value", bound="Recorded")


class Recorded:
    """A dataclass with a plain form: a dict with its kind, a version, and a key for each of its fields.

    A subclass names its kind, `class State(Recorded, kind="state")`, and what its records do not repeat,
    `given=(Family,)`: fields of these types are passed to `from_record` again.
    """

    KIND: ClassVar[str]
    VERSION: ClassVar[int] = 1
    GIVEN: ClassVar[tuple[str, ...]] = ()
    RENAMED: ClassVar[Mapping[str, str]] = {}
    """Keys of earlier versions, and what they are called now."""

    def __init_subclass__(cls, kind: str | None = None, given: tuple[str, ...] = (), **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind is not None:
            cls.KIND, cls.GIVEN = kind, given
            KINDS[kind] = cls

    def to_record(self) -> Record:
        """The value as numbers, texts, lists and dicts; JSON holds it without loss."""
        return {**self._head(), **{name: plain(getattr(self, name)) for name in self.recorded_fields()}}

    @classmethod
    def from_record(cls: type[Value], record: object, *given: object) -> Value:
        """The value that a record was written of.

        Args:
            record: such as `to_record` gives, or JSON gives back.
            given: what the record does not repeat, such as the signals of a model.

        Returns:
            The value, equal to the bit.

        Raises:
            InvalidInput: another kind, a newer version, an unknown or missing key, or a value that cannot be used.
        """
        return cls._read(record, cls.KIND, given)

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        fields = dataclasses.fields(cls)  # type: ignore[arg-type]
        return tuple(field.name for field in fields if field.init and field.name not in cls.GIVEN)

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version as this one would have written it.

        Args:
            record: without "kind" and "version".
        """
        return {cls.RENAMED.get(key, key): value for key, value in record.items()}

    @classmethod
    def _head(cls) -> Record:
        return {"kind": cls.KIND, "version": cls.VERSION}

    @classmethod
    def _read(cls: type[Value], record: object, where: str, given: tuple[object, ...]) -> Value:
        hints = _hints(cls)
        fields = {field.name: field for field in dataclasses.fields(cls)}  # type: ignore[arg-type]
        names = cls.recorded_fields()
        optional = [name for name in names if not _required(fields[name])]
        found = checked_record(record, cls, names, where, optional=optional)
        values = {name: read(hints[name], found[name], f"{where}.{name}", given) for name in found}
        values |= {name: beside(hints[name], given, f"{where}.{name}") for name in cls.GIVEN}
        return cls(**values)


def checked_record(
    record: object,
    kind: type[Recorded],
    keys: Sequence[str],
    where: str,
    *,
    optional: Sequence[str] = (),
) -> Record:
    """The keys of a record of a kind, once they are the ones that there should be.

    Args:
        record: from anywhere.
        kind: the class that it should be a record of.
        keys: that it may have beside "kind" and "version".
        where: how to call it in an error.
        optional: keys that may be missing.

    Returns:
        The record without "kind" and "version".

    Raises:
        InvalidInput: no dict, another kind, a newer version, an unknown key or a missing one.
    """
    if not isinstance(record, Mapping):
        raise InvalidInput(f"Record {where}: expected a dict of kind {kind.KIND!r}, found {shown(record)}.")
    found = record.get("kind")
    if found != kind.KIND:
        raise InvalidInput(
            f"Record {where}: expected the kind {kind.KIND!r}, found {shown(found)}; read it with the class that"
            " wrote it."
        )
    version = record.get("version")
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise InvalidInput(
            f"Record {where}: expected a version, a whole number from 1, found {shown(version)}; add it."
        )
    if version > kind.VERSION:
        raise InvalidInput(
            f"Record {where}: expected version {kind.VERSION} of {kind.KIND!r} at most, found {version}; a newer"
            " Twinloop wrote it: install that."
        )
    rest = {key: value for key, value in record.items() if key not in ("kind", "version")}
    if version < kind.VERSION:
        rest = kind.renewed(rest)
    for key in rest:
        if key not in keys:
            raise unknown(f"key in the record {where}", str(key)[:60], keys)
    missing = [key for key in keys if key not in rest and key not in optional]
    if missing:
        raise InvalidInput(f"Record {where}: expected {', '.join(missing)}, found none; add them.")
    return rest


def with_names(items: object, names: Sequence[str], *later: object) -> object:
    """What an earlier version wrote as bare lists, as values with names.

    Args:
        items: of a record; what is no list of bare lists of the right length stays, for reading refuses it.
        names: of the values.
        later: the last values, which that version did not have.
    """
    if not isinstance(items, list):
        return items
    bare = len(names) - len(later)
    return [
        dict(zip(names, [*item, *later], strict=True))
        if isinstance(item, list) and len(item) == bare
        else item
        for item in items
    ]


def plain(value: object) -> Any:
    """A value as numbers, texts, lists and dicts.

    Args:
        value: None, a number, a text, an array, anything with a plain form, or a list or dict of them.

    Returns:
        The same in plain types, a named tuple as a dict. Numbers that are not finite become "inf", "-inf" or "nan"; an
        array without elements {"shape": [...]}; a dict whose keys are numbers a list of pairs.

    Raises:
        TypeError: a value without a plain form.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else str(float(value))
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray):
        if value.size == 0:
            return {"shape": list(value.shape)}
        return value.tolist() if np.isfinite(value).all() else plain(value.tolist())
    if isinstance(value, Recorded):
        return value.to_record()
    if isinstance(value, _core.Program):
        return str(value)
    if isinstance(value, _core.Model):
        return model_record(value)
    if isinstance(value, Mapping):
        if all(isinstance(key, str) for key in value):
            return {key: plain(item) for key, item in value.items()}
        return [[plain(key), plain(item)] for key, item in value.items()]
    if hasattr(value, "_fields"):
        return {name: plain(getattr(value, name)) for name in value._fields}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise TypeError(f"expected a value with a plain form, found {type(value).__name__}")


def read(hint: Any, value: object, where: str, given: tuple[object, ...] = ()) -> Any:
    """The value of a type that something plain was written of.

    Args:
        hint: its type, as annotations have it.
        value: plain, from anywhere.
        where: how to call it in an error.
        given: what records do not repeat.

    Returns:
        A value of that type.

    Raises:
        InvalidInput: something else.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        return _read_union(arguments, value, where, given)
    if hint is Any:
        return value
    if hint in _SIMPLE:
        return _SIMPLE[hint](value, where)
    if origin is np.ndarray:
        return read_array(value, where)
    if hint is _core.Program:
        return read_program(value, where)
    if hint is _core.Model:
        return read_model(value, where, given)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _read_mapping(arguments, value, where, given)
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return _read_sequence(origin, arguments, value, where, given)
    if isinstance(hint, type) and issubclass(hint, Recorded):
        return hint._read(value, where, given)
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        found, hints = keys(value, hint._fields, where), typing.get_type_hints(hint)
        return hint(**{name: read(hints[name], found[name], f"{where}.{name}", given) for name in found})
    return _read_protocol(hint, value, where, given)


def beside(hint: Any, given: tuple[object, ...], where: str) -> Any:
    """What a record does not repeat.

    Args:
        hint: its type.
        given: beside the record.
        where: how to call it in an error.

    Raises:
        InvalidInput: it was not given.
    """
    for value in given:
        if isinstance(value, hint):
            return value
    wanted = getattr(hint, "__name__", hint)
    raise InvalidInput(
        f"Record {where}: expected a {wanted} beside the record, found none; pass it to from_record."
    )


def to_text(record: Mapping[str, object]) -> str:
    """A record as one line of JSON; numbers have all their digits.

    Args:
        record: plain.

    Raises:
        InvalidInput: a text in it has halves of characters, which no file can hold.
    """
    return text("Record", json.dumps(record, ensure_ascii=False, allow_nan=False, separators=(",", ":")))


def _hints(cls: type) -> dict[str, Any]:
    if "_recorded_hints" not in cls.__dict__:
        cls._recorded_hints = typing.get_type_hints(cls)  # type: ignore[attr-defined]
    hints: dict[str, Any] = cls.__dict__["_recorded_hints"]
    return hints


def _required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _read_union(choices: tuple[Any, ...], value: object, where: str, given: tuple[object, ...]) -> Any:
    if value is None and type(None) in choices:
        return None
    refusal: InvalidInput | None = None
    for choice in (choice for choice in choices if choice is not type(None)):
        try:
            return read(choice, value, where, given)
        except InvalidInput as reason:
            refusal = reason
    assert refusal is not None
    raise refusal


def _read_mapping(
    arguments: tuple[Any, ...], value: object, where: str, given: tuple[object, ...]
) -> dict[Any, Any]:
    key_hint, item_hint = arguments
    if key_hint is str:
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
            raise InvalidInput(f"Record {where}: expected a dict, found {shown(value)}.")
        pairs: list[Any] = list(value.items())
    elif value == {}:
        pairs = []  # of an empty dict nobody can say what its keys would have been
    else:
        pairs = [read_list(pair, f"{where}[{i}]") for i, pair in enumerate(read_list(value, where))]
        if not all(len(pair) == 2 for pair in pairs):
            raise InvalidInput(f"Record {where}: expected a list of pairs, found others.")
    return {
        read(key_hint, key, where, given): read(item_hint, item, f"{where}[{shown(key)}]", given)
        for key, item in pairs
    }


def _read_sequence(
    origin: type, arguments: tuple[Any, ...], value: object, where: str, given: tuple[object, ...]
) -> Any:
    items = read_list(value, where)
    if origin is tuple and arguments[-1:] != (...,):
        if len(items) != len(arguments):
            raise InvalidInput(f"Record {where}: expected {len(arguments)} items, found {len(items)}.")
        hints = list(arguments)
    else:
        hints = [arguments[0]] * len(items)
    found = (
        read(hint, item, f"{where}[{i}]", given)
        for i, (hint, item) in enumerate(zip(hints, items, strict=True))
    )
    return list(found) if origin is list else tuple(found)


def _read_protocol(hint: Any, value: object, where: str, given: tuple[object, ...]) -> object:
    """Anything that keeps a protocol, by the kind that the record names."""
    found = value.get("kind") if isinstance(value, Mapping) else None
    possible = [kind for kind, cls in KINDS.items() if _keeps(cls, hint)]
    if found not in possible:
        raise unknown(f"kind in the record {where}", str(found)[:60], possible)
    return KINDS[str(found)]._read(value, where, given)


def _keeps(cls: type, protocol: Any) -> bool:
    return all(hasattr(cls, name) for name in dir(protocol) if not name.startswith("_"))


_SIMPLE: dict[Any, Callable[[object, str], object]] = {
    float: read_number,
    int: read_whole,
    str: read_text,
    bool: read_flag,
}

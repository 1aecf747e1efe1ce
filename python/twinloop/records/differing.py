"""Differing: which values of two plain forms differ, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from twinloop.errors import InvalidInput

LONGEST = 60
"""Characters of a value that are shown."""
MOST = 3
"""Differences that are shown."""
ABSENT = object()
SINCE = "in the store", "now"
"""Where the two are that are compared, unless it is said."""


def differences(known: object, asked: object, where: tuple[str, str] = SINCE) -> str:
    """What differs between what a store holds and what is asked for now; empty where nothing does.

    Args:
        known: plain form of what the store holds.
        asked: the same of what is asked for.
        where: in words, where the one and the other are.

    Returns:
        Such as "signals: state p: derivative_of: 'roll' in the store, none now".
    """
    found = list(_found(known, asked, (), where))
    more = f"; and {len(found) - MOST} more" if len(found) > MOST else ""
    return "; ".join(found[:MOST]) + more


def check_same(known: object, asked: object, what: str) -> None:
    """Refuses another setup or system than the one that is known, and says where they differ.

    Args:
        known: plain form of what the store holds.
        asked: the same of what is asked for.
        what: was expected, as the beginning of a sentence.

    Raises:
        InvalidInput: they differ.
    """
    if known != asked:
        raise InvalidInput(
            f"{what}, found another: {differences(known, asked)}; use another store or another name, or the same"
            " campaign file or arguments as before."
        )


def _found(known: Any, asked: Any, place: tuple[str, ...], where: tuple[str, str]) -> Iterator[str]:
    if known == asked:
        return
    if isinstance(known, Mapping) and isinstance(asked, Mapping):
        for key in dict.fromkeys([*known, *asked]):
            yield from _found(known.get(key, ABSENT), asked.get(key, ABSENT), (*place, str(key)), where)
    elif _named(known) and _named(asked):
        yield from _of_members(known, asked, place, where)
    elif isinstance(known, (list, tuple)) and isinstance(asked, (list, tuple)) and len(known) == len(asked):
        for i, (one, other) in enumerate(zip(known, asked, strict=True)):
            yield from _found(one, other, (*place, str(i + 1)), where)
    else:
        one, other = _cut(_words(known), _words(asked))
        yield f"{': '.join(place)}: {one} {where[0]}, {other} {where[1]}"


def _named(value: object) -> bool:
    """Whether it is a list of records with names, such as states."""
    return isinstance(value, (list, tuple)) and all(
        isinstance(item, Mapping) and "kind" in item and "name" in item for item in value
    )


def _of_members(
    known: Sequence[Mapping[str, Any]],
    asked: Sequence[Mapping[str, Any]],
    place: tuple[str, ...],
    where: tuple[str, str],
) -> Iterator[str]:
    """Differences of the members by name; of their order where they are the same ones."""
    ours, theirs = ({item["name"]: item for item in items} for items in (known, asked))
    for name in dict.fromkeys([*ours, *theirs]):
        item = ours[name] if name in ours else theirs[name]
        member = (*place[:-1], f"{item['kind']} {name}")
        if name in ours and name in theirs:
            yield from _found(ours[name], theirs[name], member, where)
        else:
            one, other = ("", "none ") if name in ours else ("none ", "there ")
            yield f"{': '.join(member)}: {one}{where[0]}, {other}{where[1]}"
    if list(ours) != list(theirs) and set(ours) == set(theirs):
        yield f"{': '.join(place)}: in the order {', '.join(ours)} {where[0]}, {', '.join(theirs)} {where[1]}"


def _words(value: object) -> str:
    if value is None or value is ABSENT:
        return "none"
    if isinstance(value, Mapping):
        return ", ".join(
            f"{key} {_words(item)}" for key, item in value.items() if key not in ("kind", "version")
        )
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_words, value))}]"
    return repr(value)


def _cut(one: str, other: str) -> tuple[str, str]:
    """Both in short, from shortly before where they differ."""
    first = next((i for i, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), 0)
    start = max(0, first - LONGEST // 2) if max(len(one), len(other)) > LONGEST else 0

    def cut(text: str) -> str:
        end = start + LONGEST
        return f"{'…' if start else ''}{text[start:end]}{'…' if len(text) > end else ''}"

    return cut(one), cut(other)

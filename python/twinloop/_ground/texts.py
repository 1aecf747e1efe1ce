"""Texts from anybody, made fit for one line."""

from __future__ import annotations


def one_line(text: str) -> str:
    """A text on one line without control characters, as a comment or an attribute may hold it.

    Args:
        text: from anybody, such as a unit.
    """
    return " ".join("".join(each if each.isprintable() else " " for each in text).split())

"""Remarks: diagnostics of data or a twin, as values with a code, a severity and a sentence."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass

from twinloop.errors import InvalidInput, RemarkWarning, unknown
from twinloop.records import Recorded

SEVERITIES = ("note", "serious")
"""Good to know; or a reason not to use a result before it was looked into."""


@dataclass(frozen=True)
class Remark(Recorded, kind="remark"):
    """What a person should know.

    Args:
        code: a fixed word or two, such as "does-not-follow".
        severity: "note", or "serious": check this before you use the result.
        sentence: the same for a person.

    Raises:
        InvalidInput: no code, no sentence, or another severity.
    """

    code: str
    severity: str
    sentence: str

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise unknown("severity of a remark", self.severity, SEVERITIES)
        if not self.code or not self.sentence:
            raise InvalidInput(
                f"Remark: expected a code and a sentence, found {self.code!r} and {self.sentence!r}."
            )

    @property
    def serious(self) -> bool:
        """Whether this must be checked before the result is used."""
        return self.severity == "serious"

    def __str__(self) -> str:
        return self.sentence


def note(code: str, sentence: str) -> Remark:
    """A remark that is good to know.

    Args:
        code: what it is about.
        sentence: for a person.
    """
    return Remark(code, "note", sentence)


def serious(code: str, sentence: str) -> Remark:
    """A remark that has to be looked into.

    Args:
        code: what it is about.
        sentence: for a person.
    """
    return Remark(code, "serious", sentence)


def warn(remarks: Iterable[Remark], stacklevel: int) -> None:
    """Says serious remarks as Python does: as warnings.

    Args:
        remarks: of any severity.
        stacklevel: calls from here up to the user's line.
    """
    for remark in remarks:
        if remark.serious:
            warnings.warn(f"{remark.sentence} ({remark.code})", RemarkWarning, stacklevel=stacklevel + 1)

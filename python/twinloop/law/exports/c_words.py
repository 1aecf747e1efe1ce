"""Numbers, lists and places of a law as C writes them."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.law.law import Law

BEGIN_C = ("#ifdef __cplusplus", 'extern "C" {', "#endif", "")
"""Opens what a header declares: programs in C++ look for a function of C by its bare name."""

END_C = ("#ifdef __cplusplus", "}", "#endif", "")
"""Closes it."""


def number(value: float, precision: str) -> str:
    """A literal with all its digits.

    Args:
        value: finite.
        precision: "double" or "float".
    """
    return repr(float(value)) + ("f" if precision == "float" else "")


def listed(values: Sequence[float], precision: str) -> str:
    """An initialiser.

    Args:
        values: finite.
        precision: "double" or "float".
    """
    return "{" + ", ".join(number(value, precision) for value in values) + "}"


def places(law: Law, names: Sequence[str]) -> list[int]:
    """Where states stand.

    Args:
        law: of the twin.
        names: of the states.
    """
    return [law.signals.state_names.index(name) for name in names]

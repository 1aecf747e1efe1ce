"""Qualities, units and bounds in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from twinloop._ground.texts import in_unit, two_digits
from twinloop.campaign.examination.examination import Examination


def held_at(gain: Mapping[str, Any]) -> str:
    """Where a gain of a result stands at a bound, for a person.

    Args:
        gain: of the controller; results of earlier versions do not say it.

    Returns:
        "at its upper bound", "at its lower bound" or "".
    """
    return f"at its {gain['at_bound']} bound" if gain.get("at_bound") else ""


QUALITIES = {
    "iae": "integrated absolute error",
    "ise": "integrated squared error",
    "final_distance": "distance of the last state to the target",
}


def with_unit(value: float, unit: str) -> str:
    """A value in its unit."""
    return in_unit(two_digits(value), unit)


def quality_words(kind: str, unit: str) -> str:
    """What is minimised, for a person.

    Args:
        kind: "iae", "ise" or "final_distance".
        unit: of it; "" where it has none.

    Returns:
        Such as "integrated absolute error (rad s)".
    """
    return QUALITIES[kind] + (f" ({unit})" if unit else "")


def predicted_flights(result: Mapping[str, Any]) -> int | None:
    """Flights at most from which risks are taken; None where the result does not say it.

    Args:
        result: of a campaign.
    """
    options = result.get("options", {})
    members, draws = options.get("committee_size"), options.get("draws")
    return None if members is None or draws is None else members * draws


def is_bounded(result: Mapping[str, Any]) -> bool:
    """Whether any state of a result has an envelope.

    Args:
        result: of a campaign.
    """
    return any(state["envelope"] is not None for state in result["signals"]["states"])


def flown_words(found: Examination) -> str:
    """Whether the gains of the controller to fly have flown, for a person.

    Args:
        found: of a campaign with such a controller.

    Returns:
        "flown", "flown only with an excitation" or "not flown yet".
    """
    if found.best_flown is not None:
        return "flown"
    return "flown only with an excitation" if found.best_flights else "not flown yet"


def every(seconds: Sequence[float]) -> str:
    """How often free runs begin again at a reading, for a person.

    Args:
        seconds: length of each piece, s; at least one.

    Returns:
        Such as "every 1.5 s" or "every 1.5 to 3 s".
    """
    least, most = (two_digits(value) for value in (min(seconds), max(seconds)))
    return f"every {least if least == most else f'{least} to {most}'} s"


def controller_name(test: int | None) -> str:
    """What the controller to fly is called.

    Args:
        test: with its gains; None: there is none yet.
    """
    return "tuned gains, not asked for yet" if test is None else f"test {test}"


def counted(measure: Mapping[str, Any]) -> str:
    """What counts in a quality, with weights and units, for a person.

    Args:
        measure: `quality` of a result.

    Returns:
        Such as "2 × pitch (rad), 1 × yaw (rad)".
    """
    squared = "" if measure["kind"] == "iae" else "²"
    parts = [
        f"{each['weight']:.4g} × {each['name']}{squared} ({each['unit'] or '1'})"
        for each in measure["counts"]
    ]
    efforts = (("effort", "commands²"), ("effort_rate", "their rates²"))
    parts += [f"{measure[key]:.4g} × {what} (in scales)" for key, what in efforts if measure[key]]
    return ", ".join(parts)

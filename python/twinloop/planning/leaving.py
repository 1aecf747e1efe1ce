"""Leaving: the risk of leaving the envelope, in numbers and in words that never claim more than the flights show."""

from __future__ import annotations

from twinloop._ground.texts import two_digits


def risk_of(left: int, flights: int) -> float:
    """Probability that the next flight leaves the envelope, as some have left it.

    Half a flight is added on either side: few flights are no certainty.

    Args:
        left: how many left it, or did not end.
        flights: how many there were.
    """
    return (left + 0.5) / (flights + 1.0)


def least_risk(left: int, flights: int) -> float:
    """The same as a lower bound beside what else is known: 0 where all have kept the envelope."""
    return risk_of(left, flights) if left else 0.0


def none_leaves(risk: float, flights: int | None) -> bool:
    """Whether a risk is as small as it can be found: none of the predicted flights leaves the envelope.

    With k of n flights outside, the risk is (k + 1/2) / (n + 1). A k of 1 or more would need n + 1 = 1.5 / risk flights
    or more.

    Args:
        risk: probability.
        flights: that are predicted at most; fewer where the committee is smaller. None: unknown.
    """
    return flights is not None and risk > 0.0 and 1.5 / risk > (flights + 1.0) * (1.0 + 1e-9)


def risk_of_what(bounded: bool) -> str:
    """What a risk is the probability of.

    Args:
        bounded: whether any state has an envelope; without one a predicted flight can only diverge.
    """
    return "leaving the envelope" if bounded else "diverging, without a declared envelope"


def risk_words(risk: float, flights: int | None, bounded: bool = True) -> str:
    """A risk for a person, such as "1.2 %" or "less than 0.4 % (none of 128 predicted flights leaves it)".

    Args:
        risk: probability.
        flights: that are predicted at most; None: unknown.
        bounded: whether any state has an envelope.
    """
    if not none_leaves(risk, flights):
        return _percent(risk)
    count = round(0.5 / risk - 1.0)
    happens = "leaves it" if bounded else "diverges"
    return f"less than {_above(100.0 * risk):g} % (none of {count} predicted flights {happens})"


def short_risk(risk: float | None, flights: int | None) -> str | None:
    """The same for a cell of a table, such as "1.2 %" or "< 0.4 %"; None without a risk.

    Args:
        risk: probability; None without a committee.
        flights: that are predicted at most; None: unknown.
    """
    if risk is None:
        return None
    return f"< {_above(100.0 * risk):g} %" if none_leaves(risk, flights) else _percent(risk)


def _percent(risk: float) -> str:
    return f"{two_digits(100.0 * risk)} %"


def _above(percent: float) -> float:
    """The next larger number of one digit."""
    digit, exponent = f"{percent:.0e}".split("e")
    more = 0 if float(f"{digit}e{exponent}") >= percent else 1
    return float(f"{int(digit) + more}e{exponent}")

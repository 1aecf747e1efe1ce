"""Terms that a user suspects or knows, written as formulas of states and commands: parsed, never run as code."""

from __future__ import annotations

import math

from twinloop.errors import InvalidInput
from twinloop.identification.terms.pool import Pool
from twinloop.law.parsing import parsed
from twinloop.signals import Bounds, Signals

LONGEST = 500
"""Characters of a formula at most."""


def parsed_term(text: str, pool: Pool, signals: Signals) -> int:
    """A formula as a node of the pool.

    A command stands for itself in units of its scale, as a model sees it; states are in their units.

    Args:
        text: such as "rate * abs(rate)" or "sin(angle)": numbers, + − * / **, abs, sqrt, sin, cos, tanh, exp, min, max.
        pool: where it is entered.
        signals: whose names it may use.

    Returns:
        The node.

    Raises:
        InvalidInput: text that is no such formula, or names what is not there.
    """
    if len(text) > LONGEST:
        raise InvalidInput(f"Term: expected at most {LONGEST} characters, found {len(text)}; split it.")
    names = {name: i for i, name in enumerate((*signals.state_names, *signals.command_names))}
    # A number alone is 1 times it: only its coefficient is searched.
    return parsed(text, pool, names, lambda value: pool.add("*", pool.one, value))


def fixed_term(text: str, pool: Pool, signals: Signals) -> tuple[int, int]:
    """What is known of a law.

    Args:
        text: "state: formula", such as "rate: -9.81 * sin(angle)".
        pool: where the formula is entered.
        signals: whose names it may use.

    Returns:
        The state's number, and the node.

    Raises:
        InvalidInput: no such state, or no formula.
    """
    name, separator, formula = text.partition(":")
    if not separator or name.strip() not in signals.state_names:
        raise InvalidInput(
            f"Fixed term {text!r}: expected 'state: formula' with one of the states"
            f" {', '.join(signals.state_names)}; such as '{signals.state_names[-1]}: -9.81 * sin(angle)'."
        )
    # Times 1, so that it is never one of the terms that are searched.
    known = pool.add("*", parsed_term(formula.strip(), pool, signals), 1.0)
    return signals.state_names.index(name.strip()), known


def bounded_term(text: str, pool: Pool, signals: Signals) -> tuple[int, int, Bounds]:
    """What is known of a constant of the law.

    Args:
        text: "state: formula in low .. high", such as "rate: sin(angle) in -20 .. -5"; either number may be left out.
        pool: where the formula is entered.
        signals: whose names it may use.

    Returns:
        The state's number, the node without its numerical factors, and bounds of its coefficient.

    Raises:
        InvalidInput: no such state, no formula, or bounds that nothing is between.
    """
    name, separator, rest = text.partition(":")
    formula, inside, interval = rest.rpartition(" in ")
    first, dots, last = interval.partition("..")
    if not (separator and inside and dots) or name.strip() not in signals.state_names:
        raise InvalidInput(
            f"Bounded term {text!r}: expected 'state: formula in low .. high' with one of the states"
            f" {', '.join(signals.state_names)}; such as '{signals.state_names[-1]}: sin(angle) in -20 .. -5'."
        )
    node, factor = bare_term(parsed_term(formula.strip(), pool, signals), pool)
    if not math.isfinite(factor):
        raise InvalidInput(f"Bounded term {text!r}: expected finite factors, found {factor}; remove them.")
    low, high = _bound(first, text, -math.inf), _bound(last, text, math.inf)
    if not low <= high or (math.isinf(low) and low == high):
        raise InvalidInput(
            f"Bounded term {text!r}: expected low <= high, found {low:g} and {high:g}; exchange or widen them."
        )
    if factor == 0.0:
        raise InvalidInput(f"Bounded term {text!r}: expected a term, found 0 times one; remove the 0.")
    bounds = (low * factor, high * factor) if factor > 0.0 else (high * factor, low * factor)
    return signals.state_names.index(name.strip()), node, bounds


def bare_term(node: int, pool: Pool) -> tuple[int, float]:
    """A term without the numbers that it is multiplied by, and their product."""
    factor = 1.0
    while pool[node].operation == "*":
        a, b = pool[node].operands
        values = pool.constant_value(a), pool.constant_value(b)
        if values[1] is not None:
            node, factor = a, factor * values[1]
        elif values[0] is not None:
            node, factor = b, factor * values[0]
        else:
            break
    return node, factor


def _bound(written: str, text: str, without: float) -> float:
    """A number; where no number is written, an infinite bound."""
    if not written.strip():
        return without
    try:
        value = float(written)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise InvalidInput(
            f"Bounded term {text!r}: expected numbers on either side of '..', found {written.strip()!r};"
            " write one, or leave it out."
        )
    return value

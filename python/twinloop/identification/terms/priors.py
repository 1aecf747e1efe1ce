"""Priors: terms of the law that a user knows, and bounds on constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from twinloop.errors import InvalidInput
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.bounds import Limits
from twinloop.identification.terms.formulas import bare_term, bounded_term, fixed_term
from twinloop.identification.terms.pool import Pool
from twinloop.law.forms import driven_states
from twinloop.records import Recorded
from twinloop.signals import Bounds, Signals


@dataclass(frozen=True)
class Priors(Recorded, kind="priors"):
    """What a user knows of a law before anything is learnt.

    Args:
        fixed: nodes that drive a state as they are, by the state.
        bounds: bounds of the coefficients of a state's sum by node, by the state.
    """

    fixed: Mapping[int, Sequence[int]]
    bounds: Mapping[int, Limits]


def priors_of(options: IdentificationOptions, pool: Pool, signals: Signals) -> Priors:
    """The priors that options state.

    Args:
        options: with `fixed_terms` and `bounded_terms`.
        pool: where the formulas are entered.
        signals: whose names they may use.

    Returns:
        The same by state.

    Raises:
        InvalidInput: text that is no such formula or bound, a state that no output drives, a term that is fixed or
            bounded twice, or one that is both.
    """
    form = options.form_for(signals)
    fixed: dict[int, list[int]] = {}
    for text in options.fixed_terms:
        state, node = fixed_term(text, pool, signals)
        _check_driven(f"Fixed term {text!r}", state, form, signals)
        if node in fixed.setdefault(state, []):
            raise InvalidInput(
                f"Fixed term {text!r}: expected each term once, found it twice in the equation of"
                f" {signals.state_names[state]}; remove one, or write what both come to."
            )
        fixed[state].append(node)
    bare = {(state, bare_term(node, pool)[0]) for state, nodes in fixed.items() for node in nodes}
    found: dict[int, dict[int, Bounds]] = {}
    for text in options.bounded_terms:
        state, node, bounds = bounded_term(text, pool, signals)
        _check_driven(f"Bounded term {text!r}", state, form, signals)
        if (state, node) in bare:
            raise InvalidInput(
                f"Bounded term {text!r}: expected a term whose constant is to be found, found one that is fixed;"
                " remove it from fixed_terms or from bounded_terms."
            )
        if node in found.setdefault(state, {}):
            raise InvalidInput(
                f"Bounded term {text!r}: expected one pair of bounds a term, found a second one; join them."
            )
        # Under "absolute" sums are what is added to a state.
        itself = float(form == "absolute" and node == state)
        found[state][node] = (bounds[0] - itself, bounds[1] - itself)
    return Priors(fixed, found)


def _check_driven(what: str, state: int, form: str, signals: Signals) -> None:
    outputs = driven_states(signals, form)
    if state not in outputs:
        raise InvalidInput(
            f"{what}: expected a state that an output drives, any of"
            f" {', '.join(signals.state_names[i] for i in outputs)}, found {signals.state_names[state]}; write it for"
            " one of them."
        )

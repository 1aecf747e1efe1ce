"""What a flight may cost to tell more: what that is worth, and never much more than the best one flown."""

from __future__ import annotations

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.planning.settings import PlanningOptions

WORST = 1.5
"""Ratio of a flight's predicted quality, in known disturbances, to the best one measured, at most."""


def gain(choices: Floats) -> float:
    """Quality that knowing the right member would bring: the expected value of perfect information.

    It is min_k mean_m q − mean_m min_k q: the best flight for all members against each one's own (Raiffa and Schlaifer,
    *Applied Statistical Decision Theory*, 1961).

    Args:
        choices: quality of each flight on each member (members, K), infinite where it diverges.
    """
    if not choices.size:
        return 0.0
    own = choices.min(axis=1)
    return max(0.0, float(choices.mean(axis=0).min() - own.mean())) if np.isfinite(own).all() else 0.0


def apart(choices: Floats) -> float:
    """How far members are apart about flights, as a share of their qualities, 1 at most: median over flights.

    Args:
        choices: quality of each flight on each member (members, K), infinite where it diverges; it counts 1 where some
            members see it diverge, and nothing where all do.
    """
    lasts = np.isfinite(choices)
    some, whole = lasts.any(axis=0), lasts.all(axis=0)
    shares = np.ones(choices.shape[1])
    mean, spread = choices[:, whole].mean(axis=0), choices[:, whole].std(axis=0)
    shares[whole] = np.minimum(1.0, spread / np.where(mean > 0.0, mean, 1.0))
    return float(np.median(shares[some])) if some.any() else 0.0


def in_vain(predicted: float, spread: float, good: float) -> bool:
    """Whether a flight from which nothing is to be learnt promises nothing better, and may be far worse.

    Args:
        predicted: its quality.
        spread: standard deviation of the prediction, as earlier ones came true.
        good: quality of the best flight that kept the envelope; infinite where none has.
    """
    return predicted >= good and predicted + spread > WORST * good


def limit(
    promised: float, good: float, to_task: float, unknown: float, scatter: float, options: PlanningOptions
) -> float:
    """Predicted quality that a flight may have at most.

    A flight is worth what it may bring to the task, and what the twin lacks of the accuracy that is asked for: a share
    of a quality that is not known counts as much as one that is lost. What is lost in the scatter of the flights costs
    nothing.

    Args:
        promised: quality of the tuned gains on the committee, infinite where they diverge.
        good: of the best flight that kept the envelope; infinite where none has.
        to_task: quality that knowing the right member would bring.
        unknown: how far members are apart about flights, as a share; 0 where the twin is not what flights are for.
        scatter: standard deviation of the quality from one flight to the next.
        options: of the planning.

    Returns:
        At most the share `worse` above what is promised, and above what was flown.
    """
    most = (1.0 + options.worse) * good
    if not np.isfinite(promised):
        return most
    to_twin = max(0.0, unknown - options.accuracy) * promised
    most_given = options.worse * promised
    given = min(max(to_task + to_twin, scatter), most_given) if options.worth else most_given
    return min(promised + given, most)

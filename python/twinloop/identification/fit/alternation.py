"""Alternation: noise is estimated by innovations behind a law, the law tuned with that noise, and so on in turns."""

from __future__ import annotations

from twinloop.identification.context import Context
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.fit.innovations import Described
from twinloop.identification.fit.settling import settled
from twinloop.identification.hypothesis import Hypothesis

TURNS = 10
"""Times at most that the noise is estimated behind a law, and the law tuned with it."""
GAIN = 1.0
"""What a turn must gain, in units of χ²: less is worth no further one."""


def by_innovations(context: Context, hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with the noise that its innovations say, tuned with that noise.

    Args:
        context: of the identification.
        hypothesis: with a stable fit.

    Returns:
        The same terms, with the constants inside them that tuning has found, and without those that are nothing then.
    """
    best, latest = hypothesis, Described(context, hypothesis).under_noise
    for _ in range(TURNS):
        # Fitting estimates the noise behind what it has tuned.
        latest = fitted(context, settled(latest))
        if not (latest.evidence.stable and latest.evidence.length < best.evidence.length - GAIN):
            break
        best = latest
    return best

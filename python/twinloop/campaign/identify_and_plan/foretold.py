"""Foretold: whether a function of what a system does foretells what disturbs it in a flight that was left out.

A gust knows nothing of what a system does; what a law is wrong about is a function of that, now and shortly before. So
such a function is learnt from all flights but one and held against the one left out, each in turn. It is a sum of
single features, added one at a time by how much they explain (componentwise L2 boosting; Bühlmann and Yu 2003).

A gust moves the system, so that readings tell of it afterwards. There are two ways around that. A free run of the twin
has felt no gust: what it does is held against the gusts that the observer has estimated. And an observer that is right
has used what it has read: its next error of prediction is held against what was read and sent before.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import cos, exp, sin
from twinloop.campaign.identify_and_plan.likeness import Likeness, in_pieces
from twinloop.signals import Signals

MEMORIES = (0.03, 0.1, 0.3)
"""Time constants of what is remembered of states and commands, as shares of a flight."""
STEPS, SHARE = 20, 0.5
"""Features that are added at most, and share of its fit with which each of them is."""


def foretold(flights: Sequence[tuple[Floats, Floats]]) -> Likeness:
    """How alike disturbances are to what the other flights say of them.

    Args:
        flights: of each the features (n, p) and what disturbed it (n,), with the same rows.

    Returns:
        The likeness, over all flights; nothing of less than two.
    """
    if len(flights) < 2:
        return Likeness.of([])
    pieces = [(in_pieces(features), in_pieces(disturbed)) for features, disturbed in flights]
    scale = np.sqrt(np.mean([np.square(features).mean(axis=0) for features, _ in pieces], axis=0))
    scaled = [(features / np.where(scale > 0.0, scale, 1.0), disturbed) for features, disturbed in pieces]
    pairs = []
    for left_out, (features, disturbed) in enumerate(scaled):
        others = [flight for number, flight in enumerate(scaled) if number != left_out]
        weights = _boosted(*(np.concatenate(parts) for parts in zip(*others, strict=True)))
        # A flight that is far from all others is foretold wildly, and counts no more for it.
        pairs.append((_of_size_1((features * weights).sum(axis=1)), _of_size_1(disturbed)))
    return Likeness.of(pairs)


def _of_size_1(series: Floats) -> Floats:
    """A series over its root mean square; itself where that is 0."""
    size = float(np.sqrt(np.square(series).mean()))
    return series / size if size > 0.0 else series


def features_of(states: Floats, commands: Floats, signals: Signals) -> Floats:
    """What an error of a law may be a function of: states, commands, their products, and what is remembered of them.

    Args:
        states: of a free run or a flight (n + 1, n_x).
        commands: of the same (n, n_u).
        signals: of the system.

    Returns:
        Features (n, p), states in units of their scales; of states that wrap the sine and the cosine.
    """
    plain = in_scales(states, commands, signals)
    products = [plain[:, i] * plain[:, j] for i, j in combinations_with_replacement(range(plain.shape[1]), 2)]
    remembered = [_remembered(plain, share * len(plain)) for share in MEMORIES]
    one = np.ones((len(plain), 1))
    return np.hstack([one, plain, plain * np.abs(plain), np.stack(products, axis=1), *remembered])


def in_scales(states: Floats, commands: Floats, signals: Signals) -> Floats:
    """States at the start of each period and the commands in it, in units of their scales.

    Args:
        states: of a free run or a flight (n + 1, n_x).
        commands: of the same (n, n_u).
        signals: of the system.

    Returns:
        Features (n, p); of states that wrap the sine and the cosine.
    """
    columns = []
    for state, values in zip(signals.states, states[:-1].T, strict=True):
        if state.period is None:
            columns.append(values / state.scale)
        else:
            turned = 2.0 * np.pi / state.period * values
            columns += [sin(turned), cos(turned)]
    columns += [values / command.size for command, values in zip(signals.commands, commands.T, strict=True)]
    return np.stack(columns, axis=1)


def _remembered(series: Floats, periods: float) -> Floats:
    """Series (n, p) through a first-order lag of so many periods, from their first values on."""
    kept = float(exp(np.array([-1.0 / max(periods, 1.0)]))[0])
    found, now = np.empty_like(series), series[0]
    for k, row in enumerate(series):
        now = kept * now + (1.0 - kept) * row
        found[k] = now
    return found


def _boosted(features: Floats, disturbed: Floats) -> Floats:
    """Weights (p,) of the features (n, p) that explain most of what disturbs (n,), one after another."""
    weights, left = np.zeros(features.shape[1]), disturbed.copy()
    squares = np.square(features).sum(axis=0)
    usable = squares > 0.0
    if not usable.any():
        return weights
    for _ in range(STEPS):
        products = (features * left[:, np.newaxis]).sum(axis=0)
        explained = np.where(usable, np.square(products) / np.where(usable, squares, 1.0), 0.0)
        best = int(explained.argmax())
        by = SHARE * float(products[best] / squares[best])
        weights[best] += by
        left -= by * features[:, best]
    return weights

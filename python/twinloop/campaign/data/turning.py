"""Turning: three angles of a declared rigid body, held against what its body rates say of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from math import pi

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import cos, product, sin
from twinloop.campaign.data.integrated import (
    BENT,
    WALKED,
    contradiction,
    cuts,
    in_spite_of_drift,
    walk,
)
from twinloop.signals import RigidBody

STEEP = 0.1
"""Cosine of a pitch below which its angles say little of body rates."""
MOST_CURES = 3
"""Changes of the columns that are named at most, where each explains all that was found."""
LEAST_REST = 1e-6
"""Share of a column that must be left beside others for it to say something of its own."""


def turning(angles: Floats, rates: Floats) -> Floats:
    """Rates of roll, pitch and yaw of a body with these angles and body rates; z, then y, then x.

    Args:
        angles: roll, pitch and yaw (n, 3), rad.
        rates: about x, y and z of the body (n, 3), rad/s.

    Returns:
        Derivatives of the angles (n, 3), rad/s.
    """
    roll, pitch, _ = angles.T
    p, q, r = rates.T
    steep = cos(pitch)
    steep = np.where(np.abs(steep) < STEEP, np.where(steep < 0.0, -STEEP, STEEP), steep)
    across = q * sin(roll) + r * cos(roll)
    return np.stack([p + across * sin(pitch) / steep, q * cos(roll) - r * sin(roll), across / steep], axis=1)


@dataclass(frozen=True, eq=False)
class Turned:
    """Angles of a body in one run, and its body rates.

    Args:
        angles: roll, pitch and yaw (n, 3), rad.
        rates: body rates (n, 3), rad/s.
        dt: period, s.
    """

    angles: Floats
    rates: Floats
    dt: float

    def pairs(self) -> list[tuple[Floats, Floats]]:
        """How each angle moved (n,), and the same by the body rates, both without what biased rates would add."""
        steps = np.diff(self.angles, axis=0)
        moved = self._summed(steps - 2.0 * pi * np.rint(steps / (2.0 * pi)))
        said = self._integrated(self.rates)
        biased = np.stack([self._integrated(np.broadcast_to(axis, self.rates.shape)) for axis in np.eye(3)])
        return [
            (_without(biased[:, :, k], moved[:, k]), _without(biased[:, :, k], said[:, k])) for k in range(3)
        ]

    def walks(self, noise: Floats) -> Floats:
        """Sums of squares (3,) that the noise of the body rates adds to the integrated rates of the angles.

        Args:
            noise: variance of each body rate (3,).
        """
        gains = [turning(self.angles, np.broadcast_to(axis, self.rates.shape)) for axis in np.eye(3)]
        each = sum(float(noise[j]) * np.square(gain).mean(axis=0) for j, gain in enumerate(gains))
        return walk(np.asarray(each), self.dt, len(self.angles))

    def _integrated(self, rates: Floats) -> Floats:
        said = turning(self.angles, rates)
        return self._summed(0.5 * self.dt * (said[1:] + said[:-1]))

    def _summed(self, steps: Floats) -> Floats:
        """Sums of steps, without those beside the vertical, where the angles jump and say little of the rates."""
        flat = np.abs(cos(self.angles[:, 1])) >= STEEP
        kept = steps * (flat[1:] & flat[:-1])[:, np.newaxis]
        return np.concatenate([np.zeros((1, kept.shape[1])), np.cumsum(kept, axis=0)])


def contradictions(flown: Sequence[Turned], angles: Floats, rates: Floats) -> list[str | None]:
    """How each angle contradicts the body rates: "" if it does not, None if it moved too little to tell.

    Args:
        flown: runs.
        angles: variances of the noise of the angles (3,).
        rates: the same of the body rates (3,).
    """
    return in_spite_of_drift(partial(_in_pieces, flown, angles, rates))


def _in_pieces(flown: Sequence[Turned], angles: Floats, rates: Floats, pieces: int) -> list[str | None]:
    """The same where runs are cut into so many pieces."""
    cut = [
        Turned(run.angles[part], run.rates[part], run.dt)
        for run in flown
        for part in cuts(len(run.angles), pieces)
    ]
    pairs = [run.pairs() for run in cut]
    walks = np.sum([run.walks(rates) for run in cut], axis=0)
    return [
        contradiction(
            [run[k] for run in pairs], BENT * BENT * float(angles[k]), WALKED * WALKED * float(walks[k])
        )
        for k in range(3)
    ]


def cures(flown: Sequence[Turned], angles: Floats, rates: Floats, body: RigidBody) -> list[str]:
    """Changes of the columns, in words, each of which alone makes angles and body rates agree; none where many do.

    Args:
        flown: runs, in which they do not agree.
        angles: variances of the noise of the angles (3,).
        rates: the same of the body rates (3,).
        body: names of the columns.
    """
    found = []
    for words, mix_angles, mix_rates in _changes(body):
        changed = [
            Turned(product(run.angles, mix_angles.T), product(run.rates, mix_rates.T), run.dt)
            for run in flown
        ]
        noises = (np.square(mix_angles) * angles, np.square(mix_rates) * rates)
        said = contradictions(changed, *(noise.sum(axis=1) for noise in noises))
        if not any(said) and "" in said:
            found.append(words)
    return found if len(found) <= MOST_CURES else []


def _changes(body: RigidBody) -> Iterator[tuple[str, Floats, Floats]]:
    """Likely mistakes: what to do in words, and what it makes of angles and of rates (3, 3)."""
    same = np.eye(3)
    for which, names in enumerate((body.rates, body.angles)):
        for k, name in enumerate(names):
            sign = np.diag([-1.0 if j == k else 1.0 for j in range(3)])
            yield (f"with the sign of {name} changed", *((same, sign) if which == 0 else (sign, same)))
        for i, j in combinations(range(3), 2):
            order = [j if k == i else i if k == j else k for k in range(3)]
            swap = same[order]
            yield (
                f"with {names[i]} and {names[j]} exchanged",
                *((same, swap) if which == 0 else (swap, same)),
            )
    for names, angles, rates in ((body.angles, True, False), (body.rates, False, True)):
        for factor, way in ((pi / 180.0, "divided"), (180.0 / pi, "multiplied")):
            scaled = factor * same
            yield (
                f"with {', '.join(names)} {way} by 57.3 (degrees, radians)",
                *(scaled if angles else same, scaled if rates else same),
            )


def _without(causes: Floats, values: Floats) -> Floats:
    """Values less their regression on a constant and on causes.

    Args:
        causes: (m, n).
        values: (n,).
    """
    rest: Floats = values - values.mean()
    others: list[Floats] = []
    for cause in causes:
        own = cause - cause.mean()
        size = float(np.square(own).sum())
        for other in others:
            own = own - other * float((other * own).sum())
        left = float(np.square(own).sum())
        if left > LEAST_REST * LEAST_REST * size:
            own = own / np.sqrt(left)
            others.append(own)
            rest = rest - own * float((own * rest).sum())
    return rest

"""How a flight answers to a step from start to target: rise, overshoot and settling (Åström and Murray 2008, 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats

SETTLED = 0.05
"""Share of the step within which a state has settled."""


@dataclass(frozen=True)
class StepAnswer:
    """The step response of one state, from its start to its target.

    Args:
        state: its name.
        rise: time from 10 % to 90 % of the step, s; None if it does not reach 90 %.
        overshoot: as a share of the step.
        settling: time after which it stays within 5 % of the step, s; None if it does not settle.
        steady_state_error: error at the end, as a share of the step.
    """

    state: str
    rise: float | None
    overshoot: float
    settling: float | None
    steady_state_error: float


def step_answer(name: str, t: Floats, values: Floats, start: float, target: float) -> StepAnswer:
    """Of one state.

    Args:
        name: of the state.
        t: times (n,), s.
        values: of the state (n,), in its unit.
        start: where it begins.
        target: where it should end; not the start.
    """
    share = (values - start) / (target - start)
    tenth, most = (_reached(t, share, level) for level in (0.1, 0.9))
    off = np.flatnonzero(np.abs(share - 1.0) > SETTLED)
    settling: float | None = 0.0
    if len(off):
        settling = float(t[off[-1] + 1] - t[0]) if off[-1] + 1 < len(t) else None
    return StepAnswer(
        name,
        None if tenth is None or most is None else most - tenth,
        max(0.0, float(share.max()) - 1.0),
        settling,
        float(abs(share[-1] - 1.0)),
    )


def _reached(t: Floats, share: Floats, level: float) -> float | None:
    """When a level is first reached, between readings by a straight line."""
    above = np.flatnonzero(share >= level)
    if not len(above):
        return None
    k = int(above[0])
    if k == 0:
        return float(t[0])
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(t[k - 1] + part * (t[k] - t[k - 1]))


def moved_states(start: Floats, target: Floats, scales: Sequence[float]) -> list[int]:
    """States whose target is elsewhere than their start.

    Args:
        start: (n_x,).
        target: (n_x,), where the flight should end.
        scales: of the states.
    """
    return [i for i, scale in enumerate(scales) if abs(target[i] - start[i]) > 1e-3 * scale]

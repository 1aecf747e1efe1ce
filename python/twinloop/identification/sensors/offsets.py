"""Sensors that are late or early: time offsets between groups of readings, searched before anything else is learnt.

What a reading should have been at another time follows from the readings of its derivative, so no law is needed to see
an offset: an angle must change as its rate says. Interpolation would see one too, but it averages noise, and the
likelihood would reward it for that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.identification.description import shortest
from twinloop.identification.records import Run
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.kinematic_steps import kinematic_model, kinematic_step
from twinloop.identification.sensors.noise import floor_of
from twinloop.signals import Signals

OFFSETS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Offsets that are tried on either side of 0, in periods."""
PRICE = 12.0
"""What an offset must gain in χ²: its number, and the choice of having one."""
HALVINGS = 6
"""Times that the step is halved once an offset pays."""


def late_groups(signals: Signals, chains: Sequence[Chain]) -> list[list[int]]:
    """States that no output drives, by unit, the nearest to the driven ones first; their sensors share an offset."""
    found: dict[str, list[int]] = {}
    depth = max((len(chain.states) for chain in chains), default=0)
    for order in range(depth):
        for chain in chains:
            # Every state of a chain without an output is moved by others.
            if order < len(chain.states) and (order > 0 or chain.output is None):
                found.setdefault(signals.states[chain.states[order]].unit, []).append(chain.states[order])
    return list(found.values())


def moved(runs: Sequence[Run], signals: Signals, offsets: Floats) -> list[Run]:
    """Runs as they would have been read had all sensors been read at once.

    Args:
        runs: as recorded.
        signals: of the system.
        offsets: by how much later than those of the driven states each state's readings were taken from it (n_x,), s.

    Returns:
        The runs themselves where all offsets are 0.
    """
    if not offsets.any():
        return list(runs)
    return [_moved(run, signals, offsets) for run in runs]


def _moved(run: Run, signals: Signals, offsets: Floats) -> Run:
    states = run.states.copy()
    orders = np.array([_order(signals, i) for i in range(signals.n_x)])
    # Derivatives that are driven are taken from the middle of the time to cover, others from where it begins.
    shares = np.array([0.5 if i in signals.driven else 1.0 for i in range(signals.n_x)])
    # Derivatives first: what they are derivatives of is moved along them.
    nearest = np.argsort(-orders, kind="stable")
    for size in (offset for offset in dict.fromkeys(offsets[nearest].tolist()) if offset != 0.0):
        late = offsets == size
        begun = states.copy()
        if len(states) > 1:
            # A command is held for a period: what it does to a derivative is the slope of the same period.
            slopes = np.diff(states, axis=0) / signals.dt
            slopes = np.vstack([slopes[:1], slopes] if size > 0.0 else [slopes, slopes[-1:]])
            others = (orders > 0) & ~late
            begun[:, others] -= size * shares[others] * slopes[:, others]
        # Back in time, derivatives of odd order have the other sign.
        signs = np.where(orders % 2 == 1, np.sign(size), 1.0)
        ended = signs * kinematic_model(signals, abs(size)).step(
            signs * begun, np.zeros((len(states), signals.n_u))
        )
        states[:, late] = ended[:, late]
    return replace(run, states=states, smooth=states)


def _order(signals: Signals, state: int) -> int:
    """How often a state is a derivative of another."""
    body = signals.kinematics
    if body is not None and signals.state_names[state] in body.rates:
        return 1
    of = signals.states[state].derivative_of
    return 0 if of is None else 1 + _order(signals, signals.state_names.index(of))


def search_offsets(
    runs: Sequence[Run], signals: Signals, chains: Sequence[Chain], scales: Floats, workers: _core.Workers
) -> Floats:
    """Offsets that shorten the description of the readings by more than they cost, one group after another.

    Args:
        runs: as recorded.
        signals: of the system.
        chains: all of them.
        scales: of all states (n_x,).
        workers: how the work is carried out.

    Returns:
        By how much later than those of the driven states each state's readings were taken from it (n_x,), s.
    """
    best = np.zeros(signals.n_x)
    for group in late_groups(signals, chains):
        touched = [chain for chain in chains if set(group) & set(chain.states)]
        best = _Group(runs, signals, group, touched, best, scales, workers).searched()
    return best


class _Group:
    """One group of sensors: how likely their readings are at any offset."""

    def __init__(
        self,
        runs: Sequence[Run],
        signals: Signals,
        group: Sequence[int],
        chains: Sequence[Chain],
        base: Floats,
        scales: Floats,
        workers: _core.Workers,
    ) -> None:
        self.runs, self.signals, self.group = runs, signals, group
        self.chains, self.base, self.scales, self.workers = chains, base, scales, workers

    def searched(self) -> Floats:
        """All offsets, with the group's own."""
        dt = self.signals.dt
        chains = self._believed(0.0)
        size = dt * _coarse(lambda periods: self._description_length(dt * periods, chains))
        step = 0.5 * abs(size)
        for _ in range(HALVINGS if size != 0.0 else 0):
            # The noise was found too large while it had to explain the offset.
            chains = self._believed(size)
            around = {
                tried: self._description_length(tried, chains) for tried in (size, size - step, size + step)
            }
            size = shortest(list(around), around.__getitem__)
            step *= 0.5
        return self._at(size)

    def _at(self, size: float) -> Floats:
        offsets = self.base.copy()
        offsets[list(self.group)] = size
        return offsets

    def _regressions(self, size: float, chains: Sequence[Chain]) -> list[_core.Regression]:
        runs = moved(self.runs, self.signals, self._at(size))
        return [_unexplained(runs, self.signals, chain) for chain in chains]

    def _description_length(self, size: float, chains: Sequence[Chain]) -> float:
        """−2 log of the likelihood of the readings if disturbances are all that drives the chains."""
        regressions = self._regressions(size, chains)
        return sum(
            regression.likelihood([0.0], chain.sensors, chain.motion)
            for regression, chain in zip(regressions, chains, strict=True)
        )

    def _believed(self, size: float) -> list[Chain]:
        """The chains with the noise under which that is most likely."""
        runs = moved(self.runs, self.signals, self._at(size))
        return [chain for chain, _ in unexplained_noise(runs, self.signals, self.chains, self.workers)]


def unexplained_noise(
    runs: Sequence[Run], signals: Signals, chains: Sequence[Chain], workers: _core.Workers
) -> list[tuple[Chain, float]]:
    """The noise under which readings are most likely if disturbances are all that drives some chains.

    Args:
        runs: as they would have been read had all sensors been read at once.
        signals: of the system.
        chains: whose forms say how states move one another.
        workers: how the work is carried out.

    Returns:
        Each chain with that noise, and −2 log of the likelihood of its readings, up to a constant.
    """
    dt, problems = signals.dt, []
    for chain in chains:
        low, slow = floor_of(chain, dt)
        first = float(chain.rough[0])
        gust = 0.0 if chain.output is None else max(first / (dt * dt), slow[1])
        start = (max(first / dt, slow[0]), gust, 10.0 * dt)
        regression = _unexplained(runs, signals, chain)
        problems.append((regression, [0.0], np.maximum(chain.rough, low), start, low, slow))
    found = _core.most_likely_noises(problems, workers)
    return [
        (chain.with_noise(sensors, motion), length)
        for chain, (sensors, motion, length) in zip(chains, found, strict=True)
    ]


def _unexplained(runs: Sequence[Run], signals: Signals, chain: Chain) -> _core.Regression:
    """Of a chain on nothing; what body rates have turned is taken out of an angle's readings."""
    records = []
    for run in runs:
        readings = run.states[:, list(chain.states)]
        nothing = np.zeros((len(run.commands), 1))
        if chain.output is None:
            turned = kinematic_step(run.states, signals, chain.form) - run.states[:-1]
            readings[1:] -= np.cumsum(turned[:, list(chain.states)], axis=0)
        records.append((readings, run.weights[:, list(chain.states)], nothing, nothing, nothing))
    return _core.Regression(len(chain.states), signals.dt, chain.form, records)


def _coarse(judge: Callable[[float], float]) -> float:
    """The best offset of the grid, in periods; 0 where none pays."""
    none = judge(0.0)
    best, least = 0.0, none - PRICE
    for sign in (1.0, -1.0):
        before = none
        for size in OFFSETS:
            score = judge(sign * size)
            if score < least:
                best, least = sign * size, score
            # Past the best offset the fit only gets worse.
            if score >= before:
                break
            before = score
    return best

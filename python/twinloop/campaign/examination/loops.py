"""Loops that a controller closes around a twin and its committee: what an engineer draws of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.campaign.setup import Setup
from twinloop.errors import unknown
from twinloop.law.law import Law
from twinloop.law.linear.friction import has_friction, sliding
from twinloop.law.linear.margins import Loops, closed_loops
from twinloop.law.noise import Noise
from twinloop.law.twin import Twin
from twinloop.signals import Signals

FREQUENCIES = 160
"""At which loops are drawn, in equal ratios."""
SLOWEST = 1e-3
"""Lowest of them, as a share of half the frequency of the periods."""
SUMMED = 2048
"""Frequencies over which the spectrum of a command's noise is summed."""
FAR = 1000.0
"""Ranges of a command between its bounds and those of a command without any."""


def loops_around(
    twin: Twin, setup: Setup, genes: Floats, broken_at: str, slides: bool = False
) -> tuple[list[Loops], Sequence[str]]:
    """The loops of a controller around a twin and the members of its committee, at the target of a campaign.

    Args:
        twin: with its committee.
        setup: of the campaign.
        genes: gains of the controller (size,).
        broken_at: "axes", where the law of each axis leaves for the mixer, or "commands".
        slides: whether dry friction slides there; otherwise it sticks, as it does at rest.

    Returns:
        The loops of the twin, then of each member, none if friction is to slide and no model has any; and a name for
        each place where they are broken.

    Raises:
        InvalidInput: another place.
        NotAvailable: the twin or the controller has no derivatives there, or the target needs a command at its bound.
    """
    if broken_at not in ("axes", "commands"):
        raise unknown("place to break a loop at", broken_at, ("axes", "commands"))
    signals, mixer = setup.signals, setup.mixer
    if mixer is None or broken_at == "commands":
        names: Sequence[str] = signals.command_names
    else:
        axes = getattr(setup.controller, "axes", None)
        names = [f"u{i + 1}" if axes is None else axes[i][0] for i in range(mixer.matrix.shape[1])]
    laws = [twin.law, *(Law.of(member, signals) for member in twin.members)]
    if slides:
        if not any(map(has_friction, laws)):
            return [], names
        laws = [sliding(law, setup.final_target) for law in laws]
    family = setup.controller.bind(_without_bounds(signals))
    return closed_loops(laws, family, genes, setup.final_target, mixer, broken_at), names


def _without_bounds(signals: Signals) -> Signals:
    """The same signals, the bounds of the commands so far away that a small departure meets none."""
    commands = []
    for command in signals.commands:
        low, high = command.bounds
        far = FAR * (high - low)
        commands.append(replace(command, bounds=(low - far, high + far)))
    return replace(signals, commands=tuple(commands))


@dataclass(frozen=True, eq=False)
class LoopCurves:
    """One loop over frequency, of the twin and of the members of its committee.

    Args:
        loop: its name.
        frequencies: (f,), rad/s.
        open: L (models, f), the twin's first; with dry friction all as it slides, then as it sticks.
    """

    loop: str
    frequencies: Floats
    open: np.ndarray

    @property
    def sensitivity(self) -> Floats:
        """|S| = |1 / (1 + L)| (models, f)."""
        return np.asarray(1.0 / np.abs(1.0 + self.open))

    @property
    def complementary(self) -> Floats:
        """|T| = |L / (1 + L)| (models, f)."""
        return np.asarray(np.abs(self.open / (1.0 + self.open)))


@dataclass(frozen=True, eq=False)
class ClosedCurves:
    """Transfer functions of the twin's closed loops over frequency.

    Args:
        frequencies: (f,), rad/s.
        to_commands: |C S|, from noise on each state, in units of its scale, to each command, in units of its half range
            (n_u, n_x, f).
        to_states: |P S|, from a disturbance of each command to each state, in the same units (n_x, n_u, f).
        noise_of_commands: standard deviation of each command due to sensor noise (n_u,), in its unit.
    """

    frequencies: Floats
    to_commands: Floats
    to_states: Floats
    noise_of_commands: Floats

    @property
    def of_noise(self) -> Floats:
        """Root sum of squares over the states' sensors of |C S| (n_u, f)."""
        return np.asarray(np.sqrt(np.square(self.to_commands).sum(axis=1)))

    @property
    def of_disturbances(self) -> Floats:
        """Root sum of squares over the disturbed commands of |P S| (n_x, f)."""
        return np.asarray(np.sqrt(np.square(self.to_states).sum(axis=1)))


def loop_curves(loops: Sequence[Loops], names: Sequence[str]) -> tuple[LoopCurves, ...]:
    """Each loop over frequency.

    Args:
        loops: of the twin, then of the others.
        names: of the places where they are broken.
    """
    frequencies = _frequencies(loops[0].dt)
    return tuple(
        LoopCurves(name, frequencies, np.stack([closed.response(i, frequencies) for closed in loops]))
        for i, name in enumerate(names)
    )


def closed_curves(closed: Loops, setup: Setup, noise: Noise | None) -> ClosedCurves:
    """What sensors' noise does to the commands, and what disturbs the commands to the states.

    Args:
        closed: the loops of the twin.
        setup: of the campaign.
        noise: of the twin's sensors.
    """
    scales = np.array([state.scale for state in setup.signals.states])
    halves = np.array([0.5 * (high - low) for low, high in (c.bounds for c in setup.signals.commands)])
    frequencies = _frequencies(closed.dt)
    to_commands, to_states = (np.abs(found) for found in closed.closed(frequencies))
    return ClosedCurves(
        frequencies,
        np.moveaxis(to_commands * scales / halves[:, np.newaxis], 0, -1),
        np.moveaxis(to_states * halves / scales[:, np.newaxis], 0, -1),
        noise_of_commands(closed, np.zeros(len(scales)) if noise is None else noise.sensors),
    )


def noise_of_commands(closed: Loops, sensors: Floats) -> Floats:
    """Standard deviation that white noise of the sensors causes in each command, while no bound is met.

    Args:
        closed: the loops of a twin.
        sensors: standard deviation of each state's readings (n_x,), in its unit.

    Returns:
        One a command (n_u,), in its unit; infinite where the loops are not stable.
    """
    if not (np.abs(closed.closed_poles()) < 1.0).all():
        return np.full(len(closed.controller.D), np.inf)
    # Middles of even parts of the upper half of the circle: the spectrum is summed over them (Parseval).
    frequencies = (np.arange(SUMMED) + 0.5) * np.pi / SUMMED / closed.dt
    gains = np.abs(closed.closed(frequencies)[0]) * sensors
    return np.asarray(np.sqrt(np.square(gains).sum(axis=2).mean(axis=0)))


def _frequencies(dt: float) -> Floats:
    half = np.pi / dt
    return np.geomspace(SLOWEST * half, half * (1.0 - 1e-9), FREQUENCIES)

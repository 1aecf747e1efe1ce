"""Margins of the loops that a controller closes around a law, each broken at one place and the others closed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.controllers import Family, Mixer
from twinloop.errors import NotAvailable
from twinloop.law.law import Law
from twinloop.law.linear.controller import LinearController, linear_controller
from twinloop.law.linear.plant import linearised, trimmed
from twinloop.law.linear.state_space import Linear

FREQUENCIES = 4000
"""Frequencies at which a loop is looked at, in equal ratios."""
SLOWEST = 1e-5
"""Lowest of them, as a share of half the frequency of the periods."""
TINY = 1e-300
"""In place of the gain of a loop that no command goes round, for its logarithm."""
HALVINGS = 60
"""Times that an interval with a crossing is halved."""


@dataclass(frozen=True)
class LoopMargins:
    """Stability margins of one loop; a gain of 2 is 6 dB.

    Args:
        loop: name of the axis or command at which it is broken.
        stable: whether all loops together are stable; if not, the margins mean nothing.
        gain: factor above 1 by which the loop's gain may grow; infinite without a limit.
        gain_down: factor below 1 to which it may fall; 0 without a limit.
        phase: phase margin at the crossover, rad.
        delay: delay that may be added to the loop, s.
        crossover: highest frequency at which the loop's gain is 1, rad/s; 0 if it is never 1.
        sensitivity: Ms, the largest |1 / (1 + L)|.
        complementary: Mt, the largest |L / (1 + L)|.
        friction: whether dry friction is "sticking" or "sliding" where the delay is the smallest; "" without any.
    """

    loop: str
    stable: bool
    gain: float
    gain_down: float
    phase: float
    delay: float
    crossover: float
    sensitivity: float
    complementary: float
    friction: str = ""


class Loops:
    """A plant and a controller, closed.

    Args:
        plant: of the law, in discrete time.
        controller: that reads its first states.
        outputs: slopes of the commands by the axes (n_u, axes), where the loops are broken at axes; None: at the
            commands.
    """

    def __init__(self, plant: Linear, controller: LinearController, outputs: Floats | None = None) -> None:
        assert plant.dt is not None
        self.plant, self.controller, self.dt = plant, controller, plant.dt
        n_x = controller.D.shape[1]
        self.of_axes = np.eye(len(controller.D)) if outputs is None else outputs
        self._to_axes = np.linalg.pinv(self.of_axes)
        self._seen = n_x

    def closed_poles(self) -> np.ndarray:
        """Eigenvalues of the closed loop, in discrete time.

        Without that of a hidden state that moves nothing, such as the twist within a gap, which stays where it is.
        """
        plant, law = self.plant, self.controller
        n, m = len(plant.A), len(law.A)
        seen = plant.C[: self._seen]
        whole = np.zeros((n + m, n + m))
        whole[:n, :n] = plant.A + plant.B @ law.D @ seen
        whole[:n, n:] = plant.B @ law.C
        whole[n:, :n] = law.B @ seen
        whole[n:, n:] = law.A
        moves = np.asarray((whole - np.diag(np.diag(whole))).any(axis=0))
        moves[: self._seen] = moves[n:] = True
        return np.linalg.eigvals(whole[np.ix_(moves, moves)])

    def response(self, loop: int, frequencies: Floats) -> np.ndarray:
        """L of one loop, broken where it leaves the controller, the others closed.

        Args:
            loop: number of the axis or command.
            frequencies: (f,), rad/s.

        Returns:
            Complex gains (f,); 1 + L is what decides on stability.
        """
        through = self.controller.response(frequencies) @ self.plant.response(frequencies)[:, : self._seen]
        around = self._to_axes @ through @ self.of_axes
        size = around.shape[1]
        closed = np.eye(size)
        closed[loop, loop] = 0.0
        answer = np.linalg.solve(np.eye(size) - around @ closed, around[:, :, loop : loop + 1])
        return -np.asarray(answer[:, loop, 0])

    def closed(self, frequencies: Floats) -> tuple[np.ndarray, np.ndarray]:
        """What acts on the closed loops, all of them closed.

        Args:
            frequencies: (f,), rad/s.

        Returns:
            From noise on the states to the commands (f, n_u, n_x), C S; from what is added to the commands to the
            states (f, n_x, n_u), P S.
        """
        law = self.controller.response(frequencies)
        plant = self.plant.response(frequencies)[:, : self._seen]
        size = law.shape[1]
        to_commands = np.linalg.solve(np.eye(size) - law @ plant, law)
        to_states = plant @ np.linalg.inv(np.eye(size) - law @ plant)
        return to_commands, to_states

    def margins(self, loop: int, name: str, friction: str = "") -> LoopMargins:
        """Margins of one loop.

        Args:
            loop: number of the axis or command.
            name: of it.
            friction: what dry friction does, "sticking" or "sliding"; "" without any.
        """
        half = math.pi / self.dt
        frequencies = np.geomspace(SLOWEST * half, half * (1.0 - 1e-9), FREQUENCIES)
        values = self.response(loop, frequencies)
        sizes = np.log(np.maximum(np.abs(values), TINY))
        crossings = self._crossings(loop, frequencies, sizes, lambda v: math.log(max(abs(v), TINY)))
        turns = self._crossings(loop, frequencies, values.imag, lambda v: float(v.imag))
        at = self.response(loop, np.array(crossings)) if crossings else np.zeros(0, complex)
        lost = np.mod(np.angle(at) + math.pi, 2.0 * math.pi)
        real = self.response(loop, np.array(turns)).real if turns else np.zeros(0)
        factors = -1.0 / real[real < 0.0]
        # The last point is half the frequency of the periods, where L is real.
        factors = np.append(factors, [-1.0 / values[-1].real] if values[-1].real < 0.0 else [])
        return LoopMargins(
            loop=name,
            stable=bool((np.abs(self.closed_poles()) < 1.0).all()),
            gain=float(factors[factors > 1.0].min(initial=math.inf)),
            gain_down=float(factors[factors < 1.0].max(initial=0.0)),
            phase=float(np.minimum(lost, 2.0 * math.pi - lost).min(initial=math.inf)),
            delay=float((lost / crossings).min(initial=math.inf)) if crossings else math.inf,
            crossover=max(crossings, default=0.0),
            sensitivity=float((1.0 / np.abs(1.0 + values)).max()),
            complementary=float(np.abs(values / (1.0 + values)).max()),
            friction=friction,
        )

    def _crossings(
        self, loop: int, frequencies: Floats, marks: Floats, mark: Callable[[complex], float]
    ) -> list[float]:
        """Frequencies at which a mark of L changes its sign, by bisection."""
        found = []
        for place in np.flatnonzero(np.sign(marks[:-1]) * np.sign(marks[1:]) < 0.0):
            low, high = float(frequencies[place]), float(frequencies[place + 1])
            for _ in range(HALVINGS):
                middle = math.sqrt(low * high)
                try:
                    there = mark(complex(self.response(loop, np.array([middle]))[0]))
                except np.linalg.LinAlgError:
                    # An oscillation without damping: L leaps through infinity there, and crosses nothing.
                    break
                low, high = (middle, high) if there * marks[place] > 0.0 else (low, middle)
            else:
                found.append(math.sqrt(low * high))
        return found


@dataclass(frozen=True)
class Margins:
    """Margins of the loops of a controller, by loop, each broken while the others stay closed; printable.

    With dry friction each is the worse of two: as it sticks, where it damps like a strong damper, and as it slides,
    where it damps nothing.

    Args:
        broken_at: "axes", between the law of each axis and the mixer, or "commands".
        nominal: of the twin.
        worst: the worst of each margin over the committee.
        members: number of models in the committee.
    """

    broken_at: str
    nominal: tuple[LoopMargins, ...]
    worst: tuple[LoopMargins, ...]
    members: int

    def __str__(self) -> str:
        """A table as text, the nominal margins above the worst of each loop."""
        head = (
            f"{'loop':>16}  {'':>7}  {'gain':>8}  {'down to':>8}  {'phase (°)':>9}  {'delay (s)':>9}  {'crossover':>9}"
            f"  {'Ms':>6}  {'Mt':>6}"
        )
        lines = [f"Loops broken at the {self.broken_at}; crossover in rad/s", head]
        for pair in zip(self.nominal, self.worst, strict=True):
            for which, row in zip(("twin", "worst"), pair, strict=True):
                lines.append(
                    f"{row.loop if which == 'twin' else '':>16}  {which:>7}  {row.gain:>8.3g}  {row.gain_down:>8.3g}"
                    f"  {math.degrees(row.phase):>9.3g}  {row.delay:>9.3g}  {row.crossover:>9.3g}"
                    f"  {row.sensitivity:>6.3g}  {row.complementary:>6.3g}{'' if row.stable else '  unstable'}"
                    f"{row.friction and f'  {row.friction}'}"
                )
        lines.append(f"worst: the worst of each over {self.members} model{'s' * (self.members != 1)}")
        if any(row.friction for row in self.worst):
            lines.append(
                "each the worse of dry friction sticking and sliding; named is the one with less delay"
            )
        return "\n".join(lines)


def closed_loops(
    laws: Sequence[Law], family: Family, genes: Floats, target: Floats, mixer: Mixer | None, broken_at: str
) -> list[Loops]:
    """The loops of a controller around each of several laws, at the target and under the command that holds it.

    Args:
        laws: the twin's, then those of the committee.
        family: of the controller, over commands without bounds: a heater that rests on its bound at zero error does
            not rest there once the integral has found the power that holds the target.
        genes: its gains (size,).
        target: state that it leads to (n_x,).
        mixer: from axes to commands; None: axis i is command i.
        broken_at: "axes" or "commands".

    Returns:
        As many as laws.

    Raises:
        NotAvailable: a law or the controller has no derivatives there, or on the first law a command that the
            controller moves is at a bound there.
    """
    controller = linear_controller(family, genes, target)
    outputs = None if mixer is None or broken_at == "commands" else _slopes(mixer, controller.rest)
    held = [trimmed(law, target, controller.rest) for law in laws]
    _check_held(laws[0], controller, held[0])
    plants = (linearised(law, target, by, discrete=True) for law, by in zip(laws, held, strict=True))
    return [Loops(plant, controller, outputs) for plant in plants]


def _check_held(law: Law, controller: LinearController, held: Floats) -> None:
    """Refuses a target at which a command is at a bound: feedback has nothing left to move there."""
    moved = np.abs(np.hstack([controller.C, controller.D])).sum(axis=1) > 0.0
    for command, value, moves in zip(law.signals.commands, held.tolist(), moved.tolist(), strict=True):
        if moves and value in command.bounds:
            raise NotAvailable(
                f"Linear analysis: expected commands within their bounds that hold the target, found {command.name} at"
                " a bound on the twin, where feedback moves nothing more; choose a target that they can hold, or"
                " correct their bounds."
            )


def margins_of(
    loops: Sequence[Loops], names: Sequence[str], broken_at: str, sliding: Sequence[Loops] = ()
) -> Margins:
    """Margins of all loops.

    Args:
        loops: of the twin, then of the members of its committee.
        names: of the places where they are broken.
        broken_at: "axes" or "commands".
        sliding: the same as dry friction slides; empty where no model has any.

    Returns:
        Nominal and worst margins of each loop.
    """

    def of(model: Loops, friction: str) -> list[LoopMargins]:
        return [model.margins(loop, name, friction) for loop, name in enumerate(names)]

    rows = [of(model, "sticking" if sliding else "") for model in loops]
    if sliding:
        slid = [of(model, "sliding") for model in sliding]
        rows = [[worst(both) for both in zip(*pair, strict=True)] for pair in zip(rows, slid, strict=True)]
    return Margins(
        broken_at,
        tuple(rows[0]),
        tuple(worst(each) for each in zip(*rows, strict=True)),
        max(1, len(loops) - 1),
    )


def _slopes(mixer: Mixer, rest: Floats) -> Floats:
    """How commands move with the outputs of the axes at rest (n_u, axes)."""
    before = np.abs(rest) ** (1.0 / mixer.power)
    slopes = np.ones(len(rest)) if mixer.power == 1.0 else mixer.power * before ** (mixer.power - 1.0)
    return np.asarray(mixer.matrix * slopes[:, np.newaxis], dtype=np.float64)


def worst(margins: Sequence[LoopMargins]) -> LoopMargins:
    """The worst of each margin of one loop over several laws.

    Args:
        margins: of the same loop, at least one.
    """
    return LoopMargins(
        loop=margins[0].loop,
        stable=all(each.stable for each in margins),
        gain=min(each.gain for each in margins),
        gain_down=max(each.gain_down for each in margins),
        phase=min(each.phase for each in margins),
        delay=min(each.delay for each in margins),
        crossover=max(each.crossover for each in margins),
        sensitivity=max(each.sensitivity for each in margins),
        complementary=max(each.complementary for each in margins),
        friction=min(margins, key=lambda each: (each.stable, each.delay)).friction,
    )

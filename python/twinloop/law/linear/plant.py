"""A law around a point: how small departures of states and commands move on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.law.actuation import Actuation, Actuator
from twinloop.law.law import Law
from twinloop.law.linear.attitude import angles, quaternion, turning
from twinloop.law.linear.dual import Dual
from twinloop.law.linear.jacobian import jacobian
from twinloop.law.linear.reports import as_given
from twinloop.law.linear.sensors import as_read
from twinloop.law.linear.state_space import Linear
from twinloop.law.linear.storage import fading, filling, moved, seen, settled, settled_as_seen

HALVINGS = 30
"""Times that a step to a command that holds a state is halved at most."""
CLOSE = 1e-12
"""Of a command's size: steps that are no longer change nothing that anybody asks for."""
ALIKE = 1e-5
"""Effect of the difference between commands, over theirs, below which they are taken to do the same."""
SETTLED = 1e-6
"""Share of what is left of a state's motion that a step must take away for another to follow."""


def linearised(law: Law, state: Floats, command: Floats, discrete: bool) -> Linear:
    """A law around a point, by exact derivatives; with actuators at rest under the command.

    Hidden states that commands fill by themselves are at 0 there, those that are integrated where they settle.

    Args:
        law: of a twin.
        state: (n_x,), SI units, radians.
        command: (n_u,), in the units of the commands.
        discrete: over a period, as the twin steps, instead of at an instant.

    Returns:
        The matrices with the names of what they stand for.

    Raises:
        NotAvailable: the law has no derivatives there, or, for continuous time, none at all.
    """
    plain = _period(law, state, command) if discrete else _instant(law, state, command)
    effects = command * (1.0 / np.array([each.size for each in law.signals.commands]))
    point = np.concatenate([state, effects, settled_as_seen(law, state, effects)])
    found = as_given(law.reports, as_read(law, plain, _wrapped(law, point)), law.signals.dt)
    if not _finite(found):
        raise _no_derivatives()
    return found


def _finite(plant: Linear) -> bool:
    parts = (plant.A, plant.B, plant.drift)
    return all(bool(np.isfinite(part).all()) for part in parts)


def _no_derivatives() -> NotAvailable:
    return NotAvailable(
        "Linearisation: expected a law with finite derivatives at the point, found one that overflows or has a root of"
        " 0 there; choose a point beside it."
    )


def _instant(law: Law, state: Floats, command: Floats) -> Linear:
    if law.form != "acceleration":
        raise NotAvailable(
            f"Linearisation: expected a law whose derivatives are integrated, found the form {law.form!r}, which steps"
            " from period to period; ask for discrete=True."
        )
    signals, hidden = law.signals, law.actuation.hidden
    n_x, n_u = signals.n_x, signals.n_u
    lagging = [i for i, actuator in enumerate(law.actuation.actuators) if actuator.lag > 0.0]
    size = n_x + len(lagging) + len(hidden)
    factors = 1.0 / np.array([each.size for each in signals.commands])
    effects = factors * command
    still = settled(law, state, effects)
    point = np.concatenate([state, effects, settled_as_seen(law, state, effects)])
    values, slopes = jacobian(law.expressions, law.derivatives(), _wrapped(law, point))
    by_effect = slopes[:, n_x : n_x + n_u] * factors
    A, B, drift = np.zeros((size, size)), np.zeros((size, n_u)), np.zeros(size)
    A[:n_x, :n_x], A[:n_x, n_x + len(lagging) :], drift[:n_x] = (
        slopes[:, :n_x],
        slopes[:, n_x + n_u :],
        values,
    )
    direct = [i for i in range(n_u) if i not in lagging]
    B[:n_x, direct] = by_effect[:, direct]
    for place, i in enumerate(lagging, start=n_x):
        lag = law.actuation.actuators[i].lag
        A[:n_x, place] = by_effect[:, i]
        A[place, place], B[place, i] = -1.0 / lag, 1.0 / lag
    stored = len(law.actuation.stored)
    kept, every = size - stored, np.eye(n_x + stored + n_u)
    of_stored, given = slopes[:, slopes.shape[1] - stored :], Dual(effects, every[n_x + stored :])
    inputs = Dual.stacked([Dual(state, every[:n_x]), given])
    held = Dual(still[len(hidden) - stored :], every[n_x : n_x + stored])
    A[:n_x, kept:] = 0.0
    for slope, rows in (
        (of_stored @ seen(law, inputs, held).slopes, slice(n_x)),
        (moved(law, inputs, held).slopes, slice(kept, size)),
    ):
        A[rows, :n_x] += slope[:, :n_x]
        A[rows, kept:] += slope[:, n_x : n_x + stored]
        through = slope[:, n_x + stored :] * factors
        A[rows, n_x : n_x + len(lagging)] += through[:, lagging]
        B[rows, direct] += through[:, direct]
    for place, h in enumerate(hidden, start=n_x + len(lagging)):
        if h.integrated:
            continue
        A[place, place] = -1.0 / h.time
        level, slope = _level(h.commands, h.squared, effects, factors)
        B[place] = slope
        drift[place] = 0.0 if h.rest is None else level - h.rest
    delays = signals.dt * np.array([float(actuator.delay) for actuator in law.actuation.actuators])
    names = [f"{signals.command_names[i]}_effect" for i in lagging]
    return Linear(
        A,
        B,
        (*signals.state_names, *names, *law.held_symbols),
        signals.command_names,
        np.concatenate([state, command[lagging], still]),
        command,
        drift,
        None,
        delays,
        np.eye(size),
        np.zeros(size),
        tuple(place for place, h in enumerate(hidden, start=n_x + len(lagging)) if not h.integrated),
    )


def _wrapped(law: Law, inputs: Floats) -> Floats:
    """Inputs of the equations, angles that wrap within half a period of 0."""
    seen = inputs.copy()
    for place, state in enumerate(law.signals.states):
        if state.period is not None:
            seen[place] -= np.rint(seen[place] / state.period) * state.period
    return seen


def _level(commands: Sequence[int], squared: bool, scaled: Floats, factors: Floats) -> tuple[float, Floats]:
    """What fills a hidden state, and its slope by each command (n_u,)."""
    given, slope = scaled[list(commands)], np.zeros(len(factors))
    slope[list(commands)] = (2.0 * given if squared else 1.0) * factors[list(commands)] / len(commands)
    return float((given**2 if squared else given).mean()), slope


@dataclass(frozen=True, eq=False)
class _Begun:
    """What a period begins with, each with its derivatives: all of it together is the state of the linear model.

    Args:
        names: of the states of the linear model.
        x: the states of the signals.
        held: effect of each command that lags, by its place.
        hidden: the hidden states.
        queues: commands on their way, the oldest first, for each command.
        sent: the commands of the period.
    """

    names: list[str]
    x: Dual
    held: dict[int, Dual]
    hidden: Dual
    queues: list[list[Dual]]
    sent: Dual

    @staticmethod
    def of(law: Law, state: Floats, command: Floats) -> _Begun:
        signals, actuators = law.signals, law.actuation.actuators
        sent = list(zip(signals.command_names, actuators, strict=True))
        names = [*signals.state_names, *(f"{name}_effect" for name, a in sent if a.lag > 0.0)]
        names += law.held_symbols
        names += [f"{name}_{back}_before" for name, a in sent for back in range(a.delay, 0, -1)]
        identity, rows = np.eye(len(names) + signals.n_u), iter(range(len(names)))

        def taken(values: Floats) -> Dual:
            return Dual(values, identity[[next(rows) for _ in values]])

        x = taken(state)
        held = {i: taken(command[[i]]) for i, actuator in enumerate(actuators) if actuator.lag > 0.0}
        sizes = np.array([each.size for each in signals.commands])
        hidden = taken(settled(law, state, command / sizes))
        queues = [[taken(command[[i]]) for _ in range(a.delay)] for i, a in enumerate(actuators)]
        return _Begun(names, x, held, hidden, queues, Dual(command, identity[len(names) :]))

    def whole(self) -> Dual:
        """All of it, in the order of the names."""
        waiting = [part for queue in self.queues for part in queue]
        return Dual.stacked([self.x, *self.held.values(), self.hidden, *waiting])


def _period(law: Law, state: Floats, command: Floats) -> Linear:
    """One period, with what is on its way as states: x, effects that lag, hidden states, commands before."""
    begun = _Begun.of(law, state, command)
    effects, held, waiting = _effects(law, begun)
    filled = _filled(law, begun)
    inputs = [
        Dual.stacked([of_commands, hidden]) for of_commands, hidden in zip(effects, filled, strict=True)
    ]
    stored = begun.hidden.rows(range(len(filled[2].values), len(begun.hidden.values)))
    x, stored = _stepped(law, begun.x, stored, inputs)
    ended = Dual.stacked([x, *held, filled[2], stored, *waiting])
    before, size = begun.whole(), len(begun.names)
    return Linear(
        ended.slopes[:, :size],
        ended.slopes[:, size:],
        tuple(begun.names),
        law.signals.command_names,
        before.values,
        command,
        ended.values - before.values,
        law.signals.dt,
        np.zeros(law.signals.n_u),
        np.eye(size),
        np.zeros(size),
    )


def _effects(law: Law, begun: _Begun) -> tuple[list[Dual], list[Dual], list[Dual]]:
    """Scaled effects of commands at start, middle and end of a period; what lags hold; commands still on their way."""
    stages: list[list[Dual]] = [[], [], []]
    held, waiting = [], []
    for i, actuator in enumerate(law.actuation.actuators):
        arrived, *later = [*begun.queues[i], Dual(begun.sent.values[[i]], begun.sent.slopes[[i]])]
        half = float(np.exp(-0.5 * law.signals.dt / actuator.lag)) if actuator.lag > 0.0 else 0.0
        start = begun.held.get(i, arrived)
        middle = arrived * (1.0 - half) + start * half
        end = arrived * (1.0 - half) + middle * half
        for stage, effect in zip(stages, (start, middle, end), strict=True):
            stage.append(effect)
        held += [end] if i in begun.held else []
        waiting += later
    factors = 1.0 / np.array([each.size for each in law.signals.commands])
    return [Dual.stacked(stage) * factors for stage in stages], held, waiting


def _filled(law: Law, begun: _Begun) -> list[Dual]:
    """Hidden states that commands fill at the start, the middle and the end of a period."""
    factors = 1.0 / np.array([each.size for each in law.signals.commands])
    stages: list[list[Dual]] = [[], [], []]
    by_commands = [h for h in law.actuation.hidden if not h.integrated]
    for j, h in enumerate(by_commands):
        kept = float(np.exp(-0.5 * law.signals.dt / h.time))
        level, slope = _level(h.commands, h.squared, factors * begun.sent.values, factors)
        over = 0.0 if h.rest is None else level - h.rest
        added = Dual(np.array([over]), slope[np.newaxis] @ begun.sent.slopes) * (h.time * (1.0 - kept))
        start = Dual(begun.hidden.values[[j]], begun.hidden.slopes[[j]])
        middle = start * kept + added
        for stage, value in zip(stages, (start, middle, middle * kept + added), strict=True):
            stage.append(value)
    return [Dual.stacked(stage) if stage else begun.hidden.rows([]) for stage in stages]


def _stepped(law: Law, x: Dual, stored: Dual, inputs: Sequence[Dual]) -> tuple[Dual, Dual]:
    """The next state, and what motion has filled then.

    Args:
        law: of a twin.
        x: the state at the start of a period.
        stored: the hidden states that are integrated, there.
        inputs: effects and hidden states that commands fill, at the start, the middle and the end of the period.
    """
    if law.form != "acceleration":
        after = _mapped(law, x, stored, inputs)
        half, fades = 0.5 * law.signals.dt, fading(law)
        n_u = range(law.signals.n_u)
        ends = [Dual.stacked([at, by.rows(n_u)]) for at, by in ((x, inputs[0]), (after, inputs[2]))]
        added = (filling(law, ends[0]) + filling(law, ends[1]) - stored.mapped(fades)) * half
        inverse = np.asarray(np.linalg.inv(np.eye(len(fades)) + half * fades), dtype=np.float64)
        return after, (stored + added).mapped(inverse)
    size, n_x = len(x.values) + len(stored.values), len(x.values)
    roots, body = law.derivatives(), law.signals.kinematics

    def slope(point: Dual, given: Dual) -> Dual:
        states, held = (upright(point) if body else point.rows(range(n_x))), point.rows(range(n_x, size))
        inputs = Dual.stacked([states, given.rows(range(law.signals.n_u))])
        slopes = [_given(law, roots, states, Dual.stacked([given, seen(law, inputs, held)]))]
        slopes.append(moved(law, inputs, held))
        if body is not None:
            still = Dual(np.zeros(3), np.zeros((3, states.slopes.shape[1])))
            slopes[0] = slopes[0].put(turns, still)
            slopes.append(turning(point.rows(range(size, size + 4)), states.rows(rates)))
        return Dual.stacked(slopes)

    def upright(point: Dual) -> Dual:
        """The states, with the angles of the quaternion behind them."""
        found = angles(point.rows(range(size, size + 4)), x.values[turns])
        return point.rows(range(n_x)).put(turns, found)

    begun = Dual.stacked([x, stored])
    if body is not None:
        place = law.signals.state_names.index
        turns, rates = [place(name) for name in body.angles], [place(name) for name in body.rates]
        begun = Dual.stacked([begun, quaternion(x.rows(turns))])
    steps = law.signals.substeps
    for part in range(steps):
        given = [_between(inputs, (part + share) / steps) for share in (0.0, 0.5, 1.0)]
        begun = _integrated(slope, begun, law.signals.dt / steps, given)
    ended = upright(begun) if body is not None else begun.rows(range(n_x))
    return ended, begun.rows(range(n_x, size))


def _given(law: Law, roots: Sequence[int], states: Dual, given: Dual) -> Dual:
    """Some expressions of the law at a state, under effects and hidden states."""
    whole = Dual.stacked([states, given])
    values, slopes = jacobian(law.expressions, roots, _wrapped(law, whole.values))
    return Dual(values, slopes @ whole.slopes)


def _mapped(law: Law, x: Dual, stored: Dual, inputs: Sequence[Dual]) -> Dual:
    """The next state of a law that steps from period to period."""
    start, middle, _ = (Dual.stacked([given, stored]) for given in inputs)
    if law.form == "absolute":
        return _given(law, law.outputs, x, middle)
    if law.form == "increment":
        return x + _given(law, law.outputs, x, middle)
    return x + _given(law, law.increments(), x, start)


def _integrated(slope: Callable[[Dual, Dual], Dual], begun: Dual, dt: float, inputs: Sequence[Dual]) -> Dual:
    """One Runge-Kutta step of order four under inputs at its start, middle and end."""
    start, middle, end = inputs
    first = slope(begun, start)
    second = slope(begun + first * (0.5 * dt), middle)
    third = slope(begun + second * (0.5 * dt), middle)
    fourth = slope(begun + third * dt, end)
    return begun + (first + second * 2.0 + third * 2.0 + fourth) * (dt / 6.0)


def _between(inputs: Sequence[Dual], share: float) -> Dual:
    """Inputs at a share of a period: the parabola through those at its start, middle and end."""
    start, middle, end = inputs
    weights = (1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)
    return start * weights[0] + middle * weights[1] + end * weights[2]


def trimmed(law: Law, state: Floats, start: Floats) -> Floats:
    """A command under which a state stays as much as it can: the nearest to a first guess, by Gauss and Newton.

    Args:
        law: of a twin.
        state: (n_x,) to be held.
        start: (n_u,), the first guess; where several commands hold the state, the answer is near it.

    Returns:
        The command (n_u,), within its bounds.

    Raises:
        NotAvailable: the law has no derivatives there.
    """
    # A command that is held has arrived.
    at_once = replace(law, actuation=Actuation((Actuator(),) * law.signals.n_u, law.actuation.hidden))
    low, high = np.array([command.bounds for command in law.signals.commands]).T
    sizes = np.array([command.size for command in law.signals.commands])
    scales = np.array([state.scale for state in law.signals.states])

    def off(command: Floats) -> tuple[float, Linear]:
        found = _period(at_once, state, command)
        if not _finite(found):
            return np.inf, found
        return float(np.square(found.drift[: law.signals.n_x] / scales).sum()), found

    best = np.clip(start, low, high)
    least, found = off(best)
    if least == np.inf:
        raise _no_derivatives()
    for _ in range(HALVINGS):
        n_x = law.signals.n_x
        reach = found.B[:n_x] * sizes / scales[:, np.newaxis]
        step = _inwards(reach, -found.drift[:n_x] / scales, best <= low, best >= high) * sizes
        share = 1.0
        for _ in range(HALVINGS):
            tried = np.clip(best + share * step, low, high)
            if (np.abs(tried - best) <= CLOSE * sizes).all():
                return best
            left, there = off(tried)
            if left < least:
                break
            share *= 0.5
        else:
            return best
        settled = least - left <= SETTLED * least
        best, least, found = tried, left, there
        if settled:
            break
    return best


def _inwards(reach: Floats, wanted: Floats, at_low: NDArray[np.bool_], at_high: NDArray[np.bool_]) -> Floats:
    """The shortest least-squares step of commands (n_u,) that leads none beyond a bound at which it is.

    A command that goes beyond it downhill, or would be led there, stays, and the others do what they can without it
    (projected steps of Newton, Bertsekas 1982).
    """
    downhill = reach.T @ wanted
    step, free = np.zeros(reach.shape[1]), ~((at_low & (downhill < 0.0)) | (at_high & (downhill > 0.0)))
    while free.any():
        step[:] = 0.0
        step[free] = np.linalg.lstsq(reach[:, free], wanted, rcond=ALIKE)[0]
        stays = (at_low & (step < 0.0)) | (at_high & (step > 0.0))
        if not stays.any():
            break
        free &= ~stays
    return step


def resting(law: Law) -> Floats:
    """Where the commands of a law are at rest, (n_u,): where its actuators begin, else in the middle of the bounds.

    Args:
        law: of a twin.
    """
    middles = (0.5 * sum(command.bounds) for command in law.signals.commands)
    rests = (actuator.rest for actuator in law.actuation.actuators)
    return np.array([middle if rest is None else rest for middle, rest in zip(middles, rests, strict=True)])

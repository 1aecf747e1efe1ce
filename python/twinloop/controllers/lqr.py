"""Gains of a state feedback from a model: the linear-quadratic regulator around the target."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from twinloop._ground.arrays import Floats, floats, number
from twinloop._ground.elementary import product
from twinloop.controllers.family import Family
from twinloop.controllers.riccati import solve_linear, solve_riccati
from twinloop.controllers.state_feedback import FeedbackFamily
from twinloop.errors import InvalidInput, NotAvailable, unknown

NUDGE = 1e-4
"""Share of its scale by which a state or command is moved to see what follows from it."""


class Steps(Protocol):
    """Dynamics that step many rows at once, such as the engine's models and plants."""

    def step(self, states: Floats, commands: Floats) -> Floats:
        """Next states (rows, n_x) of states (rows, n_x) and commands (rows, n_u)."""
        ...


Dynamics = Steps | Callable[[Floats, Floats], ArrayLike]


def lqr_gains(
    model: Dynamics,
    family: Family,
    target_state: ArrayLike,
    state_weights: Mapping[str, float] | None = None,
    command_weights: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Gains that minimise the weighted sum of squared errors and commands for small errors.

    The model is linearised by central differences at the target, under the commands that the family sends for zero
    error (for a quadrotor: hovering). A state without feedback is assumed to be constant.

    Args:
        model: with a step: `twin.model`, a plant, or a function (state, command) -> next state.
        family: a bound `StateFeedback`.
        target_state: (n_x,), SI units, radians.
        state_weights: cost of a squared error by the name of its state, or "<state>.integral"; by default
            1 / scale², and 1 / (scale · 1 s)² for an integral: an error of one scale that lasted a second costs as
            much as one that is there.
        command_weights: cost of a command's squared deviation from its rest, by name; by default 1 / scale².

    Returns:
        All gains of the family by name, clipped to their bounds; fixed gains as they are.

    Raises:
        InvalidInput: no family of state feedbacks, unknown names, weights of commands that are not above 0, or
            weights of states below 0.
        NotAvailable: the model diverges at the target, or no feedback through this output makes it stable
            there.
    """
    if not isinstance(family, FeedbackFamily):
        raise InvalidInput(
            f"lqr_gains: expected a family of a StateFeedback, found {type(family).__name__}; bind one to the"
            " signals."
        )
    signals = family.signals
    target = floats("Target state", target_state, (signals.n_x,))
    integrals = [f"{name}.integral" for name in family.integral]
    scales = {state.name: state.scale for state in signals.states}
    sources = {name: scales[name.removesuffix(".integral")] for name in (*family.states, *integrals)}
    state_costs = _costs("state", state_weights, sources)
    sizes = {command.name: command.size for command in signals.commands}
    command_costs = _costs("command", command_weights, sizes)
    if min(command_costs) <= 0.0:
        raise InvalidInput(
            "lqr_gains, command weights: expected weights above 0, found 0; give every command a cost."
        )
    rest, mixing = _output_map(family, target)
    a, b = _linearised(model, family, target, rest)
    fed_back = [signals.state_names.index(name) for name in family.states]
    a, b = _with_integrals(a[np.ix_(fed_back, fed_back)], product(b[fed_back], mixing), family)
    q = np.diag(state_costs)
    r = product(mixing.T * np.array(command_costs), mixing)
    # Each state in its scale, each integral in what one scale fills in a period, each output in what costs 1: which
    # pivot is the largest, and whether a deviation has settled, then depends on no unit.
    sizes_in = np.array(
        [*(scales[name] for name in family.states), *(scales[name] * signals.dt for name in family.integral)]
    )
    costs = np.diag(r)
    sizes_out = 1.0 / np.sqrt(np.where(costs > 0.0, costs, 1.0))
    a, b = a * sizes_in / sizes_in[:, np.newaxis], b * sizes_out / sizes_in[:, np.newaxis]
    q, r = q * sizes_in * sizes_in[:, np.newaxis], r * sizes_out * sizes_out[:, np.newaxis]
    # No finite cost stands for "no gains": both the equation and the last solution must have one.
    x = solve_riccati(a, b, q, r)
    gains = None
    if x is not None:
        gains = solve_linear(r + product(product(b.T, x), b), product(product(b.T, x), a))
    if gains is None or not np.isfinite(gains).all():
        raise NotAvailable(
            "LQR gains: expected a model whose fed-back states the commands can lead to the target, found one"
            " that no feedback stabilises there; learn from more tests, feed back other states, or give every"
            " state that drifts a weight."
        )
    gains = gains * sizes_out[:, np.newaxis] / sizes_in
    best = {gain.name: value for gain, value in zip(family.law_gains, gains.ravel().tolist(), strict=True)}
    return family.parameters([np.clip(best[gain.name], gain.low, gain.high) for gain in family.gains])


def _costs(kind: str, weights: Mapping[str, float] | None, scales: Mapping[str, float]) -> list[float]:
    """A weight for each name: as given, or one over its squared scale."""
    if weights is not None and not isinstance(weights, Mapping):
        names = ", ".join(repr(name) for name in scales)
        raise InvalidInput(
            f"lqr_gains, {kind} weights: expected a dict by name among {names}, found {weights!r}."
        )
    given = dict(weights or {})
    for name, weight in given.items():
        if name not in scales:
            raise unknown(f"{kind} to weigh", name, scales)
        if number(f"lqr_gains, weight of {name!r}", weight) < 0.0:
            raise InvalidInput(
                f"lqr_gains, weight of {name!r}: expected at least 0, found {weight:g}; change its sign."
            )
    return [float(given.get(name, 1.0 / (scale * scale))) for name, scale in scales.items()]


def _output_map(family: FeedbackFamily, target: Floats) -> tuple[Floats, Floats]:
    """The commands at no error (n_u,), and how they move with the outputs there (n_u, outputs)."""
    commands = family.signals.commands
    rest = family.controller(np.zeros(family.size)).command(target, target)
    if family.output is None:
        matrix, offset, power = np.eye(len(commands)), np.zeros(len(commands)), 1.0
    else:
        assert family.output.offset is not None  # __post_init__ has set it
        matrix, offset, power = family.output.matrix, family.output.offset, family.output.power
    slopes = np.zeros(len(commands))
    for i, command in enumerate(commands):
        v, sent = float(offset[i]), float(rest[i])
        if v == 0.0 and power < 1.0:
            raise NotAvailable(
                f"LQR gains: expected an output map with a slope at no error, found that {command.name}"
                f" starts from 0 to the power {power:g}; give the Mixer an offset."
            )
        clipped = sent in command.bounds and not (power == 1.0 and v == sent)
        if v == 0.0:
            slopes[i] = float(power == 1.0 and not clipped)
        elif not clipped:
            # The derivative of sign(v) |v|^power, from the engine's own power.
            slopes[i] = power * sent / v
    return rest, matrix * slopes[:, np.newaxis]


def _linearised(
    model: Dynamics, family: FeedbackFamily, target: Floats, rest: Floats
) -> tuple[Floats, Floats]:
    """How the next state moves with the state (n_x, n_x) and with the command (n_x, n_u)."""
    signals = family.signals
    sizes = [state.scale for state in signals.states] + [command.size for command in signals.commands]
    nudges = NUDGE * np.diag(sizes)
    points = np.concatenate([target, rest]) + np.concatenate([nudges, -nudges])
    states, commands = points[:, : signals.n_x], points[:, signals.n_x :]
    step = getattr(model, "step", None)
    if step is not None:
        following = step(states, commands)
    elif callable(model):
        following = [model(state, command) for state, command in zip(states, commands, strict=True)]
    else:
        raise InvalidInput(
            f"lqr_gains, model: expected a model with a step or a step function, found {model!r}; pass"
            " twin.model."
        )
    following = np.asarray(following, dtype=np.float64)
    if following.shape != states.shape:
        raise InvalidInput(
            f"lqr_gains, model: expected next states of {signals.n_x} numbers, found {following.shape[1:]};"
            " pass a model of these signals."
        )
    if not np.isfinite(following).all():
        raise NotAvailable(
            "LQR gains: expected a model that steps on from the target, found one that diverges there at"
            " once; learn from more tests, or choose another target."
        )
    half = len(sizes)
    slopes = signals.difference(following[:half], following[half:]).T / (2.0 * NUDGE * np.array(sizes))
    return slopes[:, : signals.n_x], slopes[:, signals.n_x :]


def _with_integrals(a: Floats, b: Floats, family: FeedbackFamily) -> tuple[Floats, Floats]:
    """The linear model of the errors and their integrals, which count the coming error as the law does.

    With e' = A e − B u and I' = I + dt e', the integrals of a state that is not fed back cannot be led.
    """
    for name in family.integral:
        if name not in family.states:
            raise InvalidInput(
                f"lqr_gains: expected integrals of states that are fed back, found {name!r}; add it to the"
                " states."
            )
    chosen = np.zeros((len(family.integral), len(family.states)))
    for row, name in enumerate(family.integral):
        chosen[row, family.states.index(name)] = family.signals.dt
    corner = np.zeros((len(family.states), len(family.integral)))
    top = np.hstack([a, corner])
    bottom = np.hstack([product(chosen, a), np.eye(len(family.integral))])
    return np.vstack([top, bottom]), np.vstack([b, product(chosen, b)])

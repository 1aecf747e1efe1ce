"""A law: the equations of a twin with all that makes a simulator of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from twinloop import _core
from twinloop._ground.values import Value
from twinloop.law.actuation import Actuation, twists
from twinloop.law.expressions import INPUT, UPRIGHT, Expressions, Node
from twinloop.law.levels import Levels
from twinloop.law.reports import Reports, reports_of, with_reports
from twinloop.signals import RigidBody, Signals


@dataclass(frozen=True, eq=False)
class Law(Value):
    """Equations, kinematics, actuators, hidden states, sensors and the integrator of a twin.

    The inputs of the expressions are the states, the effects of the commands in units of their scales, and the hidden
    states. With the form "acceleration", outputs are the derivatives of the driven states. They are integrated by one
    Runge-Kutta step of order four per period, with effects and hidden states at its start, middle and end. With
    "explicit-euler" and "semi-implicit-euler" they make a step of Euler, under the effects at the start of the period;
    states that others give go on by these as they were, or as they have become. With "absolute" outputs are the next
    state, with "increment" its change, under the effects in the middle of the period.

    Args:
        signals: of the system.
        form: one of `FORMS`.
        expressions: with the equations.
        outputs: nodes of the outputs, in the order of the states that they drive.
        actuation: actuators and hidden states.
        offsets: delay of each state's readings against those of the driven states (n_x,), s.
        levels: in which commands of controllers are sent (n_u,); none where all are sent as they are.
        reports: what is given of readings (n_x,); none where all are given as they are.
        begins: of states that stand for hidden ones where each begins, in words.
    """

    signals: Signals
    form: str
    expressions: Expressions
    outputs: tuple[int, ...]
    actuation: Actuation
    offsets: tuple[float, ...]
    levels: Levels = ()
    reports: Reports = ()
    begins: tuple[str, ...] = ()

    @staticmethod
    def of(model: _core.Model, signals: Signals) -> Law:
        """The law of a model.

        Args:
            model: of the engine.
            signals: of the system.

        Returns:
            Equations with the bits of the model's program.
        """
        expressions = Expressions()
        outputs = expressions.entered(model.program)
        actuation = Actuation.of(model, signals)
        offsets = tuple(model.offsets) or (0.0,) * signals.n_x
        levels = tuple(map(tuple, model.levels))
        reports = reports_of(model, signals.n_x)
        return Law(signals, model.form, expressions, outputs, actuation, offsets, levels, reports)

    def model(self) -> _core.Model:
        """The engine's model of this law, which roll-outs run."""
        program = self.expressions.program(self.outputs, self.inputs)
        model = _core.Model(
            program,
            self.form,
            self.signals.engine,
            self.actuation.actuators,
            self.actuation.hidden,
            self.offsets,
        )
        return with_reports(model.with_levels(self.levels) if self.levels else model, self.reports)

    @property
    def inputs(self) -> int:
        """States, commands and hidden states together."""
        return self.signals.n_x + self.signals.n_u + len(self.actuation.hidden)

    @cached_property
    def command_symbols(self) -> tuple[str, ...]:
        """Name in the equations of each command's effect, in units of its scale."""
        return tuple(_scaled(command.name, command.size, self.signals) for command in self.signals.commands)

    @cached_property
    def hidden_symbols(self) -> tuple[str, ...]:
        """Names of the hidden states in the equations."""
        return tuple(hidden_names(self.signals, len(self.actuation.hidden)))

    @property
    def held_symbols(self) -> tuple[str, ...]:
        """Names of what the hidden states hold from period to period: of what presses beyond a gap, the twist."""
        before = twists(self.actuation.hidden)
        symbols = enumerate(self.hidden_symbols)
        return tuple(twist_name(symbol) if place in before else symbol for place, symbol in symbols)

    @property
    def symbols(self) -> tuple[str, ...]:
        """A name for each input of the equations."""
        return (*self.signals.state_names, *self.command_symbols, *self.hidden_symbols)

    @property
    def commanded(self) -> bool:
        """Whether a command acts in any equation, directly or by a hidden state."""
        nodes = (self.expressions[number] for number in self.expressions.needed(self.outputs))
        places = {int(node.value) for node in nodes if node.operation == INPUT}
        first = self.signals.n_x + self.signals.n_u
        return any(
            place < first or bool(self.actuation.hidden[place - first].commands)
            for place in places
            if place >= self.signals.n_x
        )

    def derivatives(self) -> tuple[int, ...]:
        """Where outputs are derivatives, the node of each state's (n_x,)."""
        signals, remaining = self.signals, iter(self.outputs)
        states = self._states()
        rates: dict[str | None, int] = {
            state.derivative_of: states[state.name]
            for state in signals.states
            if state.derivative_of is not None
        }
        if signals.kinematics is not None:
            rates |= _turning(self.expressions, signals.kinematics, states, states)
        return tuple(rates[name] if name in rates else next(remaining) for name in signals.state_names)

    def increments(self) -> tuple[int, ...]:
        """With a form of Euler, the node of what a period adds to each state (n_x,)."""
        signals, states = self.signals, self._states()
        slopes = dict(zip(signals.state_names, self.derivatives(), strict=True))
        rates = {state.derivative_of: state.name for state in signals.states if state.derivative_of}
        body = signals.kinematics
        dt = self.expressions.constant(signals.dt)

        def make(operation: str, *operands: int) -> int:
            return self.expressions.enter(Node(operation, operands))

        def ended(name: str) -> int:
            return make("+", states[name], added(name))

        def added(name: str) -> int:
            slope = slopes[name]
            if self.form == "semi-implicit-euler" and name in rates:
                slope = ended(rates[name])
            elif self.form == "semi-implicit-euler" and body is not None and name in body.angles:
                turned = _turning(self.expressions, body, states, {rate: ended(rate) for rate in body.rates})
                slope = turned[name]
            return make("*", slope, dt)

        return tuple(added(name) for name in signals.state_names)

    def _states(self) -> dict[str, int]:
        """The node of each state."""
        return {name: self.expressions.input(place) for place, name in enumerate(self.signals.state_names)}


def twist_name(symbol: str) -> str:
    """Name of the twist behind a hidden state that is what presses beyond a gap."""
    return f"{symbol}_twist"


def hidden_names(signals: Signals, count: int) -> list[str]:
    """Symbols of hidden states, none of which is a signal's.

    Args:
        signals: of the system.
        count: how many there are.

    Returns:
        As many names.
    """
    prefix = "hidden"
    while any(name.startswith(prefix) for name in signals.state_names + signals.command_names):
        prefix += "_"
    return [prefix if count == 1 else f"{prefix}_{number + 1}" for number in range(count)]


def _scaled(name: str, size: float, signals: Signals) -> str:
    if size == 1.0:
        return name
    symbol = f"{name}_scaled"
    while symbol in signals.state_names + signals.command_names:
        symbol += "_"
    return symbol


def _turning(
    expressions: Expressions, body: RigidBody, states: Mapping[str, int], rates: Mapping[str, int]
) -> dict[str | None, int]:
    """How body rates turn roll, pitch and yaw (z-y-x angles; Diebel 2006, equation 79), by nodes of both."""

    def make(operation: str, *operands: int) -> int:
        return expressions.enter(Node(operation, operands))

    roll, pitch, _ = (states[name] for name in body.angles)
    p, q, r = (rates[name] for name in body.rates)
    sin, cos = make("sin", roll), make("cos", roll)
    yawing = make("+", make("*", q, sin), make("*", r, cos))
    upright = make(UPRIGHT, make("cos", pitch))
    turned = make("/", make("*", yawing, make("sin", pitch)), upright)
    return {
        body.angles[0]: make("+", p, turned),
        body.angles[1]: make("-", make("*", q, cos), make("*", r, sin)),
        body.angles[2]: make("/", yawing, upright),
    }

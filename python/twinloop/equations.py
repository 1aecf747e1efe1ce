"""Turns a program into equations that a person can read: registers vanish, what is used twice gets a name."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop import _core
from twinloop.errors import InvalidInput
from twinloop.signals import RigidBody, Signals

SMALLEST_DIVISOR = 1e-6
"""A divisor whose magnitude is not above this leaves the dividend as it is (specification, section 4)."""

SUM, PRODUCT, ATOM = 1, 2, 3
"""How tightly an expression binds."""

Node = tuple[str, "int | float | str", "int | None"]
"""("input", name, None), ("constant", value, None) or (operation, first node, second node)."""


class Graph:
    """Expressions that share their equal parts; a node is a number, operands come before what uses them."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}

    def add(self, node: Node) -> int:
        """The number of a node, new or known."""
        if node not in self._numbers:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[node]

    def constant(self, value: float) -> int:
        """The number of a constant."""
        return self.add(("constant", value + 0.0, None))  # + 0.0: one zero, not two

    def value(self, number: int | None) -> float | None:
        """The value of a node that is a constant."""
        if number is None:
            return None
        kind, value, _ = self.nodes[number]
        return float(value) if kind == "constant" else None

    def negated(self, number: int) -> int | None:
        """What a node is the negative of, if it is written as one."""
        operation, first, second = self.nodes[number]
        return second if operation == "-" and isinstance(first, int) and self.value(first) == 0.0 else None

    def apply(self, operation: str, first: int, second: int | None) -> int:
        """The number of an operation on nodes, folded where the result is known.

        Args:
            operation: its name in a program.
            first: the first operand.
            second: the second operand, if there is one.

        Returns:
            A node that has the same value for all finite inputs.
        """
        a, b = self.value(first), self.value(second)
        if second is not None and a is not None and b is not None:
            folded = _fold(operation, a, b)
            if folded is not None and abs(folded) <= 1.7e308:
                return self.constant(folded)
        if operation == "+" and a == 0.0 and second is not None:
            return second
        if operation == "*" and a == 1.0 and second is not None:
            return second
        if (operation in "+-" and b == 0.0) or (operation in "*/" and b == 1.0):
            return first
        if operation == "/" and b is not None and abs(b) <= SMALLEST_DIVISOR:
            return first
        if (operation == "*" and 0.0 in (a, b)) or (operation == "/" and a == 0.0):
            return self.constant(0.0)
        if operation == "-" and first == second:
            return self.constant(0.0)
        if operation in "+-" and second is not None:
            opposite = self.negated(second)
            if opposite is not None:
                return self.apply("-" if operation == "+" else "+", first, opposite)
            opposite = self.negated(first)
            if opposite is not None and operation == "+":
                return self.apply("-", second, opposite)
        return self.add((operation, first, second))

    def counts(self, roots: Sequence[int]) -> list[int]:
        """How often each node is used by the roots and by what they use."""
        counts = [0] * len(self.nodes)
        for root in roots:
            counts[root] += 1
        for number in range(len(self.nodes) - 1, -1, -1):
            if counts[number]:
                for operand in _operands(self.nodes[number]):
                    counts[operand] += 1
        return counts


def program_graph(program: _core.Program, inputs: Sequence[str]) -> tuple[Graph, list[int]]:
    """The effective program as expressions of its inputs.

    Args:
        program: any program.
        inputs: a symbol for each of its inputs.

    Returns:
        The graph, and the node of each output.

    Raises:
        InvalidInput: another number of symbols than of inputs.
    """
    if len(inputs) != program.inputs:
        raise InvalidInput(
            f"Equations: expected {program.inputs} symbols, found {len(inputs)}; name every input."
        )
    graph = Graph()
    zero = graph.constant(0.0)
    registers = [graph.add(("input", name, None)) for name in inputs]
    registers += [zero] * (program.registers - program.inputs)
    for operation, destination, first, second in program.effective().instructions:
        if second is None:
            operand = None
        else:
            operand = graph.constant(second) if isinstance(second, float) else registers[second]
        registers[destination] = graph.apply(operation, registers[first], operand)
    return graph, registers[program.inputs : program.inputs + program.outputs]


class Writer:
    """Writes nodes of a graph as text; nodes that are used several times are written by name.

    Args:
        graph: the expressions.
        roots: what will be written.
        digits: significant digits of constants; 17 are exact.
        prefix: what the names of shared parts begin with.
    """

    def __init__(self, graph: Graph, roots: Sequence[int], digits: int, prefix: str) -> None:
        self.graph = graph
        self.digits = digits
        self.protected = False
        self.names: dict[int, str] = {}
        for number, count in enumerate(graph.counts(roots)):
            if count > 1 and graph.nodes[number][0] not in ("input", "constant"):
                self.names[number] = f"{prefix}{len(self.names) + 1}"

    def number(self, value: float) -> str:
        """A constant as text."""
        return repr(value) if self.digits == 17 else f"{value:.{self.digits}g}"

    def expression(self, number: int, *, define: bool = False) -> str:
        """A node as text.

        Args:
            number: the node.
            define: write what it stands for even if it has a name.

        Returns:
            The text, without outer brackets.
        """
        return self._text(number, define)[0]

    def _text(self, number: int, define: bool = False) -> tuple[str, int]:
        if number in self.names and not define:
            return self.names[number], ATOM
        operation, first, second = self.graph.nodes[number]
        if operation == "input":
            return str(first), ATOM
        if operation == "constant":
            return self.number(float(first)), ATOM
        assert isinstance(first, int)
        if operation not in ("+", "-", "*", "/") or second is None:
            operands = ", ".join(
                self.expression(operand) for operand in _operands((operation, first, second))
            )
            return f"{operation}({operands})", ATOM
        left, right = self.graph.value(first), self.graph.value(second)
        if operation == "-" and left == 0.0:
            return f"-{self._bracketed(second, ATOM)}", SUM
        if operation in "+-" and right is not None and right < 0.0:
            sign = "-" if operation == "+" else "+"
            return f"{self._bracketed(first, SUM)} {sign} {self.number(-right)}", SUM
        if operation == "+" and self._is_sum(second) and not self._is_sum(first):
            first, second = second, first  # a sum commutes to the bit: a - b + c for c + (a - b)
        level = SUM if operation in "+-" else PRODUCT
        symbol = operation
        if operation == "/" and right is None:
            symbol, self.protected = "÷", True
        # The right operand keeps its brackets even where algebra would not need them: rounding does.
        return f"{self._bracketed(first, level)} {symbol} {self._bracketed(second, level + 1)}", level

    def _is_sum(self, number: int) -> bool:
        return number not in self.names and self.graph.nodes[number][0] in ("+", "-")

    def _bracketed(self, number: int, level: int) -> str:
        text, own = self._text(number)
        return f"({text})" if own < level or (text.startswith("-") and level > SUM) else text


def equations(model: _core.Model, signals: Signals, digits: int = 6) -> str:
    """A model as text: a legend of the conventions, then the shared parts, then one equation a state.

    Args:
        model: what was learnt.
        signals: names and units of its states and commands.
        digits: significant digits of constants; 17 give every bit back.

    Returns:
        Lines of text.

    Raises:
        InvalidInput: digits out of range, or signals of another width.
    """
    if not 1 <= digits <= 17:
        raise InvalidInput(f"Equations, digits: expected 1 to 17, found {digits}; 17 are exact.")
    symbols = [_scaled(command.name, command.size, signals) for command in signals.commands]
    hidden = hidden_names(signals, len(model.hidden))
    graph, outputs = program_graph(model.program, [*signals.state_names, *symbols, *hidden])
    taken = {*signals.state_names, *symbols, *hidden}
    prefix = "t"
    while any(name.startswith(prefix) and name[len(prefix) :].isdigit() for name in taken):
        prefix += "_"
    writer = Writer(graph, outputs, digits, prefix)
    body = [f"{name} = {writer.expression(node, define=True)}" for node, name in writer.names.items()]
    body += _states(model.form, signals, [writer.expression(output) for output in outputs])
    body += [_filling(name, parts, symbols, writer) for name, parts in zip(hidden, model.hidden, strict=True)]
    legend = _legend(model.form, signals, symbols, writer) + _actuators(model, signals, writer)
    return "\n".join([*legend, "", *body])


def _legend(form: str, signals: Signals, symbols: Sequence[str], writer: Writer) -> list[str]:
    kinds = {
        "absolute": f"the state one period of {signals.dt:g} s later",
        "increment": f"the state one period of {signals.dt:g} s later, as the state and what is added to it",
        "acceleration": f"derivatives, integrated by one Runge-Kutta step of {signals.dt:g} s",
    }
    units = ", ".join(f"{state.name} in {state.unit or 'units'}" for state in signals.states)
    lines = [f"# Form {form!r}: {kinds.get(form, form)}; {units}."]
    lines += [
        f"# {symbol} = {command.name} / {writer.number(command.size)}, {command.name} in"
        f" {command.unit or '1'}"
        for symbol, command in zip(symbols, signals.commands, strict=True)
        if symbol != command.name
    ]
    if writer.protected:
        lines.append(f"# a ÷ b = a / b where |b| > {SMALLEST_DIVISOR:g}, otherwise a")
    if any(node[0] == "sqrt" for node in writer.graph.nodes):
        lines.append("# sqrt(a) = √|a|")
    return lines


def _states(form: str, signals: Signals, outputs: Sequence[str]) -> list[str]:
    if form == "absolute":
        return [f"{name}[k+1] = {text}" for name, text in zip(signals.state_names, outputs, strict=True)]
    if form == "increment":
        return [
            f"{name}[k+1] = {name} + ({text})"
            for name, text in zip(signals.state_names, outputs, strict=True)
        ]
    rates: dict[str | None, str] = {
        state.derivative_of: state.name for state in signals.states if state.derivative_of is not None
    }
    if signals.kinematics is not None:
        rates |= _turning(signals.kinematics)
    remaining = iter(outputs)
    return [
        f"d {name} / dt = {rates[name] if name in rates else next(remaining)}" for name in signals.state_names
    ]


def _turning(body: RigidBody) -> dict[str | None, str]:
    """How body rates turn roll, pitch and yaw."""
    (roll, pitch, yaw), (p, q, r) = body.angles, body.rates
    turning = f"{q} * sin({roll}) + {r} * cos({roll})"
    return {
        roll: f"{p} + ({turning}) * tan({pitch})",
        pitch: f"{q} * cos({roll}) - {r} * sin({roll})",
        yaw: f"({turning}) / cos({pitch})",
    }


def _actuators(model: _core.Model, signals: Signals, writer: Writer) -> list[str]:
    """What stands between commands and their effect, one line for those that are alike."""
    alike: dict[tuple[float, int, float | None], list[str]] = {}
    for actuator, command in zip(model.actuators, signals.commands, strict=False):
        alike.setdefault(actuator, []).append(command.name)
    lines = []
    for (lag, delay, rest), names in alike.items():
        if lag == 0.0 and delay == 0:
            continue
        parts = [f"a lag of {writer.number(lag)} s"] if lag > 0.0 else []
        parts += [f"a delay of {delay} period{'s' if delay > 1 else ''}"] if delay else []
        start = "the first command" if rest is None else writer.number(rest)
        lines.append(f"# {', '.join(names)}: act with {' and '.join(parts)}, from {start} at the start")
    return lines


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


def _filling(
    name: str, parts: tuple[Sequence[int], bool, float | None, float], symbols: Sequence[str], writer: Writer
) -> str:
    """The equation of a hidden state that commands fill."""
    commands, squared, rest, time = parts
    given = " + ".join(f"{symbols[i]}²" if squared else symbols[i] for i in commands)
    mean = f"({given}) / {len(commands)}" if len(commands) > 1 else given
    still = "the same at the start" if rest is None else writer.number(rest)
    return f"d {name} / dt = {mean} - {still} - {name} / {writer.number(time)}, from 0 at the start"


def _scaled(name: str, size: float, signals: Signals) -> str:
    if size == 1.0:
        return name
    symbol = f"{name}_scaled"
    while symbol in signals.state_names + signals.command_names:
        symbol += "_"
    return symbol


def _operands(node: Node) -> list[int]:
    operation, first, second = node
    if operation in ("input", "constant"):
        return []
    return [operand for operand in (first, second) if isinstance(operand, int)]


def _fold(operation: str, a: float, b: float) -> float | None:
    if operation == "+":
        return a + b
    if operation == "-":
        return a - b
    if operation == "*":
        return a * b
    if operation == "/":
        return a / b if abs(b) > SMALLEST_DIVISOR else a
    return None

"""Expressions by number: equal ones are one, operands come before what uses them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from twinloop import _core

SMALLEST_DIVISOR = 1e-6
"""A divisor whose magnitude is not above this leaves the dividend as it is (specification, section 4)."""
GIMBAL = 1e-3
"""cos of the pitch below which Euler's angles are taken to have no more meaning: it is kept there."""
UNARY = ("abs", "sqrt", "sin", "cos", "tanh", "exp")
"""Functions of one operand that a program computes; sqrt(a) is √|a|."""
BINARY = ("+", "-", "*", "/", "min", "max")
"""Operations on two operands that a program computes; a / b is protected, see `SMALLEST_DIVISOR`."""
COMMUTING = ("+", "*")
INPUT, CONSTANT, POWER, UPRIGHT, SHARE = "input", "constant", "**", "upright", "share"
"""What programs do not have: leaves, whole powers, a cosine kept away from 0 (see `GIMBAL`), a node in units of a
scale."""

Instruction = tuple[str, int, int, "int | float | None"]
"""(operation, destination, first operand, second operand): a register an int, a constant a float."""


class Node(NamedTuple):
    """One expression.

    Args:
        operation: "input", "constant", "**", "upright", "share", or an operation of programs.
        operands: numbers of the nodes that it is computed from.
        value: place of an input, value of a constant, exponent of a power, 1 / scale of a share; 0 for anything else.
    """

    operation: str
    operands: tuple[int, ...] = ()
    value: float = 0.0


_FOLDS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b if abs(b) > SMALLEST_DIVISOR else a,
}


class Expressions:
    """A store of expressions; a node is a number.

    `input`, `constant` and `add` enter an expression as it is written; `apply` folds what is known and is for reading.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}

    def __len__(self) -> int:
        return len(self.nodes)

    def __getitem__(self, number: int) -> Node:
        return self.nodes[number]

    def enter(self, node: Node) -> int:
        """The number of a node, new or known."""
        if node not in self._numbers:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[node]

    def input(self, place: int) -> int:
        """The node of an input, by its place among them."""
        return self.enter(Node(INPUT, (), place))

    def constant(self, value: float) -> int:
        """The node of a constant."""
        return self.enter(Node(CONSTANT, (), float(value) + 0.0))  # + 0.0: one zero, not two

    def power(self, base: int, exponent: int) -> int:
        """The node of a whole power of a node, the exponent at least 1."""
        return base if exponent == 1 else self.enter(Node(POWER, (base,), exponent))

    def share(self, number: int, scale: float) -> int:
        """The node of a node in units of a scale, above 0: a number that no unit changes."""
        return self.enter(Node(SHARE, (number,), 1.0 / scale))

    def add(self, operation: str, *operands: int) -> int:
        """The node of an operation as it is written; sums and products do not depend on the order of operands."""
        if operation in COMMUTING and operands[1] < operands[0]:
            operands = operands[::-1]
        return self.enter(Node(operation, operands))

    def constant_value(self, number: int) -> float | None:
        """The value of a node that is a constant, None for others."""
        return self.nodes[number].value if self.nodes[number].operation == CONSTANT else None

    def apply(self, operation: str, first: int, second: int | None = None) -> int:
        """The node of an operation, folded where the result is known; operands stay in their order.

        Args:
            operation: its name in a program.
            first: the first operand.
            second: the second operand, if there is one.

        Returns:
            A node that has the same value, to the bit, for all finite inputs.
        """
        if second is None:
            return self.enter(Node(operation, (first,)))
        folded = self._folded(operation, first, second)
        return self.enter(Node(operation, (first, second))) if folded is None else folded

    def _folded(self, operation: str, first: int, second: int) -> int | None:
        a, b = self.constant_value(first), self.constant_value(second)
        if a is not None and b is not None and operation in _FOLDS:
            result = _FOLDS[operation](a, b)
            if abs(result) <= 1.7e308:
                return self.constant(result)
        if (operation == "+" and a == 0.0) or (operation == "*" and a == 1.0):
            return second
        if (operation in "+-" and b == 0.0) or (operation in "*/" and b == 1.0):
            return first
        if operation == "/" and b is not None and abs(b) <= SMALLEST_DIVISOR:
            return first
        if (operation == "*" and 0.0 in (a, b)) or (operation == "/" and a == 0.0):
            return self.constant(0.0)
        if operation == "-" and first == second:
            return self.constant(0.0)
        if operation in "+-":
            opposite = self.negated(second)
            if opposite is not None:
                return self.apply("-" if operation == "+" else "+", first, opposite)
            opposite = self.negated(first)
            if opposite is not None and operation == "+":
                return self.apply("-", second, opposite)
        return None

    def negated(self, number: int) -> int | None:
        """What a node is the negative of, if it is written as 0 minus it."""
        node = self.nodes[number]
        zero = node.operation == "-" and self.constant_value(node.operands[0]) == 0.0
        return node.operands[1] if zero else None

    def needed(self, roots: Iterable[int]) -> list[int]:
        """All nodes that some are computed from, these among them, operands first."""
        found: set[int] = set()
        waiting = list(roots)
        while waiting:
            number = waiting.pop()
            if number not in found:
                found.add(number)
                waiting.extend(self.nodes[number].operands)
        return sorted(found)

    def counts(self, roots: Sequence[int]) -> dict[int, int]:
        """How often each needed node is used by the roots and by what they use."""
        needed = self.needed(roots)
        counts = dict.fromkeys(needed, 0)
        for number in [*roots, *(operand for node in needed for operand in self.nodes[node].operands)]:
            counts[number] += 1
        return counts

    def entered(self, program: _core.Program) -> tuple[int, ...]:
        """The outputs of an effective program as nodes, folded where results are known.

        Args:
            program: any program; its inputs are those of the expressions.

        Returns:
            A node for each output, with the program's values to the bit for all finite inputs.
        """
        registers = [self.input(place) for place in range(program.inputs)]
        registers += [self.constant(0.0)] * (program.registers - program.inputs)
        for operation, destination, first, second in program.effective().instructions:
            if isinstance(second, float):
                operand: int | None = self.constant(second)
            else:
                operand = None if second is None else registers[second]
            registers[destination] = self.apply(operation, registers[first], operand)
        return tuple(registers[program.inputs : program.inputs + program.outputs])

    def program(self, roots: Sequence[int], inputs: int) -> _core.Program:
        """A program that computes nodes, equal parts once.

        Args:
            roots: a node for each output.
            inputs: that the program has.

        Returns:
            The program; its values are those of the nodes to the bit.
        """
        compiler = Compiler(self, inputs, len(roots))
        compiler.compute(roots, {root: inputs + i for i, root in reversed([*enumerate(roots)])})
        return compiler.program([[(root, None)] for root in roots])


class Compiler:
    """Turns nodes into the instructions of a program.

    Args:
        expressions: whose nodes they are.
        inputs: of the program.
        outputs: of the program.
    """

    def __init__(self, expressions: Expressions, inputs: int, outputs: int) -> None:
        self.expressions, self.inputs, self.outputs = expressions, inputs, outputs
        self.held: list[int] = []
        """For each constant of the instructions so far, in their order, the node in whose instruction it stands."""
        self._page: list[Instruction] = []
        self._registers: dict[int, int] = {}
        self._free = inputs + outputs

    def compute(self, numbers: Iterable[int], places: Mapping[int, int] | None = None) -> None:
        """Writes what computes some nodes.

        Args:
            numbers: the nodes.
            places: registers in which some of them are to be found, each for one node.
        """
        for number in self.expressions.needed(numbers):
            self._compute(number, places or {})

    def program(self, outputs: Sequence[Sequence[tuple[int, float | None]]]) -> _core.Program:
        """The program of sums of nodes that are computed; a constant need not be.

        Args:
            outputs: for each output nodes with their weights; None: no weight, for a node alone.
        """
        spare = self._new() if any(len(terms) > 1 for terms in outputs) else -1
        for target, terms in enumerate(outputs, start=self.inputs):
            for place, (number, weight) in enumerate(terms):
                value = self.expressions.constant_value(number)
                if value is not None:
                    self._page.append(("+", target, target, value if weight is None else value * weight))
                elif weight is None:
                    if self._registers[number] != target:
                        self._page.append(("+", target, target, self._registers[number]))
                elif place == 0:
                    self._page.append(("*", target, self._registers[number], weight))
                else:
                    self._page.append(("*", spare, self._registers[number], weight))
                    self._page.append(("+", target, target, spare))
        return _core.Program(self.inputs, self.outputs, self._free, [self._page])

    def _compute(self, number: int, places: Mapping[int, int]) -> None:
        """Writes what computes a node of nodes that are computed; constants are written where they are used."""
        operation, operands, value = self.expressions[number]
        if operation == INPUT:
            self._registers[number] = int(value)
        elif operation == POWER:
            base = first = self._register(operands[0])
            for _ in range(int(value) - 1):
                first = self._written("*", first, base, self._new())
            self._registers[number] = first
        elif operation == SHARE:
            self.held.append(number)
            first = self._register(operands[0])
            self._registers[number] = self._written("*", first, value, self._place(number, places))
        elif operation in UNARY:
            first = self._register(operands[0])
            self._registers[number] = self._written(operation, first, None, self._place(number, places))
        elif operation in BINARY:
            a, b = operands
            # An instruction may hold a constant as its second operand only.
            constants = self.expressions.constant_value(a), self.expressions.constant_value(b)
            if operation in COMMUTING and constants[0] is not None and constants[1] is None:
                (a, b), constants = (b, a), constants[::-1]
            first = self._register(a)
            second = self._register(b) if constants[1] is None else constants[1]
            self.held += [number] if constants[1] is not None else []
            self._registers[number] = self._written(operation, first, second, self._place(number, places))
        elif operation != CONSTANT:
            raise ValueError(f"expected an operation of programs, found {operation!r}")

    def _register(self, number: int) -> int:
        """Where a node is found; a constant is put there."""
        if number not in self._registers:
            value = self.expressions.constant_value(number)
            assert value is not None  # operands come first
            register = self._new()
            self._registers[number] = self._written("+", register, value, register)
            self.held.append(number)
        return self._registers[number]

    def _place(self, number: int, places: Mapping[int, int]) -> int:
        return places[number] if number in places else self._new()

    def _written(self, operation: str, first: int, second: int | float | None, register: int) -> int:
        self._page.append((operation, register, first, second))
        return register

    def _new(self) -> int:
        self._free += 1
        return self._free - 1

"""Expressions of a model's inputs: each is a number in a pool, equal ones are one, and all run as one program."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats

Node = tuple[str, int, "int | float | None"]
"""(operation, operand, second operand): a number of a node, a constant, or None under a unary operation."""

UNARY = ("abs", "sqrt", "sin", "cos", "tanh", "exp")
ONE = ("one", 0, None)
"""The node whose value is 1 everywhere."""


class Pool:
    """Nodes by number; operands come before what uses them. The first ones are the inputs.

    Args:
        inputs: how many inputs a program has.
        operations: how many there are to choose from, for the prices.
    """

    def __init__(self, inputs: int, operations: int = 4) -> None:
        self.inputs = inputs
        self.operations = max(2, operations)
        self.nodes: list[Node] = []
        # 2 the node and 2.0 the constant are equal to Python.
        self._numbers: dict[tuple[Node, bool], int] = {}
        self.rungs: dict[int, int] = {}
        self.one = self.add(ONE)

    def __len__(self) -> int:
        return self.inputs + len(self.nodes)

    def add(self, node: Node) -> int:
        """The number of a node, new or known; sums and products do not depend on the order of operands.

        Args:
            node: to be found or entered.

        Returns:
            Its number.
        """
        operation, a, b = node
        if operation in "+*" and isinstance(b, int) and b < a:
            node = (operation, b, a)
        key = (node, isinstance(b, float))
        if key not in self._numbers:
            self._numbers[key] = self.inputs + len(self.nodes)
            self.nodes.append(node)
        return self._numbers[key]

    def node(self, number: int) -> Node | None:
        """A node by its number; None for an input."""
        return None if number < self.inputs else self.nodes[number - self.inputs]

    def rung(self, numbers: Iterable[int]) -> int:
        """The highest rung of the ladder that some terms stand on; one above all for what was evolved."""
        top = max(self.rungs.values(), default=-1) + 1
        return max((self.rungs.get(number, top) for number in numbers), default=0)

    def product(self, *factors: int) -> int:
        """The node of a product of several nodes."""
        result = factors[0]
        for factor in factors[1:]:
            result = self.add(("*", result, factor))
        return result

    def operands(self, number: int) -> list[int]:
        """Nodes that a node is computed from."""
        node = self.node(number)
        if node is None or node == ONE:
            return []
        return [node[1], *([node[2]] if isinstance(node[2], int) else [])]

    def needed(self, numbers: Iterable[int]) -> list[int]:
        """All nodes, no inputs, that must be computed for some, operands first."""
        found: set[int] = set()
        waiting = list(numbers)
        while waiting:
            number = waiting.pop()
            if number >= self.inputs and number not in found:
                found.add(number)
                waiting.extend(self.operands(number))
        return sorted(found)

    def leaves(self, number: int) -> list[int | None]:
        """Inputs that an expression is written with, one after another; None for a constant."""
        node = self.node(number)
        if node is None:
            return [number]
        if node == ONE:
            return [None]
        found = [leaf for operand in self.operands(number) for leaf in self.leaves(operand)]
        return found + [None] * isinstance(node[2], float)

    def length(self, number: int) -> float:
        """Description length of an expression in nats.

        It is linear, made of one input twice, or of two inputs: three kinds, and a choice within the kind, for laws of
        machines are as often quadratic as linear. Each further input or constant is a choice of its own, with its
        operation, and so is each function: where rates have one sign only, |rate| must not be as short as -rate.
        """
        n, leaves = self.inputs, self.leaves(number)
        choices = 1 + n if len(set(leaves)) < 2 else max(1 + n, n * (n - 1) / 2)
        operation = float(np.log(self.operations))
        further = max(0, len(leaves) - 2) * (float(np.log(n)) + operation)
        return float(np.log(3.0 * choices)) + further + self.functions(number) * operation

    def functions(self, number: int) -> int:
        """How often an expression applies a function of one operand."""
        node = self.node(number)
        own = node is not None and node[0] in UNARY
        return own + sum(self.functions(operand) for operand in self.operands(number))

    def text(self, number: int, symbols: Sequence[str]) -> str:
        """An expression as it would be written, with a symbol for each input."""
        node = self.node(number)
        if node is None:
            return symbols[number]
        operation, a, b = node
        if node == ONE:
            return "1"
        first = self.text(a, symbols)
        if operation in UNARY:
            return f"{operation}({first})"
        second = self.text(b, symbols) if isinstance(b, int) else f"{b:.4g}"
        if operation in ("min", "max"):
            return f"{operation}({first}, {second})"
        return f"{first} {operation} {second}" if operation == "*" else f"({first} {operation} {second})"

    def values(self, numbers: Sequence[int], rows: Floats) -> Floats:
        """Nodes evaluated.

        Args:
            numbers: p nodes.
            rows: inputs (rows, inputs).

        Returns:
            Values (rows, p); not finite where an operation overflows.
        """
        order = self.needed(numbers)
        if not order:
            return np.ascontiguousarray(rows[:, list(numbers)])
        register = {number: number for number in range(self.inputs)}
        register |= {number: self.inputs + i for i, number in enumerate(order)}
        lines = [self._instruction(number, register) for number in order]
        text = _text(self.inputs, len(order), len(register), lines)
        computed = _core.Program.parse(text).run(rows)
        place = {number: i for i, number in enumerate(order)}
        columns = [rows[:, n] if n < self.inputs else computed[:, place[n]] for n in numbers]
        return np.ascontiguousarray(np.stack(columns, axis=1))

    def program(self, outputs: Sequence[Mapping[int, float]]) -> _core.Program:
        """A program of which each output is a weighted sum of nodes.

        Args:
            outputs: for each output, weights by node.

        Returns:
            The program; its constants are the weights, output after output, and those inside nodes.
        """
        order = self.needed(n for terms in outputs for n in terms if n != self.one)
        first = self.inputs + len(outputs)
        register = {number: number for number in range(self.inputs)}
        register |= {number: first + i for i, number in enumerate(order)}
        spare = first + len(order)
        lines = [self._instruction(number, register) for number in order]
        for i, terms in enumerate(outputs):
            target, started = self.inputs + i, False
            for number, weight in terms.items():
                if number == self.one:
                    lines.append(f"r{target} = r{target} + {float(weight)!r}")
                elif not started:
                    lines.append(f"r{target} = r{register[number]} * {float(weight)!r}")
                else:
                    lines.append(f"r{spare} = r{register[number]} * {float(weight)!r}")
                    lines.append(f"r{target} = r{target} + r{spare}")
                started = True
        return _core.Program.parse(_text(self.inputs, len(outputs), spare + 1, lines))

    def _instruction(self, number: int, register: Mapping[int, int]) -> str:
        node = self.node(number)
        assert node is not None
        operation, a, b = node
        target = f"r{register[number]}"
        if node == ONE:
            return f"{target} = {target} + 1.0"
        if operation in UNARY:
            return f"{target} = {operation}(r{register[a]})"
        second = f"r{register[b]}" if isinstance(b, int) else repr(float(b or 0.0))
        if operation in ("min", "max"):
            return f"{target} = {operation}(r{register[a]}, {second})"
        return f"{target} = r{register[a]} {operation} {second}"


def _text(inputs: int, outputs: int, registers: int, lines: Sequence[str]) -> str:
    body = "\n".join(f"  {line}" for line in lines)
    return f"program inputs={inputs} outputs={outputs} registers={registers}\npage 1\n{body}\n"

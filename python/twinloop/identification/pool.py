"""Expressions of a model's inputs: each is a number in a pool, equal ones are one, and all run as one program."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.elementary import log
from twinloop.errors import InvalidInput, unknown
from twinloop.records import Record, Recorded, checked_record, plain, read

Node = tuple[str, int, "int | float | None"]
"""(operation, operand, second operand): a number of a node, a constant, or None under a unary operation.

("hidden", i, None) is a hidden state by its number: a further input, where a model has one.
"""

Instruction = tuple[str, int, int, "int | float | None"]
"""(operation, destination, first operand, second operand): a register an int, a constant a float."""

UNARY = ("abs", "sqrt", "sin", "cos", "tanh", "exp")
BINARY = ("+", "-", "*", "/", "min", "max")
ONE = ("one", 0, None)
"""The node whose value is 1 everywhere."""
MOST_LEAVES = 10_000
"""Inputs and constants of one expression: a record with more is refused, for it would never be worked through."""


class Pool(Recorded, kind="pool"):
    """Nodes by number; operands come before what uses them. The first ones are the inputs.

    `rungs` says on which rung of the ladder a term stands; `found`, what an expression costs (nats) that was read off a
    model, which is one choice however long it is.

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
        self.found: dict[int, float] = {}
        self._lengths: dict[int, float] = {}
        self.one = self.add(ONE)

    def __len__(self) -> int:
        return self.inputs + len(self.nodes)

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "inputs", "operations", "nodes", "rungs", "found"

    def to_record(self) -> Record:
        """The pool as numbers, texts, lists and dicts; a constant is {"constant": value}, for 2 is a node."""
        return {
            **self._head(),
            "inputs": self.inputs,
            "operations": self.operations,
            "nodes": [
                [operation, a, {"constant": plain(b)} if isinstance(b, float) else b]
                for operation, a, b in self.nodes
            ],
            "rungs": [[number, rung] for number, rung in self.rungs.items()],
            "found": [[number, plain(price)] for number, price in self.found.items()],
        }

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Pool:
        found = checked_record(record, cls, cls.recorded_fields(), where)
        pool = cls(
            _below(1 << 12, read(int, found["inputs"], f"{where}.inputs"), where),
            _below(2**31, read(int, found["operations"], f"{where}.operations"), where),
        )
        leaves = [1] * pool.inputs
        for i, node in enumerate(read(list[Any], found["nodes"], f"{where}.nodes")):
            at = f"{where}.nodes[{i}]"
            entered = _node(node, pool.inputs + i, at)
            if pool.add(entered) != pool.inputs + i:
                raise InvalidInput(f"Record {at}: expected 1 first and each node once, found another order.")
            leaves.append(1 + sum(leaves[operand] for operand in pool.operands(pool.inputs + i)))
            if leaves[-1] > MOST_LEAVES:
                raise InvalidInput(f"Record {at}: expected an expression of {MOST_LEAVES} parts at most.")
        pool.rungs = read(dict[int, int], found["rungs"], f"{where}.rungs")
        pool.found = read(dict[int, float], found["found"], f"{where}.found")
        for number in (*pool.rungs, *pool.found):
            _below(len(pool), number, where)
        return pool

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

    def forget(self, first: int) -> None:
        """Takes back all nodes from a number on: what is entered later gets the numbers that it would have had."""
        del self.nodes[first - self.inputs :]
        self._numbers = {key: number for key, number in self._numbers.items() if number < first}
        self.rungs = {number: rung for number, rung in self.rungs.items() if number < first}
        self.found = {number: price for number, price in self.found.items() if number < first}
        self._lengths = {number: length for number, length in self._lengths.items() if number < first}

    def node(self, number: int) -> Node | None:
        """A node by its number; None for an input."""
        return None if number < self.inputs else self.nodes[number - self.inputs]

    def rung(self, numbers: Iterable[int]) -> int:
        """The highest rung of the ladder that some terms stand on; one above all for what was evolved."""
        top = max(self.rungs.values(), default=-1) + 1
        return max((self.rungs.get(number, top) for number in numbers), default=0)

    def hidden(self, number: int) -> int:
        """The node of a hidden state."""
        return self.add(("hidden", number, None))

    def is_hidden(self, number: int) -> bool:
        """Whether a node is made of a hidden state."""
        return any(self._is_input(part) and part >= self.inputs for part in self._parts(number))

    def _is_input(self, number: int) -> bool:
        node = self.node(number)
        return node is None or node[0] == "hidden"

    def _input(self, number: int) -> int:
        """The place of an input among those of a program: hidden states are the last ones."""
        node = self.node(number)
        return number if node is None else self.inputs + node[1]

    def _parts(self, number: int) -> list[int]:
        return [number, *(part for operand in self.operands(number) for part in self._parts(operand))]

    def product(self, *factors: int) -> int:
        """The node of a product of several nodes."""
        result = factors[0]
        for factor in factors[1:]:
            result = self.add(("*", result, factor))
        return result

    def wave(self, function: str, number: int, period: float | None) -> int:
        """The node of the sine or cosine of a node, over a period of it; None: over 2π."""
        if period is not None and period != 2.0 * math.pi:
            number = self.add(("*", number, 2.0 * math.pi / period))
        return self.add((function, number, None))

    def operands(self, number: int) -> list[int]:
        """Nodes that a node is computed from."""
        node = self.node(number)
        if node is None or node == ONE or node[0] == "hidden":
            return []
        return [node[1], *([node[2]] if isinstance(node[2], int) else [])]

    def needed(self, numbers: Iterable[int]) -> list[int]:
        """All nodes, no inputs, that must be computed for some, operands first."""
        found: set[int] = set()
        waiting = list(numbers)
        while waiting:
            number = waiting.pop()
            if not self._is_input(number) and number not in found:
                found.add(number)
                waiting.extend(self.operands(number))
        return sorted(found)

    def leaves(self, number: int) -> list[int | None]:
        """Inputs that an expression is written with, one after another; None for a constant."""
        node = self.node(number)
        if node is None or node[0] == "hidden":
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
        if number in self.found:
            return self.found[number]
        if number not in self._lengths:
            self._lengths[number] = self._written(number)
        return self._lengths[number]

    def _written(self, number: int) -> float:
        n, leaves = self.inputs, self.leaves(number)
        choices = 1 + n if len(set(leaves)) < 2 else max(1 + n, n * (n - 1) / 2)
        operation = float(log(self.operations))
        further = max(0, len(leaves) - 2) * self.further
        return float(log(3.0 * choices)) + further + self.functions(number) * operation

    @property
    def further(self) -> float:
        """What one more input or constant adds to the description length of an expression, in nats."""
        return float(log(self.inputs) + log(self.operations))

    def functions(self, number: int) -> int:
        """How often an expression applies a function of one operand."""
        node = self.node(number)
        own = node is not None and node[0] in UNARY
        return own + sum(self.functions(operand) for operand in self.operands(number))

    def text(self, number: int, symbols: Sequence[str]) -> str:
        """An expression as it would be written, with a symbol for each input, hidden states last."""
        node = self.node(number)
        if node is None or node[0] == "hidden":
            return symbols[self._input(number)]
        operation, a, b = node
        if node == ONE:
            return "1"
        if operation == "+" and isinstance(b, int) and self._is_sum(b) and not self._is_sum(a):
            a, b = b, a
        first = self.text(a, symbols)
        if operation in UNARY:
            return f"{operation}({first})"
        second = self.text(b, symbols) if isinstance(b, int) else f"{b:.4g}"
        if operation in ("min", "max"):
            return f"{operation}({first}, {second})"
        if operation == "*":
            return f"{first} * {second}"
        first = first[1:-1] if operation in "+-" and self._is_sum(a) else first
        return f"({first} {operation} {second})"

    def _is_sum(self, number: int) -> bool:
        node = self.node(number)
        return node is not None and node[0] in ("+", "-")

    def values(self, numbers: Sequence[int], rows: Floats) -> Floats:
        """Nodes evaluated.

        Args:
            numbers: p nodes.
            rows: inputs, then hidden states (rows, inputs + hidden).

        Returns:
            Values (rows, p); not finite where an operation overflows.
        """
        order = self.needed(numbers)
        if not order:
            return np.ascontiguousarray(rows[:, [self._input(number) for number in numbers]])
        inputs = rows.shape[1]
        place = {number: i for i, number in enumerate(order)}
        page = [self._instruction(number, place, inputs) for number in order]
        computed = _core.Program(inputs, len(order), inputs + len(order), [page]).run(rows)
        columns = [rows[:, self._input(n)] if self._is_input(n) else computed[:, place[n]] for n in numbers]
        return np.ascontiguousarray(np.stack(columns, axis=1))

    def program(self, outputs: Sequence[Mapping[int, float]], hidden: int = 0) -> _core.Program:
        """A program of which each output is a weighted sum of nodes.

        Args:
            outputs: for each output, weights by node.
            hidden: how many hidden states follow the inputs.

        Returns:
            The program; its constants are the weights, output after output, and those inside nodes.
        """
        order = self.needed(n for terms in outputs for n in terms if n != self.one)
        inputs = self.inputs + hidden
        first = inputs + len(outputs)
        place = {number: i for i, number in enumerate(order)}
        spare = first + len(order)
        page = [self._instruction(number, place, first) for number in order]
        for i, terms in enumerate(outputs):
            target, started = inputs + i, False
            for number, weight in terms.items():
                if number == self.one:
                    page.append(("+", target, target, float(weight)))
                elif not started:
                    page.append(("*", target, self._register(number, place, first), float(weight)))
                else:
                    page.append(("*", spare, self._register(number, place, first), float(weight)))
                    page.append(("+", target, target, spare))
                started = True
        return _core.Program(inputs, len(outputs), spare + 1, [page])

    def _register(self, number: int, place: Mapping[int, int], first: int) -> int:
        """Where a node is found, where those that are computed stand from a first register on."""
        return self._input(number) if self._is_input(number) else first + place[number]

    def _instruction(self, number: int, place: Mapping[int, int], first: int) -> Instruction:
        node = self.node(number)
        assert node is not None
        operation, a, b = node
        target = self._register(number, place, first)
        if node == ONE:
            return "+", target, target, 1.0
        second = self._register(b, place, first) if isinstance(b, int) else b
        return operation, target, self._register(a, place, first), second


def _node(value: object, number: int, where: str) -> Node:
    """A node from its plain form; operands come before it."""
    operation, a, b = read(tuple[str, int, Any], value, where)
    if operation == "one" and (a, b) == (0, None):
        return ONE
    if operation == "hidden" and b is None:
        return operation, _below(2**31, a, where), None
    if operation in UNARY and b is None:
        return operation, _below(number, a, where), None
    if operation not in BINARY:
        raise unknown(f"operation in the record {where}", operation, (*BINARY, *UNARY, "one", "hidden"))
    if isinstance(b, Mapping) and set(b) == {"constant"}:
        return operation, _below(number, a, where), read(float, b["constant"], f"{where}.constant")
    return operation, _below(number, a, where), _below(number, read(int, b, where), where)


def _below(limit: int, number: int, where: str) -> int:
    if not 0 <= number < limit:
        raise InvalidInput(f"Record {where}: expected a number from 0 to {limit - 1}, found {number}.")
    return number

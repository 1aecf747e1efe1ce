"""Expressions of a model's inputs, with what they cost: equal ones are one, and all run as one program."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import log
from twinloop.errors import InvalidInput, unknown
from twinloop.law.equations import readable
from twinloop.law.expressions import (
    BINARY,
    CONSTANT,
    INPUT,
    SHARE,
    UNARY,
    Compiler,
    Expressions,
    Node,
)
from twinloop.records import Record, Recorded, checked_record, plain, read

MOST_LEAVES = 10_000
"""Inputs and constants of one expression: a record with more is refused, for it would never be worked through."""
NO_PARTS = (INPUT, CONSTANT, SHARE, "*")
"""Operations of nodes that cost within an expression what they are written with, however they are priced alone."""


class Pool(Expressions, Recorded, kind="pool"):
    """Expressions of states, commands and hidden states: the inputs are the first nodes, then the constant 1.

    `rungs` says on which rung of the ladder a term stands; `found`, what an expression costs (nats) that was read off a
    model, which is one choice however long it is.

    Args:
        inputs: how many inputs a program has; hidden states are further ones.
        operations: how many there are to choose from, for the prices.
    """

    def __init__(self, inputs: int, operations: int = 4) -> None:
        super().__init__()
        self.inputs = inputs
        self.operations = max(2, operations)
        self.rungs: dict[int, int] = {}
        self.found: dict[int, float] = {}
        self._lengths: dict[int, float] = {}
        self._hidden: dict[int, frozenset[int]] = {}
        self._made_of: dict[int, frozenset[int]] = {}
        for place in range(inputs):
            self.input(place)
        self.one = self.constant(1.0)

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return "inputs", "operations", "nodes", "rungs", "found"

    def to_record(self) -> Record:
        """The pool as numbers, texts, lists and dicts; a node is [operation, operands, value]."""
        return {
            **self._head(),
            "inputs": self.inputs,
            "operations": self.operations,
            "nodes": [
                [operation, list(operands), plain(value)]
                for operation, operands, value in self.nodes[self.one + 1 :]
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
        leaves = [1] * len(pool)
        for i, plain_node in enumerate(read(list[Any], found["nodes"], f"{where}.nodes")):
            at = f"{where}.nodes[{i}]"
            node = _node(plain_node, pool, at)
            if pool.enter(node) != len(leaves):
                raise InvalidInput(f"Record {at}: expected each node once, found one that there is already.")
            leaves.append(max(1, sum(leaves[operand] for operand in node.operands)))
            if leaves[-1] > MOST_LEAVES:
                raise InvalidInput(f"Record {at}: expected an expression of {MOST_LEAVES} parts at most.")
        pool.rungs = read(dict[int, int], found["rungs"], f"{where}.rungs")
        pool.found = read(dict[int, float], found["found"], f"{where}.found")
        for number in (*pool.rungs, *pool.found):
            _below(len(pool), number, where)
        return pool

    def add(self, operation: str, *operands: int | float) -> int:
        """The node of an operation on nodes, or on constants where a float is given; it is not simplified.

        Args:
            operation: its name in a program.
            operands: a number of a node is an int, a constant a float. Sums and products do not depend on their order.

        Returns:
            The number of the node.
        """
        nodes = (self.constant(each) if isinstance(each, float) else each for each in operands)
        return super().add(operation, *nodes)

    def copy(self) -> Pool:
        """The same expressions by the same numbers; what is entered in one of the two does not show in the other."""
        other = Pool(self.inputs, self.operations)
        other.nodes, other._numbers = list(self.nodes), dict(self._numbers)
        other.rungs, other.found = dict(self.rungs), dict(self.found)
        other._lengths, other._hidden = dict(self._lengths), dict(self._hidden)
        other._made_of = dict(self._made_of)
        return other

    def extends(self, other: Pool) -> bool:
        """Whether every number of another pool means the same in this one."""
        return self.inputs == other.inputs and self.nodes[: len(other)] == other.nodes

    def rung(self, numbers: Iterable[int]) -> int:
        """The highest rung of the ladder that some terms stand on; one above all for what was evolved."""
        asked = [self.rungs.get(number) for number in numbers]
        known = [rung for rung in asked if rung is not None]
        evolved = len(known) < len(asked)
        return max(self.rungs.values(), default=-1) + 1 if evolved else max(known, default=0)

    def hidden(self, number: int) -> int:
        """The node of a hidden state: a further input, where a model has one."""
        return self.input(self.inputs + number)

    def is_hidden(self, number: int) -> bool:
        """Whether a node is made of a hidden state."""
        return bool(self.hidden_in(number))

    def hidden_in(self, number: int) -> frozenset[int]:
        """Numbers of the hidden states that a node is made of."""
        if number not in self._hidden:
            parts = (self[part] for part in self.needed([number]))
            places = (int(part.value) - self.inputs for part in parts if part.operation == INPUT)
            self._hidden[number] = frozenset(place for place in places if place >= 0)
        return self._hidden[number]

    def reach(self, number: int) -> int:
        """How many inputs, hidden states among them, a node needs at least; `inputs` where nothing is hidden in it."""
        return self.inputs + max(self.hidden_in(number), default=-1) + 1

    def product(self, *factors: int) -> int:
        """The node of a product of several nodes."""
        result = factors[0]
        for factor in factors[1:]:
            result = self.add("*", result, factor)
        return result

    def bare(self, number: int) -> int:
        """The node of the same expression without shares."""
        operation, operands, _ = self[number]
        if operation == SHARE:
            return self.bare(operands[0])
        parts = tuple(self.bare(operand) for operand in operands)
        return number if parts == operands else super().add(operation, *parts)

    def wave(self, function: str, number: int, period: float | None) -> int:
        """The node of the sine or cosine of a node, over a period of it; None: over 2π.

        The period is a unit, and no constant that tuning may change.
        """
        if period is not None and period != 2.0 * math.pi:
            number = self.share(number, period / (2.0 * math.pi))
        return self.add(function, number)

    def leaves(self, number: int) -> list[int | None]:
        """Inputs that an expression is written with, one after another; None for a constant."""
        operation, operands, _ = self[number]
        if operation == INPUT:
            return [number]
        if operation == CONSTANT:
            return [None]
        # The scale of a share is that of a unit, and no choice.
        return [leaf for operand in operands for leaf in self.leaves(operand)]

    def length(self, number: int) -> float:
        """Description length of an expression in nats.

        It is linear, made of one input twice, or of two inputs: three kinds, and a choice within the kind, for laws of
        machines are as often quadratic as linear. Each further input or constant is a choice of its own, with its
        operation, and so is each function: where rates have one sign only, |rate| must not be as short as -rate.
        A part that was found among many costs what it does alone, such as the place where a stop begins.
        """
        if number in self.found:
            return self.found[number]
        written = self.written(number)
        return written if self._parts(number).isdisjoint(self.found) else written + self._owed(number)

    def _parts(self, number: int) -> frozenset[int]:
        """What an expression is made of, without itself, inputs, constants and products."""
        if number not in self._made_of:
            parts = (part for part in self.needed([number]) if self[part].operation not in NO_PARTS)
            self._made_of[number] = frozenset(parts) - {number}
        return self._made_of[number]

    def _owed(self, number: int) -> float:
        """What the parts of an expression cost beyond how they are written: of those that were found, the outermost."""
        owed = 0.0
        for operand in self[number].operands:
            if operand in self.found and self[operand].operation not in NO_PARTS:
                owed += max(0.0, self.found[operand] - self.written(operand))
            else:
                owed += self._owed(operand)
        return owed

    def written(self, number: int) -> float:
        """Description length in nats of an expression as it is written, whatever it was found among."""
        if number not in self._lengths:
            self._lengths[number] = self._as_written(number)
        return self._lengths[number]

    def _as_written(self, number: int) -> float:
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
        operation, operands, _ = self[number]
        return (operation in UNARY) + sum(self.functions(operand) for operand in operands)

    def text(self, number: int, symbols: Sequence[str]) -> str:
        """An expression multiplied out, with a symbol for each input, hidden states last."""
        return readable(self, number, symbols)

    def values(self, numbers: Sequence[int], rows: Floats) -> Floats:
        """Nodes evaluated.

        Args:
            numbers: p nodes.
            rows: inputs, then hidden states (rows, inputs + hidden).

        Returns:
            Values (rows, p); not finite where an operation overflows.
        """
        computed = [number for number in dict.fromkeys(numbers) if self[number].operation != INPUT]
        results = self.program(computed, rows.shape[1]).run(rows) if computed else rows
        place = {number: i for i, number in enumerate(computed)}
        values = np.empty((len(rows), len(numbers)))
        for column, number in enumerate(numbers):
            values[:, column] = (
                results[:, place[number]] if number in place else rows[:, int(self[number].value)]
            )
        return values

    def program_of_sums(self, outputs: Sequence[Mapping[int, float]], hidden: int = 0) -> _core.Program:
        """A program of which each output is a weighted sum of nodes.

        Args:
            outputs: for each output, weights by node.
            hidden: how many hidden states follow the inputs.

        Returns:
            The program; its constants are those inside nodes, see `held`, and the weights, output after output.
        """
        compiler = Compiler(self, self.inputs + hidden, len(outputs))
        compiler.compute(self._inside(number for terms in outputs for number in terms))
        return compiler.program(
            [[(number, float(weight)) for number, weight in terms.items()] for terms in outputs]
        )

    def held(self, numbers: Iterable[int]) -> list[int]:
        """For each constant inside nodes of a program of sums, the node in whose instruction it stands.

        The scale of a share is one of them.
        """
        compiler = Compiler(self, len(self), 0)
        compiler.compute(self._inside(numbers))
        return compiler.held

    def _inside(self, numbers: Iterable[int]) -> list[int]:
        return [number for number in numbers if number != self.one]


def _node(value: object, pool: Pool, where: str) -> Node:
    """A node from its plain form; operands come before it."""
    operation, operands, number = read(tuple[str, list[int], float], value, where)
    sizes = {**dict.fromkeys(UNARY, 1), **dict.fromkeys(BINARY, 2), INPUT: 0, CONSTANT: 0, SHARE: 1}
    if operation not in sizes:
        raise unknown(f"operation in the record {where}", operation, sizes)
    fits = len(operands) == sizes[operation] and (number == 0.0 or operation in (INPUT, CONSTANT, SHARE))
    if not fits or (operation == INPUT and not (number.is_integer() and pool.inputs <= number < 2**31)):
        raise InvalidInput(
            f"Record {where}: expected an operation with its operands and no value, a constant, a share, or a further"
            f" input, found {operation!r} with {len(operands)} operands and the value {number:g}."
        )
    places = tuple(_below(len(pool), operand, where) for operand in operands)
    return Node(operation, places, int(number) if operation == INPUT else number)


def _below(limit: int, number: int, where: str) -> int:
    if not 0 <= number < limit:
        raise InvalidInput(f"Record {where}: expected a number from 0 to {limit - 1}, found {number}.")
    return number

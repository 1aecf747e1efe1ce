"""From formulas as text, such as another package prints them, to a program."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from twinloop import _core
from twinloop.errors import InvalidInput, engine_input

OPERATIONS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
FUNCTIONS = ("sin", "cos", "tanh", "exp", "sqrt", "abs")


def program(formulas: Sequence[str], registers: Mapping[str, int], inputs: int) -> _core.Program:
    """A program that computes formulas.

    Args:
        formulas: one for each output, of +, −, ×, ÷, whole powers (`^` or `**`), and one-place functions.
        registers: input register of each name.
        inputs: that the program has.

    Returns:
        The program; equal parts are computed once.

    Raises:
        InvalidInput: a formula that cannot be read, or that uses what a program cannot compute.
    """
    writer = _Writer(registers, inputs, len(formulas))
    for output, formula in enumerate(formulas, start=inputs):
        try:
            tree = ast.parse(formula.replace("^", "**").strip(), mode="eval").body
        except SyntaxError as reason:
            raise InvalidInput(
                f"Formula {formula[:60]!r}: expected one that can be read: {reason}."
            ) from reason
        writer.write(output, tree)
    with engine_input():
        return _core.Program.parse(writer.text())


class _Writer:
    """Instructions so far; a value is a register, or a number."""

    def __init__(self, registers: Mapping[str, int], inputs: int, outputs: int) -> None:
        self._names, self._inputs, self._outputs = registers, inputs, outputs
        self._free = inputs + outputs
        self._lines: list[str] = []
        self._known: dict[str, str] = {}

    def write(self, output: int, tree: ast.expr) -> None:
        value = self._value(tree)
        self._lines.append(f"r{output} = r{output} + {_operand(value)}")

    def text(self) -> str:
        head = f"program inputs={self._inputs} outputs={self._outputs} registers={self._free}"
        return "\n".join([head, "page 1", *self._lines])

    def _value(self, node: ast.expr) -> str | float:
        match node:
            case ast.Constant(value=int() | float()):
                return float(node.value)  # type: ignore[arg-type]
            case ast.Name(id=name) if name in self._names:
                return f"r{self._names[name]}"
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                value = self._value(operand)
                return -value if isinstance(value, float) else self._entered(f"{value} * -1.0")
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._value(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as power)) if power >= 1:
                base = self._register(self._value(left))
                value = base
                for _ in range(power - 1):
                    value = self._entered(f"{value} * {base}")
                return value
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in OPERATIONS:
                first, second = self._value(left), self._value(right)
                return self._entered(
                    f"{self._register(first)} {OPERATIONS[type(operation)]} {_operand(second)}"
                )
            case ast.Call(func=ast.Name(id=name), args=[argument]) if name in FUNCTIONS:
                return self._entered(f"{name}({self._register(self._value(argument))})")
        raise InvalidInput(
            f"Formula: expected + − × ÷, whole powers, {', '.join(FUNCTIONS)} and known names, found"
            f" {ast.unparse(node)[:60]!r}; restrict what the formula may use."
        )

    def _register(self, value: str | float) -> str:
        # First operands are registers; a spare one that nobody writes holds 0.
        return value if isinstance(value, str) else self._entered(f"{self._zero()} + {value!r}")

    def _zero(self) -> str:
        if "zero" not in self._known:
            self._known["zero"] = f"r{self._free}"
            self._free += 1
        return self._known["zero"]

    def _entered(self, expression: str) -> str:
        if expression not in self._known:
            self._known[expression] = f"r{self._free}"
            self._lines.append(f"r{self._free} = {expression}")
            self._free += 1
        return self._known[expression]


def _operand(value: str | float) -> str:
    return value if isinstance(value, str) else repr(value)

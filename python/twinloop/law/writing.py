"""Writes expressions as text that a person, Python and SymPy read alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from twinloop.law.expressions import CONSTANT, INPUT, POWER, SMALLEST_DIVISOR, UPRIGHT, Expressions

SUM, PRODUCT, HIGH, ATOM = 1, 2, 3, 4
"""How tightly an expression binds."""
LONGEST_PART = 60
"""Characters above which a part of an expression gets a name."""
WORTH_A_NAME = 24
"""Characters above which a part that is written several times gets a name."""
ENDLESS = 2000
"""Characters above which whatever is written several times gets a name."""
EXACT = 17
"""Digits that give every bit of a constant back."""

Term = tuple[str, str]
"""Sign, "+" or "-", and what is added or subtracted."""


def decimal(value: float, digits: int) -> str:
    """A constant as text with a number of significant digits; 17 are exact."""
    return repr(value) if digits == EXACT else f"{value:.{digits}g}"


@dataclass(frozen=True)
class Dialect:
    """How a language writes expressions.

    Args:
        functions: how an operation is written of its operands, where not as its name with brackets.
        division: how a protected division is written of its operands; None: as a / b.
        times: what stands between factors.
        power: how a whole power is written of its base and exponent.
        number: writes a constant with a number of digits.
        longest: characters above which a part of an expression gets a name.
        worth: characters above which a part that is written several times gets a name.
    """

    functions: Mapping[str, str]
    division: str | None = None
    times: str = "*"
    power: str = "{}**{}"
    number: Callable[[float, int], str] = decimal
    longest: int = LONGEST_PART
    worth: int = WORTH_A_NAME


TEXT = Dialect({"sqrt": "sqrt(abs({}))", "min": "Min({}, {})", "max": "Max({}, {})", UPRIGHT: "{}"})
"""What people, Python and SymPy read alike."""


class Written(NamedTuple):
    """A node as text.

    Args:
        text: without outer brackets.
        binds: how tightly.
    """

    text: str
    binds: int

    def within(self, level: int, first: bool = False) -> str:
        """In brackets where it binds less tightly than a level, or has a sign that something other stands before."""
        return (
            f"({self.text})"
            if self.binds < level
            or (not first and self.text.startswith("-") and (level > PRODUCT or self.binds < PRODUCT))
            else self.text
        )


def free_prefix(symbols: Sequence[str]) -> str:
    """What the names of parts may begin with, so that none is a symbol: "t", with as many underscores as it takes.

    Args:
        symbols: names that are taken.
    """
    prefix = "t"
    while any(symbol.startswith(prefix) and symbol[len(prefix) :].isdigit() for symbol in symbols):
        prefix += "_"
    return prefix


class Writer:
    """Writes nodes; parts that are used several times, or are long, are written by name.

    Args:
        expressions: of which some are written.
        roots: those, as sums of terms.
        symbols: a name for each input.
        digits: significant digits of constants; 17 are exact.
        prefix: what the names of parts begin with.
        every: whether each part that is used twice gets a name, however short.
        dialect: of the language.
    """

    def __init__(
        self,
        expressions: Expressions,
        roots: Sequence[int],
        symbols: Sequence[str],
        digits: int,
        prefix: str,
        every: bool,
        dialect: Dialect = TEXT,
    ) -> None:
        self.expressions, self.symbols = expressions, symbols
        self.dialect = dialect
        self.number: Callable[[float], str] = lambda value: dialect.number(value, digits)
        """A constant as text."""
        self._texts: dict[int, Written] = {}
        self.names: dict[int, str] = {}
        """Of parts, in the order in which they must be defined."""
        named = self._chosen(roots, every)
        self.names = {number: f"{prefix}{i + 1}" for i, number in enumerate(sorted(named))}
        self._texts = {}
        # Without recursion on what is deep: operands come first.
        for number in expressions.needed(roots):
            self._texts[number] = self._composed(number)

    @property
    def protected(self) -> bool:
        """Whether a division by something other than a constant is written."""
        nodes = (self.expressions[number] for number in self._texts)
        divisors = (self.expressions[n.operands[1]] for n in nodes if n.operation == "/")
        return any(divisor.operation not in (CONSTANT, UPRIGHT) for divisor in divisors)

    def text(self, number: int) -> str:
        """A node as text, by its name if it has one, without outer brackets."""
        return self.names.get(number) or self._texts[number].text

    def terms(self, number: int, define: bool = False) -> list[Term]:
        """What a node is the sum of, from left to right.

        Args:
            number: the node.
            define: write what it stands for even if it has a name.

        Returns:
            The terms; the first one has a sign, too.
        """
        return [term for term, _ in self.summands(number, define)]

    def summands(self, number: int, define: bool = False) -> list[tuple[Term, int]]:
        """What a node is the sum of, as `terms`, each with its node."""
        found: list[tuple[Term, int]] = []
        while self._is_plain_sum(number) or (define and self._is_sum(number)):
            operation, operands, _ = self.expressions[number]
            number, second = self._in_order(operation, operands)
            sign, text = _signed(self._operand(second).within(PRODUCT))
            found.append(((sign if operation == "+" else _opposite(sign), text), second))
            define = False
        found.append((_signed(self._texts[number].text if define else self.text(number)), number))
        return found[::-1]

    def _chosen(self, roots: Sequence[int], every: bool) -> set[int]:
        """Parts that get a name; while they are chosen all are called alike."""
        counts = self.expressions.counts(roots)
        for number, count in counts.items():
            operation, operands, _ = self.expressions[number]
            self._texts[number] = self._composed(number)
            if operation in (INPUT, CONSTANT):
                continue
            if operation in ("+", "-"):
                # Where a sum stands at the left of another one, a line may be broken between its terms.
                parts = [self._in_order(operation, operands)[1]]
                long = len(self.text(parts[0])) > self.dialect.longest
            else:
                parts = sorted(set(operands), key=lambda operand: -len(self.text(operand)))
                long = len(self._texts[number].text) > self.dialect.longest
            for part in parts:
                if long and self.expressions[part].operation not in (INPUT, CONSTANT):
                    self.names[part] = "t00"
                    self._texts[number] = self._composed(number)
                    long = (
                        operation not in ("+", "-") and len(self._texts[number].text) > self.dialect.longest
                    )
            if count > 1 and (every or self._pays(number)):
                self.names[number] = "t00"
        return set(self.names)

    def _pays(self, number: int) -> bool:
        """Whether a part that is used twice gets a name, where short ones do not."""
        whole = self.expressions[number].operation not in ("*", "/", "+", "-", POWER)
        length = len(self._texts[number].text)
        # What is squared again and again would double its text with each time.
        return length > ENDLESS or (whole and length > self.dialect.worth)

    def _composed(self, number: int) -> Written:
        """A node as text of its operands."""
        operation, operands, value = self.expressions[number]
        if operation == INPUT:
            return Written(self.symbols[int(value)], ATOM)
        if operation == CONSTANT:
            return Written(self.number(value), ATOM)
        if operation == POWER:
            return Written(
                self.dialect.power.format(self._operand(operands[0]).within(ATOM), int(value)), HIGH
            )
        if operation in ("+", "-"):
            first, second = self._in_order(operation, operands)
            if operation == "-" and self.expressions.constant_value(first) == 0.0:
                text = self._operand(second).within(PRODUCT)
                return Written(f"-({text})" if text.startswith("-") else f"-{text}", SUM)
            sign, text = _signed(self._operand(second).within(PRODUCT))
            sign = sign if operation == "+" else _opposite(sign)
            return Written(f"{self._operand(first).within(SUM, first=True)} {sign} {text}", SUM)
        division = self.dialect.division
        if operation == "/" and division is not None and not self._is_plain_divisor(operands[1]):
            return Written(division.format(*(self.text(operand) for operand in operands)), ATOM)
        if operation not in ("*", "/"):
            inside = [self.text(operand) for operand in operands]
            known = self.dialect.functions.get(operation)
            return Written(
                f"{operation}({', '.join(inside)})" if known is None else known.format(*inside), ATOM
            )
        first, second = operands
        if operation == "*" and self.expressions.constant_value(second) is not None:
            first, second = second, first  # a product commutes to the bit
        # The right operand keeps its brackets even where algebra would not need them: rounding does.
        between = self.dialect.times if operation == "*" else operation
        return Written(
            f"{self._operand(first).within(PRODUCT, first=True)}{between}{self._operand(second).within(HIGH)}",
            PRODUCT,
        )

    def _is_plain_divisor(self, number: int) -> bool:
        """Whether a division by a node needs no protection: it is a constant that is large enough, or kept from 0."""
        value = self.expressions.constant_value(number)
        upright = self.expressions[number].operation == UPRIGHT
        return upright or (value is not None and abs(value) > SMALLEST_DIVISOR)

    def _in_order(self, operation: str, operands: tuple[int, ...]) -> tuple[int, int]:
        """Operands of a sum as they are written: it commutes to the bit, a - b + c for c + (a - b)."""
        first, second = operands
        if operation == "+" and self._is_plain_sum(second) and not self._is_plain_sum(first):
            return second, first
        return first, second

    def _is_plain_sum(self, number: int) -> bool:
        """Whether a node is written as a sum where it stands."""
        return number not in self.names and self._is_sum(number)

    def _is_sum(self, number: int) -> bool:
        """Whether a node is a sum, and not the negative of something."""
        operation, operands, _ = self.expressions[number]
        if operation not in ("+", "-"):
            return False
        return not (operation == "-" and self.expressions.constant_value(operands[0]) == 0.0)

    def _operand(self, number: int) -> Written:
        """An operand, by its name if it has one."""
        return Written(self.names[number], ATOM) if number in self.names else self._texts[number]


def _signed(text: str) -> Term:
    return ("-", text[1:]) if text.startswith("-") else ("+", text)


def _opposite(sign: str) -> str:
    return "+" if sign == "-" else "-"

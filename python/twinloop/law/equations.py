"""A law as text: a legend of the conventions, shared parts, one equation a state; each constant with its ±."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop.errors import InvalidInput
from twinloop.law.actuation import Actuator
from twinloop.law.expansion import Expansion, Polynomial, ordered, written
from twinloop.law.expressions import SMALLEST_DIVISOR, Expressions
from twinloop.law.forms import DERIVATIVES, EULER
from twinloop.law.law import Law
from twinloop.law.spread import Spread, spreads
from twinloop.law.writing import EXACT, TEXT, Term, Writer
from twinloop.signals import Signals

WIDTH = 100
"""Columns of a line."""
NOTE = 22
"""Columns of a note behind an equation; longer ones stand below it."""
LATER = "[k+1]"
"""Behind a state: a period later."""
LONG_NAME = 32
"""Columns of a left side above which lines that go on do not begin under its equals sign."""


@dataclass(frozen=True)
class _Piece:
    """Terms of an equation that share a constant, and what is noted behind them."""

    terms: list[Term]
    note: str = ""


def equations(law: Law, members: Sequence[Law] = (), digits: int = 6) -> str:
    """A law as text that SymPy reads, too.

    Sums are multiplied out and like terms collected, unless every bit is asked for. A line that goes on begins with the
    sign of its first term.

    Args:
        law: to be written.
        members: of the committee; behind each constant stands its standard deviation over those that have its term.
        digits: significant digits of constants; 17 give every bit back, as the program computes it and without ±.

    Returns:
        Lines of at most 100 columns, where the names of the signals allow it.

    Raises:
        InvalidInput: digits out of range.
    """
    if not 1 <= digits <= EXACT:
        raise InvalidInput(f"Equations, digits: expected 1 to 17, found {digits}; 17 are exact.")
    page = _Page(law, members, digits)
    return "\n".join([*page.legend(), "", *page.body()])


class _Page:
    """One law on its way to text."""

    def __init__(self, law: Law, members: Sequence[Law], digits: int) -> None:
        self.law, self.signals = law, law.signals
        self.exact = digits == EXACT
        self.members = () if self.exact else tuple(members)
        self.expressions = law.expressions if self.exact else Expressions()

        def expanded(each: Law) -> list[Polynomial]:
            expansion = Expansion(each.expressions, self.expressions)
            return [expansion.polynomial(output) for output in each.outputs]

        self.polynomials: list[Polynomial] = []
        if self.exact:
            self.outputs = list(law.outputs)
        else:
            for place in range(law.inputs):
                self.expressions.input(place)
            self.polynomials = expanded(law)
            self.outputs = [written(self.expressions, polynomial) for polynomial in self.polynomials]
        self.of_members = [expanded(member) for member in self.members]
        prefix = _unused("t", law.symbols)
        self.writer = Writer(self.expressions, self.outputs, law.symbols, digits, prefix, self.exact)

    # The legend

    def legend(self) -> list[str]:
        dt, signals = self.signals.dt, self.signals
        kinds = {
            "absolute": f"the state one period of {dt:g} s later",
            "increment": f"the state one period of {dt:g} s later, as the state and what is added to it",
            "acceleration": f"derivatives, integrated by {_steps(signals)} of {dt / signals.substeps:g} s",
            "explicit-euler": f"one Euler step a period of {dt:g} s, in which states go on by others as they were",
            "semi-implicit-euler": f"one Euler step a period of {dt:g} s, in which states go on by others as they"
            " have become",
        }
        units = ", ".join(f"{state.name} in {state.unit or 'units'}" for state in signals.states)
        lines = [f"Form {self.law.form!r}: {kinds[self.law.form]}; {units}."]
        body = signals.kinematics if self.law.form == "acceleration" else None
        if body is not None:
            lines.append(f"{', '.join(body.angles)} go on as a quaternion, so that no pitch is singular")
        lines += [
            f"{state.name} wraps: the equations see it from {-0.5 * state.period:g} to {0.5 * state.period:g}"
            f" {state.unit}".rstrip()
            for state in signals.states
            if state.period is not None
        ]
        lines += [
            f"{symbol} = {command.name} / {self.writer.number(command.size)}, {command.name} in"
            f" {command.unit or '1'}"
            for symbol, command in zip(self.law.command_symbols, signals.commands, strict=True)
            if symbol != command.name
        ]
        if self.writer.protected:
            lines.append(f"a/b is protected: a / b where |b| > {SMALLEST_DIVISOR:g}, otherwise a")
        if self.members:
            lines.append(
                f"±: standard deviation of a constant over the {len(self.members)} models of the committee, or"
                " over as many of them as have the term, where a number of them is given"
            )
        lines += self._actuators() + self._offsets()
        return [part for line in lines for part in _comment(line)]

    def _actuators(self) -> list[str]:
        """What stands between commands and their effect, one line for those that are alike."""
        alike: dict[Actuator, list[int]] = {}
        for place, actuator in enumerate(self.law.actuation.actuators):
            if not actuator.direct:
                alike.setdefault(actuator, []).append(place)
        lines = []
        for (lag, delay, rest), places in alike.items():
            lags = [member.actuation.actuators[places[0]].lag for member in self.members]
            parts = [f"a lag of {self.writer.number(lag)}{self._deviation(lags)} s"] if lag > 0.0 else []
            parts += [f"a delay of {delay} period{'s' if delay > 1 else ''}"] if delay else []
            start = "the first command" if rest is None else self.writer.number(rest)
            names = ", ".join(self.signals.command_names[place] for place in places)
            lines.append(f"{names}: act with {' and '.join(parts)}, from {start} at the start")
        return lines

    def _deviation(self, values: Sequence[float]) -> str:
        return f" ± {np.std(values, ddof=1):.2g}" if len(values) > 1 else ""

    def _offsets(self) -> list[str]:
        return [
            f"{name} is read {abs(offset):.3g} s {'later' if offset > 0.0 else 'earlier'} than the states that"
            " outputs drive"
            for name, offset in zip(self.signals.state_names, self.law.offsets, strict=True)
            if offset != 0.0
        ]

    # The equations

    def body(self) -> list[str]:
        """Parts that have a name, then an equation for each state, then one for each hidden state."""
        law, names = self.law, self.signals.state_names
        lines = [
            line
            for node, name in self.writer.names.items()
            for line in _equation(name, [_Piece(self.writer.terms(node, define=True))])
        ]
        pieces = [self._pieces(output) for output in range(len(self.outputs))]
        if law.form in DERIVATIVES:
            driven = self.signals.driven
            for place, name in enumerate(names):
                own = pieces[driven.index(place)] if place in driven else [_Piece(self._given(place))]
                if law.form in EULER:
                    own = self._stepped(name, own)
                lines += _equation(f"{name}{LATER}" if law.form in EULER else f"d {name} / dt", own)
        else:
            for name, own in zip(names, pieces, strict=True):
                if law.form == "increment":
                    # What is added is summed first, which rounding may show.
                    itself = ("+", name)
                    own = [_Piece([*own[0].terms, itself])] if self.exact else [_Piece([itself]), *own]
                lines += _equation(f"{name}{LATER}", own)
        for number, name in enumerate(law.hidden_symbols):
            lines += self._filling(name, number)
        return lines

    def _given(self, place: int) -> list[Term]:
        """The derivative of a state that others give."""
        roots, symbols = self.law.derivatives(), given_symbols(self.law, place, LATER)
        return Writer(self.law.expressions, roots, symbols, EXACT, "", False).terms(roots[place])

    def _stepped(self, name: str, own: Sequence[_Piece]) -> list[_Piece]:
        """A step of Euler: the state, and a period times its derivative."""
        dt = "" if self.signals.dt == 1.0 else f"{self.writer.number(self.signals.dt)}*"
        terms = [list(piece.terms) for piece in own]
        (sign, first), (_, last) = terms[0][0], terms[-1][-1]
        if sum(map(len, terms)) == 1 and sign == "+" and first.removesuffix(LATER).isidentifier():
            terms[0][0] = "+", f"{dt}{first}"
        else:
            terms[-1][-1] = terms[-1][-1][0], f"{last})"
            terms[0][0] = "+", f"{dt}({'' if sign == '+' else '-'}{terms[0][0][1]}"
        scaled = (_Piece(each, piece.note) for each, piece in zip(terms, own, strict=True))
        return [_Piece([("+", name)]), *scaled]

    def _pieces(self, output: int) -> list[_Piece]:
        """An output, in pieces that share a constant where a committee stands behind it."""
        if not self.members or not self.polynomials[output]:
            return [_Piece(self.writer.terms(self.outputs[output]))]
        found = spreads(
            self.expressions,
            self.polynomials[output],
            [polynomials[output] for polynomials in self.of_members],
        )
        pieces: dict[tuple[str, str], list[Term]] = {}
        terms = self.writer.terms(self.outputs[output])
        for (monomial, coefficient), term in zip(ordered(self.polynomials[output]), terms, strict=True):
            key = self.writer.number(abs(coefficient)), _note(found[monomial])
            pieces.setdefault(key, []).append(term)
        return [_Piece(terms, note) for (_, note), terms in pieces.items()]

    def _filling(self, name: str, number: int) -> list[str]:
        """The equation of a hidden state that commands fill."""
        hidden = self.law.actuation.hidden[number]
        symbols = [self.law.command_symbols[place] + "**2" * hidden.squared for place in hidden.commands]
        share = len(symbols)
        given = [("+", symbol if share == 1 else f"{symbol}/{share}") for symbol in symbols]
        start = "from 0 at the start"
        if hidden.rest is None:
            rest = f"{name}_rest"
            start += f"; {rest}: the terms before it in the first period"
        else:
            rest = self.writer.number(hidden.rest)
        times = [member.actuation.hidden[number].time for member in self.members if self._alike(member)]
        deviation = self._deviation(times)
        note = f"{start}; its time {self.writer.number(hidden.time)}{deviation} s" if deviation else start
        terms = [*given, ("-", rest), ("-", f"{name}/{self.writer.number(hidden.time)}")]
        return [*_equation(f"d {name} / dt", [_Piece(terms)]), *_comment(note)]

    def _alike(self, member: Law) -> bool:
        """Whether a member has hidden states like those of the law."""
        return len(member.actuation.hidden) == len(self.law.actuation.hidden)


def _note(spread: Spread) -> str:
    """± of the constants of a term, and how many members have it if not all do."""
    having = "" if spread.having == spread.members else f" ({spread.having} of {spread.members})"
    if spread.sds is None:
        return having.strip()
    coefficient, *inside = (f"± {sd:.2g}" for sd in spread.sds)
    return coefficient + (f", inside {', '.join(inside)}" if inside else "") + having


def _equation(left: str, pieces: Sequence[_Piece]) -> list[str]:
    """Lines of one equation; where there are notes each piece begins a line, and its note stands behind its last."""
    noted = any(piece.note for piece in pieces)
    if not noted:
        pieces = [_Piece([term for piece in pieces for term in piece.terms])]
    room = WIDTH - (NOTE + len("  # ") if noted else 0)
    indent = " " * (len(left) if len(left) < LONG_NAME else len("   "))
    rows, notes, row = [], {}, f"{left} ="
    for number, piece in enumerate(pieces):
        for place, (sign, text) in enumerate(piece.terms):
            first = number == place == 0
            part = (text if sign == "+" else f"-{text}") if first else f"{sign} {text}"
            if not first and row.strip() and len(row) + 1 + len(part) > room:
                rows.append(row)
                row = indent
            row = f"{row} {part}"
        notes[len(rows)] = piece.note
        rows.append(row)
        row = indent
    column = 2 + max(len(rows[place]) for place in notes)
    lines = []
    for place, row in enumerate(rows):
        note = notes.get(place)
        if note and len(note) <= NOTE:
            lines.append(f"{row:<{column}}# {note}")
        else:
            lines += (
                [row, *(f"{indent} {line}" for line in _comment(note, len(indent) + 1))] if note else [row]
            )
    return lines


def given_symbols(law: Law, place: int, later: str) -> list[str]:
    """Symbols for the derivative of a state that others give, where they may stand for these a period later.

    Args:
        law: whose symbols they are.
        place: of the state.
        later: what is written behind such a state.
    """
    symbols, signals = list(law.symbols), law.signals
    body, name = signals.kinematics, signals.state_names[place]
    turned = body is not None and name in body.angles
    for i, state in enumerate(signals.states if law.form == "semi-implicit-euler" else ()):
        if not turned or (body is not None and state.name in body.rates):
            symbols[i] += later
    return symbols


def _comment(text: str, indent: int = 0) -> list[str]:
    return textwrap.wrap(text, WIDTH - indent, initial_indent="# ", subsequent_indent="#   ")


def _unused(prefix: str, taken: Sequence[str]) -> str:
    """A prefix with which no name is made that is taken."""
    while any(name.startswith(prefix) and name[len(prefix) :].isdigit() for name in taken):
        prefix += "_"
    return prefix


def readable(expressions: Expressions, number: int, symbols: Sequence[str], digits: int = 4) -> str:
    """One expression on one line, multiplied out.

    Args:
        expressions: where it is.
        number: its node.
        symbols: a name for each input, by its place.
        digits: significant digits of constants.
    """
    target = Expressions()
    for place in range(len(symbols)):
        target.input(place)
    root = written(target, Expansion(expressions, target).polynomial(number))
    endless = replace(TEXT, longest=sys.maxsize, worth=sys.maxsize)
    return Writer(target, [root], symbols, digits, "t", False, endless).text(root)


def _steps(signals: Signals) -> str:
    """How often a law is integrated in a period, in words."""
    return (
        "one Runge-Kutta step"
        if signals.substeps == 1
        else f"{signals.substeps} Runge-Kutta steps a period, each"
    )

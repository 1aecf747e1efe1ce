"""A law as text: a legend of the conventions, shared parts, one equation a state; each constant with its ±."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twinloop._ground.texts import in_unit, two_digits
from twinloop.errors import InvalidInput
from twinloop.law.actuation import Actuator, in_periods, partners
from twinloop.law.expansion import Expansion, Monomial, Polynomial, written
from twinloop.law.expressions import SMALLEST_DIVISOR, Expressions
from twinloop.law.flown import Span
from twinloop.law.forms import DERIVATIVES
from twinloop.law.law import Law, twist_name
from twinloop.law.levels import in_words as levels_in_words
from twinloop.law.play import FIRM
from twinloop.law.reports import in_words as reports_in_words
from twinloop.law.spread import Spread, spreads, varying_in
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
DIGITS = 4
"""Significant digits of the constants of one expression on one line."""


@dataclass(frozen=True)
class _Piece:
    """Terms of an equation that share a constant, and what is noted behind them."""

    terms: list[Term]
    note: str = ""


class Equations:
    """A law as text that SymPy reads, too, with symbols for the names as its `locals`: `str(Equations(law))`.

    Sums are multiplied out and like terms collected, unless every bit is asked for. A line that goes on begins with the
    sign of its first term, or stands below the equals sign that ends a line. Lines have at most 100 columns, where the
    names of the signals allow it.

    Args:
        law: to be written.
        members: of the committee; behind each constant stands its standard deviation over those that have its term, if
            they differ at all.
        digits: significant digits of constants; 17 give every bit back, as the program computes it and without ±.
        flown: how far the flights went that it was learnt from.

    Raises:
        InvalidInput: digits out of range.
    """

    def __init__(
        self, law: Law, members: Sequence[Law] = (), digits: int = 6, flown: Sequence[Span] = ()
    ) -> None:
        if not 1 <= digits <= EXACT:
            raise InvalidInput(f"Equations, digits: expected 1 to 17, found {digits}; 17 are exact.")
        self.law, self.signals, self.flown = law, law.signals, flown
        self.exact = digits == EXACT
        # Copies of one law know nothing of how far its constants are off: "± 0" would promise that they are exact.
        self.members = () if self.exact or _all_alike(members) else tuple(members)
        self.expressions = law.expressions if self.exact else Expressions()

        def expanded(each: Law) -> list[Polynomial]:
            expansion = Expansion(each.expressions, self.expressions)
            return [expansion[output] for output in each.outputs]

        self.polynomials: list[Polynomial] = []
        if self.exact:
            self.outputs = list(law.outputs)
        else:
            for place in range(law.inputs):
                self.expressions.input(place)
            self.polynomials = expanded(law)
            self.outputs = [written(self.expressions, polynomial) for polynomial in self.polynomials]
        of_members = [expanded(member) for member in self.members]
        self.spreads: list[dict[Monomial, Spread]] = [
            spreads(self.expressions, polynomial, [polynomials[output] for polynomials in of_members])
            for output, polynomial in enumerate(self.polynomials if self.members else ())
        ]
        prefix = _unused(law.symbols)
        self.writer = Writer(self.expressions, self.outputs, law.symbols, digits, prefix, self.exact)

    # The legend

    def _legend(self) -> list[str]:
        dt, signals = self.signals.dt, self.signals
        kinds = {
            "absolute": f"the state one period of {dt:g} s later",
            "increment": f"the state one period of {dt:g} s later, as the state and what is added to it",
            "acceleration": f"derivatives, integrated by {_steps(signals)} of {dt / signals.substeps:g} s",
            "explicit-euler": self._step(),
            "semi-implicit-euler": f"{self._step()}{self._become()}",
        }
        units = ", ".join(f"{state.name} in {state.unit or 'units'}" for state in signals.states)
        lines = [f"Form {self.law.form!r}: {kinds[self.law.form]}; {units}."]
        body = signals.kinematics if self.law.form == "acceleration" else None
        if body is not None:
            lines.append(
                f"{', '.join(body.angles)} are integrated as a quaternion, so that no pitch is singular"
            )
        lines += [
            f"{state.name} wraps: the equations see it from"
            f" {in_unit(f'{-0.5 * state.period:g} to {0.5 * state.period:g}', state.unit)}"
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
        lines += self._actuators() + self._as_sent() + self._offsets()
        lines += levels_in_words(self.law.levels, self.signals) + reports_in_words(
            self.law.reports, self.signals
        )
        if self.flown:
            lines.append(f"flown: {', '.join(map(str, self.flown))}; beyond, the law is extrapolated")
        return [part for line in lines for part in _comment(line)]

    def _step(self) -> str:
        """A step of Euler, for any state x."""
        dt = self.writer.number(self.signals.dt)
        return f"derivatives, in one Euler step a period: x{LATER} = x + {dt} * d x / dt, of the states as they are"

    def _become(self) -> str:
        """Which derivatives a semi-implicit step takes last, and of which states."""
        body, states = self.signals.kinematics, self.signals.states
        moved = [state.derivative_of for state in states if state.derivative_of is not None]
        by = [state.name for state in states if state.derivative_of is not None]
        if body is not None:
            moved, by = [*moved, *body.angles], [*by, *body.rates]
        if not moved:
            return ""
        become = "it has become" if len(by) == 1 else "they have become"
        return f", but {', '.join(f'd {name} / dt' for name in moved)} of {', '.join(by)} as {become}"

    def _actuators(self) -> list[str]:
        """What stands between commands and their effect, one line for those that are alike."""
        alike: dict[Actuator, list[int]] = {}
        for place, actuator in enumerate(self.law.actuation.actuators):
            if not actuator.direct:
                alike.setdefault(actuator, []).append(place)
        lines = []
        for (lag, delay, rest, ramp), places in alike.items():
            of_members = [member.actuation.actuators[places[0]] for member in self.members]
            lags = self._deviation([each.lag for each in of_members])
            parts = [f"a lag of {self.writer.number(lag)}{lags} s"] if lag > 0.0 else []
            parts += [f"a delay of {in_periods(delay)}"] if delay else []
            if ramp > 0.0:
                command = self.signals.commands[places[0]]
                rates = self._deviation([each.rate(command.size) for each in of_members])
                unit = f"{command.unit or '1'}/s"
                parts.append(f"a rate of at most {self.writer.number(command.size / ramp)}{rates} {unit}")
            start = "the first command" if rest is None else self.writer.number(rest)
            names = ", ".join(self.signals.command_names[place] for place in places)
            lines.append(f"{names}: act with {' and '.join(parts)}, from {start} at the start")
        return lines

    def _as_sent(self) -> list[str]:
        """Hidden states that know commands before what the lines above say of how these act."""
        lines = []
        for symbol, hidden in zip(self.law.hidden_symbols, self.law.actuation.hidden, strict=True):
            late = [place for place in hidden.commands if not self.law.actuation.actuators[place].direct]
            if late and not hidden.integrated:
                names = ", ".join(self.signals.command_names[place] for place in late)
                lines.append(
                    f"{symbol}: knows {names} as sent, not as {'they act' if len(late) > 1 else 'it acts'}"
                )
        return lines

    def _deviation(self, values: Sequence[float]) -> str:
        return f" ± {two_digits(float(np.std(values, ddof=1)))}" if len(values) > 1 else ""

    def _offsets(self) -> list[str]:
        lines = []
        for place, (name, offset) in enumerate(zip(self.signals.state_names, self.law.offsets, strict=True)):
            if offset != 0.0:
                deviation = self._deviation([member.offsets[place] for member in self.members])
                when = "later" if offset > 0.0 else "earlier"
                lines.append(f"{name} is read {abs(offset):.3g}{deviation} s {when} than the driven states")
        return lines

    # The equations

    def __str__(self) -> str:
        """The legend, parts that have a name, then an equation for each state, then one for each hidden state."""

        def pieces_of(output: int) -> list[_Piece]:
            """An output, in pieces that share a constant where a committee stands behind it."""
            terms = [term for term, _ in self.writer.summands(self.outputs[output])]
            if not self.members or not self.polynomials[output]:
                return [_Piece(terms)]
            found, alike = self.spreads[output], dict[tuple[str, str], list[Term]]()
            for (monomial, coefficient), term in zip(self.polynomials[output].items(), terms, strict=True):
                key = self.writer.number(abs(coefficient)), _note(found[monomial], self.writer.names)
                alike.setdefault(key, []).append(term)
            return [_Piece(terms, note) for (_, note), terms in alike.items()]

        law, names = self.law, self.signals.state_names
        lines = [*self._legend(), "", *_named(self.writer, self._note_inside)]
        pieces = [pieces_of(output) for output in range(len(self.outputs))]
        if law.form in DERIVATIVES:
            driven, slopes = self.signals.driven, dict(enumerate(law.derivatives()))
            given = [node for place, node in slopes.items() if place not in driven]
            prefix = _unused([*law.symbols, *self.writer.names.values()])
            kinematics = Writer(law.expressions, given, law.symbols, EXACT, prefix, False)
            lines += _named(kinematics)
            for place, name in enumerate(names):
                known = place not in driven
                own = [_Piece(kinematics.terms(slopes[place]))] if known else pieces[driven.index(place)]
                lines += _equation(f"d {name} / dt", own)
        else:
            for name, own in zip(names, pieces, strict=True):
                if law.form == "increment":
                    # What is added is summed first, which rounding may show.
                    itself = ("+", name)
                    own = [_Piece([*own[0].terms, itself])] if self.exact else [_Piece([itself]), *own]
                lines += _equation(f"{name}{LATER}", own)
        for number, name in enumerate(law.hidden_symbols):
            lines += self._filling(name, number)
        return "\n".join(lines)

    def _note_inside(self, node: int) -> str:
        """± of the constants of a part of an equation."""
        every = (spread for of_output in self.spreads for spread in of_output.values())
        return ", ".join(f"± {two_digits(sd)}" for sd in varying_in(every, node, self.writer.names))

    def _filling(self, name: str, number: int) -> list[str]:
        """The equation of a hidden state that commands or states drive."""
        hidden = self.law.actuation.hidden[number]
        symbols = [self.law.command_symbols[place] for place in hidden.commands]
        for state in (self.signals.states[place] for place in hidden.states):
            symbols.append(
                state.name if state.scale == 1.0 else f"({state.name}/{self.writer.number(state.scale)})"
            )
        symbols = [symbol + "**2" * hidden.squared for symbol in symbols]
        share = len(symbols)
        given = [("+", symbol if share == 1 else f"{symbol}/{share}") for symbol in symbols]
        start = "from 0 at the start"
        if hidden.settled:
            start = "as it settles under what fills it at the start"
        if hidden.rest is None:
            rest = f"{name}_rest"
            start += f"; {rest}: the terms before it in the first period"
        else:
            rest = self.writer.number(hidden.rest)
        times = [member.actuation.hidden[number].time for member in self.members if self._alike(member)]
        deviation = self._deviation(times)
        note = f"{start}; its time {self.writer.number(hidden.time)}{deviation} s" if deviation else start
        emptied = [] if hidden.rest == 0.0 else [("-", rest)]
        if hidden.gap:
            return self._behind_a_gap(number, [*given, *emptied], deviation)
        terms = [*given, *emptied, ("-", f"{name}/{self.writer.number(hidden.time)}")]
        partner = partners(self.law.actuation.hidden)[number]
        if partner != number:
            other = self.law.hidden_symbols[partner]
            terms.append(("-" if partner > number else "+", f"{other}/{self.writer.number(hidden.turns)}"))
        return [*_equation(f"d {name} / dt", [_Piece(terms)]), *_comment(note)]

    def _behind_a_gap(self, number: int, driven: list[tuple[str, str]], deviation: str) -> list[str]:
        """The equations of a mass behind a gap: what presses on it, or its rate."""
        hidden, write = self.law.actuation.hidden[number], self.writer.number
        partner = partners(self.law.actuation.hidden)[number]
        name, other = (self.law.hidden_symbols[place] for place in (number, partner))
        if partner < number:
            square = write(hidden.turns * hidden.turns)
            terms = [("+", f"{other}/{square}"), ("-", f"{name}/{write(hidden.time)}")]
            note = f"moves along at the start{deviation and f'; its time {write(hidden.time)}{deviation} s'}"
            return [*_equation(f"d {name} / dt", [_Piece(terms)]), *_comment(note)]
        twist, sides = twist_name(name), []
        damped = f"{write(hidden.damping)}*d {twist} / dt"
        for sign, nearer, least in (("-", "min", "max"), ("+", "max", "min")):
            deep = f"{twist} {sign} {write(hidden.gap)}"
            sides.append(("+", f"{least}(0, {nearer}({write(FIRM)}*({deep}), {deep} + {damped}))"))
        rate = self.law.signals.states[hidden.states[0]]
        parents = (state for state in self.law.signals.states if state.name == rate.derivative_of)
        turned = "".join(f" (±{write(hidden.gap * rate.scale)} {of.unit} of {of.name})" for of in parents)
        note = (
            f"from 0 at the start; {name} is what presses beyond a gap, half of which is"
            f" {write(hidden.gap)}{turned}"
        )
        return [
            *_equation(name, [_Piece(sides)]),
            *_equation(f"d {twist} / dt", [_Piece([*driven, ("-", other)])]),
            *_comment(note),
        ]

    def _alike(self, member: Law) -> bool:
        """Whether a member has hidden states like those of the law."""
        return len(member.actuation.hidden) == len(self.law.actuation.hidden)


def _note(spread: Spread, named: Collection[int]) -> str:
    """± of the constants of a term, and how many members have it if not all do."""
    having = "" if spread.having == spread.members else f" ({spread.having} of {spread.members})"
    if spread.sd is None:
        return having.strip()
    inside = ", ".join(f"± {two_digits(sd)}" for sd in spread.varying(named))
    return f"± {two_digits(spread.sd)}" + (f", inside {inside}" if inside else "") + having


def _named(writer: Writer, note: Callable[[int], str] = lambda node: "") -> list[str]:
    """An equation for each part that has a name."""
    return [
        line
        for node, name in writer.names.items()
        for line in _equation(
            name, [_Piece([term], note(part)) for term, part in writer.summands(node, define=True)]
        )
    ]


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
            # Behind an equals sign nothing is gained where the next line begins as far to the right.
            breaks = len(left) >= LONG_NAME if first else row.strip()
            if breaks and len(row) + 1 + len(part) > room:
                rows.append(row)
                row = indent
            row = f"{row} {part}"
        notes[len(rows)] = piece.note
        rows.append(row)
        row = indent
    column = 2 + max(min(len(rows[place]), room) for place in notes)
    lines = []
    for place, row in enumerate(rows):
        note = notes.get(place)
        if note and len(note) <= NOTE and len(row) < column:
            lines.append(f"{row:<{column}}# {note}")
        else:
            lines += (
                [row, *(f"{indent} {line}" for line in _comment(note, len(indent) + 1))] if note else [row]
            )
    return lines


def _comment(text: str, indent: int = 0) -> list[str]:
    return textwrap.wrap(text, WIDTH - indent, initial_indent="# ", subsequent_indent="#   ")


def _unused(taken: Sequence[str]) -> str:
    """A prefix with which no name is made that is taken."""
    prefix = "t"
    while any(name.startswith(prefix) and name[len(prefix) :].isdigit() for name in taken):
        prefix += "_"
    return prefix


def readable(expressions: Expressions, number: int, symbols: Sequence[str]) -> str:
    """One expression on one line, multiplied out.

    Args:
        expressions: where it is.
        number: its node.
        symbols: a name for each input, by its place.
    """
    target = Expressions()
    for place in range(len(symbols)):
        target.input(place)
    root = written(target, Expansion(expressions, target)[number])
    endless = replace(TEXT, longest=sys.maxsize, worth=sys.maxsize)
    return Writer(target, [root], symbols, DIGITS, "t", False, endless).text(root)


def _all_alike(members: Sequence[Law]) -> bool:
    """Whether there are several members, and all of them are the same law."""
    laws = [(each.expressions.nodes, each.outputs, each.actuation, each.offsets) for each in members]
    return len(laws) > 1 and all(law == laws[0] for law in laws)


def _steps(signals: Signals) -> str:
    """How often a law is integrated in a period, in words."""
    return (
        "one Runge-Kutta step"
        if signals.substeps == 1
        else f"{signals.substeps} Runge-Kutta steps a period, each"
    )

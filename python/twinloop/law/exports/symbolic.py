"""A law for algebra and for papers: a script that makes SymPy expressions, and LaTeX."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import replace

from twinloop._core import __version__
from twinloop._ground.texts import one_line
from twinloop.law.equations import Equations
from twinloop.law.expansion import Expansion, written
from twinloop.law.exports.python_source import equation_roots, joined
from twinloop.law.expressions import Expressions
from twinloop.law.forms import DERIVATIVES, EULER
from twinloop.law.law import Law
from twinloop.law.writing import EXACT, Dialect, Term, Writer, free_prefix

SYMPY = Dialect({
    "abs": "sp.Abs({})", "sqrt": "sp.sqrt(sp.Abs({}))", "min": "sp.Min({}, {})", "max": "sp.Max({}, {})",
    **{function: f"sp.{function}({{}})" for function in ("sin", "cos", "tanh", "exp")}, "upright": "{}",
})  # fmt: skip


TAKEN = ("sp", "STATES", "COMMANDS", "HIDDEN", "EQUATIONS", "READ", "t")
"""Names of the script's own."""


def sympy_source(law: Law) -> str:
    """A law as a script that makes SymPy expressions, every constant with all its digits.

    Args:
        law: of a twin.

    Returns:
        Python that leaves `STATES`, `COMMANDS` (in units of their scales), `HIDDEN` and `EQUATIONS`, a matrix with the
        derivative of each state (with a form of Euler they make one step a period), or with what the form of the twin
        says; where sensors are late or early also `READ`, by state what its sensor gives at the time `t`. Divisions are
        plain ones.
    """
    roots = equation_roots(law)
    symbols = [f"{symbol}_" if symbol in TAKEN else symbol for symbol in law.symbols]
    writer = Writer(law.expressions, roots, symbols, EXACT, free_prefix(symbols), True, SYMPY)
    n_x, n_u = law.signals.n_x, law.signals.n_u
    groups = dict(
        zip(TAKEN[1:4], (symbols[:n_x], symbols[n_x : n_x + n_u], symbols[n_x + n_u :]), strict=True)
    )
    kinds = {**dict.fromkeys(DERIVATIVES, "derivatives of the states"), "absolute": "the next states"}
    lines = [
        f'"""The equations of a twin, learnt by Twinloop {__version__}: {kinds.get(law.form, "what is added")}."""',
        "",
        *(f"# {note}" for note in _notes(law, EXACT)),
        "",
        "import sympy as sp",
        "",
    ]
    for group, names in groups.items():
        if names:
            lines.append(f'{group} = {", ".join(names)}, = sp.symbols("{" ".join(names)},", real=True)')
    between = "\n    "
    lines += [
        f"{name} = ({joined(writer.terms(number, define=True), between)})"
        for number, name in writer.names.items()
    ]
    lines += [
        "EQUATIONS = sp.Matrix([",
        *(f"    {joined(writer.terms(root), between)}," for root in roots),
        "])",
    ]
    late = _late(law)
    if late:
        lines.append('t = sp.Symbol("t", real=True)')
        read = (f"{symbols[i]}: sp.Function({symbols[i]!r}, real=True)(t - {offset!r})" for i, offset in late)
        lines.append(f"READ = {{{', '.join(read)}}}")
    return "\n".join(lines) + "\n"


def _late(law: Law) -> list[tuple[int, float]]:
    """States that are read later or earlier than those that the law drives, and by how much, s."""
    return [(i, offset) for i, offset in enumerate(law.offsets) if offset != 0.0]


def _given_symbols(law: Law, place: int) -> list[str]:
    """Names of the signals in the derivative of a state that others give, now or a period later."""
    symbols, signals = [latex_name(symbol) for symbol in law.symbols], law.signals
    body, name = signals.kinematics, signals.state_names[place]
    turned = body is not None and name in body.angles
    for i, state in enumerate(signals.states if law.form == "semi-implicit-euler" else ()):
        if not turned or (body is not None and state.name in body.rates):
            symbols[i] += "_{k+1}"
    return symbols


def _latex_number(value: float, digits: int) -> str:
    text = f"{value:.{digits}g}"
    mantissa, exponent = text.split("e") if "e" in text else (text, "")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


LATEX = Dialect(
    {
        "abs": r"\left|{}\right|",
        "sqrt": r"\sqrt{{\left|{}\right|}}",
        "min": r"\min\left({}, {}\right)",
        "max": r"\max\left({}, {}\right)",
        "exp": r"\exp\left({}\right)",
        **{function: rf"\{function}\left({{}}\right)" for function in ("sin", "cos", "tanh")},
        "upright": "{}",
    },
    division=r"\frac{{{0}}}{{{1}}}",
    times=r" \, ",
    power="{}^{{{}}}",
    number=_latex_number,
    longest=400,
)

WIDE = 64
"""Characters, as a reader sees them, that the right side of an equation may be long on one line of a page."""
ON_ANOTHER_LINE = " \\\\\n  &\\quad "

DIGITS = 6
"""Significant digits of constants in LaTeX."""
IN_FULL = replace(LATEX, longest=sys.maxsize, worth=sys.maxsize)
"""No part of an equation has a name."""


def latex_source(law: Law) -> str:
    """A law as LaTeX, multiplied out.

    Args:
        law: of a twin.

    Returns:
        An `align*` environment of amsmath with an equation a state, and one for each that is read late or early.
    """
    target = Expressions()
    for place in range(law.inputs):
        target.input(place)
    expansion = Expansion(law.expressions, target)
    roots = [written(target, expansion[root]) for root in law.outputs]
    writer = Writer(target, roots, [latex_name(symbol) for symbol in law.symbols], DIGITS, "t_", False, LATEX)
    lines = [
        rf"  {name} &= {_in_lines(writer.terms(number, define=True))}"
        for number, name in writer.names.items()
    ]
    outputs = dict(zip(law.outputs, roots, strict=True))
    every = equation_roots(law)
    for place, (name, root) in enumerate(zip(law.signals.state_names, every, strict=True)):
        symbol = latex_name(name)
        if law.form not in DERIVATIVES or place in law.signals.driven:
            terms = writer.terms(outputs[root])
        else:
            terms = Writer(
                law.expressions, every, _given_symbols(law, place), DIGITS, "t_", False, IN_FULL
            ).terms(root)
        right = _in_lines(terms)
        if law.form == "acceleration":
            left = rf"\frac{{\mathrm{{d}} {symbol}}}{{\mathrm{{d}} t}}"
        else:
            left = rf"{symbol}_{{k+1}}"
            if law.form == "increment":
                right = f"{symbol} - {right[1:]}" if right.startswith("-") else f"{symbol} + {right}"
            elif law.form in EULER:
                # What grows with its content ends on its line.
                left_bracket, right_bracket = (
                    (r"\Bigl(", r"\Bigr)") if ON_ANOTHER_LINE in right else (r"\left(", r"\right)")
                )
                step = _latex_number(law.signals.dt, DIGITS)
                right = f"{symbol} + {step} {left_bracket}{right}{right_bracket}"
        lines.append(rf"  {left} &= {right}")
    lines = [re.sub(r"\bt_([0-9]+)", r"t_{\1}", line) for line in lines]
    for place, offset in _late(law):
        symbol, shift = latex_name(law.signals.state_names[place]), _latex_number(abs(offset), DIGITS)
        sign = "-" if offset > 0.0 else "+"
        lines.append(rf"  {symbol}_{{\mathrm{{read}}}}(t) &= {symbol}(t {sign} {shift}\,\mathrm{{s}})")
    notes = "".join(f"% {note}\n" for note in _notes(law, DIGITS))
    return notes + "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}\n"


def _in_lines(terms: Sequence[Term]) -> str:
    """A sum, broken over lines between its terms where it is wider than a page."""
    first, *rest = terms
    text = ("-" if first[0] == "-" else "") + first[1]
    width = _seen(text)
    for sign, term in rest:
        size = _seen(term) + 3
        if width + size > WIDE:
            text += ON_ANOTHER_LINE
            width = 0
        else:
            text += " "
        text += f"{sign} {term}"
        width += size
    return text


def _seen(text: str) -> int:
    """How many characters wide a reader sees a formula, about: of a fraction the wider part."""
    fraction = re.compile(r"\\frac{((?:[^{}]|{[^{}]*})*)}{((?:[^{}]|{[^{}]*})*)}")
    while found := fraction.search(text):
        wider = max(found.groups(), key=_seen)
        text = text[: found.start()] + wider + text[found.end() :]
    text = re.sub(r"\\(?:mathit|mathrm|left|right|sqrt|quad|,|(?=_))", "", text)
    return len(re.sub(r"[{}^\\ ]", "", text.replace(r"\cdot", "·")))


def _notes(law: Law, digits: int) -> list[str]:
    """What belongs to the equations: conventions, actuators, hidden states."""
    lines = str(Equations(law, digits=digits)).splitlines()
    begins = tuple(f"d {name} / dt =" for name in law.held_symbols) + tuple(
        f"{name} =" for name in law.hidden_symbols
    )
    filled, goes_on = [], False
    for line in lines:
        goes_on = line.startswith(begins) or (goes_on and line.startswith(" "))
        filled += [line] if goes_on else []
    return [one_line(note) for note in [line[2:] for line in lines if line.startswith("# ")] + filled]


def latex_name(name: str) -> str:
    """A name of a signal as LaTeX writes it.

    Args:
        name: of a state or a command.
    """
    return rf"\mathit{{{name.replace('_', chr(92) + '_')}}}"

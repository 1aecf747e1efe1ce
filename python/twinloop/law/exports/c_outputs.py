"""The equations of a law in C: what they give, out of states and commands in effect."""

from __future__ import annotations

from twinloop.law.exports.c_words import number
from twinloop.law.exports.python_source import free_symbols, joined, stepped_roots
from twinloop.law.law import Law
from twinloop.law.writing import EXACT, Dialect, Writer, decimal, free_prefix

KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while _Bool _Complex
    _Imaginary sin cos tan exp log pow sqrt fabs tanh real x u out SEEN y0 y1 j0 j1 yn jn gamma signgam main NULL NAN
    INFINITY
    """.split()  # noqa: SIM905
)
"""Names that a variable in C may not have, or should not."""


def functions_c(name: str, precision: str) -> dict[str, str]:
    """Functions that the equations may call, by name."""
    f = "f" if precision == "float" else ""

    def written(key: str, arguments: str, body: str) -> str:
        return f"static real {name}_{key}({arguments})\n{{\n    return {body};\n}}\n"

    return {
        "divided": written(
            "divided", "real a, real b", f"fabs{f}(b) > {number(1e-6, precision)} ? a / b : a"
        ),
        "wrapped": written("wrapped", "real a, real period", f"a - rint{f}(a / period) * period"),
        "min": written("min", "real a, real b", "a < b ? a : b"),
        "max": written("max", "real a, real b", "a > b ? a : b"),
        "upright": written(
            "upright",
            "real a",
            f"fabs{f}(a) >= {number(1e-3, precision)} ? a : copysign{f}({number(1e-3, precision)}, a)",
        ),
    }


def outputs_c(law: Law, name: str, precision: str) -> str:
    """The function that evaluates the equations."""
    f = "f" if precision == "float" else ""
    dialect = Dialect(
        {
            "abs": f"fabs{f}({{}})",
            "sqrt": f"sqrt{f}(fabs{f}({{}}))",
            **{function: f"{function}{f}({{}})" for function in ("sin", "cos", "tanh", "exp")},
            "min": f"{name}_min({{}}, {{}})",
            "max": f"{name}_max({{}}, {{}})",
            "upright": f"{name}_upright({{}})",
        },
        division=f"{name}_divided({{}}, {{}})",
        number=lambda value, digits: decimal(value, digits) + f,
    )
    symbols = free_symbols(law.symbols, KEYWORDS)
    roots = stepped_roots(law)
    writer = Writer(law.expressions, roots, symbols, EXACT, free_prefix(symbols), True, dialect)
    needed = {
        int(law.expressions[number].value)
        for number in law.expressions.needed(roots)
        if law.expressions[number].operation == "input"
    }
    n_x, between = law.signals.n_x, "\n" + " " * 8
    lines = [
        "/* What the equations give; u are commands in effect in units of their scales, then hidden states. */",
        f"static void {name}outputs_c(const real x[{n_x}], const real u[SEEN], real out[{n_x}])",
        "{",
    ]
    lines += [
        f"    const real {symbol} = {_seen(law, name, precision, i)};"
        for i, symbol in enumerate(symbols)
        if i in needed
    ]
    if not any(i < n_x for i in needed):
        lines.append("    (void)x;")
    if not any(i >= n_x for i in needed):
        lines.append("    (void)u;")
    lines += [
        f"    const real {part} = {joined(writer.terms(number, define=True), between)};"
        for number, part in writer.names.items()
    ]
    lines += [f"    out[{i}] = {joined(writer.terms(root), between)};" for i, root in enumerate(roots)]
    return "\n".join([*lines, "}"])


def _seen(law: Law, name: str, precision: str, place: int) -> str:
    """An input of the equations, an angle that wraps within half a period of 0."""
    if place >= law.signals.n_x:
        return f"u[{place - law.signals.n_x}]"
    period = law.signals.states[place].period
    return f"x[{place}]" if period is None else f"{name}_wrapped(x[{place}], {number(period, precision)})"

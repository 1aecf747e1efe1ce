"""A law as C99: no dependency but <math.h>, no allocation, one period a call."""

from __future__ import annotations

import math

from twinloop._core import __version__
from twinloop.law.exports.c_sensors import sensor_c, sensor_header
from twinloop.law.exports.c_words import listed, number, places
from twinloop.law.exports.python_source import joined, stepped_roots
from twinloop.law.law import Law
from twinloop.law.writing import EXACT, Dialect, Writer, decimal
from twinloop.signals import RigidBody
from twinloop.texts import one_line

KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while _Bool _Complex
    _Imaginary sin cos tan exp log pow sqrt fabs tanh real x u y0 y1 j0 j1 yn jn gamma signgam main NULL
    """.split()  # noqa: SIM905
)
"""Names that a variable in C may not have, or should not."""


def c_source(law: Law, name: str, precision: str = "double") -> tuple[str, str]:
    """A law as a header and a source file.

    Args:
        law: of a twin.
        name: what the functions begin with.
        precision: "double" or "float".

    Returns:
        The header, and what it declares.
    """
    return _header(law, name, precision), _source(law, name, precision)


def _header(law: Law, name: str, precision: str) -> str:
    signals, big = law.signals, name.upper()
    queue = sum(actuator.delay for actuator in law.actuation.actuators)
    states = [f"   {i}  {state.name} ({_comment(state.unit)})" for i, state in enumerate(signals.states)]
    commands = [
        f"   {i}  {command.name} ({_comment(command.unit)}), {command.bounds[0]:g} to {command.bounds[1]:g}"
        for i, command in enumerate(signals.commands)
    ]
    late = [
        f"   {state} is read {offset:+.6g} s after the states that the equations drive"
        for state, offset in zip(signals.state_names, law.offsets, strict=True)
        if offset != 0.0
    ]
    return "\n".join([
        f"/* A twin learnt by Twinloop {__version__}: one period of {signals.dt:g} s a call, no allocation.",
        "   States:", *states, "   Commands:", *commands, *late, "*/",
        f"#ifndef {big}_H", f"#define {big}_H", "",
        f"#define {big}_STATES {signals.n_x}",
        f"#define {big}_COMMANDS {signals.n_u}",
        f"#define {big}_DT {number(signals.dt, precision)}",
        "",
        f"typedef {precision} {name}_real;", "",
        "/* What its actuators and hidden states remember. */",
        "typedef struct {",
        "    int started;",
        f"    {name}_real held[{signals.n_u}];",
        f"    {name}_real queue[{max(1, queue)}];",
        f"    {name}_real hidden[{max(1, len(law.actuation.hidden))}];",
        f"    {name}_real levels[{max(1, len(law.actuation.hidden))}];",
        f"}} {name}_memory;", "",
        "/* Begins a run: the next command is the first one. */",
        f"void {name}_reset({name}_memory *memory);", "",
        "/* Clips commands to their bounds. */",
        f"void {name}_clip({name}_real u[{signals.n_u}]);", "",
        "/* The state a period after x, under the commands u; next may be x. */",
        f"void {name}_step({name}_memory *memory, const {name}_real x[{signals.n_x}],",
        f"    const {name}_real u[{signals.n_u}], {name}_real next[{signals.n_x}]);", "",
        *sensor_header(law, name), "#endif", "",
    ])  # fmt: skip


def _source(law: Law, name: str, precision: str) -> str:
    signals = law.signals
    text = _outputs(law, name, precision)
    used = [helper for key, helper in _helpers(name, precision).items() if f"{name}_{key}(" in text]
    n_x, seen = signals.n_x, signals.n_u + len(law.actuation.hidden)
    return "\n".join([
        f"/* Written by Twinloop {__version__}; see {name}.h. */", f'#include "{name}.h"', "", "#include <math.h>", "",
        f"typedef {name}_real real;", f"#define SEEN {seen}", "",
        *used, text, "",
        *_actuation(law, name, precision), "",
        *_stepped(law, name, precision, n_x), "",
        f"void {name}_reset({name}_memory *memory)", "{", "    memory->started = 0;", "}", "",
        f"void {name}_clip(real u[{signals.n_u}])", "{",
        f"    static const real low[{signals.n_u}] = {listed([c.bounds[0] for c in signals.commands], precision)};",
        f"    static const real high[{signals.n_u}] = {listed([c.bounds[1] for c in signals.commands], precision)};",
        f"    for (int i = 0; i < {signals.n_u}; ++i) {{",
        "        u[i] = u[i] < low[i] ? low[i] : u[i] > high[i] ? high[i] : u[i];",
        "    }", "}", "",
        *_attitude_of_sensors(law, name, precision),
        *sensor_c(law, name, precision),
    ])  # fmt: skip


def _comment(unit: str) -> str:
    """A unit as a comment may hold it."""
    return one_line(unit).replace("*/", "* /").replace("/*", "/ *") or "1"


def _helpers(name: str, precision: str) -> dict[str, str]:
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


def _outputs(law: Law, name: str, precision: str) -> str:
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
    symbols = [f"{symbol}_" if symbol in KEYWORDS else symbol for symbol in law.symbols]
    prefix = "t"
    while any(symbol.startswith(prefix) and symbol[len(prefix) :].isdigit() for symbol in symbols):
        prefix += "_"
    roots = stepped_roots(law)
    writer = Writer(law.expressions, roots, symbols, EXACT, prefix, True, dialect)
    needed = {
        int(law.expressions[number].value)
        for number in law.expressions.needed(roots)
        if law.expressions[number].operation == "input"
    }
    n_x, between = law.signals.n_x, "\n" + " " * 8
    lines = [
        "/* What the equations give; u are commands in effect in units of their scales, then hidden states. */",
        f"static void {name}_outputs(const real x[{n_x}], const real u[SEEN], real out[{n_x}])",
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


def _actuation(law: Law, name: str, precision: str) -> list[str]:
    """What arrives of commands at the start, the middle and the end of a period."""
    actuators, hidden, n_u = law.actuation.actuators, law.actuation.hidden, law.signals.n_u
    f = "f" if precision == "float" else ""

    def literal(value: float) -> str:
        return number(value, precision)

    lines = [
        f"static void {name}_effects({name}_memory *memory, const real u[{n_u}], real seen[3][SEEN])",
        "{",
        f"    static const real factors[{n_u}] = {listed([1.0 / c.size for c in law.signals.commands], precision)};",
    ]
    if not hidden and all(actuator.direct for actuator in actuators):
        return [
            *lines,
            "    (void)memory;",
            f"    for (int i = 0; i < {n_u}; ++i) {{",
            "        seen[0][i] = seen[1][i] = seen[2][i] = u[i] * factors[i];",
            "    }",
            "}",
        ]
    delays = ", ".join(str(actuator.delay) for actuator in actuators)
    lines += [
        f"    static const real lags[{n_u}] = {listed([actuator.lag for actuator in actuators], precision)};",
        f"    static const int delays[{n_u}] = {{{delays}}};",
    ]
    begun = [
        f"        memory->held[{i}] = {f'u[{i}]' if actuator.rest is None else literal(actuator.rest)};"
        for i, actuator in enumerate(actuators)
    ]
    levels = []
    for j, h in enumerate(hidden):
        given = [f"u[{i}] * factors[{i}]" for i in h.commands]
        total = " + ".join(f"({g}) * ({g})" if h.squared else g for g in given)
        levels.append(f"    const real level_{j} = ({total}) * {literal(1.0 / len(given))};")
        begun += [
            f"        memory->hidden[{j}] = {literal(0.0)};",
            f"        memory->levels[{j}] = {f'level_{j}' if h.rest is None else literal(h.rest)};",
        ]
    lines += [
        *levels,
        "    real *queue = memory->queue;",
        "    if (!memory->started) {",
        *begun,
        f"        for (int i = 0, place = 0; i < {n_u}; ++i) {{",
        "            for (int k = 0; k < delays[i]; ++k) {",
        "                memory->queue[place++] = memory->held[i];",
        "            }",
        "        }",
        "        memory->started = 1;",
        "    }",
        f"    for (int i = 0; i < {n_u}; ++i) {{",
        "        real arrived = u[i];",
        "        if (delays[i] > 0) {",
        "            arrived = queue[0];",
        "            for (int k = 0; k + 1 < delays[i]; ++k) {",
        "                queue[k] = queue[k + 1];",
        "            }",
        "            queue[delays[i] - 1] = u[i];",
        "            queue += delays[i];",
        "        }",
        f"        const real half = lags[i] > 0 ? exp{f}({literal(-0.5 * law.signals.dt)} / lags[i]) : 0;",
        "        const real start = lags[i] > 0 ? memory->held[i] : arrived;",
        "        const real middle = arrived + (start - arrived) * half;",
        "        const real end = arrived + (middle - arrived) * half;",
        "        memory->held[i] = end;",
        "        seen[0][i] = start * factors[i];",
        "        seen[1][i] = middle * factors[i];",
        "        seen[2][i] = end * factors[i];",
        "    }",
    ]
    for j, h in enumerate(hidden):
        lines += [
            "    {",
            f"        const real kept = exp{f}({literal(-0.5 * law.signals.dt / h.time)});",
            f"        const real added = (level_{j} - memory->levels[{j}]) * ({literal(h.time)} * (1 - kept));",
            f"        seen[0][{n_u + j}] = memory->hidden[{j}];",
            f"        seen[1][{n_u + j}] = seen[0][{n_u + j}] * kept + added;",
            f"        seen[2][{n_u + j}] = seen[1][{n_u + j}] * kept + added;",
            f"        memory->hidden[{j}] = seen[2][{n_u + j}];",
            "    }",
        ]
    return [*lines, "}"]


def _stepped(law: Law, name: str, precision: str, n_x: int) -> list[str]:
    """One period."""
    n_u = law.signals.n_u
    lines = [
        f"void {name}_step({name}_memory *memory, const real x[{n_x}], const real u[{n_u}], real next[{n_x}])",
        "{",
        f"    real seen[3][SEEN], first[{n_x}];",
        f"    {name}_effects(memory, u, seen);",
    ]
    if law.form != "acceleration":
        add = "x[i] + first[i]" if law.form == "increment" else "first[i]"
        return [
            *lines,
            f"    {name}_outputs(x, seen[1], first);",
            f"    for (int i = 0; i < {n_x}; ++i) {{",
            f"        next[i] = {add};",
            "    }",
            "}",
        ]
    body = law.signals.kinematics
    size, begun, slopes = n_x, "x", f"{name}_outputs("
    if body is not None:
        size, begun, slopes = n_x + 4, "begun", f"{name}_slopes(before, "
        lines = [
            *_turned(law, name, precision, body),
            *_slopes(law, name, precision, body),
            *lines[:2],
            f"    real seen[3][SEEN], first[{size}], begun[{size}];",
            f"    const real before[3] = {{{', '.join(f'x[{i}]' for i in places(law, body.angles))}}};",
            f"    {name}_effects(memory, u, seen);",
            f"    for (int i = 0; i < {n_x}; ++i) {{",
            "        begun[i] = x[i];",
            "    }",
            f"    {name}_quaternion(before, begun + {n_x});",
        ]
    steps = law.signals.substeps
    half, whole, sixth = (
        number(law.signals.dt / steps * share, precision) for share in (0.5, 1.0, 1.0 / 6.0)
    )
    target = "next" if body is None else "begun"
    inputs = "seen" if steps == 1 else "within"

    def moved(slope: str, time: str) -> list[str]:
        return [
            f"    for (int i = 0; i < {size}; ++i) {{",
            f"        point[i] = {begun}[i] + {time} * {slope}[i];",
            "    }",
        ]

    stages = [
        f"    {slopes}{begun}, {inputs}[0], first);",
        *moved("first", half),
        f"    {slopes}point, {inputs}[1], second);",
        *moved("second", half),
        f"    {slopes}point, {inputs}[1], third);",
        *moved("third", whole),
        f"    {slopes}point, {inputs}[2], fourth);",
        f"    for (int i = 0; i < {size}; ++i) {{",
        f"        {target}[i] = {begun}[i] + {sixth} * (first[i] + 2 * second[i] + 2 * third[i] + fourth[i]);",
        "    }",
    ]
    if steps > 1:
        stages = [f"    {line}" for line in [*_within(steps, precision), *stages]]
        stages = [f"    for (int part = 0; part < {steps}; ++part) {{", *stages, "    }"]
    lines += [f"    real second[{size}], third[{size}], fourth[{size}], point[{size}];", *stages]
    return [*lines, *([] if body is None else [f"    {name}_seen(before, begun, next);"]), "}"]


def _within(steps: int, precision: str) -> list[str]:
    """Inputs in a part of a period: the parabola through those at its start, middle and end."""
    half, one = number(0.5, precision), number(1.0, precision)
    return [
        "    real within[3][SEEN];",
        "    for (int stage = 0; stage < 3; ++stage) {",
        f"        const real at = (part + {half} * stage) / {number(float(steps), precision)};",
        f"        const real a = ({one} - at) * ({one} - 2 * at), b = 4 * at * ({one} - at);",
        f"        const real c = at * (2 * at - {one});",
        "        for (int i = 0; i < SEEN; ++i) {",
        "            within[stage][i] = a * seen[0][i] + b * seen[1][i] + c * seen[2][i];",
        "        }",
        "    }",
    ]


def _attitude_of_sensors(law: Law, name: str, precision: str) -> list[str]:
    """What late sensors of a rigid body need, where the step has not brought it already."""
    body = law.signals.kinematics
    if body is None or law.form == "acceleration" or not any(law.offsets):
        return []
    return _turned(law, name, precision, body)


def _turned(law: Law, name: str, precision: str, body: RigidBody) -> list[str]:
    """The attitude of a rigid body as a quaternion behind the states: no pitch is singular for it."""
    f, n_x = "f" if precision == "float" else "", law.signals.n_x
    pi, half = number(math.pi, precision), number(0.5, precision)
    angles = places(law, body.angles)
    return [
        f"static void {name}_quaternion(const real angles[3], real q[4])",
        "{",
        *(
            f"    const real s{i} = sin{f}({half} * angles[{i}]), c{i} = cos{f}({half} * angles[{i}]);"
            for i in range(3)
        ),
        "    q[0] = c0 * c1 * c2 + s0 * s1 * s2;",
        "    q[1] = s0 * c1 * c2 - c0 * s1 * s2;",
        "    q[2] = c0 * s1 * c2 + s0 * c1 * s2;",
        "    q[3] = c0 * c1 * s2 - s0 * s1 * c2;",
        "}",
        "",
        "/* The states of y, their angles those of the quaternion behind them, the nearest to what they were. */",
        f"static void {name}_seen(const real before[3], const real y[{n_x + 4}], real x[{n_x}])",
        "{",
        f"    const real a = y[{n_x}], b = y[{n_x + 1}], c = y[{n_x + 2}], d = y[{n_x + 3}];",
        "    const real across = 2 * (c * d + a * b), up = a * a - b * b - c * c + d * d;",
        f"    real angles[3] = {{atan2{f}(across, up),",
        f"        atan2{f}(-2 * (b * d - a * c), sqrt{f}(across * across + up * up)),",
        f"        atan2{f}(2 * (b * c + a * d), a * a + b * b - c * c - d * d)}};",
        f"    if (cos{f}(before[1]) < 0) {{",
        f"        angles[0] += {pi};",
        f"        angles[1] = {pi} - angles[1];",
        f"        angles[2] += {pi};",
        "    }",
        "    for (int i = 0; i < 3; ++i) {",
        f"        angles[i] += 2 * {pi} * rint{f}((before[i] - angles[i]) / (2 * {pi}));",
        "    }",
        f"    for (int i = 0; i < {n_x}; ++i) {{",
        "        x[i] = y[i];",
        "    }",
        *(f"    x[{place}] = angles[{i}];" for i, place in enumerate(angles)),
        "}",
        "",
    ]


def _slopes(law: Law, name: str, precision: str, body: RigidBody) -> list[str]:
    """How the states and the quaternion behind them change."""
    n_x, half, rates = law.signals.n_x, number(0.5, precision), places(law, body.rates)
    return [
        f"static void {name}_slopes(const real before[3], const real y[{n_x + 4}], const real u[SEEN],",
        f"    real out[{n_x + 4}])",
        "{",
        f"    real x[{n_x}];",
        f"    {name}_seen(before, y, x);",
        f"    {name}_outputs(x, u, out);",
        f"    const real a = y[{n_x}], b = y[{n_x + 1}], c = y[{n_x + 2}], d = y[{n_x + 3}];",
        "    const real "
        + ", ".join(f"{letter} = {half} * x[{place}]" for letter, place in zip("pqr", rates, strict=True))
        + ";",
        f"    out[{n_x}] = -(b * p + c * q + d * r);",
        f"    out[{n_x + 1}] = a * p + c * r - d * q;",
        f"    out[{n_x + 2}] = a * q - b * r + d * p;",
        f"    out[{n_x + 3}] = a * r + b * q - c * p;",
        "}",
        "",
    ]

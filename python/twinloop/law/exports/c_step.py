"""A period of a law in C: its integrator, and the attitude of a rigid body."""

from __future__ import annotations

import math

from twinloop.law.exports.c_words import number, places
from twinloop.law.forms import EULER
from twinloop.law.law import Law
from twinloop.signals import RigidBody


def step_c(law: Law, name: str, precision: str, n_x: int) -> list[str]:
    """One period."""
    n_u = law.signals.n_u
    lines = [
        f"void {name}_step({name}_memory *memory, const real x[{n_x}], const real u[{n_u}], real next[{n_x}])",
        "{",
        f"    real seen[3][SEEN], first[{n_x}];",
        f"    {name}_effects(memory, u, seen);",
    ]
    if law.form != "acceleration":
        add = "first[i]" if law.form == "absolute" else "x[i] + first[i]"
        stage = 0 if law.form in EULER else 1
        return [
            *lines,
            f"    {name}outputs_c(x, seen[{stage}], first);",
            f"    for (int i = 0; i < {n_x}; ++i) {{",
            f"        next[i] = {add};",
            "    }",
            "}",
        ]
    body = law.signals.kinematics
    size, begun, slopes = n_x, "x", f"{name}outputs_c("
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


def attitude_c(law: Law, name: str, precision: str) -> list[str]:
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
        f"    {name}outputs_c(x, u, out);",
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

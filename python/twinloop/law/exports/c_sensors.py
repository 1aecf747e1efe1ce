"""What late and early sensors read of a run, as C99: `crates/twinloop-core/src/sensors.rs`, one state a call."""

from __future__ import annotations

import math

from twinloop.law.exports.c_words import number, places
from twinloop.law.exports.sensor_source import groups, rates, reach
from twinloop.law.law import Law


def sensor_header(law: Law, name: str) -> list[str]:
    """What is declared of the sensors; nothing where all are in time.

    Args:
        law: of the twin.
        name: what the functions begin with.
    """
    if not any(law.offsets):
        return []
    n_x = law.signals.n_x
    return [
        "/* What its sensors remember: some are late or early. */",
        "typedef struct {",
        "    int seen;",
        f"    {name}_real first[{n_x}];",
        f"    {name}_real recent[{reach(law)}][{n_x}];",
        f"}} {name}_sensors;",
        "",
        "/* Begins a run: the next state that is read is the first one. */",
        f"void {name}_begin({name}_sensors *sensors);",
        "",
        "/* What the sensors read at the state x: for each state in turn. reading is another place than x. */",
        f"void {name}_read({name}_sensors *sensors, const {name}_real x[{n_x}], {name}_real reading[{n_x}]);",
        "",
    ]


def sensor_c(law: Law, name: str, precision: str) -> list[str]:
    """The functions; nothing where all sensors are in time.

    Args:
        law: of the twin, whose functions `quaternion` and `seen` are there if it is a rigid body.
        name: what they begin with.
        precision: "double" or "float".
    """
    if not any(law.offsets):
        return []
    n_x, back = law.signals.n_x, reach(law)
    copied = [f"    for (int i = 0; i < {n_x}; ++i) {{", "        reading[i] = x[i];", "    }"]
    return [
        *_coasted(law, name, precision),
        *_between(law, name, precision),
        f"void {name}_begin({name}_sensors *sensors)", "{", "    sensors->seen = 0;", "}", "",
        f"void {name}_read({name}_sensors *sensors, const real x[{n_x}], real reading[{n_x}])", "{",
        f"    real found[{n_x}];",
        "    if (sensors->seen == 0) {",
        f"        for (int i = 0; i < {n_x}; ++i) {{",
        "            sensors->first[i] = x[i];",
        "        }",
        "    }",
        *copied,
        *(line for periods, read in groups(law) for line in _group(law, name, precision, periods, read)),
        f"    for (int k = {back - 1}; k > 0; --k) {{",
        f"        for (int i = 0; i < {n_x}; ++i) {{",
        "            sensors->recent[k][i] = sensors->recent[k - 1][i];",
        "        }",
        "    }",
        f"    for (int i = 0; i < {n_x}; ++i) {{",
        "        sensors->recent[0][i] = x[i];",
        "    }",
        f"    sensors->seen += sensors->seen <= {back};",
        "}", "",
    ]  # fmt: skip


def _group(law: Law, name: str, precision: str, periods: float, read: tuple[int, ...]) -> list[str]:
    """Sensors that are late or early by the same."""
    n_x, dt = law.signals.n_x, law.signals.dt
    put = [f"        reading[{place}] = found[{place}];" for place in read]

    def numbered(value: float) -> str:
        return number(value, precision)

    if periods < 0.0:
        driven = [int(place in law.signals.driven) for place in range(n_x)]
        return [
            "    {",
            f"        static const int driven[{n_x}] = {{{', '.join(map(str, driven))}}};",
            f"        real rates[{n_x}];",
            f"        for (int i = 0; i < {n_x}; ++i) {{",
            "            rates[i] = x[i];",
            "            if (driven[i] && sensors->seen > 0) {",
            f"                rates[i] += (x[i] - sensors->recent[0][i]) * {numbered(-0.5 * periods)};",
            "            }",
            "        }",
            f"        {name}_coasted(x, rates, {numbered(-periods * dt)}, found);",
            *put,
            "    }",
        ]
    back = math.ceil(periods)

    def state(ago: int) -> str:
        return "x" if ago == 0 else f"sensors->recent[{ago - 1}]"

    within = [
        f"            for (int i = 0; i < {n_x}; ++i) {{",
        f"                found[i] = {state(back)}[i];",
        "            }",
    ]
    if back > periods:
        within = [
            f"            {name}_between({state(back)}, {state(back - 1)}, {numbered(back - periods)}, found);"
        ]
    return [
        "    {",
        f"        const real at = (real)sensors->seen - {numbered(periods)};",
        "        if (at < 0) {",
        f"            {name}_coasted(sensors->first, sensors->first, at * {numbered(dt)}, found);",
        "        } else {",
        *within,
        "        }",
        *put,
        "    }",
    ]


def _coasted(law: Law, name: str, precision: str) -> list[str]:
    """A state some time later by kinematics alone."""
    n_x, of = law.signals.n_x, rates(law)
    lines = [
        *_turning(law, name, precision),
        f"static void {name}_coasted(const real x[{n_x}], const real rates[{n_x}], real time, real found[{n_x}])",
        "{",
        f"    for (int i = 0; i < {n_x}; ++i) {{",
        "        found[i] = x[i];",
        "    }",
    ]
    for place in range(n_x):
        rate, factor, order = of[place], "time", 1
        while rate is not None:
            lines.append(f"    found[{place}] += rates[{rate}] * ({factor});")
            rate, order = of[rate], order + 1
            factor = f"{factor} * time / {order}"
    if not any(rate is not None for rate in of) and law.signals.kinematics is None:
        lines += ["    (void)rates;", "    (void)time;"]
    body = law.signals.kinematics
    if body is not None:
        f = "f" if precision == "float" else ""
        p, q, r = (f"rates[{place}]" for place in places(law, body.rates))
        angles = ", ".join(f"x[{place}]" for place in places(law, body.angles))
        lines += [
            f"    const real before[3] = {{{angles}}};",
            f"    const real half = sqrt{f}({p} * {p} + {q} * {q} + {r} * {r}) * time / 2;",
            f"    const real cosine = cos{f}(half), sine = half > 0 || half < 0 ? sin{f}(half) / half : 1;",
            f"    real attitude[4], slope[4], y[{n_x + 4}];",
            f"    {name}_quaternion(before, attitude);",
            f"    {name}_turning(attitude, rates, slope);",
            f"    for (int i = 0; i < {n_x}; ++i) {{",
            "        y[i] = found[i];",
            "    }",
            "    for (int i = 0; i < 4; ++i) {",
            f"        y[{n_x} + i] = attitude[i] * cosine + slope[i] * sine * time;",
            "    }",
            f"    {name}_seen(before, y, found);",
        ]
    return [*lines, "}", ""]


def _turning(law: Law, name: str, precision: str) -> list[str]:
    """How body rates turn a quaternion."""
    body, n_x = law.signals.kinematics, law.signals.n_x
    if body is None:
        return []
    half = number(0.5, precision)
    p, q, r = places(law, body.rates)
    return [
        f"static void {name}_turning(const real attitude[4], const real x[{n_x}], real slope[4])",
        "{",
        "    const real a = attitude[0], b = attitude[1], c = attitude[2], d = attitude[3];",
        f"    const real p = {half} * x[{p}], q = {half} * x[{q}], r = {half} * x[{r}];",
        "    slope[0] = -(b * p + c * q + d * r);",
        "    slope[1] = a * p + c * r - d * q;",
        "    slope[2] = a * q - b * r + d * p;",
        "    slope[3] = a * r + b * q - c * p;",
        "}",
        "",
    ]


def _between(law: Law, name: str, precision: str) -> list[str]:
    """What lies between two states a period apart; nothing where no sensor is late by a part of a period."""
    if not any(periods > 0.0 and periods != math.ceil(periods) for periods, _ in groups(law)):
        return []
    n_x, of, body = law.signals.n_x, rates(law), law.signals.kinematics
    dt = number(law.signals.dt, precision)
    lines = [
        f"static void {name}_between(const real before[{n_x}], const real after[{n_x}], real share,",
        f"    real found[{n_x}])",
        "{",
        "    const real rest = 1 - share;",
        "    const real begun = rest * rest * (1 + 2 * share), ended = share * share * (3 - 2 * share);",
        f"    const real rising = {dt} * share * rest * rest, falling = -{dt} * share * share * rest;",
        f"    for (int i = 0; i < {n_x}; ++i) {{",
        "        found[i] = after[i];",
        "    }",
        *(
            f"    found[{i}] = before[{i}] * begun + after[{i}] * ended"
            f" + before[{rate}] * rising + after[{rate}] * falling;"
            for i, rate in enumerate(of)
            if rate is not None
        ),
    ]
    if body is not None:
        at = places(law, body.angles)
        from_, to = (", ".join(f"{which}[{place}]" for place in at) for which in ("before", "after"))
        lines += [
            f"    const real angles[3] = {{{from_}}}, others[3] = {{{to}}};",
            f"    real p[4], q[4], first[4], last[4], y[{n_x + 4}];",
            f"    {name}_quaternion(angles, p);",
            f"    {name}_quaternion(others, q);",
            "    /* A quaternion and its negative are the same attitude. */",
            "    if (p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] < 0) {",
            "        for (int i = 0; i < 4; ++i) {",
            "            q[i] = -q[i];",
            "        }",
            "    }",
            f"    {name}_turning(p, before, first);",
            f"    {name}_turning(q, after, last);",
            f"    for (int i = 0; i < {n_x}; ++i) {{",
            "        y[i] = found[i];",
            "    }",
            "    for (int i = 0; i < 4; ++i) {",
            f"        y[{n_x} + i] = p[i] * begun + q[i] * ended + first[i] * rising + last[i] * falling;",
            "    }",
            f"    {name}_seen(angles, y, found);",
        ]
    return [*lines, "}", ""]

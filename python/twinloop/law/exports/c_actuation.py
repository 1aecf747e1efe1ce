"""Actuators and hidden states of a law in C: what arrives of commands within a period."""

from __future__ import annotations

from twinloop.law.exports.c_words import listed, number
from twinloop.law.law import Law


def actuation_c(law: Law, name: str, precision: str) -> list[str]:
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

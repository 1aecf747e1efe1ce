"""Actuators and hidden states of a law in C: what arrives of commands within a period."""

from __future__ import annotations

from collections.abc import Callable

from twinloop.law.exports.c_words import listed, number
from twinloop.law.law import Law


def actuation_c(law: Law, name: str, precision: str) -> list[str]:
    """What arrives of commands at the start, the middle and the end of a period."""
    actuators, hidden, n_u = law.actuation.actuators, law.actuation.hidden, law.signals.n_u
    f = "f" if precision == "float" else ""

    def literal(value: float) -> str:
        return number(value, precision)

    slow = _on_its_way(law, name, literal, f)
    lines = [
        f"static void {name}_effects({name}_memory *memory, const real u[{n_u}], real seen[3][SEEN])",
        "{",
        f"    static const real factors[{n_u}] = {listed([1.0 / c.size for c in law.signals.commands], precision)};",
    ]
    if not law.actuation.remembers:
        return [
            *lines,
            "    (void)memory;",
            f"    for (int i = 0; i < {n_u}; ++i) {{",
            "        seen[0][i] = seen[1][i] = seen[2][i] = u[i] * factors[i];",
            "    }",
            "}",
        ]
    rates = [one.rate(command.size) for one, command in zip(actuators, law.signals.commands, strict=True)]
    delays = ", ".join(str(actuator.delay) for actuator in actuators)
    lines += [
        f"    static const real lags[{n_u}] = {listed([actuator.lag for actuator in actuators], precision)};",
        f"    static const real rates[{n_u}] = {listed(rates, precision)};",
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
        "        const real start = lags[i] > 0 || rates[i] > 0 ? memory->held[i] : arrived;",
        f"        const real middle = {name}_on_its_way(start, arrived, lags[i], rates[i]);",
        f"        const real end = {name}_on_its_way(middle, arrived, lags[i], rates[i]);",
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
    return [*slow, *lines, "}"]


def _on_its_way(law: Law, name: str, literal: Callable[[float], str], f: str) -> list[str]:
    """The effect of a command half a period later: it moves at the rate, if there is one, until the lag is slower."""
    return [
        f"static real {name}_on_its_way(real held, real arrived, real lag, real rate)",
        "{",
        f"    const real time = {literal(0.5 * law.signals.dt)};",
        "    const real off = arrived - held;",
        f"    const real beyond = fabs{f}(off) - rate * lag;",
        "    if (rate == 0 || !(beyond > 0)) {",
        f"        return arrived + (held - arrived) * (lag > 0 ? exp{f}(-time / lag) : 0);",
        "    }",
        "    if (beyond >= rate * time) {",
        f"        return held + copysign{f}(rate * time, off);",
        "    }",
        f"    const real fading = lag > 0 ? exp{f}(-(time - beyond / rate) / lag) : 0;",
        f"    return arrived - copysign{f}(rate * lag, off) * fading;",
        "}",
        "",
    ]

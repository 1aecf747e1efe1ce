"""A law as C99: no dependency but <math.h>, no allocation, one period a call."""

from __future__ import annotations

from twinloop._core import __version__
from twinloop._ground.texts import one_line
from twinloop.law.exports.c_actuation import actuation_c
from twinloop.law.exports.c_outputs import functions_c, outputs_c
from twinloop.law.exports.c_sensors import sensor_c, sensor_header
from twinloop.law.exports.c_step import attitude_c, step_c
from twinloop.law.exports.c_words import BEGIN_C, END_C, listed, number
from twinloop.law.exports.left_out import left_out
from twinloop.law.law import Law


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
    others = [f"   {_comment(line)}" for line in left_out(law)]
    return "\n".join([
        f"/* A twin learnt by Twinloop {__version__}: one period of {signals.dt:g} s a call, no allocation.",
        "   States:", *states, "   Commands:", *commands, *late, *others, "*/",
        f"#ifndef {big}_H", f"#define {big}_H", "",
        f"#define {big}_STATES {signals.n_x}",
        f"#define {big}_COMMANDS {signals.n_u}",
        f"#define {big}_DT {number(signals.dt, precision)}",
        "",
        *BEGIN_C,
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
        *sensor_header(law, name), *END_C, "#endif", "",
    ])  # fmt: skip


def _source(law: Law, name: str, precision: str) -> str:
    signals = law.signals
    text = outputs_c(law, name, precision)
    used = [helper for key, helper in functions_c(name, precision).items() if f"{name}_{key}(" in text]
    n_x, seen = signals.n_x, signals.n_u + len(law.actuation.hidden)
    return "\n".join([
        f"/* Written by Twinloop {__version__}; see {name}.h. */", f'#include "{name}.h"', "", "#include <math.h>", "",
        f"typedef {name}_real real;", f"#define SEEN {seen}", "",
        *used, text, "",
        *actuation_c(law, name, precision), "",
        *step_c(law, name, precision, n_x), "",
        f"void {name}_reset({name}_memory *memory)", "{", "    memory->started = 0;", "}", "",
        f"void {name}_clip(real u[{signals.n_u}])", "{",
        f"    static const real low[{signals.n_u}] = {listed([c.bounds[0] for c in signals.commands], precision)};",
        f"    static const real high[{signals.n_u}] = {listed([c.bounds[1] for c in signals.commands], precision)};",
        f"    for (int i = 0; i < {signals.n_u}; ++i) {{",
        "        u[i] = u[i] < low[i] ? low[i] : u[i] > high[i] ? high[i] : u[i];",
        "    }", "}", "",
        *attitude_c(law, name, precision),
        *sensor_c(law, name, precision),
    ])  # fmt: skip


def _comment(unit: str) -> str:
    """A unit as a comment may hold it."""
    return one_line(unit).replace("*/", "* /").replace("/*", "/ *") or "1"

"""A controller as Python and as C99: one call a period, every gain a number."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._core import __version__
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import power
from twinloop.controllers import PID, Cascade, Family, Mixer, StateFeedback, UnboundFamily
from twinloop.errors import NotAvailable
from twinloop.law.exports.c_words import BEGIN_C, END_C, number
from twinloop.signals import Signals
from twinloop.unmeasured import in_words

DECIMAL = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)")
"""A number with a point or an exponent, as Python writes it."""
READ = re.compile(r"(?:state|target)\[\d+\]")
"""An entry of the state or of the target."""


@dataclass(frozen=True)
class Assignment:
    """One line of a law, the same in both languages: a new name, or a place of the memory or the command.

    Args:
        target: what is assigned.
        value: an expression of numbers, names, `state[i]`, `target[i]`, `memory[i]`, `command[i]` and the helpers.
    """

    target: str
    value: str


class _Sheet:
    """Lines of a law as they are written, with the memory that they need.

    Attributes:
        lines: so far.
        memory: how many numbers are remembered.
        wanted: names of the commands before they are clipped, which hides what overflows.
        missed: place of the memory that counts calls that nothing else remembers; None: nobody asks for it.
    """

    def __init__(self, signals: Signals) -> None:
        self.signals = signals
        self.lines: list[Assignment] = []
        self.memory = 0
        self.wanted: list[str] = []
        self.missed: int | None = None

    def let(self, target: str, value: str) -> str:
        self.lines.append(Assignment(target, value))
        return target

    def remembered(self) -> str:
        """A new place of the memory, 0 at the start of a run."""
        self.memory += 1
        return f"memory[{self.memory - 1}]"

    def since(self) -> str:
        """Periods since the last call that was remembered."""
        if self.missed is None:
            self.remembered()
            self.missed = self.memory - 1
        return f"(1.0 + memory[{self.missed}])"

    def difference(self, state: int, a: str, b: str) -> str:
        period = self.signals.states[state].period
        return f"({a} - {b})" if period is None else f"wrapped({a} - {b}, {period!r})"

    def mixed(self, mixer: Mixer | None, outputs: Sequence[str]) -> None:
        """Commands of what the axes ask for, clipped to their bounds."""
        for j, command in enumerate(self.signals.commands):
            low, high = (repr(float(bound)) for bound in command.bounds)
            if mixer is None:
                value = outputs[j]
            else:
                assert mixer.offset is not None  # __post_init__ has set it
                shares = zip(mixer.matrix[j].tolist(), outputs, strict=True)
                parts = [
                    repr(float(mixer.offset[j])),
                    *(f"{out} * {_number(share)}" for share, out in shares),
                ]
                value = " + ".join(parts)
                if mixer.power != 1.0:
                    value = f"signed_power({value}, {float(mixer.power)!r})"
            self.wanted.append(self.let(f"wanted_{j}", value))
            self.let(f"command[{j}]", f"clip({self.wanted[j]}, {low}, {high})")


def _sheet(described: UnboundFamily, family: Family, genes: Floats) -> _Sheet:
    """What a controller does in a period.

    Args:
        described: the family as a user wrote it.
        family: the same, bound.
        genes: gains (size,).

    Raises:
        NotAvailable: a family that cannot be written down, such as one in Python.
    """
    gains, sheet = family.parameters(genes), _Sheet(family.signals)
    if isinstance(described, StateFeedback):
        _state_feedback(sheet, described, gains)
    elif isinstance(described, (PID, Cascade)):
        _axes(sheet, described, gains)
    else:
        raise NotAvailable(
            f"Export: expected a PID, a Cascade or a StateFeedback, found a {type(described).__name__}, whose law is"
            " not known here; write its code by hand."
        )
    if sheet.missed is not None:
        sheet.let(f"memory[{sheet.missed}]", "0.0")
    return sheet


def _state_feedback(sheet: _Sheet, described: StateFeedback, gains: dict[str, float]) -> None:
    signals, place = sheet.signals, sheet.signals.state_names.index
    states = signals.state_names if described.states is None else described.states
    sources = []
    for name in states:
        i = place(name)
        sources.append((name, sheet.let(f"error_{i}", sheet.difference(i, f"target[{i}]", f"state[{i}]"))))
    for name in described.integral:
        i, integral = place(name), sheet.remembered()
        error = sheet.difference(i, f"target[{i}]", f"state[{i}]")
        sheet.let(integral, f"{integral} + {error} * {signals.dt!r}")
        sources.append((f"{name}.integral", integral))
    if described.output is None:
        outputs = list(signals.command_names)
    else:
        outputs = [f"u{j + 1}" for j in range(described.output.matrix.shape[1])]
    asked = [
        sheet.let(
            f"asked_{j}",
            " + ".join(f"{_number(gains[f'{source}->{output}'])} * {value}" for source, value in sources),
        )
        for j, output in enumerate(outputs)
    ]
    sheet.mixed(described.output, asked)


def _axes(sheet: _Sheet, described: PID | Cascade, gains: dict[str, float]) -> None:
    signals, place = sheet.signals, sheet.signals.state_names.index
    dt = signals.dt
    share = dt / (dt + described.derivative_filter)
    started = sheet.remembered()
    asked, wound = [], []
    for i, (angle, rate) in enumerate(described.axes):
        if isinstance(described, Cascade):
            assert rate is not None and described.rate_limits is not None
            led, measured, outer = place(rate), None, place(angle)
            limit = described.rate_limits.get(rate, math.inf)
            error = sheet.difference(outer, f"target[{outer}]", f"state[{outer}]")
            point = f"{_number(gains[f'{angle}.kp'])} * {error} + target[{led}]"
            if math.isfinite(limit):
                point = f"clip({point}, {-limit!r}, {limit!r})"
            point, name = sheet.let(f"point_{i}", point), rate
        else:
            led, measured, name = place(angle), None if rate is None else place(rate), angle
            point = f"target[{led}]"
        error = sheet.let(f"error_{i}", sheet.difference(led, point, f"state[{led}]"))
        if measured is None:
            last = sheet.remembered()
            moved = sheet.difference(led, f"state[{led}]", last)
            slope = sheet.let(f"rate_{i}", f"{moved} / ({dt!r} * {sheet.since()}) * {started}")
            sheet.let(last, f"state[{led}]")
        else:
            slope = f"state[{measured}]"
        if share != 1.0:
            kept = sheet.remembered()
            slope = sheet.let(kept, f"chosen({started}, {kept} + ({slope} - {kept}) * {share!r}, {slope})")
        integral = sheet.remembered()
        before = sheet.let(f"before_{i}", integral) if described.anti_windup else ""
        sheet.let(integral, f"{integral} + {error} * {dt!r}")
        kp, ki, kd = (_number(gains[f"{name}.{term}"]) for term in ("kp", "ki", "kd"))
        asked.append(sheet.let(f"asked_{i}", f"{kp} * {error} + {ki} * {integral} - {kd} * {slope}"))
        wound.append((integral, before, ki))
    sheet.mixed(described.output, asked)
    sheet.let(started, "1.0")
    for i, (integral, before, ki) in enumerate(wound if described.anti_windup else []):
        shares = [float(i == j) for j in range(signals.n_u)]
        if described.output is not None:
            shares = described.output.matrix[:, i].tolist()
        pushed = [
            f"pushing({ki} * ({integral} - {before}) * {_number(factor)}, command[{j}],"
            f" {float(command.bounds[0])!r}, {float(command.bounds[1])!r})"
            for j, (factor, command) in enumerate(zip(shares, signals.commands, strict=True))
            if factor != 0.0
        ]
        if pushed:
            sheet.let(integral, f"chosen({' + '.join(pushed)}, {before}, {integral})")


def _at_rest(described: UnboundFamily, signals: Signals) -> list[float]:
    """What a controller sends without any error (n_u,): that of its mixer for no output, or 0, within the bounds."""
    output = described.output if isinstance(described, (PID, Cascade, StateFeedback)) else None
    offset = np.zeros(signals.n_u) if output is None or output.offset is None else output.offset
    exponent = 1.0 if output is None else output.power
    low, high = np.array([command.bounds for command in signals.commands]).T
    sent: list[float] = np.clip(
        [math.copysign(power(abs(x), exponent), x) for x in offset], low, high
    ).tolist()
    return sent


def _read(lines: Sequence[Assignment]) -> list[str]:
    """Which entries of the state and the target a law needs, in their order."""
    return sorted({entry for line in lines for entry in READ.findall(line.value)}, key=_place)


def _place(entry: str) -> tuple[str, int]:
    name, _, place = entry.rstrip("]").partition("[")
    return name, int(place)


def _number(value: float) -> str:
    return f"({value!r})" if value < 0.0 else repr(float(value))


_PYTHON_HELPERS = '''
def finite(values):
    return all(math.isfinite(value) for value in values)


def clip(a, low, high):
    return min(max(a, low), high)


def wrapped(a, period):
    """The same within half a period of 0."""
    return a - round(a / period) * period


def signed_power(a, power):
    return math.copysign(abs(a) ** power, a)


def chosen(test, a, b):
    return a if test > 0.0 else b


def pushing(push, command, low, high):
    """1 where a push leads further beyond the bound that a command is at."""
    return float((push > 0.0 and command >= high) or (push < 0.0 and command <= low))
'''


def controller_python(described: UnboundFamily, family: Family, genes: Floats) -> str:
    """A controller as a Python module that needs nothing but Python.

    Args:
        described: the family as a user wrote it.
        family: the same, bound.
        genes: gains (size,).

    Returns:
        A module with a class `Controller`: `reset()` and `command(state, target)`.

    Raises:
        NotAvailable: a family that cannot be written down.
    """
    sheet = _sheet(described, family, genes)
    lines, memory, missed = sheet.lines, sheet.memory, sheet.missed
    signals, rest = family.signals, _at_rest(described, family.signals)
    repeating = "return self._repeated()"
    head = [
        f'"""A controller tuned by Twinloop {__version__}: one call of `command` a period of {signals.dt:g} s."""',
        "",
        "import math",
        "",
        *(f"# {one}" for one in in_words(signals)),
        f"STATES = {signals.state_names!r}",
        f"COMMANDS = {signals.command_names!r}",
        f"GAINS = {family.parameters(genes)!r}",
        "",
    ]
    body = [f"            {line.target} = {line.value}" for line in lines]
    return "\n".join([
        *head, _PYTHON_HELPERS, "",
        "class Controller:", '    """One controller with its memory."""', "",
        "    def __init__(self):", "        self.reset()", "",
        "    def reset(self):", '        """Forgets the run so far."""',
        f"        self._memory, self._sent = [0.0] * {memory}, {rest!r}", "",
        "    def command(self, state, target):",
        '        """What to send for the coming period, within the bounds, for a measured state and a target.',
        "",
        *(f"        {line}" for line in _missing(signals, rest, missed)),
        '        """',
        "        for what, given in (('state', state), ('target', target)):",
        "            if len(given) != len(STATES):",
        "                expected = f\"{len(STATES)} numbers ({', '.join(STATES)})\"",
        "                raise ValueError(f\"command: {what}: expected {expected}, found {len(given)}\")",
        f"        memory, command = self._memory.copy(), [0.0] * {signals.n_u}",
        f"        if not finite([{', '.join(_read(lines))}]):",
        f"            {repeating}",
        "        try:",
        *body,
        "        except (ArithmeticError, ValueError):",
        f"            {repeating}",
        f"        if not finite([*memory, {', '.join(sheet.wanted)}]):",
        f"            {repeating}",
        "        self._memory, self._sent = memory, command.copy()",
        "        return command", "",
        "    def _repeated(self):",
        *([] if missed is None else [f"        self._memory[{missed}] += 1.0"]),
        "        return self._sent.copy()", "",
    ])  # fmt: skip


def controller_c(
    described: UnboundFamily, family: Family, genes: Floats, name: str, precision: str = "double"
) -> tuple[str, str]:
    """A controller as a header and a source file of C99.

    Args:
        described: the family as a user wrote it.
        family: the same, bound.
        genes: gains (size,).
        name: what its functions begin with.
        precision: "double" or "float".

    Returns:
        The header, and what it declares.

    Raises:
        NotAvailable: a family that cannot be written down.
    """
    sheet = _sheet(described, family, genes)
    lines, memory, missed = sheet.lines, sheet.memory, sheet.missed
    signals, big, rest = family.signals, name.upper(), _at_rest(described, family.signals)
    n_u = signals.n_u
    gains = [f"   {key} = {value!r}" for key, value in family.parameters(genes).items()]
    declared = (
        f"void {name}_command({name}_memory *memory_, const {name}_real state[{signals.n_x}],\n"
        f"    const {name}_real target[{signals.n_x}], {name}_real command[{signals.n_u}])"
    )
    header = "\n".join([
        f"/* A controller tuned by Twinloop {__version__}: one call a period of {signals.dt:g} s, no allocation.",
        f"   States: {', '.join(signals.state_names)}", *(f"   {one}" for one in in_words(signals)),
        f"   Commands: {', '.join(signals.command_names)}",
        "   Gains:", *gains, "*/",
        f"#ifndef {big}_H", f"#define {big}_H", "",
        *BEGIN_C,
        f"typedef {precision} {name}_real;", "",
        f"typedef struct {{\n    {name}_real values[{max(1, memory)}];\n    {name}_real sent[{n_u}];",
        f"}} {name}_memory;", "",
        "/* Forgets the run so far. */", f"void {name}_reset({name}_memory *memory_);", "",
        "/* What to send for the coming period, within the bounds, for a measured state and a target.", "",
        *(f"   {line}" for line in _missing(signals, rest, missed)),
        "   Compile without -ffast-math, which takes every number for finite. */",
        f"{declared};", "", *END_C, "#endif", "",
    ])  # fmt: skip
    body = []
    for line in lines:
        place = line.target.startswith(("memory[", "command["))
        value = DECIMAL.sub(r"\1f", line.value) if precision == "float" else line.value
        text = f"    {'' if place else 'const real '}{line.target} = {value};"
        body.append(text)
    text = "\n".join(body)
    helpers = [helper for key, helper in _c_helpers(precision).items() if f"{key}(" in text]
    read, usable = _read(lines), [f"all_finite(memory, {memory})"] if memory else []
    usable += [f"isfinite({wanted})" for wanted in sheet.wanted]
    source = "\n".join([
        f"/* Written by Twinloop {__version__}; see {name}.h. */", f'#include "{name}.h"', "", "#include <math.h>", "",
        "#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__",
        '#error "Compile this file without -ffast-math: a missing reading is NaN, and has to be seen."', "#endif", "",
        f"typedef {name}_real real;", "", *helpers, _FINITE,
        f"static void repeated({name}_memory *memory_, real *command)", "{",
        *([] if missed is None else [f"    memory_->values[{missed}] += 1;"]),
        *_looped(n_u, "command[i] = memory_->sent[i];"), "}", "",
        declared, "{",
        f"    const real given[{len(read)}] = {{{', '.join(read)}}};",
        *([f"    real memory[{memory}];"] if memory else []),
        *_repeating(f"!all_finite(given, {len(read)})"),
        *(_looped(memory, "memory[i] = memory_->values[i];") if memory else []),
        text,
        *_repeating(f"!({' && '.join(usable)})"),
        *(_looped(memory, "memory_->values[i] = memory[i];") if memory else []),
        *_looped(n_u, "memory_->sent[i] = command[i];"), "}", "",
        f"void {name}_reset({name}_memory *memory_)", "{",
        *_looped(max(1, memory), "memory_->values[i] = 0;"),
        *(f"    memory_->sent[{j}] = {number(value, precision)};" for j, value in enumerate(rest)), "}", "",
    ])  # fmt: skip
    return header, source


def _missing(signals: Signals, rest: Sequence[float], missed: int | None) -> list[str]:
    """What becomes of a reading that is missing, for whoever calls the controller."""
    before = ", ".join(
        f"{command.name} {value:g}" for command, value in zip(signals.commands, rest, strict=True)
    )
    return [
        "Where a number that the law needs is not finite, as a missing reading is, it repeats its last command,",
        "and remembers nothing of the call; before the first usable reading it sends what it sends without any error:",
        f"{before}. It does so for as long as the reading is missing: stop the system if that lasts.",
        *(
            []
            if missed is None
            else ["A rate that it makes of readings itself is then one over so many more periods."]
        ),
    ]


_FINITE = """static int all_finite(const real *values, int count)
{
    for (int i = 0; i < count; ++i) {
        if (!isfinite(values[i])) {
            return 0;
        }
    }
    return 1;
}
"""


def _repeating(condition: str) -> list[str]:
    return [f"    if ({condition}) {{", "        repeated(memory_, command);", "        return;", "    }"]


def _looped(count: int, statement: str) -> list[str]:
    return [f"    for (int i = 0; i < {count}; ++i) {{", f"        {statement}", "    }"]


def _c_helpers(precision: str) -> dict[str, str]:
    f = "f" if precision == "float" else ""

    def written(name: str, arguments: str, value: str) -> str:
        return f"static real {name}({arguments})\n{{\n    return {value};\n}}\n"

    return {
        "clip": written("clip", "real a, real low, real high", "a < low ? low : a > high ? high : a"),
        "wrapped": written("wrapped", "real a, real period", f"a - rint{f}(a / period) * period"),
        "signed_power": written(
            "signed_power", "real a, real power", f"copysign{f}(pow{f}(fabs{f}(a), power), a)"
        ),
        "chosen": written("chosen", "real test, real a, real b", "test > 0 ? a : b"),
        "pushing": written(
            "pushing",
            "real push, real command, real low, real high",
            "(push > 0 && command >= high) || (push < 0 && command <= low) ? 1 : 0",
        ),
    }

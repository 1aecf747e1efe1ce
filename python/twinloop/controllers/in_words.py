"""A controller in words: the formulas of one period, for a person who sets its gains in a program of their own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from twinloop.controllers.cascade import Cascade
from twinloop.controllers.family import Family, UnboundFamily
from twinloop.controllers.mixer import Mixer
from twinloop.controllers.pid import PID
from twinloop.controllers.state_feedback import StateFeedback
from twinloop.signals import Signals


def formulas(described: UnboundFamily, family: Family) -> list[str]:
    """What a controller computes in each period, a line for each formula, in this order.

    `clip(v, low, high)` stands for the nearest number within bounds; how others are meant, such as `∫e_x` for the
    integral of `e_x`, `reading_rules` says. A term of a gain that is fixed at 0 is left out.

    Args:
        described: the family as a user wrote it.
        family: the same, bound.

    Returns:
        The lines; none where the law is not known, as that of a class in Python.
    """
    if isinstance(described, StateFeedback):
        return list(_of_states(described, family))
    if isinstance(described, (PID, Cascade)):
        return list(_of_axes(described, family))
    return []


def reading_rules(described: UnboundFamily, signals: Signals, lines: Sequence[str]) -> list[str]:
    """Sentences that say how the formulas of a controller are meant.

    Args:
        described: the family as a user wrote it.
        signals: of it.
        lines: its formulas.
    """
    text, period = "\n".join(lines), f"{signals.dt:g} s"
    said = []
    if "∫" in text:
        said.append(f"∫e is the sum of e times {period} since the test began, this period's included.")
        if isinstance(described, (PID, Cascade)) and described.anti_windup:
            said.append(
                "An integral stays as it was before a period in which a command is at a bound and the step of the"
                " integral pushes it further out."
            )
    if ")/dt" in text:
        said.append("d(x)/dt is a reading less the one before, over the period; 0 in the first period.")
    if isinstance(described, (PID, Cascade)) and "filtered(" in text:
        share = signals.dt / (signals.dt + described.derivative_filter)
        said.append(
            f"filtered(r) begins with r, and moves by {share:.4g} of the way to r in each period after it."
        )
    if "signed_power(" in text:
        said.append("signed_power(v, p) is |v|^p with the sign of v.")
    if "turned(" in text:
        said.append("turned(e) is e the shorter way round.")
    return said


def _of_axes(described: PID | Cascade, family: Family) -> Iterator[str]:
    signals = family.signals
    outputs = _outputs(described.output, signals, [f"u_{angle}" for angle, _ in described.axes])
    asked = {}
    for (angle, rate), output in zip(described.axes, outputs, strict=True):
        led, slope = angle, f"d({angle})/dt" if rate is None else rate
        if isinstance(described, Cascade):
            assert rate is not None and described.rate_limits is not None
            led, slope, limit = rate, f"d({rate})/dt", described.rate_limits.get(rate, math.inf)
            yield f"e_{angle} = {_error(angle, signals)}"
            point = f"{angle}.kp * e_{angle} + target of {rate}"
            yield f"wanted_{rate} = " + (
                f"clip({point}, {-limit:.9g}, {limit:.9g})" if math.isfinite(limit) else point
            )
            yield f"e_{led} = wanted_{rate} - {rate}"
        else:
            yield f"e_{led} = {_error(angle, signals)}"
        slope = f"filtered({slope})" if described.derivative_filter > 0.0 else slope
        terms = {f"{led}.kp": f"e_{led}", f"{led}.ki": f"∫e_{led}", f"{led}.kd": slope}
        signs = {f"{led}.kd": "-"}
        asked[output] = _sum(
            (signs.get(gain, "+"), f"{gain} * {of}")
            for gain, of in terms.items()
            if family.fixed.get(gain) != 0.0
        )
    yield from _sent(described.output, signals, asked)


def _of_states(described: StateFeedback, family: Family) -> Iterator[str]:
    signals = family.signals
    states = signals.state_names if described.states is None else described.states
    for name in dict.fromkeys((*states, *described.integral)):
        yield f"e_{name} = {_error(name, signals)}"
    count = signals.n_u if described.output is None else described.output.matrix.shape[1]
    sources = {name: f"e_{name}" for name in states}
    sources |= {f"{name}.integral": f"∫e_{name}" for name in described.integral}
    asked = {}
    for output in _outputs(described.output, signals, [f"u{j + 1}" for j in range(count)]):
        gains = {f"{source}->{output}": of for source, of in sources.items()}
        asked[output] = _sum(
            ("+", f"({gain}) * {of}") for gain, of in gains.items() if family.fixed.get(gain) != 0.0
        )
    yield from _sent(described.output, signals, asked)


def _outputs(mixer: Mixer | None, signals: Signals, names: Sequence[str]) -> Sequence[str]:
    """What the outputs of a law are called: the commands, where there is no mixer."""
    return signals.command_names if mixer is None else names


def _error(name: str, signals: Signals) -> str:
    """The error of a state, of an angle the shorter way round."""
    error = f"target of {name} - {name}"
    return error if signals.states[signals.state_names.index(name)].period is None else f"turned({error})"


def _sent(mixer: Mixer | None, signals: Signals, asked: Mapping[str, str]) -> Iterator[str]:
    """What is asked for, and the commands, clipped to their bounds."""
    if mixer is not None:
        yield from (f"{output} = {value}" for output, value in asked.items())
    for j, command in enumerate(signals.commands):
        low, high = command.bounds
        value = asked[command.name] if mixer is None else _mixed(mixer, j, list(asked))
        yield f"{command.name} = clip({value}, {low:.9g}, {high:.9g})"


def _mixed(mixer: Mixer, row: int, outputs: Sequence[str]) -> str:
    """A command of what the outputs ask for, not clipped yet."""
    assert mixer.offset is not None  # __post_init__ has set it
    shares = zip(mixer.matrix[row].tolist(), outputs, strict=True)
    parts = [
        ("-" if share < 0.0 else "+", f"{abs(share):.9g} * {output}") for share, output in shares if share
    ]
    offset = float(mixer.offset[row])
    if offset:
        parts.append(("-" if offset < 0.0 else "+", f"{abs(offset):.9g}"))
    value = _sum(parts)
    return value if mixer.power == 1.0 else f"signed_power({value}, {mixer.power:.9g})"


def _sum(parts: Iterator[tuple[str, str]] | Sequence[tuple[str, str]]) -> str:
    """Signed parts as a sum; 0 where there are none."""
    text = " ".join(f"{sign} {part}" for sign, part in parts)
    return text.removeprefix("+ ") or "0"

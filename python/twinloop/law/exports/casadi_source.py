"""A law as a Python file that builds CasADi functions, for optimal control and sensitivities."""

from __future__ import annotations

from twinloop._core import __version__
from twinloop.law.exports.python_source import layout, outputs_source
from twinloop.law.exports.sensor_source import reading_source
from twinloop.law.exports.step_source import step_source
from twinloop.law.law import Law
from twinloop.law.writing import Dialect

CASADI = Dialect(
    {
        "abs": "ca.fabs({})",
        "sqrt": "ca.sqrt(ca.fabs({}))",
        "min": "ca.fmin({}, {})",
        "max": "ca.fmax({}, {})",
        **{function: f"ca.{function}({{}})" for function in ("sin", "cos", "tanh", "exp")},
        "upright": "_upright({})",
    },
    division="_divided({}, {})",
)

_HELPERS = '''
def _divided(a, b):
    """Protected: a where b is all but 0; neither branch divides by 0, nor do their derivatives."""
    return a / ca.if_else(ca.fabs(b) > 1e-6, b, 1.0)


def _wrapped(a, period):
    """An angle within half a period of 0."""
    return ca.remainder(a, period)


def _upright(a):
    """A cosine of the pitch, kept from 0."""
    return ca.if_else(ca.fabs(a) >= 1e-3, a, ca.copysign(1e-3, a))
'''

_EFFECTS = '''
def _on_its_way(held, arrived, lag, rate):
    """The effect of a command half a period later: it moves at the rate, if there is one, until the lag is slower."""
    time, off = 0.5 * DT, arrived - held
    lagging = arrived + (held - arrived) * (math.exp(-time / lag) if lag > 0.0 else 0.0)
    if rate == 0.0:
        return lagging
    beyond = ca.fabs(off) - rate * lag
    fading = ca.exp(-(time - ca.fmin(beyond / rate, time)) / lag) if lag > 0.0 else 0.0
    limited = ca.if_else(
        beyond >= rate * time,
        held + ca.sign(off) * (rate * time),
        arrived - ca.sign(off) * (rate * lag) * fading,
    )
    return ca.if_else(beyond > 0.0, limited, lagging)


def _levels(seen):
    """What fills each hidden state."""
    return [
        sum(seen[i] * seen[i] if squared else seen[i] for i in commands) * (1.0 / len(commands))
        for commands, squared, _, _ in HIDDEN
    ]


def _start(u):
    """What is remembered before the first command u: queues, effects, hidden states and their levels at rest."""
    held = [value if rest is None else rest for value, rest in zip(u, RESTS)]
    queues = [value for value, delay in zip(held, DELAYS) for _ in range(delay)]
    levels = _levels([value * (1.0 / scale) for value, scale in zip(u, SCALES)])
    rests = [level if rest is None else rest for level, (_, _, rest, _) in zip(levels, HIDDEN)]
    return [*queues, *held, *[0.0] * len(HIDDEN), *rests]


def _effects(memory, u):
    """Effects of commands and hidden states at start, middle and end of a period, and what is remembered then."""
    memory, queues, ends_, hidden_ = list(memory), [], [], []
    arrived = []
    for value, delay in zip(u, DELAYS):
        waiting = [*memory[:delay], value]
        del memory[:delay]
        arrived.append(waiting[0])
        queues += waiting[1:]
    held, memory = memory[: len(u)], memory[len(u) :]
    hidden, rests = memory[: len(HIDDEN)], memory[len(HIDDEN) :]
    starts, middles, ends = [], [], []
    for before, value, lag, rate, scale in zip(held, arrived, LAGS, FASTEST, SCALES):
        start = before if lag > 0.0 or rate > 0.0 else value
        middle = _on_its_way(start, value, lag, rate)
        end = _on_its_way(middle, value, lag, rate)
        ends_.append(end)
        for seen, effect in zip((starts, middles, ends), (start, middle, end)):
            seen.append(effect * (1.0 / scale))
    levels = _levels([value * (1.0 / scale) for value, scale in zip(u, SCALES)])
    for start, level, rest, (_, _, _, time) in zip(hidden, levels, rests, HIDDEN):
        kept = math.exp(-0.5 * DT / time)
        added = (level - rest) * (time * (1.0 - kept))
        middle = start * kept + added
        hidden_.append(middle * kept + added)
        for seen, value in zip((starts, middles, ends), (start, middle, hidden_[-1])):
            seen.append(value)
    return (starts, middles, ends), [*queues, *ends_, *hidden_, *rests]
'''

_ANGLES = '''
def _angles(a, b, c, d, before):
    """Roll, pitch and yaw, by whole turns the nearest to what they were."""
    across, up = 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d
    roll = ca.atan2(across, up)
    pitch = ca.atan2(-2.0 * (b * d - a * c), ca.sqrt(across * across + up * up))
    yaw = ca.atan2(2.0 * (b * c + a * d), a * a + b * b - c * c - d * d)
    over = ca.cos(before[1]) < 0.0
    turned = (roll + math.pi, math.pi - pitch, yaw + math.pi)
    chosen = [ca.if_else(over, other, angle) for angle, other in zip((roll, pitch, yaw), turned)]
    return [old - ca.remainder(old - new, math.tau) for old, new in zip(before, chosen)]
'''

_NUMBERS = """
def _choose(condition, this, other):
    return ca.if_else(condition, this, other)


def _root(a):
    return ca.sqrt(a)


def _cosine(a):
    return ca.cos(a)


def _sinc(a):
    return ca.if_else(a == 0.0, 1.0, ca.sin(a) / ca.if_else(a == 0.0, 1.0, a))
"""

_READ = '''
_past = ca.SX.sym("past", PAST)
_reading, _later = _read(ca.vertsplit(_x), ca.vertsplit(_past))
read = ca.Function(
    "read", [_x, _past], [ca.vertcat(*_reading), ca.vertcat(*_later)], ["x", "past"], ["reading", "past_next"]
)
"""What the sensors read at the state x, and what they remember then; before the first state all of that is 0."""


def readings(states):
    """What the sensors read of a run, the first state of which is where it began."""
    found, past = [], [0.0] * PAST
    for x in states:
        reading, past = read(x, past)
        found.append(reading.full().ravel().tolist())
    return found
'''

_FUNCTIONS = '''
_x, _u = ca.SX.sym("x", len(STATES)), ca.SX.sym("u", len(COMMANDS))
_remembered = _start(ca.vertsplit(_u))
_memory = ca.SX.sym("memory", len(_remembered))
_seen, _next = _effects(ca.vertsplit(_memory), ca.vertsplit(_u))

start = ca.Function("start", [_u], [ca.vertcat(*_remembered)], ["u"], ["memory"])
"""What is remembered before the first command u of a run."""
step = ca.Function(
    "step",
    [_x, _u, _memory],
    [ca.vertcat(*_step(ca.vertsplit(_x), *_seen)), ca.vertcat(*_next)],
    ["x", "u", "memory"],
    ["x_next", "memory_next"],
)
"""The state a period after x, under commands u within their bounds, and what is remembered then."""


def simulate(initial_state, commands):
    """The states of a free run, the first one among them; what lies beyond a bound of a command is clipped."""
    states, memory = [[float(value) for value in initial_state]], None
    for u in commands:
        clipped = [min(max(value, low), high) for value, (low, high) in zip(u, BOUNDS)]
        memory = start(clipped) if memory is None else memory
        following, memory = step(states[-1], clipped, memory)
        states.append(following.full().ravel().tolist())
    return states
'''


def casadi_source(law: Law) -> str:
    """A law as a Python file that imports CasADi.

    Args:
        law: of a twin.

    Returns:
        A module with `start`, `step` (CasADi functions of one period) and `simulate(initial_state, commands)`; where
        sensors are late or early also `read` and `readings(states)`.
    """
    head = [
        f'"""A twin of {", ".join(law.signals.state_names)}, learnt by Twinloop {__version__}, as CasADi functions.',
        "",
        "`start(u)` is what is remembered before a run, `step(x, u, memory)` one period of it.",
        '"""',
        "",
        "import math",
        "",
        "import casadi as ca",
        "",
        *layout(law, actuated=True),
    ]
    sines = "ca.sin, ca.cos"
    steps = step_source(law, sines, _ANGLES)
    outputs = outputs_source(law, CASADI, ("ca", "math"))
    sensors = [reading_source(law, sines, _ANGLES, _NUMBERS), _READ] if any(law.offsets) else []
    return "\n".join(["\n".join(head) + "\n", _HELPERS, outputs, steps, _EFFECTS, _FUNCTIONS, *sensors])

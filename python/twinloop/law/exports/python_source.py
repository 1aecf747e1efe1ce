"""A law as a stand-alone Python module, which needs nothing but Python."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from twinloop._core import __version__
from twinloop.law.exports.left_out import left_out
from twinloop.law.exports.sensor_source import sensor_layout, sensor_source
from twinloop.law.exports.step_source import step_source
from twinloop.law.forms import DERIVATIVES, EULER
from twinloop.law.law import Law
from twinloop.law.writing import EXACT, Dialect, Term, Writer, free_prefix

PYTHON = Dialect(
    {
        "abs": "abs({})",
        "sqrt": "math.sqrt(abs({}))",
        "sin": "_sin({})",
        "cos": "_cos({})",
        "tanh": "math.tanh({})",
        "exp": "_exp({})",
        "min": "_min({}, {})",
        "max": "_max({}, {})",
        "upright": "_upright({})",
    },
    division="_divided({}, {})",
)

_HELPERS = '''
def _one_each(what, names, values):
    """The values as a list: one for each of the named signals, or an error."""
    values = list(values)
    if len(values) != len(names):
        expected = ", ".join(name for name, _ in names)
        raise ValueError(f"{what}: expected {len(names)} numbers ({expected}), found {len(values)}")
    return values


def _divided(a, b):
    """Protected: a where b is all but 0."""
    return a / b if abs(b) > 1e-6 else a


def _min(a, b):
    return a if a < b else b


def _max(a, b):
    return a if a > b else b


def _sin(a):
    return math.sin(a) if math.isfinite(a) else math.nan


def _cos(a):
    return math.cos(a) if math.isfinite(a) else math.nan


def _exp(a):
    try:
        return math.exp(a)
    except OverflowError:
        return math.inf


def _wrapped(a, period):
    """An angle within half a period of 0."""
    return a - round(a / period) * period if math.isfinite(a) else math.nan


def _upright(a):
    """A cosine of the pitch, kept from 0."""
    return a if abs(a) >= 1e-3 else math.copysign(1e-3, a)
'''

_ACTUATED = '''
def _on_its_way(held, arrived, lag, rate):
    """The effect of a command half a period later: it moves at the rate, if there is one, until the lag is slower."""
    time, beyond = 0.5 * DT, abs(arrived - held) - rate * lag
    if rate == 0.0 or beyond <= 0.0:
        return arrived + (held - arrived) * (math.exp(-time / lag) if lag > 0.0 else 0.0)
    if beyond >= rate * time:
        return held + math.copysign(rate * time, arrived - held)
    fading = math.exp(-(time - beyond / rate) / lag) if lag > 0.0 else 0.0
    return arrived - math.copysign(rate * lag, arrived - held) * fading


class Twin:
    """The twin from period to period; it remembers what its actuators and hidden states hold."""

    def __init__(self):
        self.reset()

    def reset(self):
        """Begins a run: the next command is the first one."""
        self._started = False

    def step(self, x, u):
        """The state a period after the state x, under the commands u."""
        x, u = _one_each("step: x", STATES, x), _one_each("step: u", COMMANDS, u)
        starts, middles, ends = self._effects(u)
        return _step(x, starts, middles, ends)

    def _effects(self, u):
        """Commands in effect, in units of their scales, and hidden states: at start, middle and end of the period."""
        if not self._started:
            self._held = [value if rest is None else rest for value, rest in zip(u, RESTS)]
            self._queues = [[held] * delay for held, delay in zip(self._held, DELAYS)]
            self._hidden = [0.0] * len(HIDDEN)
            self._levels = [None] * len(HIDDEN)
            self._started = True
        starts, middles, ends = [], [], []
        for i, value in enumerate(u):
            self._queues[i].append(value)
            arrived = self._queues[i].pop(0)
            start = self._held[i] if LAGS[i] > 0.0 or FASTEST[i] > 0.0 else arrived
            middle = _on_its_way(start, arrived, LAGS[i], FASTEST[i])
            end = _on_its_way(middle, arrived, LAGS[i], FASTEST[i])
            self._held[i] = end
            for seen, effect in zip((starts, middles, ends), (start, middle, end)):
                seen.append(effect * (1.0 / SCALES[i]))
        for j, (commands, squared, rest, time) in enumerate(HIDDEN):
            given = [u[i] * (1.0 / SCALES[i]) for i in commands]
            level = sum(value * value if squared else value for value in given) * (1.0 / len(given))
            if self._levels[j] is None:
                self._levels[j] = level if rest is None else rest
            kept = math.exp(-0.5 * DT / time)
            added = (level - self._levels[j]) * (time * (1.0 - kept))
            start = self._hidden[j]
            middle = start * kept + added
            self._hidden[j] = middle * kept + added
            for seen, value in zip((starts, middles, ends), (start, middle, self._hidden[j])):
                seen.append(value)
        return starts, middles, ends
'''

_DIRECT = '''
class Twin:
    """The twin from period to period; its commands act at once, and it remembers nothing."""

    def reset(self):
        """Begins a run."""

    def step(self, x, u):
        """The state a period after the state x, under the commands u."""
        x, u = _one_each("step: x", STATES, x), _one_each("step: u", COMMANDS, u)
        seen = [value * (1.0 / scale) for value, scale in zip(u, SCALES)]
        return _step(x, seen, seen, seen)
'''

_SIMULATE = '''
def simulate(initial_state, commands):
    """The states of a free run, the first one among them; what lies beyond a bound of a command is clipped."""
    twin, states = Twin(), [_one_each("simulate: initial_state", STATES, initial_state)]
    for k, row in enumerate(commands):
        u = _one_each(f"simulate: row {k} of commands", COMMANDS, row)
        clipped = [min(max(value, low), high) for value, (low, high) in zip(u, BOUNDS)]
        states.append(twin.step(states[-1], clipped))
    return states
'''

_ANGLES = '''
def _angles(a, b, c, d, before):
    """Roll, pitch and yaw, by whole turns the nearest to what they were."""
    across, up = 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d
    roll = math.atan2(across, up)
    pitch = math.atan2(-2.0 * (b * d - a * c), math.sqrt(across * across + up * up))
    yaw = math.atan2(2.0 * (b * c + a * d), a * a + b * b - c * c - d * d)
    if _cos(before[1]) < 0.0:
        roll, pitch, yaw = roll + math.pi, math.pi - pitch, yaw + math.pi
    turns = [(old - new) / math.tau for old, new in zip(before, (roll, pitch, yaw))]
    return [
        angle + math.tau * (round(turn) if math.isfinite(turn) else turn)
        for angle, turn in zip((roll, pitch, yaw), turns)
    ]
'''


def python_source(law: Law) -> str:
    """A law as Python.

    Args:
        law: of a twin.

    Returns:
        A module with `simulate(initial_state, commands)`, a class `Twin` with `reset` and `step`, and what the sensors
        read: `readings(states)` and a class `Sensors` with `reset` and `read`.
    """
    direct = not law.actuation.remembers
    head = [
        f'"""A twin of {", ".join(law.signals.state_names)}, learnt by Twinloop {__version__}.',
        "",
        "It needs nothing but Python.",
        "",
        "`simulate(initial_state, commands)` is a free run, `Twin().step(x, u)` one period of it;",
        "`readings(states)` is what the sensors read of a run.",
        '"""',
        "",
        "import math",
        "",
        *layout(law, actuated=not direct),
    ]
    steps = step_source(law, "_sin, _cos", _ANGLES)
    parts = [
        "\n".join(head) + "\n",
        _HELPERS,
        outputs_source(law, PYTHON, ("math", "abs", "min", "max")),
        steps,
    ]
    sensors = sensor_source(law, "_sin, _cos", _ANGLES)
    return "\n".join([*parts, _DIRECT if direct else _ACTUATED, _SIMULATE, sensors])


def layout(law: Law, actuated: bool) -> list[str]:
    """What a law's signals and actuators are, as assignments in Python.

    Args:
        law: of a twin.
        actuated: whether actuators and hidden states are written, too.
    """
    signals, actuators = law.signals, law.actuation.actuators
    lines = [
        f"STATES = {tuple((state.name, state.unit) for state in signals.states)!r}  # names and units",
        f"COMMANDS = {tuple((command.name, command.unit) for command in signals.commands)!r}",
        f"BOUNDS = {tuple(command.bounds for command in signals.commands)!r}  # of the commands, in their units",
        f"SCALES = {tuple(command.size for command in signals.commands)!r}  # what the equations see as 1",
        f"DT = {signals.dt!r}  # s, a period",
    ]
    if actuated:
        limits = tuple(
            each.rate(command.size) for each, command in zip(actuators, signals.commands, strict=True)
        )
        lines += [
            f"LAGS = {tuple(actuator.lag for actuator in actuators)!r}  # s, of each command",
            f"FASTEST = {limits!r}  # rate at most, a second; 0: any",
            f"DELAYS = {tuple(actuator.delay for actuator in actuators)!r}  # periods",
            f"RESTS = {tuple(actuator.rest for actuator in actuators)!r}  # at the start; None: the first one",
            f"HIDDEN = {tuple(tuple(each[:4]) for each in law.actuation.hidden)!r}"
            "  # commands that fill it, whether squared, level at rest, time (s)",
        ]
    lines += [
        f"# {name} is read {offset:+.6g} s after the states that the equations drive."
        for name, offset in zip(signals.state_names, law.offsets, strict=True)
        if offset != 0.0
    ]
    lines += [f"# {line}." for line in left_out(law)]
    lines += sensor_layout(law)
    if law.form == "acceleration" and signals.kinematics is not None:
        lines.append(f"SUBSTEPS = {signals.substeps}  # of the integrator, in a period")
    if (law.form == "acceleration" or any(law.offsets)) and signals.kinematics is not None:
        body, place = signals.kinematics, signals.state_names.index
        lines += [
            f"ANGLES = {tuple(map(place, body.angles))!r}  # roll, pitch and yaw",
            f"RATES = {tuple(map(place, body.rates))!r}  # of the body",
        ]
    return lines


def equation_roots(law: Law) -> tuple[int, ...]:
    """Nodes of what the equations give: derivatives of all states, or outputs.

    Args:
        law: of a twin.
    """
    return law.derivatives() if law.form in DERIVATIVES else law.outputs


def stepped_roots(law: Law) -> tuple[int, ...]:
    """The same for a step: with a form of Euler what it adds.

    Where the angles of a rigid body go on as a quaternion, 0 stands for their derivatives.

    Args:
        law: of a twin.
    """
    if law.form in EULER:
        return law.increments()
    body = law.signals.kinematics
    if law.form != "acceleration" or body is None:
        return equation_roots(law)
    nothing = law.expressions.constant(0.0)
    return tuple(
        nothing if name in body.angles else node
        for name, node in zip(law.signals.state_names, law.derivatives(), strict=True)
    )


def joined(terms: Sequence[Term], between: str) -> str:
    """A sum, a term a line where it is long.

    Args:
        terms: of it.
        between: what stands before each further line.
    """
    first, *rest = terms
    text = ("-" if first[0] == "-" else "") + first[1]
    size = len(text) + sum(len(term) + 3 for _, term in rest)
    return text + "".join(f"{between if size > 80 else ' '}{sign} {term}" for sign, term in rest)


def free_symbols(symbols: Sequence[str], taken: Collection[str]) -> list[str]:
    """Names of variables, other ones for those that are taken, or begin as names of the export's own do.

    Args:
        symbols: of a law.
        taken: names that mean something else.
    """
    found: list[str] = []
    for symbol in symbols:
        name = f"of{symbol}" if symbol.startswith("_") else symbol
        while name in taken or name in found or (name != symbol and name in symbols):
            name += "_"
        found.append(name)
    return found


def outputs_source(law: Law, dialect: Dialect, taken: Sequence[str]) -> str:
    """What the equations give, as a function of Python.

    Args:
        law: of a twin.
        dialect: how operations are written.
        taken: names that these use.
    """
    roots = stepped_roots(law)
    symbols = free_symbols(law.symbols, taken)
    writer = Writer(law.expressions, roots, symbols, EXACT, free_prefix(symbols), True, dialect)
    states, seen = symbols[: law.signals.n_x], symbols[law.signals.n_x :]
    lines = [
        "",
        "def _outputs(_state, _seen):",
        '    """What the equations give at a state and at commands in effect, in units of their scales."""',
        f"    {', '.join(states)}, = _state",
        f"    {', '.join(seen)}, = _seen",
    ]
    lines += [
        f"    {symbol} = _wrapped({symbol}, {state.period!r})"
        for symbol, state in zip(states, law.signals.states, strict=True)
        if state.period is not None
    ]
    lines += [
        f"    {name} = ({joined(writer.terms(number, define=True), chr(10) + ' ' * 8)})"
        for number, name in writer.names.items()
    ]
    lines += [
        "    return [",
        *(f"        {joined(writer.terms(root), chr(10) + ' ' * 8)}," for root in roots),
        "    ]",
    ]
    return "\n".join(lines) + "\n"

"""What late and early sensors read of a run, as the text of Python functions: `crates/twinloop-core/src/sensors.rs`."""

from __future__ import annotations

import math

from twinloop.law.exports.step_source import attitude_source
from twinloop.law.law import Law

_IN_TIME = '''
class Sensors:
    """What the sensors read at each state of a run in turn: every state as it is."""

    def reset(self):
        """Begins a run."""

    def read(self, x):
        """What is read at the state x."""
        return list(x)
'''

_COASTED = '''
def _coasted(x, rates, time):
    """The state some time later (before 0: earlier) by kinematics alone, at these rates."""
    found = list(x)
    for i, rate in enumerate(RATE_OF):
        factor, order = 1.0, 1.0
        while rate is not None:
            factor = factor * time / order
            found[i] = found[i] + rates[rate] * factor
            rate, order = RATE_OF[rate], order + 1.0
    return {coasted}


def _between(before, after, share):
    """What lies between two states a period apart: the cubics through both and through their rates."""
    rest = 1.0 - share
    values = (rest * rest * (1.0 + 2.0 * share), share * share * (3.0 - 2.0 * share))
    slopes = (DT * share * rest * rest, -DT * share * share * rest)

    def cubic(a, a_rate, b, b_rate):
        return a * values[0] + b * values[1] + a_rate * slopes[0] + b_rate * slopes[1]

    found = [
        b if rate is None else cubic(a, before[rate], b, after[rate]) for a, b, rate in zip(before, after, RATE_OF)
    ]
    return {between}
'''

_ATTITUDE = '''
def _turning(attitude, rates):
    """How body rates turn a quaternion."""
    (a, b, c, d), (p, q, r) = attitude, (0.5 * rate for rate in rates)
    return [-(b * p + c * q + d * r), a * p + c * r - d * q, a * q - b * r + d * p, a * r + b * q - c * p]


def _put(found, attitude, before):
    """The state with the angles of an attitude, by whole turns the nearest to what they were."""
    found = list(found)
    for i, angle in zip(ANGLES, _angles(*attitude, before)):
        found[i] = angle
    return found


def _turned(found, x, rates, time):
    before, spin = [x[i] for i in ANGLES], [rates[i] for i in RATES]
    attitude = _quaternion(*before)
    half = _root(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]) * (0.5 * time)
    slope, cosine, sine = _turning(attitude, spin), _cosine(half), _sinc(half)
    return _put(found, [part * cosine + rate * sine * time for part, rate in zip(attitude, slope)], before)


def _turned_between(found, before, after, cubic):
    angles = [before[i] for i in ANGLES]
    begun, ended = _quaternion(*angles), _quaternion(*[after[i] for i in ANGLES])
    # A quaternion and its negative are the same attitude.
    sign = _choose(sum(a * b for a, b in zip(begun, ended)) < 0.0, -1.0, 1.0)
    ended = [sign * part for part in ended]
    first, last = _turning(begun, [before[i] for i in RATES]), _turning(ended, [after[i] for i in RATES])
    return _put(found, [cubic(*parts) for parts in zip(begun, first, ended, last)], angles)
'''

_READ = '''
def _read(x, past):
    """What is read at the state x, and what is remembered then: how many states, the first one, and the last ones."""
    x, size = list(x), len(STATES)
    count, parts = past[0], [past[1 + k * size : 1 + (k + 1) * size] for k in range(REACH + 1)]
    first, recent = [_choose(count < 0.5, new, old) for new, old in zip(x, parts[0])], parts[1:]
    states, reading = [x, *recent], list(x)
    for periods, places in OFFSETS:
        if periods < 0.0:
            # Its mean rates over that time, going on as they did over the last period.
            gone = _choose(count < 0.5, 0.0, -0.5 * periods)
            rates = [
                now + (now - then) * gone if driven else now for now, then, driven in zip(x, recent[0], DRIVEN)
            ]
            found = _coasted(x, rates, -periods * DT)
        else:
            back = math.ceil(periods)
            within = states[back]
            if back > periods:
                within = _between(states[back], states[back - 1], back - periods)
            before = _coasted(first, first, (count - periods) * DT)
            found = [_choose(count < periods, early, late) for early, late in zip(before, within)]
        for i in places:
            reading[i] = found[i]
    return reading, [count + 1.0, *first, *(value for state in states[:-1] for value in state)]
'''

_SENSORS = '''
class Sensors:
    """What the sensors read at each state of a run in turn, some of them late or early."""

    def __init__(self):
        self.reset()

    def reset(self):
        """Begins a run: the next state is the first one; before it nothing changed but by its rates."""
        self._past = [0.0] * PAST

    def read(self, x):
        """What is read at the state x."""
        reading, self._past = _read(x, self._past)
        return reading
'''

_READINGS = '''
def readings(states):
    """What the sensors read of a run, the first state of which is where it began."""
    sensors = Sensors()
    sensors.reset()
    return [sensors.read(x) for x in states]
'''

_NUMBERS = """
def _choose(condition, this, other):
    return this if condition else other


def _root(a):
    return math.sqrt(a) if a == a else math.nan


def _cosine(a):
    return _cos(a)


def _sinc(a):
    return _sin(a) / a if a != 0.0 else 1.0
"""


def groups(law: Law) -> list[tuple[float, tuple[int, ...]]]:
    """Offsets other than 0 in periods, each with the states that are read so much later.

    Args:
        law: of a twin.
    """
    found: dict[float, list[int]] = {}
    for place, offset in enumerate(law.offsets):
        if offset != 0.0:
            found.setdefault(offset / law.signals.dt, []).append(place)
    return [(periods, tuple(places)) for periods, places in found.items()]


def reach(law: Law) -> int:
    """Periods before now that sensors look back.

    Args:
        law: of a twin.
    """
    return max([1, *(math.ceil(periods) for periods, _ in groups(law))])


def rates(law: Law) -> tuple[int | None, ...]:
    """The place of each state's declared derivative; None where there is none.

    Args:
        law: of a twin.
    """
    of = {state.derivative_of: place for place, state in enumerate(law.signals.states) if state.derivative_of}
    return tuple(of.get(name) for name in law.signals.state_names)


def sensor_layout(law: Law) -> list[str]:
    """What sensors are late by, as assignments in Python; none where all are in time.

    Args:
        law: of a twin.
    """
    if not any(law.offsets):
        return []
    driven = tuple(place in law.signals.driven for place in range(law.signals.n_x))
    size, back = law.signals.n_x, reach(law)
    return [
        f"OFFSETS = {tuple(groups(law))!r}  # periods by which states are read later, and which",
        f"RATE_OF = {rates(law)!r}  # place of each state's derivative",
        f"DRIVEN = {driven!r}  # whether nothing but the equations moves it",
        f"REACH = {back}  # periods that sensors look back",
        f"PAST = {1 + size * (1 + back)}  # numbers that they remember",
    ]


def reading_source(law: Law, sines: str, angles: str, numbers: str = _NUMBERS) -> str:
    """The function `_read(x, past)`, and what it calls; nothing where all sensors are in time.

    Args:
        law: of a twin.
        sines: names of the functions sine and cosine, comma-separated.
        angles: the function `_angles`, as for `step_source`.
        numbers: the functions `_choose`, `_root`, `_cosine` and `_sinc`.
    """
    if not any(law.offsets):
        return ""
    body = law.signals.kinematics is not None
    parts = [numbers]
    if body:
        # With accelerations the step has brought them already.
        parts += [] if law.form == "acceleration" else [attitude_source(sines, angles)]
        parts.append(_ATTITUDE)
    coasted = "_turned(found, x, rates, time)" if body else "found"
    between = "_turned_between(found, before, after, cubic)" if body else "found"
    return "\n".join([*parts, _COASTED.format(coasted=coasted, between=between), _READ])


def sensor_source(law: Law, sines: str, angles: str) -> str:
    """The class `Sensors` and the function `readings(states)`.

    Args:
        law: of a twin.
        sines: names of the functions sine and cosine, comma-separated.
        angles: the function `_angles`, as for `step_source`.
    """
    if not any(law.offsets):
        return "\n".join([_IN_TIME, _READINGS])
    return "\n".join([reading_source(law, sines, angles), _SENSORS, _READINGS])

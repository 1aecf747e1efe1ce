"""The step of a period as the text of Python functions: what each form of a law does with what its equations give."""

from __future__ import annotations

from twinloop.law.law import Law

_STEPS = {
    "absolute": '''
def _step(x, start, middle, end):
    """The next state."""
    return _outputs(x, middle)
''',
    "increment": '''
def _step(x, start, middle, end):
    """The state and what is added to it."""
    return [value + added for value, added in zip(x, _outputs(x, middle))]
''',
    "explicit-euler": '''
def _step(x, start, middle, end):
    """One explicit Euler step."""
    return [value + added for value, added in zip(x, _outputs(x, start))]
''',
    "semi-implicit-euler": '''
def _step(x, start, middle, end):
    """One semi-implicit Euler step."""
    return [value + added for value, added in zip(x, _outputs(x, start))]
''',
    "acceleration": '''
def _step(x, start, middle, end):
    """One Runge-Kutta step of order four."""
    return _integrated(_outputs, x, DT, start, middle, end)
''',
}

_INTEGRATED = """
def _along(a, b, share):
    return [first + share * second for first, second in zip(a, b)]


def _integrated(slope, x, dt, start, middle, end):
    first = slope(x, start)
    second = slope(_along(x, first, 0.5 * dt), middle)
    third = slope(_along(x, second, 0.5 * dt), middle)
    fourth = slope(_along(x, third, dt), end)
    return [
        value + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        for value, a, b, c, d in zip(x, first, second, third, fourth)
    ]
"""

_QUATERNION = """
def _quaternion(roll, pitch, yaw):
    (sr, sp, sy), (cr, cp, cy) = ([f(0.5 * angle) for angle in (roll, pitch, yaw)] for f in ({sines}))
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
"""

_TURNED = '''
def _part_of(start, middle, end, share):
    """Inputs at a share of a period: the parabola through those at its start, middle and end."""
    a, b, c = (1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)
    return [a * first + b * second + c * third for first, second, third in zip(start, middle, end)]


def _step(x, start, middle, end):
    """Runge-Kutta steps of order four; the attitude goes on as a quaternion, for which no pitch is singular."""
    before = [x[i] for i in ANGLES]

    def seen(y):
        states = list(y[:-4])
        for i, angle in zip(ANGLES, _angles(*y[-4:], before)):
            states[i] = angle
        return states

    def slope(y, u):
        states, (a, b, c, d) = seen(y), y[-4:]
        p, q, r = (0.5 * states[i] for i in RATES)
        turning = [-(b * p + c * q + d * r), a * p + c * r - d * q, a * q - b * r + d * p, a * r + b * q - c * p]
        return [*_outputs(states, u), *turning]

    y = [*x, *_quaternion(*before)]
    for part in range(SUBSTEPS):
        places = [(part + share) / SUBSTEPS for share in (0.0, 0.5, 1.0)]
        y = _integrated(slope, y, DT / SUBSTEPS, *[_part_of(start, middle, end, place) for place in places])
    return seen(y)
'''


def step_source(law: Law, sines: str, angles: str) -> str:
    """The function `_step(x, start, middle, end)` of a period, and what it calls beside `_outputs`.

    Args:
        law: of a twin.
        sines: names of the functions sine and cosine, comma-separated.
        angles: the function `_angles(a, b, c, d, before)`: roll, pitch and yaw of a quaternion, by whole turns the
            nearest to what they were.
    """
    if law.form != "acceleration":
        return _STEPS[law.form]
    if law.signals.kinematics is None:
        return "\n".join([_INTEGRATED, _STEPS[law.form]])
    return "\n".join([_INTEGRATED, attitude_source(sines, angles), _TURNED])


def attitude_source(sines: str, angles: str) -> str:
    """The functions `_quaternion(roll, pitch, yaw)` and `_angles`.

    Args:
        sines: names of the functions sine and cosine, comma-separated.
        angles: the function `_angles`, as for `step_source`.
    """
    return "\n".join([_QUATERNION.format(sines=sines), angles])

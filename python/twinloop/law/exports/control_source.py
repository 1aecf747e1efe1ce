"""A law as a Python file that builds a nonlinear system of python-control."""

from __future__ import annotations

from twinloop.law.exports.python_source import python_source
from twinloop.law.law import Law

_NOTHING_REMEMBERED = '''
_MEMORY = []


def _recalled(memory):
    """A twin; it remembers nothing."""
    return Twin()


def _remembered(twin):
    return []
'''

_REMEMBERED = '''
_MEMORY = [
    "started",
    *(f"effect_{name}" for name, _ in COMMANDS),
    *(f"waiting_{name}_{k}" for (name, _), delay in zip(COMMANDS, DELAYS) for k in range(delay)),
    *(f"{kind}_{j}" for kind in ("hidden", "level") for j in range(len(HIDDEN))),
]


def _recalled(memory):
    """A twin that remembers what a state of the system holds; all 0: nothing yet."""
    twin, values = Twin(), iter(memory)
    if next(values) > 0.0:
        twin._started = True
        twin._held = [next(values) for _ in DELAYS]
        twin._queues = [[next(values) for _ in range(delay)] for delay in DELAYS]
        twin._hidden = [next(values) for _ in HIDDEN]
        twin._levels = [next(values) for _ in HIDDEN]
    return twin


def _remembered(twin):
    queues = [value for queue in twin._queues for value in queue]
    return [1.0, *twin._held, *queues, *twin._hidden, *twin._levels]
'''

_SYSTEM = '''
def _update(time, states, commands, parameters):
    """What follows a period later: the states of the twin, then what it remembers."""
    x, memory, past = _parts(states)
    twin = _recalled(memory)
    clipped = [min(max(float(value), low), high) for value, (low, high) in zip(commands, BOUNDS)]
    following = twin.step(x, clipped)
    return np.array([*following, *_remembered(twin), *_seen(x, past)[1]])


def _outputs_of(time, states, commands, parameters):
    """The states of the twin, then what late sensors read of them."""
    x, _, past = _parts(states)
    return np.array([*x, *_seen(x, past)[0]])


def _parts(states):
    values, size, known = [float(value) for value in states], len(STATES), len(STATES) + len(_MEMORY)
    return values[:size], values[size:known], values[known:]


system = control.nlsys(
    _update,
    _outputs_of,
    inputs=[name for name, _ in COMMANDS],
    outputs=[*(name for name, _ in STATES), *(f"{STATES[i][0]}_read" for i in _LATE)],
    states=[
        *(f"{name}_state" for name, _ in STATES),
        *(f"memory_{name}" for name in _MEMORY),
        *(f"past_{k}" for k in range(_PAST)),
    ],
    dt=DT,
    name="twin",
)
"""In discrete time; its state is that of the twin, then what that remembers, which is 0 before a run."""
'''


_IN_TIME = '''
_LATE, _PAST = (), 0


def _seen(x, past):
    """What late sensors read, and what they remember: none is late."""
    return [], []
'''

_LATE = '''
_LATE, _PAST = tuple(sorted(i for _, places in OFFSETS for i in places)), PAST


def _seen(x, past):
    """What late sensors read, and what they remember then."""
    reading, later = _read(x, past)
    return [reading[i] for i in _LATE], later
'''


def control_source(law: Law) -> str:
    """A law as a Python file that imports python-control.

    Args:
        law: of a twin.

    Returns:
        The module of `python_source` with `system`, a `control.NonlinearIOSystem` whose outputs are the states
        and, by names that end in `_read`, what late sensors read of them.
    """
    text = python_source(law)
    text = text.replace("\nimport math\n", "\nimport math\n\nimport control\nimport numpy as np\n", 1)
    text = text.replace(
        "It needs nothing but Python.", "`system` is a nonlinear system of python-control.", 1
    )
    remembered = _REMEMBERED if law.actuation.remembers else _NOTHING_REMEMBERED
    return "\n".join([text, remembered, _LATE if any(law.offsets) else _IN_TIME, _SYSTEM])

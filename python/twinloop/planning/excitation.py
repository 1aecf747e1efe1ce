"""Excitation: gentle chirps on the commands that fade out, so that a flight tells more than its task.

While no law is known, the controller says how strongly they begin, and what the states answer how far they grow.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.elementary import exp, log, sin
from twinloop.controllers import Family
from twinloop.signals import Signals

SLOWEST, FASTEST = (0.5, 2.0), (4.0, 10.0)
"""Cycles per flight at which a chirp begins and ends, the range that is drawn from."""
SHORTEST = 8.0
"""Periods of a cycle at least: faster ones look like noise to a model in steps."""
SHARE = 0.08
"""Share of the envelope that a state must be off for a controller to answer the first excitation."""
FIRST = (2.0, 4.0)
"""Cycles per flight at which the chirps of such a flight begin: slower ones are where loops resonate."""
ENTERING = 0.1
"""Share of such a flight, at its beginning, over which its excitation grows from nothing."""
GROWTH = 8.0
"""Ratio of its excitation at the end, before it fades, to that at the beginning."""
MOST_GROWTHS = 64
"""Flights after which an excitation has long been at its most."""
NEARBY = 1.0 / 1024.0
"""Share of the envelope by which a state is off where the answer of a controller is asked for: a power of two."""
USUAL = 0.625
"""Place of all gains in their box where a family is asked what its controllers do: in the middle many gains are 0."""
UNUSED = 1e-6
"""Share of the strongest direction in command space, squared, below which a controller has no use for one."""


def growing_chirps(
    signals: Signals,
    along: tuple[Floats, Floats],
    steps: int,
    amplitude: float,
    most: float,
    fade: float,
    stream: _core.Stream,
    flights: int = 0,
) -> Floats:
    """Chirps for a flight of a system of which no law is known: only the controller is.

    A controller that one trusts is made for the authority of its commands: ten times the authority, a tenth of the
    gain. So each direction has a chirp of the size that the controller itself would send along it for states that are
    off by `SHARE` of their envelopes; where it sends nothing, the smallest of the others. How much more the system
    bears, the flight itself shows: the chirps grow from cycle to cycle, and are held back once the states answer. A
    flight that has borne them lets the next begin half-way to where it ended, in factors, and go on as far again.

    Args:
        signals: of the system.
        along: `directions` of the controller that flies, with what it sends along them.
        steps: of the test.
        amplitude: at which the first flight begins, at most, in units of each command's scale.
        most: amplitude at the end of any flight, at most.
        fade: share of the flight, at its end, over which the chirps fade to nothing.
        stream: of random numbers.
        flights: before this one that have borne such an excitation.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    vectors, answers = along
    first = np.minimum(amplitude, SHARE * answers)
    first = np.where(answers > 0.0, first, first.min(where=answers > 0.0, initial=amplitude))
    # The task itself moves the states most at its beginning: what is borne at its end may be too much there.
    steps_up = min(flights, MOST_GROWTHS)
    growths = sqrt(GROWTH**steps_up), GROWTH ** (steps_up + 1)
    begin, end = (np.maximum(first, np.minimum(first * growth, most)) for growth in growths)
    passed = np.arange(steps)[:, np.newaxis] / steps
    entering = np.minimum(1.0, passed / ENTERING)
    into = np.clip((passed - ENTERING) / max(1.0 - fade - ENTERING, 1.0 / steps), 0.0, 1.0)
    swings = _swings(signals, steps, len(answers), fade, stream, FIRST)
    swings *= entering * begin * exp(log(end / begin) * into)
    added = np.zeros((steps, signals.n_u))
    for swing, vector in zip(swings.T, vectors, strict=True):
        added += swing[:, np.newaxis] * vector
    sent: Floats = added * np.array([command.size for command in signals.commands])
    return sent


def swing_of(duration: float) -> float:
    """Seconds in which a state that swings with the slowest of such chirps covers its amplitude at its largest rate.

    Args:
        duration: of the flight, s.
    """
    return duration / (2.0 * np.pi * FIRST[0])


def directions(family: Family, genes: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Directions in command space, and what a controller at rest sends along them.

    Args:
        family: of the controllers.
        genes: of one of them (size,).
        target: around which it is asked (n_x,).

    Returns:
        Unit vectors, a row each, in scales of the commands (n_u, n_u). For each, what is sent at most for states that
        are off by their envelopes (by the scale, where a state has none), all together as one unit vector (n_u,): the
        singular values; 0 where the controller has no use for a direction.
    """
    values, vectors, used = _principal(slopes(family, genes, target))
    return vectors, np.sqrt(np.where(used, values, 0.0))


def directions_for(
    family: Family, genes: Floats, target: Floats, states: Sequence[int]
) -> tuple[Floats, Floats]:
    """Directions in which controllers of a family answer to some states, and what one of them sends along each.

    That one may not answer to them at all: its gains for them may be 0.

    Args:
        family: of the controllers.
        genes: of one of them (size,).
        target: around which it is asked (n_x,).
        states: that are off.

    Returns:
        As `directions` does, of those that are used alone (d, n_u) and (d,).
    """
    own, usual = (slopes(family, each, target)[:, list(states)] for each in (genes, usual_genes(family)))
    norms = [float(np.sqrt(np.square(sent).sum())) for sent in (own, usual)]
    alike = [sent / (norm or 1.0) for sent, norm in zip((own, usual), norms, strict=True)]
    _, vectors, used = _principal(np.concatenate(alike, axis=1))
    answers = np.sqrt(np.square((vectors[used][:, :, np.newaxis] * own).sum(axis=1)).sum(axis=1))
    return vectors[used], np.where(answers > sqrt(UNUSED) * norms[0], answers, 0.0)


def _principal(sent: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Squares of a matrix's singular values (n,), its left singular vectors, a row each, and which values are not 0."""
    values, vectors = _core.eigen((sent[:, np.newaxis, :] * sent[np.newaxis, :, :]).sum(axis=2))
    used = values > UNUSED * values[-1] if values[-1] > 0.0 else np.zeros(len(values), bool)
    return values, vectors, used


def usual_genes(family: Family) -> Floats:
    """Gains (size,) of a controller that does what controllers of a family do: hardly any of them is 0."""
    return family.from_unit(np.full(family.size, USUAL))


def slopes(family: Family, genes: Floats, target: Floats) -> Floats:
    """What a controller at rest sends for an error (n_u, n_x), in scales of the commands for shares of the envelope."""
    columns = []
    scales = np.array([command.size for command in family.signals.commands])
    for i in range(family.signals.n_x):
        answers = [
            family.controller(genes).command(off_by(family.signals, i, target, share), target)
            for share in (NEARBY, -NEARBY)
        ]
        columns.append((answers[0] - answers[1]) / (2.0 * NEARBY * scales))
    return np.stack(columns, axis=1)


def off_by(signals: Signals, place: int, target: Floats, share: float = NEARBY) -> Floats:
    """A target (n_x,) from which one state is off by a share of half its envelope, of its scale where it has none."""
    state, reading = signals.states[place], target.copy()
    half = state.scale if state.envelope is None else 0.5 * (state.envelope[1] - state.envelope[0])
    reading[place] += share * half
    return reading


def chirps(signals: Signals, steps: int, amplitude: float, fade: float, stream: _core.Stream) -> Floats:
    """A chirp for each command.

    Args:
        signals: of the system.
        steps: of the test.
        amplitude: in units of each command's scale.
        fade: share of the flight, at its end, over which the chirps fade to nothing.
        stream: of random numbers.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    sizes = amplitude * np.array([command.size for command in signals.commands])
    return _swings(signals, steps, signals.n_u, fade, stream, SLOWEST) * sizes


def binary(signals: Signals, steps: int, amplitude: float, fade: float, stream: _core.Stream) -> Floats:
    """A pseudo-random binary sequence for each command, faded likewise: a baseline for tests.

    Args:
        signals: of the system.
        steps: of the test.
        amplitude: in units of each command's scale.
        fade: share of the flight, at its end, over which the sequences fade to nothing.
        stream: of random numbers.

    Returns:
        What is to be added to the commands (steps, n_u), in their units.
    """
    held = max(1, steps // 20)
    signs = np.where(stream.uniforms(steps // held + 1, signals.n_u) < 0.5, -1.0, 1.0)
    sizes = np.array([command.size for command in signals.commands])
    fading = _fading(signals, steps, fade)[:, np.newaxis]
    added: Floats = amplitude * sizes * np.repeat(signs, held, axis=0)[:steps] * fading
    return added


def _swings(
    signals: Signals, steps: int, count: int, fade: float, stream: _core.Stream, slowest: tuple[float, float]
) -> Floats:
    """Chirps of amplitude 1, faded, which begin with so many cycles per flight (steps, count)."""
    duration = steps * signals.dt
    t = signals.dt * np.arange(steps)
    fading = _fading(signals, steps, fade)
    columns = []
    for _ in range(count):
        first = stream.uniform(*slowest) / duration
        last = min(stream.uniform(*FASTEST) / duration, 1.0 / (SHORTEST * signals.dt))
        phase = stream.uniform(0.0, 2.0 * np.pi)
        angle = 2.0 * np.pi * (first * t + (last - first) * t * t / (2.0 * duration)) + phase
        columns.append(sin(angle) * fading)
    return np.array(columns).reshape(count, steps).T


def _fading(signals: Signals, steps: int, fade: float) -> Floats:
    """1, and towards the end of a flight down to 0 over a share of it (steps,)."""
    duration = steps * signals.dt
    left = duration - signals.dt * np.arange(steps)
    return np.clip(left / max(fade * duration, signals.dt), 0.0, 1.0)

"""Candidate flights, judged on a committee or on the truth: how well they go, how much they would tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, Integers, floats
from twinloop.controllers import Family
from twinloop.signals import Signals

__all__ = ["candidates", "disagreements", "qualities", "quality"]


def candidates(
    family: Family,
    genes: ArrayLike,
    initial_states: ArrayLike,
    target_states: ArrayLike,
    steps: int,
    *,
    excitation: ArrayLike | None = None,
    hold_back: HoldBack | None = None,
    limits: Limits | None = None,
) -> _core.Flights:
    """K flights of one length, laid out for the engine once and judged as often as needed.

    Args:
        family: of the controllers.
        genes: gains (K, size), in their units.
        initial_states: of each flight (K, n_x), or of all (n_x,), SI units, radians.
        target_states: of each flight (K, n_x), or of all (n_x,), the same units; or a row for each state of each
            flight (K, n + 1, n_x).
        steps: number of commands of each, n.
        excitation: signal that is added to the commands of each flight (K, n, n_u), in their units; None: no
            excitation.
        hold_back: holds the excitation of all flights back; None: it is not held back.
        limits: magnitudes at which a flight has diverged; None: ten times each state's scale.

    Returns:
        The engine's flights.

    Raises:
        InvalidInput: shapes that do not fit, or numbers that are not finite.
    """
    n_x = family.signals.n_x
    rows = floats("Flights, genes (candidates, gains)", genes, (None, family.size))
    return _core.Flights(
        (limits or Limits(family.signals)).setting(family.engine),
        rows,
        _states("Flights, initial states", initial_states, len(rows), n_x),
        _states("Flights, target states", target_states, len(rows), n_x, steps),
        steps,
        excitation=excitation,
        hold_back=None if hold_back is None else hold_back.engine,
    )


def quality(kind: str, weights: ArrayLike, *, effort: float = 0.0, effort_rate: float = 0.0) -> _core.Quality:
    """The quality of a flight, to be minimised: its error plus the cost of its commands.

    Args:
        kind: "iae", Σ_k dt Σ_i w_i |x_i(k + 1) − target_i|; "ise", the same with squares;
            "final_distance", √(Σ_i w_i (x_i(n) − target_i)²).
        weights: of each state, w (n_x,), at least 0.
        effort: factor of Σ_k dt Σ_j (u_j / scale_j)², at least 0.
        effort_rate: factor of Σ_k Σ_j ((u_j(k) − u_j(k − 1)) / scale_j)² / dt from the second command on.

    Returns:
        The engine's quality.

    Raises:
        InvalidInput: an unknown kind, or numbers that are negative or not finite.
    """
    return _core.Quality(kind, weights, effort=effort, effort_rate=effort_rate)


def qualities(
    dynamics: Sequence[_core.Model] | _core.Quadrotor,
    flights: _core.Flights,
    measure: _core.Quality,
    signals: Signals,
    *,
    noise: ArrayLike | None = None,
    offsets: ArrayLike | None = None,
    disturbances: ArrayLike | None = None,
    measured: bool = False,
    workers: _core.Workers | None = None,
) -> tuple[Floats, Floats]:
    """Flies every candidate on every member, under every draw of noise.

    The draws are the same for all candidates and members: common random numbers.

    Args:
        dynamics: m members of a committee; or a built-in plant, for oracles (m = 1).
        flights: K candidates.
        measure: their quality.
        signals: of the system, with its envelope.
        noise: D draws of the sensor noise (D, n + 1, n_x), in the units of the states; None: perfect sensors.
        offsets: D draws of a change of the initial state (D, n_x); None: no change.
        disturbances: D draws of what moves the true state after each step (D, n, n_x); None: nothing does.
        measured: whether qualities are of the readings, as in a record of the flight, or of the true states.
        workers: threads of the engine; one by default.

    Returns:
        Qualities (m, max(D, 1), K), and usages of the envelope in the same shape: the largest |x − middle| /
        half-width over the true states with an envelope, the first state included; 0 without an envelope. Both are
        infinite if the flight diverged.

    Raises:
        InvalidInput: members, weights or draws that do not fit the flights.
    """
    envelope = [state.envelope for state in signals.states]
    return _core.qualities(
        dynamics, flights, measure, envelope,
        noise=noise, offsets=offsets, disturbances=disturbances, measured=measured, workers=workers,
    )  # fmt: skip


def disagreements(
    models: Sequence[_core.Model],
    flights: _core.Flights,
    sds: ArrayLike,
    *,
    cap: float = 100.0,
    workers: _core.Workers | None = None,
) -> tuple[Floats, Integers]:
    """The disagreement of a committee on each flight, and where it is largest.

    The value is log det(I + D Dᵀ): row m of D is member m's noise-free trajectory minus the members' mean, each entry
    divided by the sd of its state and winsorised. It is summed over all steps and states and not divided by their
    number: if readings carry independent noise of these sds, it grows with the information of a flight about which
    member is right. A member that diverges keeps its last state within the limits.

    Args:
        models: m members.
        flights: K candidates.
        sds: unit of the differences in each state (n_x,), such as the standard deviation of its sensor, in its unit.
        cap: largest deviation from the mean that counts, in sds.
        workers: threads of the engine; one by default.

    Returns:
        Values (K,), to be maximised, 0 if all members agree; and (K, 4): the row (1 to n) and the state with the
        largest difference of two members in sds, the member with the largest value there and the member with the
        smallest; zeros if no two members differ.

    Raises:
        InvalidInput: no models, models for other signals, or sds that are not above 0.
    """
    return _core.disagreements(models, flights, sds, cap=cap, workers=workers)


def _states(what: str, states: ArrayLike, count: int, n_x: int, steps: int | None = None) -> Floats:
    if np.ndim(states) == 3 and steps is not None:
        return floats(what, states, (count, steps + 1, n_x))
    if np.ndim(states) == 1:
        return np.tile(floats(what, states, (n_x,)), (count, 1))
    return floats(what, states, (count, n_x))

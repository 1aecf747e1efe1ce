"""What a person should know of a model: what is left, what never moved, which laws the runs cannot tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.times import shown_time
from twinloop.identification.records import Run
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import BEST_SENSOR, exact
from twinloop.identification.terms.bounds import Limits
from twinloop.identification.terms.pool import Pool
from twinloop.law.law import hidden_names
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals

TWINS = 4.0
"""Description length within which two laws are equally good."""
STILL = 1e-9
"""Share of its scale by which a signal moves at most that never moved."""


def symbols_of(signals: Signals, pool: Pool, sums: Sequence[Sum]) -> list[str]:
    """What the inputs of a model are called in remarks: states, commands, the hidden states of some sums."""
    terms = {term for found in sums for subset in found.subsets for term in subset.terms}
    hidden = max((pool.reach(term) - pool.inputs for term in terms), default=0)
    return [*signals.state_names, *signals.command_names, *hidden_names(signals, max(1, hidden))]


def identities(found: Sum, pool: Pool, signals: Signals) -> list[Remark]:
    """The nearest other law that the runs cannot tell from this one: an identity that held on them.

    It is one of library terms: what evolved resembles a law somewhere, and tells a reader nothing.
    """
    symbols = symbols_of(signals, pool, [found])
    driven = signals.state_names[found.chain.states[0]]
    ours = set(found.weights)
    for subset, above in found.others:
        out, into = ours - set(subset), set(subset) - ours
        plain = all(node in pool.rungs for node in into)
        if above < TWINS and out and into and plain and len(out) + len(into) <= 6:
            gone, come = (
                ", ".join(
                    sorted("a constant" if node == pool.one else pool.text(node, symbols) for node in terms)
                )
                for terms in (out, into)
            )
            return [
                note(
                    "identity",
                    f"On these runs {driven} is described equally well with {come} in place of {gone}.",
                )
            ]
    return []


def held_at_bounds(
    sums: Sequence[Sum], bounds: Mapping[int, Limits], pool: Pool, signals: Signals, form: str
) -> list[Remark]:
    """Remarks on constants that the runs would have beyond their bounds.

    Args:
        sums: of the best model.
        bounds: for each driven state, bounds of coefficients by node.
        pool: of all expressions.
        signals: of the system.
        form: what the outputs mean; under "absolute" a sum is what is added to its state.

    Returns:
        One a constant that is at a bound.
    """
    symbols = symbols_of(signals, pool, sums)
    said = []
    for found in sums:
        state = found.chain.states[0]
        limits = bounds.get(state, {})
        for node, weight in found.weights.items():
            if node in limits and weight in limits[node]:
                value = weight + (form == "absolute" and node == state)
                said.append(
                    note(
                        "at-bound",
                        f"The constant of {pool.text(node, symbols)} in the equation of {symbols[state]} is held at its"
                        f" bound {value:g}: the runs alone would put it beyond; check that bound.",
                    )
                )
    return said


def late_sensors(offsets: Floats, driven: Sequence[int], signals: Signals) -> list[Remark]:
    """Remarks on sensors that are late or early.

    Args:
        offsets: delay of each state's readings against those of the driven states that are read in time (n_x,), s.
        driven: states that outputs drive.
        signals: of the system.

    Returns:
        One an offset.
    """
    names = np.array(signals.state_names)
    others = ", ".join(names[[i for i in driven if offsets[i] == 0.0]])
    return [
        note(
            "sensor-offset",
            f"Readings of {', '.join(names[offsets == offset])} come {shown_time(abs(offset))}"
            f" {'later' if offset > 0.0 else 'earlier'} than those of {others}; the twin is corrected"
            " for it.",
        )
        for offset in dict.fromkeys(offsets[offsets != 0.0].tolist())
    ]


def other_noise(observer: Sequence[Chain], signals: Signals) -> list[Remark]:
    """Remarks on sensors whose noise is far from what was declared.

    Args:
        observer: all chains, with their noise as it was estimated.
        signals: of the system.

    Returns:
        One a sensor that is more than twice or less than half as noisy; none where the runs give a limit only.
    """
    said = []
    for chain in observer:
        for i, state in enumerate(signals.states[number] for number in chain.states):
            found = float(np.sqrt(chain.sensors[i]))
            # An angle of a rigid body, or a sensor at the least noise that is believed: smaller noise looks the same.
            limit = (
                chain.output is None or chain.sensors[i] <= 1.5 * BEST_SENSOR * BEST_SENSOR * chain.rough[i]
            )
            if state.noise is None or (state.noise < found and limit):
                continue
            if not 0.5 <= found / state.noise <= 2.0:
                said.append(
                    note(
                        "declared-noise",
                        f"The noise of the sensor of {state.name} was declared as {state.noise:.3g} {state.unit} and"
                        f" found to be {found:.3g}; check the sensor and its unit, or remove the declaration.",
                    )
                )
    return said


def remarks(
    runs: Sequence[Run],
    pool: Pool,
    signals: Signals,
    sums: Sequence[Sum],
    chi_squared: float,
    readings: int,
    ignored: int,
) -> list[Remark]:
    """Remarks on what was learnt.

    Args:
        runs: as they were learnt from.
        pool: of all expressions.
        signals: of the system.
        sums: of the best model.
        chi_squared: χ² of its predictions.
        readings: that counted.
        ignored: readings that did not, for they were taken for outliers.

    Returns:
        Misfit, exact readings, states that never moved, identities, outliers; none where there is nothing to say.
    """
    said = []
    if not np.isfinite(chi_squared):
        said.append(
            serious(
                "diverges",
                "The model diverges on the runs that it was learnt from; fly another test before you trust it.",
            )
        )
    elif chi_squared > 2.0 * readings:
        said.append(
            serious(
                "misfit",
                f"The residuals are {chi_squared / readings:.3g} times the noise: there is an effect that no term"
                " describes.",
            )
        )
    elif exact(chi_squared / max(1, readings)):
        said.append(
            note(
                "exact",
                "The readings are almost exact: their noise is taken from the model's residuals.",
            )
        )
    still = [
        signals.state_names[i]
        for i in range(signals.n_x)
        if max(float(np.ptp(run.states[:, i])) for run in runs) <= STILL * signals.states[i].scale
    ]
    if still:
        said.append(_never_moved(still, runs, signals))
    said += [remark for found in sums for remark in identities(found, pool, signals)]
    if ignored:
        several = (
            f"{ignored} readings ignored as outliers." if ignored > 1 else "1 reading ignored as an outlier."
        )
        said.append(note("outliers", several))
    return said


def _never_moved(still: Sequence[str], runs: Sequence[Run], signals: Signals) -> Remark:
    """That some states never moved: a reason to look at the rig where commands did and nothing answered them."""
    sizes = np.array([command.size for command in signals.commands])
    sent = any(bool((np.ptp(run.commands, axis=0) > STILL * sizes).any()) for run in runs)
    if sent and len(still) == signals.n_x:
        return serious(
            "never-moved",
            f"Commands moved and nothing answered: {', '.join(still)} never moved. Sensors were off or are not"
            " logged, or no command reached the system; look there before you fly another test.",
        )
    return note("never-moved", f"{', '.join(still)} never moved: nothing could be learnt of what drives it.")

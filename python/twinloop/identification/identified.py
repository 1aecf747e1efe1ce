"""What was learnt from runs: a model, a committee, the terms and the noise behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import KINEMATIC, exact
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.records import Recorded
from twinloop.remarks import Remark
from twinloop.signals import Signals


@dataclass(eq=False)
class Identified(Recorded, kind="identified"):
    """What was learnt from runs.

    Args:
        model: the best one.
        members: of the committee, the best first.
        pool: of all expressions.
        sums: the terms that drive each chain.
        chains: with the noise of sensors and motion.
        actuation: lags, delays and hidden states between commands and model.
        offsets: by how much later than those of the driven states each state's readings were taken from it (n_x,), s.
        chi_squared: of the whitened prediction errors of the best model.
        readings: that counted.
        outliers: readings that were taken for such, and not learnt from.
        description_length: of the readings, by the innovations of the best model's observer.
        of_parts: whether members are there that parts of the only run have led to.
        remarks: what a person should know.
    """

    model: _core.Model
    members: list[_core.Model]
    pool: Pool
    sums: list[Sum]
    chains: list[Chain]
    actuation: Actuation
    offsets: Floats
    chi_squared: float
    readings: int
    outliers: int
    description_length: float
    of_parts: bool = False
    remarks: list[Remark] = field(default_factory=list)

    VERSION = 3
    RENAMED: ClassVar[Mapping[str, str]] = {
        "left": "chi_squared",
        "energy": "description_length",
        "ignored": "outliers",
    }

    @classmethod
    def from_record(cls, record: object, *given: object) -> Identified:
        """What a record was written of.

        Args:
            record: such as `to_record` gives, or JSON gives back.
            given: the signals of the system.

        Returns:
            The same, to the bit.

        Raises:
            InvalidInput: another kind, a newer version, an unknown or missing key, or values that do not fit together.
        """
        found = super().from_record(record, *given)
        signals = next(value for value in given if isinstance(value, Signals))
        states = {
            state for chain in (*found.chains, *(sum_.chain for sum_ in found.sums)) for state in chain.states
        }
        subsets = [subset.terms for sum_ in found.sums for subset in sum_.subsets]
        fits = (
            all(0 <= state < signals.n_x for state in states)
            and all(0 <= node < len(found.pool) for subset in subsets for node in subset)
            and found.offsets.shape == (signals.n_x,)
            and len(found.actuation.actuators) == signals.n_u
            and found.pool.inputs == signals.n_x + signals.n_u
            and len(found.members) > 0
        )
        if not fits:
            raise InvalidInput(
                "Record identified: expected states, commands and nodes that there are, found others; it belongs to"
                " other signals, or is damaged."
            )
        return found

    @property
    def terms(self) -> int:
        """Number of terms of the best model."""
        return sum(len(found.weights) for found in self.sums)

    @property
    def misfit(self) -> float:
        """χ² for each reading; 1 where only noise is left."""
        return self.chi_squared / max(1, self.readings)

    @property
    def exact(self) -> bool:
        """Whether the readings are almost exact."""
        return exact(self.misfit)

    def noise(self, signals: Signals) -> Noise:
        """Of the sensors, and of what moves the states from one period to the next."""
        moves = np.zeros(signals.n_x)
        for chain in self.chains:
            period = signals.dt if chain.integrated else 1.0
            # What stirs an angle beyond its sensor's noise is the disturbance of its rate, which moves it by itself.
            most = np.inf if chain.output is not None else KINEMATIC * float(chain.sensors[0])
            moves[chain.states[0]] = np.sqrt(min(chain.motion.white * period, most))
        correlated = [
            CorrelatedDisturbance(
                tuple(chain.states),
                chain.form,
                float(np.sqrt(chain.motion.correlated)),
                chain.motion.correlation_time,
            )
            for chain in self.chains
            if chain.motion.correlated > 0.0
        ]
        return Noise(self.sensors(signals.n_x), moves, tuple(correlated), signals.dt)

    def sensors(self, n_x: int) -> Floats:
        """Standard deviation of each state's sensor (n_x,)."""
        sds = np.zeros(n_x)
        for chain in self.chains:
            sds[list(chain.states)] = np.sqrt(chain.sensors)
        return sds

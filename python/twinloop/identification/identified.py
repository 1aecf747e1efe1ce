"""What was learnt from runs: a model, a committee, the terms and the noise behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput
from twinloop.identification.places import check_places
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.noise import KINEMATIC, exact
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.law.reports import late_in, reports_of
from twinloop.records import Recorded, beside
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
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Identified:
        found = super()._read(record, where, given)
        signals = beside(Signals, given, f"{where}.signals")
        check_places(where, signals, found.pool, found.sums, found.chains, found.actuation)
        if found.offsets.shape != (signals.n_x,) or not found.members:
            raise InvalidInput(
                f"Record {where}: expected offsets of {signals.n_x} states and a committee, found others; it belongs to"
                " other signals, or is damaged."
            )
        return found

    def late(self, signals: Signals) -> Floats:
        """Delay of each state's readings against those of the driven states that are read in time (n_x,), s."""
        ages = late_in(reports_of(self.model, signals.n_x), signals.n_x)
        return self.offsets + signals.dt * np.array(ages)

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

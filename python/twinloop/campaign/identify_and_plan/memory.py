"""What the preset `default` remembers: values that never change, with a plain form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from twinloop import _core
from twinloop._ground.arrays import Floats, at_least_zero
from twinloop.campaign.history import Experiment, Lesson
from twinloop.campaign.identify_and_plan.inside import INSIDE, inside
from twinloop.campaign.identify_and_plan.misses import FREE_RUN
from twinloop.campaign.identify_and_plan.two_laws import TwoLaws
from twinloop.identification.identified import Identified
from twinloop.identification.identify import UnderWay
from twinloop.law.noise import Noise
from twinloop.law.twin import Twin
from twinloop.records import Record, Recorded
from twinloop.test import Test


@dataclass(frozen=True, eq=False)
class Ensemble(Recorded, kind="ensemble"):
    """What the band of a twin is made of.

    Args:
        members: of the committee that follow the flights, the best first.
        noise: of the sensors, and what disturbs.
        inflation: factor on the spread of the members.
    """

    members: tuple[_core.Model, ...]
    noise: Noise
    inflation: float

    @staticmethod
    def of(twin: Twin) -> Ensemble:
        """What the band of a twin is made of."""
        assert twin.noise is not None
        return Ensemble(twin.members, twin.noise, twin.inflation)

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Ensemble:
        found = super()._read(record, where, given)
        at_least_zero(f"Record {where}.inflation", found.inflation)
        return found


@dataclass(frozen=True, eq=False)
class Learnt(Recorded, kind="learnt"):
    """What was learnt from the first experiments of a campaign.

    Args:
        experiments: number of these experiments.
        identified: the model, its committee and how they were found.
        believed: members of the committee that follow the flights, the best first.
        follows: whether the best model follows at least half of them in free run.
        needed: factors on the committees' spreads that the flights would have needed, each predicted before it was
            learnt.
        lessons: records of this identification and of those that it began with.
        gains: that were tuned on the committee when a test was asked for; None: none were.
        models: the best model of each identification, as `lessons`; what an older version wrote has none.
        ensembles: what the bands of those twins are made of; what an older version wrote has none.
        two_laws: of those identifications whose flights no law explains, the best model of either kind.
        rough: the law of linear terms that was held last beside one that does not explain the flights; None: none was.
        explained: whether a law explains the flights.
    """

    experiments: int
    identified: Identified
    believed: Sequence[_core.Model]
    follows: bool
    needed: tuple[float, ...]
    lessons: tuple[Lesson, ...]
    gains: Floats | None = None
    models: tuple[_core.Model, ...] = ()
    ensembles: tuple[Ensemble, ...] = ()
    two_laws: tuple[TwoLaws, ...] = ()
    rough: Identified | None = None
    explained: bool = True

    VERSION = 3
    RENAMED: ClassVar[Mapping[str, str]] = {"told": "experiments"}

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version: where no law explained the flights, two were kept of them."""
        found = super().renewed(record)
        two = found.get("two_laws")
        last = two[-1] if isinstance(two, list) and two else None
        compared = isinstance(last, dict) and last.get("experiments") == found.get("experiments")
        return {**found, "explained": not compared}

    @property
    def inside(self) -> bool:
        """Whether flights were learnt only as far as they were inside their envelope."""
        return any(remark.code == INSIDE for remark in self.lessons[-1].remarks)

    def flights(self, experiments: Sequence[Experiment]) -> Sequence[Experiment]:
        """Of experiments those that were learnt, as far as they were.

        Args:
            experiments: as they were told.
        """
        first = experiments[: self.experiments]
        return inside(first) if self.inside else first

    @property
    def misses(self) -> bool:
        """Whether the twin misses its own flights by more than noise and known disturbances explain."""
        return any(remark.code == FREE_RUN for remark in self.lessons[-1].remarks)


@dataclass(frozen=True, eq=False)
class Memory(Recorded, kind="memory_of_default"):
    """What the preset `default` remembers; all of it are values that never change.

    Args:
        asked: what was known when the last test was asked for. Learning begins here; looking at results in
            between changes nothing.
        latest: what was learnt last; it is what results show, and `ask` uses it if it covers all that was told.
        gains: tuned on the latest committee, behind the number of experiments and failures by then.
        best: the controller to fly, at the revision of the logbook that it was chosen at.
        under_way: an identification that is not finished, and of how many experiments it is.
        scores: of the gains that were judged, of a tuning on the latest committee that is not finished.
    """

    VERSION = 2

    asked: Learnt | None = None
    latest: Learnt | None = None
    gains: tuple[int, Floats] | None = None
    best: tuple[int, Test] | None = None
    under_way: tuple[int, UnderWay] | None = None
    scores: tuple[int, tuple[Floats, ...]] | None = None

"""Context: what an identification is given; it stays the same while hypotheses come and go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop._ground.steps import Watch, unwatched
from twinloop._ground.streams import Purpose, Unit
from twinloop.identification.identified import Identified
from twinloop.identification.records import Run
from twinloop.identification.search.walks import Walks
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.attitude import tilts
from twinloop.identification.terms.directions import Direction
from twinloop.identification.terms.pool import Pool
from twinloop.law.levels import Levels
from twinloop.law.reports import Reports
from twinloop.signals import Signals

SEARCHED_ANEW = 4
"""Runs up to which form, lags, delays and offsets are searched anew with each run."""
LONG_RUN = 1000
"""Periods from which one run shows what several shorter ones do."""


@dataclass(frozen=True, eq=False)
class Context:
    """What every proposal may read.

    Args:
        runs: as they were recorded, at least one.
        signals: of the system.
        options: of the identification.
        unit: of work; what is drawn for a hypothesis is a part of it.
        workers: how the work is carried out.
        rests: commands whose effect may be there at the start of a run (n_u,).
        axes: directions in which the controller moves alike commands.
        levels: in which commands of controllers are sent (n_u,); none where all are sent as they are.
        reports: what is given of readings (n_x,); none where all are given as they are.
        earlier: what was learnt from fewer runs.
        watch: called with each step that begins.
        as_integrated: whether chains that step bear what integration leaves, too: where forms are compared, what a
            derivative could not show is no evidence for them.
    """

    runs: Sequence[Run]
    signals: Signals
    options: IdentificationOptions
    unit: Unit
    workers: _core.Workers
    rests: Sequence[Floats] = ()
    axes: Sequence[Direction] = ()
    levels: Levels = ()
    reports: Reports = ()
    earlier: Identified | None = None
    watch: Watch = unwatched
    as_integrated: bool = False

    @cached_property
    def limits(self) -> Limits:
        """Where a simulated run counts as diverged."""
        return Limits(self.signals, self.options.divergence_factor)

    @property
    def settled(self) -> bool:
        """Whether form, lags, delays and offsets are kept as they were learnt earlier; lags are still tuned."""
        return self.earlier is not None and len(self.runs) > SEARCHED_ANEW

    @property
    def may_lag(self) -> bool:
        """Whether lags and delays are looked for."""
        return self.options.lags and not self.settled

    @property
    def several(self) -> bool:
        """Whether runs tell what is hidden from a function of time: several do, and a long one."""
        return len(self.runs) > 1 or len(self.runs[0].commands) >= LONG_RUN

    @property
    def may_hide(self) -> bool:
        """Whether a hidden state is looked for: in one short run it is a function of time, and that may be anything."""
        return self.options.hidden and self.several

    @property
    def may_store(self) -> bool:
        """Whether a hidden state that motion fills is looked for; not in one short run, as any other."""
        return self.options.storage and self.several

    @property
    def may_couple(self) -> bool:
        """Whether masses that joints share are looked for: in one short run poses are functions of time, as all is."""
        return self.several

    @property
    def known_terms(self) -> list[int]:
        """Terms of what was learnt earlier."""
        return [] if self.earlier is None else [node for found in self.earlier.sums for node in found.weights]

    def walks(self, unit: Unit, moves: int, starts: int = 1, purpose: Purpose = "subsets") -> Walks:
        """Walks over subsets of as many terms as the options allow.

        Args:
            unit: of work.
            moves: of each walk.
            starts: walks for each chain.
            purpose: of the random numbers.
        """
        return Walks(moves, self.options.largest, unit, starts, purpose)

    def first_pool(self) -> Pool:
        """A pool to begin with, nobody else's: what is entered in it does not change what was learnt earlier."""
        if self.earlier is not None:
            return self.earlier.pool.copy()
        return Pool(self.signals.n_x + self.signals.n_u, len(self.options.operators))

    def tilts(self, pool: Pool) -> list[int]:
        """How the pose of a rigid body turns what drives it, in a pool where its library has entered that."""
        return tilts(pool, self.signals) if "attitude" in self.options.libraries else []

    def under(self, form: str) -> Context:
        """The same once a form is believed: what was known under another one is no help."""
        earlier = self.earlier
        return replace(self, earlier=earlier if earlier is not None and earlier.model.form == form else None)

    def brief(self, runs: Sequence[Run]) -> Context:
        """The same for a short look at some runs, without what was learnt earlier."""
        return replace(self, runs=runs, options=self.options.brief(), earlier=None, watch=unwatched)

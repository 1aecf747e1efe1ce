"""Knowledge: what was learnt, as a twin and as the numbers that an engineer looks at."""

from __future__ import annotations

from dataclasses import dataclass, replace

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.examination.rivals import Rival
from twinloop.campaign.examination.unseen import TwinBefore
from twinloop.campaign.identify_and_plan.calibration import (
    OF_PARTS,
    factor,
    needed_factor,
    residuals_of_flights,
)
from twinloop.campaign.identify_and_plan.causes import observed
from twinloop.campaign.identify_and_plan.memory import Learnt
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.setup import Setup
from twinloop.campaign.twin_errors import errors_of
from twinloop.identification.remarks import symbols_of
from twinloop.law.twin import Twin


@dataclass(frozen=True)
class Knowledge:
    """Shows what was learnt, beside all that was told.

    Args:
        setup: of the campaign.
        book: of the campaign.
        learnt: from the first experiments.
        asked: what was known when the last test was asked for; None: nothing, or of no interest.
    """

    setup: Setup
    book: Logbook
    learnt: Learnt
    asked: Learnt | None = None

    def twin(self, workers: _core.Workers | None = None) -> Twin:
        """The best model, with the committee and the noise for its band.

        Args:
            workers: that work out its errors on all runs; None: they are of no interest.
        """
        learnt, found = self.learnt, self.learnt.identified
        noise = found.noise(self.setup.signals)
        errors = [] if workers is None else errors_of(found.model, self.book, workers, noise)
        inflation = OF_PARTS if found.of_parts else factor(learnt.needed)
        if found.exact:
            # What follows exact readings to rounding is the law: its members are too sure of nothing.
            residuals = residuals_of_flights(
                found.model, self.book.experiments[: learnt.experiments], self.setup.limits
            )
            noise, inflation = replace(noise, sensors=residuals), 1.0
        return Twin(
            found.model,
            self.setup.signals,
            errors,
            self.setup.limits,
            members=learnt.believed,
            noise=noise,
            seed=self.setup.seed,
            inflation=inflation,
            remarks=learnt.lessons[-1].remarks,
            follows=learnt.follows,
            flights=[run.trajectory for run in self.book.experiments],
        )

    def needed_factors(self) -> tuple[float, ...]:
        """Factors that the flights told since would have needed, after those before them."""
        learnt = self.learnt
        # A committee with parts in it says nothing of those that come after it.
        if learnt.identified.of_parts:
            return learnt.needed
        twin = self.twin()
        needed = [
            needed_factor(twin, run.replayed, run.trajectory)
            for run in self.book.experiments[learnt.experiments :]
        ]
        return (*learnt.needed, *(found for found in needed if found is not None))

    def twins_before(self) -> tuple[TwinBefore, ...]:
        """Twins that have not learnt all, with bands; models alone where an older version has not kept their parts."""
        limits, seed, latest = self.setup.limits, self.setup.seed, self.learnt
        experiments = (
            [lesson.iteration for lesson in latest.lessons[-len(latest.models) :]] if latest.models else []
        )
        found = {
            learnt: Twin(model, self.setup.signals, (), limits)
            for learnt, model in zip(experiments, latest.models, strict=True)
        }
        # Both end with what was learnt last.
        for learnt, ensemble in zip(reversed(experiments), reversed(latest.ensembles), strict=False):
            found[learnt] = Twin(
                found[learnt].model, self.setup.signals, (), limits,
                members=ensemble.members, noise=ensemble.noise, seed=seed, inflation=ensemble.inflation,
            )  # fmt: skip
        if self.asked is not None:
            found[self.asked.experiments] = replace(self, learnt=self.asked).twin()
        # Of today it is where flights were told that nobody has learnt yet.
        found[latest.experiments] = self.twin()
        return tuple(
            TwinBefore(learnt, found[learnt])
            for learnt in sorted(found)
            if learnt < len(self.book.experiments)
        )

    def innovations(self, workers: _core.Workers) -> tuple[Floats, ...] | None:
        """Whitened prediction errors of the twin's own filter; None of exact readings, which leave rounding alone.

        Args:
            workers: how the work is carried out.
        """
        learnt = self.learnt
        if learnt.identified.exact:
            return None
        flights, limits = learnt.flights(self.book.experiments), self.setup.limits
        found = observed(learnt.identified, flights, self.setup.signals, limits, workers)
        return None if found is None else tuple(errors for errors, _, _ in found)

    def rivals(self) -> tuple[Rival, ...]:
        """Subsets of terms that annealing has found nearly as good."""
        identified, signals = self.learnt.identified, self.setup.signals
        symbols = symbols_of(signals, identified.pool, identified.sums)
        return tuple(
            Rival(
                signals.state_names[found.chain.states[0]],
                tuple(sorted(identified.pool.text(node, symbols) for node in subset)),
                above,
            )
            for found in identified.sums
            for subset, above in found.subsets
            if above > 0.0 or subset == tuple(found.weights)
        )

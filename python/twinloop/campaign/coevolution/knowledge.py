"""Knowledge: the best trade-off as a twin; the paper knows no noise, and programs are no sums."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.coevolution.learning import Learning
from twinloop.campaign.examination.rivals import Rival
from twinloop.campaign.examination.unseen import TwinBefore
from twinloop.campaign.logbook import Logbook
from twinloop.campaign.setup import Setup
from twinloop.campaign.twin_errors import errors_of
from twinloop.law.twin import Twin


@dataclass(frozen=True)
class Knowledge:
    """Shows what was learnt, beside all that was told.

    Args:
        setup: of the campaign.
        book: of the campaign.
        learnt: last.
        asked: what was known when the last test was asked for.
    """

    setup: Setup
    book: Logbook
    learnt: Learning
    asked: Learning | None = None

    def twin(self, workers: _core.Workers | None = None) -> Twin:
        """The best trade-off.

        Args:
            workers: that work out its errors on all runs; None: they are of no interest.
        """
        model = self.learnt.models.best_model
        errors = [] if workers is None else errors_of(model, self.book, workers)
        flights = [run.trajectory for run in self.book.experiments]
        return Twin(model, self.setup.signals, errors, self.setup.limits, flights=flights)

    def twins_before(self) -> tuple[TwinBefore, ...]:
        """The best trade-off when the last test was asked for."""
        asked = self.asked
        if asked is None or len(asked.experiments) >= len(self.learnt.experiments):
            return ()
        twin = Twin(asked.models.best_model, self.setup.signals, (), self.setup.limits)
        return (TwinBefore(len(asked.experiments), twin),)

    def innovations(self, workers: _core.Workers) -> tuple[Floats, ...] | None:
        """None: no noise is known."""
        return None

    def rivals(self) -> tuple[Rival, ...]:
        """None: programs are no sums."""
        return ()

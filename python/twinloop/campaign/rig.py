"""What a campaign flies, and how many runs it had made at each experiment: the noise of some systems depends on it."""

from __future__ import annotations

from dataclasses import dataclass, field

from twinloop._ground.arrays import whole
from twinloop.guard.guarded import record_of, unguarded
from twinloop.records import Record, check_same


@dataclass
class Rig:
    """The system of a campaign, as far as another process has to know it.

    Args:
        system: its record; None where it has none.
        budget: runs on it in all, as was said last; None: nobody has said.
        counts: how many runs it had made at each recorded experiment; None where it does not count.
    """

    system: Record | None = None
    budget: int | None = None
    counts: tuple[int | None, ...] = ()
    _flown: object = field(default=None, init=False)
    _runs: int | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self._runs = self.counts[-1] if self.counts else None

    def fly(self, system: object, budget: int, kept: str | None) -> None:
        """Takes up a system where the campaign left it: one that counts its runs, as its noise depends on them.

        Args:
            system: that will be run.
            budget: runs on it in all.
            kept: name of the campaign in its store, which knows what was flown; None: there is none.

        Raises:
            InvalidInput: it is another one than the campaign in the store has flown so far.
        """
        record = record_of(system)
        if record is not None and self.system is not None and kept is not None:
            what = f"Campaign.run, system: expected the one that {kept} has flown so far"
            known = unguarded(self.system)
            check_same({**known, "runs": None}, {**unguarded(record), "runs": None}, what)
            if self._runs is None:
                self._runs = known.get("runs")
        elif record is not None:
            self.system = record
        self.budget = budget
        runs = getattr(system, "runs", None)
        if not isinstance(runs, int) or isinstance(runs, bool):
            self._flown = None
            return
        if self._flown is None and self._runs is not None and runs < self._runs:
            setattr(system, "runs", self._runs)  # noqa: B010 - a system need not declare it
        self._flown = system

    def count(self, experiments: int) -> None:
        """Notes how many runs the system has made, for the experiments that are new.

        Args:
            experiments: that are recorded.

        Raises:
            InvalidInput: `runs` of the system is no number any more.
        """
        new = experiments - len(self.counts)
        if new <= 0:
            return
        if self._flown is not None:
            self._runs = whole("System.runs", getattr(self._flown, "runs", None))
        self.counts += (self._runs,) * new

"""Proposals: what the planner has to know of the flights so far, what is wanted, and the test that it proposes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from twinloop._experiment.hold_back import HoldBack
from twinloop._ground.arrays import Floats
from twinloop.planning.leaving import least_risk
from twinloop.planning.seen import Seen


@dataclass(frozen=True)
class Fared:
    """How flights of the same gains have fared.

    Args:
        flights: how many there were, failures included.
        left: how many of them left the envelope, or did not end.
    """

    flights: int
    left: int

    def __str__(self) -> str:
        return "their only flight" if self.flights == 1 else f"{self.left} of their {self.flights} flights"

    @property
    def risk(self) -> float:
        """Least probability that the next one does not keep the envelope: 0 where all have kept it."""
        return least_risk(self.left, self.flights)


@dataclass(frozen=True, eq=False)
class Flown:
    """What has flown so far.

    Args:
        best: genes of the best flight; those tuned where no test was flown.
        flies: whether they are known to fly: to the end, and inside the envelope.
        usages: largest usage of the envelope in each flight that kept it; in each flight where none has.
        good: quality of the best flight that kept the envelope; infinite where none has: one that keeps it may then be
            worse.
        failed: genes of tests that failed on the system, or were cut.
        times: how often the best gains have flown.
        fared: how these flights have ended.
        borne: how many of the last flights whose excitation was held back kept the envelope.
        seen: where the flights have been, as long as no prediction has come true.
        begins: usage of the envelope where the task begins: flights of the task cannot have less.
        disproved: genes of flights that were clearly worse than the best one, or left the envelope, against what the
            committee says.
    """

    best: Floats
    flies: bool
    usages: Sequence[float]
    good: float
    failed: Sequence[Floats] = ()
    times: int = 1
    fared: Fared = Fared(1, 0)
    borne: int = 1
    seen: Seen | None = None
    begins: float = 0.0
    disproved: Sequence[Floats] = ()


@dataclass(frozen=True)
class Wanted:
    """What the next test is for.

    Args:
        goal: "both", "model" or "control".
        number: of the test, for its streams.
        exploit: whether the tuned gains are flown as they are.
        plain: whether the test that promises most is wanted, rather than the one that tells most.
        last: whether nothing is to be learnt from it: it need not lead where no flight has been.
    """

    goal: str
    number: int
    exploit: bool
    plain: bool = False
    last: bool = False


@dataclass(frozen=True, eq=False)
class Proposal:
    """A test that is proposed.

    Args:
        genes: its gains (size,).
        initial_state: where it starts (n_x,).
        target_state: where it leads (n_x,).
        excitation: (n, n_u), or None.
        predicted: mean quality over members and draws, as a record of the flight would give it; infinite if any
            diverges.
        spread: standard deviation of it over members and noise; infinite likewise.
        risk: share of predicted flights that leave the envelope, with half a flight added on either side.
        safe: whether every member keeps the margin, and the envelope under every draw of the sensors' noise.
        disagreement: of the committee, log det.
        gain: quality that knowing the right member would bring, and gains that are held back, by the committee's own
            estimate.
        reason: for a person.
        hold_back: what holds its excitation back; None: nothing does.
    """

    genes: Floats
    initial_state: Floats
    target_state: Floats
    excitation: Floats | None
    predicted: float
    spread: float
    risk: float
    safe: bool
    disagreement: float
    gain: float
    reason: str
    hold_back: HoldBack | None = None

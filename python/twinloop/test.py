"""An experiment that can be asked for: a controller, where the run starts, where it should end."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, floats, whole
from twinloop._ground.showing import Shown
from twinloop._ground.values import Value
from twinloop.controllers.family import Controller, Family
from twinloop.errors import InvalidInput
from twinloop.records import Recorded
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class Test(Shown, Value, Recorded, kind="test", given=("family",)):
    """One candidate experiment; run it with `system.run(test)`, or by hand with `test.controller()`.

    Args:
        family: of its controller.
        genes: gains of the controller (size,), in their units.
        initial_state: where the run starts (n_x,), SI units, radians.
        target_state: where it should end (n_x,), the same units; or a row for each state of the run (n + 1, n_x), a
            reference that varies with time.
        steps: number of commands, n.
        excitation: signal that is added to the controller's commands (n, n_u), in their units; the sum is clipped to
            the commands' bounds. None: no excitation.
        number: its number in the campaign, from 0.
        campaign: identity of the campaign that it belongs to; empty if none.
        predicted: predicted quality (with the preset "paper" the final distance); infinite if the twin diverges; None
            without a prediction.
        measured: flown quality, mean over complete runs; None if there are none.
        spread: expected standard deviation of the measured quality; None without a prediction.
        risk: probability that the flight leaves the envelope, by the committee; None without a committee.
        reason: why this test was chosen, as a sentence.
        hold_back: holds the excitation back during the flight; None: it is not held back.

    Raises:
        InvalidInput: shapes that do not fit the family's signals, numbers that are not finite, or a `number` that is no
            whole number from 0.
    """

    __test__ = False  # a name that pytest would otherwise collect

    family: Family
    genes: Floats
    initial_state: Floats
    target_state: Floats
    steps: int
    excitation: Floats | None = None
    number: int = 0
    campaign: str = ""
    predicted: float | None = None
    measured: float | None = None
    spread: float | None = None
    risk: float | None = None
    reason: str = ""
    hold_back: HoldBack | None = None

    def __post_init__(self) -> None:
        n_x = self.family.signals.n_x
        object.__setattr__(self, "genes", floats("Test.genes", self.genes, (self.family.size,)))
        object.__setattr__(self, "initial_state", floats("Test.initial_state", self.initial_state, (n_x,)))
        object.__setattr__(self, "steps", whole("Test.steps", self.steps, least=1))
        object.__setattr__(self, "number", whole("Test.number", self.number))
        target = checked_target("Test.target_state", self.target_state, n_x, self.steps)
        object.__setattr__(self, "target_state", target)
        if self.excitation is not None:
            shape = (self.steps, self.family.signals.n_u)
            object.__setattr__(self, "excitation", floats("Test.excitation", self.excitation, shape))
        if self.hold_back is not None and len(self.hold_back.full) != n_x:
            raise InvalidInput(
                f"Test.hold_back: expected ranges of {n_x} states, found {len(self.hold_back.full)}."
            )

    @property
    def signals(self) -> Signals:
        """Signals of the system."""
        return self.family.signals

    @property
    def parameters(self) -> dict[str, float]:
        """Gains by name, in their units."""
        return self.family.parameters(self.genes)

    @property
    def task(self) -> _core.Task:
        """Start, target and length, for the native engine."""
        return _core.Task(self.initial_state, self.target_state, self.steps)

    def target(self, k: int) -> Floats:
        """The target state at time k dt (n_x,), k from 0 to n; a loop passes it to its controller.

        Args:
            k: number of the period.
        """
        return self.target_state if self.target_state.ndim == 1 else self.target_state[k]

    def controller(self) -> Controller:
        """A new controller for one run, with the excitation: `.command(state, target)` once per period."""
        return self.family.controller(self.genes, self.excitation, self.hold_back)

    def judged(self, predicted: float | None, measured: float | None) -> Test:
        """The same test with its quality.

        Args:
            predicted: quality that the twin predicts.
            measured: flown quality.

        Returns:
            A copy under the same number.
        """
        return dataclasses.replace(self, predicted=predicted, measured=measured)

    def quiet(self) -> Test:
        """The same test without its excitation."""
        return dataclasses.replace(self, excitation=None, hold_back=None)

    def explained(self, spread: float, risk: float, reason: str) -> Test:
        """The same test with the predictions of a committee.

        Args:
            spread: expected standard deviation of the measured quality.
            risk: probability that the flight leaves the envelope.
            reason: why this test.

        Returns:
            A copy under the same number.
        """
        return dataclasses.replace(self, spread=spread, risk=risk, reason=reason)

    def same_as(self, other: Test) -> bool:
        """Whether both are the same experiment of the same campaign."""
        return (self.campaign, self.number) == (other.campaign, other.number) and self.asks_as(other)

    def asks_as(self, other: Test) -> bool:
        """Whether both ask for the same flight: what repeats itself exactly then flies the same."""
        return (
            self.steps == other.steps
            and self.genes.tobytes() == other.genes.tobytes()
            and self.initial_state.tobytes() == other.initial_state.tobytes()
            and self.target_state.tobytes() == other.target_state.tobytes()
            and _bits(self.excitation) == _bits(other.excitation)
            and _ranges(self.hold_back) == _ranges(other.hold_back)
        )

    def __repr__(self) -> str:
        gains = ", ".join(f"{name}={value:.6g}" for name, value in self.parameters.items())
        return f"Test({self.number}: {gains})"


def checked_target(what: str, values: ArrayLike, n_x: int, steps: int) -> Floats:
    """A target that is constant, or one that varies with time.

    Args:
        what: how to call it in an error.
        values: (n_x,), or a row for each state of a run (steps + 1, n_x), in the units of the states.
        n_x: number of states.
        steps: of the run.

    Raises:
        InvalidInput: another shape, or numbers that are not finite.
    """
    return floats(what, values, (n_x,) if np.ndim(values) < 2 else (steps + 1, n_x))


def final_distance(last_state: ArrayLike, target_state: ArrayLike, signals: Signals | None = None) -> float:
    """Distance of the last state to the target, δ (paper, section IV.C).

    Args:
        last_state: (n_x,), SI units, radians.
        target_state: (n_x,), the same units.
        signals: of the system; None where no state is periodic.

    Returns:
        The Euclidean distance over all components.
    """
    target = floats("Target state", target_state, (None,))
    last = floats("Last state", last_state, (len(target),))
    gaps = last - target if signals is None else signals.difference(last, target)
    total = 0.0
    for gap in gaps.tolist():
        total += gap * gap
    return math.sqrt(total)


def _bits(values: Floats | None) -> bytes | None:
    return None if values is None else values.tobytes()


def _ranges(hold_back: HoldBack | None) -> tuple[bytes, bytes] | None:
    return None if hold_back is None else (hold_back.full.tobytes(), hold_back.none.tobytes())


def check_signals(test: object, signals: Signals) -> None:
    """Refuses a test, or a replay, that was made for other signals.

    Args:
        test: the one.
        signals: those of the system or twin that is to run it.

    Raises:
        InvalidInput: not a test, or other states, commands or period.
    """
    if not isinstance(test, (Test, Replay)):
        raise InvalidInput(
            f"Expected a twinloop.Test, found {type(test).__name__}; get one from campaign.ask()."
        )
    found = test.signals
    for what, expected, other in (
        ("states", signals.state_names, found.state_names),
        ("commands", signals.command_names, found.command_names),
        ("period", signals.dt, found.dt),
    ):
        if expected != other:
            raise InvalidInput(
                f"Test: expected the {what} {expected} of this system or twin, found {other}; "
                "run it on the system it was made for."
            )

"""What a campaign remembers of its iterations: plain records, one for each turn of the double loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Literal

from twinloop._experiment.envelope import gone_from, readings_leave, usages_of
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats
from twinloop.campaign.data.begun import off_start
from twinloop.campaign.data.gains import FlownOtherwise
from twinloop.law.actuation import HiddenState, renewed_hidden
from twinloop.objectives import normalised_error
from twinloop.records import Record, Recorded
from twinloop.remarks import Remark
from twinloop.test import Test
from twinloop.trajectory import Trajectory

Cause = Literal["disturbance", "law", "undecided"]
"""Of what disturbs for long: something from outside; a model error; or what flights so far do not tell apart."""

IN_SCALES = 2
"""Version of an experiment from which the errors of the preset `default` are in units of the states' scales."""


@dataclass(frozen=True)
class Experiment(Recorded, kind="experiment", given=("replayed",)):
    """One run on the system.

    Args:
        replayed: what a twin flies for the comparison: the test, or the recorded commands, which are those of a test
            that was flown with other gains, or of another test, too.
        trajectory: the measured run.
        before: closed-loop error on this run of the twin at the last `ask`, over steps and states, each in units of its
            scale (the preset "paper": SI units squared); None if there was no `ask` yet.
        frozen: closed-loop error of the model that never moves, on the run; the same units.
        final_distance: distance of the last measured state to the target; None if the run was cut, or has no target.
        quality: measured quality, which the campaign minimises; None if the run was cut, or has no target.
        attached: whether it is a run without a test.
        log: what the log of an attached run is called; empty where nobody has said so.
    """

    replayed: Test | Replay
    trajectory: Trajectory
    before: float | None
    frozen: float
    final_distance: float | None
    quality: float | None
    attached: bool = False
    log: str = ""

    VERSION = 3

    @property
    def test(self) -> Test | None:
        """The test; None for an attached run, and where other gains or another test were flown than it asks for."""
        return self.replayed if isinstance(self.replayed, Test) else None

    @property
    def number(self) -> int | None:
        """Number of the test that it was told as, whatever was flown; None for an attached run."""
        asked = self.replayed.asked if isinstance(self.replayed, FlownOtherwise) else self.test
        return None if asked is None else asked.number

    @property
    def complete(self) -> bool:
        """Whether it ran to its end."""
        flown = self.replayed.flown if isinstance(self.replayed, FlownOtherwise) else self.replayed
        return self.trajectory.ended == "completed" and self.trajectory.steps == flown.steps

    @property
    def kept_envelope(self) -> bool:
        """Whether it ran to its end and never left the envelope; False for a run that was cut."""
        return self.complete and not self.left_envelope

    @cached_property
    def off_start(self) -> tuple[int, ...]:
        """States that began elsewhere than its test does: what was predicted is then of another flight."""
        return () if self.test is None else off_start(self.test, self.trajectory)

    @property
    def miss(self) -> float | None:
        """Predicted minus measured quality; None without both, or where it began elsewhere."""
        predicted = None if self.test is None or self.off_start else self.test.predicted
        return None if predicted is None or self.quality is None else predicted - self.quality

    @property
    def normalised_before(self) -> float | None:
        """`before` over the error of the model that never moves; None as long as there was no `ask`."""
        return None if self.before is None else normalised_error(self.before, self.frozen)

    @property
    def usage(self) -> float:
        """Largest usage of the envelope by its readings: 1 at a bound; 0 if no envelope is declared."""
        return float(self._usages().max())

    @property
    def left_envelope(self) -> bool:
        """Whether two of five readings in a row were outside; a single one may be the noise of a sensor."""
        return readings_leave(self._usages())

    @property
    def gone_from(self) -> int | None:
        """The first reading from which it is outside of the envelope for good; None where it comes back or stays."""
        return gone_from(self._usages())

    def _usages(self) -> Floats:
        """The most that any state used at each reading (n + 1,)."""
        return usages_of(self.replayed.signals, self.trajectory.states)


def called(experiments: Sequence[Experiment]) -> tuple[str, ...]:
    """What people call each experiment: "test 3"; of an attached run its log, or "log 2" where no other says which.

    Args:
        experiments: all of a campaign that count; `withdraw` calls the second one that is attached attached-2.
    """
    logs, attached = [run.log for run in experiments], count(1)
    names = []
    for run in experiments:
        if run.number is not None:
            names.append(f"test {run.number}")
            continue
        name = f"log {next(attached)}"
        if run.log:
            name = run.log if logs.count(run.log) == 1 else f"{run.log} ({name})"
        names.append(name)
    return tuple(names)


@dataclass(frozen=True)
class Failure(Recorded, kind="failure", given=("test",)):
    """A test that failed on the system.

    Args:
        test: that was flown.
        reason: what happened, in a few words.
        recorded: whether the record up to the failure is among the experiments.
    """

    test: Test
    reason: str
    recorded: bool = False


@dataclass(frozen=True)
class Withdrawal(Recorded, kind="withdrawal"):
    """A flight that was told or attached by mistake: its record stays, and nothing is learnt from it any more.

    Args:
        reason: what was wrong with it, in a few words.
        test: number of its test; None for an attached flight.
        run: its place among all runs that were recorded, from 0; None for a failure without a record.
        failure: its place among all failures, from 0; None where the test did not fail.
        recorded: number of all runs that were recorded by then.
        known: of each test that was asked for by then, how many of the runs that are left it was planned from.
        planned: numbers of the tests that were planned with it: what was predicted of them counts no more.
    """

    reason: str
    test: int | None
    run: int | None
    failure: int | None
    recorded: int
    known: tuple[int, ...]
    planned: tuple[int, ...]


@dataclass(frozen=True)
class TestLoop(Recorded, kind="test_loop"):
    """One turn of the test loop.

    Args:
        test: number of the test that it gave.
        genes: gains of the test, in their units.
        objectives: of the test: discrimination, instability and, if it is an objective, control quality.
        flat: whether all tests of the random population ended at the same distance on the best model, which
            then ignores the commands.
        generations: that it ran.
        archive_size: non-dominated tests.
        evaluations: tests that were judged.
        predicted: final distance on the best model; infinite if it diverged.
        flown: final distance on the system, mean over complete runs; None if there was none.
    """

    __test__ = False  # a name that pytest would otherwise collect

    test: int
    genes: tuple[float, ...]
    objectives: tuple[float, ...]
    flat: bool
    generations: int
    archive_size: int
    evaluations: int
    predicted: float
    flown: float | None = None


@dataclass(frozen=True)
class Planned(Recorded, kind="planned"):
    """A test that the preset `default` has proposed; what no committee has estimated of it is None.

    Args:
        test: number of the test.
        genes: gains of the test, in their units.
        predicted: quality on the committee, mean; infinite if a member diverges; None without a committee.
        spread: expected standard deviation of the measured quality; None without a committee.
        risk: probability that the flight leaves the envelope, by the committee; None without one.
        safe: whether every member keeps the margin; None without a committee.
        bits: expected information of the flight; None without a committee.
        gain: improvement of the quality if the right member were known, and gains that are held back could be flown;
            None without a committee.
        reason: why this one.
        flown: quality on the system, mean over complete runs; None if there was none.
    """

    test: int
    genes: tuple[float, ...]
    predicted: float | None
    spread: float | None
    risk: float | None
    safe: bool | None
    bits: float | None
    gain: float | None
    reason: str
    flown: float | None = None

    VERSION = 2

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version: a test without a committee had no prediction, and zeros beside it."""
        found = super().renewed(record)
        if found.get("predicted") == "nan":
            found |= dict.fromkeys(("predicted", "spread", "risk", "safe", "bits", "gain"))
        return found


@dataclass(frozen=True)
class Lesson(Recorded, kind="lesson"):
    """One identification of the preset `default`, and the tests planned after it.

    Args:
        iteration: its number, from 1.
        tests: numbers of the selected tests, in the order of `tell`; None for an attached run.
        form: meaning of the model's outputs.
        terms: of the equations.
        misfit: χ² of the predictions per reading; 1 if only noise remains.
        readings: number of readings that counted.
        ignored: number of outliers.
        sensors: standard deviation of each state's sensor, estimated, in its unit.
        lags: time constant of each command's actuator, s; 0 where none was identified, as where the law does not
            explain the flights: a lag in it may stand for a state that is not logged.
        delays: of each command's actuator, periods; 0 as with `lags`.
        hidden: unmeasured states: which commands or states drive each, whether squared, the mean at rest in units of
            their scale (None: that of the first period), the time constant in s, how it begins, and
            whether it turns, or is behind a gap.
        offsets: delay of each state's readings against those of the driven states that are read in time, s.
        closed_loop: of the best model, one for each selected test, in units of the states' scales; infinite where it
            diverges.
        normalised: closed_loop over that of the model that never moves.
        follows: whether free runs of the best model follow at least half of the runs that it was learnt from; if not,
            no test is planned with it.
        remarks: diagnostics.
        recurring: states whose correlated disturbance recurs at the same times in each flight: a
            model error, not a disturbance.
        undecided: states whose correlated disturbance may also be a model error: the flights so far do not decide it.
        asked: the tests planned after it.
        rates: at which each command's actuator moves at most, in the command's unit a second; 0 as with `lags`.
    """

    iteration: int
    tests: tuple[int | None, ...]
    form: str
    terms: int
    misfit: float
    readings: int
    ignored: int
    sensors: tuple[float, ...]
    lags: tuple[float, ...]
    delays: tuple[int, ...]
    hidden: tuple[HiddenState, ...]
    offsets: tuple[float, ...]
    closed_loop: tuple[float, ...]
    normalised: tuple[float, ...]
    follows: bool
    remarks: tuple[Remark, ...]
    recurring: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    asked: tuple[Planned, ...] = ()
    rates: tuple[float, ...] = ()

    VERSION = 3

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version: hidden states had no names, commands alone filled them, or none had a gap."""
        found = super().renewed(record)
        if "hidden" in found:
            found["hidden"] = renewed_hidden(found["hidden"])
        return found

    def cause(self, state: str) -> Cause:
        """What causes the correlated disturbance of a state, by its name."""
        if state in self.recurring:
            return "law"
        return "undecided" if state in self.undecided else "disturbance"


@dataclass(frozen=True)
class Iteration(Recorded, kind="iteration"):
    """One turn of the model loop, and the tests asked for after it; iteration 0 is the random population.

    Args:
        iteration: its number.
        generations: that it ran.
        tests: numbers of the selected tests, in the order of `tell`.
        archive_size: non-dominated models.
        capped_generations: generations in which the non-dominated set was pruned to its cap.
        open_loop: of the best trade-off, one for each selected test, SI units squared.
        closed_loop: of the best trade-off, one for each selected test, SI units squared.
        normalised: closed_loop over that of the model that never moves.
        intron_share: mean share of instructions that cannot affect the outputs, over the population.
        evaluations: models that were run on the tests since the start.
        spared: offspring that were not run, since the start: their effective code was their parent's.
        asked: the test loops that followed.
    """

    iteration: int
    generations: int
    tests: tuple[int, ...]
    archive_size: int
    capped_generations: int
    open_loop: tuple[float, ...]
    closed_loop: tuple[float, ...]
    normalised: tuple[float, ...]
    intron_share: float
    evaluations: int
    spared: int
    asked: tuple[TestLoop, ...] = ()


@dataclass(frozen=True)
class Progress:
    """The state of a campaign, for its progress callback after every chunk of work.

    Args:
        phase: "models", "tests", "experiment", or a step of the preset `default`.
        iteration: of the double loop.
        generation: of the running loop.
        generations: number of generations of the running loop.
        experiments: number of experiments so far.
        tests: numbers of the tests that are being learnt; None for an attached run.
        open_loop: of the best trade-off, one for each of them.
        closed_loop: of the best trade-off, one for each of them.
        archive_size: of the running loop.
        evaluations: of the running loop, since its start.
    """

    phase: str
    iteration: int
    generation: int
    generations: int
    experiments: int
    tests: tuple[int | None, ...]
    open_loop: tuple[float, ...]
    closed_loop: tuple[float, ...]
    archive_size: int
    evaluations: int

"""The double loop, counted in experiments: ask for a test, fly it, tell what happened (section III.C)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats, floats, whole
from twinloop._ground.showing import Shown
from twinloop.campaign import standing
from twinloop.campaign.assessment import Advice, advice, controller_to_fly, rmse
from twinloop.campaign.certificate import Certificate, certificate
from twinloop.campaign.coevolution.method import Coevolution
from twinloop.campaign.cost import Cost, cost
from twinloop.campaign.entering import attached_run, flown_test, refuse_copy
from twinloop.campaign.examination.check import Checks
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.examination import Examination, Known
from twinloop.campaign.examination.log_check import against
from twinloop.campaign.examination.loops import loops_around
from twinloop.campaign.flying import checked_budget, checked_risk, fly
from twinloop.campaign.guarding import guard_of
from twinloop.campaign.history import (
    Experiment,
    Failure,
    Iteration,
    Lesson,
    Planned,
    Progress,
    Withdrawal,
)
from twinloop.campaign.persistence import Persistent
from twinloop.campaign.presets import AnyOptions
from twinloop.campaign.ranking import ranked
from twinloop.campaign.reporting import plots, reported
from twinloop.campaign.setup import Choices, Flights, checked, refuse_arguments
from twinloop.campaign.taking_away import taken_controller, taken_twin
from twinloop.campaign.twin_errors import whole_error
from twinloop.controllers import Controller, Family, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.guard import Guard, Guarded
from twinloop.law.linear.margins import Margins, margins_of
from twinloop.law.twin import Twin
from twinloop.planning.proposal import Fared
from twinloop.remarks import warn
from twinloop.signals import Signals
from twinloop.systems import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.faces.figures.plots import Plots

GENTLE = "gentle"
"""The excitation of a first test where nothing else is asked for: the preset's own."""


class Campaign(Shown, Persistent, kind="campaign"):
    """Learns a twin and a controller from as few experiments as possible.

    Args:
        signals: of the system.
        controller: a family of controllers, such as `twinloop.controllers.PID`.
        initial_state: where every test starts (n_x,), SI units, radians.
        target_state: where every test should end (n_x,), the same units. A reference that varies with time is a
            function of it in s, sampled at `dt`, or a row for each period and one for the end (n + 1, n_x).
        duration: of a test, s; a whole number of periods.
        preset: "default", or "paper" for the algorithm of the paper to the letter.
        seed: of all random numbers; equal seeds give equal bits.
        options: other values for some of the preset's options, by name.
        goal: what the flights are for: "control" (the best controller soon), "model" (a twin that is right
            everywhere), or "both", the default.
        quality: what is minimised: "iae" (integrated absolute error, the default), "ise" (squared) or "final_distance"
            (the paper's).
        weights: of states in the quality, by name, such as {"pitch": 2.0}. By default rates count with 0 and all
            other states with 1, each in units of its scale ("final_distance": all with 1, as they are).
        operators: that evolved programs may use; by default the preset's.
        threads: number of threads of the engine, by default all; no result depends on it.
        progress: called with a `Progress` a few times a second during the work. True: a table on standard error with
            the remaining time, if that is a terminal, and nothing elsewhere. None or False: nothing.
        store: a file of SQLite, or the address of a database such as "postgresql+psycopg://user@host/database", where
            each test and each run is committed before the call returns. An existing campaign of this name, with the
            same arguments, continues with the same bits. None: the campaign ends with the process.
        name: of the campaign in its store, which may hold several.

    Raises:
        InvalidInput: an argument that cannot be used.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: another process writes the campaign, or the store cannot be written.
    """

    def __init__(
        self,
        signals: Signals,
        *,
        controller: UnboundFamily,
        initial_state: ArrayLike,
        target_state: ArrayLike | Callable[[float], ArrayLike],
        duration: float,
        preset: str = "default",
        seed: int = 0,
        options: Mapping[str, object] | None = None,
        goal: str | None = None,
        quality: str | None = None,
        weights: Mapping[str, float] | None = None,
        operators: Sequence[str] | None = None,
        threads: int | None = None,
        progress: Callable[[Progress], None] | bool | None = True,
        store: str | Path | None = None,
        name: str = "campaign",
        **other: object,
    ) -> None:
        refuse_arguments("Campaign", other, list(signature(Campaign).parameters)[:-1])
        flights = Flights(signals, controller, initial_state, target_state, duration)
        choices = Choices(preset, options, seed, goal, quality, operators, weights)
        setup = checked(flights, choices)
        if setup.mixer is not None:
            # Of what is begun: a campaign that has such an offset must be read all the same.
            setup.mixer.check_offset(setup.signals)
        self._begin(setup, threads, progress)
        if store is not None:
            self._open(store, name)

    @property
    def signals(self) -> Signals:
        """Of the system."""
        return self.setup.signals

    @property
    def family(self) -> Family:
        """Of the controllers, bound to the signals."""
        return self.setup.family

    @property
    def options(self) -> AnyOptions:
        """Options of the preset, with your changes."""
        return self.setup.options

    # Ask and tell

    def test(
        self, gains: Mapping[str, float] | ArrayLike, excitation: ArrayLike | str | None = GENTLE
    ) -> Test:
        """A test with gains of your own: the first one, a controller that you already trust.

        Args:
            gains: all gains by name, or (size,) in order; in their units and bounds.
            excitation: signal that is added to the controller's commands (steps, n_u), in their units; the sum is
                clipped to the commands' bounds. None: no excitation. The default is the preset's own: a gentle one
                that grows, is held back once the states answer, and fades out; the preset "paper" has none.

        Returns:
            The test; fly it, then `tell` its run.

        Raises:
            InvalidInput: gains or an excitation that cannot be used.
        """
        genes, hold_back = self.family.genes(gains), None
        if isinstance(excitation, str):
            if excitation != GENTLE:
                raise InvalidInput(
                    f"Campaign.test, excitation: expected an array, None or {GENTLE!r}, found {excitation!r}."
                )
            added, hold_back = self._method.first_excitation(len(self._book.tests), genes)
        elif excitation is not None:
            shape = (self.setup.steps, self.signals.n_u)
            added = floats("Campaign.test, excitation (steps, commands)", excitation, shape)
        else:
            added = None
        with self._entering():
            return self._book.new_test(genes, excitation=added, hold_back=hold_back)

    def ask(self, last: bool = False) -> Test:
        """Learns from all runs so far, then plans the test on which the best models disagree.

        Asking again without a new run learns nothing new and gives another test.

        Args:
            last: whether this is the last test. The preset "default" then flies its best gains without excitation, or
                the best ones flown if its own promise nothing better and may be far worse, unless its option
                `exploit_last` is off or its option `tests` uses no committee. While such a test waits for its run, that
                one is the last, and another is planned as without `last`. The preset "paper" ignores it.

        Returns:
            The test, with its predicted quality, its risk and its reason; fly it, then `tell` its run.

        Raises:
            NotAvailable: there is no run yet.
        """
        self.interrupted = False
        with self._at_work():
            self._learn()
            with self._entering():
                return self._method.ask(self._book, bool(last))

    def ask_batch(self, size: int = 3) -> tuple[Test, ...]:
        """Alternatives: the waiting tests, with new ones from `ask` until there are `size`.

        Fly them in any order. Tell the run of each flown test and abandon the others: a test that was not flown adds
        nothing. A second call, also after a crash, only adds missing tests.

        Args:
            size: number of waiting tests.

        Returns:
            The waiting tests, the best one first: tests that keep the envelope come before the others, then the order
            is by bits of information, or with the goal "control" by predicted quality.

        Raises:
            NotAvailable: there is no run yet.
            InvalidInput: no whole number of at least 1.
        """
        wanted = whole("Campaign.ask_batch, size", size, least=1)
        while len(self._book.waiting()) < wanted:
            self.ask()
        plans = {plan.test: plan for _, plan in self._book.asked if isinstance(plan, Planned)}
        return ranked(self._book.waiting(), plans, self.setup.goal)

    def tell(self, test: Test, trajectory: Trajectory) -> None:
        """Adds the run of a test, in any order; a second run of a test is a replicate.

        What speaks against the flight by itself, such as a sensor that was off, is said as a `RemarkWarning`.

        Args:
            test: from this campaign.
            trajectory: the measured run; shorter than the test if the run was cut.

        Raises:
            InvalidInput: a test of another campaign, or a useless trajectory; nothing has changed.
        """
        with self._entering():
            own = self._book.own(test)
            self._book.enter(flown_test(self.setup, own, trajectory, self._error_so_far))
        self.interrupted = False
        self._warn_of_last(own)

    def tell_failed(self, test: Test, reason: str, partial: Trajectory | None = None) -> None:
        """Adds the failure of a test on the system.

        A failure has no quality, and counts as a run. The preset "default" then does not treat these gains, or gains
        close to them, as safe.

        Args:
            test: from this campaign.
            reason: what happened, in a few words.
            partial: the record up to the failure, of at least one step; it is learnt. None: no record.

        Raises:
            InvalidInput: a test of another campaign, no reason, or a useless record; nothing has changed.
        """
        with self._entering():
            self._book.fail(test, reason, partial, self._error_so_far)
        self.interrupted = False
        if partial is not None:
            self._warn_of_last(test)

    def attach(self, trajectory: Trajectory, log: str = "") -> None:
        """Adds a run without a test, of any length and under any commands.

        The twin is judged on it by its free run under the recorded commands. It has no quality, and `run` does not
        count it. What speaks against the log by itself is said as a `RemarkWarning`.

        Args:
            trajectory: of the same signals.
            log: what remarks and reports shall call it, such as the name of its file; empty: by its number.

        Raises:
            InvalidInput: a useless trajectory, or a copy of a flight that is recorded already, as the noise of its
                readings shows; nothing has changed.
            NotAvailable: the preset "paper" learns from tests of its controllers only.
        """
        if isinstance(self._method, Coevolution):
            raise NotAvailable(
                "Campaign.attach: expected the preset 'default', found 'paper', which learns from tests of its"
                ' controllers only; choose preset="default".'
            )
        with self._entering():
            run = attached_run(self.setup, trajectory, self._error_so_far, log)
            refuse_copy(trajectory, self._book.experiments, self.signals)
            self._book.enter(run)
        self.interrupted = False
        self._warn_of_last(None)

    def abandon(self, test: Test) -> None:
        """Marks a test as not to be flown: `run` skips it. If somebody flies it later, tell its run.

        Args:
            test: from this campaign, without a run.

        Raises:
            InvalidInput: a test of another campaign, or one that was flown.
        """
        with self._entering():
            self._book.abandon(test)

    def withdraw(self, which: int | Test | Experiment | Failure, reason: str) -> None:
        """Takes back a flight that was told or attached by mistake: wrong unit, exchanged columns, wrong file.

        Its record stays, marked with the reason, and counts in the cost. Nothing that was learnt with it is used any
        more: the next look or `ask` learns again from what is left, as if the flight had not been told. That takes
        as long as all learning so far, if a test was asked for since. Its test is "asked" again: tell the right log.
        Tests that were planned with it and still wait are abandoned, and what was predicted of those that were flown
        counts no more.

        Args:
            which: number of the test, or the test: its last run, or its failure if it has no run; or one of
                `experiments` or `failures`.
            reason: what was wrong with the flight, in a few words.

        Raises:
            InvalidInput: no such flight, one that was withdrawn before, or no reason; nothing has changed.
        """
        with self._entering():
            known = standing.known_when_asked(self._book, self._method.learnt_by)
            entry = self._book.withdraw(which, reason, known)
            self._method.forget(self._book, asked_since=bool(entry.planned))
        self.interrupted = False

    def status(self, test: Test) -> str:
        """Where a test is in its life.

        Args:
            test: from this campaign.

        Returns:
            "asked", "flown" (one run at least was complete), "aborted" (none was), "failed" or "abandoned".

        Raises:
            InvalidInput: a test of another campaign.
        """
        return standing.status(self._book, test)

    def run(
        self,
        system: System,
        experiments: int = 4,
        *,
        timeout: float | None = None,
        max_risk: float | None = None,
    ) -> Campaign:
        """Runs the whole loop; the last test comes from `ask(last=True)`.

        Waiting tests are flown first. Without any run, the first test is the last one made by `campaign.test`, or one
        with `system.default_gains`.

        If the system raises a `SystemFailure`, the test has failed, as with `tell_failed`. The loop continues with
        another test if some test was flown and the one before did not fail; otherwise the failure is raised.

        Args:
            system: anything with `signals` and `run(test)`.
            experiments: total number of runs on the system. The first run, earlier runs and failures count; attached
                runs do not.
            timeout: seconds that the system may take for a test; None: no limit.
            max_risk: largest accepted risk, the probability by the committee that a test leaves the envelope; None:
                no limit. A test that is asked for without a committee, as by the preset "paper", may have any risk.
                Tests of your own have no predicted risk, and are flown.

        Returns:
            The campaign.

        Raises:
            InvalidInput: no system, a system that returns no usable trajectory, fewer experiments than there are
                already, or a `max_risk` that is no probability.
            KeyboardInterrupt: Ctrl-C. No run is lost: `interrupted` is true, the results give the best so far, and
                another call continues with the same bits.
            NotAvailable: there is no first test.
            NoAnswer: the system did not answer in time; its test still waits, in a store also for another process. Or
                commands have moved and no reading ever has; the next test waits.
            SystemFailure: the first test failed, or two in a row; the failures are in the campaign.
            TooRisky: a test is riskier than `max_risk`; it waits. Raise `max_risk`, fly it by hand, or abandon it.
        """
        budget, allowed = checked_budget(self, system, experiments), checked_risk(max_risk)
        self.interrupted = False
        self._take_up(system, budget)
        runs = len(self._book.experiments) + budget - self.runs
        with self._at_work(type(system).__name__, runs):
            fly(self, system, budget, timeout, allowed, self._report_experiment)
        return self

    # Guarding

    def guard(
        self,
        test: Test,
        fallback: Mapping[str, float] | ArrayLike | None = None,
        *,
        horizon: float | None = None,
        false_alarms: float = 0.01,
        overrun: float = 0.5,
        clock: Callable[[], float] | None = time.monotonic,
    ) -> Guard:
        """A test's controller with supervision, for your own loop: `reset`, `command(state, target)`, `tripped`.

        It checks readings, envelope and clock. If a twin follows the flights so far, it also checks the twin's band,
        and predicts ahead with the committee. Once a check fails it sends the fallback's commands; tell
        `guard.trajectory(last)` after the flight.

        Args:
            test: that is flown.
            fallback: gains by name; or a command that is safe to hold (n_u,), in its units. None: the first controller
                that is known to fly (`trusted`), or, before any has flown, the test's own without its excitation.
            horizon: of the prediction, s, rounded up to whole periods; 0: no prediction. None: a fifth of the test.
            false_alarms: share of flights that the check of the band may end without cause, by the committee's own
                prediction.
            overrun: share of the period by which a period may be late.
            clock: gives the time in s; None: time is not checked.

        Returns:
            The guard, at the start of a flight.

        Raises:
            InvalidInput: a test for other signals, or arguments that do not fit.
            NotAvailable: controllers in Python, whose memory cannot be predicted; pass horizon=0. Or tests were flown
                and none of them is known to fly; pass a fallback.
        """
        return guard_of(
            self, test, fallback, horizon=horizon, false_alarms=false_alarms, overrun=overrun, clock=clock
        )

    def guarded(
        self,
        system: System,
        fallback: Mapping[str, float] | ArrayLike | None = None,
        *,
        horizon: float | None = None,
        false_alarms: float = 0.01,
    ) -> Guarded:
        """A system with a guard in each run, for `run`; the clock is not checked.

        Args:
            system: anything with `signals` and `run(test)` that closes the loop with the test's controller.
            fallback: as for `guard`.
            horizon: as for `guard`.
            false_alarms: as for `guard`.

        Returns:
            A system; its runs are "aborted" where the guard ended them.
        """
        return Guarded(
            system,
            lambda test: self.guard(test, fallback, horizon=horizon, false_alarms=false_alarms, clock=None),
        )

    # What came out

    @property
    def twin(self) -> Twin:
        """The best model, after learning all runs; the best so far after an interruption."""
        self._learn()
        known, twin = self._shown_twin or (None, None)
        now = self._method.memory.latest, self._book.revision
        if twin is None or known is None or known[0] is not now[0] or known[1] != now[1]:
            twin = self._method.knowledge(self._book).twin(self._workers)
            self._shown_twin = (
                now,
                twin,
            )  # one object as long as nothing is learnt or told: it remembers what it flew
        return twin

    @property
    def best_test(self) -> Test:
        """The controller to fly, without excitation, after learning all runs.

        With the preset "default": the gains tuned on the committee, or the best flown gains if the committee is not
        confident that the tuned ones are better. With "paper": the flown test that ended nearest to its target. It
        has the quality that the twin predicts and, if it was flown, the measured one. To fly it, make a test of its
        gains with `campaign.test`.

        Raises:
            NotAvailable: there is no run.
            NotTrusted: with "default", no controller to fly: no flight was completed, and the twin does not support
                its preferred gains.
        """
        with self._at_work():
            self._learn()
            best = self._method.best_test(self._book, at_once=self.interrupted)
            self._keep()  # who looks later need not tune again
            return best

    @property
    def controller(self) -> Controller:
        """The controller of `best_test`, for a real loop: `.parameters`, `.reset()`, `.command(state, target)`.

        It is one object with one memory as long as the gains of `best_test` are the same: call `reset` before each
        run. After a new run the gains may change; then it is another controller, at rest.
        """
        best = self.best_test
        if self._controller is None or self._controller.genes.tobytes() != best.genes.tobytes():
            self._controller = best.controller()
        return self._controller

    def examine(self) -> Examination:
        """The numbers that an engineer checks, each computed on first access, after learning all runs.

        Raises:
            NotAvailable: there is no run.
        """
        self._learn()
        known = self._method.knowledge(self._book)
        twins = known.twins_before()
        return Examination(
            Known(
                setup=self.setup,
                experiments=self.experiments,
                twin=self.twin,
                history=self.history,
                best_test=lambda: self.best_test,
                twins=twins,
                error=self._error_on,
                innovations=known.innovations(self._workers),
                rivals=known.rivals(),
                fared=self._fared,
            )
        )

    def checks(self) -> Checks:
        """Whether the twin can be trusted and the controller flown, check by check; printable.

        Returns:
            Checks with their value, limit and sentence; `passed` says whether all binding checks pass, `twin_passed`
            whether those of the twin pass.

        Raises:
            NotAvailable: there is no run.
        """
        return checks(self.examine())

    def certificate(self) -> Certificate:
        """The controller to fly with the evidence for it and what was not tested, or why it is refused.

        Raises:
            NotAvailable: there is no run.
        """
        return certificate(self)

    def margins(
        self, parameters: Mapping[str, float] | ArrayLike | None = None, broken_at: str = "axes"
    ) -> Margins:
        """Stability margins of a controller's loops around the target, on the twin and on its committee.

        Each loop is broken at one place while the others stay closed. The loops are in discrete time, with the delays
        and lags of actuators. The twin is linearised at the target under the command that holds it, the controller at
        zero error. Dry friction damps strongly there, as long as it sticks, and not at all as it slides: each margin is
        the worse of the two.

        Args:
            parameters: gains of the controller, by name or in order; None: those of `best_test`.
            broken_at: "axes", between the law of each axis and the mixer, or "commands".

        Returns:
            Gain, phase and delay margins, crossover, Ms and Mt of each loop, nominal and the worst of the committee.

        Raises:
            InvalidInput: unknown gains, or another place to break a loop.
            NotAvailable: there is no run, or the twin or the controller cannot be linearised there.
        """
        genes = self.best_test.genes if parameters is None else self.family.genes(parameters)
        loops, names = loops_around(self.twin, self.setup, genes, broken_at)
        sliding, _ = loops_around(self.twin, self.setup, genes, broken_at, slides=True)
        return margins_of(loops, names, broken_at, sliding)

    def export_twin(
        self, to: str | Path, *, kind: str | None = None, precision: str = "double", force: bool = False
    ) -> str | tuple[Path, ...]:
        """The twin for use elsewhere: `twin.export`, refused if a binding check of the twin fails.

        Args:
            to: a kind, or the path of a file with the suffix of one.
            kind: of the file, if its suffix is not enough.
            precision: of C, "double" or "float".
            force: exports also a twin that fails a check, and without a comparison.

        Returns:
            The text if `to` is a kind, else the paths that were written.

        Raises:
            InvalidInput: no such kind, or a path that cannot be written.
            NotTrusted: the twin fails a check.
            NotAvailable: the export could not be checked on its flights.
        """
        return taken_twin(self, to, kind, precision, force)

    def export_controller(
        self,
        to: str | Path,
        parameters: Mapping[str, float] | ArrayLike | None = None,
        *,
        kind: str | None = None,
        precision: str = "double",
        force: bool = False,
    ) -> str | tuple[Path, ...]:
        """A controller as Python or C99 without dependencies, one call per period; clipped, with all its options.

        Without `parameters` it is refused if its gains have not flown inside the envelope and would not be certified.
        It is run on the states of the campaign's flights and compared with the controller itself: differences above
        1e-9 of a command's scale are refused (1e-3 in single precision).

        Args:
            to: "python" or "c", or the path of a file that ends in ".py" or ".c".
            parameters: gains, by name or in order; None: those of `best_test`.
            kind: of the file, if its suffix is not enough.
            precision: of C, "double" or "float".
            force: exports without the comparison, and what is not certified.

        Returns:
            The text if `to` is a kind (in C the header, then the source), else the paths that were written.

        Raises:
            InvalidInput: unknown gains, no such kind, or a path that cannot be written.
            NotTrusted: no controller to fly, or one that has not flown and is refused a certificate.
            NotAvailable: a family in Python, or an export that could not be checked.
        """
        return taken_controller(self, to, kind, parameters, precision, force)

    @property
    def committee(self) -> tuple[_core.Model, ...]:
        """The models that judge tests, the best first, after learning all runs."""
        self._learn()
        return tuple(self._method.committee())

    @property
    def models(self) -> _core.ModelSearch:
        """The paper's model loop as a value, after learning all runs.

        Raises:
            NotAvailable: the preset has no such loop, or there is no run.
        """
        self._learn()
        if not isinstance(self._method, Coevolution):
            raise NotAvailable(
                f"Campaign.models: expected the preset 'paper', found {self.setup.preset!r}, which has no model loop;"
                " use `committee`."
            )
        return self._method.models

    @property
    def experiments(self) -> tuple[Experiment, ...]:
        """All runs, told and attached, in order."""
        return tuple(self._book.experiments)

    @property
    def tests(self) -> tuple[Test, ...]:
        """All tests, by their numbers."""
        return tuple(self._book.tests)

    @property
    def asked(self) -> tuple[Test, ...]:
        """Tests from `ask`, flown or not, in order; all others are somebody's own."""
        return tuple(self._book.tests[entry.test] for _, entry in self._book.asked)

    @property
    def waiting(self) -> tuple[Test, ...]:
        """Tests from `ask` that wait for their run: neither told nor abandoned, in order."""
        return tuple(self._book.waiting())

    @property
    def waiting_last(self) -> Test | None:
        """The waiting test that is the last: it flies the gains of today's `ask(last=True)`. None: there is none.

        All runs are learnt first. Where `ask(last=True)` plans what `ask()` does, it is the first one that waits.
        """
        if not self._book.waiting():
            return None
        with self._at_work():
            self._learn()
            found = self._method.waiting_last(self._book)
            self._keep()  # who asks later need not tune again
            return found

    @property
    def trusted(self) -> Test | None:
        """The first test known to fly: all its runs ended inside the envelope, and none has failed. None: no test is.

        Its gains are those to go back to.
        """
        return standing.trusted(self._book)

    @property
    def runs(self) -> int:
        """Number of runs of tests on the system, with failures, without attached runs."""
        return self._book.runs

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Failed tests, in the order of `tell_failed`."""
        return tuple(self._book.failures)

    @property
    def withdrawals(self) -> tuple[Withdrawal, ...]:
        """Flights that were withdrawn, in order; they are neither in `experiments` nor in `failures`."""
        return tuple(self._book.withdrawals)

    @property
    def withdrawn_logs(self) -> tuple[str, ...]:
        """Of each of `withdrawals`, what the log of the attached run is called; empty where nobody has said so."""
        return tuple(
            "" if each.run is None else self._book.recorded[each.run].log for each in self.withdrawals
        )

    @property
    def rmse(self) -> Floats:
        """Root mean square of flown minus simulated over all flights, each from where it began (n_x,), in each unit."""
        return rmse(self.twin, self._book.experiments)

    @property
    def advice(self) -> Advice | None:
        """The expected benefit of another experiment, after learning all runs; None with the preset "paper"."""
        twin, history = self.twin, self.history
        lessons = [record for record in history if isinstance(record, Lesson)]
        return advice(twin, self.setup, lessons, controller_to_fly(self)[0]) if lessons else None

    @property
    def cost(self) -> Cost:
        """The cost of the campaign on the system so far: runs, seconds, envelope, loss of quality."""
        return cost(self._book)

    @property
    def plot(self) -> Plots:
        """Figures by name, such as `campaign.plot.unseen()`; `campaign.plot(path)` draws all flights, .svg or .png."""
        return plots(self)

    def report(self, to: str | Path | None = None, name: str = "campaign") -> str:
        """The whole result, after a verdict of three sentences; `print(campaign)` shows it.

        Args:
            to: a file that ends in ".html", for one page with figures that needs nothing else; None: as text.
            name: of the campaign, for its title.

        Returns:
            The text, or the page that was written.

        Raises:
            InvalidInput: a file that cannot be written.
            NotAvailable: there is no run, or Jinja2 is missing.
        """
        return reported(self, to, name)

    def __str__(self) -> str:
        return self.report() if self._book.experiments else repr(self)

    def __repr__(self) -> str:
        experiments = len(self._book.experiments)
        return f"Campaign(preset={self.setup.preset!r}, seed={self.setup.seed}, experiments={experiments})"

    @property
    def history(self) -> tuple[Iteration, ...] | tuple[Lesson, ...]:
        """One record for each iteration of the loop; after an interruption the last one may be unfinished."""
        return self._method.history(self._book)

    # Inside

    def _learn(self) -> None:
        if not self._book.experiments:
            raise NotAvailable(
                "Expected at least one recorded experiment, found none; first fly a controller you "
                "trust: test = campaign.test(gains), then campaign.tell(test, system.run(test))."
            )
        before = self._method.memory
        with self._at_work():
            self._method.learn(self._book, at_once=self.interrupted)
            self._keep()
        latest = self.history[-1] if self._method.memory is not before and self.history else None
        if isinstance(latest, Lesson):
            warn(latest.remarks, stacklevel=3)

    def _warn_of_last(self, asked: Test | None) -> None:
        """Says at once what speaks against the last flight, while somebody can still look at the rig."""
        warn(against(self._book.experiments[-1], asked, self.signals), stacklevel=3)

    def _error_so_far(self, run: Experiment) -> float | None:
        """On a new run, of the model at the last `ask`: a look must not change it.

        None where that model had learnt a flight that is withdrawn: only a look has learnt again what is left.
        """
        model = None if self._book.forgot_last_ask else self._method.asked_model
        return None if model is None else self._error_on(model, run)

    def _error_on(self, model: _core.Model, run: Experiment) -> float:
        return whole_error(model, run, self.setup, self._workers)

    def _fared(self, genes: Floats) -> Fared:
        return standing.fared(self._book, genes, excited=False)

    @contextmanager
    def _at_work(self, name: str = "campaign", experiments: int | None = None) -> Iterator[None]:
        """Work that shows its progress, and that Ctrl-C interrupts without loss."""
        total = len(self._book.experiments) if experiments is None else experiments
        try:
            with self._own_progress.during(name, total):
                yield
        except KeyboardInterrupt:
            self.interrupted = True
            self._keep()
            raise

    def _report_experiment(self) -> None:
        progress = Progress(
            "experiment", self._method.iteration, 0, 0, len(self._book.experiments), (), (), (), 0, 0
        )
        self._report(progress)

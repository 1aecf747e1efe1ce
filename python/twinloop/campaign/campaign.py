"""The double loop, counted in experiments: ask for a test, fly it, tell what happened (section III.C)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from twinloop import _core
from twinloop.arrays import Floats, floats, whole
from twinloop.campaign import standing
from twinloop.campaign.assessment import Advice, advice, controller_to_fly, rmse
from twinloop.campaign.certificate import Certificate, certificate
from twinloop.campaign.coevolution.method import Coevolution
from twinloop.campaign.cost import Cost, cost
from twinloop.campaign.examination.check import Checks
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.examination import Earlier, Examination
from twinloop.campaign.examination.loops import loops_around
from twinloop.campaign.flying import checked_budget, checked_risk, fly
from twinloop.campaign.guarding import guard_of
from twinloop.campaign.history import Experiment, Failure, Iteration, Lesson, Planned, Progress
from twinloop.campaign.persistence import Persistent
from twinloop.campaign.presets import AnyOptions
from twinloop.campaign.ranking import ranked
from twinloop.campaign.reporting import plots, reported
from twinloop.campaign.setup import checked, refuse_arguments
from twinloop.campaign.taking_away import taken_controller, taken_twin
from twinloop.controllers import Controller, Family, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.guard import Guard, Guarded
from twinloop.law.linear.margins import Margins, margins_of
from twinloop.law.twin import Twin
from twinloop.objectives import closed_loop
from twinloop.remarks import warn
from twinloop.showing import Shown
from twinloop.signals import Signals
from twinloop.systems import System
from twinloop.test import Test
from twinloop.trajectory import Trajectory

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
        weights: of states in the quality, by name, such as {"pitch": 2.0}. By default the states that a task is about
            count with 1 and rates with 0, each in units of its scale ("final_distance": all with 1, as they are).
        operators: that evolved programs may use; by default the preset's.
        threads: how many the engine may use, by default all that there are; no result depends on it.
        progress: called with a `Progress` a few times a second while the loops run.
        store: a file of SQLite, or the address of a database such as "postgresql+psycopg://user@host/database", where
            all that is asked and told is committed before the call returns. A campaign of this name that is there
            already, with the same arguments, goes on with the same bits. None: nothing outlives the process.
        name: of the campaign in its store, which may hold several.

    Raises:
        InvalidInput: an argument that cannot be used, or that this version does not have.
        NotAvailable: the packages of the extra `store` are missing.
        StoreFailure: somebody else writes the campaign, or the store cannot be written.
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
        progress: Callable[[Progress], None] | None = None,
        store: str | Path | None = None,
        name: str = "campaign",
        **other: object,
    ) -> None:
        refuse_arguments("Campaign", other, list(signature(Campaign).parameters)[:-1])
        setup = checked(
            signals, controller, initial_state, target_state, duration, preset, options, seed, goal, quality,
            operators, weights,
        )  # fmt: skip
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
        """Of the preset, with those that were changed."""
        return self.setup.options

    # Ask and tell

    def test(
        self, gains: Mapping[str, float] | ArrayLike, excitation: ArrayLike | str | None = GENTLE
    ) -> Test:
        """A test with gains of your own: the first one, a controller that you already trust.

        Args:
            gains: all gains by name, or (size,) in order; in their units and bounds.
            excitation: what is added to the controller's commands (steps, n_u), in their units; the sum is
                clipped to the commands' bounds. None: nothing. By default the preset's own, a gentle one that
                fades out and is held back by what the states do; the preset "paper" has none.

        Returns:
            The test, to be flown and told.

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
        """Learns from all that was told, then picks the test on which the best models disagree.

        Asking again without telling learns nothing new and gives another test.

        Args:
            last: whether no other test will be asked for. The preset "default" then flies the best gains that it
                knows, without excitation, unless its option `exploit_last` is off or `tests` asks no committee; to
                "paper", whose tests have no excitation, it means nothing.

        Returns:
            The test, to be flown and told, with its predicted quality, its risk and the reason for it.

        Raises:
            NotAvailable: nothing was told yet.
        """
        self.interrupted = False
        self._learn()
        with self._interruptible(), self._entering():
            return self._method.ask(self._book, bool(last))

    def ask_batch(self, size: int = 3) -> tuple[Test, ...]:
        """Alternatives to be flown in any order, or not at all: all tests that wait, asked for until there are `size`.

        Each is asked for as by `ask`, from what is known now. Tell each that was flown and abandon the others; nothing
        is learnt from a test that was not flown. Calling it again, also after a crash, asks for what is missing only.

        Args:
            size: how many shall wait.

        Returns:
            The tests that wait, the one most worth flying first: those that keep the envelope before the others, then
            by the bits that a flight would tell, or with the goal "control" by the predicted quality.

        Raises:
            NotAvailable: nothing was told yet.
            InvalidInput: no whole number of at least 1.
        """
        wanted = whole("Campaign.ask_batch, size", size, least=1)
        while len(self._book.waiting()) < wanted:
            self.ask()
        plans = {plan.test: plan for _, plan in self._book.asked if isinstance(plan, Planned)}
        return ranked(self._book.waiting(), plans, self.setup.goal)

    def tell(self, test: Test, trajectory: Trajectory) -> None:
        """Adds a run to what is to be learnt. Tests may be told in any order; one told again is a replicate.

        Args:
            test: from this campaign.
            trajectory: what the system answered; shorter than the test if the run was cut.

        Raises:
            InvalidInput: a test of another campaign, or a useless trajectory; nothing has changed.
        """
        with self._entering():
            self._book.tell(test, trajectory, self._error_so_far)
        self.interrupted = False

    def tell_failed(self, test: Test, reason: str, partial: Trajectory | None = None) -> None:
        """Tells that a test failed on the system: that, too, is a result.

        It has no quality, counts as a run, and speaks against its gains: the preset "default" never takes them, or
        gains close to them, for known to fly.

        Args:
            test: from this campaign.
            reason: what happened, in a few words.
            partial: what was recorded until then, of at least one step; it is learnt from. None: nothing.

        Raises:
            InvalidInput: a test of another campaign, no reason, or a useless record; nothing has changed.
        """
        with self._entering():
            self._book.fail(test, reason, partial, self._error_so_far)
        self.interrupted = False

    def attach(self, trajectory: Trajectory) -> None:
        """Adds a run that nobody asked for, of any length and under any commands, to what is to be learnt.

        The twin is judged on it by its free run under the recorded commands. It has no quality, and is no run of a
        test: `run` does not count it.

        Args:
            trajectory: of the same signals.

        Raises:
            InvalidInput: a useless trajectory; nothing has changed.
            NotAvailable: the preset "paper" learns from tests of its controllers only.
        """
        if isinstance(self._method, Coevolution):
            raise NotAvailable(
                "Campaign.attach: expected the preset 'default', found 'paper', which learns from tests of its"
                ' controllers only; choose preset="default".'
            )
        with self._entering():
            self._book.attach(trajectory, self._error_so_far)
        self.interrupted = False

    def abandon(self, test: Test) -> None:
        """Says that a test will not be flown: `run` does not fly it. If it is flown after all, tell it.

        Args:
            test: from this campaign, of which no run was told.

        Raises:
            InvalidInput: a test of another campaign, or one that was flown.
        """
        with self._entering():
            self._book.abandon(test)

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
        """The whole loop; the last test is that of `ask(last=True)`.

        What was asked for, and neither told nor abandoned, is flown first. Where nothing was told, the first test is
        the last one made by `campaign.test`, or that of `system.default_gains`.

        A test in which the system raises a `SystemFailure` has failed, as by `tell_failed`. The loop goes on with
        another one if some test was flown and the one before did not fail; if not, the failure is raised.

        Args:
            system: anything with `signals` and `run(test)`.
            experiments: runs on the system in all, the first, those told before and those that failed included, those
                that were attached not.
            timeout: seconds that the system may take for a test; None: as long as it wants.
            max_risk: probability, by the committee, that a test leaves the envelope, above which it is not flown; None:
                any. Tests of your own have none that is known, and are flown.

        Returns:
            The campaign.

        Raises:
            InvalidInput: no system, one that answers with something else than a usable trajectory, fewer experiments
                than were told already, or a `max_risk` that is no probability.
            KeyboardInterrupt: Ctrl-C. Nothing that was told is lost: `interrupted` says so, the results give the best
                so far, and calling again goes on from there with the same bits.
            NotAvailable: there is no first test.
            NoAnswer: the system did not answer in time; its test still waits and nothing is lost.
            SystemFailure: the first test failed, or two in a row; both are told.
            TooRisky: a test is riskier than `max_risk`; it waits. Raise `max_risk`, fly it by hand, or abandon it.
        """
        budget, allowed = checked_budget(self, system, experiments), checked_risk(max_risk)
        self.interrupted = False
        if self._keeping is not None:
            self._keeping.fly(system, budget)
        with self._interruptible():
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
        """A test's controller with a watch, for a loop of one's own: `reset`, `command(state, target)`, `tripped`.

        It looks at readings, envelope and clock, and, where a twin follows the flights so far, at its band and ahead
        with its committee. Once something is wrong it gives the fallback's commands; `guard.trajectory(last)` is told.

        Args:
            test: that is flown.
            fallback: gains by name; or a command that is safe to hold (n_u,), in its units. None: the first controller
                that was flown, or, before any was, the test's own without its excitation.
            horizon: how far it looks ahead, s; 0: not at all. None: a fifth of the test.
            false_alarms: share of flights, by the committee's own account, that the watch of the band may end.
            overrun: share of the period by which a period may be late.
            clock: gives the time in s; None: time is not watched.

        Returns:
            The guard, at the start of a flight.

        Raises:
            InvalidInput: a test for other signals, or arguments that do not fit.
            NotAvailable: controllers in Python, in whose memory nobody can look ahead; pass horizon=0.
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
        """A system whose every run has a guard in its loop, for `run`; the clock is not watched.

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
        """The best model, after learning all that was told; the best so far after an interruption."""
        self._learn()
        return self._method.twin(self._book)

    @property
    def best_test(self) -> Test:
        """The controller to fly, without excitation, after learning all that was told.

        With the preset "default": the gains tuned on the committee, unless it is not confident that they beat the
        best ones flown. With "paper": the flown test that ended nearest to its target. It carries the quality that
        the twin predicts and, if it was flown, the measured one. To fly and tell it, make a test of it with
        `campaign.test`.

        Raises:
            NotAvailable: nothing was told; or, with "default", there is no controller to fly: none has flown to its
                end, and the twin cannot answer for the one that it prefers.
        """
        self._learn()
        with self._interruptible():
            best = self._method.best_test(self._book, at_once=self.interrupted)
            self._keep()  # who looks later need not tune again
            return best

    @property
    def controller(self) -> Controller:
        """That of `best_test`, for a real loop: `.parameters`, `.reset()`, `.command(state, target)`.

        It is one object with one memory for as long as the gains of `best_test` are the same: call `reset` before each
        run. Other gains, which only something that was told can bring, are another controller, at rest.
        """
        best = self.best_test
        if self._controller is None or self._controller.genes.tobytes() != best.genes.tobytes():
            self._controller = best.controller()
        return self._controller

    def examine(self) -> Examination:
        """All that an engineer checks, computed when it is asked for, after learning all that was told.

        Raises:
            NotAvailable: nothing was told.
        """
        self._learn()
        known, book = self._method, self._book
        twins = known.twins_before(book)
        errors = closed_loop([twin.model for _, twin in twins], book.selected, self._workers)
        return Examination(self, Earlier(twins, errors, known.innovations(book), known.rivals(book)))

    def checks(self) -> Checks:
        """Whether the twin may be believed and the controller flown, check by check; printable.

        Returns:
            Checks with their value, limit and sentence; `passed` says whether all that bind hold, `twin_passed` whether
            those of the twin do.

        Raises:
            NotAvailable: nothing was told.
        """
        return checks(self.examine())

    def certificate(self) -> Certificate:
        """The controller to fly with what speaks for it and what nobody tested, or why it is refused.

        Raises:
            NotAvailable: nothing was told.
        """
        return certificate(self)

    def margins(
        self, parameters: Mapping[str, float] | ArrayLike | None = None, broken_at: str = "axes"
    ) -> Margins:
        """How far the loops of a controller are from instability around the target, on the twin and on its committee.

        Each loop is broken at one place while the others stay closed. All is in discrete time, with the delays and lags
        of actuators. The twin is linearised at the target under the command that holds it, the controller where its
        error is 0.

        Args:
            parameters: gains of the controller, by name or in order; None: those of `best_test`.
            broken_at: "axes", where the law of each axis leaves for the mixer, or "commands".

        Returns:
            Gain, phase and delay margins, crossover, Ms and Mt of each loop, nominal and the worst of the committee.

        Raises:
            InvalidInput: unknown gains, or another place to break a loop at.
            NotAvailable: nothing was told, or the twin or the controller cannot be linearised there.
        """
        genes = self.best_test.genes if parameters is None else self.family.genes(parameters)
        loops, names = loops_around(self.twin, self.setup, genes, broken_at)
        return margins_of(loops, names, broken_at)

    def export_twin(
        self, to: str | Path, *, kind: str | None = None, precision: str = "double", force: bool = False
    ) -> str | tuple[Path, ...]:
        """The twin for use elsewhere: `twin.export`, refused where a check of the twin that binds fails.

        Args:
            to: a kind, or the path of a file with the suffix of one.
            kind: of the file where its suffix does not say it.
            precision: of C, "double" or "float".
            force: also a twin that fails a check, and without comparing what is made.

        Returns:
            The text where a kind was asked for, else the paths that were written.

        Raises:
            InvalidInput: no such kind, or a path that cannot be written.
            NotAvailable: the twin fails a check, or the export could not be checked on its flights.
        """
        return taken_twin(self, to, kind, precision, force)

    def export_controller(
        self,
        to: str | Path,
        parameters: Mapping[str, float] | ArrayLike | None = None,
        *,
        precision: str = "double",
        force: bool = False,
    ) -> str | tuple[Path, ...]:
        """A controller as Python or C99 without dependencies, one call a period; clipped, with all its options.

        It is run on the states of the campaign's flights and compared with the controller itself: differences above
        1e-9 of a command's scale are refused (1e-3 in single precision).

        Args:
            to: "python" or "c", or the path of a file that ends in ".py" or ".c".
            parameters: gains, by name or in order; None: those of `best_test`.
            precision: of C, "double" or "float".
            force: without the comparison.

        Returns:
            The text where a kind was asked for (in C the header, then the source), else the paths that were written.

        Raises:
            InvalidInput: unknown gains, no such kind, or a path that cannot be written.
            NotAvailable: a family of one's own, or an export that could not be checked.
        """
        return taken_controller(self, to, parameters, precision, force)

    @property
    def committee(self) -> tuple[_core.Model, ...]:
        """Models that judge tests, the best first, after learning all that was told."""
        self._learn()
        return tuple(self._method.committee())

    @property
    def models(self) -> _core.ModelSearch:
        """The paper's model loop as a value, after learning all that was told.

        Raises:
            NotAvailable: the preset has no such loop, or nothing was told.
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
        """All that was told and attached, in order."""
        return tuple(self._book.experiments)

    @property
    def tests(self) -> tuple[Test, ...]:
        """All that were made, by their numbers."""
        return tuple(self._book.tests)

    @property
    def waiting(self) -> tuple[Test, ...]:
        """Tests that were asked for, and neither told nor abandoned, in their order."""
        return tuple(self._book.waiting())

    @property
    def runs(self) -> int:
        """Runs of tests on the system, the failed ones too; those that were attached are none of a test."""
        return self._book.runs

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Tests that failed, in the order they were told."""
        return tuple(self._book.failures)

    @property
    def rmse(self) -> Floats:
        """Root mean square of flown minus simulated over all flights, each from where it began (n_x,), in each unit."""
        return rmse(self.twin, self._book.experiments)

    @property
    def advice(self) -> Advice | None:
        """What another experiment would bring, after learning all that was told; None with the preset "paper"."""
        twin, history = self.twin, self.history
        lessons = [record for record in history if isinstance(record, Lesson)]
        return advice(twin, self.setup, lessons, controller_to_fly(self)[0]) if lessons else None

    @property
    def cost(self) -> Cost:
        """What the campaign has cost on the system so far: runs, seconds, envelope, quality given away."""
        return cost(self._book)

    @property
    def plot(self) -> Any:
        """Figures by name, such as `campaign.plot.unseen()`; `campaign.plot(path)` draws all flights, .svg or .png."""
        return plots(self)

    def report(self, to: str | Path | None = None, name: str = "campaign") -> str:
        """The whole result for a person, beginning with a verdict of three sentences; `print(campaign)` shows it.

        Args:
            to: a file that ends in ".html", for one page with figures that needs nothing else; None: as text.
            name: of the campaign, for its title.

        Returns:
            The text, or the page that was written.

        Raises:
            InvalidInput: a file that cannot be written.
            NotAvailable: nothing was told, or Jinja2 is missing.
        """
        return reported(self, to, name)

    def __str__(self) -> str:
        return self.report() if self._book.experiments else repr(self)

    def __repr__(self) -> str:
        told = len(self._book.experiments)
        return f"Campaign(preset={self.setup.preset!r}, seed={self.setup.seed}, experiments={told})"

    @property
    def history(self) -> tuple[Iteration, ...] | tuple[Lesson, ...]:
        """One record for each turn of the loop; the last may be unfinished after an interruption."""
        return self._method.history(self._book)

    # Inside

    def _learn(self) -> None:
        if not self._book.experiments:
            raise NotAvailable(
                "Expected at least one experiment that was told, found none; first fly a controller you "
                "trust: test = campaign.test(gains), then campaign.tell(test, system.run(test))."
            )
        before = self._method.memory
        with self._interruptible():
            self._method.learn(self._book, at_once=self.interrupted)
            self._keep()
        latest = self.history[-1] if self._method.memory is not before and self.history else None
        if isinstance(latest, Lesson):
            warn(latest.remarks, stacklevel=3)

    def _error_so_far(self, alone: _core.SelectedTests) -> float | None:
        """On a run that is being told, of the model that the last `ask` knew: a look must not change it."""
        model = self._method.asked_model
        return None if model is None else float(closed_loop([model], alone, self._workers)[0, 0])

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        try:
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

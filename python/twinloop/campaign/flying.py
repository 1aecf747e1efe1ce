"""Flying: the loop of `Campaign.run`, from the test that is next to what became of it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from twinloop._ground.arrays import share, whole
from twinloop._ground.texts import whole_characters
from twinloop.campaign.assessment import latest_lesson
from twinloop.campaign.rescue import rescued
from twinloop.errors import InvalidInput, NoAnswer, NotAvailable, StoreFailure, SystemFailure, TooRisky
from twinloop.signals import Signals
from twinloop.store.uninterrupted import uninterrupted
from twinloop.systems import System
from twinloop.systems.patience import run_within
from twinloop.systems.raised import came_through
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign


def checked_budget(campaign: Campaign, system: object, experiments: int) -> int:
    """The runs on the system in all, once they can be made.

    Args:
        campaign: that shall fly.
        system: to be flown.
        experiments: total number of runs on it, earlier ones included.

    Raises:
        InvalidInput: no system, or fewer experiments than were told already.
    """
    budget = whole("Campaign.run, experiments", experiments, least=1)
    described = isinstance(getattr(system, "signals", None), Signals)
    if not (described and callable(getattr(system, "run", None))):
        raise InvalidInput(
            "Campaign.run, system: expected an object with twinloop.Signals as `signals` and with `run(test)`, "
            f"found {type(system).__name__}; add them."
        )
    if budget < campaign.runs:
        raise InvalidInput(
            f"Campaign.run, experiments: expected at least the {campaign.runs} runs that are recorded already, found"
            f" {budget}; every run counts, so for one more say {campaign.runs + 1}."
        )
    return budget


def checked_risk(max_risk: float | None) -> float:
    """The risk above which no test is flown.

    Args:
        max_risk: a probability; None: any risk is taken.

    Raises:
        InvalidInput: no probability.
    """
    return 1.0 if max_risk is None else share("Campaign.run, max_risk", max_risk)


def fly(
    campaign: Campaign,
    system: System,
    budget: int,
    timeout: float | None,
    allowed: float,
    announce: Callable[[], None],
) -> None:
    """Flies and tells one test after another until the budget is spent.

    Args:
        campaign: that asks and learns.
        system: to be flown.
        budget: runs on it in all.
        timeout: seconds that it may take for a test; None: as long as it wants.
        allowed: probability above which a test that may leave the envelope is not flown.
        announce: called before each flight.
    """
    failed = False
    while campaign.runs < budget:
        waited = bool(campaign.waiting)
        test = _next(campaign, system, last=campaign.runs + 1 == budget)
        check_signals(test, system.signals)
        if not waited:
            _refuse_silence(campaign, test)
        if _risk(campaign, test) > allowed:
            found = "one that no committee has estimated" if test.risk is None else f"{test.risk:.3g}"
            # Without a store it waits as long as this process lasts, and a command ends with this sentence.
            kept = (
                " and still waits: fly it by hand, abandon it, or raise max_risk."
                if campaign.store is not None
                else ": raise max_risk, or keep the campaign in a store, where a test waits to be flown by hand."
            )
            raise TooRisky(
                f"Campaign.run: expected a test that leaves the envelope with a probability of at most"
                f" {allowed:.3g}, found {found} for test {test.number}; the test was not flown{kept}"
            )
        announce()
        before = len(campaign.experiments)
        try:
            failed = _flown(campaign, system, test, timeout, failed)
        finally:
            # A test that failed has left no flight; one that landed at Ctrl-C has.
            if campaign.landed is not None and len(campaign.experiments) > before:
                campaign.landed(test, campaign.experiments[-1])


def _risk(campaign: Campaign, test: Test) -> float:
    """The highest risk that a test may have: any where it was asked for and nobody has estimated one.

    A test of somebody's own is flown at their own risk.
    """
    if test.risk is not None:
        return test.risk
    return 1.0 if any(test.number == asked.number for asked in campaign.asked) else 0.0


def _refuse_silence(campaign: Campaign, test: Test) -> None:
    """Ends the loop where no reading ever moved: somebody has to look at the rig. A test that waits flies then."""
    lesson = latest_lesson(campaign)
    silent = (
        []
        if lesson is None
        else [each for each in lesson.remarks if each.code == "never-moved" and each.serious]
    )
    if silent:
        raise NoAnswer(
            f"Campaign.run: expected readings that move, found: {silent[0].sentence} Test {test.number} was not flown;"
            " where all is well now, run again to fly it, and withdraw the flights without readings."
        )


def refused_an_answer(reason: BaseException) -> bool:
    """Whether it was what the system answered that could not be entered; its test still waits.

    Args:
        reason: that came out of `campaign.run`.
    """
    return isinstance(reason, InvalidInput) and came_through(reason, _enter.__code__)


def _next(campaign: Campaign, system: System, last: bool) -> Test:
    """What waits; a first test that was made; or one that is asked for now."""
    if campaign.waiting:
        return campaign.waiting[0]
    made = _made(campaign)
    if made is not None:
        return made
    if campaign.experiments:
        return campaign.ask(last)
    if campaign.failures:
        raise NotAvailable(
            "Campaign.run: expected a first test that has not failed, found none; make one with"
            " campaign.test(gains), from another controller that you trust, or withdraw the failure if the gains were"
            " not its cause: campaign.withdraw(number, why)."
        )
    gains = getattr(system, "default_gains", None)
    if gains is None:
        raise NotAvailable(
            "Campaign.run: expected a first test, found none and no `default_gains` of "
            f"{type(system).__name__}; make one with campaign.test(gains), from a controller you trust."
        )
    return campaign.test(gains)


def _made(campaign: Campaign) -> Test | None:
    """Before there is a run of any test: the last one that was made, and neither failed nor was abandoned."""
    if any(not run.attached for run in campaign.experiments):
        return None
    return next((test for test in reversed(campaign.tests) if campaign.status(test) == "asked"), None)


def _flown(campaign: Campaign, system: System, test: Test, timeout: float | None, again: bool) -> bool:
    """One run, entered with its result: whether the system failed, which it may not do `again`."""
    landed: list[Trajectory] = []
    try:
        _land(campaign, system, test, timeout, landed)
        _record(campaign, test, landed)
    except NoAnswer:
        raise
    except SystemFailure as failure:
        campaign.tell_failed(test, whole_characters(str(failure)).strip() or type(failure).__name__)
        if again or not campaign.experiments:
            raise
        return True
    except BaseException:
        # Ctrl-C between the end of the flight and its record: the flight is what must not be lost.
        _record(campaign, test, landed)
        raise
    return False


def _land(
    campaign: Campaign, system: System, test: Test, timeout: float | None, landed: list[Trajectory]
) -> None:
    """Flies a test. A flight that was cut short, or gave no answer, does not count in the system's `runs`."""
    runs = getattr(system, "runs", None)
    try:
        run_within(system, test, timeout, landed)
    except (KeyboardInterrupt, NoAnswer) as reason:
        if not landed and getattr(system, "runs", None) != runs:
            with suppress(AttributeError):  # one that nobody else may set
                setattr(system, "runs", runs)  # noqa: B010 - a system need not declare it
        if isinstance(reason, KeyboardInterrupt):
            raise
        # As for what is too risky: without a store nothing outlasts this process.
        kept = (
            "The test still waits and nothing is lost: continue, or abandon the test."
            if campaign.store is not None
            else "The test waits no longer than this process lasts; a campaign in a store can be continued in another."
        )
        raise NoAnswer(f"{reason} {kept}") from reason


def _record(campaign: Campaign, test: Test, landed: list[Trajectory]) -> None:
    """Enters what has landed, if it is not entered yet; Ctrl-C waits until it is."""
    with uninterrupted():
        if not landed:
            return
        trajectory = landed.pop()
        try:
            _enter(campaign, test, trajectory)
        except StoreFailure as failure:
            raise StoreFailure(f"{failure} {rescued(test, trajectory)}") from failure


def _enter(campaign: Campaign, test: Test, trajectory: Trajectory) -> None:
    if isinstance(trajectory, Trajectory) and trajectory.ended != "completed" and trajectory.steps < 2:
        # Ended before there was anything to learn from: that it was is the result.
        campaign.tell_failed(test, trajectory.reason.strip() or "ended at once")
    else:
        campaign.tell(test, trajectory)

"""`campaign.run`: a test that is too risky is not flown, and one in which the system fails has failed."""

from unittest.mock import Mock

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, TINY
from lives import CONTROLLER, SMALL
from twinloop.campaign.rescue import rescued
from twinloop.logs.files import read_log


class Failing(tl.System):
    """Fails in the runs of some numbers."""

    default_gains, words = PENDULUM_GAINS, "The motor cut out."

    def __init__(self, system, fails):
        self.system, self.fails, self.count = system, fails, -1

    @property
    def signals(self):
        return self.system.signals

    def run(self, test):
        self.count += 1
        if self.count in self.fails:
            raise tl.SystemFailure(self.words)
        return self.system.run(test)


def test_a_test_in_which_the_system_fails_has_failed_and_the_loop_goes_on(new_campaign, pendulum):
    campaign = new_campaign().run(Failing(pendulum, {1}), 3)
    assert [failure.reason for failure in campaign.failures] == ["The motor cut out."]
    assert campaign.status(campaign.failures[0].test) == "failed"
    assert [run.number for run in campaign.experiments] == [0, 2] and campaign.waiting == ()


def test_a_first_test_that_fails_and_two_in_a_row_are_told_and_raised(new_campaign, pendulum):
    campaign = new_campaign()
    with pytest.raises(tl.SystemFailure, match="motor cut out"):
        campaign.run(Failing(pendulum, {0}), 3)
    assert len(campaign.failures) == 1 and campaign.experiments == ()
    campaign = new_campaign()
    with pytest.raises(tl.SystemFailure, match="motor cut out"):
        campaign.run(Failing(pendulum, {1, 2}), 5)
    assert len(campaign.failures) == 2 and len(campaign.experiments) == 1


@pytest.mark.parametrize("bad", [-0.1, 1.1, 2, float("nan"), "low"])
def test_a_risk_that_is_none_is_refused(new_campaign, pendulum, bad):
    with pytest.raises(tl.InvalidInput, match="max_risk"):
        new_campaign().run(pendulum, 2, max_risk=bad)


def test_what_is_riskier_than_allowed_waits_and_is_not_flown(pendulum):
    campaign = tl.Campaign(
        pendulum.signals,
        controller=tl.controllers.PID(
            axes=[("angle", "rate")],
            gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
        ),
        initial_state=[0.0, 0.0],
        target_state=[1.0, 0.0],
        duration=1.0,
        threads=1,
        options={
            "moves": 1500,
            "generations": 0,
            "evaluations": 256,
            "candidates": 32,
            "committee_size": 4,
            "draws": 2,
        },
    )
    with pytest.raises(
        tl.TooRisky, match=r"at most 0, found 0\.\d+ for test 1; the test was not flown: raise"
    ) as refusal:
        campaign.run(pendulum, 2, max_risk=0.0)
    assert "still waits" not in str(refusal.value)  # nothing holds it after the process
    assert [test.number for test in campaign.waiting] == [1] and len(campaign.experiments) == 1
    assert len(campaign.run(pendulum, 2, max_risk=0.9).experiments) == 2


@pytest.mark.parametrize(
    "changes",
    [{"preset": "paper", "options": TINY}, {"preset": "default", "options": {**SMALL, "tests": "random"}}],
    ids=["paper", "random"],
)
def test_a_test_whose_risk_nobody_has_estimated_may_have_any(pendulum, changes):
    campaign = tl.Campaign(
        pendulum.signals, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0,
        threads=1, **changes,
    )  # fmt: skip
    with pytest.raises(
        tl.TooRisky, match="that no committee has estimated for test 1; the test was not flown"
    ):
        campaign.run(pendulum, 3, max_risk=0.99)
    assert [test.number for test in campaign.waiting] == [1] and len(campaign.experiments) == 1
    campaign.abandon(campaign.waiting[0])
    own = campaign.test(PENDULUM_GAINS)
    campaign.tell(own, pendulum.run(own))
    assert len(campaign.run(pendulum, 3).experiments) == 3


def test_a_test_of_somebodys_own_is_flown_whatever_risk_is_allowed(pendulum, new_campaign):
    campaign = new_campaign()
    campaign.test(PENDULUM_GAINS)
    assert len(campaign.run(pendulum, 1, max_risk=0.0).experiments) == 1


def test_a_rig_of_which_no_reading_moves_is_not_flown_on_before_somebody_has_looked(pendulum):
    """The test that waits is flown once it is run again: then somebody has."""

    class Still(tl.System):
        signals, mended, flights = pendulum.signals, False, 0

        def run(self, test):
            self.flights += 1
            run = pendulum.run(test)
            still = np.zeros_like(run.states)
            return tl.Trajectory(run.t, run.states if self.mended else still, run.commands)

    rig = Still()
    campaign = tl.Campaign(
        rig.signals, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL,
    )  # fmt: skip
    campaign.test(PENDULUM_GAINS)
    with pytest.raises(tl.NoAnswer, match=r"nothing answered.*Test 1 was not flown"):
        campaign.run(rig, 3)
    assert rig.flights == 1 and [test.number for test in campaign.waiting] == [1]
    rig.mended = True
    assert len(campaign.run(rig, 3).experiments) == 3


class Ending(Failing):
    """Ends its second run after a step, in some way."""

    def __init__(self, system, ended, reason):
        super().__init__(system, ())
        self.ended, self.reason = ended, reason

    def run(self, test):
        run = super().run(test)
        if self.count != 1:
            return run
        return tl.Trajectory(run.t[:2], run.states[:2], run.commands[:1], self.ended, self.reason)


@pytest.mark.parametrize("ended", ["aborted", "diverged"])
@pytest.mark.parametrize(("reason", "said"), [("left the rails", "left the rails"), ("", "ended at once")])
def test_a_flight_that_ends_within_a_step_has_failed_and_is_not_flown_again(
    new_campaign, pendulum, ended, reason, said
):
    rig = Ending(pendulum, ended, reason)
    campaign = new_campaign().run(rig, 2)
    assert [failure.reason for failure in campaign.failures] == [said]
    assert 1 + rig.count == campaign.run(rig, 2).runs == 2


def test_a_failure_without_words_is_told_by_its_kind(new_campaign, pendulum):
    class Wordless(Failing):
        words = ""

    campaign = new_campaign().run(Wordless(pendulum, {1}), 3)
    assert [failure.reason for failure in campaign.failures] == ["SystemFailure"]


def test_a_flight_that_no_store_takes_is_written_to_a_file_which_can_be_told(
    new_campaign, pendulum, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    campaign = new_campaign()
    test = campaign.test(PENDULUM_GAINS)
    full = tl.StoreFailure("The disk is full.")
    with monkeypatch.context() as patch, pytest.raises(tl.StoreFailure, match=r"full.*flight-of-test-0\.csv"):
        patch.setattr(type(campaign), "tell", Mock(side_effect=full))
        campaign.run(pendulum, 1)
    (file,) = tmp_path.iterdir()
    log = read_log(file, pendulum.signals)
    campaign.tell(test, log.trajectory())
    (run,) = campaign.experiments
    assert run.complete and run.trajectory.steps == test.steps


def test_what_is_rescued_has_the_columns_that_were_measured_and_says_how_it_ended(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    states = [tl.State("x", "m", 1.0), tl.State("v", "m/s", 1.0, derivative_of="x", measured=False)]
    signals = tl.Signals(states, [tl.Command("u", "N", (-1.0, 1.0))], 0.1)
    family = tl.controllers.StateFeedback(None, (-1.0, 1.0)).bind(signals)
    test = tl.Test(family, np.zeros(family.size), np.zeros(2), np.zeros(2), 5)
    run = tl.Trajectory(0.1 * np.arange(4), np.arange(4.0)[:, None], np.zeros((3, 1)), "aborted", "it fell")
    assert "It ended early (aborted): it fell" in rescued(test, run) and "-1.csv" in rescued(test, run)
    assert (tmp_path / f"flight-of-test-{test.number}.csv").read_text().startswith("t,x,u\n0.0,0.0,0.0\n")
    # Where nobody may write here it is among the temporary files.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(elsewhere))
    monkeypatch.setattr("twinloop.campaign.rescue._free", _only_in(elsewhere))
    assert str(elsewhere) in rescued(test, run)


def _only_in(folder):
    """A place for a file where it may be written, and none anywhere else."""

    def free(where, name):
        if where != folder.resolve():
            raise PermissionError
        return where / f"{name}.csv"

    return free

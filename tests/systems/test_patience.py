"""A system that hangs is given up in time, with a sentence, is stopped where it can be, and nothing is lost."""

import dataclasses
import os
import signal
import threading
import time

import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from oracles import same_bits
from twinloop.guard import Guard, Guarded
from twinloop.systems import patience


@pytest.fixture(autouse=True)
def stopping(monkeypatch):
    """What cannot be stopped is not waited for long."""
    monkeypatch.setattr(patience, "STOPPING", 0.2)


class Hanging(tl.System):
    """Answers, until it is told to hang."""

    default_gains = PENDULUM_GAINS

    def __init__(self, system):
        self.system, self.hangs, self.go = system, False, threading.Event()

    @property
    def signals(self):
        return self.system.signals

    def run(self, test):
        if self.hangs:
            self.go.wait(60.0)
        return self.system.run(test)


def test_what_hangs_is_given_up_and_the_test_still_waits(tmp_path, pendulum, new_campaign):
    system = Hanging(pendulum)
    campaign = new_campaign(store=tmp_path / "x.db").run(system, 1, timeout=30.0)
    system.hangs = True
    begun = time.monotonic()
    with pytest.raises(tl.SystemFailure, match=r"did not answer test 1 within 0\.3 s; .* still waits"):
        campaign.run(system, 2, timeout=0.3)
    assert time.monotonic() - begun < 20.0
    assert [test.number for test in campaign.waiting] == [1] and len(campaign.experiments) == 1
    with pytest.raises(tl.SystemFailure, match="has not come back from the test before"):
        campaign.run(system, 2, timeout=0.3)
    system.hangs = False
    system.go.set()
    time.sleep(0.5)
    campaign.run(system, 2, timeout=30.0)
    campaign.close()
    plain = new_campaign().run(pendulum, 1).run(pendulum, 2)
    assert same_bits(campaign.experiments[1].trajectory.states, plain.experiments[1].trajectory.states)


def test_nothing_is_said_to_wait_beyond_the_process_where_no_store_holds_it(pendulum, new_campaign):
    system = Hanging(pendulum)
    campaign = new_campaign().run(system, 1)
    system.hangs = True
    for sentence in ("did not answer test 1", "has not come back from the test before"):
        with pytest.raises(tl.NoAnswer, match=sentence) as raised:
            campaign.run(system, 2, timeout=0.3)
        assert "still waits" not in str(raised.value) and "nothing is lost" not in str(raised.value)
        assert "no longer than this process lasts" in str(raised.value)
    system.go.set()


def test_what_a_system_raises_is_raised(pendulum, new_campaign):
    def broken(x, u):
        raise RuntimeError("gear is broken")

    system = tl.systems.Simulated(pendulum.signals, broken, default_gains=PENDULUM_GAINS)
    with pytest.raises(tl.SystemFailure, match="gear is broken"):
        new_campaign().run(system, 1, timeout=30.0)
    with pytest.raises(tl.InvalidInput, match="Timeout"):
        new_campaign().run(pendulum, 1, timeout=-1.0)


# Ended from outside


class Motors(tl.System):
    """Flies for ever unless it is stopped; `blocked` is a call out of which nothing of Python leads."""

    default_gains = PENDULUM_GAINS

    def __init__(self, system, blocked=False, answer=None):
        self.system, self.answer = system, answer
        self.on, self.off, self.go = threading.Event(), threading.Event(), threading.Event()
        self.wait = self.go.wait if blocked else lambda seconds: time.sleep(0.01)
        self.flights = self.most = 0

    @property
    def signals(self):
        return self.system.signals

    def run(self, test):
        self.flights += 1
        self.most = max(self.most, self.flights)
        self.on.set()
        try:
            while not self.go.is_set():
                self.wait(60.0)
        except KeyboardInterrupt:
            if self.answer is None:
                raise
        finally:
            self.off.set()
            self.flights -= 1
        run = self.system.run(test)
        return run if self.answer is None else self.answer(run)


class Stopped(Motors):
    """Has a way of its own to be stopped, and returns what it has flown."""

    def __init__(self, system):
        super().__init__(system, blocked=True)

    def stop(self):
        self.stopped_from = threading.current_thread()
        self.go.set()


@pytest.fixture
def press():
    """Presses Ctrl-C once a system flies."""

    def after(system):
        def pressed():
            system.on.wait(30.0)
            time.sleep(0.05)
            os.kill(os.getpid(), signal.SIGINT)

        thread = threading.Thread(target=pressed)
        thread.start()
        threads.append(thread)

    threads = []
    yield after
    for thread in threads:
        thread.join()


@pytest.mark.parametrize("timeout", [None, 60.0])
def test_ctrl_c_reaches_a_system_that_cleans_up_behind_itself(pendulum, new_campaign, press, timeout):
    system, campaign = Motors(pendulum), new_campaign()
    press(system)
    with pytest.raises(KeyboardInterrupt):
        campaign.run(system, 1, timeout=timeout)
    assert system.off.is_set() and system.flights == 0
    assert campaign.interrupted and not campaign.experiments
    system.go.set()
    campaign.run(system, 1, timeout=timeout)


def test_a_system_that_is_given_up_cleans_up_behind_itself_and_can_be_flown_again(pendulum, new_campaign):
    system, campaign = Motors(pendulum), new_campaign()
    with pytest.raises(tl.NoAnswer, match="did not answer test 0") as late:
        campaign.run(system, 1, timeout=0.2)
    assert system.off.is_set() and isinstance(late.value.__cause__.__cause__, KeyboardInterrupt)
    system.go.set()
    campaign.run(system, 1, timeout=30.0)


def test_a_system_with_a_way_to_stop_is_stopped_by_it_and_its_answer_counts_after_ctrl_c_alone(
    pendulum, new_campaign, press
):
    system, campaign = Stopped(pendulum), new_campaign()
    with pytest.raises(tl.NoAnswer):
        campaign.run(system, 1, timeout=0.2)
    assert system.stopped_from is threading.main_thread() and system.off.is_set()
    assert not campaign.experiments
    system, campaign = Stopped(pendulum), new_campaign()
    press(system)
    with pytest.raises(KeyboardInterrupt):
        campaign.run(
            Guarded(system, lambda test: Guard(test, [0.0], horizon=0.0, clock=None)), 1, timeout=60.0
        )
    assert system.off.is_set() and len(campaign.experiments) == 1


def test_what_a_system_answers_to_ctrl_c_is_recorded(pendulum, new_campaign, press):
    def aborted(run):
        return dataclasses.replace(
            run, t=run.t[:6], states=run.states[:6], commands=run.commands[:5], true_states=None,
            ended="aborted", reason="Ctrl-C",
        )  # fmt: skip

    system, campaign = Motors(pendulum, answer=aborted), new_campaign()
    press(system)
    with pytest.raises(KeyboardInterrupt):
        campaign.run(system, 1, timeout=60.0)
    assert [run.trajectory.reason for run in campaign.experiments] == ["Ctrl-C"]


def test_what_still_flies_after_ctrl_c_is_not_flown_twice(pendulum, new_campaign, press):
    system, campaign = Motors(pendulum, blocked=True), new_campaign()
    press(system)
    with pytest.raises(KeyboardInterrupt):
        campaign.run(system, 1, timeout=60.0)
    assert system.flights == 1
    guarded = campaign.guarded(system, horizon=0.0)
    for again, timeout in ((system, 0.2), (system, None), (guarded, 0.2)):
        with pytest.raises(tl.NoAnswer, match="has not come back from the test before"):
            campaign.run(again, 1, timeout=timeout)
    system.go.set()
    assert system.off.wait(30.0)
    time.sleep(0.2)
    campaign.run(system, 1, timeout=30.0)
    assert system.most == 1 and len(campaign.experiments) == 1


def test_an_error_of_a_system_that_is_stopped_is_shown_behind_ctrl_c(pendulum, new_campaign, press):
    class Stuck(Motors):
        def run(self, test):
            try:
                return super().run(test)
            finally:
                raise tl.SystemFailure("The motors do not stop.")

    system, campaign = Stuck(pendulum), new_campaign()
    press(system)
    with pytest.raises(KeyboardInterrupt) as heard:
        campaign.run(system, 1, timeout=60.0)
    assert "do not stop" in str(heard.value.__cause__)

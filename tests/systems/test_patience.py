"""A system that hangs is given up in time, with a sentence, and nothing is lost."""

import threading
import time

import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from oracles import same_bits


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

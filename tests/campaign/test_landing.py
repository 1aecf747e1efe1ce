"""Ctrl-C near the end of a flight: what has landed is recorded, what has not is flown again with the same bits."""

import signal
import sys

import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from oracles import same_bits


class Counting(tl.System):
    """A noisy rig whose every run differs; `within` is called just before one returns."""

    default_gains = PENDULUM_GAINS

    def __init__(self, pendulum, within=lambda: None):
        self.rig = tl.systems.Simulated(pendulum.signals, pendulum_step, noise=[1e-3, 1e-2], seed=2)
        self.within = within

    @property
    def signals(self):
        return self.rig.signals

    @property
    def runs(self):
        return self.rig.runs

    @runs.setter
    def runs(self, runs):
        self.rig.runs = runs

    def run(self, test):
        answer = self.rig.run(test)
        self.within()
        return answer


class PressedAfter:
    """Presses Ctrl-C once, at one of the calls and returns of Python that follow the return of a run."""

    def __init__(self, place):
        self.left, self.landed = place, False

    def __call__(self, frame, event, argument):
        if event == "return" and frame.f_code is Counting.run.__code__:
            self.landed = True
        elif self.landed:
            self.left -= 1
            if self.left < 0:
                sys.setprofile(None)
                signal.raise_signal(signal.SIGINT)


def whole(new_campaign, pendulum):
    return new_campaign().run(Counting(pendulum), 2).experiments


@pytest.mark.parametrize("kept", [False, True], ids=["in memory", "in a store"])
def test_a_flight_that_has_landed_is_recorded_wherever_ctrl_c_comes(tmp_path, new_campaign, pendulum, kept):
    expected, recorded = whole(new_campaign, pendulum)[0].trajectory.states, 0
    # Around the return and the first lines after it everywhere; then here and there, until it comes after the flight.
    for place in [*range(60), *range(60, 4000, 331)]:
        campaign = new_campaign(store=tmp_path / f"{place}.db" if kept else None)
        system = Counting(pendulum)
        before = sys.getprofile()
        sys.setprofile(PressedAfter(place))
        try:
            campaign.run(system, 1)
        except KeyboardInterrupt:
            recorded += 1
        finally:
            sys.setprofile(before)
        assert len(campaign.experiments) == system.runs == 1, f"lost {place} calls after the flight"
        assert same_bits(campaign.experiments[0].trajectory.states, expected)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        campaign.close()
    assert recorded > 60


def test_a_flight_that_ctrl_c_cut_short_counts_for_nothing_and_is_flown_again_with_the_same_bits(
    new_campaign, pendulum
):
    campaign = new_campaign()
    system = Counting(pendulum)
    for experiments in (1, 2):
        system.within = lambda: signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            campaign.run(system, experiments)
        assert campaign.interrupted and len(campaign.experiments) == system.runs == experiments - 1
        system.within = lambda: None
        campaign.run(system, experiments)
    for one, other in zip(campaign.experiments, whole(new_campaign, pendulum), strict=True):
        assert same_bits(one.trajectory.states, other.trajectory.states)

"""Flights that began elsewhere than their tests: learnt and said, and no measure of gains or predictions."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.campaign import standing
from twinloop.campaign.data.begun import off_start
from twinloop.campaign.examination.log_check import against
from twinloop.campaign.identify_and_plan.calibration import misses


def rig(noise=0.0):
    return tl.systems.Simulated(SIGNALS, pendulum_step, noise=[noise, noise])


def campaign():
    return tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL, progress=None,
    )  # fmt: skip


def flown(campaign, gains, start, noise=0.0):
    test = campaign.test(gains)
    campaign.tell(test, rig(noise).run(replace(test, initial_state=np.array(start))))
    return test


@pytest.mark.parametrize(("start", "off"), [
    ([0.0, 0.0], ()), ([0.09, 0.0], ()), ([0.11, 0.0], (0,)), ([-0.2, 0.0], (0,)), ([0.0, 0.7], ()),
    ([0.0, -0.9], (1,)), ([0.5, 2.0], (0, 1)),
])  # fmt: skip
def test_a_tenth_of_the_way_or_of_the_scale_is_another_start(start, off):
    """The angle has a way of 1 rad; the rate has none, and a scale of 8 rad/s."""
    test = campaign().test(PENDULUM_GAINS)
    assert off_start(test, rig().run(replace(test, initial_state=np.array(start)))) == off


def test_noise_is_no_other_start():
    test = campaign().test(PENDULUM_GAINS)
    run = rig().run(test)
    stream = np.random.default_rng(0)
    for _ in range(50):
        noisy = replace(run, states=run.states + stream.normal(0.0, [0.1, 0.5], run.states.shape))
        assert off_start(test, noisy) == ()


def test_its_quality_counts_for_no_gains_where_others_began_as_asked():
    it = campaign()
    flown(it, PENDULUM_GAINS, [0.0, 0.0])
    near = flown(it, PENDULUM_GAINS, [0.9, 0.0])  # on the way at once
    first, second = it.experiments
    assert second.quality < first.quality and second.off_start == (0,)
    assert standing.best_flown(it._book) is first.test and standing.measured(it._book, 1) == second.quality
    it.tell(near, rig().run(near))
    assert standing.measured(it._book, near.number) == it.experiments[-1].quality


def test_it_is_said_and_no_prediction_is_held_against_it():
    it = campaign()
    flown(it, PENDULUM_GAINS, [0.0, 0.0])
    test = it.ask()
    it.tell(test, rig().run(replace(test, initial_state=np.array([0.5, 0.0]))))
    run = it.experiments[-1]
    said = [remark for remark in against(run, test, SIGNALS) if remark.code == "other-start"]
    assert len(said) == 1 and said[0].serious and "angle at 0.5 rad instead of 0 rad" in said[0].sentence
    assert run.miss is None and misses(it.experiments) == []
    assert ("other-start", "note") in {(remark.code, remark.severity) for remark in it.twin.remarks}
    assert not [
        remark for remark in against(it.experiments[0], None, SIGNALS) if remark.code == "other-start"
    ]


def test_a_flight_that_is_shorter_than_its_test_is_said_so_at_once():
    it = campaign()
    test = it.test(PENDULUM_GAINS)
    whole = rig().run(test)
    with pytest.warns(tl.RemarkWarning, match=r"has 12 of its 20 periods.* \(short-flight\)"):
        it.tell(test, tl.Trajectory(whole.t[:13], whole.states[:13], whole.commands[:12]))
    assert it.experiments[0].quality is None and not it.experiments[0].complete
    aborted = tl.Trajectory(whole.t[:13], whole.states[:13], whole.commands[:12], "aborted", "a gust")
    it.tell(test, aborted)
    assert "short-flight" not in {remark.code for remark in against(it.experiments[1], test, SIGNALS)}

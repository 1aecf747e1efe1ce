"""Flights that began elsewhere than their tests: learnt and said, and no measure of gains or predictions."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from late_sensors import BODY
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.campaign import standing
from twinloop.campaign.data.begun import not_ready, off_alone, off_start
from twinloop.campaign.examination.log_check import against
from twinloop.campaign.identify_and_plan.calibration import misses
from twinloop.errors import RemarkWarning


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


FAST = tl.Signals([tl.State("x", "m", 1.0)], [tl.Command("u", "N", (-1.0, 1.0))], 1.0)


class Quick(tl.System):
    """It forgets within a period where it began, which is not where it should have."""

    signals, default_gains = FAST, {"x->u": 0.3}

    def run(self, test):
        controller, states, commands = test.controller(), [1.5], []
        controller.reset()
        for k in range(test.steps):
            commands.append(controller.command(np.array(states[-1:]), test.target(k)))
            states.append(0.02 * states[-1] + 0.1 * commands[-1][0])
        return tl.Trajectory(np.arange(test.steps + 1.0), np.array(states)[:, None], np.array(commands))


def test_a_flight_that_began_elsewhere_and_was_there_within_a_period_is_kept_and_said_so():
    it = tl.Campaign(
        FAST, controller=tl.controllers.StateFeedback(None, (-1.0, 1.0)), initial_state=[0.0], target_state=[0.1],
        duration=20.0, threads=1, options=SMALL, progress=None,
    )  # fmt: skip
    with pytest.warns(RemarkWarning) as said:
        it.run(Quick(), 1)
    (flight,) = it.experiments
    assert flight.off_start == (0,) and off_alone(flight.test, flight.trajectory) == (0,)
    (sentence,) = (str(each.message) for each in said if "(first-reading)" in str(each.message))
    assert "x is 1.5 m in the first row and -0.012 m in the second" in sentence


def test_only_a_sensor_of_its_rate_tells_that_a_state_cannot_have_begun_where_it_was_read():
    test = campaign().test(PENDULUM_GAINS)
    run = rig().run(test)
    for rates, contradicted in (([0.0, 0.0], (0,)), ([-20.0, 0.0], ())):
        states = run.states.copy()
        states[0, 0], states[:2, 1] = 1.5, rates
        assert not_ready(test, replace(run, states=states)) == contradicted


def test_an_attitude_is_held_against_its_body_rates():
    controller = tl.controllers.StateFeedback(["a", "b", "c"], (-1.0, 1.0)).bind(BODY)
    test = tl.Test(controller, np.zeros(controller.size), np.zeros(6), np.zeros(6), 20)
    states = np.zeros((21, 6))
    states[0, 0] = 1.0
    for rate, contradicted in ((0.1, (0,)), (20.0, ())):
        states[:2, 3] = rate, 0.0
        run = tl.Trajectory(BODY.dt * np.arange(21), states, np.zeros((20, 3)))
        assert 0 in off_alone(test, run) and not_ready(test, run) == contradicted

"""Where no law follows the flights, one with linear terms does, and better gains are found on it."""

import json
import warnings

import pytest

import twinloop as tl
from twinloop.campaign.presets import options_of
from twinloop.faces.result import summary
from twinloop_exam.zoo.plants import plant


@pytest.fixture(scope="module")
def learnt():
    """One flight, gently excited, of a motor whose load stands behind play and is not logged, nor looked for."""
    motor = plant("motor-backlash-hidden")
    task, system = motor.asked, motor.make(4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.RemarkWarning)
        campaign = tl.Campaign(
            system.signals, controller=task.controller, initial_state=task.start, target_state=task.target,
            duration=task.duration, weights=dict(task.weights), threads=1,
            options={"hold_back": False, "storage": False},
        )  # fmt: skip
        test = campaign.test(task.first)
        campaign.tell(test, system.run(test))
        return motor, campaign, campaign.best_test


def test_a_twin_of_linear_terms_is_tuned_on_and_said_to_be_no_simulator(learnt):
    motor, campaign, best = learnt
    (lesson,) = campaign.history
    (said,) = (remark for remark in lesson.remarks if remark.code == "rough")
    assert lesson.follows and said.serious and "not a simulator" in said.sentence
    assert not campaign.checks().twin_passed
    # They are better, and fly before they are recommended.
    asked = tl.Campaign.from_record(campaign.to_record(), threads=1).ask()
    assert motor.true_quality(asked.genes) < 0.7 * motor.true_quality(motor.asked.first)
    assert best.number == 0 and "the twin is rough" in best.reason and asked.risk > 0.08


def test_it_has_linear_terms_only(learnt):
    _, campaign, _ = learnt
    law = campaign.twin.equations(4).partition("d motor_rate / dt")[2]
    assert "*" in law and not any(word in law for word in ("**", "Max", "abs", "motor*", "sqrt"))


def test_where_it_is_not_asked_for_none_is_learnt():
    asked, not_asked = (options_of("default", {"rough": rough}) for rough in (True, False))
    assert asked.plain != asked and asked.plain.libraries == ("linear",)
    assert not_asked.plain == not_asked


def test_both_laws_survive_a_resume_and_what_is_learnt_next_has_the_same_bits(learnt):
    motor, campaign, _ = learnt
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.RemarkWarning)
        uncut = tl.Campaign.from_record(campaign.to_record(), threads=1)
        resumed = tl.Campaign.from_record(through_json(campaign), threads=1)
        for each in (uncut, resumed):
            test = each.ask()
            each.tell(test, motor.make(7).run(test))
        assert uncut.twin.equations(17) == resumed.twin.equations(17)
    first, second = (through_json(each)["memory"] for each in (uncut, resumed))
    assert len(first["asked"]["two_laws"]) == 1 and first["asked"]["rough"] is not None
    assert first["latest"] == second["latest"]


def through_json(campaign):
    return json.loads(json.dumps(campaign.to_record()))


def test_its_lag_is_not_taken_for_an_actuator(learnt):
    _, campaign, _ = learnt
    lesson = campaign.history[0]
    (actuator,) = campaign.twin.law.actuation.actuators
    assert not actuator.direct and lesson.lags == (0.0,) and lesson.delays == (0,)
    (said,) = (remark for remark in lesson.remarks if remark.code == "stand-in")
    assert "torque" in said.sentence
    (shown,) = summary(campaign, {}, {})["twin"]["actuators"]
    assert (shown["lag"], shown["delay"]) == (actuator.lag, actuator.delay) and not shown["identified"]

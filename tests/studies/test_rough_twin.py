"""Where no law follows the flights, one with linear terms does, and better gains are found on it."""

import warnings

import pytest

import twinloop as tl
from twinloop.campaign.presets import options_of
from twinloop_exam.zoo.plants import plant


@pytest.fixture(scope="module")
def learnt():
    """One flight of a motor whose load stands behind play and is not logged."""
    motor = plant("motor-backlash-hidden")
    task, system = motor.asked, motor.make(2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tl.RemarkWarning)
        campaign = tl.Campaign(
            system.signals, controller=task.controller, initial_state=task.start, target_state=task.target,
            duration=task.duration, weights=dict(task.weights), threads=1,
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
    assert motor.true_quality(best.genes) < 0.7 * motor.true_quality(motor.asked.first)


def test_it_has_linear_terms_only(learnt):
    _, campaign, _ = learnt
    law = campaign.twin.equations(4).partition("d motor_rate / dt")[2]
    assert "*" in law and not any(word in law for word in ("**", "Max", "abs", "motor*", "sqrt"))


def test_where_it_is_not_asked_for_none_is_learnt():
    asked, not_asked = (options_of("default", {"rough": rough}) for rough in (True, False))
    assert asked.plain != asked and asked.plain.libraries == ("linear",)
    assert not_asked.plain == not_asked

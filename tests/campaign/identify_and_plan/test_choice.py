"""Which controller to fly: the gate of confidence, doubt about qualities, envelopes, and starts by LQR."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

import twinloop as tl
from conftest import pendulum_step
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.choice import Choice
from twinloop.campaign.identify_and_plan.starts import linear_gains
from twinloop.campaign.identify_and_plan.track_record import (
    SURE,
)
from twinloop.controllers import StateFeedback, lqr_gains
from twinloop.planning.gusts import UNMOVED, Moved
from twinloop.planning.judging import Committee, Judged
from twinloop.planning.planner import Planner
from twinloop.planning.proposal import Fared
from twinloop.planning.settings import PlanningOptions

FAMILY = CONTROLLER.bind(SIGNALS)
FLOWN = tl.Test(FAMILY, np.array([2.0, 2.0, 0.3]), np.zeros(2), np.array([1.0, 0.0]), 20, number=0)
TUNED = np.array([4.0, 1.0, 0.5])
KEPT = Fared(1, 0)


def experiment(predicted=None, quality=1.0, spread=0.01):
    test = SimpleNamespace(predicted=predicted, spread=spread, initial_state=np.zeros(2))
    trajectory = SimpleNamespace(states=np.zeros((21, 2)))
    return SimpleNamespace(test=test, quality=quality, trajectory=trajectory, off_start=())


def under_flown_gains(members, genes):
    """Those that gains which have flown show to be stable: what others do to a member may be true of the machine."""
    assert (genes == FLOWN.genes).all()
    return members


def chosen(
    new, old=1.0, recorded=None, again=1.0, measured=1.0, usage=0.5, flies=True, confidence=0.8, trusted=True,
    experiments=(), unfit=(), best=FLOWN, best_measured=FLOWN, track_record=True, gusts=UNMOVED, explained=True,
    misses=False, rough=False, fared=KEPT, in_gusts=None, delayed=None, blown_about=None, gains_count=True,
):  # fmt: skip
    """The answer where a twin of one member and four draws says this of the gains tuned and of those flown."""
    new = np.broadcast_to(np.asarray(new, dtype=float), 4)

    def judge(
        members, genes, sds, draws, excitation=None, ends=None, measured=False, off=None, hold_back=None,
        disturbances=None,
    ):  # fmt: skip
        if ends is not None:
            return Judged(np.full((1, 4, 1), again), np.zeros((1, 4, 1)))
        values = np.full((1, 4, len(genes)), old)
        values[0, :, 0] = new if recorded is None or not measured else recorded
        if disturbances is not None:
            values[0, :, 0] = blown_about
        usages = np.full((1, 4, len(genes)), 0.5)
        usages[0, 0, 0] = usage
        if members == ["delayed"]:
            usages[0, -1] = delayed
        return Judged(values, usages)

    runs = [experiment(), *experiments]
    book = SimpleNamespace(
        experiments=runs, tests=[FLOWN], setup=SimpleNamespace(signals=SIGNALS),
        of_task=lambda genes, number: tl.Test(FAMILY, genes, np.zeros(2), np.array([1.0, 0.0]), 20, number=number),
    )  # fmt: skip
    planner = SimpleNamespace(
        family=FAMILY, judge=judge, stable_members=under_flown_gains,
        options=PlanningOptions(track_record=track_record),
        disturbances=lambda committee, draws: None if blown_about is None else np.ones((draws, 20, 2)),
    )  # fmt: skip
    blown = SimpleNamespace(on=lambda test: in_gusts if in_gusts and (test.genes == TUNED).all() else gusts)
    late = [] if delayed is None else ["delayed"]
    committee = Committee([None], np.zeros(2), trusted, late, explained, blown, gains_count=gains_count)
    choice = Choice(planner, committee, book, 4, confidence, misses, rough)
    with mock.patch.multiple(
        standing, finishes=lambda book, test: True, flies=lambda book, test: flies,
        unfit=lambda book: list(unfit), on_task=lambda book, test: True,
        measured=lambda book, test: measured if test == 0 else None, best_flown=lambda book: best_measured,
        fared=lambda book, genes, excited: KEPT if (genes == TUNED).all() else fared,
    ):  # fmt: skip
        found = choice.between(TUNED, best)
    told = [found.reason, found.predicted, found.spread]
    moved = blown.on(found)
    assert found.risk == pytest.approx(
        max(0.5 / 5.0, moved.risk, fared.risk if (found.genes == FLOWN.genes).all() else 0.0)
    )
    return ("tuned" if (found.genes == TUNED).all() else "flown"), told[0] if gusts is UNMOVED else told


def test_gains_that_make_no_difference_on_the_twin_are_not_recommended():
    answer, reason = chosen(0.5, gains_count=False)
    assert answer == "flown" and "does not know yet what the commands do" in reason
    assert chosen(0.5)[0] == "tuned"


def test_gains_of_a_twin_that_misses_its_flights_fly_before_they_are_recommended():
    came_true = experiment(1.0)
    answer, reason = chosen(0.5, experiments=[came_true], misses=True)
    assert answer == "flown" and "have to fly before they are recommended" in reason
    # While only the first controller has flown they are recommended, as those of a twin that explains its flights are.
    assert chosen(0.5, misses=True)[0] == "tuned"
    assert chosen(0.5, experiments=[came_true])[0] == "tuned"
    # A linear law beside one that explains nothing may be wrong about any gains.
    answer, reason = chosen(0.5, rough=True)
    assert answer == "flown" and "the twin is rough, and gains that it prefers have to fly" in reason


def test_gains_are_compared_in_the_disturbances_that_they_were_tuned_in():
    assert chosen(0.5, blown_about=1.5)[0] == "flown"
    assert chosen(1.5, recorded=0.5, blown_about=0.5)[0] == "tuned"


def test_gains_that_are_better_by_more_than_any_miss_are_taken_whatever_predictions_missed():
    """Predicted three times as bad as they were, so misses are twice the quality: a third of it is asked for."""
    runs = [experiment(3.0, spread=2.0), experiment(3.2, spread=2.0)]
    assert chosen(0.3, experiments=runs)[0] == "tuned"
    assert chosen(0.4, experiments=runs)[0] == "flown"


def test_gains_that_have_not_flown_must_promise_more_than_predictions_have_missed_of_late():
    """Two misses by 4 % and 9 %: their geometric mean is 6 %."""
    runs = [experiment(1.04, spread=0.1), experiment(1.09, spread=0.1)]
    answer, reason = chosen(0.95, experiments=runs, measured=1.1)
    assert answer == "flown" and "better by 6 % or more in only 0 %" in reason
    assert chosen(0.93, experiments=runs)[0] == "tuned"
    # Predictions that come true show of how little gains can be trusted to be better.
    assert chosen(0.95, experiments=[*runs, experiment(1.01), experiment(1.01)])[0] == "tuned"
    assert chosen(0.985)[0] == "flown" and chosen(0.975)[0] == "tuned"


@pytest.mark.parametrize(
    ("delayed", "answer"),
    [((0.9, 0.9), "tuned"), ((1.1, 0.9), "flown"), ((np.inf, 1.0), "flown"), ((1.1, 1.1), "tuned")],
)
def test_gains_that_bear_less_delay_than_the_flown_ones_are_not_preferred(delayed, answer):
    found, reason = chosen(0.9, delayed=delayed)
    assert found == answer and ("with more delay than was found" in reason) == (answer == "flown")


@pytest.mark.parametrize(
    ("new", "confidence", "answer"),
    [
        ([0.9, 0.9, 0.9, 1.1], 0.75, "tuned"),
        ([0.9, 0.9, 0.9, 1.1], 0.76, "flown"),
        ([0.9, 0.9, 0.9, 0.9], 1.0, "tuned"),
        ([1.0, 1.0, 1.0, 1.0], 0.01, "flown"),
        ([1.1, 1.1, 1.1, 1.1], 0.0, "tuned"),
        # Hardly better is not worth gains that have not flown.
        ([0.996, 0.996, 0.996, 0.996], 0.8, "flown"),
        ([0.994, 0.994, 0.994, 0.994], 0.8, "tuned"),
    ],
)
def test_gains_are_preferred_where_so_large_a_share_of_the_predictions_prefers_them(new, confidence, answer):
    exact = [experiment(predicted=1.0), experiment(predicted=1.0)]
    assert chosen(new, confidence=confidence, experiments=exact, measured=1.5)[0] == answer


def test_a_flight_that_was_measured_better_for_an_excitation_is_named():
    assert "measured better" not in chosen(1.1)[1]
    others = FLOWN.genes + 0.1
    excited = SimpleNamespace(number=3, genes=others, excitation=np.ones((20, 2)))
    answer, reason = chosen(1.1, best_measured=excited)
    assert answer == "flown" and "Test 3 was measured better; without excitation these are better." in reason
    quiet = SimpleNamespace(number=3, genes=others, excitation=None)
    assert (
        "Test 3 was measured better; what the twin predicts speaks for these."
        in chosen(1.1, best_measured=quiet)[1]
    )
    again = SimpleNamespace(number=3, genes=FLOWN.genes, excitation=np.ones((20, 2)))
    assert "Test 3 flew the same gains, and was measured better." in chosen(1.1, best_measured=again)[1]


def test_gains_that_have_not_flown_must_promise_more_than_was_measured_of_the_best_flown():
    """A twin that is as far off about these as about others promises nothing better than what they have done."""
    runs = [experiment(1.04, spread=0.1), experiment(1.09, spread=0.1)]
    answer, reason = chosen(0.9, old=1.1, recorded=0.95, experiments=runs)
    assert answer == "flown"
    assert "1 was measured with these" in reason and "0.95 for others: not better by 6 % or more" in reason
    assert chosen(0.9, old=1.1, recorded=0.93, experiments=runs)[0] == "tuned"
    assert chosen(0.9, old=1.1, recorded=0.95, experiments=runs, measured=1.1)[0] == "tuned"
    # What was never measured on the task is known by the twin alone.
    assert chosen(0.9, old=1.1, recorded=0.95, experiments=runs, measured=None)[0] == "tuned"


def test_where_the_last_flight_was_not_as_predicted_others_must_be_better_by_two_spreads():
    missed = [experiment(predicted=0.8, quality=1.0, spread=0.01)]
    # What was missed last widens the spread: 2 · √(0.02 · 0.2) of the prediction.
    widened = 2.0 * np.sqrt(0.02 * 0.2)
    enough = 1.0 / (1.0 + SURE * widened)
    assert chosen(0.99 * enough, experiments=missed)[0] == "tuned"
    assert chosen(1.01 * enough, experiments=missed)[0] == "flown"
    assert "not as predicted" in chosen(1.01 * enough, experiments=missed)[1]
    assert chosen(1.01 * enough)[0] == "tuned"
    # Whatever else disturbs them: what gusts will add was measured in the flight, too.
    assert chosen(0.99 * enough, experiments=missed, gusts=Moved(0.1, 0.0))[0] == "flown"


def test_gains_that_known_disturbances_drive_out_of_the_envelope_are_not_preferred():
    blown_out = Moved(0.0, 0.0, left=3)
    answer, reason = chosen(0.5, in_gusts=blown_out)
    assert answer == "flown" and "in disturbances as the flights felt them" in reason
    # No worse than those that have flown in the same disturbances.
    assert chosen(0.5, gusts=blown_out)[0] == "tuned"


def test_what_gusts_add_is_predicted():
    answer, (_, predicted, spread) = chosen(0.5, gusts=Moved(0.1, 0.3))
    assert (answer, predicted) == ("tuned", pytest.approx(0.6))
    # Members and draws agree, and what was missed before is less.
    assert spread == pytest.approx(0.3)


def test_a_twin_that_has_promised_too_much_twice_must_promise_more_by_as_much():
    twice = [experiment(0.9, 1.0, 0.2), experiment(0.94, 1.0, 0.2)]
    assert chosen(0.9, experiments=twice)[0] == "tuned"
    answer, reason = chosen(0.95, experiments=twice)
    assert answer == "flown" and "both by 6.4 % or more" in reason
    assert chosen(0.95, experiments=twice[:1])[0] == "tuned"


def test_who_has_no_track_record_is_taken_at_his_word():
    twice = [experiment(0.9, 1.0, 0.2), experiment(0.94, 1.0, 0.2)]
    missed = [experiment(predicted=0.8, quality=1.0, spread=0.01)]
    for against in ({"experiments": twice}, {"experiments": missed}, {"recorded": 1.1, "again": 1.2}):
        assert chosen(0.95, **against)[0] == "flown"
        assert chosen(0.95, **against, track_record=False)[0] == "tuned"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"usage": 1.01}, "leave the envelope"),
        ({"trusted": False}, "does not follow"),
        ({"unfit": [TUNED]}, "failed or was cut"),
    ],
)
def test_gains_that_cannot_be_answered_for_are_not_flown(changes, words):
    answer, reason = chosen(0.5, **changes)
    assert answer == "flown" and words in reason
    with pytest.raises(tl.NotAvailable, match=words):
        chosen(0.5, best=None, **changes)
    assert chosen(0.5, usage=1.0)[0] == "tuned"


def test_gains_that_left_the_envelope_give_way_to_any_that_keep_it():
    answer, reason = chosen(1.5, flies=False)
    assert answer == "tuned" and "the best flown gains did not keep it to the end" in reason


def test_gains_that_left_the_envelope_in_other_flights_say_so_and_are_as_risky_as_those_were():
    answer, reason = chosen(1.5, fared=Fared(4, 3))
    assert answer == "flown" and reason.endswith(
        " But 3 of their 4 flights did not keep the envelope to the end."
    )


# Starts of the tuning


@pytest.mark.parametrize("trusted", [True, False])
def test_a_full_state_feedback_is_tuned_from_the_gains_of_lqr_on_the_twin_too(monkeypatch, trusted):
    seen, tune = [], Planner.tune

    def spy(self, committee, starts, number, *scored):
        seen.append((committee, list(starts)))
        return tune(self, committee, starts, number, *scored)

    monkeypatch.setattr(Planner, "tune", spy)
    controller = StateFeedback(None, (-6.0, 6.0))
    campaign = tl.Campaign(
        SIGNALS, controller=controller, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL,
    )  # fmt: skip
    plant = tl.systems.Simulated(SIGNALS, pendulum_step)
    first = campaign.test(dict.fromkeys((gain.name for gain in campaign.family.gains), 0.5))
    campaign.tell(first, plant.run(first))
    _ = campaign.best_test
    committee, starts = seen[-1]
    assert committee.trusted
    gains = campaign.family.genes(lqr_gains(committee.members[0], campaign.family, [1.0, 0.0]))
    assert any(start.tobytes() == gains.tobytes() for start in starts)
    doubted = Committee(committee.members, committee.sds, trusted)
    assert len(linear_gains(campaign.setup, doubted)) == trusted


def test_no_other_family_has_starts_by_lqr():
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=SMALL,
    )  # fmt: skip
    assert linear_gains(campaign.setup, Committee([None], np.zeros(2), True)) == []

"""Whole campaigns of the preset `default`: same bits, interruption, cut runs, and data that nobody would wish for."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import CONTROLLER, SIGNALS, THOROUGH, StopAt
from oracles import rk4, same_bits
from strategies import program_text
from twinloop import _core
from twinloop._experiment.hold_back import HoldBack
from twinloop.campaign import controller_to_fly, standing
from twinloop.campaign.entering import check_first_reading
from twinloop.campaign.identify_and_plan import learning
from twinloop.campaign.identify_and_plan import method as method_of_default
from twinloop.campaign.identify_and_plan.memory import Learnt
from twinloop.faces.result import summary
from twinloop.law.actuation import Actuation
from twinloop.law.noise import Noise
from twinloop.planning.planner import Planner


@pytest.fixture
def begin(new_campaign):
    """Makes small campaigns of the preset `default` on the pendulum."""

    def make(**changes):
        campaign_options = {**THOROUGH, **changes.pop("options", {})}
        arguments = {"target_state": [1.0, 0.0], **changes}
        return default_campaign(options=campaign_options, **arguments)

    return make


def default_campaign(options, **changes):
    signals = changes.pop("signals", SIGNALS)
    arguments = {
        "controller": CONTROLLER, "initial_state": [0.0, 0.0], "duration": 1.0, "threads": 1,
        "options": options, **changes,
    }  # fmt: skip
    return tl.Campaign(signals, **arguments)


def outcome(campaign):
    """Everything that a campaign found, as one comparable value."""
    best = campaign.best_test
    return (
        [run.test.genes.tobytes() for run in campaign.experiments],
        [run.trajectory.commands.tobytes() for run in campaign.experiments],
        campaign.history,
        [str(member.program) for member in campaign.committee],
        best.genes.tobytes(),
        best.predicted,
        best.reason,
    )


def told(campaign, system, change=lambda run: run):
    test = campaign.test(PENDULUM_GAINS)
    campaign.tell(test, change(system.run(test)))
    return campaign


def test_the_default_preset_is_default(begin, pendulum):
    campaign = begin()
    assert campaign.setup.preset == "default" and campaign.setup.goal == "both"
    assert campaign.setup.quality.kind == "iae"
    campaign.run(pendulum, 2)
    assert [record.iteration for record in campaign.history][-1] >= 1
    with pytest.raises(tl.NotAvailable, match="expected the preset 'paper'"):
        _ = campaign.models
    assert campaign.committee[0] is not None and len(campaign.committee) <= 4


def test_the_same_bits_for_one_thread_and_two(begin, pendulum):
    assert outcome(begin(threads=2).run(pendulum, 3)) == outcome(begin(threads=1).run(pendulum, 3))


def test_another_seed_is_another_campaign(begin, pendulum):
    one, two = (begin(seed=seed).run(pendulum, 2) for seed in (1, 2))
    assert not same_bits(one.experiments[1].test.genes, two.experiments[1].test.genes)


def test_nothing_depends_on_numpys_global_random_state(begin, pendulum):
    np.random.seed(1)
    one = outcome(begin().run(pendulum, 2))
    np.random.seed(2)
    assert outcome(begin().run(pendulum, 2)) == one


@pytest.fixture(scope="module")
def whole():
    from conftest import pendulum_step

    system = tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=PENDULUM_GAINS)
    return outcome(default_campaign(THOROUGH, target_state=[1.0, 0.0]).run(system, 3))


@pytest.mark.parametrize("call", [1, 2, 3, 5, 7, 9, 12, 16, 20, 24])
def test_an_interrupted_campaign_goes_on_with_the_same_bits(begin, pendulum, whole, call):
    campaign = begin(progress=StopAt(call))
    with pytest.raises(KeyboardInterrupt):
        campaign.run(pendulum, 3)
    assert campaign.interrupted
    # What is looked at in between is of what is known by then, and must not show in what comes.
    if campaign.experiments:
        assert campaign.best_test.genes.shape == (len(PENDULUM_GAINS),)
    campaign.run(pendulum, 3)
    assert not campaign.interrupted
    assert outcome(campaign) == whole


def test_an_interrupted_campaign_still_has_the_twin_that_it_had(begin, pendulum):
    campaign = told(begin(), pendulum)
    before = str(campaign.twin.model.program)
    campaign.tell(*(lambda t: (t, pendulum.run(t)))(campaign.test(PENDULUM_GAINS)))
    campaign.progress = StopAt(1)
    with pytest.raises(KeyboardInterrupt):
        _ = campaign.twin
    assert campaign.interrupted and str(campaign.twin.model.program) == before


# Arguments


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"goal": "contrl"}, "did you mean 'control'"),
        ({"goal": "everything"}, "expected one of both, model, control"),
        ({"goal": ""}, "expected one of both, model, control"),
        ({"quality": "iaee"}, "did you mean 'iae'"),
        ({"quality": ""}, "expected one of iae, ise, final_distance"),
        ({"preset": ["paper"]}, "Unknown preset"),
        ({"operators": 5}, "a list of names"),
        ({"options": {"quality_weights": "x"}}, "a list of finite numbers"),
        ({"operators": ["+", "pow"]}, "operator 'pow'"),
        ({"operators": []}, None),
        ({"options": {"libraries": ["lineal"]}}, "did you mean 'linear'"),
        ({"options": {"libraries": [], "generations": 0}}, "found neither"),
        ({"options": {"quality_weights": [1.0]}}, "expected 2 finite numbers"),
        ({"options": {"quality_weights": [1.0, np.nan]}}, "a finite number"),
        ({"options": {"initial_range": [np.inf, 0.0]}}, "a finite number"),
        ({"options": {"quality_weights": [0.0, 0.0]}}, "as good as any other"),
        ({"options": {"fixed_terms": ["rate: -2 * rate"] * 2}}, "each term once"),
        ({"initial_state": [0.0, 13.0]}, r"initial_state: expected rate within -10\.8 to 10\.8"),
        ({"target_state": [1.0, -11.0]}, r"target_state: expected rate within .* found -11"),
        ({"progress": 3}, "something to call"),
        ({"options": {"candidates": 1}}, "expected 2 to"),
        ({"options": {"margin": 1.0}}, "'margin'"),
        ({"options": {"form": "acceleraton"}}, "did you mean 'acceleration'"),
        ({"options": {"tests": "prsb"}}, "did you mean 'prbs'"),
        ({"options": {"model_generations": 5}}, "option of the preset 'default'"),
        ({"preset": "paper", "options": {}, "goal": "model"}, None),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(begin, changes, sentence):
    if sentence is None and "goal" not in changes:
        assert begin(**changes).options.operators == ()
        return
    with pytest.raises(tl.InvalidInput, match=sentence):
        begin(**changes)


def test_the_paper_knows_one_goal_and_one_quality(new_campaign):
    for changes in ({"goal": "model"}, {"quality": "iae"}):
        with pytest.raises(tl.InvalidInput, match='choose preset="default"'):
            new_campaign(**changes)
    assert new_campaign(goal="both", quality="final_distance", operators=["+"]).options.operations == ("+",)


# The first test and what is asked after it


def test_a_test_of_ones_own_is_excited_unless_asked_otherwise(begin, new_campaign):
    campaign = begin()
    gentle, plain = campaign.test(PENDULUM_GAINS), campaign.test(PENDULUM_GAINS, excitation=None)
    sent = np.abs(gentle.excitation[:, 0])
    # It begins small, is eight times as large at most, and fades out.
    assert not sent[0] and 0.0 < sent[:3].max() <= 0.02 * 2.0 * 2.0
    assert 0.02 * 2.0 < sent.max() <= 8.0 * 0.02 * 2.0 + 1e-12 and plain.excitation is None
    assert sent[-1] <= 8.0 * 0.02 * 2.0 / 5.0 + 1e-12
    own = np.full((20, 1), 0.1)
    assert same_bits(campaign.test(PENDULUM_GAINS, excitation=own).excitation, own)
    assert new_campaign().test(PENDULUM_GAINS).excitation is None
    with pytest.raises(tl.InvalidInput, match="found 'wild'"):
        campaign.test(PENDULUM_GAINS, excitation="wild")


def test_two_asks_without_tell_give_two_tests_with_reasons(begin, pendulum):
    campaign = told(begin(), pendulum)
    one, two = campaign.ask(), campaign.ask()
    assert not same_bits(one.genes, two.genes) or not same_bits(one.excitation, two.excitation)
    for test in (one, two):
        assert 0.0 < test.risk < 1.0 and test.spread >= 0.0 and test.reason
    assert [plan.test for plan in campaign.history[-1].asked] == [one.number, two.number]
    campaign.tell(two, pendulum.run(two))
    plan = campaign.history[0].asked[1]
    assert plan.flown == campaign.experiments[1].quality and plan.predicted == two.predicted


def test_the_quality_of_an_experiment_is_what_was_asked_for(begin, pendulum):
    for kind in ("iae", "ise", "final_distance"):
        run = told(begin(quality=kind), pendulum).experiments[0]
        errors = run.trajectory.states[1:] - [1.0, 0.0]
        expected = {
            "iae": 0.05 * np.abs(errors[:, 0]).sum(),
            "ise": 0.05 * (errors[:, 0] ** 2).sum(),
            "final_distance": np.sqrt((errors[-1] ** 2).sum()),
        }[kind]
        assert run.quality == pytest.approx(expected, rel=1e-12)


# Data that nobody would wish for


def cut(run, rows):
    return tl.Trajectory(
        run.t[:rows], run.states[:rows], run.commands[: rows - 1], ended="aborted", reason="stop"
    )


def changed(run, states=None, commands=None):
    return tl.Trajectory(
        run.t, run.states if states is None else states, run.commands if commands is None else commands
    )


def outlier(run):
    states = np.array(run.states)
    states[9, 1] += 6.0
    return changed(run, states)


DATA = {
    "a run that was cut": lambda run: cut(run, 8),
    "a first controller that crashes at once": lambda run: cut(run, 3),
    "a run that never moves": lambda run: changed(
        run, np.zeros_like(run.states), np.zeros_like(run.commands)
    ),
    "a state that is constant": lambda run: changed(run, run.states * [1.0, 0.0]),
    "commands at their bound": lambda run: changed(run, commands=np.full_like(run.commands, 2.0)),
    "one outlier": outlier,
    "nothing but noise": lambda run: changed(run, np.random.default_rng(0).normal(size=run.states.shape)),
}


@pytest.mark.parametrize("case", DATA)
def test_hard_data_are_learnt_from_and_something_is_asked(begin, pendulum, case):
    campaign = told(begin(), pendulum, DATA[case])
    for _ in range(2):
        twin, (best, why), test = campaign.twin, controller_to_fly(campaign), campaign.ask()
        assert twin.equations() and np.isfinite(twin.predict([0.1, 0.1], [0.1])).all()
        low = [gain.low for gain in campaign.family.gains]
        high = [gain.high for gain in campaign.family.gains]
        # Where nothing has flown to the end, there may be no controller to fly, and then that is said.
        assert best is not None or "No controller to fly" in why
        for genes in [test.genes] if best is None else [best.genes, test.genes]:
            assert (genes >= low).all() and (genes <= high).all()
        assert test.reason and 0.0 < test.risk <= 1.0
        assert twin.simulate(test).states.shape[1] == 2
        campaign.tell(test, pendulum.run(test))
    assert len(campaign.twin.errors) == 3


def test_a_run_that_was_cut_is_data_but_no_quality(begin, pendulum):
    campaign = told(begin(), pendulum, DATA["a run that was cut"])
    assert campaign.experiments[0].quality is None and campaign.experiments[0].final_distance is None
    assert campaign.history == () and campaign.twin.errors[0].test == 0
    assert campaign.history[0].readings == 16
    test = campaign.ask()
    campaign.tell(test, pendulum.run(test))
    assert campaign.experiments[1].quality is not None


def test_a_twin_that_does_not_follow_its_own_runs_is_not_followed(begin, pendulum):
    """Commands recorded with the wrong sign: the law is right for the record, and nobody can fly by it."""
    campaign = told(begin(), pendulum, lambda run: changed(run, commands=-run.commands))
    first = campaign.experiments[0].test
    best, test = campaign.best_test, campaign.ask()
    assert same_bits(best.genes, first.genes) and "does not follow" in best.reason
    assert same_bits(test.genes, first.genes) and "again" in test.reason
    assert "agree" not in test.reason and "cannot say" in test.reason
    assert any("check the signs" in str(remark) for remark in campaign.history[0].remarks)
    honest = told(begin(), pendulum)
    assert not same_bits(honest.best_test.genes, first.genes)
    assert not any("check the signs" in str(remark) for remark in honest.history[0].remarks)


def test_where_no_run_was_complete_a_remark_says_so(begin, pendulum):
    campaign = told(begin(), pendulum, DATA["a first controller that crashes at once"])
    assert campaign.twin and "the longest had 2 of 20 steps" in campaign.history[0].remarks[-1].sentence


def test_after_a_first_flight_beyond_the_envelope_flights_keep_it_and_so_does_the_controller(begin):
    rate = replace(SIGNALS.states[1], envelope=(-1.1, 1.1))
    signals = tl.Signals([SIGNALS.states[0], rate], SIGNALS.commands, SIGNALS.dt)
    system = tl.systems.Simulated(signals, pendulum_step)
    quick = {"angle.kp": 5.0, "angle.ki": 0.0, "angle.kd": 0.2}
    campaign = begin(signals=signals, options={"candidates": 256, "evaluations": 2048})
    first = campaign.test(quick, excitation=None)
    campaign.tell(first, system.run(first))
    assert campaign.experiments[0].left_envelope and campaign.experiments[0].usage > 1.5
    for _ in range(2):
        campaign.run(system, len(campaign.experiments) + 1)
        flown = campaign.experiments[-1]
        assert not flown.left_envelope and flown.quality > campaign.experiments[0].quality
        assert campaign.history[-1].asked[-1].safe
    best = campaign.best_test
    assert best.risk < 0.2 and np.abs(system.run(best).states[:, 1]).max() <= 1.1
    # After the first flight alone it is not recommended either.
    again = begin(signals=signals, options={"candidates": 256, "evaluations": 2048})
    first = again.test(quick, excitation=None)
    again.tell(first, system.run(first))
    assert np.abs(system.run(again.best_test).states[:, 1]).max() <= 1.1
    assert "the best flown gains did not keep it to the end" in again.best_test.reason


def test_a_first_reading_that_no_state_was_near_is_refused_and_a_noisy_one_is_not(begin, pendulum):
    campaign = begin()
    test = campaign.test(PENDULUM_GAINS)
    run = pendulum.run(test)
    states = np.array(run.states)
    states[0, 0] = 1.5
    with pytest.raises(
        tl.InvalidInput, match=r"expected angle to begin near 0 rad, found 1\.5 in the first row"
    ):
        campaign.tell(test, changed(run, states))
    assert campaign.experiments == ()
    for seed in range(200):
        noisy = run.states + np.random.default_rng(seed).normal(0.0, 0.3, run.states.shape)
        check_first_reading(changed(run, noisy), test)
    # A run that began elsewhere, and stayed there, is a run.
    check_first_reading(changed(run, run.states + np.array([0.5, 0.0])), test)


def test_the_same_test_twice_is_a_replicate(begin, pendulum):
    campaign = told(begin(), pendulum)
    first = campaign.experiments[0].test
    campaign.tell(first, pendulum.run(first))
    assert [row.test for row in campaign.twin.errors] == [0, 0]
    assert campaign.ask().number == 1


def test_a_system_that_does_not_listen_is_handled(begin):
    deaf = tl.systems.Simulated(SIGNALS, lambda x, u: (0.9 * x[0] + 0.01, 0.0), default_gains=PENDULUM_GAINS)
    campaign = begin().run(deaf, 3)
    assert len(campaign.experiments) == 3 and campaign.best_test.reason


@pytest.mark.parametrize("tests", ["random", "chirp", "prbs"])
def test_tests_that_no_committee_chose_are_flown(begin, pendulum, tests):
    campaign = begin(options={"tests": tests}).run(pendulum, 2)
    plan = campaign.history[0].asked[0]
    assert "without a committee" in plan.reason and plan.flown == campaign.experiments[1].quality
    assert {plan.predicted, plan.spread, plan.risk, plan.safe, plan.bits, plan.gain} == {None}
    assert np.abs(campaign.experiments[1].test.excitation).max() > 0.0


def test_the_last_experiment_of_a_budget_flies_the_best_gains_as_they_are(begin, pendulum):
    campaign = begin().run(pendulum, 2)
    assert campaign.experiments[1].test.excitation is None
    assert campaign.experiments[1].test.reason.startswith("The best gains")
    by_hand = told(begin(), pendulum).ask(last=True)
    assert by_hand.same_as(replace(campaign.experiments[1].test, campaign=by_hand.campaign))
    explored = begin(options={"exploit_last": False}).run(pendulum, 2)
    assert not explored.experiments[1].test.reason.startswith("The best gains")


def test_a_last_experiment_that_would_be_in_vain_flies_the_best_gains_flown_as_they_are(begin, pendulum):
    usual, asked = told(begin(), pendulum).ask(last=True), []
    campaign = told(begin(), pendulum)
    first = campaign.experiments[0]

    def vain(*of_it):
        asked.append(of_it)
        return True

    with mock.patch.object(method_of_default, "in_vain", vain):
        test = campaign.ask(last=True)
        assert campaign.waiting_last is test
        assert campaign.ask().number != test.number  # none that is not the last is held against that
        another = campaign.ask(last=True)  # while one waits, as without `last`
        assert another.excitation is not None and campaign.waiting_last is test
    assert asked == [(usual.predicted, usual.spread, first.quality)]
    assert same_bits(test.genes, first.test.genes) and not same_bits(usual.genes, test.genes)
    assert test.excitation is None and test.reason == "The best gains flown, again: they are known to fly."
    assert test.predicted != usual.predicted and test.spread > 0.0
    own = campaign.test(0.8 * first.test.genes)
    campaign.tell(own, pendulum.run(own))
    assert campaign.waiting_last is None  # another twin has to plan it anew


@pytest.mark.parametrize(("misses", "share"), [(False, 0.15), (True, 0.35)])
def test_the_first_prediction_of_a_twin_that_misses_its_own_flight_has_the_spread_of_such(
    begin, pendulum, misses, share
):
    with mock.patch.object(Learnt, "misses", new_callable=mock.PropertyMock, return_value=misses):
        test = told(begin(), pendulum).ask()
    assert test.spread == pytest.approx(share * test.predicted)


def test_where_gains_make_no_difference_on_the_twin_the_best_ones_fly_again_held_back(begin, pendulum):
    """A law may let a state stand still that moves: no flight on such a twin tells one controller from another."""
    with mock.patch.object(method_of_default, "gains_count", return_value=False):
        campaign = told(begin(), pendulum)
        first, test = campaign.experiments[0].test, campaign.ask()
    assert same_bits(test.genes, first.genes) and test.hold_back is not None
    # It goes on from where the first excitation ended.
    assert np.abs(test.excitation).max() > 1.5 * np.abs(first.excitation).max()
    assert "does not know yet what the commands do" in test.reason
    assert told(begin(), pendulum).ask().hold_back is None


def test_what_is_predicted_of_a_flight_that_is_held_back_is_predicted_held_back(begin, pendulum):
    # Nothing of the excitation is sent once the angle has moved by a fiftieth of its way.
    tight = HoldBack([[-0.01, 0.01], [-9.0, 9.0]], [[-0.02, 0.02], [-10.0, 10.0]])
    with (
        mock.patch.object(method_of_default, "gains_count", return_value=False),
        mock.patch.object(Planner, "held_back", return_value=tight),
    ):
        campaign = told(begin(), pendulum)
        test = campaign.ask()
    assert test.hold_back is tight

    def simulated(test):
        found = campaign.twin.simulate(test)
        return campaign.setup.quality.flown(found, test.target_state)

    held, whole = simulated(test), simulated(replace(test, hold_back=None))
    assert abs(test.predicted - held) < 0.2 * abs(whole - held)


def test_gains_are_not_tuned_on_lesser_models_where_nothing_that_is_commanded_moves_the_best_one(
    begin, pendulum
):
    asked, counted = [], method_of_default.gains_count

    def only_on_lesser(judge, members, untunable):
        asked.append(len(members))
        return len(members) > 1 and counted(judge, members, untunable)

    with mock.patch.object(method_of_default, "gains_count", only_on_lesser):
        campaign = told(begin(), pendulum)
        test = campaign.ask()
    assert asked and len(campaign._method.committee()) > 1
    assert same_bits(test.genes, campaign.experiments[0].test.genes) and test.hold_back is not None


def test_until_a_prediction_has_come_true_the_controller_to_fly_leads_no_further_than_the_next_flight(
    begin, pendulum
):
    limits = {"reach_seen": 0.1}
    campaign = told(begin(options=limits), pendulum)
    best, tuned = campaign.best_test, campaign._method._gains(campaign._book)
    assert best.reason.startswith("Tuned on the twin") and not same_bits(best.genes, tuned)
    assert same_bits(best.genes, told(begin(options=limits), pendulum).ask(last=True).genes)
    confirmed = mock.patch.object(method_of_default, "nearly_confirmed_in_a_row", return_value=1)
    with confirmed:
        campaign = told(begin(options=limits), pendulum)
        assert same_bits(campaign.best_test.genes, campaign._method._gains(campaign._book))


@pytest.mark.parametrize(("flights", "again"), [(1, 1.0), (2, 0.0)])
def test_gains_must_bear_that_what_states_do_ends_where_flights_and_task_were_or_after_one_flight_as_far_again(
    begin, pendulum, flights, again
):
    campaign = begin()
    test = campaign.test(PENDULUM_GAINS)
    for _ in range(flights):
        campaign.tell(test, pendulum.run(test))
        test = campaign.ask()
    method, book = campaign._method, campaign._book
    ended = method._committee(book).ending
    readings = np.concatenate([run.trajectory.states for run in book.experiments])
    ends = np.array([book.setup.initial_state, book.setup.target_state])
    far = np.ptp(readings, axis=0)
    highest = np.maximum(readings.max(axis=0), ends.max(axis=0)) + again * far

    def moved(law, beyond):
        """By how much the rate changes in a period, from so far beyond where the law ends."""
        place = highest + beyond
        return law.step([place], [[0.0]])[0, 1] - place[1]

    # Beyond, states do what they did at their ends; the law itself goes on.
    assert moved(ended, 10.0) == pytest.approx(moved(ended, 20.0), rel=1e-9)
    assert moved(ended, -0.4 * far) == moved(method._committee(book).members[0], -0.4 * far)
    assert abs(moved(method._committee(book).members[0], 10.0) - moved(ended, 10.0)) > 0.1


def test_where_a_flight_has_left_is_no_place_where_flights_have_been(begin, pendulum):
    known = replace(SIGNALS, states=[replace(SIGNALS.states[0], envelope=(-1.5, 2.5)), SIGNALS.states[1]])
    campaign = told(begin(signals=known), pendulum)
    seen = campaign._method._seen(campaign._book)
    test = campaign.test(PENDULUM_GAINS)
    run = pendulum.run(test)
    far = run.states.copy()
    far[14:, 0] += 3.0
    lost = tl.Trajectory(run.t, far, run.commands, ended="aborted", reason="it was lost")
    campaign.tell(test, lost)
    assert campaign.experiments[-1].left_envelope
    assert same_bits(campaign._method._seen(campaign._book).flights, seen.flights)
    # Where all have left, there is nothing else to go by than what was inside.
    alone = begin(signals=known)
    first = alone.test(PENDULUM_GAINS)
    alone.tell(first, lost)
    low, high = alone._method._seen(alone._book).flights
    assert low[0] >= -1.5 and high[0] <= 2.5 and (low <= high).all()


def test_without_the_option_nothing_ends(begin, pendulum):
    campaign = begin(options={"ends": False})
    test = campaign.test(PENDULUM_GAINS)
    for _ in range(2):
        campaign.tell(test, pendulum.run(test))
        test = campaign.ask()
    assert campaign._method._committee(campaign._book).ending is None


def test_a_controller_to_fly_that_relies_on_what_no_flight_has_shown_leads_no_further_than_the_next_flight(
    begin, pendulum
):
    confirmed = mock.patch.object(method_of_default, "nearly_confirmed_in_a_row", return_value=1)
    campaign = told(begin(), pendulum)
    with confirmed, mock.patch.object(Planner, "is_near", return_value=False):
        with mock.patch.object(Planner, "propose", autospec=True, side_effect=Planner.propose) as proposed:
            _ = campaign.best_test
        assert proposed.called
    campaign = told(begin(), pendulum)
    with confirmed, mock.patch.object(Planner, "propose", autospec=True) as proposed:
        _ = campaign.best_test
    assert not proposed.called


@pytest.mark.parametrize("bears", [True, False])
def test_gains_must_bear_more_delay_until_a_prediction_has_come_true(begin, pendulum, bears):
    campaign = told(begin(options={"delay_margin": bears}), pendulum)
    _ = campaign.twin
    assert len(campaign._method._committee(campaign._book).delayed) == bears


def test_the_delay_that_gains_bear_and_the_one_they_fly_well_with_shrink_with_each_prediction_that_comes_true(
    begin, pendulum
):
    campaign = told(begin(), pendulum)
    _ = campaign.twin
    method, book = campaign._method, campaign._book

    def later(slower):
        """By how many periods a slower model acts later, as a delay and as a lag."""
        models = method._latest().believed[0], slower[0]
        (before,), (after,) = (Actuation.of(model, SIGNALS).actuators for model in models)
        return after.delay - before.delay, (after.lag - before.lag) / SIGNALS.dt

    committee = method._committee(book)
    assert later(committee.delayed) == (1, 0.0) and committee.tuned_delayed is committee.delayed
    for came_true, borne, counted in ((1, 0.5, 0.25), (2, 0.25, 0.0625), (3, 0.125, 0.015625)):
        with mock.patch.object(method_of_default, "nearly_confirmed_in_a_row", return_value=came_true):
            committee = method._committee(book)
            assert later(committee.delayed) == (0, pytest.approx(borne))
            assert later(committee.tuned_delayed) == (0, pytest.approx(counted))


@pytest.mark.parametrize(
    ("least", "true", "borne"), [(1.0, 3, (1, 0.0)), (1.5, 0, (1, 0.5)), (0.3, 1, (0, 0.5))]
)
def test_a_delay_that_is_asked_for_is_borne_whatever_came_true(begin, pendulum, least, true, borne):
    campaign = told(begin(options={"delay_least": least}), pendulum)
    _ = campaign.twin
    method, book = campaign._method, campaign._book
    with mock.patch.object(method_of_default, "nearly_confirmed_in_a_row", return_value=true):
        committee = method._committee(book)
    models = method._latest().believed[0], committee.delayed[0]
    (before,), (after,) = (Actuation.of(model, SIGNALS).actuators for model in models)
    later = after.delay - before.delay, (after.lag - before.lag) / SIGNALS.dt
    assert later == (borne[0], pytest.approx(borne[1]))
    # Where a whole one is asked for they are tuned with it as well, on the same model.
    assert (committee.tuned_delayed is committee.delayed) == (least >= 1.0)


def test_the_band_is_wider_by_what_flights_have_shown_but_not_those_of_a_committee_with_parts(
    begin, pendulum
):
    inflations = {}
    # Of one second no part is long enough.
    for duration in (1.0, 3.0):
        campaign, found = begin(duration=duration), []
        test = campaign.test(PENDULUM_GAINS)
        for _ in range(4):
            campaign.tell(test, pendulum.run(test))
            test = campaign.ask()
            found.append(campaign.twin.inflation)
        inflations[duration] = found
    short, long = inflations[1.0], inflations[3.0]
    assert short[0] == 2.0 and short[1] != 2.0
    assert long[:2] == [1.5, 2.0] and long[2] != 2.0
    assert all(1.0 <= factor <= 30.0 for factor in short + long)


def runge_kutta_pendulum(x, u):
    """One period of a pendulum, integrated as a twin is: nothing but rounding is between the two."""
    return rk4(lambda now: np.array([now[1], 6.0 * u[0] - 12.0 * np.sin(now[0])]), np.asarray(x), SIGNALS.dt)


def test_the_band_of_exact_readings_is_that_of_what_the_twin_leaves_of_the_flights_it_knows(begin):
    plant = tl.systems.Simulated(SIGNALS, runge_kutta_pendulum)
    campaign, shares = begin(duration=3.0, options={"moves": 4000}), []
    test = campaign.test(PENDULUM_GAINS)
    for number in range(3):
        flight = plant.run(test)
        if number:
            low, high = campaign.twin.simulate(test).band[:, 1:]
            shares.append(np.mean((low <= flight.states[1:]) & (flight.states[1:] <= high)))
        campaign.tell(test, flight)
        test = campaign.ask()
        twin = campaign.twin
        left = [run.trajectory.states - twin.simulate(run.test).states for run in campaign.experiments]
        nine_of_ten = [np.quantile(np.abs(errors), 0.9, axis=0) for errors in left]
        np.testing.assert_array_equal(twin.noise.sensors, np.median(nine_of_ten, axis=0) / 1.645)
        assert twin.inflation == 1.0 and twin.noise.sensors.max() < 1e-12
    assert min(shares) > 0.5


def laws(twin):
    """The equations without their legend, which names the flights."""
    return twin.equations().partition("\n\n")[2]


@pytest.mark.parametrize("keeps", [True, False])
def test_where_more_flights_make_a_worse_twin_the_one_of_before_is_kept(begin, pendulum, monkeypatch, keeps):
    campaign = told(begin(options={"earlier_twin": keeps}), pendulum)
    test = campaign.ask()
    before = laws(campaign.twin)
    identify, nothing = learning.identify_runs, "r3 = r3 + 0.0"

    def worse(*arguments, **given):
        found = identify(*arguments, **given)
        program = _core.Program.parse(program_text(3, 1, 4, [[nothing]]))
        still = _core.Model(program, "acceleration", SIGNALS.engine)
        return replace(found, model=still, members=[still] * len(found.members))

    monkeypatch.setattr(learning, "identify_runs", worse)
    campaign.tell(test, pendulum.run(test))
    assert (laws(campaign.twin) == before) is keeps
    kept = [remark.sentence for remark in campaign.twin.remarks if remark.code == "known-before"]
    assert len(kept) == keeps
    if not keeps:
        return
    # It may still miss more than what is known to disturb explains, and another remark says so.
    assert "by more than any disturbance explains" in kept[0] and "misses none" not in kept[0]
    monkeypatch.setattr(learning, "identify_runs", identify)
    test = campaign.ask()
    campaign.tell(test, pendulum.run(test))
    assert laws(campaign.twin) != before
    assert "known-before" not in [remark.code for remark in campaign.twin.remarks]


def test_gusts_are_reported_unless_the_readings_were_taken_for_exact(begin, monkeypatch):
    stream = np.random.default_rng(0)

    def gusty_pendulum(x, u):
        push = stream.normal(0.0, 2.0)
        return rk4(
            lambda now: np.array([now[1], 6.0 * u[0] - 12.0 * np.sin(now[0]) + push]),
            np.asarray(x),
            SIGNALS.dt,
        )

    plant = tl.systems.Simulated(SIGNALS, gusty_pendulum, default_gains=PENDULUM_GAINS)
    campaign = begin(duration=3.0).run(plant, 1)
    (found,) = summary(campaign, {}, {})["twin"]["disturbances"]
    assert found["name"] == "rate" and max(found["white"] / SIGNALS.dt, found["correlated"]) > 0.5
    # The same noise, had it been held at the least that is believed rather than estimated.
    exact = [replace(lesson, misfit=1e-6) for lesson in campaign.history]
    monkeypatch.setattr(tl.Campaign, "history", property(lambda campaign: exact))
    assert summary(campaign, {}, {})["twin"]["disturbances"] == []


def test_a_flight_that_began_elsewhere_is_compared_with_the_twin_from_there(begin, pendulum):
    campaign, off = begin(duration=3.0), np.array([0.1, -0.2])
    for _ in range(2):
        test = campaign.test(PENDULUM_GAINS)
        campaign.tell(test, pendulum.run(replace(test, initial_state=off)))
    twin, run = campaign.twin, campaign.experiments[0]
    states = summary(campaign, {}, {})["twin"]["states"]
    (start,) = twin.model.states_of(off[np.newaxis])  # the plant's small steps read the angle early
    left = [
        run.trajectory.states[1:] - twin.simulate(replace(run.test, initial_state=start)).states[1:]
        for run in campaign.experiments
    ]
    expected = np.sqrt(np.mean(np.square(np.concatenate(left)), axis=0))
    np.testing.assert_allclose([state["error"] for state in states], expected)
    # What the sensor explains is no other start.
    silent = Noise(np.array([0.05, 0.03]), np.zeros(2))
    noisy = tl.Twin(twin.model, SIGNALS, noise=silent)
    np.testing.assert_array_equal(noisy.as_flown(run.test, run.trajectory).initial_state, [0.0, -0.2])


def test_members_that_are_one_spread_by_nothing_not_by_the_rounding_of_their_mean(begin, pendulum):
    campaign = begin().run(pendulum, 1)
    model, test = campaign.twin.model, campaign.experiments[0].test
    silent = Noise(np.zeros(2), np.zeros(2))
    twin = tl.Twin(model, SIGNALS, members=[model] * 7, noise=silent)
    mean, variance = twin.spread(test)
    np.testing.assert_array_equal(mean, twin.simulate(test).states)
    np.testing.assert_array_equal(variance, np.zeros_like(mean))


def test_a_pendulum_is_learnt_and_flown_better_than_at_first(begin):
    # Read with noise, as a rig is: of exact readings the law would also have to say how coarsely the plant is stepped.
    rig = tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=PENDULUM_GAINS, noise=1e-3)
    campaign = begin(options={"moves": 4000, "evaluations": 1000}).run(rig, 3)
    assert campaign.experiments[-1].quality <= campaign.experiments[0].quality
    assert max(row.normalised for row in campaign.twin.errors) < 1e-3
    assert "sin(angle)" in campaign.twin.equations()
    first, best = campaign.experiments[0], campaign.best_test
    assert best.predicted <= 1.05 * first.quality and best.excitation is None
    band = campaign.twin.simulate(first.test).band
    assert band.shape == (2, 21, 2) and (band[0] <= band[1]).all()


BRIEF = {
    **THOROUGH, "libraries": ("linear", "quadratic"), "moves": 4000, "passes": 1, "parts": False, "hidden": False,
    "offsets": False,
}  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_test_that_was_flown_again_and_again_teaches_the_plant_and_not_its_controller(seed):
    plant = tl.systems.Quadrotor(noise=1e-2, seed=seed)
    campaign = default_campaign(
        BRIEF, signals=plant.signals, controller=plant.controller, initial_state=plant.initial_state,
        target_state=plant.target_state, duration=2.0, seed=seed,
    )  # fmt: skip
    test = campaign.test(plant.default_gains)
    for _ in range(4):
        campaign.tell(test, plant.run(test))
    # Commands are sums of readings: with them a law can give a reading's noise back, and call it explained.
    assert len(campaign.committee) > 0
    lesson = campaign.history[-1]
    np.testing.assert_allclose(lesson.sensors, [0.01] * 3 + [0.05] * 3, rtol=0.15)
    assert lesson.terms <= 10 and lesson.follows and max(lesson.normalised) < 0.01


def test_copies_of_a_record_teach_nothing(begin, pendulum):
    one, many = begin(), begin()
    for campaign, times in ((one, 1), (many, 3)):
        test = campaign.test(PENDULUM_GAINS)
        record = pendulum.run(test)
        for _ in range(times):
            campaign.tell(test, record)
    assert str(many.twin.model.program) == str(one.twin.model.program)
    assert many.history[-1].readings == one.history[-1].readings
    assert "2 of 3 records are exact copies of an earlier one" in " ".join(map(str, many.history[-1].remarks))


def test_a_flight_of_another_task_is_not_given_back_as_the_best(begin, pendulum):
    campaign = begin(options={"target_range": (0.3, 0.0)}, goal="model").run(pendulum, 3)
    assert any(run.test.target_state[0] != 1.0 for run in campaign.experiments)
    best = campaign.best_test
    np.testing.assert_array_equal([*best.initial_state, *best.target_state], [0.0, 0.0, 1.0, 0.0])
    flown = [run for run in campaign.experiments if (run.test.target_state == [1.0, 0.0]).all()]
    # What was measured on the way to another target is not the quality of this one.
    assert best.measured in [None, *(run.quality for run in flown)]
    assert standing.best_flown(campaign._book).number == min(flown, key=lambda run: run.quality).test.number


def test_gains_that_may_not_be_tried_yet_are_not_recommended_either(begin, pendulum):
    campaign = told(begin(), pendulum)
    _ = campaign.twin  # learns
    method, book = campaign._method, campaign._book
    committee, best = method._committee(book), standing.best_flown(book)
    tuned = best.genes * 1.01
    far = mock.patch.object(Planner, "is_near", lambda *given: False)
    for safe, genes in ((True, best.genes * 1.005), (False, best.genes)):
        unsafe = mock.patch.object(
            Planner, "propose", lambda *given, s=safe, g=genes, **more: mock.Mock(safe=s, genes=g)
        )
        limits = mock.patch.object(type(committee), "predicts_limits", True)
        with far, unsafe, limits:
            assert same_bits(method._within_reach(committee, tuned, book), genes)

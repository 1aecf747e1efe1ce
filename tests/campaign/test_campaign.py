"""The double loop, counted in experiments: ask, fly, tell; what is learnt when; what interrupts it."""

import dataclasses

import numpy as np
import pytest

import twinloop as tl
from lives import StopAt
from oracles import final_distance, same_bits
from twinloop import pareto
from twinloop.law.forms import FORMS
from twinloop.objectives import closed_loop, frozen_error, open_loop, selected_tests

GAINS = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}


class Counting(tl.System):
    """Counts its runs; offers no first controller."""

    def __init__(self, system):
        self.system, self.flown = system, []

    @property
    def signals(self):
        return self.system.signals

    def run(self, test):
        self.flown.append(test)
        return self.system.run(test)


def begun(campaign, system):
    first = campaign.test(GAINS)
    campaign.tell(first, system.run(first))
    return campaign


def snapshot(campaign):
    return (
        [run.test.number for run in campaign.experiments],
        campaign.history,
        campaign.models.archive_objectives.tobytes(),
    )


# The loop of the paper


def test_iteration_i_learns_the_tests_before_it(new_campaign, pendulum):
    campaign = new_campaign().run(pendulum, experiments=4)
    _ = campaign.twin
    assert [(record.iteration, record.tests) for record in campaign.history] == [
        (0, (0,)),
        (1, (0,)),
        (2, (0, 1)),
        (3, (0, 1, 2)),
        (4, (0, 1, 2, 3)),
    ]
    assert [record.generations for record in campaign.history] == [0, 8, 8, 8, 8]
    assert [len(record.closed_loop) for record in campaign.history] == [1, 1, 2, 3, 4]
    assert campaign.models.iteration == 4
    assert campaign.models.archive_objectives.shape[1] == 8


def test_the_test_asked_after_an_iteration_is_noted_there(new_campaign, pendulum):
    campaign = new_campaign().run(pendulum, experiments=3)
    asked = [[loop.test for loop in record.asked] for record in campaign.history]
    assert asked == [[], [1], [2]]
    loop = campaign.history[1].asked[0]
    run = campaign.experiments[1]
    assert loop.genes == tuple(run.test.genes)
    assert loop.flown == run.final_distance
    assert loop.predicted == run.test.predicted
    assert loop.generations == 4 and len(loop.objectives) == 2


def test_the_third_objective_is_asked_for_by_name(new_campaign, pendulum):
    campaign = new_campaign(options={"control_quality": True}).run(pendulum, experiments=2)
    loop = campaign.history[1].asked[0]
    assert len(loop.objectives) == 3
    assert loop.objectives[2] == pytest.approx(loop.predicted, rel=1e-12)


def test_experiments_count_every_run_on_the_system(new_campaign, pendulum):
    system = Counting(pendulum)
    campaign = begun(new_campaign(), system)
    campaign.run(system, experiments=3)
    assert len(system.flown) == len(campaign.experiments) == 3
    campaign.run(system, experiments=3)
    assert len(system.flown) == 3


def test_a_run_of_fewer_experiments_than_were_told_is_refused(new_campaign, pendulum):
    system = Counting(pendulum)
    campaign = begun(new_campaign(), system).run(system, 2)
    with pytest.raises(
        tl.InvalidInput, match=r"at least the 2 runs that are recorded already, found 1;.* say 3"
    ):
        campaign.run(system, experiments=1)
    assert len(system.flown) == 2


def test_run_is_the_loop_by_hand(new_campaign, pendulum):
    by_hand = begun(new_campaign(), pendulum)
    for last in (False, True):
        test = by_hand.ask(last=last)
        by_hand.tell(test, pendulum.run(test))
    assert snapshot(by_hand) == snapshot(new_campaign().run(pendulum, 3))


def test_run_flies_the_last_test_that_was_made_first(new_campaign, pendulum):
    campaign = new_campaign()
    campaign.test(GAINS)
    campaign.test({**GAINS, "angle.kp": 1.0})
    campaign.run(Counting(pendulum), 1)
    assert campaign.experiments[0].test.parameters["angle.kp"] == 1.0


def test_run_flies_what_was_asked_and_not_told_before_it_asks_again(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    waiting = campaign.ask()
    campaign.run(pendulum, 2)
    assert campaign.experiments[1].test.number == waiting.number


# Ask and tell


def test_asking_twice_gives_two_tests_and_learns_nothing_between(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    one = campaign.ask()
    evaluations = campaign.models.evaluations
    two = campaign.ask()
    assert not same_bits(one.genes, two.genes)
    assert (one.number, two.number) == (1, 2)
    assert campaign.models.evaluations == evaluations
    assert [loop.test for loop in campaign.history[1].asked] == [1, 2]


def test_tests_are_told_in_any_order(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    one, two = campaign.ask(), campaign.ask()
    campaign.tell(two, pendulum.run(two))
    campaign.tell(one, pendulum.run(one))
    assert [row.test for row in campaign.twin.errors] == [0, 2, 1]
    assert campaign.history[-1].tests == (0, 2, 1)


def test_a_test_told_twice_is_a_replicate_with_a_row_of_its_own(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    first = campaign.experiments[0].test
    campaign.tell(first, pendulum.run(first))
    assert [row.test for row in campaign.twin.errors] == [0, 0]
    assert campaign.models.archive_objectives.shape[1] == 4
    assert campaign.best_test.measured == pytest.approx(campaign.experiments[0].final_distance)


def test_the_twin_learns_what_was_told_on_first_access(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    assert len(campaign.twin.errors) == 1
    test = campaign.ask()
    campaign.tell(test, pendulum.run(test))
    assert len(campaign.history) == 2
    assert len(campaign.twin.errors) == 2
    assert len(campaign.history) == 3
    evaluations = campaign.models.evaluations
    _ = campaign.twin, campaign.controller, campaign.best_test
    assert campaign.models.evaluations == evaluations


def test_an_asked_test_carries_what_the_best_model_predicts(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    test = campaign.ask()
    run = campaign.twin.simulate(test)
    if run.ended == "completed":
        assert test.predicted == pytest.approx(final_distance(run.states[-1], test.target_state), rel=1e-12)
    else:
        assert test.predicted == np.inf
    assert test.measured is None


def test_a_question_before_anything_was_told_says_what_to_do(new_campaign):
    campaign = new_campaign()
    for ask in (campaign.ask, lambda: campaign.twin, lambda: campaign.best_test, lambda: campaign.models):
        with pytest.raises(tl.NotAvailable, match="xpected"):
            ask()
    assert campaign.history == () and campaign.experiments == ()


def test_a_run_that_was_cut_can_be_told(new_campaign, pendulum):
    campaign = new_campaign()
    first = campaign.test(GAINS)
    whole = pendulum.run(first)
    cut = tl.Trajectory(whole.t[:8], whole.states[:8], whole.commands[:7], ended="aborted", reason="stopped")
    campaign.tell(first, cut)
    assert campaign.experiments[0].final_distance is None
    assert campaign.best_test.number == 0 and campaign.best_test.measured is None
    assert campaign.twin.errors[0].normalised > 0.0


def test_the_controller_is_one_object_until_its_gains_change(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    controller = campaign.controller
    integrating = [campaign.controller.command([0.2, 0.0], [1.0, 0.0]) for _ in range(3)]
    assert integrating[0] < integrating[1] < integrating[2]  # the integral grows from access to access
    campaign.ask()
    _ = campaign.twin, campaign.history
    assert campaign.controller is controller
    # A run that changes nothing about which gains are the best leaves it as it is.
    worse = campaign.test({"angle.kp": 0.01, "angle.ki": 0.0, "angle.kd": 1.0})
    campaign.tell(worse, pendulum.run(worse))
    assert campaign.best_test.number == 0 and campaign.controller is controller
    better = campaign.test({"angle.kp": 5.0, "angle.ki": 5.0, "angle.kd": 0.8})
    campaign.tell(better, pendulum.run(better))
    assert campaign.best_test.number == better.number
    assert campaign.controller is not controller and campaign.controller is campaign.controller
    assert same_bits(campaign.controller.genes, better.genes)


# What is told about the twin and the tests


def test_errors_of_the_twin_are_those_of_its_model(new_campaign, pendulum):
    campaign = new_campaign().run(pendulum, 3)
    twin = campaign.twin
    runs = campaign.experiments
    selected = selected_tests([run.test for run in runs], [run.trajectory for run in runs])
    for k, row in enumerate(twin.errors):
        assert row.open_loop == open_loop([twin.model], selected)[0, k]
        assert row.closed_loop == row.after == closed_loop([twin.model], selected)[0, k]
        assert row.normalised == pytest.approx(row.closed_loop / frozen_error(runs[k].trajectory))
    assert runs[0].before is None and all(run.before is not None for run in runs[1:])


def test_the_error_before_is_that_of_the_twin_that_had_not_learnt_the_test(new_campaign, pendulum):
    campaign = begun(new_campaign(), pendulum)
    test = campaign.ask()
    ignorant = campaign.twin.model
    run = pendulum.run(test)
    campaign.tell(test, run)
    expected = closed_loop([ignorant], selected_tests([test], [run]))[0, 0]
    assert campaign.experiments[1].before == campaign.twin.errors[1].before == expected


def test_the_best_test_is_the_flown_one_that_ended_nearest(new_campaign, pendulum):
    campaign = new_campaign().run(pendulum, 4)
    flown = [final_distance(r.trajectory.states[-1], r.test.target_state) for r in campaign.experiments]
    best = campaign.best_test
    assert best.number == int(np.argmin(flown))
    assert best.measured == pytest.approx(min(flown), rel=1e-12)
    assert campaign.controller.parameters == best.parameters
    assert best.excitation is None


def test_a_twin_simulates_and_predicts_with_the_same_model(new_campaign, pendulum):
    campaign = new_campaign().run(pendulum, 2)
    twin = campaign.twin
    run = twin.simulate(campaign.experiments[0].test)
    following = twin.predict(run.states[:-1], run.commands)
    assert same_bits(following, run.states[1:])
    assert same_bits(twin.predict(run.states[0], run.commands[0]), run.states[1])
    again = twin.simulate_commands(run.states[0], run.commands)
    assert same_bits(again.states, run.states)


def test_a_twin_that_runs_away_is_cut_at_the_same_step_with_and_without_a_controller(
    pendulum_signals, pendulum_controller
):
    family = pendulum_controller.bind(pendulum_signals)
    test = tl.Test(family, [1.0, 0.0, 0.0], [1.0, 1.0], [0.0, 0.0], 9)
    text = "program inputs=3 outputs=2 registers=5\npage 1\n  r3 = r0 * 1.0\n  r4 = r1 * 2.0\n"
    model = tl._core.Model(tl._core.Program.parse(text), "absolute", pendulum_signals.engine)
    for factor in (0.5, 1.0, 2.0, 3.0):  # limits of the rate that are powers of two, and one that is not
        twin = tl.Twin(model, pendulum_signals, limits=tl.Limits(pendulum_signals, factor))
        flown, driven = twin.simulate(test), twin.simulate_commands([1.0, 1.0], np.zeros((9, 1)))
        assert flown.ended == driven.ended == "diverged"
        assert flown.steps == driven.steps


def test_commands_reach_a_twin_through_its_lags_and_hidden_states(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    test = tl.Test(family, [0.8, 0.1, 0.2], [0.4, 0.0], [0.0, 0.0], 30)
    text = (
        "program inputs=4 outputs=1 registers=6\npage 1\n  r4 = r2 * 2.0\n  r5 = r3 * 0.5\n  r4 = r4 - r5\n"
        "  r4 = r4 - r0\n"
    )
    program = tl._core.Program.parse(text)
    actuators, hidden = [(0.15, 2, 0.3, 0.0)], [([0], True, None, 0.5, [], False, 0.0, 0.0, 0.0)]
    model = tl._core.Model(program, "acceleration", pendulum_signals.engine, actuators, hidden)
    twin = tl.Twin(model, pendulum_signals)
    flown = twin.simulate(test)
    assert flown.ended == "completed"
    driven = twin.simulate_commands([0.4, 0.0], flown.commands)
    np.testing.assert_allclose(driven.states, flown.states, rtol=0.0, atol=1e-12)
    nothing = twin.simulate_commands([0.4, 0.0], np.zeros((0, 1)))
    assert nothing.steps == 0 and same_bits(nothing.states, np.array([[0.4, 0.0]]))


# Bad answers leave everything as it was


def bad_trajectories(good):
    t, x, u = good.t, good.states, good.commands
    return {
        "no trajectory": (x, "found ndarray"),
        "one step": (tl.Trajectory(t[:2], x[:2], u[:1]), "at least 2 steps"),
        "no step": (tl.Trajectory(t[:1], x[:1], u[:0]), "at least 2 steps"),
        "another width": (tl.Trajectory(t, np.hstack([x, x]), u), "expected 2 states"),
        "another command": (tl.Trajectory(t, x, np.hstack([u, u])), "expected 1 commands"),
        "another period": (tl.Trajectory(2.0 * t, x, u), "expected a period of 0.05 s"),
        "too long": (
            tl.Trajectory(np.arange(23) * 0.05, np.zeros((23, 2)), np.zeros((22, 1))),
            "at most the 20 steps",
        ),
        "out of scale": (tl.Trajectory(t, x * 1e6, u), "declare a larger scale"),
    }


KINDS = [
    "no trajectory",
    "one step",
    "no step",
    "another width",
    "another command",
    "another period",
    "too long",
    "out of scale",
]


@pytest.mark.parametrize("kind", KINDS)
def test_a_useless_trajectory_is_refused_and_changes_nothing(new_campaign, pendulum, kind):
    campaign = begun(new_campaign(), pendulum)
    test = campaign.ask()
    before = snapshot(campaign)
    bad, sentence = bad_trajectories(pendulum.run(test))[kind]
    with pytest.raises(tl.InvalidInput, match=sentence):
        campaign.tell(test, bad)
    assert snapshot(campaign) == before
    campaign.tell(test, pendulum.run(test))
    untouched = begun(new_campaign(), pendulum)
    again = untouched.ask()
    untouched.tell(again, pendulum.run(again))
    assert snapshot(campaign) == snapshot(untouched)


def test_a_test_of_another_campaign_is_refused(new_campaign, pendulum):
    campaign, other = begun(new_campaign(), pendulum), new_campaign()
    stranger = other.test(GAINS)
    with pytest.raises(tl.InvalidInput, match="expected a test of this campaign"):
        campaign.tell(stranger, pendulum.run(stranger))
    with pytest.raises(tl.InvalidInput, match="found str"):
        campaign.tell("test 0", campaign.experiments[0].trajectory)
    assert len(campaign.experiments) == 1


# Interruption


@pytest.mark.parametrize("call", [1, 2, 3, 4, 6, 9, 12, 15])
def test_an_interrupted_campaign_keeps_the_best_so_far_and_goes_on_with_the_same_bits(
    monkeypatch, new_campaign, pendulum, call
):
    monkeypatch.setattr("twinloop.campaign.coevolution.search.CHUNK_SECONDS", 0.0)
    campaign = new_campaign(progress=StopAt(call))
    with pytest.raises(KeyboardInterrupt):
        campaign.run(pendulum, 3)
    assert campaign.interrupted
    if campaign.experiments:
        assert len(campaign.twin.errors) == len(campaign.experiments)
        assert campaign.best_test.number in [run.test.number for run in campaign.experiments]
        assert campaign.history[0].iteration == 0
    campaign.run(pendulum, 3)
    assert not campaign.interrupted
    whole = new_campaign().run(pendulum, 3)
    assert snapshot(campaign) == snapshot(whole)
    assert all(
        same_bits(a.test.genes, b.test.genes)
        for a, b in zip(campaign.experiments, whole.experiments, strict=True)
    )


def test_an_interrupted_iteration_is_in_the_history_with_the_generations_it_had(
    monkeypatch, new_campaign, pendulum
):
    monkeypatch.setattr("twinloop.campaign.coevolution.search.CHUNK_SECONDS", 0.0)
    campaign = new_campaign(progress=StopAt(5))
    with pytest.raises(KeyboardInterrupt):
        campaign.run(pendulum, 3)  # one experiment, then four generations
    assert [(r.iteration, r.generations) for r in campaign.history] == [(0, 0), (1, 4)]
    evaluations = campaign.models.evaluations
    _ = campaign.twin
    assert campaign.models.evaluations == evaluations  # the best so far, nothing more was learnt


def test_progress_says_where_the_campaign_is(monkeypatch, new_campaign, pendulum):
    monkeypatch.setattr("twinloop.campaign.coevolution.search.CHUNK_SECONDS", 0.0)
    seen = []
    campaign = new_campaign(progress=seen.append).run(pendulum, 2)
    phases = [p.phase for p in seen]
    assert phases == ["experiment"] + ["models"] * 8 + ["tests"] * 4 + ["experiment"]
    assert seen[8].generation == seen[8].generations == 8
    assert seen[8].closed_loop == campaign.history[1].closed_loop
    assert [p.experiments for p in seen] == [0] + [1] * 13
    assert seen[1].tests == (0,)


# End to end


def test_a_pendulum_is_learnt_and_lifted(new_campaign, pendulum):
    options = {"model_population": 60, "model_generations": 80, "test_population": 20, "form": "increment"}
    campaign = new_campaign(duration=2.0, options=options).run(pendulum, experiments=3)
    twin = campaign.twin
    assert campaign.history[-1].closed_loop[0] < campaign.history[0].closed_loop[0]
    assert min(row.normalised for row in twin.errors) < 1.0
    assert "angle[k+1]" in twin.equations()
    assert campaign.best_test.measured <= campaign.experiments[0].final_distance
    assert "closed loop" in str(twin.errors)


def test_the_quadrotor_goes_through_the_front_page(tiny):
    system = tl.systems.Quadrotor(noise=1e-3)
    campaign = tl.Campaign(
        system.signals,
        controller=system.controller,
        initial_state=np.zeros(6),
        target_state=np.deg2rad([-30, 30, -70, 0, 0, 0]),
        duration=2.0,
        preset="paper",
        seed=0,
        options=tiny,
    )
    first = campaign.test(system.default_gains)
    campaign.tell(first, system.run(first))
    test = campaign.ask()
    campaign.tell(test, system.run(test))
    assert len(campaign.twin.errors) == 2
    assert set(campaign.controller.parameters) == set(system.default_gains)
    assert campaign.twin.simulate(test).states.shape[1] == 6
    assert test.steps == 100


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tradeoff", ["raw", "normalised"])
def test_every_form_and_trade_off_makes_a_whole_campaign(new_campaign, pendulum, form, tradeoff):
    campaign = new_campaign(options={"form": form, "tradeoff": tradeoff}).run(pendulum, 2)
    assert campaign.twin.model.form == form


def test_settings_reach_the_engine(new_campaign, pendulum):
    options = {"pages": 2, "page_length": 3, "operations": ["+", "tanh"], "spare_registers": 1}
    campaign = new_campaign(options=options).run(pendulum, 1)
    program = campaign.models.population[0]
    assert program.page_lengths == [3, 3] and program.registers == 3 + 2 + 1
    names = {name for p in campaign.models.population for name, *_ in p.instructions}
    assert names == {"+", "tanh"}


def test_the_preset_paper_is_table_1(new_campaign):
    from twinloop.campaign.presets import options_of

    paper = options_of("paper")
    assert (paper.model_generations, paper.model_population) == (15_000, 250)
    assert (paper.generations_of_tests, paper.test_population) == (500, 100)
    assert options_of("paper", {"control_quality": True}).generations_of_tests == 750
    assert (paper.pages, paper.page_length, paper.operations) == (5, 10, ("+", "-", "*", "/"))
    assert (paper.mutation_share, paper.crossover_share, paper.reproduction_share) == (0.6, 0.3, 0.1)
    assert (paper.elite_share, paper.ranking_pressure) == (0.1, 1.8)
    assert (paper.archive_cap, paper.committee_size, paper.tradeoff) == (10_000, 100, "raw")
    assert (paper.mutants, paper.mutant_step, paper.test_mutation_step) == (10, 0.05, 0.1)
    assert (paper.distance_cap, paper.divergence_factor, paper.form) == (3.0, 10.0, "absolute")
    assert (paper.constant_low, paper.constant_high, paper.constant_step) == (1e-3, 10.0, 0.1)
    assert (paper.mutation_rate, paper.aligned_pages, paper.constant_share) == (1 / 50, 0.5, 0.5)
    assert (paper.spare_registers, paper.writable_inputs, paper.control_quality) == (4, True, False)


def test_the_named_trade_off_chooses_the_best_model(new_campaign, pendulum):
    differ = 0
    for seed in range(8):
        for tradeoff in ("raw", "normalised"):
            campaign = new_campaign(seed=seed, options={"tradeoff": tradeoff}).run(pendulum, 1)
            rows = campaign.models.archive_objectives
            assert campaign.models.best == pareto.best_tradeoff(rows, tradeoff == "normalised")
            differ += pareto.best_tradeoff(rows) != pareto.best_tradeoff(rows, True)
    assert differ > 0  # or the test would say nothing


def test_an_excitation_is_flown_learnt_and_replayed(new_campaign, pendulum):
    campaign = new_campaign()
    excitation = 0.3 * np.random.default_rng(0).normal(size=(20, 1))
    test, plain = campaign.test(GAINS, excitation=excitation), campaign.test(GAINS)
    assert test.excitation is not None and plain.excitation is None
    assert same_bits(test.excitation, excitation)
    run = pendulum.run(test)
    assert not same_bits(run.commands, pendulum.run(plain).commands)
    controller = test.controller()
    by_hand = [controller.command(state, test.target_state) for state in run.states[:-1]]
    assert same_bits(by_hand, run.commands)
    campaign.tell(test, run)
    replayed = campaign.twin.simulate(test)
    error = np.mean((replayed.states[1:] - run.states[1:]) ** 2)
    assert campaign.twin.errors[0].closed_loop == pytest.approx(error, rel=1e-9)
    assert campaign.best_test.number == test.number and campaign.best_test.excitation is None
    near = [0.9, 0.0]
    assert not same_bits(*(c.command(near, [1.0, 0.0]) for c in (campaign.controller, test.controller())))


def test_a_test_with_another_excitation_is_another_test(new_campaign, pendulum):
    campaign = new_campaign()
    test = campaign.test(GAINS, excitation=np.zeros((20, 1)))
    for other in (test.quiet(), dataclasses.replace(test, excitation=np.ones((20, 1)))):
        assert not test.same_as(other) and not other.same_as(test)
        with pytest.raises(tl.InvalidInput, match="as it was made"):
            campaign.tell(other, pendulum.run(other))
    assert test.same_as(dataclasses.replace(test))

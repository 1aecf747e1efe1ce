"""The exam: its measures against slow ones, its baselines against formulas, its memory, its tables."""

import dataclasses
import json
import math
import sqlite3

import click
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from command import invoke
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.faces.cli import main
from twinloop.law.parsing import program_of
from twinloop.law.twin import Twin
from twinloop_exam import bars, campaigns, held_out, kinds, least_squares, measures, operon, quality, study
from twinloop_exam.integrals import regression
from twinloop_exam.kinds import Campaigner, Fitter, Flyer, Optimum
from twinloop_exam.learners import LEARNERS, for_smoke, key
from twinloop_exam.library import model_inputs, monomials, variables_of
from twinloop_exam.page import as_page
from twinloop_exam.plan import Scope, planned
from twinloop_exam.results import Results, spread
from twinloop_exam.store import Address, Row, Store
from twinloop_exam.systems import Subject, subject
from twinloop_exam.tables import as_markdown, render, tables
from twinloop_exam.tuning import score, tuned, tuned_as_values, variants

PAPER = for_smoke(LEARNERS["paper"])
RANDOM = LEARNERS["random-gains"]


@pytest.fixture(scope="module")
def rig():
    return subject("quadrotor-0")


@pytest.fixture(scope="module")
def judge(rig):
    return held_out.fly(rig)


@pytest.fixture(scope="module")
def excited(rig):
    """Noise-free runs under commands that jump about hover, with the true coefficients of the library."""
    system = rig.true_rig
    stream = np.random.default_rng(3)
    runs = []
    for _ in range(6):
        commands = system.hover_speed * (1.0 + 0.1 * stream.standard_normal((60, 4)))
        states = [np.array([0.1, -0.2, 0.3, 1.0, -1.0, 0.5]) * stream.standard_normal(6)]
        for command in commands:
            states.append(system.dynamics.step(states[-1][None], command[None])[0])
        runs.append(tl.Trajectory(0.02 * np.arange(61), np.array(states), commands))
    library = monomials(variables_of("rates", rig.signals))
    x, u = stream.standard_normal((400, 6)), 300.0 * stream.random((400, 4))
    slopes = np.array([system.dynamics.derivative(a, b) for a, b in zip(x, u, strict=True)])
    features = library.values(model_inputs(x, u, rig.signals))
    true = np.linalg.lstsq(features, slopes[:, list(rig.signals.driven)], rcond=None)[0]
    return runs, library, true


def some_model(rig, gain):
    """Accelerations that are a share of the command's deviation from hover: rough dynamics."""
    coefficients = np.zeros((3, 3))
    coefficients[1] = gain
    coefficients[2] = -gain
    library = dataclasses.replace(monomials([]), terms=((), (6,), (7,)))
    return library.model(coefficients, rig.signals)


# Measures


def test_the_held_out_controllers_are_the_same_whenever_they_are_asked_for(rig):
    genes = held_out.controllers(rig)
    assert genes.shape == (100, 9)
    assert genes.tobytes() == held_out.controllers(subject("quadrotor")).tobytes()
    low = [gain.low for gain in rig.family.gains]
    high = [gain.high for gain in rig.family.gains]
    assert (genes >= low).all() and (genes <= high).all()
    assert genes[0, 0] == pytest.approx(
        0.2441467, abs=1e-6
    )  # another seed, or another stream, is another exam
    assert len({row.tobytes() for row in genes}) == 100


def test_held_out_errors_are_those_of_a_loop_written_out(rig, judge):
    model = some_model(rig, 3.0)
    found = judge.errors(Twin(model, rig.signals).simulate)
    for i in (0, 17, 99):
        test, truth = judge.tests[i], judge.states[i]
        controller = test.controller()
        x, squares, frozen = truth[0], 0.0, 0.0
        for k in range(test.steps):
            command = controller.command(x, test.target_state)
            x = model.step(x[None], command[None])[0]
            for state in range(6):
                squares += (x[state] - truth[k + 1, state]) ** 2
                frozen += (truth[k + 1, state] - truth[0, state]) ** 2
        assert found[i] == pytest.approx(squares / frozen, rel=1e-9)


def test_held_out_errors_are_the_engines_closed_loop_errors_over_the_frozen_ones(rig, judge):
    model = some_model(rig, 1.0)
    runs = [
        tl.Trajectory(0.02 * np.arange(101), states, np.zeros((100, 4)) + 200.0) for states in judge.states
    ]
    selected = tl.objectives.selected_tests(judge.tests, runs)
    frozen = np.array([tl.objectives.frozen_error(run) for run in runs])
    np.testing.assert_allclose(
        judge.errors(Twin(model, rig.signals).simulate),
        tl.objectives.closed_loop([model], selected)[0] / frozen,
        rtol=1e-9,
    )


def test_the_truth_has_no_error_and_what_never_moves_has_1(rig, judge):
    assert (judge.errors(lambda test: rig.true_rig.run(test)) == 0.0).all()

    def frozen(test):
        states = np.tile(test.initial_state, (test.steps + 1, 1))
        return tl.Trajectory(0.02 * np.arange(test.steps + 1), states, np.zeros((test.steps, 4)))

    np.testing.assert_allclose(judge.errors(frozen), 1.0)


def test_a_twin_that_diverges_has_an_infinite_error_however_long_it_lasts(rig, judge):
    def cut(steps):
        return lambda test: tl.Trajectory(
            0.02 * np.arange(steps + 1), np.zeros((steps + 1, 6)), np.ones((steps, 4))
        )

    assert np.isinf(judge.errors(cut(1))).all() and np.isinf(judge.errors(cut(99))).all()
    assert np.isfinite(judge.errors(cut(100))).all()


@given(
    st.lists(st.one_of(st.floats(0.0, 1e9), st.just(math.inf)), min_size=1, max_size=120),
    st.sampled_from([0.0, 0.25, 0.5, 0.9, 1.0]),
)
def test_quantiles_are_numpys_where_they_lie_between_finite_numbers_and_else_infinite(values, share):
    (found,) = measures.quantiles(values, [share])
    ranks = sorted(values)
    place = (len(ranks) - 1) * share
    if math.isinf(ranks[math.ceil(place)]):
        assert math.isinf(found)
    else:
        low, high = ranks[math.floor(place)], ranks[math.ceil(place)]
        assert found == pytest.approx(low + (place - math.floor(place)) * (high - low))
    if all(map(math.isfinite, values)):
        assert found == np.quantile(values, share)


@pytest.mark.parametrize("diverged", [0, 9, 10, 49, 50, 100])
def test_a_store_gives_back_infinite_errors_and_reads_those_of_earlier_versions(store, diverged):
    """Earlier versions had 1e6 to 2e6 for a run that diverged, and interpolated between it and a finite error."""
    errors = np.concatenate([np.linspace(0.1, 0.5, 100 - diverged), np.full(diverged, math.inf)])
    median, tail = measures.quantiles(errors, [0.5, 0.9])
    before = np.quantile(np.where(np.isinf(errors), 1.7e6, errors), [0.5, 0.9]).tolist()
    for seed, (middle, upper) in enumerate([(median, tail), before]):
        values = {"error_median": middle, "error_p90": upper, "diverged": float(diverged), "terms": 3.0}
        store.write(Row(Address("quadrotor", "ours", 20 + seed, "x"), 0, values, 1.0))
    now, earlier = store.rows("quadrotor", "ours", "x")
    assert now.measures == earlier.measures
    assert (now.measures["error_median"], now.measures["error_p90"]) == (median, tail)
    assert math.isinf(now.measures["error_p90"]) == (diverged >= 10)
    assert math.isinf(now.measures["error_median"]) == (diverged >= 50)


def test_tables_say_that_a_twin_diverges_and_on_how_many_of_the_controllers(store):
    ours = Campaigner("ours", "paper")
    for seed, lost in ((10, 20.0), (11, 40.0), (12, 70.0)):
        for k, diverged in ((0, lost), (1, 0.0)):
            values = {"error_median": 0.5, "error_p90": 0.7, "diverged": diverged}
            store.write(Row(Address("quadrotor", "ours", seed, key(ours)), k, values, 1.0))
    results = Results(store, ["quadrotor"], [ours], ours)
    (row,) = tables(results)[0].rows
    assert row == ["ours", "0.5 / diverges [0.5, diverges] (3)", "0.5 / 0.7 [0.5, 0.5] (3)", "40, 0"]
    cell = json.loads(render(results, "json"))["cells"][0]
    assert cell["error_p90"]["median"] is None and cell["diverged"]["median"] == 40.0
    text, met = bars.held_out("quadrotor", 0, 1.0, 1.0).judge(results)
    assert text == "0.5 / diverges (3 seeds)" and not met
    assert bars.no_forgetting("quadrotor").judge(results) is None


def test_held_out_runs_come_back_from_a_store_with_the_same_bits(rig, judge, tmp_path):
    store = Store(tmp_path / "exam.db")
    for kept in (store.held_out(rig), store.held_out(rig)):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(kept.states, judge.states, strict=True))
        assert kept.tests[5].genes.tobytes() == judge.tests[5].genes.tobytes()


def test_qualities_are_the_distance_at_the_end_and_the_integrated_error_of_angles(rig):
    test = rig.test(held_out.controllers(rig)[0])
    states = np.random.default_rng(0).standard_normal((101, 6))
    total = 0.0
    for k in range(1, 101):
        for angle in range(3):
            total += 0.02 * abs(states[k, angle] - test.target_state[angle])
    assert quality.of_states("iae", states, test) == pytest.approx(total)
    distance = math.sqrt(sum((states[-1] - test.target_state) ** 2))
    assert quality.of_states("final_distance", states, test) == pytest.approx(distance)
    assert quality.of_nothing("iae", test) == pytest.approx(math.radians(130) * 2.0)
    assert quality.of_states("iae", states[:50], test) == 10.0 * quality.of_nothing("iae", test)
    with pytest.raises(tl.InvalidInput, match="iae"):
        quality.of_states("iea", states, test)


def test_the_true_quality_is_the_mean_over_runs_with_noise():
    noisy = subject("quadrotor-noisy")
    genes = noisy.family.genes(noisy.true_rig.default_gains)
    system = tl.systems.Quadrotor(noise=1e-2, seed=7)
    distances = []
    for _ in range(5):
        run = system.run(noisy.test(genes))
        distances.append(np.linalg.norm(run.true_states[-1] - noisy.test(genes).target_state))
    assert noisy.true_quality(genes, runs=5, seed=7) == pytest.approx(np.mean(distances))


def test_an_envelope_is_judged_on_true_states(rig):
    def flown(measured, true=None, ended="completed"):
        states = np.zeros((4, 6))
        states[2, 0] = measured
        truth = None if true is None else np.where(states != 0.0, true, 0.0)
        return tl.Trajectory(0.02 * np.arange(4), states, np.ones((3, 4)), ended, "", truth)

    limit = math.radians(60.0)
    assert not measures.violated(flown(0.99 * limit), rig.signals)
    assert measures.violated(flown(-1.01 * limit), rig.signals)
    assert not measures.violated(flown(1.01 * limit, true=0.99 * limit), rig.signals)
    assert measures.violated(flown(0.99 * limit, true=1.01 * limit), rig.signals)
    assert measures.violated(flown(0.1, ended="diverged"), rig.signals)


def test_coverage_counts_samples_after_the_first():
    states = np.array([[9.0, 9.0], [0.0, 0.5], [1.0, 3.0]])
    band = np.array([np.full((3, 2), -1.0), np.full((3, 2), 1.0)])
    assert measures.coverage(band, states) == 0.75


@pytest.mark.parametrize(
    ("lines", "terms"),
    [
        (["r2 = r2 + 0.0"], 0),
        (["r2 = r0 * 3.0"], 1),
        (["r2 = r2 + r0", "r2 = r2 + r1"], 2),
        (["r4 = r0 * r1", "r4 = r4 + r0", "r2 = r4 * r1", "r3 = r4 * 2.0"], 3),
        (["r4 = r0 - r1", "r4 = r4 - r4", "r2 = r0 * 1.0"], 1),
        (["r2 = cos(r4)"], 1),
    ],
)
def test_terms_are_outputs_and_sums_once_each(lines, terms):
    text = "\n".join(["program inputs=2 outputs=2 registers=5", "page 1", *lines])
    assert measures.number_of_terms(_core.Program.parse(text)) == terms


def test_gains_go_to_the_unit_cube_and_back():
    signals = tl.Signals([tl.State("angle", "rad", 1.0)], [tl.Command("torque", "N m", (-1.0, 1.0))], 0.1)
    box = {"angle.kp": (0.01, 100.0, "log"), "angle.ki": (-2.0, 4.0), "angle.kd": (0.0, 1.0)}
    family = tl.controllers.PID(axes=[("angle", None)], gains=box).bind(signals)
    np.testing.assert_allclose(family.from_unit([0.5, 0.5, 0.0]), [1.0, 1.0, 0.0])
    genes = np.array([3.0, -1.0, 0.25])
    np.testing.assert_allclose(family.from_unit(family.to_unit(genes)), genes)


# Fits


@pytest.mark.parametrize(("form", "tolerance"), [("increment", 0.01), ("integral", 0.01)])
def test_least_squares_finds_the_quadrotors_coefficients(excited, rig, form, tolerance):
    runs, library, true = excited
    assert len(library.terms) == 36
    problems = regression(form, runs, rig.signals, library)
    found = np.stack([least_squares.ridge_fit(p.features, p.target, 1e-14) for p in problems], axis=1)
    large = np.abs(true) > 1e-2 * np.abs(true).max(axis=0)
    np.testing.assert_allclose(found[large], true[large], rtol=tolerance)
    assert np.abs(found - true)[~large].max() < 1e-2 * np.abs(true).max()


@pytest.mark.parametrize("name", ["least-squares", "least-squares-integral"])
def test_a_least_squares_twin_follows_the_quadrotor(excited, rig, judge, name):
    model = LEARNERS[name].fit(excited[0], rig.signals, 0)
    errors = judge.errors(Twin(model, rig.signals).simulate)
    assert np.median(errors) < 1e-3


def test_the_integral_form_does_not_care_where_a_run_starts(excited, rig):
    runs, library, _ = excited
    shift = np.array([0.5, -1.0, 2.0, 0.0, 0.0, 0.0])
    moved = [dataclasses.replace(run, states=run.states + shift) for run in runs]
    for a, b in zip(
        regression("integral", runs, rig.signals, library),
        regression("integral", moved, rig.signals, library),
        strict=True,
    ):
        np.testing.assert_allclose(a.features.T @ a.target, b.features.T @ b.target, rtol=1e-4, atol=1e-9)


def test_a_library_becomes_a_program_that_computes_it(rig):
    library = monomials(variables_of("all", rig.signals), degree=3)
    stream = np.random.default_rng(1)
    coefficients = stream.standard_normal((len(library.terms), 3))
    coefficients[stream.random(coefficients.shape) < 0.3] = 0.0
    inputs = stream.standard_normal((50, 10))
    model = library.model(coefficients, rig.signals)
    expected = library.values(inputs) @ coefficients
    np.testing.assert_allclose(model.program.run(inputs), expected, rtol=1e-9, atol=1e-9)
    nothing = library.model(np.zeros((len(library.terms), 3)), rig.signals)
    assert (nothing.program.run(inputs) == 0.0).all()


def test_a_formula_becomes_a_program_that_computes_it():
    formulas = [
        "((-2.5) * (a - 3)) + ((a * b) ^ 2) / (1e-1 + b * b)",
        "-a + sqrt(abs(b)) * sin(a) - cos(2) + 7",
        "a",
        "1.25",
    ]
    inputs = np.random.default_rng(2).standard_normal((40, 3))
    a, b = inputs[:, 0], inputs[:, 2]
    expected = [
        -2.5 * (a - 3) + (a * b) ** 2 / (0.1 + b * b),
        -a + np.sqrt(np.abs(b)) * np.sin(a) - np.cos(2) + 7,
        a,
        np.full(40, 1.25),
    ]
    found = program_of(formulas, {"a": 0, "b": 2}, 3).run(inputs)
    np.testing.assert_allclose(found, np.stack(expected, axis=1), rtol=1e-12)


@pytest.mark.parametrize("formula", ["a + c", "a ** 0.5", "a if b else 1", "log(a)", "a +"])
def test_a_formula_that_no_program_can_compute_is_refused(formula):
    with pytest.raises(tl.InvalidInput, match="expected"):
        program_of([formula], {"a": 0, "b": 1}, 2)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("members", [0, 5])
def test_a_pysindy_model_becomes_a_program_that_predicts_the_same(excited, rig, members):
    pytest.importorskip("pysindy", reason="optional: pip install 'twinloop[exam]'")
    from twinloop_exam.sindy import own_form

    settings = {"form": "derivative", "threshold": 0.1, "alpha": 1e-6, "ensemble": members}
    variables = variables_of("rates", rig.signals)
    model, library, coefficients = own_form(excited[0], rig.signals, variables, settings, 0)
    x, u = np.random.default_rng(5).standard_normal((2, 30, 4))
    inputs = np.hstack([np.zeros((30, 3)), x[:, :3], u])
    expected = np.asarray(model.predict(x[:, :3], u=u))
    found = library.model(coefficients, rig.signals).program.run(inputs)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.filterwarnings("default")
def test_pysindys_optimiser_on_integrals_finds_the_quadrotor(excited, rig, judge):
    pytest.importorskip("pysindy", reason="optional: pip install 'twinloop[exam]'")
    who = LEARNERS["sindy-stlsq-integral"]
    who = dataclasses.replace(who, settings={**who.settings, "threshold": 1e-3, "alpha": 1e-9})
    errors = judge.errors(Twin(who.fit(excited[0], rig.signals, 0), rig.signals).simulate)
    assert np.median(errors) < 1e-3


@pytest.mark.filterwarnings("default")
def test_operons_samples_are_means_over_windows_of_inputs_and_slopes(rig, excited):
    runs, window = excited[0][:2], 4
    inputs, slopes = operon.samples(runs, rig.signals, [0, 3, 7], window)
    assert inputs.shape == (2 * 57, 3) and slopes.shape == (2 * 57, 3)
    states, commands = runs[1].states, runs[1].commands
    row, rates = 57 + 10, [3, 4, 5]
    rise = (states[10 + window, rates] - states[10, rates]) / (window * rig.signals.dt)
    np.testing.assert_allclose(slopes[row], rise, rtol=1e-12)
    middles = 0.5 * (states[10 : 10 + window] + states[11 : 11 + window])
    scale = rig.signals.commands[1].size
    expected = [middles[:, 0].mean(), middles[:, 3].mean(), commands[10 : 10 + window, 1].mean() / scale]
    np.testing.assert_allclose(inputs[row], expected, rtol=1e-12)


def test_a_pyoperon_formula_becomes_a_program_that_predicts_the_same():
    pytest.importorskip("pyoperon", reason="optional: pip install 'twinloop[exam]'")
    from twinloop_exam.operon import formula, search

    inputs = np.random.default_rng(4).standard_normal((200, 3))
    target = 1.5 * inputs[:, 0] * inputs[:, 1] - 0.7 * inputs[:, 2] ** 2
    found = search(inputs, target, {"length": 30, "evaluations": 5000}, 1)
    names = {f"X{i + 1}": i for i in range(3)}
    values = program_of([formula(found)], names, 3).run(inputs)[:, 0]
    np.testing.assert_allclose(values, found.predict(inputs), rtol=1e-3, atol=1e-4)  # it predicts in float32


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    ("name", "package"), [("gp-bo", "bayes_opt"), ("cma-es", "cmaes"), ("optuna-tpe", "optuna")]
)
def test_an_optimiser_begins_with_the_first_controller_and_keeps_the_best_it_measured(name, package):
    pytest.importorskip(package, reason="optional: pip install 'twinloop[exam]'")
    from twinloop_exam.tuners import tune

    system = subject("quadrotor-0")  # without noise, what was measured is true
    rows = tune(LEARNERS[name], system, seed=3, flights=6)
    assert [k for k, *_ in rows] == list(range(6))
    first = system.true_quality(system.family.genes(system.true_rig.default_gains))
    assert rows[0][1]["quality"] == rows[0][1]["flown_quality"] == pytest.approx(first)
    flown = [row[1]["flown_quality"] for row in rows]
    assert [row[1]["quality"] for row in rows] == pytest.approx(np.minimum.accumulate(flown))
    assert len(set(flown)) > 4


# Memory


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "exam.db")


def a_scope(learners=(PAPER,), **changes):
    return Scope(["quadrotor-0"], list(learners), PAPER, **{"seeds": [0], "experiments": 2, **changes})


def test_what_is_measured_is_not_measured_again(store):
    least = Fitter("least-squares", "least_squares", LEARNERS["least-squares"].settings)
    scope = a_scope([least, PAPER])
    jobs = planned(scope, store)
    assert [job.who.name for job in jobs] == ["paper", "least-squares"]  # flights before those who need them
    assert study.work_off(store.path, jobs) == 0
    assert planned(scope, store) == []
    more = planned(dataclasses.replace(scope, seeds=[0, 1]), store)
    assert [job.address.seed for job in more] == [1, 1]
    changed = dataclasses.replace(least, settings={**least.settings, "ridge": 0.5})
    assert [job.ks for job in planned(a_scope([changed]), store)] == [(0, 1, 2)]


def test_a_campaign_that_was_killed_is_taken_up_with_the_same_bits(store, monkeypatch):
    [job] = planned(a_scope(), store)
    whole = campaigns.campaign

    def killed(*arguments):
        for number, row in enumerate(whole(*arguments)):
            if number == 1:
                raise KeyboardInterrupt
            yield row

    monkeypatch.setattr(campaigns, "campaign", killed)
    with pytest.raises(KeyboardInterrupt):
        study.work(store.path, job)
    monkeypatch.undo()
    kept = store.rows("quadrotor-0", "paper", job.address.settings)
    assert [row.k for row in kept] == [0]
    [rest] = planned(a_scope(), store)
    assert rest.ks == (1, 2)
    assert study.work(store.path, rest) is None
    rows = store.rows("quadrotor-0", "paper", job.address.settings)
    assert [row.k for row in rows] == [0, 1, 2] and rows[0] == kept[0]
    other = Store(store.path.with_name("other.db"))
    study.work(other.path, job)
    for row, again in zip(rows, other.rows("quadrotor-0", "paper", job.address.settings), strict=True):
        same = {name: value for name, value in row.measures.items() if "seconds" not in name}
        assert same == {name: value for name, value in again.measures.items() if "seconds" not in name}


def test_a_campaigns_flights_are_kept_as_they_were_flown(store):
    study.work(store.path, planned(a_scope(), store)[0])
    address = Address("quadrotor-0", "paper", 0, key(PAPER))
    flights = store.flights(address, 2)
    first = subject("quadrotor-0")
    flown = first.rig(0).run(first.test(first.family.genes(first.true_rig.default_gains)))
    assert flights[0].states.tobytes() == flown.states.tobytes()
    assert flights[0].commands.tobytes() == flown.commands.tobytes()
    assert flights[0].ended == "completed" and len(flights) == 3
    with pytest.raises(tl.NotAvailable, match="found 3"):
        store.flights(address, 3)


def test_a_failure_is_counted_and_tried_again_only_when_asked(store, monkeypatch):
    def broken(*_):
        raise RuntimeError("no thrust")

    monkeypatch.setattr(campaigns, "campaign", broken)
    assert study.work_off(store.path, planned(a_scope(), store)) == 1
    monkeypatch.undo()
    assert planned(a_scope(), store) == []
    results = Results(store, ["quadrotor-0"], [PAPER], PAPER, [0])
    assert results.failures("quadrotor-0", "paper", 1) == 1
    assert "1 failed" in render(results, "text")
    assert len(planned(a_scope(retry=True), store)) == 1


def test_a_fit_without_flights_is_no_failure_and_waits_for_them(store):
    least = LEARNERS["least-squares"]
    jobs = planned(a_scope([least]), store)
    assert "run that learner first" in study.work(store.path, jobs[0])
    assert planned(a_scope([least]), store) == jobs


def test_a_cluster_measures_the_same_by_its_address_though_its_workers_see_no_file(store, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="needs the extra cluster")
    least = LEARNERS["least-squares"]
    scope = a_scope([PAPER, least], seeds=[0, 1], experiments=1)
    here = Store(store.path.with_name("here.db"))
    assert study.work_off(here.path, planned(scope, here)) == 0
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
    ) as cluster:
        # One seed first: the other is what is left to do.
        first = dataclasses.replace(scope, seeds=[0])
        assert study.work_off(store.path, planned(first, store), cluster.scheduler_address) == 0
        left = planned(scope, store)
        assert {job.address.seed for job in left} == {1}
        assert study.work_off(store.path, left, cluster.scheduler_address) == 0
    assert planned(scope, store) == []
    for who in (PAPER, least):
        found = [
            [
                (row.address.seed, row.k, {n: v for n, v in row.measures.items() if "seconds" not in n})
                for row in of.rows("quadrotor-0", who.name, key(who, PAPER))
            ]
            for of in (here, store)
        ]
        assert len(found[0]) == 4 and found[0] == found[1]
    address = Address("quadrotor-0", "paper", 1, key(PAPER))
    assert [f.states.tobytes() for f in store.flights(address, 1)] == [
        f.states.tobytes() for f in here.flights(address, 1)
    ]


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "notes.db"
    path.write_text("not a database, " * 100)
    with pytest.raises(tl.InvalidInput, match="choose another"):
        Store(path)


def test_a_file_of_the_version_before_is_gone_on_with(tmp_path):
    path = tmp_path / "exam.db"
    Store(path).close()
    with sqlite3.connect(path) as base:
        base.execute("DROP TABLE commits")
        base.execute("PRAGMA user_version = 1")
    base.close()
    kept = Store(path)
    assert kept.versions == []
    kept.close()


def test_a_database_of_somebody_else_is_refused_and_left_as_it_is(tmp_path):
    path = tmp_path / "bookmarks.db"
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE bookmarks (address TEXT)")
    base.close()
    before = path.read_bytes()
    with pytest.raises(tl.InvalidInput, match="'bookmarks'; choose another"):
        Store(path)
    assert path.read_bytes() == before


def test_settings_tell_learners_apart_and_costs_do_not():
    settings = [key(who, LEARNERS["paper"]) for who in LEARNERS.values()]
    assert len(set(settings)) == len(settings)
    paper, least = LEARNERS["paper"], LEARNERS["least-squares"]
    assert key(paper) == key(dataclasses.replace(paper, seconds=1.0, experiments=9))
    assert key(paper) != key(dataclasses.replace(paper, options={}))
    assert key(least, paper) != key(least, RANDOM)


# Tables


@pytest.fixture
def filled(store):
    """Three seeds of ours at three k, with numbers that are easy to follow."""
    ours = Campaigner("ours", "paper", {"model_generations": 7})
    best = Optimum("optimum")
    for seed in (10, 11, 12):
        for k in (0, 1, 2):
            values = {
                "error_median": 10.0 ** -(k + 3) * (seed - 9),
                "error_p90": 10.0 ** -(k + 2) * (seed - 9),
                "quality": 0.1 * (seed - 9),
                "flown_quality": 0.5 - 0.1 * k,
                "violated": float(seed == 12 and k == 2),
                "ask_seconds": 0.5 + k,
                "terms": 20.0 + k,
                "coverage": 0.9,
            }
            store.write(Row(Address("quadrotor", "ours", seed, key(ours)), k, values, 1.0))
    store.write(Row(Address("quadrotor", "ours", 13, key(ours)), 1, {}, 0.0, "it broke"))
    store.write(Row(Address("quadrotor", "optimum", 0, key(best)), 0, {"quality": 0.1}, 1.0))
    return Results(store, ["quadrotor"], [ours, best], ours)


def test_cells_are_medians_over_seeds_with_quartiles_and_failures(filled):
    shown = {table.title: table for table in tables(filled)}
    errors = shown["quadrotor: normalised error on held-out controllers"]
    assert list(errors.head) == ["after Υ0 +", "0", "1", "2", "of 100 diverge"]
    assert errors.rows[0][2] == "0.0002 / 0.002 [0.00015, 0.00025] (3, 1 failed)"
    controllers = shown["quadrotor: controller to fly"]
    assert controllers.rows[0][1] == "0.2 [0.15, 0.25] (3)"
    assert "Optimum (CMA-ES on the true system): 0.1." in controllers.notes[1]


def test_ablations_stand_beside_ours_on_the_same_seeds(store, filled):
    ablated = Campaigner("without-lags", "default", {"lags": False})
    for seed in (11, 12, 20):
        values = {"error_median": 1e-3, "error_p90": 1e-2, "quality": 0.3}
        store.write(Row(Address("quadrotor", "without-lags", seed, key(ablated)), 1, values, 1.0))
    ours = Campaigner("ours", "paper", {"model_generations": 7})
    shown = {t.title: t for t in tables(Results(store, ["quadrotor"], [ours, ablated], ours))}
    rows = shown["quadrotor: ablations"].rows
    # Seeds 11 and 12: errors of 2e-4 and 3e-4.
    assert rows[0][1] == "0.00025 / 0.0025 [0.00023, 0.00028] (2)"
    assert rows[1][1] == "0.001 / 0.01 [0.001, 0.001] (2)"


def test_a_table_reads_as_markdown_and_as_json(filled):
    lines = as_markdown(tables(filled)[0]).splitlines()
    assert lines[2].startswith("| after Υ0 + | 0 | 1") and lines[3] == "| --- | --- | --- | --- | --- |"
    cells = json.loads(render(filled, "json"))["cells"]
    cell = next(cell for cell in cells if cell["learner"] == "ours" and cell["k"] == 1)
    assert cell["failed"] == 1 and cell["error_median"]["seeds"] == 3
    assert cell["error_median"]["median"] == pytest.approx(2e-4)


def test_a_page_says_which_versions_have_measured_its_rows(filled, store):
    assert store.versions == []
    store.measured_by("0.1.0 at aaaaaaa")
    store.measured_by("0.1.0 at aaaaaaa")
    page = as_page(filled, store.versions)
    assert "All rows are of one version of the code: 0.1.0 at aaaaaaa." in page
    assert page.index("## Bars") < page.index("## quadrotor") < page.index("### Controller to fly")
    assert page.count("| ours | 0.2 [0.15, 0.25] (3)") == 1
    store.measured_by("0.1.0 at bbbbbbb")
    assert "**Rows are of 2 versions of the code**: 0.1.0 at aaaaaaa, 0.1.0 at b" in as_page(
        filled, store.versions
    )


def test_bars_say_what_was_measured_and_whether_it_is_enough(filled):
    def verdict(bar):
        return bar.judge(filled)

    assert verdict(bars.held_out("quadrotor", 2, 2.1e-5, 1e-3)) == ("2e-05 / 0.0002 (3 seeds)", True)
    assert verdict(bars.held_out("quadrotor", 2, 1e-5, 1e-3))[1] is False
    assert verdict(bars.held_out("quadrotor", 9, 1.0)) is None
    assert verdict(bars.near_optimum("quadrotor", 1, 1.3, 0.9)) == ("33 % of 3 seeds, median 2 ×", False)
    assert verdict(bars.flown_near_optimum("quadrotor", 2, 3.1, 3.1)) == (
        "3 ×, worst seed 3 × (3 seeds)",
        True,
    )
    assert verdict(bars.safe("quadrotor")) == ("1 of 9", False)
    assert verdict(bars.quick("quadrotor")) == ("2.5 s", True)
    assert verdict(bars.calibrated("quadrotor")) == ("90 % (9 flights)", True)
    assert verdict(bars.better_than_first("quadrotor")) == ("0 of 6 worse", True)
    assert verdict(bars.growth("quadrotor")) is None


def test_forgetting_is_measured_against_the_best_so_far(store):
    ours = Campaigner("ours", "paper")
    for k, error in ((2, 1e-5), (3, 4e-6), (4, 3e-5)):
        address = Address("quadrotor", "ours", 10, key(ours))
        store.write(Row(address, k, {"error_median": error}, 1.0))
    text, met = bars.no_forgetting("quadrotor").judge(Results(store, ["quadrotor"], [ours], ours))
    assert text.startswith("3 of the bar, worst seed 3e-05") and met is False


def test_seeds_for_tuning_are_not_reported(store):
    for seed in (9, 10):
        store.write(Row(Address("quadrotor", "paper", seed, key(PAPER)), 0, {"quality": float(seed)}, 1.0))
    assert Results(store, ["quadrotor"], [PAPER], PAPER).values("quadrotor", "paper", "quality", 0) == {
        10: 10.0
    }
    assert spread([]) is None


def test_tuning_ranks_a_grid(store):
    who = Fitter("least-squares", "least_squares", {"ridge": 1.0}, grid={"ridge": (1.0, 2.0)})
    scores = []
    for variant, error in zip(variants(who), (1e-2, 1e-4), strict=True):
        for k in (2, 4):
            address = Address("quadrotor", who.name, 0, key(variant, RANDOM))
            store.write(Row(address, k, {"error_median": error, "error_p90": 100 * error}, 1.0))
        results = Results(store, ["quadrotor"], [variant], RANDOM, [0])
        scores.append((variant, score(results, "quadrotor", variant)))
    assert [found for _, found in scores] == pytest.approx([1e-1, 1e-3])
    assert [row[0] for row in tuned(who, scores).rows] == ["2.0", "1.0"]
    values = [(value["settings"], value["in_the_code"]) for value in tuned_as_values(who, scores)]
    assert values == [({"ridge": 2.0}, False), ({"ridge": 1.0}, True)]
    assert score(Results(store, ["quadrotor"], [who], RANDOM, [5]), "quadrotor", who) == math.inf


# The command


def bench(*arguments, code=0):
    done = CliRunner().invoke(main, ["bench", "power", *arguments])
    assert done.exit_code == code, done.output
    return done


@pytest.mark.filterwarnings("default")
def test_a_smoke_run_without_optional_packages_says_what_it_left_out(monkeypatch):
    monkeypatch.setattr(kinds.importlib.util, "find_spec", lambda package: None)
    done = bench("--smoke", "--systems", "quadrotor-0", "--seeds", "0")
    for package in ("pysindy", "pyoperon", "bayes_opt", "cmaes", "optuna"):
        assert f"the package {package!r} is not installed" in done.stderr
    assert "about" in done.stderr
    for words in ("quadrotor-0: normalised error on held-out controllers", "least-squares-integral", "Bars"):
        assert words in done.stdout


@pytest.fixture
def studies(monkeypatch):
    """Stand-ins for the studies: what each was called with, and the code with which each ends."""
    called, codes = [], {"power": 0, "zoo": 0}

    def stand_in(name):
        @click.pass_context
        def study(context, smoke, **_):
            called.append((name, smoke))
            context.exit(codes[name])

        return study

    for name in codes:
        monkeypatch.setattr(main.get_command(None, "bench").commands[name], "callback", stand_in(name))
    return called, codes


def test_a_smoke_run_of_bench_is_that_of_its_studies_in_turn(studies):
    called, codes = studies
    assert invoke("bench", "--smoke").exit_code == 0
    assert called == [("power", True), ("zoo", True)]
    codes["power"] = 1
    assert invoke("bench", "--smoke").exit_code == 1


def test_smoke_counts_before_the_name_of_a_study_too(studies):
    called, _ = studies
    assert [invoke("bench", *words).exit_code for words in (["--smoke", "zoo"], ["zoo"])] == [0, 0]
    assert called == [("zoo", True), ("zoo", False)]


def test_bench_alone_names_its_studies():
    done = invoke("bench")
    assert done.exit_code == 0 and done.stderr == ""
    assert "power" in done.stdout and "zoo" in done.stdout


def test_ctrl_c_keeps_what_was_measured_and_says_so(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(campaigns, "random_gains", interrupted)
    asked = ("--systems", "quadrotor-0", "--learners", "random-gains", "--seeds", "10")
    done = bench(*asked, "--store", str(tmp_path / "exam.db"), code=130)
    assert "Interrupted: what was measured is in exam.db" in done.stderr


def test_the_store_prints_its_tables_without_working(tmp_path):
    path = str(tmp_path / "exam.db")
    asked = ("--systems", "quadrotor-0", "--learners", "random-gains", "--seeds", "10:12", "--store", path)
    bench(*asked, "--experiments", "1")
    again = bench(*asked, "--experiments", "1")
    assert "0 jobs" in again.stderr
    shown = json.loads(bench(*asked, "--table", "json").stdout)
    assert [cell["violated"]["seeds"] for cell in shown["cells"]] == [2, 2]
    assert json.loads(bench(*asked, "--experiments", "1", "--json").stdout) == shown
    page = tmp_path / "results.md"
    assert bench(*asked, "--page", str(page)).stdout == ""
    assert json.loads(bench(*asked, "--page", str(page), "--json").stdout) == {"files": [str(page)]}
    assert f"one version of the code: {tl.__version__}" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--learners", "oars"], "ours"),
        (["--systems", "quadrotr"], "quadrotor"),
        (["--seeds", "5:5"], "10:35"),
        (["--seeds", "x"], "10:35"),
        (["--table", "html"], "markdown"),
        (["--cluster", "local:0"], "local:N"),
        (["--experiments", "-1"], "--experiments"),
        (["--table", "text", "--store", "nowhere.db"], "run the exam first"),
    ],
)
def test_misuse_is_told_in_a_sentence(arguments, words):
    assert words in bench(*arguments, code=2).stderr


def test_a_system_that_this_version_lacks_is_left_out_with_a_reason(monkeypatch):
    from twinloop_exam import systems

    def missing(*_):
        raise tl.NotAvailable("no such plant here.")

    odd = Subject("odd", "iae", missing, missing)
    monkeypatch.setitem(systems.SUBJECTS, "odd", odd)
    assert systems.why_missing("odd") == "no such plant here."
    assert systems.why_missing("quadrotor") is None
    with pytest.raises(tl.InvalidInput, match="quadrotor"):
        systems.why_missing("quadrotar")


def test_every_campaign_of_the_exam_has_options_that_there_are():
    campaigns = [who for who in LEARNERS.values() if isinstance(who, Campaigner)]
    assert len(campaigns) > 20
    for who in campaigns:
        options_of(who.preset, who.options)


def test_every_learner_says_whether_it_can_run():
    assert LEARNERS["paper"].why_missing() is None
    assert Flyer("random-gains").why_missing() is None
    assert "install" in Fitter("x", "least_squares", {}, package="no_such_package").why_missing()

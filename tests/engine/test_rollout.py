"""Roll-outs: one loop for search and real run, checked against a plain one in NumPy."""

import numpy as np
import pytest

from conftest import setting_of
from oracles import Pid, close_loop, final_distance, model_step, same_bits
from strategies import program_text
from twinloop import InvalidInput, _core, objectives
from twinloop.law.forms import DERIVATIVES as RATES
from twinloop.law.forms import FORMS

GROUPS = [1, 2, 5, 9, 33]
"""Numbers of runs that fill groups of lanes in every way."""
SCALES, DERIVATIVES, DT = [1.0, 4.0], [None, 0], 0.1
BOUNDS = [(-1.0, 1.0), (-3.0, 2.0)]
LIMITS = np.array([10.0, 20.0])
START, TARGET = np.array([0.3, -0.2]), np.array([0.8, 0.1])


def pid(genes):
    return Pid([(0, 1), (1, None)], genes, DT, [[1.0, 0.25], [0.5, -2.0]], [0.1, -0.2], 1.0, BOUNDS)


def drawn(count, seed=0):
    return np.random.default_rng(seed).uniform(0.0, 2.0, (count, 6))


def models(rig, form, count=3):
    """Random models, one that is sure to move and one that is sure to run away among them."""
    outputs = 1 if form in RATES else 2
    text = program_text(4, outputs, 4 + outputs, [[f"r{4 + k} = r{k} * 1.3" for k in range(outputs)]])
    programs = [_core.Program.parse(text), *_core.Grammar(4, outputs).random(11, count)]
    return [_core.Model(program, form, rig) for program in programs]


def expected_run(model, genes, steps, start=START, target=TARGET, **influences):
    def step(x, u):
        return model_step(model.program, model.form, x, u, SCALES, DERIVATIVES, DT)

    return close_loop(step, pid(genes), start, target, steps, LIMITS, **influences)


def agree(form, found, expected):
    if form == "acceleration":
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    else:
        assert same_bits(found, expected)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", GROUPS)
def test_a_roll_out_is_the_plain_loop(rig, rig_setting, form, count):
    task, genes = _core.Task(START, TARGET, 15), drawn(count)
    for model in models(rig, form):
        runs = _core.rollout(model, rig_setting, genes, task)
        assert runs.states.shape == (count, 16, 2) and runs.commands.shape == (count, 15, 2)
        for i in range(count):
            states, _, commands, lasted = expected_run(model, genes[i], 15)
            assert runs.lasted[i] == lasted
            agree(form, runs.states[i, : lasted + 1], states)
            agree(form, runs.commands[i, :lasted], commands)
            assert np.isnan(runs.states[i, lasted + 1 :]).all()
            assert np.isnan(runs.commands[i, lasted:]).all()


@pytest.mark.parametrize("count", [1, 5])
def test_the_controller_reads_the_noise_and_the_model_does_not(rig, rig_setting, count):
    noise = np.random.default_rng(3).normal(0.0, 0.1, (count, 13, 2))
    task, genes = _core.Task(START, TARGET, 12), drawn(count)
    model = models(rig, "increment")[1]
    runs = _core.rollout(model, rig_setting, genes, task, noise=noise)
    for i in range(count):
        states, readings, commands, lasted = expected_run(model, genes[i], 12, noise=noise[i])
        assert lasted == runs.lasted[i]
        assert same_bits(runs.states[i, : lasted + 1], states)
        assert same_bits(runs.measured[i, : lasted + 1], readings)
        assert same_bits(runs.commands[i, :lasted], commands)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", GROUPS)
def test_excitation_moves_the_commands_and_disturbance_the_true_state(rig, rig_setting, form, count):
    stream, steps = np.random.default_rng(4), 12
    shapes = {"noise": (steps + 1, 2), "excitation": (steps, 2), "disturbance": (steps, 2)}
    influences = {name: stream.normal(0.0, 0.3, (count, *shape)) for name, shape in shapes.items()}
    influences["excitation"] *= 5.0
    task, genes = _core.Task(START, TARGET, steps), drawn(count)
    for model in models(rig, form):
        runs = _core.rollout(model, rig_setting, genes, task, **influences)
        for i in range(count):
            alone = {name: values[i] for name, values in influences.items()}
            states, readings, commands, lasted = expected_run(model, genes[i], steps, **alone)
            assert lasted == runs.lasted[i]
            agree(form, runs.states[i, : lasted + 1], states)
            agree(form, runs.measured[i, : lasted + 1], readings)
            agree(form, runs.commands[i, :lasted], commands)


def test_an_excitation_is_clipped_to_the_bounds_of_the_commands(rig, rig_family):
    task, genes = _core.Task(START, TARGET, 4), drawn(1)
    excitation = np.array([[[9.0, -9.0], [-9.0, 9.0], [0.0, 0.0], [1e300, -1e300]]])
    model = models(rig, "increment")[1]
    far = setting_of(rig, rig_family, 1e6)
    runs = _core.rollout(model, far, genes, task, excitation=excitation)
    assert runs.commands[0, [0, 1, 3]].tolist() == [[1.0, -3.0], [-1.0, 2.0], [1.0, -3.0]]


@pytest.mark.parametrize("excitation", [None, 0.0])
def test_no_excitation_and_one_of_nothing_fly_alike(rig, rig_setting, excitation):
    task, genes, model = _core.Task(START, TARGET, 12), drawn(3), models(rig, "absolute")[1]
    values = None if excitation is None else np.full((3, 12, 2), excitation)
    runs = _core.rollout(model, rig_setting, genes, task, excitation=values)
    assert np.array_equal(runs.states, _core.rollout(model, rig_setting, genes, task).states)


def test_a_python_function_is_rolled_out_like_a_model(rig, rig_setting):
    model = models(rig, "increment")[1]
    task, genes = _core.Task(START, TARGET, 12), drawn(3)
    called = _core.rollout(
        lambda x, u: model.step(x[None], u[None])[0], rig_setting, genes, task
    )  # fmt: skip
    learnt = _core.rollout(model, rig_setting, genes, task)
    assert same_bits(called.states, learnt.states)
    assert same_bits(called.commands, learnt.commands)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", GROUPS)
def test_final_distances_are_those_of_the_plain_loop(rig, rig_setting, form, count):
    task, genes, several = _core.Task(START, TARGET, 10), drawn(count), models(rig, form)
    found = _core.final_distances(several, rig_setting, genes, task)
    assert found.shape == (len(several), count)
    for model, row in zip(several, found, strict=True):
        for i in range(count):
            states, _, _, lasted = expected_run(model, genes[i], 10)
            expected = final_distance(states[-1], TARGET) if lasted == 10 else np.inf
            assert row[i] == pytest.approx(expected, rel=1e-9)


def selected(rig_setting, count):
    """Tests of several lengths with recordings that no model made."""
    stream, tests, recorded = np.random.default_rng(5), _core.SelectedTests(rig_setting), []
    for i, genes in enumerate(drawn(count, seed=2)):
        steps = 4 + (7 * i) % 11
        states = stream.uniform(-1.0, 1.0, (steps + 1, 2))
        commands = stream.uniform(-1.0, 1.0, (steps, 2))
        target = stream.uniform(-1.0, 1.0, 2)
        tests = tests.with_test(genes, target, states, commands)
        recorded.append((genes, target, states, commands))
    return tests, recorded


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", GROUPS)
def test_the_open_loop_error_is_the_mean_square_one_step_ahead(rig, rig_setting, form, count):
    tests, recorded = selected(rig_setting, count)
    several = models(rig, form)
    found = _core.open_loop(several, tests)
    assert found.shape == (len(several), count)
    for model, row in zip(several, found, strict=True):
        for k, (_, _, states, commands) in enumerate(recorded):
            with np.errstate(all="ignore"):
                ahead = [
                    model_step(model.program, form, x, u, SCALES, DERIVATIVES, DT)
                    for x, u in zip(states, commands, strict=False)
                ]
                expected = np.mean((np.array(ahead) - states[1:]) ** 2)
            assert row[k] == pytest.approx(expected if np.isfinite(expected) else np.inf, rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", GROUPS)
def test_the_closed_loop_error_is_that_of_the_free_run_under_the_tests_controller(
    rig, rig_setting, form, count
):
    tests, recorded = selected(rig_setting, count)
    several = models(rig, form)
    found, lasting = _core.closed_loop(several, tests)
    for i, (model, row) in enumerate(zip(several, found, strict=True)):
        for k, (genes, target, states, commands) in enumerate(recorded):
            steps = len(commands)
            run, _, _, lasted = expected_run(model, genes, steps, states[0], target)
            if lasted == steps:
                expected = np.mean((run[1:] - states[1:]) ** 2)
            else:
                expected = np.inf
            assert row[k] == pytest.approx(expected, rel=1e-9) and lasting[i, k] == lasted


@pytest.mark.parametrize("count", GROUPS)
def test_the_closed_loop_of_an_excited_test_replays_its_excitation(rig, rig_setting, count):
    """Every second test carries one; some recordings are shorter than their test."""
    model, stream = models(rig, "acceleration")[1], np.random.default_rng(8)
    tests = _core.SelectedTests(rig_setting)
    for i, genes in enumerate(drawn(count)):
        steps, task = 12, _core.Task(START, TARGET, 12)
        excitation = stream.normal(0.0, 1.0, (1, steps, 2)) if i % 2 == 0 else None
        runs = _core.rollout(model, rig_setting, genes[None], task, excitation=excitation)
        kept = min(int(runs.lasted[0]), steps - i % 3)
        assert kept > 0
        added = None if excitation is None else excitation[0]
        tests = tests.with_test(genes, TARGET, runs.states[0, : kept + 1], runs.commands[0, :kept], added)
    assert (_core.closed_loop([model], tests)[0] == 0.0).all()
    others = models(rig, "acceleration", 6)
    assert (_core.closed_loop(others, tests)[0][[0, 2, 3]] != 0.0).any()


@pytest.mark.parametrize(("factor", "steps"), [(3.0, 2), (3.0, 20), (1.5, 8), (20.0, 5)])
def test_a_run_that_blows_up_has_no_error_but_a_time_that_it_lasted(rig, rig_setting, factor, steps):
    program = _core.Program.parse(program_text(4, 2, 6, [[f"r4 = r0 * {factor}", "r5 = r1 * 1.0"]]))
    model = _core.Model(program, "absolute", rig)
    size, lasted = 1.0, 0
    while lasted < steps and abs(size * factor) < 10.0:
        size, lasted = size * factor, lasted + 1
    states = np.zeros((steps + 1, 2))
    states[0] = [1.0, 0.0]
    tests = _core.SelectedTests(rig_setting).with_test(np.ones(6), TARGET, states, np.zeros((steps, 2)))
    found, lasting = (values[0, 0] for values in _core.closed_loop([model], tests))
    assert lasting == lasted and np.isinf(found) == (lasted < steps)
    assert objectives.closed_loop([model], tests)[0, 0] == found
    assert objectives.lasted([model], tests)[0, 0] == lasted
    runs = _core.rollout(model, rig_setting, np.ones((1, 6)), _core.Task([1.0, 0.0], TARGET, steps))
    assert runs.lasted[0] == lasted


def test_a_run_that_stops_being_finite_has_diverged(rig, rig_setting):
    text = program_text(4, 2, 6, [["r4 = exp(r0)", "r4 = r4 * 1e300", "r4 = r4 * 1e300", "r5 = r4 - r4"]])
    model = _core.Model(_core.Program.parse(text), "absolute", rig)
    task = _core.Task(START, TARGET, 5)
    assert _core.rollout(model, rig_setting, np.ones((1, 6)), task).lasted.tolist() == [0]
    assert np.isinf(_core.final_distances([model], rig_setting, np.ones((1, 6)), task)).all()


def test_the_limit_of_divergence_is_a_multiple_of_the_scale(rig, rig_family):
    program = _core.Program.parse(program_text(4, 2, 6, [["r4 = r0 * 2.0", "r5 = r1 * 1.0"]]))
    model, task = _core.Model(program, "absolute", rig), _core.Task([1.0, 0.0], TARGET, 9)
    lasted = [
        _core.rollout(model, setting_of(rig, rig_family, f), np.ones((1, 6)), task).lasted[0]
        for f in (2.0, 2.1, 8.0, 8.1, 1e6)
    ]
    assert lasted == [0, 1, 2, 3, 9]


def test_a_failing_step_function_passes_its_own_error_on(rig_setting):
    def fails(x, u):
        raise KeyError("the rig is on fire")

    with pytest.raises(KeyError, match="fire"):
        _core.rollout(fails, rig_setting, np.ones((1, 6)), _core.Task(START, TARGET, 5))
    with pytest.raises(InvalidInput, match=r"expected a next state of shape \(2,\)"):
        _core.rollout(lambda x, u: np.zeros(3), rig_setting, np.ones((1, 6)), _core.Task(START, TARGET, 5))


def test_arguments_of_another_shape_are_refused(rig, rig_setting):
    model, task = models(rig, "absolute")[0], _core.Task(START, TARGET, 5)
    with pytest.raises(InvalidInput, match="expected 6 columns"):
        _core.rollout(model, rig_setting, np.ones((1, 5)), task)
    with pytest.raises(InvalidInput, match="noise: expected shape"):
        _core.rollout(model, rig_setting, np.ones((1, 6)), task, noise=np.zeros((1, 5, 2)))
    for name in ("excitation", "disturbance"):
        with pytest.raises(InvalidInput, match=f"{name}: expected shape"):
            _core.rollout(model, rig_setting, np.ones((1, 6)), task, **{name: np.zeros((1, 6, 2))})
    with pytest.raises(InvalidInput, match="expected 2 states"):
        _core.rollout(model, rig_setting, np.ones((1, 6)), _core.Task([0.0], [1.0], 5))
    for wrong in ([0.0, np.nan], [0.0, np.inf]):
        with pytest.raises(InvalidInput, match="expected finite"):
            _core.Task(START, wrong, 5)
    with pytest.raises(InvalidInput, match="steps"):
        _core.Task(START, TARGET, 0)


@pytest.mark.parametrize("what", ["states", "commands", "parameters", "target"])
def test_a_recorded_test_that_does_not_fit_is_refused(rig, rig_setting, what):
    good = {
        "parameters": np.ones(6),
        "target": TARGET,
        "states": np.zeros((4, 2)),
        "commands": np.zeros((3, 2)),
    }
    tests = _core.SelectedTests(rig_setting)
    assert len(tests.with_test(**good)) == 1
    longer = {**good, what: np.concatenate([good[what], good[what]])}
    with pytest.raises(InvalidInput, match="expected"):
        tests.with_test(**longer)
    spoilt = good[what].copy()
    spoilt.flat[0] = np.nan
    with pytest.raises(InvalidInput, match="expected"):
        tests.with_test(**{**good, what: spoilt})
    assert len(tests) == 0

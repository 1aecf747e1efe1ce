"""Candidate flights: judged as a slow NumPy version judges the trajectories of plain roll-outs."""

import numpy as np
import pytest

import twinloop as tl
from conftest import setting_of
from oracles import same_bits
from strategies import program_text
from twinloop import _core, flights

STEPS, DT = 15, 0.1
COMMAND_SCALES = np.array([1.0, 4.0])
ENVELOPE = [(-0.5, 1.5), None]
GROUPS = [1, 3, 9, 33, 70]
KINDS = ["iae", "ise", "final_distance"]


@pytest.fixture(scope="module")
def committee(rig):
    """Models that follow their commands, each in its own way, and one that runs away."""
    pages = [
        [
            [
                f"r4 = r0 * {a}",
                f"r5 = r2 * {b}",
                "r4 = r4 + r5",
                f"r5 = r1 * {a}",
                f"r6 = r3 * {c}",
                "r5 = r5 + r6",
            ]
        ]
        for a, b, c in [(0.9, 0.1, 0.2), (0.8, 0.2, 0.1), (0.95, 0.15, 0.3), (1.3, 0.2, 0.2)]
    ]
    programs = [_core.Program.parse(program_text(4, 2, 7, page)) for page in pages]
    return [_core.Model(program, "absolute", rig) for program in programs]


class Drawn:
    """K random candidates."""

    def __init__(self, setting, count, excited=True, seed=0):
        stream = np.random.default_rng(seed)
        self.genes = stream.uniform(0.0, 2.0, (count, 6))
        self.initial, self.target = stream.uniform(-1.0, 1.0, (2, count, 2))
        self.excitation = stream.normal(0.0, 1.0, (count, STEPS, 2)) if excited else None
        self.flights = _core.Flights(
            setting, self.genes, self.initial, self.target, STEPS, excitation=self.excitation
        )
        self.setting, self.count = setting, count

    def run(self, model, i, noise=None, offset=0.0, disturbance=None):
        """The trajectory of one candidate, alone."""
        task = _core.Task(self.initial[i] + offset, self.target[i], STEPS)
        excitation = None if self.excitation is None else self.excitation[i : i + 1]
        noise, disturbance = (None if drawn is None else drawn[None] for drawn in (noise, disturbance))
        genes = self.genes[i : i + 1]
        return _core.rollout(
            model, self.setting, genes, task, noise=noise, excitation=excitation, disturbance=disturbance
        )  # fmt: skip


def expected_quality(kind, weights, effort, effort_rate, states, commands, target):
    gaps = states[1:] - target
    match kind:
        case "iae":
            error = DT * (np.abs(gaps) @ weights).sum()
        case "ise":
            error = DT * (gaps**2 @ weights).sum()
        case "final_distance":
            error = np.sqrt(gaps[-1] ** 2 @ weights)
    scaled = commands / COMMAND_SCALES
    change = np.diff(scaled, axis=0)
    return error + effort * DT * (scaled**2).sum() + effort_rate * (change**2).sum() / DT


def expected_usage(states):
    low, high = ENVELOPE[0]
    return (np.abs(states[:, 0] - (low + high) / 2) / ((high - low) / 2)).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", GROUPS)
@pytest.mark.parametrize("costs", [(0.0, 0.0), (0.3, 0.02)])
def test_every_flight_is_judged_by_its_own_trajectory(rig_setting, committee, kind, count, costs):
    drawn, stream, weights = Drawn(rig_setting, count), np.random.default_rng(1), np.array([2.0, 0.5])
    noise, offsets = stream.normal(0.0, 0.05, (3, STEPS + 1, 2)), stream.normal(0.0, 0.1, (3, 2))
    gusts = stream.normal(0.0, 0.1, (3, STEPS, 2))
    measure = _core.Quality(kind, weights, effort=costs[0], effort_rate=costs[1])
    qualities, usages = _core.qualities(
        committee, drawn.flights, measure, ENVELOPE, noise=noise, offsets=offsets, disturbances=gusts
    )
    assert qualities.shape == usages.shape == (4, 3, count)
    diverged = 0
    for m, model in enumerate(committee):
        for d in range(3):
            for i in range(count):
                run = drawn.run(model, i, noise[d], offsets[d], gusts[d])
                if run.lasted[0] < STEPS:
                    diverged += 1
                    assert np.isinf(qualities[m, d, i]) and np.isinf(usages[m, d, i])
                    continue
                states, commands = run.states[0], run.commands[0]
                quality = expected_quality(kind, weights, *costs, states, commands, drawn.target[i])
                assert qualities[m, d, i] == pytest.approx(quality, rel=1e-12)
                assert usages[m, d, i] == pytest.approx(expected_usage(states), rel=1e-12)
    assert diverged < qualities.size
    if count > 8:
        assert diverged > 0


@pytest.mark.parametrize("kind", KINDS)
def test_a_measured_quality_is_that_of_the_readings(rig_setting, committee, kind):
    drawn, weights = Drawn(rig_setting, 5), np.array([2.0, 0.5])
    noise = np.random.default_rng(1).normal(0.0, 0.05, (3, STEPS + 1, 2))
    measure = _core.Quality(kind, weights, effort=0.3, effort_rate=0.02)
    found = _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE, noise=noise, measured=True)
    true = _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE, noise=noise)
    assert same_bits(found[1], true[1]) and (found[0] != true[0]).all()
    for m, d, i in np.ndindex(found[0].shape):
        run = drawn.run(committee[m], i, noise[d])
        readings = run.states[0] + noise[d]
        readings[0] = run.states[0][0]  # where the flight begins counts in no quality
        expected = expected_quality(kind, weights, 0.3, 0.02, readings, run.commands[0], drawn.target[i])
        assert found[0][m, d, i] == pytest.approx(expected, rel=1e-12)
    silent = _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE, measured=True)
    assert same_bits(silent[0], _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE)[0])


def test_without_draws_there_is_one_flight_without_noise(rig_setting, committee):
    drawn, measure = Drawn(rig_setting, 5, excited=False), _core.Quality("iae", [1.0, 1.0])
    found = _core.qualities(committee, drawn.flights, measure, ENVELOPE)
    silent = _core.qualities(
        committee,
        drawn.flights,
        measure,
        ENVELOPE,
        noise=np.zeros((1, STEPS + 1, 2)),
        offsets=np.zeros((1, 2)),
    )
    assert found[0].shape == (4, 1, 5)
    assert same_bits(found[0], silent[0]) and same_bits(found[1], silent[1])
    for only in ({"offsets": np.zeros((2, 2))}, {"disturbances": np.zeros((2, STEPS, 2))}):
        twice = _core.qualities(committee, drawn.flights, measure, ENVELOPE, **only)
        assert twice[0].shape == (4, 2, 5)
        assert same_bits(twice[0][:, 1], found[0][:, 0])


def test_the_true_state_uses_the_envelope_and_states_without_one_do_not(rig_setting, committee):
    drawn, measure = Drawn(rig_setting, 4), _core.Quality("iae", [1.0, 1.0])
    assert (_core.qualities(committee[:3], drawn.flights, measure, [None, None])[1] == 0.0).all()
    noise = np.zeros((1, STEPS + 1, 2))
    noise[0, STEPS] = 100.0  # a reading that no command answers any more
    loud = _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE, noise=noise)
    quiet = _core.qualities(committee[:3], drawn.flights, measure, ENVELOPE)
    assert same_bits(loud[1], quiet[1])


def expected_disagreement(runs, sds, cap):
    """Value and place from trajectories (members, n, n_x)."""
    scaled = (runs - runs.mean(axis=0)) / sds
    rows = np.clip(scaled, -cap, cap).reshape(len(runs), -1)
    value = np.linalg.slogdet(np.eye(len(runs)) + rows @ rows.T)[1]
    gaps = (runs.max(axis=0) - runs.min(axis=0)) / sds
    step, state = np.unravel_index(np.argmax(gaps), gaps.shape)
    values = runs[:, step, state]
    return value, [step + 1, state, int(np.argmax(values)), int(np.argmin(values))], gaps[step, state]


@pytest.mark.parametrize("count", [*GROUPS, 140])
@pytest.mark.parametrize("cap", [100.0, 3.0])
def test_disagreement_is_the_log_determinant_of_the_deviations(rig_setting, committee, count, cap):
    drawn, sds = Drawn(rig_setting, count), np.array([0.05, 0.2])
    values, where = _core.disagreements(committee, drawn.flights, sds, cap=cap)
    assert values.shape == (count,) and where.shape == (count, 4)
    for i in range(count):
        runs = []
        for model in committee:
            run = drawn.run(model, i)
            lasted = int(run.lasted[0])
            states = run.states[0].copy()
            states[lasted:] = states[lasted]
            runs.append(states[1:])
        value, place, gap = expected_disagreement(np.array(runs), sds, cap)
        assert values[i] == pytest.approx(value, rel=1e-9)
        step, state, highest, lowest = where[i]
        found = (runs[highest][step - 1, state] - runs[lowest][step - 1, state]) / sds[state]
        assert found == pytest.approx(gap, rel=1e-12)
        if cap == 100.0 and count <= 9:
            assert where[i].tolist() == place


def test_members_that_agree_have_nothing_to_disagree_about(rig_setting, committee):
    drawn = Drawn(rig_setting, 3)
    for alike in (committee[:1], [committee[0]] * 4):
        values, where = _core.disagreements(alike, drawn.flights, [0.1, 0.1])
        assert values == pytest.approx(np.zeros(3), abs=1e-12) and (values >= 0.0).all()
        assert (where == 0).all()


@pytest.mark.parametrize("count", [7, 70])
def test_threads_and_widths_change_no_bit(rig_setting, committee, count):
    drawn, stream = Drawn(rig_setting, count), np.random.default_rng(2)
    noise = stream.normal(0.0, 0.05, (4, STEPS + 1, 2))
    measure = _core.Quality("iae", [1.0, 0.1], effort=0.1, effort_rate=0.1)

    def judged(workers):
        both = _core.qualities(committee, drawn.flights, measure, ENVELOPE, noise=noise, workers=workers)
        values, where = _core.disagreements(committee, drawn.flights, [0.1, 0.1], workers=workers)
        return (*both, values, where)

    one = judged(None)
    for threads in (1, 3):
        for width in _core.vector_widths():
            for a, b in zip(one, judged(_core.Workers(threads, width)), strict=True):
                assert same_bits(a, b)


def test_a_candidate_is_judged_alike_whoever_flies_beside_it(rig_setting, committee):
    drawn, measure = Drawn(rig_setting, 40), _core.Quality("ise", [1.0, 1.0], effort=1.0)
    qualities, _ = _core.qualities(committee, drawn.flights, measure, ENVELOPE)
    values, where = _core.disagreements(committee, drawn.flights, [0.1, 0.1])
    for i in (0, 13, 39):
        alone = _core.Flights(
            rig_setting, drawn.genes[i : i + 1], drawn.initial[i : i + 1], drawn.target[i : i + 1], STEPS,
            excitation=drawn.excitation[i : i + 1],
        )  # fmt: skip
        assert same_bits(_core.qualities(committee, alone, measure, ENVELOPE)[0][..., 0], qualities[..., i])
        value, place = _core.disagreements(committee, alone, [0.1, 0.1])
        assert same_bits(value, values[i : i + 1]) and place[0].tolist() == where[i].tolist()


def test_the_truth_judges_what_a_system_flew(quadrotor, quadrotor_family, first_test):
    genes = np.array([first_test.genes, 1.5 * first_test.genes])
    start, target = quadrotor.initial_state, quadrotor.target_state
    both = flights.candidates(quadrotor_family, genes, start, target, 100)
    measure = flights.quality("iae", np.ones(6))
    found, usages = flights.qualities(quadrotor.dynamics, both, measure, quadrotor.signals)
    assert len(both) == 2 and both.steps == 100 and measure.kind == "iae" and found.shape == (1, 1, 2)
    states = quadrotor.run(first_test).states
    assert found[0, 0, 0] == pytest.approx(0.02 * np.abs(states[1:] - target).sum(), rel=1e-12)
    limits = np.array([state.envelope[1] for state in quadrotor.signals.states])
    assert usages[0, 0, 0] == pytest.approx((np.abs(states) / limits).max(), rel=1e-12)


FLIGHTS = {
    "no candidate": {"genes": np.zeros((0, 6))},
    "no step": {"steps": 0},
    "a factor of nothing": {"factor": 0.0},
    "gains of another width": {"genes": np.ones((2, 5))},
    "starts for others": {"initial": np.zeros((3, 2))},
    "targets of another width": {"target": np.zeros((2, 3))},
    "an excitation of another length": {"excitation": np.zeros((2, 4, 2))},
    "an excitation that is infinite": {"excitation": np.full((2, STEPS, 2), np.inf)},
    "a target that is NaN": {"target": np.full((2, 2), np.nan)},
}


@pytest.mark.parametrize("wrong", FLIGHTS.values(), ids=FLIGHTS)
def test_flights_that_cannot_be_flown_are_refused(rig, rig_family, wrong):
    good = {"genes": np.ones((2, 6)), "initial": np.zeros((2, 2)), "target": np.ones((2, 2)), "steps": STEPS}
    given = {**good, "excitation": None, "factor": 10.0, **wrong}
    with pytest.raises(ValueError, match="expected"):
        _core.Flights(
            setting_of(rig, rig_family, given["factor"]),
            given["genes"], given["initial"], given["target"], given["steps"],
            excitation=given["excitation"],
        )  # fmt: skip


JUDGEMENTS = {
    "weights of another length": lambda m, f: _core.qualities(m, f, _core.Quality("iae", [1.0]), ENVELOPE),
    "a negative weight": lambda m, f: _core.Quality("iae", [1.0, -1.0]),
    "an effort that is NaN": lambda m, f: _core.Quality("iae", [1.0, 1.0], effort=np.nan),
    "an unknown quality": lambda m, f: _core.Quality("itae", [1.0, 1.0]),
    "an envelope the wrong way round": lambda m, f: _core.qualities(
        m, f, _core.Quality("iae", [1.0, 1.0]), [(1.0, -1.0), None]
    ),
    "an envelope of another length": lambda m, f: _core.qualities(m, f, _core.Quality("iae", [1, 1]), [None]),
    "noise of another length": lambda m, f: _core.qualities(
        m, f, _core.Quality("iae", [1, 1]), ENVELOPE, noise=np.zeros((2, STEPS, 2))
    ),
    "offsets for other draws": lambda m, f: _core.qualities(
        m, f, _core.Quality("iae", [1, 1]), ENVELOPE,
        noise=np.zeros((2, STEPS + 1, 2)), offsets=np.zeros((3, 2)),
    ),
    "disturbances for other draws": lambda m, f: _core.qualities(
        m, f, _core.Quality("iae", [1, 1]), ENVELOPE,
        noise=np.zeros((2, STEPS + 1, 2)), disturbances=np.zeros((3, STEPS, 2)),
    ),
    "disturbances of another length": lambda m, f: _core.qualities(
        m, f, _core.Quality("iae", [1, 1]), ENVELOPE, disturbances=np.zeros((2, STEPS + 1, 2))
    ),
    "nobody to judge": lambda m, f: _core.qualities([], f, _core.Quality("iae", [1, 1]), ENVELOPE),
    "nobody to disagree": lambda m, f: _core.disagreements([], f, [1.0, 1.0]),
    "an sd of nothing": lambda m, f: _core.disagreements(m, f, [1.0, 0.0]),
    "sds of other states": lambda m, f: _core.disagreements(m, f, [1.0]),
    "a cap that is infinite": lambda m, f: _core.disagreements(m, f, [1.0, 1.0], cap=np.inf),
}  # fmt: skip


@pytest.mark.parametrize("call", JUDGEMENTS.values(), ids=JUDGEMENTS)
def test_judgements_that_make_no_sense_are_refused(rig_setting, committee, call):
    with pytest.raises(ValueError, match="expected"):
        call(committee, Drawn(rig_setting, 2).flights)


def test_a_plant_judges_no_flights_of_another_system(rig_setting, quadrotor):
    drawn = Drawn(rig_setting, 2)
    with pytest.raises(ValueError, match="quadrotor: expected 6 states"):
        _core.qualities(quadrotor.dynamics, drawn.flights, _core.Quality("iae", [1.0, 1.0]), ENVELOPE)


def test_starts_of_another_shape_are_refused_with_their_name(quadrotor_family):
    with pytest.raises(tl.InvalidInput, match="initial states"):
        flights.candidates(quadrotor_family, np.ones((2, 9)), np.zeros(5), np.zeros(6), 10)
    with pytest.raises(tl.InvalidInput, match="expected one of iae"):
        flights.quality("itae", np.ones(6))

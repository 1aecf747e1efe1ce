"""Values come back from their plain form to the bit, and nothing else comes in through it."""

import copy
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from sameness import same, through_json
from strategies import programs
from twinloop import _core
from twinloop.campaign.coevolution.snapshots import ModelSnapshot, TestSnapshot
from twinloop.campaign.presets import options_of
from twinloop.campaign.setup import Setup
from twinloop.identification.identified import Identified
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.search.structure import Other, Sum
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.terms.pool import Pool
from twinloop.law.actuation import Actuation
from twinloop.records import KINDS, Recorded, from_text, plain, to_text

WORKERS = _core.Workers(threads=2)
NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)
# One NaN is as good as another: no text says which.
ANY_NUMBER = st.floats(allow_nan=True, allow_infinity=True).map(lambda x: np.nan if np.isnan(x) else x)


def again(value, *given):
    return type(value).from_record(through_json(value.to_record()), *given)


@st.composite
def signals(draw):
    n_x, n_u = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    states = [
        tl.State(
            f"x{i}",
            draw(st.sampled_from(["rad", "m/s", "K", "θ"])),
            draw(st.floats(1e-6, 1e6)),
            f"x{i - 1}" if i and draw(st.booleans()) else None,
            draw(st.sampled_from([None, (-1.5, 2.25)])),
            draw(st.none() | st.floats(1e-12, 1.0)),
        )
        for i in range(n_x)
    ]
    commands = [
        tl.Command(f"u{i}", "V", (-draw(st.floats(0.1, 10.0)), 3.0), draw(st.none() | st.floats(0.1, 5.0)))
        for i in range(n_u)
    ]
    return tl.Signals(states, commands, draw(st.floats(1e-4, 1.0)))


@st.composite
def families(draw, over):
    """A family over signals, as a user describes it."""
    box = draw(st.sampled_from([(0.0, 1.0), (0.25, 0.5, "log")]))
    mixer = tl.controllers.Mixer(
        np.linspace(0.1, 1.0, over.n_u)[:, None], draw(st.none() | st.just(np.ones(over.n_u))), 0.5, "N m"
    )
    output = mixer if over.n_u > 1 or draw(st.booleans()) else None
    if draw(st.booleans()):
        gains = {f"x0.{term}": box for term in ("kp", "ki", "kd")}
        return tl.controllers.PID([("x0", None)], gains, output)
    chosen = draw(st.sampled_from([box, {"x0": box}]))
    states = ["x0"] if isinstance(chosen, dict) else draw(st.sampled_from([None, ["x0"]]))
    return tl.controllers.StateFeedback(states, chosen, output)


@st.composite
def trajectories(draw):
    steps, n_x, n_u = draw(st.integers(0, 5)), draw(st.integers(1, 3)), draw(st.integers(1, 3))

    def rows(count, columns):
        return np.array(draw(st.lists(NUMBERS, min_size=count * columns, max_size=count * columns))).reshape(
            count, columns
        )

    states = rows(steps + 1, n_x)
    return tl.Trajectory(
        0.1 * np.arange(steps + 1),
        states,
        rows(steps, n_u),
        draw(st.sampled_from(["completed", "aborted", "diverged"])),
        draw(st.text(max_size=20)),
        draw(st.sampled_from([None, states])),
        draw(st.sampled_from([None, np.stack([states, states])])),
    )


@given(st.data())
def test_signals_and_families_come_back_as_they_were(data):
    over = data.draw(signals())
    family = data.draw(families(over))
    assert same(again(over), over)
    assert same(again(family), family)
    assert again(family).bind(again(over)).gains == family.bind(over).gains


@given(trajectories())
def test_a_trajectory_comes_back_as_it_was(trajectory):
    assert same(again(trajectory), trajectory)


@given(st.data())
def test_a_test_comes_back_as_it_was_over_the_family_that_it_is_given(data):
    over = data.draw(signals())
    family = data.draw(families(over)).bind(over)
    numbers = st.none() | ANY_NUMBER
    test = tl.Test(
        family,
        [gain.high for gain in family.gains],
        np.zeros(over.n_x),
        data.draw(st.lists(NUMBERS, min_size=over.n_x, max_size=over.n_x)),
        4,
        data.draw(st.sampled_from([None, np.full((4, over.n_u), 0.1)])),
        data.draw(st.integers(0, 1000)),
        "a",
        *(data.draw(numbers) for _ in range(4)),
        data.draw(st.text(max_size=20)),
    )
    assert same(again(test, family), test)


@given(programs())
def test_a_program_is_made_of_its_instructions(program):
    lengths, instructions = program.page_lengths, iter(program.instructions)
    pages = [[next(instructions) for _ in range(length)] for length in lengths]
    made = _core.Program(program.inputs, program.outputs, program.registers, pages)
    assert made == program and str(made) == str(program)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((1, 1, 1, []), "registers"),
        ((0, 1, 2, []), "input"),
        ((1, 1, 2, [[("+", 2, 0, 0)]]), "r2"),
        ((1, 1, 2, [[("+", -1, 0, 0)]]), "register"),
        ((1, 1, 2, [[("+", 1, 0, 70_000)]]), "70000"),
        ((1, 1, 2, [[("+", 1, 0, "r0")]]), "register"),
        ((1, 1, 2, [[("+", 1, 0, math.inf)]]), "finite"),
        ((1, 1, 2, [[("+", 1, 0, None)]]), "two operands"),
        ((1, 1, 2, [[("sin", 1, 0, 0)]]), "one operand"),
        ((1, 1, 2, [[("nothing", 1, 0, 0)]]), "nothing"),
    ],
)
def test_instructions_that_no_program_can_have_are_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        _core.Program(*arguments)


@st.composite
def pools(draw):
    """A pool of a few expressions."""
    pool = Pool(draw(st.integers(1, 4)), draw(st.integers(2, 9)))
    for _ in range(draw(st.integers(0, 8))):
        a, b = (draw(st.integers(0, len(pool) - 1)) for _ in range(2))
        kind = draw(st.sampled_from(["sum", "constant", "function", "hidden"]))
        if kind == "function":
            pool.add(draw(st.sampled_from(["abs", "sin"])), a)
        elif kind == "hidden":
            pool.hidden(draw(st.integers(0, 1)))
        else:
            second = b if kind == "sum" else draw(st.sampled_from([2.0, 1.0, -0.0, 0.1]))
            pool.add(draw(st.sampled_from(["+", "-", "*", "/", "min"])), a, second)
    for number in draw(st.lists(st.integers(0, len(pool) - 1), unique=True)):
        pool.rungs[number] = draw(st.integers(0, 3))
        pool.found[number] = draw(st.floats(0.0, 50.0))
    return pool


@given(pools())
def test_a_pool_comes_back_as_it_was(pool):
    found = again(pool)
    assert same(found, pool)
    assert [found.length(i) for i in range(len(pool))] == [pool.length(i) for i in range(len(pool))]


@given(ANY_NUMBER, st.lists(ANY_NUMBER, max_size=4))
def test_numbers_come_back_to_the_bit_those_that_json_cannot_write_too(number, several):
    chain = Chain((0,), None, "acceleration", np.ones(1), np.array(several), moved=number)
    assert same(again(chain), chain)


def test_what_was_identified_comes_back_and_is_learnt_on_from_with_the_same_bits(pendulum_signals):
    rows = np.random.default_rng(3)
    angle = np.cumsum(rows.standard_normal(40) * 0.05)
    states = np.stack([angle, np.gradient(angle, 0.05)], axis=1)
    runs = [Run.of(states, rows.uniform(-1, 1, (39, 1))), Run.of(0.5 * states, rows.uniform(-1, 1, (39, 1)))]
    options = options_of("default", {"moves": 300, "generations": 1, "population": 20, "committee_size": 3})

    def learn(known, iteration):
        return identify_runs(
            runs[:iteration], pendulum_signals, options, iteration=iteration, earlier=known, workers=WORKERS
        )

    identified = learn(None, 1)
    assert again(Actuation.direct(pendulum_signals)) == Actuation.direct(pendulum_signals)
    found = again(identified, pendulum_signals)
    assert same(found, identified)
    assert same(learn(found, 2), learn(identified, 2))


# Searches


@pytest.fixture
def searched(new_campaign, pendulum):
    """A campaign of the paper with one experiment that was learnt."""
    campaign = new_campaign()
    first = campaign.test(pendulum.default_gains)
    campaign.tell(first, pendulum.run(first))
    return campaign


def test_a_model_search_goes_on_from_its_record_with_the_same_bits(searched):
    search, selected = searched.models, searched._book.selected
    snapshot = ModelSnapshot.of(search)
    assert same(again(snapshot), snapshot)
    restored = again(snapshot).restored(searched.options, searched.signals, WORKERS)
    assert same(ModelSnapshot.of(restored), snapshot)
    moved = [ModelSnapshot.of(s.advance(selected, 5, WORKERS)) for s in (search, restored)]
    assert same(*moved) and moved[0].generation == search.generation + 5
    assert restored.committee(4) == search.committee(4) and restored.best == search.best


def test_a_test_search_goes_on_from_its_record_with_the_same_bits(searched):
    from twinloop.campaign.coevolution.search import start_tests

    setup, models = searched.setup, searched.models
    search = start_tests(
        models, setup.setting, setup.task, setup.options, seed=3, iteration=1, workers=WORKERS
    ).advance(2, WORKERS)
    snapshot = TestSnapshot.of(search)
    assert same(again(snapshot), snapshot)
    restored = again(snapshot).restored(models, setup.setting, setup.task, setup.options, WORKERS)
    moved = [TestSnapshot.of(s.advance(3, WORKERS)) for s in (search, restored)]
    assert same(*moved)
    assert restored.flat == search.flat


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"population": ()}, "individuals"),
        ({"archive": ()}, "member"),
        ({"seed": -1}, "at least 0"),
        ({"archive_objectives": np.zeros((2, 2))}, "member"),
        (
            {"population_objectives": np.zeros((20, 3)), "archive_objectives": np.zeros((1, 3))},
            "two objectives",
        ),
    ],
)
def test_a_search_that_never_was_is_refused(searched, change, word):
    snapshot = dataclasses.replace(ModelSnapshot.of(searched.models), **change)
    if "population_objectives" in change:
        snapshot = dataclasses.replace(snapshot, archive=snapshot.archive[:1])
    with pytest.raises(tl.InvalidInput, match=word):
        snapshot.restored(searched.options, searched.signals, WORKERS)


def test_members_that_another_dominates_are_no_archive(searched):
    snapshot = ModelSnapshot.of(searched.models)
    objectives = snapshot.archive_objectives.copy()
    double = np.concatenate([objectives, objectives[:1] + 1.0])
    wrong = dataclasses.replace(
        snapshot, archive=(*snapshot.archive, snapshot.archive[0]), archive_objectives=double
    )
    with pytest.raises(tl.InvalidInput, match="dominate"):
        wrong.restored(searched.options, searched.signals, WORKERS)


def test_genes_outside_their_bounds_are_no_tests(searched):
    from twinloop.campaign.coevolution.search import start_tests

    setup, models = searched.setup, searched.models
    search = start_tests(
        models, setup.setting, setup.task, setup.options, seed=3, iteration=1, workers=WORKERS
    )
    wrong = dataclasses.replace(TestSnapshot.of(search), population=search.population + 100.0)
    with pytest.raises(tl.InvalidInput, match="bounds"):
        wrong.restored(models, setup.setting, setup.task, setup.options, WORKERS)


# Setups and systems


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_setup_comes_back_with_every_option(preset, pendulum_signals, pendulum_controller):
    options = {"divergence_factor": 7.5}
    setup = tl.Campaign(
        pendulum_signals,
        controller=pendulum_controller,
        initial_state=[0.0, 0.0],
        target_state=[0.1, 0.2],
        duration=1.05,
        preset=preset,
        seed=2**63,
        options=options,
    ).setup
    found = again(setup)
    assert same(found, setup)
    assert found.options.divergence_factor == 7.5


def test_a_quadrotor_comes_back_and_draws_the_noise_of_its_next_run(first_test):
    system = tl.systems.Quadrotor.harsh(noise=2e-3, seed=5)
    system.run(first_test)
    found = again(system)
    assert found.runs == 1
    assert same(found.run(first_test), system.run(first_test))
    assert not same(tl.systems.Quadrotor.harsh(noise=2e-3, seed=5).run(first_test), system.run(first_test))


def test_a_setup_with_controllers_of_others_cannot_be_written_down(pendulum_signals, pendulum_controller):
    class Mine:
        def bind(self, over):
            return pendulum_controller.bind(over)

    campaign = tl.Campaign(
        pendulum_signals, controller=Mine(), initial_state=[0, 0], target_state=[1, 0], duration=1.0
    )
    with pytest.raises(tl.NotAvailable, match="Mine"):
        campaign.setup.to_record()


# What comes from elsewhere


STATE = {"kind": "state", "version": 1, "name": "angle", "unit": "rad", "scale": 1.0}


@pytest.mark.parametrize(
    ("record", "word"),
    [
        ([], "dict"),
        ({}, "'state'"),
        ({**STATE, "kind": "command"}, "'command'"),
        ({**STATE, "version": 3}, "newer Twinloop"),
        ({**STATE, "version": "1"}, "whole number"),
        ({**STATE, "version": True}, "whole number"),
        ({**STATE, "scales": 1.0}, "did you mean 'scale'"),
        ({key: value for key, value in STATE.items() if key != "unit"}, "unit"),
        ({**STATE, "scale": "1.0"}, "state.scale"),
        ({**STATE, "scale": "nan"}, "finite"),
        ({**STATE, "scale": True}, "number"),
        ({**STATE, "scale": 10**400}, "beyond 64 bits"),
        ({**STATE, "envelope": [1.0]}, "2 items"),
        ({**STATE, "envelope": [2.0, 1.0]}, "low < high"),
        ({**STATE, "name": "__import__('os')"}, "name"),
    ],
)
def test_a_record_that_is_none_is_refused_with_what_is_wrong(record, word):
    with pytest.raises(tl.InvalidInput, match=word.replace("(", r"\(")):
        tl.State.from_record(record)


@pytest.mark.parametrize(
    "nodes",
    [
        [],
        [["+", [0, 9], 0.0]],
        [["+", [0, 1], 0.0], ["+", [0, 1], 0.0]],
        [["constant", [], 1.0]],
        [["sin", [0, 1], 0.0]],
        [["sin", [0], 2.0]],
        [["input", [], 0.0]],
        [["input", [], 2.5]],
        [["os.system", [0], 0.0]],
        [["**", [0], 3.0]],
        [["*", [2 + i, 2 + i], 0.0] for i in range(40)],
    ],
)
def test_a_pool_that_never_was_is_refused(nodes):
    record = {**Pool(2).to_record(), "nodes": nodes}
    if not nodes:
        assert Pool.from_record(record).nodes == Pool(2).nodes
        return
    with pytest.raises(tl.InvalidInput):
        Pool.from_record(record)


def test_what_was_identified_of_other_signals_is_refused(pendulum_signals, quadrotor):
    pool = Pool(3)
    program = pool.program_of_sums([{0: 1.0}])
    chain = Chain((1, 0), 0, "acceleration", np.ones(2), np.ones(2))
    model = _core.Model(program, "acceleration", pendulum_signals.engine)
    direct = Actuation.direct(pendulum_signals)
    sums = [Sum({0: 1.0}, 2.0, chain, [Other((0,), 1.0)])]
    whole = Identified(model, [model], pool, sums, [chain], direct, np.zeros(2), 1.0, 2, 0, 3.0)
    assert same(again(whole, pendulum_signals), whole)
    with pytest.raises(tl.InvalidInput):
        again(whole, quadrotor.signals)
    damaged = copy.copy(whole)
    damaged.sums = [Sum({99: 1.0}, 2.0, chain)]
    with pytest.raises(tl.InvalidInput, match="nodes"):
        again(damaged, pendulum_signals)


@given(
    st.recursive(
        st.none() | st.booleans() | ANY_NUMBER | st.integers() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
        max_leaves=8,
    ),
    st.data(),
)
def test_a_record_with_anything_in_it_is_read_or_refused_in_a_sentence(anything, data):
    over = data.draw(
        st.sampled_from([tl.Signals, tl.Trajectory, tl.controllers.PID, Setup, Pool, Chain, Sum])
    )
    head = {"kind": over.KIND, "version": 1}
    names = data.draw(st.lists(st.sampled_from(over.recorded_fields()), unique=True))
    record = data.draw(
        st.sampled_from([anything, {**head, **dict.fromkeys(over.recorded_fields(), anything)}])
    )
    if isinstance(record, dict):
        record = {**record, **{name: anything for name in names}}
    with pytest.raises(tl.InvalidInput):
        over.from_record(record)


@pytest.mark.parametrize("text", ["", "{", "[NaN]", "[" * 100_000, '{"a": Infinity}', "\x00"])
def test_text_that_is_no_json_is_refused(text):
    with pytest.raises(tl.InvalidInput, match="expected JSON"):
        from_text(text, "This")


def test_a_text_of_a_record_is_one_line_that_reads_back():
    record = {"a": [1.0, 0.1, -0.0, 1e-300], "b": "θ\n"}
    text = to_text(record)
    assert "\n" not in text and json.dumps(from_text(text, "This")) == json.dumps(record)


def test_what_has_no_plain_form_is_refused():
    with pytest.raises(TypeError, match="object"):
        plain(object())


def test_each_kind_is_read_by_the_class_that_writes_it():
    assert all(kind == cls.KIND and issubclass(cls, Recorded) for kind, cls in KINDS.items())


def test_the_page_on_records_names_every_kind_and_every_field(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "scripts"))
    import records_page

    written = records_page.PAGE.read_text(encoding="utf-8")
    assert written == records_page.page(), "run `python scripts/records_page.py`"

"""What is given of readings: beside a loop that is written out, and what keeps a model's reports."""

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import strategies as st

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.streams import Unit
from twinloop.flights import candidates, qualities, quality
from twinloop.law.actuation import delayed
from twinloop.law.flight import fly
from twinloop.law.law import Law
from twinloop.law.noise import Noise
from twinloop.law.reports import Computed, Held, given, reports_of, variance, with_reports
from twinloop.records.native import model_record, read_model

DT, STEPS = 0.02, 60
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 5.0, derivative_of="angle")],
    [tl.Command("torque", "1", (-3.0, 3.0))],
    DT,
)
LOOP = tl.controllers.StateFeedback(None, gains={"angle->torque": (-9.0, 9.0), "rate->torque": (-9.0, 9.0)})
BOUND = LOOP.bind(SIGNALS)
TEST = tl.Test(BOUND, BOUND.genes({"angle->torque": 2.0, "rate->torque": 0.4}), [0.5, 0.0], [0.0, 0.0], STEPS)
COMPUTED = (None, Computed(0, 0.6, 0.4 / DT))
SLOW = (Held(5, 3, 4), None)
BOTH = (Held(3, 1), Computed(0, 0.8, 0.2 / DT))


def model():
    """d rate / dt = 8 torque - 0.5 rate."""
    lines = ["r4 = r2 * 24.0", "r5 = r1 * 0.5", "r3 = r4 - r5"]
    return _core.Model(_core.Program.parse(program_text(3, 1, 6, [lines])), "acceleration", SIGNALS.engine)


def written_out(reports, noise):
    """The loop in plain Python: readings as they are given, and true states, in steps of the plain model."""
    controller = TEST.controller()
    controller.reset()
    state, read, shown, states = np.array([0.5, 0.0]), [], [], [[0.5, 0.0]]
    for k in range(STEPS + 1):
        read.append(state + noise[k])
        now = read[-1].copy()
        for i, report in enumerate(reports):
            if isinstance(report, Held) and k > 0:
                fresh = k >= report.first and (k - report.first) % report.every == 0
                now[i] = read[max(k - report.age, 0)][i] if fresh else shown[-1][i]
        for i, report in enumerate(reports):
            if isinstance(report, Computed) and k > 0:
                now[i] = report.kept * shown[-1][i] + report.share * (now[report.of] - shown[-1][report.of])
        shown.append(now)
        if k < STEPS:
            command = controller.command(now, np.zeros(2))
            state = np.asarray(model().step(state[np.newaxis], command[np.newaxis])[0])
            states.append(state.tolist())
    return np.array(shown), np.array(states)


@pytest.mark.parametrize("reports", [COMPUTED, SLOW, BOTH])
def test_a_controller_on_the_twin_is_given_what_the_log_would_show(reports):
    noise = 0.01 * np.random.default_rng(1).normal(size=(STEPS + 1, 2))
    shown, states = written_out(reports, noise)
    run = fly(with_reports(model(), reports), TEST, noise=given(reports, noise))
    np.testing.assert_allclose(run.states, shown, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.true_states, states, rtol=1e-9, atol=1e-12)
    plain = fly(model(), TEST, noise=noise)
    assert np.abs(plain.true_states - states).max() > 1e-3


def test_many_flights_side_by_side_are_given_the_same():
    learnt = with_reports(model(), BOTH)
    genes = np.stack([TEST.genes, 0.5 * TEST.genes, 0.8 * TEST.genes])
    flights = candidates(BOUND, genes, [0.5, 0.0], [0.0, 0.0], STEPS, limits=Limits(SIGNALS))
    judged, _ = qualities([learnt], flights, quality("iae", [1.0, 0.5]), SIGNALS)
    for one, found in zip(genes, judged[0, 0], strict=True):
        run = fly(learnt, tl.Test(BOUND, one, [0.5, 0.0], [0.0, 0.0], STEPS))
        apart = DT * np.abs(run.true_states[1:]).sum(axis=0)
        assert found == pytest.approx(apart[0] + 0.5 * apart[1], rel=1e-9)


@drawn(st.sampled_from([COMPUTED, SLOW, BOTH]), st.integers(0, 2**32 - 1), st.floats(-3.0, 3.0))
def test_what_is_given_of_a_sum_is_the_sum_of_what_is_given(reports, seed, factor):
    first, second = np.random.default_rng(seed).normal(size=(2, 4, 30, 2))
    together = given(reports, first + factor * second)
    np.testing.assert_allclose(together, given(reports, first) + factor * given(reports, second), atol=1e-9)


def test_the_noise_of_a_computed_rate_is_that_of_the_readings_through_its_filter():
    noise = Noise(np.array([0.03, 0.0]), np.zeros(2), dt=DT)
    seen, _ = noise.drawn(50, 2000, Unit(7).part(0).stream("band"), COMPUTED)
    rate = COMPUTED[1]
    assert seen[:, 100:, 1].var() == pytest.approx(variance(rate, 0.03**2), rel=0.02)
    assert seen[:, 100:, 0].var() == pytest.approx(0.03**2, rel=0.02)


def test_reports_are_kept_in_all_that_is_made_of_a_model():
    learnt = with_reports(model(), BOTH)
    assert reports_of(model(), 2) == () and reports_of(learnt, 2) == BOTH
    law = Law.of(learnt, SIGNALS)
    assert law.reports == BOTH
    again = read_model(model_record(learnt), "model", (SIGNALS,))
    late = learnt.with_offsets([0.01, 0.0])
    for kept in (
        law.model(),
        again,
        late,
        delayed(learnt, SIGNALS),
        learnt.with_constants(learnt.constants, None),
    ):
        assert reports_of(kept, 2) == BOTH
    assert late.with_reports(*learnt.reports).offsets == [0.01, 0.0]
    text = tl.Twin(with_reports(model(), (Held(10, 10, 6), BOTH[1])), SIGNALS).equations()
    assert "# angle is read once in 10 periods (0.2 s), and given 0.12 s later" in text
    assert (
        "# rate is computed: 0.8 times its last value and 10 times what angle has changed by as it is read"
        in text
    )


def test_an_export_says_what_it_leaves_out(tmp_path):
    twin = tl.Twin(with_reports(model(), SLOW), SIGNALS)
    twin.export(tmp_path / "twin.py")
    assert "# angle is read once in 5 periods (0.1 s), and given 0.08 s later: not done here." in (
        tmp_path / "twin.py"
    ).read_text("utf-8")


def test_a_record_with_reports_of_no_machine_is_refused():
    record = model_record(with_reports(model(), BOTH))
    held, computed = record["reports"]["held"], record["reports"]["computed"]
    for wrong in (
        "always",
        {"held": held},
        {"held": [{**held[0], "every": 0}], "computed": computed},
        {"held": [{**held[0], "first": -1}], "computed": computed},
        {"held": [{**held[0], "age": 2.5}], "computed": computed},
        {"held": [*held, *held], "computed": computed},
        {"held": held, "computed": [{**computed[0], "kept": 1.0}]},
        {"held": held, "computed": [{**computed[0], "of": 7}]},
        {"held": held, "computed": [{**computed[0], "share": float("inf")}]},
    ):
        with pytest.raises(tl.InvalidInput):
            read_model({**record, "reports": wrong}, "model", (SIGNALS,))

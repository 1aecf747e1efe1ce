"""What a user knows or suspects: formulas become terms, and nothing else."""

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.formulas import bounded_term, fixed_term, parsed_term
from twinloop.identification.terms.pool import Pool

SIGNALS = tl.Signals(
    states=[
        tl.State("angle", "rad", scale=np.pi),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle"),
    ],
    commands=[tl.Command("torque", "N m", bounds=(-2, 2))],
    dt=0.05,
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rate * abs(rate)", lambda a, r, u: r * np.abs(r)),
        ("-9.81 * sin(angle)", lambda a, r, u: -9.81 * np.sin(a)),
        ("angle ** 3 - 2 * torque", lambda a, r, u: a**3 - 2 * u),
        ("max(rate, 0.5) / (1 + angle * angle)", lambda a, r, u: np.maximum(r, 0.5) / (1 + a * a)),
        ("-(angle + rate)", lambda a, r, u: -(a + r)),
    ],
)
def test_a_formula_is_the_expression_that_it_says(text, expected):
    pool = Pool(3)
    rows = np.random.default_rng(0).normal(size=(50, 3))
    found = pool.values([parsed_term(text, pool, SIGNALS)], rows)[:, 0]
    np.testing.assert_allclose(found, expected(*rows.T), rtol=1e-13)


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "rate.real", "speed", "lambda: 1", "rate if angle else 1", "rate ** 99", "1 +", "'x'",
     "abs(rate, angle)", "[rate]", "rate < angle", "(" * 300 + ")" * 300, "1e999 * rate", "rate + " + "9" * 401,
     "-" * 490 + "rate"],
)  # fmt: skip
def test_what_is_no_formula_is_refused(text):
    def below(calls):  # where little of the stack is left
        return below(calls - 1) if calls else parsed_term(text, Pool(3), SIGNALS)

    with pytest.raises(tl.InvalidInput, match="Term"):
        below(60)


def pendulum(states, command):
    angle, rate = states
    return np.array([rate, -9.81 * np.sin(angle) - 0.3 * rate + 3.0 * command])


def flown(noise=0.0, steps=60):
    stream = np.random.default_rng(1)
    x, states, commands = np.zeros(2), [np.zeros(2)], []
    for k in range(steps):
        u = 1.5 * np.sin(0.2 * k) * np.cos(0.05 * k)
        for _ in range(5):
            h = 0.01
            k1 = pendulum(x, u)
            k2 = pendulum(x + h / 2 * k1, u)
            k3 = pendulum(x + h / 2 * k2, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + pendulum(x + h * k3, u))
        states.append(x)
        commands.append([u])
    return Run.of(np.array(states) + noise * stream.standard_normal((steps + 1, 2)), np.array(commands))


def terms(identified):
    names = [*SIGNALS.state_names, *SIGNALS.command_names]
    return {identified.pool.text(node, names): weight for node, weight in identified.sums[0].weights.items()}


def learnt(**options):
    few = {"moves": 3000, "generations": 0, "committee_size": 2, "lags": False}
    settings = IdentificationOptions(**{**few, **options})
    return identify_runs([flown(1e-4)], SIGNALS, settings, workers=_core.Workers(1))


def test_a_fixed_term_stays_as_it_is_and_the_rest_is_found():
    found = learnt(fixed_terms=("rate: -9.81 * sin(angle)",))
    assert set(terms(found)) == {"rate", "torque"}
    assert terms(found)["torque"] == pytest.approx(6.0, rel=0.01)
    assert -9.81 in found.model.constants.tolist()
    assert 1.0 in found.model.constants.tolist()


def test_a_fixed_term_is_taken_out_of_the_readings_before_terms_are_selected():
    found = learnt(fixed_terms=("rate: -9.81 * sin(angle)",), tuning=False, passes=1)
    assert set(terms(found)) == {"rate", "torque"}
    assert terms(found)["torque"] == pytest.approx(6.0, rel=0.01)


def test_a_wrong_fixed_term_is_made_up_for():
    found = learnt(fixed_terms=("rate: -5 * sin(angle)",))
    assert terms(found)["sin(angle)"] == pytest.approx(-4.81, rel=0.02)


def test_a_seed_term_stands_on_the_first_rung():
    found = learnt(libraries=("linear",), seed_terms=("sin(angle)",))
    assert terms(found)["sin(angle)"] == pytest.approx(-9.81, rel=0.01)
    assert "sin(angle)" not in terms(learnt(libraries=("linear",)))


@pytest.mark.parametrize("text", ["sin(angle)", "angle: rate", "speed: 3", "rate: import os", ": rate"])
def test_a_fixed_term_names_a_state_that_an_output_drives(text):
    with pytest.raises(tl.InvalidInput):
        learnt(fixed_terms=(text,))


def test_a_campaign_refuses_formulas_before_anything_is_flown():
    family = tl.controllers.PID(
        axes=[("angle", "rate")], gains={"angle.kp": (0, 10), "angle.ki": (0, 2), "angle.kd": (0, 3)}
    )
    for options in (
        {"seed_terms": ("sin(angel)",)},
        {"fixed_terms": ("rate = 3",)},
        {"bounded_terms": ("rate: sin(angle) in 3 .. 2",)},
        {"fixed_terms": ("angle: rate",)},
        {"bounded_terms": ("angle: rate in 0 .. 3",)},
    ):
        with pytest.raises(tl.InvalidInput, match=r"[Tt]erm"):
            tl.Campaign(
                SIGNALS,
                controller=family,
                initial_state=[0, 0],
                target_state=[1, 0],
                duration=2.0,
                options=options,
            )


def test_known_terms_of_a_state_may_be_several():
    pool = Pool(3)
    state, node = fixed_term("rate: 2 * torque", pool, SIGNALS)
    assert state == 1 and pool.text(node, ["a", "r", "u"]) == "2*u"


# Bounds


@pytest.mark.parametrize(
    ("text", "expected", "low", "high"),
    [
        ("rate: sin(angle) in -20 .. -5", "sin(angle)", -20.0, -5.0),
        ("rate: -sin(angle) in 5..20", "sin(angle)", -20.0, -5.0),
        ("rate: 2 * torque in .. 6e0", "torque", -np.inf, 12.0),
        ("rate:torque in 0 .. inf", "torque", 0.0, np.inf),
        ("rate: 1 in -1 .. -1", "1", -1.0, -1.0),
    ],
)
def test_bounds_are_those_that_are_written(text, expected, low, high):
    pool = Pool(3)
    state, node, bounds = bounded_term(text, pool, SIGNALS)
    assert (state, pool.text(node, ["angle", "rate", "torque"]), bounds) == (1, expected, (low, high))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"bounded_terms": ("rate: sin(angle) in 3 .. 2",)}, "expected low <= high, found 3 and 2"),
        ({"bounded_terms": ("rate: sin(angle) in inf ..",)}, "expected low <= high"),
        ({"bounded_terms": ("speed: sin(angle) in 2 .. 3",)}, "one of the states angle, rate"),
        ({"bounded_terms": ("angle: rate in 0 .. 3",)}, "any of rate, found angle"),
        ({"bounded_terms": ("rate: sin(angle) in 2",)}, "expected 'state: formula in low .. high'"),
        ({"bounded_terms": ("rate: sin(angle) in nan .. 3",)}, "expected numbers"),
        ({"bounded_terms": ("rate: sin(angle) in 1 .. x",)}, "found 'x'"),
        ({"bounded_terms": ("rate: 0.0 * angle in 1 .. 2",)}, "found 0 times one"),
        ({"bounded_terms": ("rate: import os in 1 .. 2",)}, "expected a formula"),
        ({"bounded_terms": ("rate: angle in 1 ..", "rate: -angle in .. 9")}, "found a second one"),
        (
            {"bounded_terms": ("rate: sin(angle) in 1 ..",), "fixed_terms": ("rate: -9.81 * sin(angle)",)},
            "found one that is fixed",
        ),
    ],
)
def test_bounds_that_make_no_sense_are_refused(options, sentence):
    with pytest.raises(tl.InvalidInput, match=sentence):
        learnt(**options)


def of_sine(found):
    """The coefficients of sin(angle) in each member of a committee, read from its program."""
    said = []
    for member in found.members:
        instructions = member.program.instructions
        sines = [target for operation, target, a, _ in instructions if operation == "sin" and a == 0]
        said.append([b for op, _, a, b in instructions if op == "*" and a in sines and isinstance(b, float)])
    return said


def same(one, other):
    return [str(m.program) for m in one.members] == [str(m.program) for m in other.members]


def test_a_bound_that_does_not_bind_changes_no_bit():
    free = learnt(committee_size=6)
    for text in ("rate: sin(angle) in -20 .. -5", "rate: sin(angle) in .. 0", "rate: torque in 0 .. 100"):
        bound = learnt(committee_size=6, bounded_terms=(text,))
        assert (
            same(bound, free)
            and bound.description_length == free.description_length
            and bound.remarks == free.remarks
        )


@pytest.mark.parametrize("changes", [{"parts": False}, {"libraries": ("linear",)}])
def test_a_bound_that_excludes_the_truth_holds_every_member_and_is_told(changes):
    # With cubes a part makes the rest of a sine of them, within the bound.
    found = learnt(committee_size=6, bounded_terms=("rate: sin(angle) in -20 .. -12",), **changes)
    assert terms(found)["sin(angle)"] == -12.0
    assert any("sin(angle) in the equation of rate is held at its bound -12" in str(r) for r in found.remarks)
    assert all(len(one) == 1 and -20.0 <= one[0] <= -12.0 for one in of_sine(found))


@pytest.mark.parametrize(
    ("low", "high"), [(-9.8, -5.0), (-9.815, -9.805), (-20.0, -9.8), (-3.0, np.inf), (2.0, 9.0)]
)
def test_every_member_keeps_within_bounds(low, high):
    found = learnt(committee_size=8, bounded_terms=(f"rate: sin(angle) in {low} .. {high}",))
    assert len(found.members) > 1
    must = not low <= 0.0 <= high
    for coefficients in of_sine(found):
        assert len(coefficients) >= must and all(low <= c <= high for c in coefficients)


def test_a_bounded_term_that_no_library_has_is_a_candidate():
    found = learnt(libraries=("linear",), bounded_terms=("rate: sin(angle) in -20 .. -5",))
    assert terms(found)["sin(angle)"] == pytest.approx(-9.81, rel=0.01)


def test_bounds_on_terms_that_runs_cannot_tell_apart_are_no_obstacle():
    still = Run.of(np.zeros((41, 2)), np.zeros((40, 1)))
    settings = IdentificationOptions(
        moves=500, generations=0, committee_size=2, lags=False,
        bounded_terms=("rate: sin(angle) in .. -5", "rate: angle in 1 ..", "rate: 2 * angle - angle in 1 ..")
    )  # fmt: skip
    for run in (still, flown()):
        found = identify_runs([run], SIGNALS, settings, workers=_core.Workers(1))
        assert np.isfinite(found.model.step([[0.1, 0.0]], [[0.0]])).all()


def test_bounds_hold_in_every_form():
    for form, low, high in (("increment", 0.9, 1.1), ("absolute", 0.9, 0.93)):
        found = learnt(form=form, libraries=("linear",), bounded_terms=(f"rate: rate in {low} .. {high}",))
        # What a state adds to its own next value: all of it in "absolute", what is beyond 1 of it in "increment".
        x = np.array([[0.0, 0.5], [0.0, 0.0]])
        change = np.diff(found.model.step(x, np.zeros((2, 1)))[::-1, 1])[0] / 0.5
        coefficient = change - (form == "increment")
        assert low - 1e-9 <= coefficient <= high + 1e-9
        assert any("rate in the equation of rate is held at its bound" in str(r) for r in found.remarks)

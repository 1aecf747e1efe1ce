"""What a user knows or suspects: formulas become terms, and nothing else."""

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop.identification.formulas import fixed_term, parsed_term
from twinloop.identification.identify import identify_runs
from twinloop.identification.pool import Pool
from twinloop.identification.records import Run
from twinloop.identification.settings import IdentificationOptions

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
     "abs(rate, angle)", "[rate]", "rate < angle", "(" * 300 + ")" * 300],
)  # fmt: skip
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(tl.InvalidInput, match="Term"):
        parsed_term(text, Pool(3), SIGNALS)


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
    settings = IdentificationOptions(moves=3000, generations=0, committee_size=2, lags=False, **options)
    return identify_runs([flown(1e-4)], SIGNALS, settings, workers=_core.Workers(1))


def test_a_fixed_term_stays_as_it_is_and_the_rest_is_found():
    found = learnt(fixed_terms=("rate: -9.81 * sin(angle)",))
    assert set(terms(found)) == {"rate", "torque"}
    assert terms(found)["torque"] == pytest.approx(6.0, rel=0.01)
    assert -9.81 in found.model.constants.tolist()
    assert 1.0 in found.model.constants.tolist()


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
    for options in ({"seed_terms": ("sin(angel)",)}, {"fixed_terms": ("rate = 3",)}):
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
    assert state == 1 and pool.text(node, ["a", "r", "u"]) == "u * 2 * 1"

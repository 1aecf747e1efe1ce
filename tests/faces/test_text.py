"""What a person reads, and what JSON can hold."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from twinloop.campaign.examination.check import Checks
from twinloop.campaign.history import Progress
from twinloop.campaign.presets import options_of
from twinloop.campaign.remaining import Estimate, duration
from twinloop.faces.result import plain, to_json
from twinloop.faces.text import quality_words, render, table
from twinloop.faces.text.twin import hidden_states
from twinloop.faces.text.verdict import verdict
from twinloop.faces.verdict import of_next, verdict_facts


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (42.0, "42 s"), (59.6, "1 min 00 s"), (185.0, "3 min 05 s"), (7800.0, "2 h 10 min")],
)
def test_a_length_of_time_is_written_for_a_person(seconds, text):
    assert duration(seconds) == text


def test_a_table_has_columns_of_equal_width():
    lines = table(["name", "value"], [["a", 0.123456], ["longer", None], ["c", 7]]).splitlines()
    assert lines[0] == "name     value"
    assert lines[2:] == ["a       0.1235", "longer       –", "c            7"]


def test_what_is_not_finite_becomes_null_in_json():
    text = to_json({"a": math.inf, "b": [math.nan, 1.5], "c": np.float64(2.0), "d": (np.int64(3), None)})
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": 2.0, "d": [3, None]}
    assert text.endswith("}\n")


def test_a_number_keeps_its_bits_in_json():
    values = [0.1, 1.0 / 3.0, 5e-324, -1.7976931348623157e308]
    assert json.loads(to_json({"values": np.array(values)}))["values"] == values


def test_json_refuses_what_it_cannot_hold():
    with pytest.raises(TypeError, match="expected numbers"):
        plain(object())


def progress(phase, iteration, generation, generations):
    return Progress(phase, iteration, generation, generations, 1, (0,), (), (), 1, 1)


def test_the_time_left_shrinks_to_nothing_with_the_work(monkeypatch):
    clock = iter(range(100))
    monkeypatch.setattr("twinloop.campaign.remaining.time.monotonic", lambda: float(next(clock)))
    options = options_of("paper", {"model_generations": 10, "test_generations": 5})
    estimate = Estimate(options, experiments=1)
    assert estimate.remaining(progress("experiment", 0, 0, 0)) is None
    left = [estimate.remaining(progress("models", 1, generation, 10)) for generation in range(1, 11)]
    assert left == pytest.approx([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0])


def result_of_default(**advice):
    """The least that `render` needs of a run of the preset `default`, whose checks all hold."""
    result = {
        "system": {"name": "rig"}, "preset": "default", "seed": 7, "interrupted": False,
        "quality": {
            **{"kind": "iae", "unit": "rad s", "effort": 0.0, "effort_rate": 0.0},
            "counts": [{"name": "angle", "unit": "rad", "weight": 1.0}],
        },
        "signals": {"states": [{"unit": "rad", "envelope": None}, {"unit": "rad/s", "envelope": [-1.0, 1.0]}]},
        "experiments": [
            {
                "test": 0, "ended": "aborted", "reason": "rate above 12", "open_loop": 1e-4, "closed_loop": 1e-3,
                "normalised": 0.1, "normalised_before": None, "predicted": None, "spread": None, "measured": None,
                "predicted_minus_measured": None, "risk": None, "why": "", "excited": True,
            }
        ],
        "twin": {
            "equations": ["d rate / dt = torque"], "terms": 1, "committee": 1, "misfit": 1.0, "readings": 80,
            "ignored": 0, "remarks": ["Fly another test before you trust it."],
            "states": [{"name": "angle", "unit": "rad", "error": 2e-3, "sensor": 1e-3}],
            "disturbances": [
                {
                    "name": "rate", "unit": "rad/s", "white": 0.0, "correlated": 0.5, "correlation_time": 0.2,
                    "cause": "disturbance",
                },
            ],
            "actuators": [
                {"name": "torque", "lag": 0.03, "delay": 1}, {"name": "rudder", "lag": 0.0, "delay": 0, "rate": 0.5},
            ],
            "hidden": [{"commands": ["torque"], "squared": True, "rest": 0.0, "time": 0.8}],
        },
        "controller": {
            "test": 1, "flown": False, "why": "Tuned on the twin.", "predicted": 0.9, "spread": 0.1,
            "measured": None, "risk": 0.01,
            "gains": [{"name": "angle.kp", "value": 2.0, "unit": "N m/rad", "low": 0.0, "high": 6.0}],
        },
        "first_controller": {"gains": {"angle.kp": 1.0}, "predicted": 2.0, "measured": None},
        "advice": {
            "before_test": 1, "trusted": True, "gain": 0.5, "share": 0.25, "scatter": 0.1, "stop": False, **advice
        },
        "run_info": {},
    }  # fmt: skip
    examined = SimpleNamespace(best=object(), margins=object(), ending=None)
    result["verdict"] = {
        "twin": {"answer": "Trust it within the flown range", "good": True, "reasons": []},
        "controller": {"answer": "Fly it", "good": True, "reasons": []},
        **verdict_facts([of_next(examined, Checks([]), result)]),
    }
    return result


def test_a_result_of_default_says_what_a_person_must_know():
    text = render(result_of_default())
    for words in (
        "torque: lag 0.03 s, delay 1 period;", "rudder: no lag, no delay, at most 0.5 of its unit a second.",
        "squares of torque drive a state", "1/e in 0.8 s",
        "rate 0.5 (rad/s)/s with a correlation time of 0.2 s", "It was cut: rate above 12.",
        "CONTROLLER TO FLY: NOT FLOWN YET", "each in units of its scale", "Fly another test before you trust it.",
    ):  # fmt: skip
        assert words in text


@pytest.mark.parametrize(
    ("advice", "words"),
    [
        (
            {},
            "0.5 rad s, 25 % of what it is now.\nThat is above what the sensors alone scatter one measurement by,"
            " 0.1 rad s",
        ),
        (
            {"gain": 0.01, "share": None, "stop": True},
            "by 0.01 rad s.\nThat is below what the sensors alone scatter",
        ),
        ({"gain": 0.0, "stop": True}, "would not have improved\nthe quality. For the controller, stop."),
        ({"gain": 0.0, "stop": True}, "stop.\nThe sensors alone scatter one measurement by 0.1 rad s."),
        ({"gain": 0.0, "stop": True}, "Next: fly this controller, then stop; another flight"),
        ({"trusted": False}, "Next: look into the remarks, then fly another test"),
        ({"trusted": False}, "it cannot say. Look into the remarks, then fly another test."),
        ({"gain": None}, "No flight was planned yet"),
    ],
)
def test_advice_to_stop_is_given_where_a_gain_could_not_be_measured(advice, words):
    assert words in render(result_of_default(**advice))


def test_gains_that_no_test_was_made_of_have_no_number():
    result = result_of_default()
    assert "Controller: fly it; test 1, " in render(result)
    result["controller"]["test"] = None
    text = render(result)
    assert (
        "Controller: fly it; tuned gains, not asked for yet, " in text
        and "CONTROLLER TO FLY: NOT FLOWN YET" in text
    )


def test_a_quality_without_a_unit_is_named_without_one():
    assert quality_words("ise", "") == "integrated squared error"
    assert quality_words("iae", "rad s") == "integrated absolute error (rad s)"


def test_a_risk_that_no_predicted_flight_shows_is_no_estimate():
    """Where none of 128 flights leaves the envelope, (0 + 1/2) / 129 is the least that the formula gives."""
    result = result_of_default() | {"options": {"committee_size": 8, "draws": 16}}
    result["controller"]["risk"] = result["experiments"][0]["risk"] = 0.5 / 129.0
    text = render(result)
    assert "Risk of leaving the envelope: less than 0.4 % (none of 128 predicted flights leaves it)." in text
    assert "< 0.4 %" in text and "0.003876" not in text
    result["controller"]["risk"] = 2.5 / 129.0
    assert "Risk of leaving the envelope: 1.9 %." in render(result)


def test_without_an_envelope_the_risk_is_that_of_diverging():
    result = result_of_default()
    result["signals"]["states"][1]["envelope"] = None
    text = render(result)
    assert "Risk of diverging, without a declared envelope: 1 %." in text and "leav" not in text


def test_gains_that_are_fixed_at_nothing_are_counted_rather_than_listed():
    result = result_of_default()
    fixed = {"unit": "N m/rad", "low": None, "high": None}
    for name, value in (("rate.kp", 0.0), ("rate.ki", 0.0), ("rate.kd", 0.7)):
        result["controller"]["gains"].append({"name": name, "value": value, **fixed})
        result["first_controller"]["gains"][name] = value
    text = render(result)
    assert "\n2 gains fixed at 0 left out.\n" in text and "rate.kp" not in text and "rate.ki" not in text
    (row,) = [line for line in text.splitlines() if line.startswith("rate.kd")]
    assert row.split() == ["rate.kd", "0.7", "0.7", "N", "m/rad", "fixed"]


def test_hidden_states_are_said_one_by_one_and_a_mass_on_a_spring_once():
    one = {"commands": [], "states": ["rate"], "squared": False, "time": 6.5, "turns": 0.1}
    other = {"commands": ["torque"], "states": [], "squared": True, "time": 1e6, "turns": 0.0}
    first, second, third = hidden_states([other, one, one, {**one, "turns": 0.2}, {**one, "turns": 0.2}])
    assert (
        first == "Hidden state: the squares of torque drive a state that is not measured; it does not decay."
    )
    assert "values of rate" in second and "swings once in 0.628 s and decays to 1/e in 6.5 s" in second
    assert "swings once in 1.26 s" in third


def test_a_mass_behind_a_gap_is_said_once_with_its_play():
    one = {"commands": [], "states": ["rate"], "squared": False, "time": 0.7, "turns": 0.025, "gap": 0.06}
    (said,) = hidden_states([one, one])
    assert "behind a gap: rate drives it, with a play of ±0.06 (unit of rate, times s)" in said
    assert "swing once in 0.157 s; its own rate decays to 1/e in 0.7 s" in said


@pytest.mark.parametrize(
    ("count", "more"),
    [(1, ""), (2, " There is 1 more reason."), (3, " There are 2 more reasons.")],
)
def test_a_verdict_counts_the_reasons_that_it_does_not_say(count, more):
    result = result_of_default()
    reasons = ["Commands moved and nothing answered."] * count
    result["verdict"]["twin"] = {"answer": "Do not trust it", "good": False, "reasons": reasons}
    said, *_ = verdict(result, "twinloop report rig.db").splitlines()
    begun = f"Twin: do not trust it. Commands moved and nothing answered.{more}"
    assert said == f"{begun} All checks: twinloop report rig.db"
    assert verdict(result).splitlines()[0] == begun

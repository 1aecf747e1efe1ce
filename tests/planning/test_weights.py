"""Weights of the quality by the states' names: what counts, in any units, and what is refused."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from lives import CONTROLLER, SIGNALS, SMALL, lived
from twinloop.faces.cli import main
from twinloop.faces.report.tables.controller import gains
from twinloop.faces.result import summary
from twinloop.faces.text import counted, render
from twinloop.planning.quality import KINDS, quality_of, weights_of
from twinloop.records import to_text


def signals(angle=1.0, rate=1.0, angles="rad"):
    """Two angles and a rate, in units of which there are this many in those of SI."""
    return tl.Signals(
        [
            tl.State("pitch", angles, 0.5 * angle),
            tl.State("yaw", "rad", 2.0 * angle),
            tl.State("rate", "rad/s", 4.0 * rate, derivative_of="pitch"),
        ],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        0.05,
    )


def begun(**changes):
    return tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options={**SMALL, **changes.pop("options", {})}, **changes,
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_state_that_is_named_counts_so_often_and_the_others_as_before(kind):
    before = quality_of(kind, signals()).weights
    assert weights_of(kind, signals(), {"pitch": 2.0}).tolist() == [2.0 * before[0], *before[1:]]
    assert weights_of(kind, signals(), {}).tolist() == before.tolist()


def test_a_rate_that_is_named_counts_in_units_of_its_scale():
    assert weights_of("iae", signals(), {"rate": 0.5}).tolist() == [1 / 0.5, 1 / 2.0, 0.5 / 4.0]
    assert weights_of("ise", signals(), {"rate": 0.5}).tolist() == [4.0, 0.25, 0.5 / 16.0]
    assert weights_of("iae", signals(), {"pitch": 0, "yaw": 0, "rate": 3}).tolist() == [0.0, 0.0, 3.0]


@given(
    st.sampled_from(("iae", "ise")),
    st.lists(st.floats(0.125, 1e3) | st.just(0.0), min_size=3, max_size=3),
    st.tuples(st.integers(-20, 20), st.integers(-20, 20)),
)
def test_weights_have_no_unit(kind, shares, units):
    """The weighed errors of two plants that differ in their units are alike but for one factor of all."""
    names, factors = ("pitch", "yaw", "rate"), np.ldexp(1.0, [units[0], units[0], units[1]])
    one = weights_of(kind, signals(), dict(zip(names, shares, strict=True)))
    other = weights_of(kind, signals(factors[0], factors[2]), dict(zip(names, shares, strict=True)))
    ratios = (other * factors ** (1 if kind == "iae" else 2))[one > 0.0] / one[one > 0.0]
    assert (ratios == ratios[:1]).all() and (other[one == 0.0] == 0.0).all()


def test_weights_are_kept_in_a_record_and_change_what_a_flight_is_worth():
    plain, weighed = (lived(begun(weights=weights), ("tell",)) for weights in (None, {"rate": 1.0}))
    again = tl.Campaign.from_record(weighed.to_record())
    assert again.setup.quality.weights.tolist() == [1 / np.pi, 1 / 8.0]
    assert to_text(again.to_record()) == to_text(weighed.to_record())
    run, alone = weighed.experiments[0].trajectory, plain.experiments[0].quality
    both = 0.05 * np.sum(np.abs(run.states[1:] - [1.0, 0.0]) / [np.pi, 8.0])
    assert weighed.experiments[0].quality == pytest.approx(both, rel=1e-12) != alone


def test_the_result_and_its_text_say_what_counts():
    result = summary(
        lived(begun(weights={"angle": 2.0}, options={"effort": 0.5}), ("tell",)), {"name": "it"}, {}
    )
    assert result["quality"]["counts"] == [{"name": "angle", "unit": "rad", "weight": 2.0}]
    assert "What counts: 2 × angle (rad), 0.5 × commands² (in scales)." in render(result)
    squares = {
        "kind": "ise",
        "counts": [{"name": "x", "unit": "", "weight": 1.0}],
        "effort": 0.0,
        "effort_rate": 0.0,
    }
    assert counted(squares) == "1 × x² (1)"


@pytest.mark.parametrize(("value", "bound"), [(5.99, "upper"), (5.9, ""), (0.0, "lower")])
def test_a_gain_at_a_bound_is_marked_in_json_text_and_report(value, bound, monkeypatch):
    campaign = lived(begun(), ("tell",))
    best = dataclasses.replace(campaign.experiments[0].test, genes=np.array([value, 2.0, 0.3]))
    monkeypatch.setattr(type(campaign), "best_test", best)
    result = summary(campaign, {"name": "it"}, {})
    assert [gain["at_bound"] for gain in result["controller"]["gains"]] == [bound, "", ""]
    assert render(result).count("at its ") == (bound != "") and f"{bound} bound" * (bound != "") in render(
        result
    )
    cells = [row[-1] for row in gains(result).rows]
    assert cells == [f"at its {bound} bound" if bound else "", "", ""]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"weights": {"angel": 2.0}}, "did you mean 'angle'"),
        ({"weights": {1: 2.0}}, "state of the argument weights"),
        ({"weights": {"angle": -1.0}}, "expected a finite number|expected at least 0"),
        ({"weights": {"angle": np.nan}}, "expected a finite number|expected at least 0"),
        ({"weights": {"angle": 10**400}}, "expected a finite number|expected at least 0"),
        ({"weights": {"angle": True}}, "expected a finite number|expected at least 0"),
        ({"weights": {"angle": "2"}}, "expected a finite number|expected at least 0"),
        ({"weights": [1.0, 0.0]}, "expected a finite number|expected at least 0"),
        ({"weights": {"angle": 0.0}}, "as good as any other"),
        ({"weights": {"angle": 2.0}, "quality": "iaee"}, "did you mean 'iae'"),
        ({"weights": {"angle": 2.0}, "options": {"quality_weights": [1.0, 0.0]}}, "found both"),
    ],
)
def test_weights_that_cannot_be_used_are_refused(changes, sentence):
    with pytest.raises(tl.InvalidInput, match=sentence):
        begun(**changes)


def test_the_paper_weighs_all_states_alike(new_campaign):
    with pytest.raises(tl.InvalidInput, match="weights"):
        new_campaign(weights={"angle": 2.0})


@pytest.mark.parametrize("text", ["angle", "angle=heavy", "=2"])
def test_a_weight_on_the_command_line_that_is_none_is_refused(text, capsys):
    with pytest.raises(SystemExit) as left:
        main(["run", "quadrotor", "--weight", text])
    assert left.value.code == 2 and "weight" in capsys.readouterr().err

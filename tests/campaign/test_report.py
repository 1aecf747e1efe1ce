"""What a campaign and its twin say of themselves: fit, remarks, advice, the report with its verdict, the picture."""

import json
import warnings
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from lives import PLANT, begun, by_hand, cut, made
from lives import new as new_of
from twinloop.campaign.assessment import advice as assessed
from twinloop.errors import RemarkWarning
from twinloop.faces.result import summary, to_json
from twinloop.law.beginning import start_of
from twinloop.remarks import Remark, note, serious

GAINS = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3}


def backwards(run):
    return tl.Trajectory(run.t, run.states, -run.commands)


# The fit of a twin


def test_the_fit_is_that_of_the_free_run_under_the_recorded_commands():
    twin, record = begun().run(PLANT, 2).twin, by_hand(40)
    table = twin.fit(record)
    y = record.states[1:]
    start = start_of(twin.model, record.states, record.commands, twin.limits)
    simulated = twin.simulate_commands(start, record.commands).states[1:]
    for i, row in enumerate(table):
        off, around = y[:, i] - simulated[:, i], y[:, i] - y[:, i].mean()
        assert row.name == record_names()[i]
        assert row.rmse == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-9)
        assert row.fit == pytest.approx(100 * (1 - np.linalg.norm(off) / np.linalg.norm(around)), rel=1e-9)
        assert row.r2 == pytest.approx(1 - np.sum(off**2) / np.sum(around**2), rel=1e-9)
    assert "FIT %" in str(table) and "angle" in str(table)


def record_names():
    return [state.name for state in PLANT.signals.states]


def test_a_state_that_never_moves_has_no_fit_and_a_run_that_diverges_none_that_is_finite():
    family = begun().family
    text = "program inputs=3 outputs=2 registers=5\npage 1\n  r3 = r0 * 1.0\n  r4 = r1 * 2.0\n"
    twin = tl.Twin(
        tl._core.Model(tl._core.Program.parse(text), "absolute", family.signals.engine), family.signals
    )
    t = 0.05 * np.arange(21)
    still = tl.Trajectory(t, np.zeros((21, 2)), np.zeros((20, 1)))
    assert [(row.rmse, row.fit, row.r2) for row in twin.fit(still)] == [(0.0, None, None)] * 2
    moving = tl.Trajectory(t, np.column_stack([0.1 * t, 1.0 + t]), np.zeros((20, 1)))
    assert all(row.rmse == np.inf and row.fit == -np.inf and row.r2 == -np.inf for row in twin.fit(moving))
    with pytest.raises(tl.InvalidInput, match="at least 1 step"):
        twin.fit(tl.Trajectory(t[:1], np.zeros((1, 2)), np.zeros((0, 1))))


# Remarks


def test_serious_remarks_are_warnings_and_values_of_the_twin():
    campaign = made()
    first = campaign.test(GAINS)
    campaign.tell(first, backwards(PLANT.run(first)))
    with pytest.warns(RemarkWarning, match=r"does not follow.*\(does-not-follow\)") as said:
        twin = campaign.twin
    assert said[0].filename == __file__
    (remark,) = [remark for remark in twin.remarks if remark.code == "does-not-follow"]
    assert remark.serious and remark.severity == "serious" and str(remark) == remark.sentence
    assert twin.remarks == campaign.history[-1].remarks
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _ = campaign.twin, campaign.best_test  # it was said


def test_a_campaign_without_serious_remarks_warns_of_nothing():
    campaign = begun()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        remarks = campaign.twin.remarks
    assert not any(remark.serious for remark in remarks)
    result = json.loads(to_json(summary(campaign, {}, {})))
    assert result["twin"]["remarks"] == [
        {"code": remark.code, "severity": remark.severity, "sentence": remark.sentence} for remark in remarks
    ]


def test_a_remark_has_a_severity_and_comes_back_from_its_record():
    remark = Remark("copies", "note", "Two records are equal.")
    assert Remark.from_record(json.loads(json.dumps(remark.to_record()))) == remark
    with pytest.raises(tl.InvalidInput, match="did you mean 'serious'"):
        Remark("copies", "seriuos", "Two records are equal.")


def dead(run, column=slice(None), value=0.0):
    states = run.states.copy()
    states[:, column] = value
    return tl.Trajectory(run.t, states, run.commands)


@pytest.mark.parametrize("how", ["tell", "attach", "tell_failed"])
def test_what_speaks_against_a_flight_is_a_warning_as_soon_as_it_is_told(how):
    campaign = made()
    first = campaign.test(GAINS)
    run = dead(PLANT.run(first), 1)
    tell = {
        "tell": lambda: campaign.tell(first, run),
        "attach": lambda: campaign.attach(run),
        "tell_failed": lambda: campaign.tell_failed(first, "a motor cut out", run),
    }[how]
    with pytest.warns(RemarkWarning, match=r"rate is 0 rad/s in every row.*\(still\)") as said:
        tell()
    assert {each.filename for each in said} == {__file__} and len(campaign.experiments) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        other = begun()  # a flight of which nothing is to be said
        other.tell_failed(other.test(GAINS), "there is no log")


# Advice, report, picture


def test_the_result_holds_flights_and_predictions_as_series():
    campaign = begun()
    campaign.attach(by_hand(30))
    result = json.loads(to_json(summary(campaign, {}, {})))
    for run, entry in zip(campaign.experiments, result["experiments"], strict=True):
        series, predicted = (
            entry["series"],
            campaign.twin.simulate(campaign.twin.as_flown(run.replayed, run.trajectory)),
        )
        assert series["t"] == run.trajectory.t.tolist() and series["states"] == run.trajectory.states.tolist()
        assert series["commands"] == run.trajectory.commands.tolist()
        assert series["simulated"] == predicted.states.tolist() and series["band"] == predicted.band.tolist()


def test_advice_is_a_value_of_the_campaign():
    campaign = begun()
    assert (
        campaign.advice.gain is None and campaign.advice.before_test is None and campaign.advice.stop is None
    )
    test = campaign.ask()
    campaign.tell(test, PLANT.run(test))
    advice = campaign.advice
    assert advice.before_test == test.number and advice.trusted and advice.scatter > 0.0
    assert advice.gain == campaign.history[0].asked[0].gain and advice.stop is (advice.gain <= advice.scatter)
    plant_of_paper = new_of("paper")
    first = plant_of_paper.test(GAINS)
    plant_of_paper.tell(first, PLANT.run(first))
    assert plant_of_paper.advice is None


def test_a_twin_that_is_not_to_be_believed_now_gives_no_advice():
    plan = SimpleNamespace(test=1, gain=0.1, predicted=1.0)

    def trusted(*lessons, commanded=True):
        twin = SimpleNamespace(law=SimpleNamespace(commanded=commanded))
        return assessed(twin, None, lessons, None).trusted

    def lesson(*remarks, follows=True):
        return SimpleNamespace(asked=[plan], follows=follows, remarks=remarks)

    said, grave = note("known-before", "The earlier twin is kept."), serious("free-run", "It misses.")
    assert trusted(lesson()) and trusted(lesson(grave), lesson(said))
    assert not trusted(lesson(), lesson(said, grave)) and not trusted(lesson(), lesson(follows=False))
    # All gains are as good on a twin in which no command acts.
    assert not trusted(lesson(), commanded=False)


def test_a_twin_of_a_system_that_never_answered_follows_nothing_and_gives_no_advice_to_stop():
    campaign = made()
    test = campaign.test(GAINS)
    for _ in range(2):
        campaign.tell(test, dead(PLANT.run(test)))
        test = campaign.ask()
    assert not campaign.twin.follows and not campaign.history[-1].follows
    assert campaign.advice.stop is None and not campaign.advice.trusted
    assert {"never-moved", "does-not-follow"} <= {each.code for each in campaign.twin.remarks if each.serious}
    failed = {check.name for check in campaign.checks() if not check.passed}
    assert {"follows", "remarks"} <= failed
    twin, _, following = verdict(campaign)
    assert "do not trust it. Commands moved and nothing answered" in twin and "stop" not in following


def test_the_errors_of_the_report_are_those_of_whole_flights():
    campaign = begun().run(PLANT, 2)
    off = [run.trajectory.states - campaign.twin.simulate(run.test).states for run in campaign.experiments]
    np.testing.assert_allclose(
        campaign.rmse, np.sqrt(np.mean(np.square(np.concatenate([o[1:] for o in off])), axis=0))
    )


def verdict(campaign):
    lines = str(campaign).split("\n\n")[1].splitlines()
    assert [line.partition(":")[0] for line in lines] == ["Twin", "Controller", "Next"]
    return lines


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_printed_campaign_is_the_report_and_begins_with_a_verdict(preset):
    campaign = new_of(preset)
    assert str(campaign) == repr(campaign) == f"Campaign(preset={preset!r}, seed=0, experiments=0)"
    first = campaign.test(GAINS)
    campaign.tell(first, PLANT.run(first))
    twin, controller, following = verdict(campaign)
    assert "do not trust it" in twin and "measured" in controller and following
    assert twin.endswith(" All checks: print(campaign.checks())")
    assert "d rate / dt" in str(campaign) or preset == "paper"
    assert repr(campaign) == f"Campaign(preset={preset!r}, seed=0, experiments=1)"


def test_the_verdict_says_that_a_twin_is_not_to_be_believed_and_that_there_is_no_controller():
    campaign = made()
    for seed in range(3):
        test = campaign.test({**GAINS, "angle.kp": 1.0 + seed})
        run, stream = cut(PLANT.run(test), 9, "diverged", "ran away"), np.random.default_rng(seed)
        wrong = 0.5 * stream.normal(size=run.commands.shape)
        campaign.tell(test, tl.Trajectory(run.t, run.states, wrong, ended="diverged", reason="ran away"))
    twin, controller, following = verdict(campaign)
    assert "do not trust it" in twin and "none to fly" in controller and "another controller" in following


def test_a_campaign_draws_itself(tmp_path):
    campaign = begun()
    campaign.attach(by_hand(30))
    campaign.plot(tmp_path / "runs.svg")
    text = (tmp_path / "runs.svg").read_text(encoding="utf-8")
    assert ElementTree.fromstring(text).tag.endswith("svg")
    assert "test 0" in text and "log 1" in text and "integrated absolute error" in text
    with pytest.raises(tl.InvalidInput, match="to end in"):
        campaign.plot(tmp_path / "runs.gif")

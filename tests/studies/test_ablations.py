"""Ablations: each idea can be switched off, and what it buys is counted rightly."""

import dataclasses
import json
import math

import numpy as np
import pytest
from scipy import stats

from command import invoke
from twinloop.campaign.presets import DefaultOptions, options_of, parsed
from twinloop_exam.ablations import ABLATIONS, SMOKE_OPTIONS
from twinloop_exam.tables import as_text
from twinloop_exam.zoo import ablated, results
from twinloop_exam.zoo.ablated import MEASURES, bought, compared, missed_most_on, pairs_of, sign_test
from twinloop_exam.zoo.campaign import Job

FLOWN, ERROR, SECONDS = MEASURES
NAME = "lags"


def campaign(flown=1.0, error=0.1, seconds=2.0, *, seed=0, plant="arm", without="", flights=5, made=None):
    """A made-up campaign: the third flight is the best of its first three."""
    rows = [
        {
            "ended": "completed",
            "flown": flown if k == 2 else max(9.0, flown),
            "error": error,
            "ask_seconds": seconds,
        }
        for k in range(flights if made is None else made)
    ]
    return {
        "plant": plant, "seed": seed, "without": without, "flights_asked": flights, "optimum_under_noise": 0.5,
        "flights": rows, "failure": None if made is None else "it failed", "version": "1",
    }  # fmt: skip


def pairs(ratios, **which):
    """Pairs in which the idea is missed by such ratios of what was flown."""
    return [
        (campaign(2.0, seed=seed, **which), campaign(2.0 * ratio, seed=seed, without=NAME, **which))
        for seed, ratio in enumerate(ratios)
    ]


# The list


@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_changes_the_preset_and_can_be_written_on_the_command_line(name):
    found = options_of("default", ABLATIONS[name].options)
    assert found != options_of("default")
    written = dict(setting.split("=") for setting in ABLATIONS[name].settings)
    assert (
        options_of("default", {key: parsed("default", key, text) for key, text in written.items()}) == found
    )


def test_no_two_ablations_switch_off_the_same():
    every = [tuple(sorted(each.options.items())) for each in ABLATIONS.values()]
    assert len(set(every)) == len(every) and len({each.without for each in ABLATIONS.values()}) == len(every)


def test_each_switch_of_the_preset_is_switched_off_by_an_ablation_of_its_own():
    switches = {field.name for field in dataclasses.fields(DefaultOptions) if field.default is True}
    alone = {name for each in ABLATIONS.values() if len(each.options) == 1 for name in each.options}
    assert len(switches) > 20 and switches <= alone


# What it buys


@pytest.mark.parametrize("better", range(9))
@pytest.mark.parametrize("worse", range(9))
def test_the_sign_test_is_scipys(better, worse):
    expected = stats.binomtest(better, better + worse).pvalue if better + worse else 1.0
    assert sign_test(better, worse) == pytest.approx(expected, rel=1e-12)


def test_the_median_of_ratios_and_the_shares_are_numpys():
    ratios = np.exp(np.random.default_rng(3).normal(0.05, 0.1, 25))
    found = bought(pairs(ratios), FLOWN)
    assert found.ratio == pytest.approx(np.median(ratios)) and found.pairs == 25
    assert (found.better, found.worse) == ((ratios > 1.001).sum(), (ratios < 1.0 / 1.001).sum())
    assert found.chance == pytest.approx(stats.binomtest(found.better, found.better + found.worse).pvalue)


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ([1.1] * 6, "buys"),
        ([0.9] * 6, "costs"),
        ([1.1] * 5, "no difference seen"),  # 1 in 16 by luck
        ([1.1] * 5 + [0.9] * 4, "no difference seen"),
        ([1.1] * 6 + [1.0005] * 30, "buys"),  # those that are alike count on neither side
        ([1.0] * 30, "no difference seen"),
    ],
)
def test_an_idea_buys_what_luck_seldom_does(ratios, verdict):
    assert bought(pairs(ratios), FLOWN).verdict == verdict


def test_a_campaign_that_never_flies_or_fails_is_infinitely_worse():
    lost = campaign(math.inf, without=NAME)
    assert bought([(campaign(), lost)], FLOWN) == ablated.Bought(math.inf, 1, 0, 1)
    assert bought([(lost, campaign())], FLOWN) == ablated.Bought(0.0, 0, 1, 1)
    assert bought([(lost, lost)], FLOWN) == ablated.Bought(1.0, 0, 0, 1)
    failed = campaign(1.0, without=NAME, made=3)
    assert bought([(campaign(2.0), failed)], FLOWN).ratio == 0.5
    assert bought([(campaign(), failed)], ERROR).ratio == math.inf
    nothing = campaign(error=0.0)
    assert bought([(nothing, campaign())], ERROR).ratio == math.inf
    assert bought([(nothing, nothing)], ERROR).ratio == 1.0


def test_what_was_not_measured_does_not_count():
    short = campaign(flights=2)
    for measure in (FLOWN, ERROR):
        found = bought([(short, short)], measure)
        assert found.pairs == 0 and math.isnan(found.ratio)
    assert bought([(short, short)], SECONDS).pairs == 1
    unjudged = campaign(error=None)
    assert bought([(unjudged, campaign()), (campaign(), campaign())], ERROR).pairs == 1


def test_campaigns_are_compared_on_the_same_plant_with_the_same_seed():
    ones = [
        campaign(seed=0), campaign(seed=1), campaign(seed=1, plant="gene"),
        campaign(seed=1, without=NAME), campaign(seed=2, without=NAME), campaign(seed=0, without="hidden"),
        campaign(seed=0, without=NAME, flights=4),
    ]  # fmt: skip
    assert pairs_of(NAME, ones) == [(ones[1], ones[3])]


def test_the_plant_on_which_it_is_missed_most_is_that_of_the_worst_median():
    several = (
        pairs([1.0, 1.2, 3.0], plant="arm")
        + pairs([1.3, 1.3, 1.3], plant="gene")
        + pairs([0.2], plant="heater")
    )
    assert missed_most_on(several) == "gene"
    assert missed_most_on(pairs([1.0, 0.9])) is missed_most_on([]) is None


def test_the_table_has_what_was_compared():
    several = [one for pair in pairs([1.1] * 8 + [0.9] * 2) for one in pair]
    rows = compared([NAME, "hidden"], several)
    assert rows[0]["campaigns"] == rows[0]["changed"] == 10 and rows[1]["campaigns"] == 0
    assert rows[0]["flown"]["verdict"] == "no difference seen"  # 8 of 10: 11 % by luck
    assert rows[0]["error"]["ratio"] == rows[0]["seconds"]["ratio"] == 1.0
    shown = ablated.table("zoo", rows)
    (lags, hidden) = shown.rows
    assert lags[:2] == [f"lags: {ABLATIONS['lags'].without}", "10, 10 changed"]
    assert lags[2:4] == ["1.1; 80 % better, 20 % worse", "no difference seen"]
    assert lags[-1] == "arm" and set(hidden[2:]) == {"–"}
    assert all(len(row) == len(shown.head) for row in shown.rows)
    assert "missed most on" in as_text(shown) and json.dumps(rows)


# The verb


def test_a_smoke_run_flies_with_and_without():
    answer = invoke(
        "bench", "zoo", "--smoke", "--plants", "heater", "--ablation", "backtracking,tuning", "--json"
    )
    assert answer.exit_code == 0, answer.output
    found = json.loads(answer.stdout)
    assert [row["ablation"] for row in found["ablations"]] == ["backtracking", "tuning"]
    for row in found["ablations"]:
        assert row["campaigns"] == row["seconds"]["pairs"] == 1 and row["flown"]["verdict"] is None
    # Constants of the few readings of a smoke run are others once they are tuned.
    assert found["ablations"][1]["changed"] == 1


def test_what_is_switched_off_is_kept_beside_the_whole_preset(tmp_path):
    whole, without = Job("heater", 3), Job("heater", 3).ablated(NAME)
    assert without.name == "heater, seed 3, without lags" and dict(without.options) == {"lags": False}
    for job, flown in ((whole, 1.0), (without, 1.5)):
        found = campaign(flown, plant="heater", seed=3, without=job.without)
        results.keep(job, {**found, "options": job.asked}, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"heater-3-5.json", "heater-3-5-without-lags.json"}
    arguments = ("bench", "zoo", "--plants", "heater", "--seeds", "3", "--results", str(tmp_path))
    answer = invoke(*arguments, "--ablation", NAME, "--table", "text")
    assert answer.exit_code == 0 and "1.5; 100 % better, 0 % worse" in answer.stdout
    assert "3 campaigns" not in answer.stdout
    # An idea that is switched off in another way by now was measured by nobody.
    results.keep(without, {**found, "options": {"lags": True}}, tmp_path)
    refused = invoke(*arguments, "--ablation", NAME, "--table", "text")
    assert refused.exit_code == 2 and "other options" in refused.stderr


def test_all_ideas_or_those_that_are_named_are_switched_off(tmp_path):
    arguments = ("bench", "zoo", "--plants", "heater", "--results", str(tmp_path), "--table", "json")
    answer = invoke(*arguments, "--ablation", "all")
    assert [row["ablation"] for row in json.loads(answer.stdout)["ablations"]] == list(ABLATIONS)
    refused = invoke(*arguments, "--ablation", "lags,lagz")
    assert refused.exit_code == 2 and "'lags'" in refused.stderr


def test_an_idea_is_off_in_a_smoke_run_too():
    job = Job("heater", 0, options=tuple(SMOKE_OPTIONS["default"].items())).ablated("annealing")
    assert dict(job.options)["moves"] == 100 and dict(job.options)["libraries"] == ("linear", "quadratic")

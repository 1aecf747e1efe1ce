"""The zoo's campaigns: what is measured of them, the bars, and the verb."""

import copy
import dataclasses
import json
import re

import numpy as np
import pytest

from command import invoke
from twinloop.law.twin import Twin
from twinloop_exam.library import monomials
from twinloop_exam.zoo import bars, honesty, optima, results
from twinloop_exam.zoo.campaign import Job
from twinloop_exam.zoo.held_out import held_out
from twinloop_exam.zoo.plants import plant

NAME = "end-stop"


def still(found):
    """A twin of which no driven state ever moves."""
    library = monomials([])
    coefficients = np.zeros((len(library.terms), len(found.signals.driven)))
    return Twin(library.model(coefficients, found.signals), found.signals)


@pytest.fixture(scope="module")
def end_stop():
    return plant(NAME)


@pytest.fixture(scope="module")
def flights(end_stop):
    system, test = end_stop.make(1), end_stop.test(end_stop.asked.first)
    return [(test, system.run(test))]


# What is measured


def test_held_out_controllers_are_those_that_the_plant_survives(end_stop):
    first, again = held_out(end_stop, 6), held_out(end_stop, 6)
    assert len(first.tests) == 6 <= first.tried
    assert [t.genes.tobytes() for t in first.tests] == [t.genes.tobytes() for t in again.tests]
    for test, states in zip(first.tests, first.states, strict=True):
        assert len(states) == test.steps + 1
        assert end_stop.truth.run(test).states.tobytes() == states.tobytes()


def test_a_twin_that_never_moves_has_the_error_one_and_does_not_diverge(end_stop):
    found = held_out(end_stop, 5).judged(still(end_stop))
    assert found.error == pytest.approx(1.0) and found.diverged == 0


def test_the_error_inside_the_envelope_is_of_the_controllers_that_keep_it(end_stop):
    found, twin = held_out(end_stop, 5), still(end_stop)
    for lost, inside in ((3, pytest.approx(1.0)), (5, None)):
        # Elsewhere from the first state on, beyond the envelope, where a twin at rest at the start is far off.
        states = [states + 2.0 if i < lost else states for i, states in enumerate(found.states)]
        judged = dataclasses.replace(found, states=states).judged(twin)
        assert judged.error > 2.0 and judged.error_inside == inside and judged.diverged == 0


def test_flights_count_as_repeated_where_a_start_that_is_hardly_off_leads_the_plant_along_them(end_stop):
    repeated, twin = held_out(end_stop, 5), still(end_stop)
    assert list(repeated.repeated) == [True] * 5
    assert repeated.judged(twin).error_repeated == repeated.judged(twin).error
    # The cart-pole's commands are sent as pulses: one that flips sends it another way.
    pulsed = plant("cart-pole")
    found, scales = held_out(pulsed, 5), np.array([state.scale for state in pulsed.truth.signals.states])
    assert list(found.repeated) == [False] * 5 and found.judged(still(pulsed)).error_repeated is None
    for test, states, kept in zip(found.tests, found.states, found.repeated, strict=True):
        start = test.initial_state + 1e-4 * scales * [1.0, -1.0, 1.0, -1.0]
        again = pulsed.truth.run(dataclasses.replace(test, initial_state=start)).states
        off, moved = ((other - states) / scales for other in (again, states[:1]))
        assert kept == ((off**2).mean() <= 0.01 * (moved**2).mean())


def test_an_equation_is_empty_where_its_state_moves(end_stop, flights):
    assert honesty.empty_equations(still(end_stop), flights) == ["velocity"]
    system = end_stop.make(1)
    resting = end_stop.test(end_stop.asked.first)
    resting = dataclasses.replace(resting, target_state=resting.initial_state, steps=5)
    assert honesty.empty_equations(still(end_stop), [(resting, system.run(resting))]) == []


def test_a_free_run_misses_by_more_than_noise_explains(end_stop, flights):
    assert honesty.misses(end_stop, still(end_stop), flights) > 1.0
    ((test, flight),) = flights
    # The truth flown twice with other noise differs by what noise explains.
    system = end_stop.make(2)
    other = system.run(test)
    off = np.sqrt(np.square(other.true_states - flight.true_states).mean(axis=0))
    assert (off < honesty.MATTERS * np.ptp(flight.true_states, axis=0)).all()


def test_quality_is_that_of_a_campaign_and_a_cut_flight_is_bad(end_stop):
    test = end_stop.test(end_stop.asked.first)
    run = end_stop.truth.run(test)
    gaps = np.abs(run.states[1:, 0] - test.target_state[0]).sum() * end_stop.signals.dt
    assert end_stop.judged(run, test) == pytest.approx(gaps, rel=1e-12)
    assert end_stop.quality_of_states(run.states[:10], test) == pytest.approx(10.0 * 0.87 * 2.4, rel=1e-12)


# Bars


def row(**changed):
    return {
        "ended": "completed", "left": False, "flown": 1.0, "gains_quality": 1.0, "best_test": 1.0,
        "gains_in_noise": 1.0, "best_test_in_noise": 1.0, "predicted": 1.0, "measured": 1.0, "spread": 0.01,
        "error": 0.1, "error_repeated": 0.1, "diverged": 0, "found": [], "false": [], "empty": [],
        "missed": 0.5, "missed_repeated": 0.5, "serious": [], "follows": True, "ask_seconds": 2.0, **changed,
    }  # fmt: skip


def campaign(rows, **changed):
    return {
        "plant": NAME, "seed": 0, "optimum": 1.0, "optimum_under_noise": 1.0, "held_out": [40, 50], "failure": None,
        "confident": False, "flights": [*rows, *(row() for _ in range(5 - len(rows)))], **changed,
    }  # fmt: skip


def verdicts(*campaigns):
    return [one["met"] for one in bars.judged(campaigns)]


def good():
    return campaign([
        row(flown=4.0, predicted=None, spread=None, error=1.0), row(flown=1.1, error=1.0, error_repeated=1.0),
        row(flown=1.04),
        row(flown=1.01, predicted=1.02, measured=1.0), row(flown=1.01, predicted=0.99, measured=1.0),
    ])  # fmt: skip


def test_a_good_campaign_meets_every_bar_but_the_share_within_two_spreads():
    # All of three flights within two spreads is more than 98 %: such a spread says too little.
    assert [one["measure"] for one in bars.judged([good()]) if one["met"] is False] == [
        "flown within two spreads of predicted, from the third flight on"
    ]


@pytest.mark.parametrize(
    ("place", "number", "change"),
    [
        (0, 2, {"flown": 1.06}),
        (2, 4, {}),
        (3, 4, {"best_test": 1.02}),
        (3, 4, {"best_test": None}),
        (4, 4, {"best_test_in_noise": 1.02}),
        (6, 3, {"predicted": 1.1}),
        (7, 4, {"error": 0.6}),
        (8, 4, {"error_repeated": 0.6}),
        (9, 4, {"error": 2.5}),
        (10, 4, {"diverged": 1}),
        (11, 2, {"false": ["lasting"], "found": ["lasting"]}),
        (12, 2, {"empty": ["velocity"]}),
        (13, 2, {"missed": "inf"}),
        (14, 2, {"missed_repeated": "inf"}),
        (16, 2, {"left": True}),
        (17, 2, {"ask_seconds": 61.0}),
    ],
)
def test_a_bar_is_missed_by_what_it_measures(place, number, change):
    one = copy.deepcopy(good())
    if place == 2:  # nothing ever flown comes near
        for each in one["flights"]:
            each["flown"] = 1.3
    if place == 6:  # the median of three
        one["flights"][4].update(change)
    if place == 10:
        one["held_out"] = [40, 40]
    one["flights"][number].update(change)
    assert verdicts(one)[place] is False


def test_what_is_said_excuses_a_lost_campaign_and_a_miss():
    one = good()
    for each in one["flights"]:
        each.update(flown=1.3, serious=["free-run"], missed="inf", missed_repeated="inf")
    assert verdicts(one)[2] is True and verdicts(one)[13:15] == [True, True]
    one["confident"] = True
    assert verdicts(one)[15] is False


def test_that_gains_elsewhere_are_still_open_is_said_of_a_twin_that_more_flights_made_worse():
    one = copy.deepcopy(good())
    one["flights"][4].update(error=2.5, noted=["identity"])
    assert verdicts(one)[9] is False
    one["flights"][4].update(noted=["elsewhere", "identity"])
    assert verdicts(one)[9] is True


def test_the_worst_campaigns_come_first():
    ones = [campaign([], seed=seed, optimum_under_noise=1.0 / (1.0 + seed)) for seed in (0, 3, 1, 2)]
    assert [one["seed"] for one in bars.worst(ones)] == [3, 2, 1]
    shown = bars.tables("zoo", ones)
    assert len(shown[0].rows) == len(bars.BARS) and shown[1].rows[0][0] == f"{NAME}, seed 3"


def test_the_error_inside_the_envelope_is_shown_where_every_campaign_has_it():
    later = campaign([])
    for each in later["flights"]:
        each["error_inside"] = 0.02
    for campaigns, shown in (([later], True), ([later, campaign([], seed=1)], False)):
        every = bars.tables("zoo", campaigns)[2]
        assert ("inside the envelope" in every.head) is shown and len(every.rows[0]) == len(every.head)
        assert ("0.02, 0.02" in every.rows[0]) is shown


# The verb


def test_a_smoke_run_flies_and_shows_every_bar():
    answer = invoke("bench", "zoo", "--smoke", "--plants", "heater,end-stop", "--json")
    assert answer.exit_code == 0, answer.output
    found = json.loads(answer.stdout)
    assert len(found["bars"]) == len(bars.BARS)
    assert {one["plant"] for one in found["worst"]} == {"heater", "end-stop"}
    for one in found["worst"]:
        assert one["failure"] is None and len(one["flights"]) == 2
        assert one["flights"][0]["flown"] == pytest.approx(optima.kept()[one["plant"]]["first"], rel=0.1)
        assert re.search(r"\[k\+1\]|'", one["equations"])
        assert all(each["error_inside"] == each["error"] for each in one["flights"])  # none of the two leaves


def test_what_is_kept_is_not_flown_again(tmp_path):
    job = Job(NAME, 4)
    results.keep(job, campaign([], seed=4), tmp_path)
    answer = invoke("bench", "zoo", "--plants", NAME, "--seeds", "4", "--results", str(tmp_path))
    assert answer.exit_code == 0 and "0 of 1 campaigns to fly" in answer.stderr
    assert "1 campaigns, 1 plants, 1 seeds" in answer.stdout
    results.path_of(job, tmp_path).write_text("{}")
    refused = invoke("bench", "zoo", "--plants", NAME, "--seeds", "4", "--results", str(tmp_path))
    assert refused.exit_code == 2 and "another one" in refused.stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--half", "other"], "half of the zoo"),
        (["--plants", "zebra"], "plant of the zoo"),
        (["--half", "tune", "--plants", "gene"], "plant of the zoo"),
        (["--seeds", "a"], "--seeds"),
        (["--table", "pdf"], "form of the tables"),
    ],
)
def test_what_there_is_not_is_refused(arguments, sentence):
    answer = invoke("bench", "zoo", *arguments)
    assert answer.exit_code == 2 and sentence in answer.output + answer.stderr

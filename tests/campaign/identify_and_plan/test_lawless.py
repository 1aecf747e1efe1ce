"""What is flown where gusts hide an axis' law: its gains stay as they are, its commands are excited as at first."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from oracles import same_bits
from twinloop.errors import NotAvailable, NotTrusted
from twinloop.planning.candidates import candidates

AXES = tl.Signals(
    [
        tl.State("a", "rad", 1.0, envelope=(-2.0, 2.0)),
        tl.State("b", "rad", 1.0, envelope=(-2.0, 2.0)),
        tl.State("p", "rad/s", 2.0, derivative_of="a", envelope=(-6.0, 6.0)),
        tl.State("q", "rad/s", 2.0, derivative_of="b", envelope=(-6.0, 6.0)),
    ],
    [tl.Command("u", "N m", (-1.0, 1.0)), tl.Command("v", "N", (-1.0, 1.0))],
    0.02,
)
GAINS = {
    f"{axis}.{kind}": (0.0, most) for axis in "ab" for kind, most in (("kp", 4.0), ("ki", 1.0), ("kd", 2.0))
}
OF_A, OF_B = ({name: 0.0 for name in GAINS if name[0] == axis} for axis in "ab")
FIRST = {"a.kp": 0.3, "a.ki": 0.0, "a.kd": 0.3, "b.kp": 0.3, "b.ki": 0.1, "b.kd": 0.5}
BRIEF = {"evaluations": 1500, "candidates": 128, "draws": 4}


def flown(test, seed, coupled=0.0, authority=0.5):
    """p' = 4 u - p / 2 (and what v does to it) and q' = v / 2 or less + gust, under the controller of a test."""
    draw, controller = np.random.default_rng(seed), test.controller()
    state, gust, noise = test.initial_state.copy(), 0.2 * draw.standard_normal(), 2e-3
    states, commands = [state + noise * draw.standard_normal(4)], []
    for _ in range(test.steps):
        u, v = controller.command(states[-1], test.target_state)
        commands.append((u, v))
        accelerations = np.array([4.0 * u - 0.5 * state[2] + coupled * v, authority * v + gust])
        state[:2] += AXES.dt * (state[2:] + 0.5 * AXES.dt * accelerations)
        state[2:] += AXES.dt * accelerations
        gust += -0.04 * gust + 0.2 * np.sqrt(AXES.dt) * draw.standard_normal()
        states.append(state + noise * draw.standard_normal(4))
    return tl.Trajectory(AXES.dt * np.arange(len(states)), np.array(states), np.array(commands))


def begun(gains=GAINS, options=BRIEF, signals=AXES, controller=None, **changes):
    family = controller or tl.controllers.PID(axes=[("a", "p"), ("b", "q")], gains=gains)
    return tl.Campaign(
        signals, controller=family,
        initial_state=[0.5, 0.3, 0.0, 0.0], target_state=np.zeros(4), duration=3.0, seed=3, threads=1,
        progress=None, options=options, **changes,
    )  # fmt: skip


def told(first=FIRST, coupled=0.0, **changes):
    campaign = begun(**changes)
    test = campaign.test(first)
    campaign.tell(test, flown(test, 30, coupled))
    return campaign


def gains_of(test, those):
    return {name: test.parameters[name] for name in those}


def codes(campaign):
    return [remark.code for remark in campaign.twin.remarks]


pytestmark = pytest.mark.filterwarnings("ignore::twinloop.RemarkWarning")


def test_they_stay_as_flown_until_a_stronger_excitation_has_shown_the_law():
    campaign = told(options={})
    test = campaign.ask()
    assert "unmoved" in codes(campaign)
    assert gains_of(test, OF_B) == {name: FIRST[name] for name in OF_B} and test.parameters["a.kp"] > 1.0
    assert test.reason.endswith("no law of b and q yet: b.kp, b.ki and b.kd stay as flown.")
    best = campaign.best_test
    assert best.parameters["a.kp"] > 1.0 and gains_of(best, OF_B) == gains_of(test, OF_B)
    assert best.reason.endswith("no law of b and q yet: b.kp, b.ki and b.kd stay as flown.")
    strongest = np.abs(test.excitation).max(axis=0)
    assert strongest[0] <= campaign.options.excitation_most < strongest[1]
    # Where a goes the twin foretells: that holds nothing back.
    assert set(test.hold_back.ranges(AXES)) == {"b", "q"}
    for seed in (31, 32):
        campaign.tell(test, flown(test, seed))
        test = campaign.ask()
    assert "unmoved" not in codes(campaign)
    assert test.parameters["b.kp"] > 1.0 and test.hold_back is None


@pytest.mark.parametrize(
    ("limited", "held_by"),
    [("abpq", "bq"), ("b", "bq"), ("ap", "ap"), ("", None)],
)
def test_states_without_a_law_hold_their_excitation_back_or_all_that_have_an_envelope(limited, held_by):
    """A rate has room as long as what it is the rate of has. Where nothing would, no such excitation is flown."""
    states = [state if state.name in limited else replace(state, envelope=None) for state in AXES.states]
    test = told(signals=replace(AXES, states=states)).ask()
    assert (test.hold_back and "".join(sorted(test.hold_back.ranges(AXES)))) == held_by
    assert (np.abs(test.excitation[:, 1]).max() > 0.1) == (held_by is not None)


def test_the_last_flight_has_no_excitation_and_keeps_them_too():
    test = told().ask(last=True)
    assert test.excitation is None and test.hold_back is None
    assert gains_of(test, OF_B) == {name: FIRST[name] for name in OF_B} and test.parameters["a.kp"] > 1.0


def test_gains_that_were_zero_stay_zero_and_their_commands_are_excited_all_the_same():
    """Where the flown controller sends nothing, the directions are those of the family."""
    test = told(first=FIRST | OF_B).ask()
    assert gains_of(test, OF_B) == OF_B and test.parameters["a.kp"] > 1.0
    # It begins as small as a first flight where nobody says how large: 0.02 of the scale, growing to 64 times that.
    assert np.abs(test.excitation[:, 1]).max() > 0.1


def test_flights_for_the_task_alone_are_excited_until_there_is_a_law():
    """Without an excitation nothing would be learnt of it, and its gains would stay as flown for ever."""
    campaign = begun(goal="control")
    test = campaign.test(FIRST)
    for seed in range(60, 63):
        campaign.tell(test, flown(test, seed, authority=0.08))
        test = campaign.ask()
        assert "unmoved" in codes(campaign) and np.abs(test.excitation[:, 1]).max() > 0.1


@pytest.mark.parametrize(
    ("options", "exploits"),
    [
        ({}, False),
        ({"excitation": 0.0}, True),
        ({"excitation_most": 0.0}, True),
        ({"hold_back": False}, True),
    ],
    ids=repr,
)
def test_flights_for_the_task_alone_are_the_best_gains_as_they_are_where_no_such_excitation_is_flown(
    options, exploits, monkeypatch
):
    campaign = begun(goal="control", options=BRIEF | options)
    test = campaign.test(FIRST)
    for seed in (60, 61):
        campaign.tell(test, flown(test, seed, authority=0.08))
        test = campaign.ask() if seed == 60 else test
    asked, planner = [], campaign._method.planner
    propose = planner.propose
    monkeypatch.setattr(planner, "propose", lambda *given: asked.append(given) or propose(*given))
    test = campaign.ask()
    assert "unmoved" in codes(campaign) and [given[5] for given in asked] == [exploits]
    assert gains_of(test, OF_B) == {name: FIRST[name] for name in OF_B}
    assert ("a stronger excitation" in test.reason) <= (test.excitation is not None)


def test_boxes_around_zero_are_no_way_round_it():
    """In the middle of such a box a controller answers to nothing."""
    test = told(gains={name: (-4.0, 4.0) for name in GAINS}, first=FIRST | OF_B).ask()
    assert gains_of(test, OF_B) == OF_B and test.parameters["a.kp"] > 1.0
    assert np.abs(test.excitation[:, 1]).max() > 0.1


class Crossed:
    """Two gains on a, one of which moves b, and a trim on b that is always sent."""

    def __init__(self, **gains):
        self.gains = gains

    def reset(self):
        """Nothing is remembered."""

    def command(self, reading, target):
        (a, b, p, q), of = target - reading, self.gains
        return [of["ka"] * a + of["da"] * p, of["kb"] * b + 0.5 * q + of["cross"] * a + of["trim"]]


def test_gains_that_make_no_difference_without_the_law_stay_too():
    """What they do to b, of which the twin knows nothing, would be left to chance."""
    boxes = {"ka": (0.0, 4.0), "da": (0.0, 2.0), "kb": (0.0, 4.0), "cross": (-1.0, 4.0), "trim": (-0.5, 0.5)}
    first = {"ka": 0.3, "da": 0.3, "kb": 0.3, "cross": 0.0, "trim": 0.05}
    campaign = told(controller=tl.controllers.Custom(Crossed, boxes), first=first)
    test, best = campaign.ask(), campaign.best_test
    assert "unmoved" in codes(campaign)
    for found in (test, best):
        assert gains_of(found, ("kb", "cross", "trim")) == {
            name: first[name] for name in ("kb", "cross", "trim")
        }
        assert found.parameters["ka"] > 1.0 and "kb, cross and trim stay as flown" in found.reason


def test_where_all_gains_answer_to_it_the_best_ones_fly_again_and_nobody_says_that_they_have_no_effect():
    fixed = {name: FIRST[name] for name in OF_A}
    first = {name: FIRST[name] for name in OF_B}
    campaign = told(gains=GAINS | fixed, first=first, coupled=0.8)
    test, best = campaign.ask(), campaign.best_test
    assert gains_of(test, OF_B) == gains_of(best, OF_B) == first
    assert test.hold_back is not None and np.abs(test.excitation[:, 1]).max() > 0.1
    assert "The twin knows no law of b and q yet" in test.reason
    assert "the twin knows no law of b and q yet" in best.reason
    assert all(
        "effect" not in one.reason and "what the commands do" not in one.reason for one in (test, best)
    )


def test_without_a_flown_test_there_are_no_gains_that_could_stay():
    """A log tells how a moves; what to fly on b it does not."""
    other = begun()
    campaign = begun()
    campaign.attach(flown(other.test(FIRST), 30))
    with pytest.raises(NotAvailable, match=r"a law of b and q, found neither: .* Fly a controller"):
        campaign.ask()
    with pytest.raises(
        NotTrusted, match="the twin knows no law of b and q yet, and no gains have completed a flight"
    ):
        _ = campaign.best_test


def test_after_an_interruption_gains_of_an_earlier_twin_stay_as_flown_there_too():
    """They may have been tuned on a twin that still had the law."""
    campaign = told()
    campaign.ask()
    method, best = campaign._method, campaign.experiments[0].test
    earlier = best.family.genes({**FIRST, "a.kp": 4.0, "a.kd": 1.2, "b.kp": 1.7})
    method.memory = replace(method.memory, gains=None, asked=replace(method.memory.asked, gains=earlier))
    found = method.best_test(campaign._book, at_once=True)
    assert found.parameters["a.kp"] == 4.0
    assert gains_of(found, OF_B) == {name: FIRST[name] for name in OF_B}


def test_without_an_excitation_a_flight_that_is_flown_again_varies_the_others_alone():
    campaign = told(options=BRIEF | {"excitation": 0.0})
    campaign.ask()
    method, book = campaign._method, campaign._book
    best = campaign.experiments[0].test
    committee = method._committee(book)
    drafts = candidates(
        method.planner, campaign.options, best.genes, method._flown(book, best, best.genes, committee), "both", 1, True,
        committee.lawless, committee.untunable,
    )  # fmt: skip
    again = drafts.genes[drafts.repeats :]
    held = np.isin(np.arange(best.family.size), committee.untunable)
    assert same_bits(again[:, held], np.tile(best.genes[held], (len(again), 1)))
    assert (again[:, ~held] != best.genes[~held]).any(axis=1).all() and not drafts.excitation.any()

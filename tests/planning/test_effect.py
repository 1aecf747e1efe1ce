"""Whether gains make a difference on a twin at all, which answer to a state, and what is flown where not all count."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from committees import TUNED, committee_of, member, planner_of, signals
from oracles import same_bits
from twinloop._ground.streams import Unit
from twinloop.planning.effect import answering, gains_count, without_effect
from twinloop.planning.excitation import (
    directions,
    directions_for,
    growing_chirps,
    slopes,
    usual_genes,
)
from twinloop.planning.proposal import Flown
from twinloop.planning.within import tune_within

KNOWN = signals()
IDLE, MOVED, WILD = member(KNOWN, 0.0), member(KNOWN, 1.0), member(KNOWN, 1.0, damping=-400.0)
"""Motors whose torque does nothing, whose torque turns them, and one that diverges under all gains."""


@pytest.mark.parametrize(
    ("members", "counted"),
    [([MOVED], True), ([IDLE], False), ([IDLE, IDLE], False), ([IDLE, MOVED], True), ([WILD], True)],
    ids=["acts", "idle", "all-idle", "acts-on-one", "diverges"],
)
def test_gains_count_where_flights_differ_by_them_or_diverge(members, counted):
    assert gains_count(planner_of(KNOWN), members) == counted


def test_where_gains_make_no_difference_the_best_ones_fly_again_as_strongly_excited_as_where_no_law_is_known():
    planner = planner_of(KNOWN)
    idle = replace(committee_of(KNOWN), members=[IDLE, IDLE], gains_count=False)
    flown = Flown(TUNED, True, [1.0], 100.0)
    amplitudes = []
    for committee in (idle, replace(idle, gains_count=True), replace(committee_of(KNOWN), trusted=False)):
        found = planner.propose(committee, TUNED, flown, "both", 3, exploit=False)
        assert found.excitation is not None
        amplitudes.append(float(np.abs(found.excitation).max()))
        if committee is idle:
            assert same_bits(found.genes, TUNED)
            assert "does not know yet what the commands do" in found.reason
    most = planner.options.excitation_unknown
    assert amplitudes[0] == pytest.approx(most, rel=0.05) and amplitudes[2] == pytest.approx(most, rel=0.05)
    assert amplitudes[1] <= planner.options.excitation_most


ARM = tl.Signals(
    [
        tl.State("a", "rad", 1.0, envelope=(-2.0, 2.0)),
        tl.State("b", "rad", 1.0),
        tl.State("p", "rad/s", 3.0, derivative_of="a"),
        tl.State("q", "rad/s", 3.0, derivative_of="b"),
    ],
    [tl.Command("left", "N m", (-9.0, 9.0)), tl.Command("right", "N m", (-9.0, 9.0))],
    0.02,
)
A, B, P, Q = range(4)
BOX = (0.0, 5.0)


def pid(box, rates=("p", "q")):
    gains = {f"{axis}.{kind}": box for axis in "ab" for kind in ("kp", "ki", "kd")}
    return tl.controllers.PID(axes=list(zip("ab", rates, strict=True)), gains=gains)


def cascade(box):
    gains = {f"{axis}.kp": box for axis in "ab"}
    gains |= {f"{rate}.{kind}": box for rate in "pq" for kind in ("kp", "ki", "kd")}
    return tl.controllers.Cascade(axes=[("a", "p"), ("b", "q")], gains=gains)


LAWS = {
    "pid": pid(BOX),
    "no-rates": pid(BOX, rates=(None, None)),
    "cascade": cascade(BOX),
    "feedback": tl.controllers.StateFeedback(
        states=["a", "b", "q"], gains={name: (-5.0, 5.0) for name in "abq"}
    ),
}


@pytest.mark.parametrize(
    ("law", "states", "names"),
    [
        ("pid", [B], "b.kp b.ki"),
        ("pid", [Q], "b.kd"),
        ("pid", [B, Q], "b.kp b.ki b.kd"),
        ("pid", [A, B], "a.kp a.ki b.kp b.ki"),
        ("pid", [], ""),
        ("no-rates", [B], "b.kp b.ki b.kd"),
        ("no-rates", [Q], ""),
        ("cascade", [B], "b.kp q.kp q.ki"),
        ("cascade", [Q], "q.kp q.ki q.kd"),
        ("feedback", [A], "a->left a->right"),
        ("feedback", [B, Q], "b->left b->right q->left q->right"),
    ],
)
def test_gains_answer_to_a_state_if_what_is_sent_while_it_is_off_depends_on_them(law, states, names):
    """Over two periods, so that rates that are differences, and integrals, are answered too."""
    family = LAWS[law].bind(ARM)
    found = answered(family, states, usual_genes(family), (0.3, -0.2, 0.0, 0.0))
    assert sorted(found) == sorted(names.split())


@pytest.mark.parametrize("most", [1e-3, 1.0, 1e2, 1e4])
def test_gains_that_saturate_their_command_answer_too(most):
    """Commands are within ±9; with 1e4 a ten-thousandth of a radian asks for more."""
    box = (0.0, most)
    expected = {
        pid(box): "b.kp b.ki",
        pid(box, rates=(None, None)): "b.kp b.ki b.kd",
        cascade(box): "b.kp q.kp q.ki",
    }
    for law, names in expected.items():
        family = law.bind(ARM)
        assert answered(family, [B], usual_genes(family)) == names.split()


def answered(family, states, beside, target=(0.0, 0.0, 0.0, 0.0)):
    """The names of the gains that answer to some states."""
    return [family.names[i] for i in answering(family, states, np.array(target), beside)]


class Law:
    """What every law in Python has."""

    def __init__(self, **gains):
        self.gains = gains

    def reset(self):
        """Nothing is remembered."""


class Trimmed(Law):
    """A law in Python: a trim that is always sent, and a gain for each axis."""

    def command(self, reading, target):
        off = target - reading
        return [self.gains["trim"] + self.gains["ka"] * off[A], self.gains["kb"] * off[B]]


def test_a_gain_that_is_sent_whatever_the_states_do_answers_to_none():
    family = tl.controllers.Custom(Trimmed, {name: (-1.0, 1.0) for name in ("trim", "ka", "kb")}).bind(ARM)
    assert answered(family, [B], usual_genes(family)) == ["kb"]
    # The rate of a that its target asks for is answered at the target, too.
    axes, moving = LAWS["pid"].bind(ARM), (0.0, 0.0, 0.4, 0.0)
    assert answered(axes, [B, Q], usual_genes(axes), moving) == ["b.kp", "b.ki", "b.kd"]


class Banded(Law):
    """A dead band around b's target, and a trim that saturates the command wherever it is large."""

    def command(self, reading, target):
        off = target - reading
        return [0.0, self.gains["trim"] + self.gains["kb"] * (off[B] if abs(off[B]) > 0.05 else 0.0)]


def test_a_dead_band_and_a_command_that_saturates_at_the_target_hide_no_gain():
    family = tl.controllers.Custom(Banded, {"trim": (0.0, 40.0), "kb": (0.0, 2.0)}).bind(ARM)
    usual = usual_genes(family)
    assert usual[0] > 9.0  # the usual controller sends the bound of its command, whatever b does
    flown = np.array([0.0, 0.5])
    # The trim, too: a large one saturates the command, and leaves b unanswered.
    assert answered(family, [B], flown) == ["trim", "kb"]
    assert answered(family, [A], flown) == []


def test_boxes_around_zero_hide_nothing_either():
    family = pid((-4.0, 4.0)).bind(ARM)
    assert not slopes(family, family.from_unit(np.full(6, 0.5)), np.zeros(4)).any()
    vectors, answers = directions_for(family, np.zeros(6), np.zeros(4), [B, Q])
    np.testing.assert_allclose(np.abs(vectors), [[0.0, 1.0]], atol=1e-12)
    assert answers.tolist() == [0.0]
    assert answered(family, [B, Q], np.zeros(6)) == ["b.kp", "b.ki", "b.kd"]


def test_gains_without_an_effect_are_those_that_change_no_flight():
    planner = planner_of(KNOWN)
    beside = usual_genes(planner.family)
    assert without_effect(planner, [IDLE], beside) == (0, 1, 2)
    assert without_effect(planner, [IDLE, MOVED], beside) == without_effect(planner, [MOVED], beside) == ()
    planner.task = replace(planner.task, initial_state=np.zeros(2))
    # At rest on the target only noise and the integral of nothing are answered: no gain makes a difference.
    assert without_effect(planner, [MOVED], beside) == (0, 1, 2)


def test_where_no_controller_of_a_family_answers_there_is_no_direction_and_nothing_is_added():
    family = LAWS["feedback"].bind(ARM)
    vectors, answers = directions_for(family, np.zeros(6), np.zeros(4), [P])
    assert len(vectors) == len(answers) == 0
    stream = Unit(1).part(1).stream("excitation")
    assert not growing_chirps(ARM, (vectors, answers), 100, 0.02, 0.3, 0.25, stream).any()


def test_directions_that_the_flown_gains_have_no_use_for_are_those_of_the_middle_of_the_box():
    family = LAWS["pid"].bind(ARM)
    genes = family.genes({name: 0.5 * (name[0] == "a") for name in family.names})
    vectors, answers = directions_for(family, genes, np.zeros(4), [B, Q])
    np.testing.assert_allclose(np.abs(vectors), [[0.0, 1.0]], atol=1e-12)
    assert answers.tolist() == [0.0]
    every, all_answers = directions_for(family, genes, np.zeros(4), [A, B, P, Q])
    assert len(every) == 2 and (all_answers == 0.0).sum() == 1


@pytest.mark.parametrize(("untunable", "counted"), [((), True), ((0, 1), True), ((0, 1, 2), False)])
def test_gains_that_cannot_be_tuned_do_not_count(untunable, counted):
    assert gains_count(planner_of(KNOWN), [MOVED], untunable) == counted


HELD = replace(committee_of(KNOWN), lawless=(0,), untunable=(1,))
"""As if the angle's law, and so what its integral is for, were not known."""
START = np.array([0.6, 0.7, 0.3])


def test_gains_that_cannot_be_tuned_stay_as_in_the_first_start_and_the_others_are_the_best_beside_them():
    planner = planner_of(KNOWN, evaluations=4000, draws=1, delay_margin=False)
    found, free = (planner.tune(committee, [START, TUNED], 1) for committee in (HELD, committee_of(KNOWN)))
    assert found[1] == START[1] != free[1]
    others = planner.family.from_unit(Unit(1).part(1).stream("candidates").uniforms(20_000, 3))
    others[:, 1] = START[1]
    judged = planner.judge(HELD.members, np.vstack([found, others]), HELD.sds, 1)
    kept = judged.worst_usage[1:] <= 1.0 - planner.options.margin
    assert judged.mean[0] <= 1.01 * judged.mean[1:][kept].min()


def test_so_they_do_where_gains_are_tuned_within_limits():
    bounds = np.array([[-0.9, -0.4], [0.9, 0.4]])
    found = tune_within(
        planner_of(KNOWN), planner_of(KNOWN).options, HELD, HELD.members, bounds, [START], 3, lambda: None
    )
    assert found[1] == START[1] and not same_bits(found, START)


@pytest.mark.parametrize("goal", ["both", "model"])
def test_a_proposal_keeps_them_as_flown_excites_what_has_no_law_as_a_first_flight_and_says_so(goal):
    flown = Flown(START, True, [1.0], 100.0)
    planner = planner_of(KNOWN)
    tuned = planner.tune(HELD, [START], 1)
    found = planner.propose(HELD, tuned, flown, goal, 3, exploit=False)
    assert found.genes[1] == START[1] and not same_bits(found.genes, START)
    assert "knows no law of angle yet: angle.ki stays as flown" in found.reason
    usual = planner.propose(committee_of(KNOWN), tuned, flown, goal, 3, exploit=False)
    assert "as flown" not in usual.reason
    most = planner.options.excitation_most
    assert np.abs(usual.excitation).max() <= most < np.abs(found.excitation).max()
    plain = planner.propose(HELD, tuned, flown, goal, 3, exploit=True, last=True)
    assert plain.excitation is None and plain.genes[1] == START[1]


def test_only_along_the_commands_that_answer_to_it():
    """Two axes with a command each, of which one has a law."""
    family = LAWS["pid"].bind(ARM)
    genes = np.full(6, 0.5)
    vectors, answers = directions_for(family, genes, np.zeros(4), [B, Q])
    np.testing.assert_allclose(np.abs(vectors), [[0.0, 1.0]], atol=1e-12)
    every, all_answers = directions(family, genes, np.zeros(4))
    assert len(every) == 2
    assert answers[0] == pytest.approx(np.sqrt(np.square(slopes(family, genes, np.zeros(4))[1]).sum()))
    assert any(answers[0] == pytest.approx(other) for other in all_answers)

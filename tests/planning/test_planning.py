"""The choice of tests: excitation that fades, gains in their box, quality as flown, proposals inside the envelope."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from committees import STEPS, TASK, TUNED, committee_of, family_of, member, planner_of, signals
from oracles import same_bits
from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.campaign.history import Experiment
from twinloop.flights import candidates, qualities
from twinloop.law.actuation import Actuation, Actuator, delayed
from twinloop.planning.candidates import candidates as drawn
from twinloop.planning.excitation import GROWTH, SHARE, binary, chirps, directions, growing_chirps
from twinloop.planning.gains import _dearer_outside, tune_gains
from twinloop.planning.judging import Committee
from twinloop.planning.proposal import Fared, Flown
from twinloop.planning.quality import KINDS, quality_of


def proposed(planner, committee, tuned=TUNED, goal="both", number=3, exploit=False, last=False, **changes):
    flown = Flown(**{"best": tuned, "flies": True, "usages": [1.0], "good": 1.0, **changes})
    return planner.propose(committee, tuned, flown, goal, number, exploit, last)


def usages(planner, committee, proposal):
    """Usage of the envelope on each member, flown once more."""
    flights = candidates(
        planner.family, proposal.genes[None], proposal.initial_state[None], proposal.target_state[None], STEPS,
        excitation=None if proposal.excitation is None else proposal.excitation[None],
    )  # fmt: skip
    return qualities(committee.members, flights, planner.quality.engine, planner.signals)[1][:, 0, 0]


# Excitation


@given(st.integers(2, 200), st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.integers(0, 99))
def test_an_excitation_keeps_its_amplitude_and_fades(steps, amplitude, fade, seed):
    two = tl.Signals(
        [tl.State("x", "m", 1.0)],
        [tl.Command("u", "V", (-2.0, 2.0)), tl.Command("w", "V", (0.0, 300.0), scale=50.0)],
        0.02,
    )
    for make in (chirps, binary):
        added = make(two, steps, amplitude, fade, Unit(seed, (0,)).stream("exam"))
        assert added.shape == (steps, 2) and np.isfinite(added).all()
        share = np.abs(added) / (np.array([2.0, 50.0]) * max(amplitude, 1e-300))
        assert (share <= 1.0 + 1e-12).all()
        left = (steps - np.arange(steps)) / steps / max(fade, 1.0 / steps)
        assert (share <= np.minimum(1.0, left)[:, None] + 1e-9).all()
        assert same_bits(added, make(two, steps, amplitude, fade, Unit(seed, (0,)).stream("exam")))


def test_the_first_excitation_is_the_tests_own_and_none_where_it_is_switched_off():
    planner = planner_of(signals())
    assert not same_bits(planner.first_excitation(0, TUNED)[0], planner.first_excitation(1, TUNED)[0])
    assert np.abs(planner.first_excitation(0, TUNED)[0]).max() <= planner.options.excitation_unknown
    # Where nothing holds it back it does not grow.
    free = planner_of(signals(), hold_back=False).first_excitation(0, TUNED)
    assert np.abs(free[0]).max() <= planner.options.excitation and free[1] is None
    assert planner_of(signals(), excitation=0.0).first_excitation(0, TUNED) == (None, None)


def three_axes(seed: int) -> tuple[tl.controllers.Family, Floats, Floats, Floats]:
    """A controller of three axes on four commands, its genes and target, and what it sends for shares of the envelope.

    In scales of the commands (4, 3).
    """
    random = np.random.default_rng(seed)
    known = tl.Signals(
        [
            tl.State(name, "rad", scale=3.0, envelope=(-width, width))
            for name, width in zip("abc", random.uniform(0.5, 4.0, 3), strict=True)
        ],
        [
            tl.Command(name, "N", (-9.0, 9.0), scale=size)
            for name, size in zip("uvwx", random.uniform(1, 5, 4), strict=True)
        ],
        0.02,
    )
    matrix = random.normal(size=(4, 3)) * [3.0, 0.5, 0.1]
    gains = {f"{name}.{term}": (0.0, 9.0) for name in "abc" for term in ("kp", "ki", "kd")}
    family = tl.controllers.PID([(name, None) for name in "abc"], gains, tl.controllers.Mixer(matrix)).bind(
        known
    )
    genes = np.tile([random.uniform(0.5, 2.0), 0.0, 0.0], 3)
    widths = np.array([state.envelope[1] for state in known.states])
    sizes = np.array([[command.scale] for command in known.commands])
    return family, genes, random.normal(size=3), matrix * genes[0] * widths / sizes


def grown(
    seed: int, share: float = 1.0, amplitude: float = 10.0, most: float = 1e6, flights: int = 0
) -> Floats:
    """An excitation of that controller with a share of its gains, in scales of the commands (100, 4)."""
    family, genes, target, _ = three_axes(seed)
    stream = Unit(seed, (0,)).stream("exam")
    sizes = np.array([command.scale for command in family.signals.commands])
    along = directions(family, share * genes, target)
    return growing_chirps(family.signals, along, 100, amplitude, most, 0.25, stream, flights) / sizes


@pytest.mark.parametrize("seed", range(5))
def test_each_direction_is_excited_as_strongly_as_the_controller_would_for_a_share_of_the_envelope(seed):
    family, genes, target, slopes = three_axes(seed)
    vectors, sent = directions(family, genes, target)
    # Oracle: the singular values; the fourth direction is of no use to three axes.
    left, values, _ = np.linalg.svd(slopes)
    assert sent[0] == 0.0
    np.testing.assert_allclose(sent[1:], values[::-1], rtol=1e-6)
    np.testing.assert_allclose(np.abs(np.sum(vectors[::-1].T * left, axis=0)), 1.0, rtol=1e-6)
    flat = grown(seed, most=0.0)
    off = np.linalg.pinv(slopes) @ flat.T
    largest = np.abs(np.linalg.svd(slopes)[2] @ off).max(axis=1)
    assert (largest <= SHARE + 1e-9).all() and (largest > 0.7 * SHARE).all()
    # The direction of no use has the size of the weakest one.
    assert 0.7 * SHARE * values[-1] < np.abs(flat @ left[:, 3]).max() <= SHARE * values[-1] + 1e-9
    assert not flat[0].any() and np.abs(flat[:2]).max() < 0.3 * np.abs(flat).max()
    # Ten times the authority, a tenth of the gain: a tenth of the excitation, which is ten times as strong.
    np.testing.assert_allclose(10.0 * grown(seed, 0.1, most=0.0), flat, rtol=1e-6, atol=1e-12)
    # Where the controller is made for little authority, the option is the limit.
    small = np.abs(grown(seed, amplitude=1e-6, most=0.0) @ left).max(axis=0)
    np.testing.assert_allclose(small, 1e-6, rtol=0.3)


@pytest.mark.parametrize("seed", range(5))
def test_it_grows_during_the_flight_and_the_next_flight_begins_half_way_and_grows_as_far_again(seed):
    flat, first, second = grown(seed, most=0.0), grown(seed), grown(seed, flights=1)
    moving = np.abs(flat) > 1e-9
    ratio = np.where(moving, first / np.where(moving, flat, 1.0), np.nan)
    # From one tenth of the flight to three quarters, as much in each period.
    expected = GROWTH ** np.clip((np.arange(100) / 100 - 0.1) / 0.65, 0.0, 1.0)
    np.testing.assert_allclose(ratio, np.where(moving, expected[:, None], np.nan), rtol=1e-6)
    again = np.where(moving, second / np.where(moving, first, 1.0), np.nan)
    # At each place it is no more than as many times as strong as the flight before was there.
    np.testing.assert_allclose(
        again, np.where(moving, np.sqrt(GROWTH * expected)[:, None], np.nan), rtol=1e-6
    )
    np.testing.assert_allclose(grown(seed, flights=2)[:10], GROWTH * first[:10], rtol=1e-6, atol=1e-12)
    # Up to the largest that is allowed, in every direction.
    _, _, _, slopes = three_axes(seed)
    left = np.linalg.svd(slopes)[0]
    assert np.abs(grown(seed, amplitude=0.1, most=0.3, flights=5) @ left).max() <= 0.3 + 1e-9


def test_a_controller_that_answers_no_error_does_not_limit_its_excitation():
    known = signals()
    family = family_of(known)
    along = directions(family, np.zeros(family.size), np.zeros(known.n_x))
    assert not along[1].any()
    added = growing_chirps(known, along, 100, 0.02, 0.02, 0.25, Unit(1, (0,)).stream("exam"))
    sizes = np.array([command.size for command in known.commands])
    assert 0.014 < np.abs(added / sizes).max() <= 0.02 + 1e-9


# Gains


@given(st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3))
def test_a_place_in_the_box_is_gains_within_their_bounds_and_back(places):
    family = family_of(signals())
    genes = family.from_unit(places)
    for value, gain in zip(genes, family.gains, strict=True):
        assert gain.low <= value <= gain.high
    np.testing.assert_allclose(family.to_unit(genes), places, atol=1e-12)


@pytest.mark.parametrize(
    ("places", "bounds"),
    [
        ([0.0, 1.0, 0.5], ["lower", "upper", ""]),
        ([0.009, 0.991, 0.009], ["lower", "upper", "lower"]),
        ([0.011, 0.989, 0.011], ["", "", ""]),
    ],
)
def test_a_gain_within_a_hundredth_of_its_range_is_at_a_bound_in_decades_where_they_matter(places, bounds):
    family = family_of(signals())
    assert family.at_bounds(family.from_unit(places)) == dict(
        zip(("angle.kp", "angle.ki", "angle.kd"), bounds, strict=True)
    )


def test_gains_are_tuned_to_the_bottom_of_a_bowl_and_never_worse_than_the_start():
    family = family_of(signals())
    bottom = np.array([0.3, 0.7, 0.5])

    def bowl(genes):
        squares = ((family.to_unit(genes) - bottom) ** 2).sum(axis=1)
        return np.stack([np.zeros(len(genes)), squares], axis=1)

    start = family.from_unit([0.9, 0.1, 0.9])
    how = {"spread": 0.2, "unit": Unit(1).part(0), "purpose": "gains"}
    genes = tune_gains(family, bowl, [start], evaluations=2000, **how)
    np.testing.assert_allclose(family.to_unit(genes), bottom, atol=0.02)
    genes = tune_gains(family, lambda g: np.ones((len(g), 2)), [start], evaluations=64, **how)
    assert same_bits(genes, start)


@pytest.mark.parametrize("height", [1.0, 1e-200])
def test_a_search_of_gains_ends_once_more_of_it_would_change_no_score(height):
    family, judged = family_of(signals()), []

    def bowl(genes):
        judged.extend(((family.to_unit(genes) - 0.4) ** 2).sum(axis=1).tolist())
        return np.stack([np.zeros(len(genes)), height * (1.0 + np.array(judged[-len(genes) :]))], axis=1)

    starts = [family.from_unit([0.9, 0.1, 0.9]), family.from_unit([0.1, 0.1, 0.1])]
    genes = tune_gains(
        family, bowl, starts, evaluations=20_000, spread=0.2, unit=Unit(1).part(0), purpose="gains"
    )
    assert ((family.to_unit(genes) - 0.4) ** 2).sum() == min(judged) < 1e-4
    assert 2 * 13 * 32 < len(judged) < 2500


def test_a_further_search_ends_once_it_is_behind_and_goes_on_where_it_is_ahead():
    family, judged = family_of(signals()), []
    # The second basin is the deeper one; a search from the other never meets it.
    basins = np.array([[0.2, 0.2, 0.2], [0.8, 0.8, 0.8]])

    def score(genes):
        squares = np.square(family.to_unit(genes)[:, np.newaxis] - basins).sum(axis=2)
        judged.append(len(genes))
        return np.stack([np.zeros(len(genes)), (squares + np.array([0.5, 0.1])).min(axis=1)], axis=1)

    def tuned(starts, patience):
        judged.clear()
        genes = tune_gains(
            family, score, [family.from_unit(basins[i] + 0.05) for i in starts], evaluations=20_000, spread=0.02,
            unit=Unit(1).part(0), purpose="gains", patience=patience,
        )  # fmt: skip
        return family.to_unit(genes), len(judged)

    patient, calls = tuned((1, 0), None)
    genes, fewer = tuned((1, 0), 5)
    assert same_bits(genes, patient) and fewer < calls
    # One evaluation of the first start, its whole search, then five generations.
    alone, whole = tuned((1,), None)
    assert same_bits(alone, genes) and fewer == whole + 5
    best, _ = tuned((0, 1), 5)
    np.testing.assert_allclose(best, basins[1], atol=0.02)


def test_what_lies_outside_the_box_is_dearer_the_further_out_whatever_the_scores_are():
    places = np.array([[0.5], [1.0], [1.5], [2.0], [-1.0], [-2.0]])
    for score in (0.0, 1e-200, 3.0, 1e200, -2.0):
        dearer = _dearer_outside(np.full(6, score), places)
        assert dearer[0] == dearer[1] == score < dearer[2] < dearer[3] == dearer[4] < dearer[5]
    assert np.isposinf(_dearer_outside(np.full(6, np.inf), places)).all()


# Quality


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("weights", [(), (2.0, 0.5)])
def test_a_flight_is_judged_alike_when_it_is_planned_and_when_it_was_flown(kind, weights):
    known = signals()
    quality = quality_of(kind, known, weights, effort=0.3, effort_rate=0.02)
    model, family = member(known, 1.0), family_of(known)
    test = tl.Test(family, TUNED, TASK.initial_state, TASK.target_state, STEPS)
    flights = candidates(family, TUNED[None], TASK.initial_state, TASK.target_state, STEPS)
    expected, used = (values[0, 0, 0] for values in qualities([model], flights, quality.engine, known))
    flown = tl.Twin(model, known).simulate(test)
    assert quality.flown(flown, TASK.target_state) == expected
    assert Experiment(test, flown, None, 1.0, None, None).usage == used


def test_the_integrals_count_what_a_task_is_about():
    assert quality_of("iae", signals()).weights.tolist() == [1.0, 0.0]
    assert quality_of("final_distance", signals()).weights.tolist() == [1.0, 1.0]
    mixed = tl.Signals(
        [tl.State("x", "m", 4.0), tl.State("a", "rad", 0.5)], [tl.Command("u", "V", (-1.0, 1.0))], 0.1
    )
    assert quality_of("iae", mixed).weights.tolist() == [0.25, 2.0]
    assert quality_of("ise", mixed).weights.tolist() == [0.0625, 4.0]


# Proposals


@pytest.mark.parametrize("goal", ["both", "model", "control"])
@pytest.mark.parametrize("number", range(3))
def test_a_proposal_keeps_the_margin_on_every_member(goal, number):
    known = signals(envelope=(-0.7, 0.7))
    planner, committee = planner_of(known), committee_of(known)
    found = proposed(planner, committee, goal=goal, number=number)
    assert found.safe and usages(planner, committee, found).max() <= 0.9 + 1e-9
    assert 0.0 < found.risk < 0.5 and np.isfinite(found.predicted) and found.reason.endswith(".")
    assert found.gain >= 0.0 and found.spread >= 0.0


def test_where_no_candidate_keeps_the_margin_the_safest_is_offered_and_said_so():
    known = signals(envelope=(-0.52, 0.52))  # the start alone uses 96 % of it
    planner, committee = planner_of(known), committee_of(known)
    found = proposed(planner, committee)
    assert not found.safe and "safest" in found.reason
    flights = candidates(planner.family, TUNED[None], TASK.initial_state, TASK.target_state, STEPS)
    quiet = qualities(committee.members, flights, planner.quality.engine, known)[1].max()
    assert 0.9 < usages(planner, committee, found).max() <= quiet


@pytest.mark.parametrize("goal", ["both", "model", "control"])
def test_where_the_first_flight_left_the_envelope_one_that_keeps_it_may_be_worse(goal):
    known = signals(rate=(-0.5, 0.5))
    planner, committee = planner_of(known, candidates=256), committee_of(known)
    wild = np.array([9.0, 2.0, 0.05])
    assert planner.judge(committee.members, wild[None], committee.sds, 1).worst_usage[0] > 1.0
    found = planner.propose(committee, TUNED, Flown(wild, False, [1.4], np.inf), goal, 3, False)
    assert found.safe and usages(planner, committee, found).max() <= 0.9 and found.predicted > 0.0
    # Where none keeps it, the one that uses least of it is offered, whether it has flown or not.
    planner = planner_of(signals(envelope=(-0.52, 0.52), rate=(-0.5, 0.5)))
    found = planner.propose(committee, TUNED, Flown(wild, False, [1.4], np.inf), goal, 3, False)
    assert not found.safe and "safest" in found.reason and not same_bits(found.genes, wild)


@pytest.mark.parametrize("exploit", [False, True])
def test_what_leaves_the_envelope_under_the_sensors_noise_is_passed_over(exploit):
    """Quick gains are the better ones without noise; with it they shake the rate out of its envelope."""
    known = signals(rate=(-0.6, 0.6), bounds=(-40.0, 40.0))
    quiet, loud = (
        Committee(committee_of(known).members, np.array(sds), True) for sds in ([1e-4, 5e-4], [3e-2, 0.5])
    )
    planner, quick = planner_of(known, candidates=256, draws=16, nearness=0.3), np.array([3.0, 0.1, 3.0])
    one, other = (
        proposed(planner, committee, quick, exploit=exploit, good=50.0) for committee in (quiet, loud)
    )

    def shaken(found):
        ends = found.initial_state[None], found.target_state[None]
        excitation = None if found.excitation is None else found.excitation[None]
        judged = planner.judge(loud.members, found.genes[None], loud.sds, 16, excitation, ends, measured=True)
        return judged.worst_usage[0], judged.mean[0]

    assert one.safe and shaken(one)[0] > 1.0
    usage, quality = shaken(other)
    assert other.safe and usage <= 1.0 and other.predicted == pytest.approx(quality)
    assert other.risk < one.risk + 0.1 and np.isfinite(other.predicted)


@pytest.mark.parametrize("exploit", [False, True])
@pytest.mark.parametrize("goal", ["both", "control"])
def test_where_the_twin_promises_less_than_was_flown_the_flown_gains_fly_again(goal, exploit):
    known = signals()
    planner, committee = planner_of(known), committee_of(known)
    flown, lazy = np.array([3.0, 0.2, 1.5]), np.array([0.1, 0.0, 3.0])
    quality = float(planner.judge(committee.members, TUNED[None], committee.sds, 1).mean[0])
    known_to_fly = Flown(flown, True, [1.0], 0.5 * quality)
    found = planner.propose(committee, lazy, known_to_fly, goal, 3, exploit)
    assert same_bits(found.genes, flown) and "again" in found.reason and found.excitation is not None
    # Where the twin promises more than that, it is followed.
    assert not same_bits(proposed(planner, committee, goal=goal, exploit=exploit).genes, flown)


def test_another_number_is_another_proposal_and_the_same_number_the_same():
    known = signals()
    planner, committee = planner_of(known), committee_of(known)
    one, two, again = (proposed(planner, committee, number=n) for n in (1, 2, 1))
    assert not same_bits(one.genes, two.genes) or not same_bits(one.excitation, two.excitation)
    assert same_bits(one.genes, again.genes) and one.predicted == again.predicted


def test_exploiting_flies_the_tuned_gains_as_they_are():
    known = signals()
    found = proposed(planner_of(known), committee_of(known), exploit=True)
    assert same_bits(found.genes, TUNED) and found.excitation is None


@pytest.mark.parametrize("goal", ["both", "model", "control"])
def test_where_the_tuned_gains_may_not_be_flown_the_last_test_is_the_best_of_the_others_without_excitation(
    goal,
):
    known = signals()
    planner, committee = planner_of(known), committee_of(known)
    found = proposed(planner, committee, goal=goal, exploit=True, last=True, failed=TUNED[np.newaxis])
    assert found.excitation is None and not same_bits(found.genes, TUNED)
    assert found.predicted < proposed(planner, committee, goal=goal, failed=TUNED[np.newaxis]).predicted
    # The tuned gains wait already: asked for once more, another test, and still nothing is added.
    again = proposed(planner, committee, goal=goal, last=True)
    assert again.excitation is None and not same_bits(again.genes, TUNED)
    if goal == "model":  # whose flights may cost more
        return
    # What was flown, where the twin promises less than that.
    flown, lazy = np.array([3.0, 0.2, 1.5]), np.array([0.1, 0.0, 3.0])
    quality = float(planner.judge(committee.members, TUNED[None], committee.sds, 1).mean[0])
    found = planner.propose(
        committee, lazy, Flown(flown, True, [1.0], 0.5 * quality), goal, 3, exploit=True, last=True
    )
    assert same_bits(found.genes, flown) and found.excitation is None
    assert found.reason.startswith("The best gains flown, again: they are known to fly.")
    left = Flown(flown, True, [1.0], 0.5 * quality, fared=Fared(3, 1))
    found = planner.propose(committee, lazy, left, goal, 3, exploit=True, last=True)
    assert found.reason.startswith(
        "The best gains flown, again, though 1 of their 3 flights did not keep the envelope to the end."
    )


def test_the_last_test_has_no_excitation_either_where_the_twin_does_not_follow():
    known = signals()
    planner, committee = planner_of(known), replace(committee_of(known), trusted=False)
    before = proposed(planner, committee)
    assert same_bits(before.genes, TUNED) and before.excitation is not None
    found = proposed(planner, committee, exploit=True, last=True)
    assert same_bits(found.genes, TUNED) and found.excitation is None
    assert found.reason.startswith("The best gains flown, again: they are known to fly.")


def test_a_committee_of_one_agrees_and_a_member_that_diverges_is_no_reason_to_crash():
    known = signals()
    planner = planner_of(known)
    alone = proposed(planner, Committee([member(known, 1.0)], np.array([1e-3, 5e-3]), True))
    assert alone.safe and "models agree on it" in alone.reason and alone.disagreement == 0.0
    # What is left of the spread is what the sensors' noise makes of a measurement.
    assert 0.0 < alone.spread < 0.1 * alone.predicted
    wild = member(known, 1.0, damping=-400.0)
    spoilt = proposed(planner, Committee([member(known, 1.0), wild], np.array([1e-3, 5e-3]), True))
    assert spoilt.safe and same_bits(spoilt.genes, alone.genes) and spoilt.predicted == alone.predicted
    found = proposed(planner, Committee([wild, member(known, 1.0)], np.array([1e-3, 5e-3]), True))
    assert not found.safe and found.predicted == np.inf and found.risk > 0.4 and "safest" in found.reason
    assert np.isfinite(found.genes).all() and found.spread == np.inf


def test_a_sensor_without_noise_divides_nothing_by_zero():
    known = signals()
    found = proposed(planner_of(known), Committee(committee_of(known).members, np.zeros(2), True))
    assert found.safe and np.isfinite(found.disagreement)


def test_gains_tuned_on_a_committee_beat_the_start_and_keep_the_margin():
    known = signals(envelope=(-0.7, 0.7))
    planner, committee = planner_of(known, evaluations=1000), committee_of(known)
    start = np.array([0.3, 1.5, 0.1])
    genes = planner.tune(committee, [start], 1)
    judged = planner.judge(committee.members, np.stack([genes, start]), committee.sds, 3)
    assert judged.mean[0] < judged.mean[1] and judged.worst_usage[0] <= 0.9 + 0.02
    same = planner.tune(committee, [start], 1)
    assert same_bits(genes, same)


def test_without_excitation_a_flight_that_is_flown_again_is_varied():
    known = signals()
    unsure = Committee(committee_of(known).members, np.array([1e-3, 5e-3]), False)
    planner = planner_of(known, excitation=0.0)
    found = proposed(planner, unsure)
    assert found.excitation is None and not same_bits(found.genes, TUNED)
    places = planner.family.to_unit(np.stack([found.genes, TUNED]))
    assert np.abs(places[0] - places[1]).max() < 0.2
    assert "small variation" in found.reason
    again = proposed(planner_of(known), unsure)
    assert same_bits(again.genes, TUNED) and again.excitation is not None


def test_flights_for_the_model_go_no_further_than_they_are_allowed_or_than_was_flown():
    known = signals()
    committee = committee_of(known)
    cases = (([0.5], 0.45), ([0.33], 0.43), ([0.33, 0.44, 0.4], 0.44), ([0.6], 0.6), ([0.01], 0.43))
    for used, most in cases:
        planner = planner_of(known, reach_far=0.45, reach_first=0.9, reach_least=0.43, reach_growth=1.3)
        found = proposed(planner, committee, goal="model", usages=used)
        flown = planner.judge(
            committee.members,
            found.genes[np.newaxis],
            committee.sds,
            1,
            None if found.excitation is None else found.excitation[np.newaxis],
        )
        assert found.safe and float(flown.worst_usage[0]) <= most + 1e-12


def cost(planner, committee, found, tuned=TUNED):
    """What a proposal is predicted to be worse than the tuned gains, as a share."""
    ends = found.initial_state[None], found.target_state[None]
    excitation = None if found.excitation is None else found.excitation[None]
    flown, tuned = (
        planner.judge(committee.members, genes[None], committee.sds, 1, added, ends).mean[0]
        for genes, added in ((found.genes, excitation), (tuned, None))
    )
    return flown / tuned - 1.0


def spent(goal="both", gains=(1.0, 0.5, 2.0), **options):
    """The dearest of three proposals, for members of some gains; the gains of the flights are tuned on these."""
    known = signals()
    committee = Committee([member(known, gain) for gain in gains], np.array([1e-3, 5e-3]), True)
    planner = planner_of(known, candidates=256, evaluations=2000, **options)
    tuned = planner.tune(committee, [TUNED], 1)
    found = [proposed(planner, committee, tuned, goal=goal, number=n, good=5.0) for n in range(3)]
    return max(cost(planner, committee, one, tuned) for one in found)


def test_no_flight_is_predicted_to_be_worse_by_more_than_the_stated_share():
    """Members that know little would pay any price for more."""
    assert (
        spent(worse=0.02) <= 0.02 + 1e-9 < spent(worse=0.05) <= 0.05 + 1e-9 < spent(worse=0.5) <= 0.5 + 1e-9
    )


def test_what_is_known_well_enough_is_not_paid_for():
    sure, unsure = (1.0, 1.0001), (1.0, 0.5, 2.0)
    assert spent(gains=sure, worse=0.5) < 0.01 < 0.05 < spent(gains=unsure, worse=0.5)
    assert spent(gains=unsure, worse=0.5, accuracy=1.0) < spent(gains=unsure, worse=0.5)


def test_flights_for_the_controller_alone_pay_for_no_twin():
    assert spent("control", worse=0.5) < 0.5 * spent("both", worse=0.5)


def test_no_flight_is_planned_that_is_worse_than_the_best_one_flown():
    known = signals()
    planner, committee = planner_of(known, candidates=256), committee_of(known)
    quality = float(planner.judge(committee.members, TUNED[None], committee.sds, 1).mean[0])
    found = proposed(planner, committee, good=quality)
    assert cost(planner, committee, found) <= 0.05 and "again" not in found.reason
    # Where the gains that the twin prefers are not as good as what was flown, others on the way back to it fly.
    poor = np.array([0.1, 0.0, 3.0])
    found = proposed(planner, committee, poor, best=TUNED, good=quality)
    assert (
        cost(planner, committee, found) <= 0.05 < 1.0 < cost(planner, committee, replace(found, genes=poor))
    )
    assert np.abs(found.genes - TUNED).max() < np.abs(found.genes - poor).max()
    # Where nothing that the twin promises is as good, what was flown flies again.
    assert "again" in proposed(planner, committee, poor, best=TUNED, good=0.5 * quality).reason


def test_where_the_tuned_gains_go_further_than_is_believed_some_on_the_way_to_them_fly():
    known = signals(rate=(-1.0, 1.0))
    planner, committee = planner_of(known, candidates=256, within=False), committee_of(known)
    far, near = np.array([9.0, 0.0, 0.5]), np.array([0.3, 0.0, 1.0])
    both = planner.judge(committee.members, np.stack([far, near]), committee.sds, 1)
    slow = float(both.mean[1])
    assert both.worst_usage[1] < planner.options.reach_first < both.worst_usage[0]
    found = proposed(planner, committee, far, best=near, good=slow, usages=[0.3])
    assert found.safe and found.predicted < 0.8 * slow
    assert usages(planner, committee, found).max() <= planner.options.reach_first
    straight = planner_of(known, candidates=256, nearness=0.01, backtracking=False, within=False)
    found = proposed(straight, committee, far, best=near, good=slow, usages=[0.3])
    assert "again" in found.reason and found.genes.tobytes() == near.tobytes()


def test_gains_that_fly_again_are_excited_more_each_time_up_to_a_limit():
    planner, amplitudes = planner_of(signals(), excitation=0.01), []
    for times in (1, 2, 3, 9):
        flown = Flown(TUNED, True, [1.0], 1.0, times=times)
        drafts = drawn(planner, planner.options, TUNED, flown, "both", 3)
        repeated = drafts.excitation[drafts.repeats :]
        assert same_bits(drafts.genes[drafts.repeats :], np.tile(TUNED, (len(repeated), 1)))
        amplitudes.append(float(np.abs(repeated).max()))
    most = planner.options.excitation_most
    assert amplitudes == pytest.approx([0.02, 0.04, most, most], rel=0.05)
    # What taught no law, and is held back in flight, begins where the one before ended, and grows.
    flown, first = Flown(TUNED, True, [1.0], 1.0), []
    for options in (planner.options, replace(planner.options, hold_back=False)):
        drafts = drawn(planner, options, TUNED, flown, "both", 3, leads=False)
        first.append(float(np.abs(drafts.excitation[drafts.repeats :]).max()))
    assert first == pytest.approx([planner.options.excitation_unknown, 0.02], rel=0.05)


def test_more_delay_is_whole_periods_of_delay_and_a_lag_of_what_is_left():
    known = signals()
    model = member(known, 2.0)
    late = _core.Model(model.program, model.form, known.engine, [Actuator(0.02, 1)], [], model.offsets)
    for periods, lag, delay in ((1.0, 0.02, 2), (0.5, 0.045, 1), (1.25, 0.0325, 2)):
        (actuator,) = Actuation.of(delayed(late, known, periods), known).actuators
        assert actuator.delay == delay and actuator.lag == pytest.approx(lag)


def test_gains_bear_a_period_more_of_delay_as_long_as_no_prediction_has_come_true():
    known = signals()
    # So quick that a period more of delay makes the best gains of the law as it is unstable.
    quick = _core.Model(member(known, 40.0).program, "acceleration", known.engine)
    slow = delayed(quick, known)
    sds, planner = np.array([1e-3, 5e-3]), planner_of(known, evaluations=2048)
    gentle = np.array([0.2, 0.0, 0.1])
    tuned, wary = (
        planner.tune(Committee([quick], sds, True, late, tuned_delayed=late), [gentle], 1)
        for late in ((), (slow,))
    )
    # Those that only have to keep the envelope with it are better without it.
    able = planner.tune(Committee([quick], sds, True, (slow,)), [gentle], 1)

    def worth(genes, model):
        return float(planner.judge([model], genes[None], sds, 1).mean[0])

    assert worth(tuned, quick) < worth(able, quick) < worth(wary, quick) < worth(gentle, quick)
    usage = planner.judge([slow], np.stack([able, tuned]), sds, 1).worst_usage
    assert usage[0] <= 1.0 - planner.options.margin < usage[1]
    assert worth(wary, slow) < 2.0 * worth(wary, quick)
    assert not worth(tuned, slow) < worth(wary, slow)
    # A flight that does not bear it is not proposed, but gains that fly are.
    found = proposed(planner, Committee([quick], sds, True, (slow,)), tuned=tuned, best=gentle)
    assert found.genes.tobytes() != tuned.tobytes()

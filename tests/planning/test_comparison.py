"""Which candidate flies next, beside slow flights of every candidate on a committee of three and the rules in words."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from committees import MOTORS, STEPS, TASK, TUNED, committee_of, member, planner_of, signals
from oracles import rk4, same_bits
from twinloop.planning.candidates import candidates
from twinloop.planning.comparison import TRIED, Comparison, _spaced
from twinloop.planning.gusts import Moved
from twinloop.planning.proposal import Flown, Wanted
from twinloop.planning.reach import reach_of
from twinloop.planning.seen import Seen

KNOWN = signals(envelope=(-0.9, 0.9), rate=(-1.5, 1.5))
DRAWS = 3
PLANNER = planner_of(KNOWN, candidates=24, draws=DRAWS)
COMMITTEE = committee_of(KNOWN)
FLOWN = Flown(best=np.array([3.0, 0.2, 1.5]), flies=True, usages=[0.7], good=0.5)


def drafts(flown=FLOWN, goal="model", number=3, trusted=True):
    return candidates(PLANNER, PLANNER.options, TUNED, flown, goal, number, trusted)


def compared(
    committee=COMMITTEE, flown=FLOWN, goal="model", number=3, exploit=False, plain=False, drawn=None
):
    drawn = drafts(flown, goal, number, committee.trusted) if drawn is None else drawn
    wanted = Wanted(goal, number, exploit, plain)
    return Comparison(PLANNER, PLANNER.options, committee, drawn, flown, wanted)


def flight(motor, genes, excitation, noise):
    """A flight in a plain loop: true states and readings (STEPS + 1, 2), and commands as they were sent."""
    gain, damping = motor
    test = tl.Test(PLANNER.family, genes, TASK.initial_state, TASK.target_state, STEPS, excitation)
    controller = test.controller()
    controller.reset()
    states, readings, commands = [np.array(TASK.initial_state)], [], []
    for k in range(STEPS):
        readings.append(states[-1] + noise[k])
        (torque,) = controller.command(readings[-1], test.target_state)
        states.append(
            rk4(lambda x, u=torque: np.array([x[1], gain * u - damping * x[1]]), states[-1], KNOWN.dt)
        )
        commands.append([torque])
    return np.array(states), np.array([*readings, states[-1] + noise[STEPS]]), np.array(commands)


def judged(drawn, noises, measured, motors=MOTORS):
    """Qualities and usages of the envelope (members, draws, candidates), flight by flight."""
    times, bounds = KNOWN.dt * np.arange(STEPS + 1), [0.9, 1.5]
    shape = len(motors), len(noises), len(drawn.genes)
    qualities, usages = np.empty(shape), np.empty(shape)
    for place in np.ndindex(shape):
        m, d, k = place
        excitation = drawn.excitation[k] if drawn.excitation[k].any() else None
        states, readings, commands = flight(motors[m], drawn.genes[k], excitation, noises[d])
        flown = tl.Trajectory(times, readings if measured else states, commands)
        qualities[place] = PLANNER.quality.flown(flown, TASK.target_state)
        usages[place] = np.abs(states / bounds).max()
    return qualities, usages


QUIET = np.zeros((1, STEPS + 1, 2))


def test_every_candidate_is_flown_on_every_member():
    drawn = drafts()
    qualities, usages = judged(drawn, QUIET, measured=False)
    found = compared(drawn=drawn).quiet
    np.testing.assert_allclose(found.qualities, qualities, rtol=1e-9)
    np.testing.assert_allclose(found.usages, usages, rtol=1e-9)


@pytest.mark.parametrize("sds", [(1e-3, 5e-3), (0.2, 1.0)], ids=["calm sensors", "loud sensors"])
@pytest.mark.parametrize("good", [0.5, 3.0])
@pytest.mark.parametrize("number", [3, 4])
def test_for_the_model_the_flight_that_tells_most_of_those_that_last_is_chosen(number, good, sds):
    flown, committee = replace(FLOWN, good=good), replace(COMMITTEE, sds=np.array(sds))
    drawn = drafts(flown, number=number)
    quiet, usage = judged(drawn, QUIET, measured=False)
    noisy, shaken = judged(drawn, PLANNER.noise(committee.sds, DRAWS, ()), measured=True)
    options = PLANNER.options
    # One for the model may cost what the best flight has cost and a little, or as much again as is promised.
    most = max((1.0 + options.worse) * good, 2.0 * quiet[:, 0, 0].mean())
    # It goes no further than the first flight has, somewhat more, nor beyond the margin.
    reach = max(min(options.reach_far, options.reach_growth * 0.7), options.reach_least, 0.7)
    found = compared(committee, flown, number=number, drawn=drawn)
    lasts = [
        k
        for k in range(1, len(drawn.genes))
        if usage[:, 0, k].max() <= min(reach, 1.0 - options.margin)
        and quiet[:, 0, k].mean() <= most
        and shaken[:, :, k].max() <= 1.0
        and noisy[:, :, k].mean() <= most
    ]
    assert 1 < len(lasts) < len(drawn.genes) - 1
    best = max(lasts, key=lambda k: found.tells[k])
    proposal = found.proposal()
    assert same_bits(proposal.genes, drawn.genes[best]) and same_bits(
        proposal.excitation, drawn.excitation[best]
    )
    assert proposal.predicted == pytest.approx(noisy[:, :, best].mean(), rel=1e-9)
    assert proposal.spread == pytest.approx(noisy[:, :, best].std(), rel=1e-6)
    assert proposal.risk == pytest.approx(0.5 / (len(MOTORS) * DRAWS + 1.0)) and proposal.safe


@pytest.mark.parametrize("goal", ["both", "control"])
def test_the_tuned_gains_are_flown_where_they_are_wanted_and_nothing_that_costs_more_otherwise(goal):
    drawn = drafts(goal=goal)
    quiet, _ = judged(drawn, QUIET, measured=False)
    assert same_bits(compared(goal=goal, drawn=drawn, exploit=True).proposal().genes, TUNED)
    other = compared(goal=goal, drawn=drawn).proposal()
    (chosen,) = [k for k in range(len(drawn.genes)) if same_bits(drawn.excitation[k], other.excitation)]
    promised, worse = quiet[:, 0, 0].mean(), PLANNER.options.worse
    assert chosen > 0 and quiet[:, 0, chosen].mean() <= (1.0 + worse) * min(promised, FLOWN.good)


def test_what_is_gained_by_knowing_the_right_member_is_the_expected_value_of_perfect_information():
    apart = replace(
        COMMITTEE, members=[member(KNOWN, gain, damping) for gain, damping in ((0.5, 0.0), (2.5, 1.0))]
    )
    found = compared(apart)
    choices = found.quiet.qualities[:, 0, found.keeps]
    # Whoever knew which member is right would fly the best for it; who does not flies the best on average.
    known = np.mean([min(row) for row in choices])
    assert found.gain == pytest.approx(min(choices.mean(axis=0)) - known) and found.gain > 1e-4


@pytest.mark.parametrize("flies", [True, False])
def test_where_the_committee_is_not_trusted_the_flight_that_uses_least_of_the_envelope_is_chosen(flies):
    distrusted = replace(COMMITTEE, trusted=False)
    # Lazy gains use no more of the envelope than the start does.
    flown = replace(FLOWN, flies=flies, best=np.array([0.1, 0.0, 3.0]))
    drawn = drafts(flown, trusted=False)
    usage = judged(drawn, QUIET, measured=False)[1].max(axis=(0, 1))
    # What flies is flown again, in one way or another; gains that do not are left alone.
    among = [k for k in range(len(usage)) if (k >= drawn.repeats) == flies]
    best = min(among, key=lambda k: usage[k])
    proposal = compared(distrusted, flown, drawn=drawn).proposal()
    sent = np.zeros((STEPS, 1)) if proposal.excitation is None else proposal.excitation
    assert same_bits(proposal.genes, drawn.genes[best]) and same_bits(sent, drawn.excitation[best])


def test_gains_close_to_some_that_failed_are_not_flown_again():
    flown = replace(FLOWN, failed=[TUNED])
    found = compared(flown=flown, exploit=True, goal="both")
    places = PLANNER.family.to_unit(found.drafts.genes)
    off = np.abs(places - PLANNER.family.to_unit(TUNED)).max(axis=1)
    assert found.possible.tolist() == (off > 0.02).tolist() and not found.possible[0]
    assert np.abs(PLANNER.family.to_unit(found.proposal().genes) - PLANNER.family.to_unit(TUNED)).max() > 0.02


def test_where_every_candidate_is_close_to_a_failure_the_safest_of_them_is_still_offered():
    drawn = drafts()
    flown = replace(FLOWN, failed=list(drawn.genes))
    found = compared(flown=flown, drawn=drawn)
    assert found.possible.all() and np.isfinite(found.proposal().predicted)


def test_a_member_that_diverges_whatever_is_flown_has_no_say():
    wild = replace(COMMITTEE, members=[*COMMITTEE.members, member(KNOWN, -60.0, -40.0)])
    with_it, without = compared(wild), compared()
    assert len(with_it.members) == len(without.members) == 3
    one, other = with_it.proposal(), without.proposal()
    assert same_bits(one.genes, other.genes) and same_bits(one.excitation, other.excitation)


def test_a_member_that_goes_too_far_whatever_is_flown_has_no_say_unless_it_is_the_best_one():
    # Commands drive it the wrong way, slowly enough to last the flight.
    adrift = member(KNOWN, -0.2)
    gains = FLOWN.best * np.linspace(0.8, 1.2, 24)[:, np.newaxis]
    drawn = replace(drafts().quiet(), genes=gains)
    usages = compared(replace(COMMITTEE, members=[adrift]), drawn=drawn).quiet.usages
    assert usages.min() > 0.7 and np.isfinite(usages).all()
    with_it = compared(replace(COMMITTEE, members=[*COMMITTEE.members, adrift]), drawn=drawn)
    assert len(with_it.members) == len(with_it.quiet.qualities) == 3 and with_it.keeps.any()
    assert same_bits(with_it.proposal().genes, compared(drawn=drawn).proposal().genes)
    best = compared(replace(COMMITTEE, members=[adrift, *COMMITTEE.members]), drawn=drawn)
    assert len(best.members) == 4 and not best.keeps.any()


def keeping(usage):
    """Which candidates stay within what may be used after a flight that has used 70 %, by usages on each member."""
    left = 1.0 - PLANNER.options.margin - 0.7
    return usage.max(axis=(0, 1)) <= 0.7 + PLANNER.options.reach_rest * left


def test_a_plain_flight_is_the_one_that_promises_most_beside_the_tuned_one_that_was_passed_over():
    drawn = drafts().quiet()
    first = int(np.argmin(judged(drawn, QUIET, measured=False)[0].mean(axis=(0, 1))))
    genes = drawn.genes.copy()
    genes[[0, first]] = genes[[first, 0]]
    drawn = replace(drawn, genes=genes)
    quiet, usage = judged(drawn, QUIET, measured=False)
    mean, keeps = quiet.mean(axis=(0, 1)), usage.max(axis=(0, 1)) <= 0.7
    best = min(np.flatnonzero(keeps)[1:], key=lambda k: mean[k])
    found = compared(drawn=drawn, plain=True)
    assert keeps[0] and mean[0] == mean.min() and found.tells[keeps].max() > found.tells[best]
    proposal = found.proposal()
    assert same_bits(proposal.genes, drawn.genes[best]) and proposal.excitation is None


def test_where_no_flight_is_worth_what_it_costs_the_best_that_is_no_worse_than_was_flown_is_chosen_or_the_safest():
    drawn = drafts(goal="control")
    lazy = PLANNER.family.to_unit(np.array([0.5, 0.0, 1.0]))
    others = np.linspace(np.add(lazy, [0.2, 0.1, 0.0]), lazy, len(drawn.genes) - 1)
    drawn = replace(drawn, genes=np.concatenate([drawn.genes[:1], PLANNER.family.from_unit(others)]))
    quiet, usage = judged(drawn, QUIET, measured=False)
    mean = quiet.mean(axis=(0, 1))
    best = 1 + int(np.argmin(mean[1:]))
    assert mean[best] > 1.2 * mean[0] and keeping(usage)[best]
    enough, too_little = (replace(FLOWN, good=good) for good in (1.1 * mean[best], 0.5 * mean[0]))
    found = compared(goal="control", flown=enough, drawn=drawn).proposal()
    assert same_bits(found.genes, drawn.genes[best])
    safest = drawn.repeats + int(np.argmin(usage.max(axis=(0, 1))[drawn.repeats :]))
    assert safest != best
    found = compared(goal="control", flown=too_little, drawn=drawn).proposal()
    assert same_bits(found.genes, drawn.genes[safest])


@pytest.mark.parametrize("flies", [True, False])
def test_gains_that_have_not_flown_keep_the_envelope_with_more_delay_than_was_seen(flies):
    quick = (4.0, 0.0)
    delayed = replace(COMMITTEE, delayed=[member(KNOWN, *quick)])
    flown = replace(FLOWN, flies=flies)
    drawn = drafts(flown, goal="both")
    bears = judged(drawn, QUIET, measured=False, motors=[quick])[1][0, 0] <= 1.0
    bears[drawn.repeats :] |= flies
    assert 0 < bears[: drawn.repeats].sum() < drawn.repeats
    usage = judged(drawn, QUIET, measured=False)[1]
    possible = flies | (np.arange(len(bears)) < drawn.repeats)
    found = compared(delayed, flown, goal="both", drawn=drawn)
    assert found.keeps.tolist() == (keeping(usage) & bears & possible).tolist()


@pytest.mark.parametrize("flies", [True, False])
def test_new_gains_keep_the_envelope_and_its_margin_also_where_what_states_do_ends(flies):
    # What holds it has ended: it drives itself.
    drives = (1.0, -2.0)
    ended = replace(COMMITTEE, ending=member(KNOWN, *drives))
    flown = replace(FLOWN, flies=flies)
    drawn = drafts(flown, goal="both")
    bears = judged(drawn, QUIET, measured=False, motors=[drives])[1][0, 0] <= 1.0 - PLANNER.options.margin
    bears[drawn.repeats :] |= flies
    found, without = (compared(one, flown, goal="both", drawn=drawn) for one in (ended, COMMITTEE))
    assert found._bears_ending(list(range(len(bears)))).tolist() == bears.tolist()
    assert 0 < bears[: drawn.repeats].sum() < drawn.repeats and found.keeps.tolist() == without.keeps.tolist()
    # What tells most gives way to what tells most of those that bear it.
    (before, _), (after, _) = without._trusted_choice(), found._trusted_choice()
    assert not bears[before] and bears[after] and found.tells[after] < found.tells[before]
    nowhere = replace(COMMITTEE, ending=member(KNOWN, -60.0, -40.0))
    last = compared(nowhere, flown, goal="both", drawn=drawn)._trusted_choice()
    assert (last is not None and last[0] >= drawn.repeats) if flies else last is None


@pytest.mark.parametrize(
    ("drives", "much"), [((-60.0, -40.0), True), ((1.0, -2.0), True), ((1.0, -1.5), False)]
)
def test_what_gains_promise_that_are_held_back_counts_in_what_another_flight_may_bring(drives, much):
    drawn = drafts(goal="both")
    ended = replace(COMMITTEE, ending=member(KNOWN, *drives))
    held, free = (compared(one, goal="both", drawn=drawn) for one in (ended, COMMITTEE))
    proposed, freely = held.proposal(), free.proposal()
    excitation = np.zeros_like(drawn.excitation[0]) if proposed.excitation is None else proposed.excitation
    chosen = next(
        k
        for k, genes in enumerate(drawn.genes)
        if same_bits(genes, proposed.genes) and same_bits(drawn.excitation[k], excitation)
    )
    mean = judged(drawn, QUIET, measured=False)[0].mean(axis=(0, 1))
    bears = judged(drawn, QUIET, measured=False, motors=[drives])[1][0, 0] <= 1.0 - PLANNER.options.margin
    # Gains that have flown need not bear it; what is held back is beyond all that do, and beyond the chosen ones.
    bears[drawn.repeats :] = True
    promises = min(mean[chosen], mean[held.keeps & bears].min()) - mean[held.keeps].min()
    assert not bears.all() and (promises > PLANNER.options.worse * mean[chosen]) == much
    assert proposed.gain == pytest.approx(held.gain + promises, rel=1e-6)
    assert freely.gain == free.gain == held.gain
    assert ("held back" in proposed.reason) == much and "held back" not in freely.reason


def test_until_a_prediction_has_come_true_no_flight_leads_far_beyond_what_was_seen():
    drawn = drafts()
    still = np.zeros((1, STEPS + 1, 2))
    runs = [
        [flight(motor, genes, excitation, still[0])[0] for motor in MOTORS]
        for genes, excitation in zip(drawn.genes, drawn.excitation, strict=True)
    ]
    # How fast each candidate turns at most, on the member on which it turns fastest.
    fastest = np.array([max(np.abs(run[:, 1]).max() for run in members) for members in runs])
    seen = Seen(np.array([[0.0, -0.15], [0.6, 0.15]]), np.zeros((2, 2)))
    reach = ((1.0 - 1e-9) * float(np.median(fastest)) - 0.15) / 0.3
    comparison = compared(flown=replace(FLOWN, seen=seen, flies=False), drawn=drawn)
    bounds = seen.around(reach, KNOWN)
    np.testing.assert_allclose(bounds[:, 1], np.array([-1.0, 1.0]) * (0.15 + reach * 0.3), atol=1e-12)
    comparison.options = replace(comparison.options, reach_seen=reach)
    near = comparison._near_what_was_seen()
    inside = [
        all((run <= bounds[1]).all() and (run >= bounds[0]).all() for run in members) for members in runs
    ]
    assert near.tolist() == inside and 0 < near.sum() < len(near)
    for anywhere in (replace(FLOWN, seen=None), replace(FLOWN, seen=Seen(1e-6 * seen.flights, seen.task))):
        comparison.flown = anywhere
        # Where every one leads further than that, it tells no flight from another.
        assert comparison._near_what_was_seen().all()


def test_what_has_hardly_moved_is_taken_to_have_moved_by_a_share_of_its_scale():
    bounds = Seen(np.zeros((2, 2)), np.zeros((2, 2))).around(2.0, KNOWN)
    scales = np.array([state.scale for state in KNOWN.states])
    np.testing.assert_allclose(bounds, 0.04 * np.stack([-scales, scales]))


def test_a_task_that_leads_far_may_be_reached_and_is_no_reason_to_go_further():
    flights, task = np.array([[0.0, -0.5], [0.4, 0.5]]), np.array([[0.2, 0.0], [3.0, 0.0]])
    bounds = Seen(flights, task).around(2.0, KNOWN)
    np.testing.assert_allclose(bounds, [[-0.8, -2.5], [3.8, 2.5]])


def test_a_candidate_that_known_disturbances_drive_out_more_often_than_the_flown_gains_gives_way_to_the_next():
    chosen = compared(goal="both").proposal()

    def blown(left_of_chosen, left_of_flown):
        def on(test):
            mine = test.genes.tobytes() == chosen.genes.tobytes()
            return Moved(0.0, 0.0, left=left_of_chosen if mine else left_of_flown)

        return compared(replace(COMMITTEE, gusts=SimpleNamespace(on=on)), goal="both").proposal()

    assert same_bits(blown(2, 2).genes, chosen.genes)
    other = blown(2, 1)
    assert other.genes.tobytes() != chosen.genes.tobytes()
    assert other.disagreement <= chosen.disagreement and other.safe


@pytest.mark.parametrize(
    ("goal", "share", "flies"),
    [("both", 0.49, True), ("both", 0.51, False), ("control", 0.51, False), ("model", 5.0, True)],
)
def test_a_candidate_that_known_disturbances_make_half_as_bad_again_as_the_best_flight_gives_way(
    goal, share, flies
):
    chosen = compared(goal=goal).proposal()
    flown = replace(FLOWN, good=1.01 * chosen.predicted)
    assert same_bits(compared(flown=flown, goal=goal).proposal().genes, chosen.genes)

    def on(test):
        mine = test.genes.tobytes() == chosen.genes.tobytes()
        return Moved((1.0 + share) * flown.good - chosen.predicted if mine else 0.0, 0.0)

    moved = compared(replace(COMMITTEE, gusts=SimpleNamespace(on=on)), flown, goal=goal).proposal()
    assert (moved.genes.tobytes() == chosen.genes.tobytes()) == flies
    assert moved.safe


@pytest.mark.parametrize("goal", ["both", "control"])
def test_where_the_gains_that_promise_most_bear_no_gust_some_on_the_way_back_from_them_fly(goal):
    planner = planner_of(KNOWN, candidates=1024, draws=DRAWS)
    flown = replace(FLOWN, good=5.0, best=np.array([0.5, 0.0, 3.0]))
    drawn = candidates(planner, planner.options, TUNED, flown, goal, 3)
    place = planner.family.to_unit(flown.best)
    way = np.abs(planner.family.to_unit(TUNED) - place).max()

    def on(test):
        return Moved(0.0, 0.0, left=int(np.abs(planner.family.to_unit(test.genes) - place).max() > 0.5 * way))

    committee = replace(COMMITTEE, gusts=SimpleNamespace(on=on))
    comparison = Comparison(planner, planner.options, committee, drawn, flown, Wanted(goal, 3, False))
    # Of those that promise most far more than are tried are all alike.
    promising = np.argsort(comparison.quiet.mean)[: 2 * TRIED]
    assert (np.abs(planner.family.to_unit(drawn.genes[promising]) - place).max(axis=1) > 0.5 * way).all()
    off = np.abs(planner.family.to_unit(comparison.proposal().genes) - place).max()
    assert 0.05 * way < off <= 0.5 * way


@pytest.mark.parametrize(("there", "most", "found"), [
    (0, 3, []), (1, 3, [0]), (3, 3, [0, 1, 2]), (5, 3, [0, 2, 4]), (9, 1, [0]), (10, 4, [0, 3, 6, 9]),
])  # fmt: skip
def test_so_many_at_most_of_a_list_are_spaced_from_its_first_to_its_last(there, most, found):
    assert _spaced(range(there), most) == found


def test_what_is_safest_is_never_the_tuned_gains_by_accident():
    # Of the best gains flown a later flight has failed: nothing of them is flown again, and nothing at random either.
    flown = replace(FLOWN, flies=True, failed=[FLOWN.best])
    found = compared(replace(COMMITTEE, trusted=False), flown)
    usage = found.quiet.worst_usage
    (chosen, _) = found._safest()
    assert found.possible[chosen] and usage[chosen] == usage[found.possible].min()
    # A model on which everything diverges tells nothing: gains that were flown.
    nothing = replace(COMMITTEE, members=[member(KNOWN, -60.0, -40.0)])
    found = compared(nothing, replace(FLOWN, flies=True))
    assert not np.isfinite(found.quiet.worst_usage).any()
    assert same_bits(found.proposal().genes, FLOWN.best)


@pytest.mark.parametrize("goal", ["both", "model"])
def test_a_task_that_begins_far_out_is_within_reach_whatever_was_flown_before(goal):
    flown, wanted = replace(FLOWN, usages=[0.05], begins=0.8), Wanted(goal, 1, False)
    most = 1.0 - PLANNER.options.margin
    assert 0.8 <= reach_of(flown, wanted, PLANNER.options) <= most
    assert reach_of(replace(flown, begins=0.0), wanted, PLANNER.options) < 0.8

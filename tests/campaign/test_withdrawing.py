"""A flight that was told by mistake is withdrawn: the campaign goes on as if it had never been told."""

import copy

import numpy as np
import pytest

import twinloop as tl
from lives import OTHER_GAINS, PENDULUM_GAINS, PLANT, StopAt, by_hand, cut, new, plain
from sameness import same


def noisy(test, seed):
    """A run of a test, read with noise."""
    run = PLANT.run(test)
    stream = np.random.default_rng(seed)
    return tl.Trajectory(run.t, run.states + 1e-3 * stream.standard_normal(run.states.shape), run.commands)


def wrong(test):
    """A log of degrees that was told as one of radians, or the like."""
    run = noisy(test, 9)
    return tl.Trajectory(run.t, run.states * [0.5, 0.5], run.commands)


def begun(preset):
    """Two flights, then a test that was asked for."""
    campaign = new(preset)
    for seed, gains in enumerate((PENDULUM_GAINS, OTHER_GAINS)):
        test = campaign.test(gains)
        campaign.tell(test, noisy(test, seed))
    return campaign, campaign.ask()


def cut_back(campaign, asked):
    """The logbook after some questions and the flights that followed them, as if nothing had been withdrawn.

    Nothing was attached, one run told before the first question, and one after each.
    """
    book = copy.deepcopy(campaign.to_record()["logbook"])
    gone = {each["run"] for each in book["withdrawals"]}
    book["experiments"] = [run for place, run in enumerate(book["experiments"]) if place not in gone]
    book["experiments"] = book["experiments"][: asked + 1]
    for _, run in book["experiments"]:
        run["before"] = None
    # What was planned with a withdrawn flight is of no turn of the loop.
    book["asked"] = [[99, plan] for _, plan in book["asked"][:asked]]
    book["tests"] = book["tests"][: asked + 1]
    for test in book["tests"]:
        test |= {"predicted": None, "spread": None, "risk": None}
    return {**book, "withdrawals": []}


def rebuilt(campaign, book, memory):
    """A campaign of a logbook, with what another one remembers."""
    record = {**campaign.to_record(), "logbook": book, "memory": memory.to_record()["memory"]}
    return tl.Campaign.from_record(record, threads=1)


def asks_the_same(one, other):
    """Whether both campaigns go on with the same bits: their questions, their answers to them, their results."""
    for seed in (20, 21):
        tests = [campaign.ask() for campaign in (one, other)]
        assert same(*(test.to_record() | {"campaign": ""} for test in tests))
        for campaign, test in zip((one, other), tests, strict=True):
            campaign.tell(test, noisy(test, seed))
    assert same(one.best_test.genes, other.best_test.genes)
    assert one.twin.equations(17) == other.twin.equations(17)
    assert one.history == other.history


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("looked", [False, True])
def test_a_campaign_whose_last_flight_was_withdrawn_asks_what_one_asks_that_was_never_told_it(preset, looked):
    campaign, test = begun(preset)
    never, _ = begun(preset)
    campaign.tell(test, wrong(test))
    if looked:
        _ = campaign.twin, campaign.best_test
    campaign.withdraw(test.number, "degrees instead of radians")
    assert campaign.status(test) == "asked" and campaign.waiting == (test,)
    assert len(campaign.experiments) == 2 and campaign.runs == 3
    asks_the_same(campaign, never)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_it_asks_the_same_where_a_test_was_asked_for_since(preset):
    campaign, test = begun(preset)
    never, _ = begun(preset)
    campaign.tell(test, wrong(test))
    poisoned = campaign.ask()
    campaign.withdraw(test, "degrees instead of radians")
    assert campaign.status(poisoned) == "abandoned" and campaign.waiting == (test,)
    book = campaign.to_record()["logbook"]
    # Of the question that had learnt it there is no turn of the loop any more.
    book = {**book, "experiments": book["experiments"][:2], "withdrawals": [], "asked": book["asked"][:1]}
    book["asked"].append([99, campaign.to_record()["logbook"]["asked"][1][1]])
    asks_the_same(campaign, rebuilt(campaign, book, never))


def test_an_attached_flight_in_the_middle_is_forgotten_like_one_that_never_was():
    campaign, never = new("default"), new("default")
    for each in (campaign, never):
        first = each.test(PENDULUM_GAINS)
        each.tell(first, noisy(first, 0))
        if each is campaign:
            each.attach(by_hand(30))
        each.ask()
    test = campaign.waiting[0]
    campaign.tell(test, noisy(test, 1))
    second = campaign.ask()
    campaign.tell(second, noisy(second, 2))
    attached = campaign.experiments[1]
    campaign.withdraw(attached, "the log of another rig")
    assert [run.number for run in campaign.experiments] == [0, 1, 2]
    # What was predicted with it counts no more; the sheets of those tests stay as they were.
    assert [run.test.predicted for run in campaign.experiments] == [None, None, None]
    assert campaign.tests[1].predicted is not None
    # Beside it campaigns that had learnt at each question what is left, with the tests of this one.
    then = cut_back(campaign, 1)
    at_first = rebuilt(campaign, then, never)
    at_first.ask()
    asks_the_same(campaign, rebuilt(campaign, cut_back(campaign, 2), at_first))


def test_what_is_learnt_later_begins_where_it_was_learnt_again():
    """A look, a copy and a record in between change nothing."""
    campaign, test = begun("default")
    campaign.tell(test, noisy(test, 3))
    second = campaign.ask()
    campaign.tell(second, noisy(second, 4))
    campaign.withdraw(0, "the first flight was that of another rig")
    other = tl.Campaign.from_record(campaign.to_record(), threads=1)
    _ = other.twin, other.best_test
    other = copy.copy(other)
    asks_the_same(campaign, other)
    assert plain(campaign) == plain(other)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_learning_again_that_is_interrupted_anywhere_goes_on_with_the_same_bits(preset):
    whole, test = begun(preset)
    whole.tell(test, noisy(test, 3))
    second = whole.ask()
    whole.tell(second, noisy(second, 4))
    whole.withdraw(0, "the first flight was that of another rig")
    start = whole.to_record()
    looks = []
    whole.progress = looks.append
    whole.ask()
    for call in sorted({1, *range(4, len(looks), max(1, len(looks) // 6))}):
        campaign = tl.Campaign.from_record(start, threads=1, progress=StopAt(call))
        with pytest.raises(KeyboardInterrupt):
            campaign.ask()
        campaign = tl.Campaign.from_record(campaign.to_record(), threads=1)
        campaign.ask()
        assert plain(campaign) == plain(whole)


def test_the_right_log_may_be_told_and_the_wrong_one_counts_as_no_second_flight():
    campaign, test = begun("default")
    campaign.tell(test, wrong(test))
    seconds = campaign.cost.seconds
    campaign.withdraw(test.number, "degrees")
    assert (campaign.cost.runs, campaign.cost.withdrawn) == (3, 1)
    assert campaign.cost.seconds == pytest.approx(seconds)
    campaign.tell(test, noisy(test, 5))
    assert campaign.status(test) == "flown"
    assert (campaign.cost.runs, campaign.cost.withdrawn) == (3, 1)
    assert campaign.cost.seconds == pytest.approx(seconds)
    straight, same_test = begun("default")
    straight.tell(same_test, noisy(same_test, 5))
    assert campaign.experiments[-1].before == straight.experiments[-1].before
    asks_the_same(campaign, straight)


def test_a_test_that_was_planned_with_a_withdrawn_flight_is_not_flown_again():
    """Its risk is that of a wrong twin; the log of its flight may still be told."""
    campaign, test = begun("default")
    campaign.tell(test, noisy(test, 5))
    campaign.withdraw(0, "the log of another rig")
    assert campaign.status(test) == "flown"
    campaign.withdraw(test, "that too")
    assert campaign.status(test) == "abandoned" and campaign.waiting == ()
    campaign.tell(test, noisy(test, 6))
    assert campaign.status(test) == "flown"


def test_a_failure_is_withdrawn_with_its_record():
    campaign, test = begun("default")
    campaign.tell_failed(test, "it did not start", partial=cut(PLANT.run(test), 6))
    campaign.withdraw(test, "it was another one")
    assert campaign.failures == () and len(campaign.experiments) == 2
    assert campaign.status(test) == "asked"
    campaign.tell_failed(test, "no record")
    campaign.withdraw(campaign.failures[0], "it had not failed")
    assert campaign.failures == () and campaign.status(test) == "asked"
    assert [each.reason for each in campaign.withdrawals] == ["it was another one", "it had not failed"]
    asks_the_same(campaign, begun("default")[0])


def test_one_of_several_runs_of_a_test_is_withdrawn():
    campaign, test = begun("default")
    runs = [noisy(test, seed) for seed in (6, 7)]
    for run in runs:
        campaign.tell(test, run)
    campaign.withdraw(campaign.experiments[2], "flown with a flat battery")
    assert same(campaign.experiments[2].trajectory.states, runs[1].states)
    assert campaign.status(test) == "flown"


@pytest.mark.parametrize(
    ("which", "reason", "sentence"),
    [
        (7, "why", "number of a test with a recorded flight, one of 0, 1, found 7"),
        (2, "why", "one of 0, 1, found 2"),
        (0, " ", "expected what was wrong"),
        ("0", "why", "found str"),
        (True, "why", "found bool"),
    ],
)
def test_what_cannot_be_withdrawn_is_refused_and_changes_nothing(which, reason, sentence):
    campaign, _ = begun("default")
    before = plain(campaign)
    with pytest.raises(tl.InvalidInput, match=sentence):
        campaign.withdraw(which, reason)
    assert plain(campaign) == before


def test_a_flight_is_withdrawn_once():
    campaign, _ = begun("default")
    run = campaign.experiments[0]
    campaign.withdraw(run, "why")
    with pytest.raises(tl.InvalidInput, match="a withdrawn one"):
        campaign.withdraw(run, "why")
    with pytest.raises(tl.InvalidInput, match="one of 1, found 0"):
        campaign.withdraw(0, "why")
    campaign.withdraw(1, "why")
    with pytest.raises(tl.NotAvailable, match="at least one recorded experiment"):
        campaign.ask()

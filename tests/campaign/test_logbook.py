"""The logbook counts what happened, refuses what cannot be without a trace, and is the same when it is read back."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import twinloop as tl
from logbooks import SETUPS, STEPS, attached, events, genes_of, planned, run_of, trajectory, written
from oracles import same_bits
from sameness import same, through_json
from strategies import program_text
from twinloop import _core
from twinloop.campaign.logbook import Logbook
from twinloop.objectives import closed_loop

LISTS = ("tests", "experiments", "asked", "failures", "abandoned")


def read_back(book, record=None):
    return Logbook.from_record(through_json(book.to_record() if record is None else record), book.setup)


@given(events)
@example([("ask", 0, 1.0), ("ask", 1, 1.0), ("abandon", 0, 1.0)])
def test_it_counts_what_happened(wanted):
    book, lives, order = written(wanted)
    assert [run.number for run in book.experiments] == order
    assert book.flown == {number for number, life in enumerate(lives) if life.flown}
    assert [test.number for test in book.waiting()] == [
        number for number, life in enumerate(lives) if life.asked and not life.flown and not life.abandoned
    ]
    # A failure that left a record is one flight, not two.
    unrecorded = sum(life.failures for life in lives) - sum(
        run == ("cut", None) for life in lives for run in life.runs
    )
    assert book.runs == sum(len(life.runs) for life in lives) + unrecorded
    assert book.outcomes == len(order) + sum(life.failures for life in lives)


@given(events)
def test_each_entry_makes_a_new_revision_and_none_is_ever_taken_back(wanted):
    books = [written(wanted[:count])[0] for count in range(len(wanted) + 1)]
    revisions = [book.revision for book in books]
    assert revisions == sorted(revisions)
    for before, after in pairwise(books):
        assert (before.revision == after.revision) == all(
            len(getattr(before, name)) == len(getattr(after, name)) for name in LISTS if name != "asked"
        )


@given(events)
def test_it_is_the_same_when_it_is_read_back(wanted):
    book, _, _ = written(wanted)
    again = read_back(book)
    assert same(again.to_record(), book.to_record())
    assert [test.number for test in again.waiting()] == [test.number for test in book.waiting()]


@given(events, st.integers(0, 16))
def test_what_was_written_before_and_what_is_new_are_the_whole(wanted, cut):
    book, _, _ = written(wanted)
    first, _, _ = written(wanted[:cut])
    known = {name: len(getattr(first, name)) for name in LISTS}
    whole, new = book.entries({}), book.entries(known)
    assert all(same(whole[name], whole[name][: known[name]] + new[name]) for name in LISTS)


@given(events)
def test_the_first_experiments_are_learnt_as_if_there_were_no_others(wanted):
    book, _, order = written([*wanted, ("tell inside", 0, 1.0), ("tell inside", 0, 1.0)])
    program = _core.Program.parse(program_text(3, 1, 5, [["r3 = r2 * 2.0"]]))
    model = _core.Model(program, "acceleration", book.setup.signals.engine)
    errors = [closed_loop([model], book.first(told).selected) for told in range(1, len(order) + 1)]
    assert [error.shape[1] for error in errors] == list(range(1, len(order) + 1))
    assert all(same_bits(error, errors[-1][:, : error.shape[1]]) for error in errors)
    for told in (0, len(order) + 1):
        with pytest.raises(tl.InvalidInput, match="belongs to another campaign"):
            book.first(told)


def test_a_copy_is_a_book_of_its_own():
    book, _, _ = written([("make", 0, 1.0), ("tell inside", 0, 1.0)])
    before = book.to_record()
    copy = book.copied()
    assert same(copy.to_record(), before)
    copy.new_test(genes_of(1))
    copy.enter(attached())
    copy.fail(copy.tests[0], "it stopped", None, lambda alone: None)
    copy.abandon(copy.tests[1])
    assert same(book.to_record(), before) and copy.revision == book.revision + 4


def test_a_failure_with_a_record_is_judged_on_it_and_entered_as_a_run_that_was_cut():
    book, _, _ = written([("make", 0, 1.0)])
    book.fail(book.tests[0], "the motor cut out", trajectory("cut"), lambda alone: 0.25)
    (run,), (failure,) = book.experiments, book.failures
    assert (run.before, run.quality, run.trajectory.ended, run.trajectory.reason) == (
        0.25,
        None,
        "aborted",
        "the motor cut out",
    )
    assert failure.recorded and failure.test is book.tests[0]


def stranger():
    return Logbook(SETUPS["default"]).new_test(genes_of(0))


REFUSED = {
    "the failure of another campaign's test": lambda book: book.fail(
        stranger(), "why", None, lambda alone: None
    ),
    "a failure without a reason": lambda book: book.fail(book.tests[1], " ", None, lambda alone: None),
    "a failure with a record of nothing": lambda book: book.fail(
        book.tests[1],
        "why",
        tl.Trajectory([0.0], np.zeros((1, 2)), np.zeros((0, 1)), "aborted"),
        lambda alone: None,
    ),
    "a failure with a run that is too long": lambda book: book.fail(
        book.tests[1],
        "why",
        tl.Trajectory(0.05 * np.arange(STEPS + 2), np.zeros((STEPS + 2, 2)), np.zeros((STEPS + 1, 1))),
        lambda alone: None,
    ),
    "abandoning another campaign's test": lambda book: book.abandon(stranger()),
    "abandoning a test that was flown": lambda book: book.abandon(book.tests[0]),
    "a test that was changed": lambda book: book.own(
        tl.Test(
            book.setup.family, genes_of(2), [0.0, 0.0], [1.0, 0.0], STEPS, number=0, campaign=book.identity
        )
    ),
    "a test under a number that there is none of": lambda book: book.own(
        tl.Test(
            book.setup.family, genes_of(0), [0.0, 0.0], [1.0, 0.0], STEPS, number=9, campaign=book.identity
        )
    ),
    "something that is no test": lambda book: book.own("test 0"),
}


@pytest.mark.parametrize("wrong", REFUSED)
def test_what_cannot_be_is_refused_and_leaves_no_trace(wrong):
    book, _, _ = written([("make", 0, 1.0), ("tell inside", 0, 1.0), ("ask", 1, 1.0)])
    before = book.to_record()
    with pytest.raises(tl.InvalidInput, match=r"[Ee]xpected .* found"):
        REFUSED[wrong](book)
    assert same(book.to_record(), before)


DAMAGED = {
    "tests in another order": lambda record: record["tests"].reverse(),
    "tests of another campaign": lambda record: record.update(identity="somebody else's"),
    "a run of a test that there is none of": lambda record: record["experiments"][0].__setitem__(0, 7),
    "a failure of a test that there is none of": lambda record: record["failures"][0].__setitem__(0, -1),
    "an abandoned test that there is none of": lambda record: record["abandoned"].append(7),
    "a question about a test that there is none of": lambda record: record["asked"][0][1].update(test=7),
    "a run of no step": lambda record: record["experiments"][0][1].update(
        trajectory=tl.Trajectory([0.0], np.zeros((1, 2)), np.zeros((0, 1)), "aborted").to_record()
    ),
    "no list of failures": lambda record: record.pop("failures"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_record_is_refused(damage):
    book, _, _ = written(
        [
            ("make", 0, 1.0),
            ("tell inside", 0, 1.0),
            ("ask", 1, 1.0),
            ("fail", 1, 1.0),
            ("make", 2, 1.0),
            ("abandon", 2, 1.0),
        ]
    )
    record = through_json(book.to_record())
    assert same(read_back(book, record).to_record(), book.to_record())
    DAMAGED[damage](record)
    with pytest.raises(tl.InvalidInput, match=r"Record|Trajectory"):
        read_back(book, record)


def test_a_test_of_the_task_is_not_entered_and_one_elsewhere_is_as_it_was_asked_for():
    book = Logbook(SETUPS["default"])
    loose = book.of_task(genes_of(1), 5)
    assert (book.tests, loose.number, loose.excitation) == ([], 5, None)
    assert same_bits(loose.initial_state, book.setup.initial_state)
    away = book.new_test(genes_of(1), initial_state=np.array([0.3, 0.0]), target_state=np.array([0.7, 0.0]))
    assert (away.initial_state.tolist(), away.target_state.tolist()) == ([0.3, 0.0], [0.7, 0.0])
    assert book.own(away) is book.tests[0] and planned(away).test == 0 and run_of(away).number == 0

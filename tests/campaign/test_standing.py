"""Where tests are in their lives and how they have fared, beside a plain list of what happened to each."""

import math
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
import pytest
from hypothesis import example, given

from logbooks import SETUPS, events, genes_of, planned, run_of, trajectory, written
from twinloop._experiment.hold_back import HoldBack
from twinloop.campaign import standing
from twinloop.campaign.data.gains import FlownOtherwise
from twinloop.campaign.history import Experiment
from twinloop.campaign.logbook import Logbook


def status_of(life):
    if life.failures:
        return "failed"
    if life.runs:
        return "flown" if life.qualities else "aborted"
    return "abandoned" if life.abandoned else "asked"


def mean(values):
    return math.fsum(values) / len(values) if values else None


@given(events)
def test_each_test_stands_where_its_life_has_led_it(wanted):
    book, lives, _ = written(wanted)
    for number, life in enumerate(lives):
        whole = life.runs != [] and all(kind != "cut" for kind, _ in life.runs) and not life.failures
        assert standing.status(book, book.tests[number]) == status_of(life)
        assert standing.measured(book, number) == mean(life.qualities)
        assert standing.flies(book, number) == life.flies
        assert standing.finishes(book, number) == whole
        assert standing.failed(book, number) == (life.failures > 0)
        assert standing.on_task(book, book.tests[number]) == life.at_home
    unfit = [
        number for number, life in enumerate(lives) if life.flown and not standing.finishes(book, number)
    ]
    assert [genes.tolist() for genes in standing.unfit(book)] == [
        book.tests[number].genes.tolist() for number in unfit
    ]


@given(events)
def test_gains_have_flown_as_often_as_there_are_runs_of_any_test_with_them(wanted):
    book, lives, _ = written(wanted)
    for gains in range(3):
        runs = sum(len(life.runs) for life in lives if life.gains == gains)
        assert standing.times_flown(book, genes_of(gains)) == runs


@given(events)
def test_gains_have_fared_as_all_their_flights_or_as_those_without_excitation_where_there_are_any(wanted):
    book, lives, _ = written(wanted)
    some = np.ones((book.setup.steps, book.setup.signals.n_u))
    excited = [number for number in range(len(lives)) if number % 2]
    for number in excited:
        book.tests[number] = replace(book.tests[number], excitation=some)
    book.experiments[:] = [
        run if run.number not in excited else replace(run, replayed=book.tests[run.number])
        for run in book.experiments
    ]
    book.failures[:] = [replace(each, test=book.tests[each.test.number]) for each in book.failures]
    for gains in range(3):
        flights = [
            (number not in excited, kept)
            for number, life in enumerate(lives)
            if life.gains == gains
            for kept in life.kept
        ]
        quiet = [each for each in flights if each[0]]
        for found, counted in (
            (standing.fared(book, genes_of(gains), excited=True), flights),
            (standing.fared(book, genes_of(gains), excited=False), quiet or flights),
        ):
            left = sum(not kept for _, kept in counted)
            assert (found.flights, found.left) == (len(counted), left)
            assert found.risk == (pytest.approx((left + 0.5) / (len(counted) + 1)) if left else 0.0)


@given(events)
def test_excitations_were_borne_by_the_last_tests_that_were_held_back_and_flew(wanted):
    book, lives, _ = written(wanted)
    held = HoldBack(*(np.tile([-far, far], (book.setup.signals.n_x, 1)) for far in (1.0, 2.0)))
    for number, test in enumerate(book.tests):
        if number % 3:
            book.tests[number] = replace(test, hold_back=held)
    fared = [
        life.flies
        for number, life in enumerate(lives)
        if number % 3 and status_of(life) not in ("asked", "abandoned")
    ]
    assert standing.borne(book) == len(list(takewhile(bool, reversed(fared))))


@pytest.mark.parametrize(("rate", "borne"), [(3.0, 1), (7.9, 1), (8.1, 0)])
def test_an_excitation_that_states_outran_is_not_borne_though_they_kept_the_envelope(rate, borne):
    book = Logbook(SETUPS["default"])
    kept = [[-np.inf, np.inf], [-4.0, 4.0]]
    assert book.setup.signals.states[1].envelope == (-12.0, 12.0)
    test = book.new_test(genes_of(0), hold_back=HoldBack(np.multiply(kept, 0.5), np.array(kept)))
    run = run_of(test)
    states = run.trajectory.states.copy()
    states[3, 1] = rate
    book.enter(replace(run, trajectory=replace(run.trajectory, states=states)))
    assert standing.flies(book, 0) and standing.borne(book) == borne


@given(events)
def test_gains_have_reached_what_all_their_flights_that_kept_the_envelope_have_read(wanted):
    book, _, _ = written(wanted)
    for gains in range(3):
        genes = genes_of(gains)
        read = [
            run.trajectory.states
            for run in book.experiments
            if run.test is not None and run.kept_envelope and (run.test.genes == genes).all()
        ]
        found = standing.reached(book, genes)
        assert (found is None) == (not read)
        if read:
            lows, highs = ([end(states, axis=0) for states in read] for end in (np.min, np.max))
            assert (found == [np.max(lows, axis=0), np.min(highs, axis=0)]).all()


def test_what_one_flight_alone_has_reached_was_its_gusts_or_its_excitation_and_not_the_controller():
    book = Logbook(SETUPS["default"])
    for low, high in ((-3.0, 2.0), (-1.0, 5.0)):
        run = run_of(book.new_test(genes_of(0)))
        states = run.trajectory.states.copy()
        states[3:5, 1] = low, high
        book.enter(replace(run, trajectory=replace(run.trajectory, states=states)))
    assert standing.reached(book, genes_of(0))[:, 1].tolist() == [-1.0, 2.0]


def best_of(lives, order, groups):
    """The number of the best test: the lowest quality in the first group with any; else the first that was flown."""
    measured = [number for number in dict.fromkeys(order) if number is not None and lives[number].qualities]
    for group in groups:
        among = [number for number in measured if group(lives[number])]
        if among:
            return min(among, key=lambda number: mean(lives[number].qualities))
    return next((number for number in order if number is not None), None)


GROUPS = {
    "default": [
        lambda life: life.flies and life.at_home,
        lambda life: life.flies,
        lambda life: life.at_home,
        lambda life: True,
    ],
    "paper": [lambda life: life.at_home, lambda life: True],
}


def two(first, second, how):
    """Two tests, of which the first has flown better, in some way."""
    return [(first, 0, 1.0), (second, 1, 1.0), (f"tell {how}", 0, 0.5), ("tell inside", 1, 4.0)]


@pytest.mark.parametrize("preset", GROUPS)
@given(wanted=events)
@example(wanted=two("make elsewhere", "make", "inside"))
@example(wanted=two("make", "make elsewhere", "outside"))
@example(wanted=two("make", "make", "outside"))
def test_the_best_flown_test_is_known_to_fly_then_is_of_the_task_then_is_of_the_best_quality(preset, wanted):
    book, lives, order = written(wanted, preset)
    best, first = standing.best_flown(book), standing.first_flown(book)
    assert (None if best is None else best.number) == best_of(lives, order, GROUPS[preset])
    assert (None if first is None else first.number) == next(
        (each for each in order if each is not None), None
    )


def test_a_replicate_that_left_the_envelope_costs_a_test_its_place():
    book = Logbook(SETUPS["default"])
    good, fair = book.new_test(genes_of(0)), book.new_test(genes_of(1))
    for test, quality in ((good, 1.0), (fair, 2.0)):
        book.enter(run_of(test, "inside", quality))
    assert standing.best_flown(book) is good
    book.enter(run_of(good, "outside", 1.0))
    assert standing.best_flown(book) is fair


@dataclass(frozen=True)
class Turn:
    """What a turn of either loop has: its number, and the tests asked for after it."""

    iteration: int
    asked: tuple = ()


def test_turns_have_the_tests_that_were_asked_for_after_them_with_what_these_have_flown():
    book = Logbook(SETUPS["default"])
    for after in (1, 1, 2):
        book.asked.append((after, planned(book.new_test(genes_of(after)))))
    for quality in (1.0, 3.0):
        book.enter(run_of(book.tests[1], "inside", quality))
    book.enter(run_of(book.tests[2], "cut"))
    turns = standing.with_asked(book, [Turn(1), Turn(2), Turn(3)])
    found = [[(asked.test, asked.flown) for asked in turn.asked] for turn in turns]
    assert found == [[(0, None), (1, 2.0)], [(2, None)], []]
    assert [asked.flown for _, asked in book.asked] == [None] * 3


def test_a_target_that_varies_is_the_task_only_where_it_varies_alike():
    setup = SETUPS["default"]
    book = Logbook(setup)
    assert standing.on_task(book, book.new_test(genes_of(0)))
    ramp = np.linspace([0.0, 0.0], setup.target_state, setup.steps + 1)
    assert not standing.on_task(book, book.new_test(genes_of(0), target_state=ramp))


def test_an_excitation_that_was_left_out_was_not_borne():
    book = Logbook(SETUPS["default"])
    steps, commands = book.setup.steps, book.setup.signals.n_u
    held = HoldBack(*(np.tile([-far, far], (book.setup.signals.n_x, 1)) for far in (1.0, 2.0)))
    tests = [
        book.new_test(genes_of(number), excitation=np.ones((steps, commands)), hold_back=held)
        for number in range(2)
    ]
    book.enter(run_of(tests[0]))
    assert standing.borne(book) == 1
    book.enter(replace(run_of(tests[1]), replayed=replace(tests[1], excitation=None)))
    assert standing.flies(book, 1) and standing.borne(book) == 1


def test_other_gains_that_were_flown_and_cut_are_unfit_themselves():
    book = Logbook(SETUPS["default"])
    # One that is shorter than its test was cut, too, whatever is said of it.
    short = replace(trajectory("cut"), ended="completed", reason="")
    for number, run in enumerate((trajectory("cut"), trajectory("inside"), short)):
        test = book.new_test(genes_of(number))
        other = replace(test, genes=genes_of(number) * 0.5)
        flown = FlownOtherwise(test.signals, run.states[0], run.commands, asked=test, flown=other)
        book.enter(Experiment(flown, run, None, 1.0, None, None))
    unfit = [genes.tolist() for genes in standing.unfit(book)]
    assert [(genes_of(number) * 0.5).tolist() in unfit for number in range(3)] == [True, False, True]

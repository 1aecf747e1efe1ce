"""Work side by side: the order of what was asked for, on threads of its own, and no threads within threads."""

import threading
import time

import pytest

from twinloop._ground.side_by_side import side_by_side


@pytest.mark.parametrize("threads", [1, 2, 5, 64])
def test_what_is_found_stands_in_the_order_of_what_was_asked_for(threads):
    def late(number):
        time.sleep(0.002 * (7 - number))
        return number * number

    assert side_by_side(late, iter(range(8)), threads) == [number * number for number in range(8)]
    assert side_by_side(late, [], threads) == []


def test_two_pieces_run_at_the_same_time():
    met = threading.Barrier(2, timeout=20.0)
    # Each waits for the other: one after another they would never end.
    assert sorted(side_by_side(lambda _: met.wait(), range(2), 2)) == [0, 1]


@pytest.mark.parametrize(("threads", "several"), [(1, 3), (4, 1)])
def test_one_thread_or_one_piece_stays_on_the_caller_s_thread(threads, several):
    own = threading.get_ident()
    assert set(side_by_side(lambda _: threading.get_ident(), range(several), threads)) == {own}


def test_work_within_work_has_no_threads_of_its_own():
    def outer(_):
        return threading.get_ident(), set(side_by_side(lambda _: threading.get_ident(), range(4), 4))

    for own, inner in side_by_side(outer, range(3), 3):
        assert inner == {own}
    # The caller's own thread is free again.
    assert threading.get_ident() not in side_by_side(lambda _: threading.get_ident(), range(2), 2)


def test_the_first_error_comes_out_and_what_has_not_begun_is_left():
    begun, met = [], threading.Barrier(2, timeout=20.0)

    def work(number):
        begun.append(number)
        if number < 2:
            met.wait()
        if number == 1:
            time.sleep(0.05)
        if number < 2:
            raise ValueError(f"piece {number}")
        time.sleep(0.2)

    with pytest.raises(ValueError, match="piece 0"):
        side_by_side(work, range(50), 2)
    assert len(begun) < 50

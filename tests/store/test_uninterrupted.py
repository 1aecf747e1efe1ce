"""A signal that comes in the block is handled at its end, once, and nothing of it stays."""

import signal
import threading

import pytest

from twinloop.store.uninterrupted import uninterrupted


def interrupt():
    signal.raise_signal(signal.SIGINT)


def test_ctrl_c_waits_for_the_end_of_the_block():
    done = []
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        interrupt()
        done.append("the rest")
    assert done == ["the rest"] and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_a_block_raises_by_itself_goes_out_where_nothing_came():
    with pytest.raises(ZeroDivisionError), uninterrupted():
        raise ZeroDivisionError
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_is_heard_too_where_the_block_has_failed():
    with pytest.raises(KeyboardInterrupt) as heard, uninterrupted():
        interrupt()
        raise ZeroDivisionError
    assert isinstance(heard.value.__context__, ZeroDivisionError)


def test_a_second_ctrl_c_is_handled_at_once():
    done = []
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        interrupt()
        done.append("first")
        interrupt()
        done.append("second")
    assert done == ["first"]


def test_the_handler_of_a_program_is_held_back_too():
    seen = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        with uninterrupted():
            signal.raise_signal(signal.SIGTERM)
            assert seen == []
        assert seen == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_handler_that_raises_does_not_swallow_the_signals_behind_it():
    seen = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    try:
        with pytest.raises(KeyboardInterrupt), uninterrupted():
            interrupt()
            signal.raise_signal(signal.SIGTERM)
        assert seen == [signal.SIGTERM] and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGTERM, before)


def test_signals_are_handled_in_the_order_in_which_they_came():
    seen = []
    numbers = (signal.SIGUSR2, signal.SIGTERM, signal.SIGUSR1)
    before = {each: signal.signal(each, lambda number, frame: seen.append(number)) for each in numbers}
    try:
        with uninterrupted():
            for each in numbers:
                signal.raise_signal(each)
        assert seen == list(numbers)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def test_another_thread_holds_nothing_back():
    """Python refuses to change handlers there."""
    done = []

    def work():
        with uninterrupted():
            done.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.default_int_handler]

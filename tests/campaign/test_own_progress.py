"""Progress that a campaign shows by itself: a table on a terminal, nothing elsewhere, and no other result."""

import contextlib
import os
import pty
import sys
import threading
from contextlib import contextmanager

import pytest

import twinloop as tl
from lives import begun, made, plain
from twinloop.campaign.own_progress import TERMINAL


class Screen:
    """What was written on a terminal."""

    text = ""


@pytest.fixture
def terminal(monkeypatch):
    """A terminal in place of standard error, and its screen."""

    @contextmanager
    def opened():
        monkeypatch.setenv("TERM", "xterm")
        master, slave = pty.openpty()
        read, shown = [], Screen()
        reader = threading.Thread(target=lambda: read.extend(chunks(master)), daemon=True)
        reader.start()
        with open(slave, "w") as screen, monkeypatch.context() as patch:
            patch.setattr(sys, "stderr", screen)
            yield shown
        reader.join()
        os.close(master)
        shown.text = b"".join(read).decode()

    return opened


def chunks(master):
    while True:
        try:
            yield os.read(master, 4096)
        except OSError:  # nobody holds the other end any more
            return


def test_a_run_on_a_terminal_shows_the_step_and_the_time_left(terminal, pendulum):
    with terminal() as screen:
        made().run(pendulum, 2)
    for words in ("Simulated", "flying experiment", "1 of 2", "selecting terms", "elapsed", "left"):
        assert words in screen.text, words


def test_the_loops_of_the_paper_are_shown_too(terminal, pendulum, new_campaign):
    with terminal() as screen:
        new_campaign().run(pendulum, 2)
    assert "generation of models" in screen.text


def test_asking_and_looking_show_their_work_as_well(terminal, pendulum):
    campaign = made()
    test = campaign.test(pendulum.default_gains)
    campaign.tell(test, pendulum.run(test))
    with terminal() as screen:
        _ = campaign.twin
    assert "estimating the noise" in screen.text and "choosing" not in screen.text
    with terminal() as screen:
        campaign.ask()
    assert "choosing the next flight" in screen.text


def test_looking_at_what_is_known_shows_nothing(terminal, pendulum):
    campaign = made().run(pendulum, 1)
    _ = campaign.twin
    with terminal() as screen:
        _ = campaign.twin
    assert screen.text == ""


@pytest.mark.parametrize("off", [None, False])
def test_it_can_be_switched_off(terminal, pendulum, off):
    with terminal() as screen:
        made(progress=off).run(pendulum, 2)
    assert screen.text == ""


def test_what_is_asked_of_a_campaign_that_was_learnt_before_counts_its_experiments(tmp_path):
    store, seen = tmp_path / "rig.db", []
    with contextlib.closing(begun(store=store)) as campaign:
        assert campaign.twin.errors
    with contextlib.closing(tl.Campaign.load(store, threads=1, progress=seen.append)) as campaign:
        campaign.ask()
    assert seen and {progress.experiments for progress in seen} == {1}


def test_without_a_terminal_nothing_is_shown(capfd, pendulum):
    made().run(pendulum, 2)
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")


def test_what_a_system_prints_stays_where_it_was_sent(terminal, pendulum, capsys):
    run, pendulum.run = pendulum.run, lambda test: (print("flown"), run(test))[1]
    with terminal() as screen:
        made().run(pendulum, 2)
    assert capsys.readouterr().out == "flown\nflown\n"
    assert "flown" not in screen.text


def test_no_result_depends_on_it(terminal, pendulum):
    with terminal() as screen:
        shown = made().run(pendulum, 2)
        equations = shown.twin.equations()
    hidden = made(progress=None).run(pendulum, 2)
    assert equations == hidden.twin.equations()
    assert plain(shown) == plain(hidden)
    assert screen.text != ""


def test_a_second_campaign_at_work_leaves_the_terminal_to_the_first(terminal, pendulum):
    with terminal() as screen, TERMINAL:
        made().run(pendulum, 2)
    assert screen.text == ""


def test_an_interruption_clears_the_terminal(terminal, pendulum):
    def interrupted(test):
        raise KeyboardInterrupt

    pendulum.run = interrupted
    with terminal() as screen, pytest.raises(KeyboardInterrupt):
        made().run(pendulum, 2)
    assert "flying experiment" in screen.text
    assert not TERMINAL.locked()

"""What was told is kept: committed when `tell` returns, resumed to the bit, and never lost to a failure."""

import itertools
import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from sqlalchemy import event

import twinloop as tl
from command import invoke
from conftest import TINY
from faults import exit_code_of, killed_and_resumed, telling, withdrawing
from lives import (
    CONTROLLER,
    EVENTS,
    LIFE,
    OTHER_GAINS,
    SIGNALS,
    SMALL,
    WITHDRAWN_LIFE,
    behind_commits,
    flown,
    lived,
    one_writer_after_another,
    plain,
    stored,
)
from sameness import same
from twinloop.campaign import keeping
from twinloop.records import to_text
from twinloop.records.reading import MOST_ITEMS
from twinloop.store import Keeper, doing, found, listed, opened, state
from twinloop.store.schema import REVISION


def rows(path, table):
    """Rows of a table, read with nothing of ours."""
    with sqlite3.connect(path) as connection:
        return connection.execute(f"select * from {table}").fetchall()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "hover.db"


# Kept at once


def test_what_was_made_and_told_is_committed_when_the_call_returns(path, pendulum):
    campaign = stored(path)
    first = campaign.test(pendulum.default_gains)
    assert len(rows(path, "tests")) == 1 and rows(path, "experiments") == []
    campaign.tell(first, pendulum.run(first))
    assert len(rows(path, "experiments")) == 1 and rows(path, "checkpoints") == []
    campaign.ask()
    assert [len(rows(path, table)) for table in ("tests", "asked", "checkpoints")] == [2, 1, 1]


def test_what_is_committed_is_on_the_disk_even_if_the_power_goes(path):
    """With a log beside it SQLite forces each commit to the disk at FULL, 2, and at NORMAL, 1, some later."""
    stored(path).close()
    store = opened(path)
    with store.transaction() as connection:
        found = [
            connection.exec_driver_sql(f"PRAGMA {name}").scalar() for name in ("journal_mode", "synchronous")
        ]
    store.close()
    assert found == ["wal", 2]


def test_a_refused_call_leaves_no_row(path, pendulum):
    campaign = flown(stored(path), pendulum)
    short = tl.Trajectory([0.0], [[0.0, 0.0]], np.empty((0, 1)))
    with pytest.raises(tl.InvalidInput):
        campaign.tell(campaign.experiments[0].test, short)
    assert len(rows(path, "experiments")) == 1 and len(campaign.experiments) == 1


TOO_LONG = "x" * (MOST_ITEMS + 1)


def test_what_could_not_be_read_again_is_refused_and_leaves_no_row(path, pendulum):
    """One such entry would be the end of the campaign, as nobody could open it any more."""
    campaign = flown(stored(path), pendulum)
    first = campaign.tests[0]
    run = pendulum.run(first)
    long = tl.Trajectory(run.t[:5], run.states[:5], run.commands[:4], ended="aborted", reason=TOO_LONG)
    for call in (
        lambda: campaign.tell(first, long),
        lambda: campaign.tell_failed(first, TOO_LONG),
        lambda: campaign.withdraw(0, TOO_LONG),
    ):
        with pytest.raises(tl.InvalidInput, match="at most 10000000 characters"):
            call()
    assert [len(rows(path, name)) for name in ("experiments", "failures", "withdrawals")] == [1, 0, 0]
    assert plain(campaign) == plain(tl.Campaign.load(path, read_only=True))


def test_a_campaign_that_could_not_be_read_again_is_not_begun(path):
    signals = tl.Signals(SIGNALS.states, [tl.Command("torque", TOO_LONG, (-2.0, 2.0))], SIGNALS.dt)
    with pytest.raises(tl.InvalidInput, match="at most 10000000 characters"):
        tl.Campaign(
            signals, controller=CONTROLLER, initial_state=[0, 0], target_state=[1, 0], duration=1, store=path
        )
    assert not path.exists()


def test_a_number_that_no_database_can_hold_is_said(path, pendulum):
    campaign = flown(stored(path), pendulum)
    with pytest.raises(tl.StoreFailure, match="too large"):
        campaign.run(pendulum, experiments=2**70)


@pytest.mark.parametrize("event", EVENTS)
def test_ctrl_c_behind_a_commit_leaves_memory_and_store_alike(path, pendulum, monkeypatch, event):
    """Whatever the call entered is known to both, and so is what comes after it."""
    campaign = flown(stored(path, "default"), pendulum)
    campaign.test(OTHER_GAINS)
    run = pendulum.run(campaign.tests[0])
    interrupting = behind_commits(monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
    with interrupting, pytest.raises(KeyboardInterrupt):
        EVENTS[event](campaign, run)
    entered = tl.Campaign.load(path, read_only=True)
    assert plain(campaign) == plain(entered)
    later = campaign.test(OTHER_GAINS)
    campaign.tell(later, pendulum.run(later))
    assert plain(campaign) == plain(tl.Campaign.load(path, read_only=True))


def test_an_interruption_behind_the_commit_of_a_flight_does_not_take_it_back(path, pendulum, monkeypatch):
    """Even one that is no signal: a later flight would be written in its place, or not at all."""
    campaign = stored(path)
    first, second = campaign.test(pendulum.default_gains), campaign.test(OTHER_GAINS)
    with monkeypatch.context() as during:
        during.setattr(keeping.Keeping, "rest", lambda self: (_ for _ in ()).throw(Killed))
        with pytest.raises(Killed):
            campaign.tell(first, pendulum.run(first))
    campaign.tell(second, pendulum.run(second))
    held = tl.Campaign.load(path, read_only=True)
    assert [run.number for run in held.experiments] == [run.number for run in campaign.experiments] == [0, 1]


def test_after_a_commit_whose_answer_was_lost_the_campaign_says_that_it_is_to_be_loaded_again(
    path, pendulum, monkeypatch
):
    def lost():
        raise tl.StoreFailure("the answer was lost")

    campaign = stored(path)
    first, second = campaign.test(pendulum.default_gains), campaign.test(OTHER_GAINS)
    with behind_commits(monkeypatch, lost), pytest.raises(tl.StoreFailure, match="lost"):
        campaign.tell(first, pendulum.run(first))
    for _ in range(2):
        with pytest.raises(tl.StoreFailure, match="found experiments: 1 instead of 0"):
            campaign.tell(second, pendulum.run(second))
    campaign.close()
    again = tl.Campaign.load(path)
    again.tell(second, pendulum.run(second))
    assert [run.number for run in again.experiments] == [0, 1]


class Killed(BaseException):
    """Nothing of the campaign's own catches it: what is kept is what was kept before."""


class KillAt:
    """A progress callback that ends everything at its n-th call, and remembers how far each was."""

    def __init__(self, call=0):
        self.call, self.seen = call, []

    def __call__(self, progress):
        self.seen.append((progress.phase == "tests", progress.generation, progress.phase))
        if len(self.seen) == self.call:
            raise Killed


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_what_is_under_way_is_kept_now_and_then_and_goes_on_from_there(path, pendulum, monkeypatch, preset):
    """Killed at each look in turn: it goes on with no step that was behind it, and to the same bits."""
    monkeypatch.setattr(keeping, "SECONDS", 0.0)
    options = {**TINY, "model_generations": 60, "test_generations": 40} if preset == "paper" else SMALL

    def begun(name):
        return flown(stored(path.with_name(name), preset, options=options), pendulum)

    whole = begun("whole.db")
    whole.progress = watched = KillAt()
    whole.ask()
    assert {phase for *_, phase in watched.seen} >= (
        {"models", "tests"} if preset == "paper" else {"smoothed", "parts", "committee", "gains"}
    )
    for call in range(1, len(watched.seen) + 1):
        campaign = begun(f"{call}.db")
        campaign.progress = killer = KillAt(call)
        with pytest.raises(Killed):
            campaign.ask()
        campaign.close()
        again = tl.Campaign.load(path.with_name(f"{call}.db"), threads=1)
        again.progress = rest = KillAt()
        again.ask()
        assert not rest.seen or rest.seen[0] >= killer.seen[-1]
        assert plain(again) == plain(whole)
        again.close()


# Resumed


@pytest.mark.parametrize("life", [LIFE, WITHDRAWN_LIFE])
@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_that_is_opened_anew_after_each_event_is_the_one_that_was_not(path, preset, life):
    def reopened(campaign, step):
        campaign.close()
        return tl.Campaign.load(path, threads=1) if step % 2 else stored(path, preset)

    whole = lived(stored(path.with_name("whole.db"), preset), life)
    moved = lived(stored(path, preset), life, reopened)
    assert plain(moved) == plain(whole)
    assert same(moved.best_test.genes, whole.best_test.genes)


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_that_is_killed_at_random_moments_ends_with_the_same_bits(preset):
    assert killed_and_resumed(preset, kills=3, seed=1)[0] >= 3


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_tell_that_is_killed_before_any_of_its_statements_is_kept_whole_or_not_at_all(
    path, preset, pendulum
):
    """And the campaign goes on to the bits of one that was not killed."""
    campaign = flown(stored(path, preset), pendulum)
    second = campaign.test(OTHER_GAINS)
    seen = pendulum.run(second)
    run = tl.Trajectory(seen.t, seen.states, seen.commands)
    log = path.with_name("flight.npz")
    np.savez(log, t=run.t, states=run.states, commands=run.commands)
    campaign.close()
    kept_before = path.read_bytes()
    whole = tl.Campaign.load(path)
    whole.tell(whole.tests[1], run)
    expected = plain(whole)
    whole.close()
    killed, statement = 0, 0
    while True:
        statement += 1
        for leftover in path.parent.glob(f"{path.name}*"):
            leftover.unlink()
        path.write_bytes(kept_before)
        code = exit_code_of(telling, path, log, statement)
        again = tl.Campaign.load(path)
        told = len(again.experiments)
        if code == 0:
            assert told == 2 and plain(again) == expected
            again.close()
            break
        assert code == -signal.SIGKILL and told in (1, 2)
        killed += 1
        if told == 1:
            again.tell(again.tests[1], run)
        assert plain(again) == expected
        again.close()
    assert killed >= 3


def test_the_record_of_a_withdrawn_flight_stays_with_the_reason_and_the_time(path, pendulum):
    campaign = flown(stored(path), pendulum)
    before = rows(path, "experiments")
    campaign.withdraw(0, "the log of another rig")
    ((_, number, record, withdrawn),) = rows(path, "withdrawals")
    assert number == 0 and "the log of another rig" in record and withdrawn.startswith("20")
    assert rows(path, "experiments") == before
    campaign.close()
    again = tl.Campaign.load(path, read_only=True)
    assert again.experiments == () and again.withdrawals[0].reason == "the log of another rig"
    copy = path.with_name("copy.db")
    again.save(copy)
    assert plain(tl.Campaign.load(copy)) == plain(again)


def test_a_withdrawal_that_the_store_refuses_has_not_happened(path, pendulum, monkeypatch):
    campaign = flown(stored(path), pendulum)
    before = plain(campaign)

    def full(*_):
        raise tl.StoreFailure("no room")

    monkeypatch.setattr(Keeper, "keep", full)
    with pytest.raises(tl.StoreFailure):
        campaign.withdraw(0, "why")
    assert plain(campaign) == before and rows(path, "withdrawals") == []


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_withdraw_that_is_killed_before_any_of_its_statements_is_kept_whole_or_not_at_all(path, preset):
    begun = WITHDRAWN_LIFE.index("withdraw")
    lived(stored(path, preset), WITHDRAWN_LIFE[:begun]).close()
    kept_before = path.read_bytes()
    either = [tl.Campaign.load(path, read_only=True)]
    either.append(lived(stored(path.with_name("whole.db"), preset), WITHDRAWN_LIFE[: begun + 1]))
    either = [plain(campaign) for campaign in either]
    ends, statement, code = set(), 0, None
    while code != 0:
        statement += 1
        for leftover in path.parent.glob(f"{path.name}*"):
            leftover.unlink()
        path.write_bytes(kept_before)
        code = exit_code_of(withdrawing, path, statement)
        assert code in (0, -signal.SIGKILL)
        again = tl.Campaign.load(path, read_only=True)
        ends.add(either.index(plain(again)))
    assert statement > 3 and ends == {0, 1}


def test_a_clock_that_jumps_changes_nothing(path, pendulum, monkeypatch):
    """Neither the time of the day nor the one that only goes forward; both jump to and fro at every look."""
    now, outcomes = itertools.cycle([1e9, -1e9, 0.0, 5e8]), []
    for jumping in (False, True):
        where = path.with_name(f"{jumping}.db")
        if jumping:
            monkeypatch.setattr("time.monotonic", lambda: next(now))
            monkeypatch.setattr("time.time", lambda: next(now))
            monkeypatch.setattr("twinloop.store.keeper._now", lambda: "1970-01-01T00:00:00+00:00")
        campaign = flown(stored(where), pendulum)
        test = campaign.ask()
        campaign.tell(test, pendulum.run(test))
        campaign.close()
        again = tl.Campaign.load(where)
        outcomes.append(
            plain(again) + to_text(again.best_test.to_record()).replace(again.best_test.campaign, "")
        )
        again.close()
    assert outcomes[0] == outcomes[1]


def test_the_noise_of_a_system_that_counts_its_runs_goes_on_where_it_was(path):
    def campaign(where):
        system = tl.systems.Quadrotor(noise=1e-3)
        return system, tl.Campaign(
            system.signals, controller=system.controller, initial_state=system.initial_state,
            target_state=system.target_state, duration=1.0, preset="paper", options=TINY, threads=1, store=where,
        )  # fmt: skip

    system, whole = campaign(None)
    whole.run(system, 3)
    for experiments in (1, 2, 3):
        system, moved = campaign(path)
        moved.run(system, experiments)
        moved.close()
    assert system.runs == 3
    assert same([run.trajectory for run in moved.experiments], [run.trajectory for run in whole.experiments])


def test_a_campaign_of_a_record_can_be_saved_and_counts_what_it_flies(path):
    system = tl.systems.Quadrotor(noise=1e-3)
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=1.0, preset="paper", options=TINY, threads=1,
    )  # fmt: skip
    read = tl.Campaign.from_record(campaign.run(system, 1).to_record(), threads=1)
    read.save(path)
    read.run(system, 2).save(path)
    # What a record does not say is not known.
    assert [row[-1] for row in rows(path, "experiments")] == [None, 2]


@pytest.mark.parametrize("first", [None, "hover.db"])
def test_a_copy_of_a_campaign_flies_on_with_the_same_noise_and_knows_its_system(path, first):
    """Whether it had a store of its own or none; also a copy that is brought up to date."""

    def hover(where):
        system = tl.systems.Quadrotor(noise=1e-3)
        campaign = tl.Campaign(
            system.signals, controller=system.controller, initial_state=system.initial_state,
            target_state=system.target_state, duration=1.0, preset="paper", options=TINY, threads=1, store=where,
        )  # fmt: skip
        return system, campaign

    copied = path.with_name("copy.db")
    system, campaign = hover(None if first is None else path)
    for experiments in (1, 2):
        campaign.run(system, experiments)
        campaign.save(copied)
    campaign.close()
    campaign.run(system, 3)
    assert [row[-1] for row in rows(copied, "experiments")] == [1, 2]
    with closing(opened(copied, read_only=True)) as store:
        held = found(store, "campaign")
    assert (held.system["noise"], held.experiments) == (1e-3, 2)
    resumed = invoke("resume", str(copied), "--experiments", "3")
    assert resumed.exit_code == 0, resumed.output
    again = tl.Campaign.load(copied)
    assert same(
        [run.trajectory for run in again.experiments], [run.trajectory for run in campaign.experiments]
    )
    again.close()


def test_another_system_than_the_one_that_was_flown_is_refused(path):
    system = tl.systems.Quadrotor()
    arguments = {
        "controller": system.controller, "initial_state": system.initial_state, "store": path,
        "target_state": system.target_state, "duration": 1.0, "preset": "paper", "options": TINY,
    }  # fmt: skip
    campaign = tl.Campaign(system.signals, **arguments)
    campaign.run(system, 1)
    campaign.close()
    with pytest.raises(tl.InvalidInput, match=r"found another: noise: 0\.0 in the store, 0\.01 now"):
        tl.Campaign(system.signals, **arguments).run(tl.systems.Quadrotor(noise=0.01), 2)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"seed": 4}, "seed: 0 in the store, 4 now"),
        ({"options": {**TINY, "mutants": 5}}, "options: mutants: 3 in the store, 5 now"),
        ({"target_state": [2.0, 0.0]}, "target_state"),
        ({"preset": "default", "options": SMALL}, "preset: 'paper' in the store, 'default' now"),
    ],
)
def test_another_configuration_under_the_same_name_is_refused(path, pendulum, changes, word):
    flown(stored(path), pendulum).close()
    with pytest.raises(tl.InvalidInput, match=word.replace("(", r"\(")):
        stored(path, **changes)
    assert len(stored(path).experiments) == 1  # and nothing is locked or changed by that


def test_several_campaigns_live_in_one_store(path, pendulum):
    one = flown(stored(path, name="one"), pendulum)
    two = stored(path, name="two", seed=1)
    flown(two, pendulum).ask()
    assert [
        (row["name"], row["experiments"], row["tests"]) for row in listed(opened(path, read_only=True))
    ] == [
        ("one", 1, 1),
        ("two", 1, 2),
    ]
    with pytest.raises(tl.InvalidInput, match="one, two"):
        tl.Campaign.load(path, read_only=True)
    with pytest.raises(tl.InvalidInput, match="did you mean 'two'"):
        tl.Campaign.load(path, "twoo", read_only=True)
    assert plain(tl.Campaign.load(path, "two", read_only=True)) == plain(two)
    assert len(one.experiments) == 1


def test_a_campaign_without_a_store_is_saved_and_loaded(path, new_campaign, pendulum):
    campaign = flown(new_campaign(), pendulum)
    campaign.save(path)
    asked = campaign.ask()
    campaign.save(path)  # what is new
    loaded = tl.Campaign.load(path, threads=1)
    assert plain(loaded) == plain(campaign)
    trajectory = pendulum.run(asked)
    campaign.tell(asked, trajectory)
    loaded.tell(asked, trajectory)
    assert same(campaign.ask().genes, loaded.ask().genes)
    loaded.close()
    with pytest.raises(tl.InvalidInput, match="continued separately"):
        new_campaign().save(path)


def test_a_copy_of_a_kept_campaign_is_not_kept(path, pendulum):
    import copy

    campaign = flown(stored(path), pendulum)
    copy.deepcopy(campaign).test(pendulum.default_gains)
    assert len(rows(path, "tests")) == 1


def test_a_command_with_bytes_that_are_no_characters_is_entered_with_their_numbers(path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["twinloop", "run", "rig-\udcff"])
    stored(path).close()
    assert tl.Campaign.load(path, read_only=True).setup is not None
    assert r"rig-\\udcff" in rows(path, "sessions")[0][3]


def test_the_store_says_what_results_come_from(path, pendulum):
    flown(stored(path), pendulum).close()
    stored(path).close()
    held = found(opened(path, read_only=True), None)
    assert [session["versions"]["twinloop"] for session in held.sessions] == [tl.__version__] * 2
    for name in ("numpy", "sqlalchemy", "alembic"):
        assert held.sessions[0]["versions"][name] == metadata.version(name)
    assert held.sessions[0]["versions"]["sqlite"] == sqlite3.sqlite_version
    assert held.sessions[0]["processor"] and held.setup["seed"] == 0
    assert len(rows(path, "experiments")[0][4]) == 64


# Readers and writers


def test_a_second_writer_is_refused_and_a_reader_is_not(path, pendulum):
    campaign = flown(stored(path), pendulum)
    for second in (lambda: stored(path), lambda: tl.Campaign.load(path), lambda: campaign.save(path)):
        with pytest.raises(tl.StoreFailure, match=f"process {os.getpid()}.*twinloop show, read_only=True"):
            second()
    assert len(tl.Campaign.load(path, read_only=True).experiments) == 1
    campaign.close()
    tl.Campaign.load(path).close()


def test_a_second_writer_who_comes_by_a_link_is_refused(path, pendulum):
    """Each would have had a lock beside its own name, and the learning of one would have replaced the other's."""
    campaign = flown(stored(path), pendulum)
    link = path.with_name("link.db")
    link.symlink_to(path.name)
    with pytest.raises(tl.StoreFailure, match="only one who writes"):
        tl.Campaign.load(link)
    campaign.close()
    tl.Campaign.load(link).close()


def test_a_reader_in_the_middle_of_reading_does_not_hold_up_the_writer(path, pendulum):
    campaign = flown(stored(path), pendulum)
    with opened(path, read_only=True).transaction() as reading:
        before = reading.exec_driver_sql("select count(*) from tests").scalar()
        writer = threading.Thread(target=lambda: campaign.test(pendulum.default_gains))
        writer.start()
        writer.join(10.0)
        assert not writer.is_alive()
        assert reading.exec_driver_sql("select count(*) from tests").scalar() == before
    assert len(rows(path, "tests")) == before + 1


def test_the_death_of_a_writer_lets_the_next_one_in(path):
    code = (
        "import sys, os, signal; sys.path.insert(0, sys.argv[1]); from lives import stored;"
        "campaign = stored(sys.argv[2]); os.kill(os.getpid(), signal.SIGKILL)"
    )
    child = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parents[1]), str(path)], check=False
    )
    assert child.returncode == -signal.SIGKILL
    assert path.with_name("hover.db-1.lock").exists()
    stored(path).close()
    assert not path.with_name("hover.db-1.lock").exists()


def test_a_lock_that_is_a_link_is_refused_and_leaves_what_it_leads_to(path):
    stored(path).close()
    other = path.with_name("other.txt")
    other.write_text("mine")
    path.with_name("hover.db-1.lock").symlink_to(other.name)
    with pytest.raises(tl.StoreFailure, match="found a link to another one"):
        tl.Campaign.load(path)
    assert other.read_text() == "mine"


@pytest.mark.parametrize(
    "made",
    [
        "create trigger forget after insert on experiments begin delete from experiments; end",
        "create view tests_again as select * from tests",
    ],
)
def test_a_store_that_would_change_what_is_written_is_refused(path, made):
    stored(path).close()
    with sqlite3.connect(path) as connection:
        connection.execute(made)
    with pytest.raises(tl.InvalidInput, match=r"expected tables alone, found (forget|tests_again)"):
        tl.Campaign.load(path)


# Failures


def full_disk(campaign):
    """From now on the database cannot grow."""
    engine = campaign._keeping._keeper.store.engine
    engine.dispose()

    @event.listens_for(engine, "connect")
    def bound(connection, _):
        connection.execute("PRAGMA max_page_count = 1")


def test_a_full_disk_is_said_and_loses_nothing(path, pendulum):
    campaign = stored(path)
    first = campaign.test(pendulum.default_gains)
    full_disk(campaign)
    with pytest.raises(tl.StoreFailure, match="room on the disk"):
        for _ in range(100):
            before = plain(campaign)
            campaign.tell(first, pendulum.run(first))
    told = len(campaign.experiments)
    assert plain(campaign) == before and told < 100
    campaign.close()
    again = stored(path)
    assert plain(again) == before
    again.tell(first, pendulum.run(first))
    assert len(again.experiments) == told + 1


@pytest.mark.parametrize(("free", "word"), [(0, "expected room on the disk"), (1 << 30, "disk I/O error")])
def test_a_disk_without_room_for_the_index_of_a_log_is_called_full(path, pendulum, monkeypatch, free, word):
    """What SQLite says then is "disk I/O error", which may be anything."""
    campaign = flown(stored(path), pendulum)

    @event.listens_for(campaign._keeping._keeper.store.engine, "before_cursor_execute")
    def fail(*_):
        raise sqlite3.OperationalError("disk I/O error")

    usage = shutil.disk_usage(path.parent)._replace(free=free)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(tl.StoreFailure, match=word):
        campaign.test(OTHER_GAINS)
    assert len(campaign.tests) == 1


def test_what_was_learnt_survives_a_full_disk_in_memory(path, pendulum):
    campaign = flown(stored(path), pendulum)
    full_disk(campaign)
    with pytest.raises(tl.StoreFailure, match="room on the disk"):
        campaign.ask()
    campaign.close()  # goes on without the store
    assert same(campaign.ask().genes, flown(stored(path.with_name("other.db")), pendulum).ask().genes)


@contextmanager
def not_root():
    """Root may write everything: for a moment this process is somebody else."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_store_that_may_not_be_written_is_said(pendulum):
    with TemporaryDirectory() as folder:  # not in pytest's own, which nobody else may enter
        path = Path(folder) / "hover.db"
        flown(stored(path), pendulum).close()
        path.chmod(0o444)
        path.parent.chmod(0o777)
        with not_root(), pytest.raises(tl.StoreFailure, match="right to write"):
            stored(path)


@contextmanager
def on_a_still_medium(*files):
    """Copies of files, the store first, in a folder in which this process may not write."""
    with TemporaryDirectory() as folder:
        copies = [Path(shutil.copy(file, folder)) for file in files]
        for copy in copies:
            copy.chmod(0o444)
        Path(folder).chmod(0o555)
        try:
            with not_root():
                yield copies[0]
        finally:
            Path(folder).chmod(0o755)


def test_a_store_on_a_medium_that_cannot_be_written_is_read(path, pendulum):
    flown(stored(path), pendulum).close()
    with on_a_still_medium(path) as copy:
        assert len(tl.Campaign.load(copy, read_only=True).experiments) == 1


def test_commits_that_are_still_in_the_log_are_never_left_out(path, pendulum):
    """Without the right to write in its folder SQLite cannot read them: the last flights would be missing."""
    flown(stored(path), pendulum).close()
    campaign = tl.Campaign.load(path)
    campaign.tell(campaign.tests[0], pendulum.run(campaign.tests[0]))
    log = path.with_name(f"{path.name}-wal")
    with (
        on_a_still_medium(path, log) as copy,
        pytest.raises(tl.StoreFailure, match=r"hover\.db-wal needs, found none; .* copy both files"),
    ):
        tl.Campaign.load(copy, read_only=True)


def test_a_store_that_another_program_holds_is_not_read_past_it(path, pendulum, monkeypatch):
    monkeypatch.setattr("twinloop.store.database.BUSY_SECONDS", 0.0)
    flown(stored(path), pendulum).close()
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("PRAGMA journal_mode = DELETE")
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(tl.StoreFailure, match="a turn to write"):
            tl.Campaign.load(path, read_only=True)


def test_a_store_that_becomes_read_only_is_said_and_loses_nothing(path, pendulum):
    campaign = stored(path)
    first = campaign.test(pendulum.default_gains)
    engine = campaign._keeping._keeper.store.engine
    engine.dispose()
    event.listen(engine, "connect", lambda connection, _: connection.execute("PRAGMA query_only = ON"))
    with pytest.raises(tl.StoreFailure, match="right to write"):
        campaign.tell(first, pendulum.run(first))
    assert campaign.experiments == ()


def test_a_writer_whose_lock_is_gone_writes_no_more_once_another_one_does(path, pendulum):
    campaign = flown(stored(path), pendulum)
    (lock,) = path.parent.glob("*.lock")
    lock.unlink()
    one_writer_after_another(campaign, path, pendulum)


def test_who_opens_a_campaign_while_another_one_writes_it_is_refused_though_no_lock_is_held(
    path, pendulum, monkeypatch
):
    campaign = flown(stored(path), pendulum)
    (lock,) = path.parent.glob("*.lock")
    lock.unlink()
    read = keeping.found

    def found(*arguments):
        held = read(*arguments)
        campaign.tell(campaign.tests[0], pendulum.run(campaign.tests[0]))
        return held

    monkeypatch.setattr(keeping, "found", found)
    with pytest.raises(tl.StoreFailure, match="only one who writes"):
        stored(path)
    monkeypatch.undo()
    assert len(tl.Campaign.load(path, read_only=True).experiments) == len(campaign.experiments) == 2


def test_a_file_that_is_no_store_is_refused_and_left_as_it_was(path):
    for content in (b"gains,are,here\n" * 100, b"SQLite format 3\x00" + b"\xff" * 5000):
        path.write_bytes(content)
        with pytest.raises(tl.InvalidInput, match="expected a database of Twinloop"):
            stored(path)
        assert path.read_bytes() == content


def test_a_truncated_store_is_refused(path, pendulum):
    flown(stored(path), pendulum).close()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(tl.InvalidInput, match="damaged"):
        stored(path)


def test_a_database_of_something_else_is_refused(path):
    with sqlite3.connect(path) as connection:
        connection.execute("create table flights (number integer)")
    with pytest.raises(tl.InvalidInput, match="something else, with the tables flights"):
        stored(path)
    assert rows(path, "sqlite_master")[0][1] == "flights" and len(rows(path, "sqlite_master")) == 1


def test_a_store_of_a_newer_version_is_refused(path, pendulum):
    flown(stored(path), pendulum).close()
    with sqlite3.connect(path) as connection:
        connection.execute("update alembic_version set version_num = '0999'")
    for call in (stored, tl.Campaign.load, lambda where: tl.Campaign.load(where, read_only=True)):
        with pytest.raises(tl.InvalidInput, match="newer Twinloop"):
            call(path)


def test_a_store_whose_version_is_damaged_is_called_so_and_no_newer_one(path, pendulum):
    flown(stored(path), pendulum).close()
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("pragma wal_checkpoint(truncate)")
    before, _, after = path.read_bytes().partition(
        REVISION.encode()
    )  # in its table, which comes before its index
    path.write_bytes(before + b"0904" + after)
    for read_only in (True, False):
        with pytest.raises(tl.InvalidInput, match="found a damaged one") as refused:
            tl.Campaign.load(path, read_only=read_only)
        assert "newer" not in str(refused.value)


COLUMNS = {
    "campaigns.system": ("[1]", "a dict as JSON", "list"),
    "campaigns.setup": ("7", "a dict as JSON", "7"),
    "campaigns.created": ("yesterday", "a date and time with its zone", "'yesterday'"),
    "campaigns.experiments": ("many", "a whole number", "'many'"),
    "sessions.provenance": ("[]", "a dict as JSON", "list"),
    "sessions.provenance, command": ('{"command": 5}', "a list", "5"),
    "sessions.provenance, versions": ('{"versions": [1]}', "a dict", "list"),
    "experiments.told": ("2026-11-28T10:00:00", "a date and time with its zone", "'2026-11-28T10:00:00'"),
    "experiments.runs": ("a", "a whole number", "'a'"),
    "checkpoints.record": ("[]", "a dict as JSON", "list"),
}


@pytest.mark.parametrize("column", COLUMNS)
def test_a_column_that_somebody_has_changed_is_refused_by_its_name(path, pendulum, column):
    campaign = flown(stored(path, name="hover"), pendulum)
    campaign.ask()  # is learnt and kept
    campaign.close()
    value, expected, seen = COLUMNS[column]
    table, name = column.split(",")[0].split(".")
    with sqlite3.connect(path) as connection:
        connection.execute(f"update {table} set {name} = ?", (value,))
    with closing(opened(str(path), read_only=True)) as store, pytest.raises(tl.InvalidInput) as refused:
        found(store, "hover")
    said = re.escape(f"expected {expected} in {column}, found {seen}; it was changed: use an earlier copy.")
    assert re.fullmatch(rf"Store \S*hover\.db, campaign hover: {said}", str(refused.value))


SAID = {"phase": "terms", "generation": 1, "generations": 2, "told": 1, "experiments": 2, "left": None}
"""What a writer says that it does."""


@pytest.mark.parametrize(
    ("said", "record"),
    [
        ("x", "{}"),
        ("2026-11-28T10:00:00+00:00", "[]"),
        ("2026-11-28T10:00:00+00:00", json.dumps({**SAID, "left": "soon"})),
        ("2026-11-28T10:00:00+00:00", json.dumps(SAID).replace("null", "1e999")),
        ("2026-11-28T10:00:00+00:00", json.dumps({name: SAID[name] for name in SAID if name != "told"})),
    ],
)
def test_a_progress_that_somebody_has_changed_is_refused(path, pendulum, said, record):
    flown(stored(path, name="hover"), pendulum).close()
    with sqlite3.connect(path) as connection:
        connection.execute("insert or replace into progress values (1, ?, ?)", (said, record))
    words = r"in progress\.(said|record), found"
    with closing(opened(str(path), read_only=True)) as store, pytest.raises(tl.InvalidInput, match=words):
        doing(store, "hover")


def test_an_experiment_that_somebody_has_changed_is_refused(path, pendulum):
    flown(stored(path), pendulum).close()
    with sqlite3.connect(path) as connection:
        connection.execute("update experiments set record = replace(record, '0.1', '0.2')")
    with pytest.raises(tl.InvalidInput, match="experiment 0 as it was told"):
        stored(path)


@pytest.mark.parametrize(
    ("where", "word"),
    [
        ("nowhere/hover.db", "existing folder"),
        (".", "a folder"),
        ("hover://somewhere", "address such as"),
    ],
)
def test_a_place_where_no_store_can_be_is_refused(tmp_path, monkeypatch, where, word):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tl.InvalidInput, match=word):
        stored(where)


def test_loading_from_where_nothing_is_makes_nothing(tmp_path):
    with pytest.raises(tl.InvalidInput, match="no such file"):
        tl.Campaign.load(tmp_path / "hover.db")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("missing", ["sqlalchemy", "alembic"])
def test_without_its_packages_the_store_says_what_to_install(path, monkeypatch, missing):
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(tl.NotAvailable, match=r"pip install 'twinloop\[store\]'"):
        stored(path)


@pytest.mark.parametrize("name", ["", "  ", "x" * 201, None, "rig \udcff"])
def test_a_campaign_needs_a_name_in_its_store(path, name):
    with pytest.raises(tl.InvalidInput, match="name"):
        stored(path, name=name)


# Watched


def test_what_is_being_done_is_said_to_whoever_looks_and_ends_with_it(path, pendulum, monkeypatch):
    monkeypatch.setattr(keeping, "BEAT", 0.0)
    campaign, seen = flown(stored(path, preset="default"), pendulum), []

    def look(progress):
        with closing(opened(path, read_only=True)) as store:
            now = doing(store, "campaign")
        assert now.phase == progress.phase and 0.0 <= now.silent < 60.0
        seen.append((now.phase, now.generation, now.left))

    campaign.progress = look
    campaign.run(pendulum, 3)
    assert {"terms", "gains", "experiment"} <= {phase for phase, _, _ in seen}
    # The time left is known once a step was seen to end.
    assert seen[0][2] is None and all(left >= 0.0 for _, _, left in seen[3:])
    with closing(opened(path, read_only=True)) as store:
        assert doing(store, "campaign") is None
    campaign.close()


def test_whatever_is_kept_changes_the_state_also_within_a_second(path, pendulum, monkeypatch):
    monkeypatch.setattr("twinloop.store.keeper._now", lambda: "1970-01-01T00:00:00+00:00")
    seen = []

    def look():
        with closing(opened(path, read_only=True)) as store:
            seen.append(state(store, "campaign"))

    campaign = stored(path)
    look()
    flown(campaign, pendulum)
    look()
    for _ in range(3):
        campaign._keeping._keeper.keep({}, campaign._method.to_record())
        look()
    for experiments in (2, 3):
        campaign._take_up(pendulum, experiments)
        look()
    assert len(set(seen)) == len(seen)
    campaign.close()
    stored(path).close()
    look()
    assert seen[-1] == seen[-2]


def test_who_was_killed_is_known_by_the_time_that_he_has_been_silent(path, pendulum):
    campaign = flown(stored(path), pendulum)
    campaign.close()
    said = ("2020-01-01T00:00:00+00:00", json.dumps(SAID))
    with sqlite3.connect(path) as connection:
        connection.execute("insert into progress values (1, ?, ?)", said)
    with closing(opened(path, read_only=True)) as store:
        assert doing(store, "campaign").silent > 1e6


def test_a_store_that_cannot_be_written_says_nothing_of_what_is_done_and_goes_on(path, pendulum, monkeypatch):
    campaign = flown(stored(path), pendulum)
    monkeypatch.setattr(keeping, "BEAT", 0.0)

    def refused(self, doing):
        raise tl.errors.StoreFailure("no room")

    monkeypatch.setattr(Keeper, "say", refused)
    assert campaign.ask().number == 1
    campaign.close()

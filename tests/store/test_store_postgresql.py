"""The same store on a PostgreSQL server, which the test starts; skipped where there is none, but never in CI."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from click.testing import CliRunner
from sqlalchemy import create_engine, text
from sqlalchemy.event import listens_for

import twinloop as tl
from lives import (
    EVENTS,
    FULL_LIFE,
    LIFE,
    OTHER_GAINS,
    PLANT,
    WITHDRAWN_LIFE,
    begun,
    behind_commits,
    flown,
    lived,
    one_writer_after_another,
    plain,
    stored,
)
from needed import lacking, needed
from old_store import old_store
from sameness import same
from twinloop.campaign import keeping
from twinloop.faces.cli import main
from twinloop.logs import write_columns
from twinloop.store import listed, opened
from twinloop.store.lock import AdvisoryLock

needed("psycopg", "the driver psycopg is not installed")
if not (shutil.which("initdb") and shutil.which("pg_ctl")):
    lacking("no PostgreSQL server (initdb, pg_ctl) is installed")


@pytest.fixture(scope="module")
def server():
    """The address of a server of our own, on a socket in a folder of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        who = {}
        if os.geteuid() == 0:  # PostgreSQL does not run as root
            shutil.chown(folder, "nobody")
            who = {"user": "nobody", "group": "nogroup", "extra_groups": []}
        data = str(folder / "data")

        def run(*command):
            # Into a file: the server keeps what it was started with, and a pipe would never end.
            with (folder / "said").open("w") as said:
                done = subprocess.run(command, stdout=said, stderr=said, cwd=folder, check=False, **who)
            assert done.returncode == 0, (folder / "said").read_text()

        run("initdb", "-D", data, "-A", "trust", "-U", "hover", "--no-sync")
        options = f"-c listen_addresses='' -k {folder}"
        run("pg_ctl", "-D", data, "-w", "-l", str(folder / "log"), "-o", options, "start")
        yield f"postgresql+psycopg://hover@/postgres?host={folder}"
        run("pg_ctl", "-D", data, "-m", "immediate", "stop")


def fresh(server, name):
    """A database of its own on the server."""
    engine = create_engine(server, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"create database {name}"))
    engine.dispose()
    return server.replace("/postgres?", f"/{name}?")


@pytest.mark.parametrize("life", [LIFE, WITHDRAWN_LIFE])
@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_on_a_server_is_the_one_in_a_file(server, tmp_path, preset, life):
    address = fresh(server, f"same_{preset}_{len(life)}")

    def reopened(campaign, step):
        campaign.close()
        return tl.Campaign.load(address, threads=1) if step % 2 else stored(address, preset)

    in_file = lived(stored(tmp_path / "hover.db", preset), life)
    on_server = lived(stored(address, preset), life, reopened)
    assert plain(on_server) == plain(in_file)
    assert same(on_server.best_test.genes, in_file.best_test.genes)
    on_server.close()


@pytest.mark.parametrize("event", EVENTS)
def test_ctrl_c_behind_a_commit_leaves_memory_and_server_alike(server, pendulum, monkeypatch, event):
    address = fresh(server, f"interrupted_{event}")
    campaign = flown(stored(address, "default"), pendulum)
    campaign.test(OTHER_GAINS)
    run = pendulum.run(campaign.tests[0])
    interrupting = behind_commits(monkeypatch, lambda: signal.raise_signal(signal.SIGINT))
    with interrupting, pytest.raises(KeyboardInterrupt):
        EVENTS[event](campaign, run)
    later = campaign.test(OTHER_GAINS)
    campaign.tell(later, pendulum.run(later))
    assert plain(campaign) == plain(tl.Campaign.load(address, read_only=True))
    campaign.close()


def test_a_second_writer_is_refused_and_a_reader_is_not(server, pendulum):
    address = fresh(server, "writers")
    campaign = flown(stored(address, name="one"), pendulum)
    with pytest.raises(tl.StoreFailure, match="only one who writes"):
        stored(address, name="one")
    other = stored(address, name="two", seed=1)
    assert len(tl.Campaign.load(address, "one", read_only=True).experiments) == 1
    source = opened(address, read_only=True)
    assert [row["name"] for row in listed(source)] == ["one", "two"]
    source.close()
    campaign.close()
    other.close()
    tl.Campaign.load(address, "one").close()


def test_a_reader_sees_one_moment_while_others_write(server, pendulum, monkeypatch):
    address = fresh(server, "moments")
    campaign = flown(stored(address), pendulum)
    opened_to_read, writes = keeping.opened, []

    def opened_beside_a_writer(*where, **how):
        source = opened_to_read(*where, **how)

        @listens_for(source.engine, "before_cursor_execute")
        def write(connection, cursor, statement, *_):
            if "FROM experiments" in statement and "count" not in statement and not writes:
                writes.append(statement)
                test = campaign.test(OTHER_GAINS)
                campaign.tell(test, pendulum.run(test))

        return source

    monkeypatch.setattr(keeping, "opened", opened_beside_a_writer)
    before = tl.Campaign.load(address, read_only=True)
    assert writes and (len(before.tests), len(before.experiments)) == (1, 1)
    after = tl.Campaign.load(address, read_only=True)
    assert (len(after.tests), len(after.experiments)) == (2, 2)
    campaign.close()


def test_a_lock_that_was_released_is_free_before_the_server_notices_that_its_connection_has_ended(server):
    engine = create_engine(server)

    class Lingering:
        """A connection that lives on where it is ended."""

        def __init__(self):
            self.connection = engine.connect()
            self.execute, self.commit = self.connection.execute, self.connection.commit

        def invalidate(self):
            pass

        close = invalidate

    first = Lingering()
    lock = AdvisoryLock(first, 7, "it")
    with pytest.raises(tl.errors.StoreFailure, match="found another one"):
        AdvisoryLock(engine.connect(), 7, "it")
    lock.release()
    again = AdvisoryLock(engine.connect(), 7, "it")
    again.release()
    first.connection.close()
    # One whose connection the server has ended is released, too.
    gone = AdvisoryLock(engine.connect(), 7, "it")
    gone._connection.connection.dbapi_connection.close()
    gone.release()
    engine.dispose()


def test_a_writer_whose_lock_the_server_has_ended_writes_no_more_once_another_one_does(server, pendulum):
    address = fresh(server, "lost")
    campaign = flown(stored(address), pendulum)
    lost = campaign._keeping._keeper._lock._connection
    engine = create_engine(address)
    with engine.begin() as connection:
        number = lost.connection.dbapi_connection.info.backend_pid
        assert connection.execute(
            text("select pg_terminate_backend(:number, 5000)"), {"number": number}
        ).scalar()
    engine.dispose()
    one_writer_after_another(campaign, address, pendulum)


MAPPING = """
[autopilot]
kind = "px4"
[autopilot.parameters]
"angle.kp" = "MC_PITCH_P"
"angle.ki" = "MC_PITCH_I"
"angle.kd" = "MC_PITCH_D"
"""


def test_what_is_taken_away_comes_from_a_server_as_from_a_file(server, tmp_path, monkeypatch):
    """Also: a password that stands in the address is printed and written nowhere."""
    address = fresh(server, "taken").replace("hover@", "hover:secret@")
    monkeypatch.setattr(sys, "argv", ["twinloop", "run", "--store", address])
    campaign = begun(name="rig", store=address)
    campaign.ask()
    campaign.close()
    campaign.save(tmp_path / "rig.db", name="rig")
    (tmp_path / "mapping.toml").write_text(MAPPING, encoding="utf-8")
    said = []
    for where, folder in ((address, "server"), (str(tmp_path / "rig.db"), "file")):
        to = ["-o", str(tmp_path / folder), "--mapping", str(tmp_path / "mapping.toml")]
        for arguments in (
            ["certify", where, *to],
            ["settings", where, "1", *to],
            ["export", where, "--to", "python", "--force"],
            ["show", where],
            ["report", where, "-o", str(tmp_path / f"{folder}.html")],
        ):
            done = CliRunner().invoke(main, arguments)
            assert done.exit_code in (0, arguments[0] == "certify"), done.stderr
            said.append((arguments[0], done.stdout + done.stderr))
    half = len(said) // 2
    assert [words for verb, words in said[:half] if verb == "export"] == [
        words for verb, words in said[half:] if verb == "export"
    ]
    written = sorted(path.name for path in (tmp_path / "file").iterdir())
    assert written == sorted(path.name for path in (tmp_path / "server").iterdir()) and len(written) >= 5
    for name in written:
        texts = [(tmp_path / folder / name).read_text("utf-8") for folder in ("server", "file")]
        assert name.startswith("certificate") or texts[0] == texts[1]
        assert "secret" not in texts[0]
    assert all("secret" not in words for _, words in said)
    assert "secret" not in (tmp_path / "server.html").read_text("utf-8")
    refused = CliRunner().invoke(main, ["settings", address, "1", *to[:2], "--autopilot", "px4"])
    assert refused.exit_code == 2 and "--mapping" in refused.stderr


def test_a_person_flies_a_campaign_on_a_server(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    address = fresh(server, "by_hand").replace("hover@", "hover:secret@")
    campaign = begun(store=address)
    campaign.close()
    asked = CliRunner().invoke(main, ["ask", address])
    assert asked.exit_code == 0 and "TEST 1" in asked.stdout and "secret" not in asked.stdout
    assert (tmp_path / "by_hand-test-1.csv").is_file()
    run = PLANT.run(tl.Campaign.load(address, read_only=True).tests[1])
    columns = {"t": run.t, "angle": run.states[:, 0], "rate": run.states[:, 1], "torque": run.commands[:, 0]}
    write_columns(tmp_path / "flight.csv", columns)
    told = CliRunner().invoke(main, ["tell", address, "1", "flight.csv"])
    assert told.exit_code == 0 and "2 experiments" in told.stdout and "secret" not in told.stdout
    assert tl.Campaign.load(address, read_only=True).experiments[1].number == 1


def test_the_death_of_a_writer_lets_the_next_one_in(server):
    address = fresh(server, "death")
    code = (
        "import sys, os, signal; sys.path.insert(0, sys.argv[1]); from lives import stored;"
        "campaign = stored(sys.argv[2]); os.kill(os.getpid(), signal.SIGKILL)"
    )
    child = subprocess.run([sys.executable, "-c", code, str(Path(__file__).parents[1]), address], check=False)
    assert child.returncode == -signal.SIGKILL
    for _ in range(100):  # the server sees the death of its client a moment later
        try:
            stored(address).close()
            return
        except tl.StoreFailure:
            continue
    raise AssertionError("still locked")


def test_a_server_that_is_not_there_is_said(tmp_path):
    with pytest.raises(tl.StoreFailure, match="no stored data is lost"):
        stored(f"postgresql+psycopg://hover:secret@/postgres?host={tmp_path}")


def test_a_store_of_the_first_version_on_a_server_is_brought_up_to_date_with_all_that_is_in_it(
    server, tmp_path
):
    new, address = tmp_path / "new.db", fresh(server, "migrated")
    lived(stored(new, "default"), FULL_LIFE).close()
    old_store(address, new)
    in_file, on_server = tl.Campaign.load(new, threads=1), tl.Campaign.load(address, threads=1)
    assert plain(on_server) == plain(in_file)
    assert same(on_server.ask().genes, in_file.ask().genes)
    on_server.close()

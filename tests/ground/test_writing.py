"""A file is the old one or the new one, whole, whatever refuses the new one, and the new one is on the disk."""

import os
import stat
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from twinloop._ground.writing import write_whole
from twinloop.faces.figures.figure import Figure, Panel
from twinloop.faces.plots import _figure, _save
from twinloop.law.exports.export import delivered
from twinloop.logs import write_columns
from twinloop.systems import Folder

resource = pytest.importorskip("resource", reason="a limit for files is how a disk gets full here")


@contextmanager
def a_disk_with_room_for(size):
    """Whatever grows beyond is refused by the operating system, half-way."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


WRITERS = {
    "a text": lambda path: write_whole(path, "new " * 1000),
    "a table": lambda path: write_columns(path, {"t": np.linspace(0.0, 1.0, 1000)}),
    "an export": lambda path: delivered({path.suffix: "new " * 1000}, "twin", path),
    "a figure": lambda path: Figure("f", "t", [Panel("p", [])]).save(path),
    "a picture": lambda path: _save(_figure(2.0, 2.0), path),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_on_a_full_disk_the_old_file_stays_and_nothing_beside_it(tmp_path, writer):
    path = tmp_path / "file.svg"
    path.write_text("old")
    with a_disk_with_room_for(500), pytest.raises((OSError, tl.InvalidInput), match=r"file\.svg"):
        WRITERS[writer](path)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    WRITERS[writer](path)
    assert path.stat().st_size > 500


def test_a_sheet_that_a_full_disk_refused_is_written_by_the_next_run(
    tmp_path, pendulum_signals, pendulum_controller
):
    family = pendulum_controller.bind(pendulum_signals)
    test = tl.Test(family, family.genes(PENDULUM_GAINS), [0.0, 0.0], [1.0, 0.0], 20, number=3)
    rig = Folder(tmp_path, pendulum_signals, timeout=0.01, settled=0.01)
    with a_disk_with_room_for(100), pytest.raises(OSError, match=r"test-0003\.json"):
        rig.run(test)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(tl.errors.NoAnswer):
        rig.run(test)
    assert [file.name for file in tmp_path.iterdir()] == ["test-0003.json"]


def test_contents_are_on_the_disk_before_they_get_their_name_and_the_name_is_behind(tmp_path, monkeypatch):
    done = []
    replace, fsync = os.replace, os.fsync

    def synced(number):
        done.append("folder" if stat.S_ISDIR(os.fstat(number).st_mode) else "file")
        fsync(number)

    def named(*paths):
        done.append("name")
        replace(*paths)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", named)
    write_columns(tmp_path / "flight.csv", {"t": np.zeros(2)})
    assert done == ["file", "name", "folder"]


def test_a_database_is_never_replaced_not_even_behind_a_link(tmp_path):
    store = tmp_path / "rig.db"
    store.write_bytes(b"SQLite format 3\0" + bytes(100))
    link = tmp_path / "report.html"
    link.symlink_to(store.name)
    for path in (store, link):
        with pytest.raises(tl.InvalidInput, match="expected no database there"):
            write_whole(path, "<html>")
    assert store.stat().st_size == 116


def test_a_folder_that_cannot_be_put_on_the_disk_is_no_failure(tmp_path, monkeypatch):
    fsync = os.fsync

    def refused(number):
        if stat.S_ISDIR(os.fstat(number).st_mode):
            raise OSError(22, "Invalid argument")
        fsync(number)

    monkeypatch.setattr(os, "fsync", refused)
    write_whole(tmp_path / "flight.csv", b"t\n0.0\n")
    assert (tmp_path / "flight.csv").read_bytes() == b"t\n0.0\n"


def test_a_link_stays_one_and_what_it_leads_to_keeps_its_rights(tmp_path):
    there, link = tmp_path / "there" / "sheet.csv", tmp_path / "sheet.csv"
    there.parent.mkdir()
    there.write_text("old")
    there.chmod(0o640)
    link.symlink_to(there)
    write_whole(link, "new\n")
    assert link.is_symlink() and there.read_bytes() == b"new\n"
    assert stat.S_IMODE(there.stat().st_mode) == 0o640


def test_a_pipe_is_written_into_and_stays_one(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reading = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, "through")
    assert os.read(reading, 100) == b"through" and stat.S_ISFIFO(pipe.stat().st_mode)
    os.close(reading)


def test_a_file_that_may_not_be_written_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / "restore.params"
    path.write_text("old")
    opened = Path.open

    def protected(self, mode="r", *arguments, **how):
        if self == path and "r" not in mode:
            raise PermissionError(13, "Permission denied")
        return opened(self, mode, *arguments, **how)

    monkeypatch.setattr(Path, "open", protected)  # root may write all files, whatever their rights
    with pytest.raises(PermissionError, match=r"restore\.params"):
        write_whole(path, "new")
    monkeypatch.undo()
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]

"""Logs as CSV: a file that ends within a number is refused, one that ends behind it is read."""

import zipfile

import numpy as np
import pytest

import twinloop as tl

SIGNALS = tl.Signals(
    [tl.State("temp", "degC", scale=60.0)], [tl.Command("power", "W", bounds=(0.0, 2000.0))], dt=10.0
)
ROWS = "t,temp,power\n0.0,20.5,1500.0\n10.0,41.25,800.5\n"


def loaded(tmp_path, text, signals=SIGNALS):
    path = tmp_path / "flight.csv"
    path.write_text(text, newline="")
    return tl.load(path, signals)


@pytest.mark.parametrize("end", ["20.0,4", "20.0,49.6515", "2", "20.0", "20.0,"])
def test_a_log_that_ends_within_a_number_is_refused_with_its_line(tmp_path, end):
    with pytest.raises(tl.InvalidInput, match=r"flight\.csv") as refusal:
        loaded(tmp_path, ROWS + end)
    assert "line 4" in str(refusal.value)


def test_what_may_be_a_part_of_a_number_is_named(tmp_path):
    with pytest.raises(tl.InvalidInput, match=r"ends at '4', which may be a part of temp; remove this row"):
        loaded(tmp_path, ROWS + "20.0,4")
    with pytest.raises(tl.InvalidInput, match="may be a part of temp"):
        loaded(tmp_path, ROWS.replace("\n", "\r\n") + "20.0,4")


@pytest.mark.parametrize(
    "end",
    [",", "\n", "\r\n", "\n ", ",\n", ",62", ",625.5"],
    ids=["comma", "end", "windows", "blank", "both", "cut", "whole"]
)  # fmt: skip
def test_a_log_that_ends_behind_its_last_reading_is_read_whether_its_command_is_there(tmp_path, end):
    run = loaded(tmp_path, ROWS + "20.0,49.5" + end)
    np.testing.assert_array_equal(run.states[:, 0], [20.5, 41.25, 49.5])
    np.testing.assert_array_equal(run.commands[:, 0], [1500.0, 800.5])


def test_a_row_of_all_cells_needs_no_line_end(tmp_path):
    run = loaded(tmp_path, "t,power,temp\n0.0,1500.0,20.5\n10.0,800.5,41.25\n20.0,,49.5")
    np.testing.assert_array_equal(run.states[:, 0], [20.5, 41.25, 49.5])


def test_a_line_far_too_long_is_refused_before_it_is_taken_apart(tmp_path):
    with pytest.raises(tl.InvalidInput, match=r"line 3: expected at most 1000000 characters"):
        loaded(tmp_path, ROWS.split("\n")[0] + "\n0.0,20.5,1500.0\n" + "1," * 600_000)


def test_a_log_is_held_in_numbers_not_in_text(tmp_path):
    import tracemalloc

    rows = "".join(
        f"{10.0 * k:.1f},{20.0 + k / 7:.6f},{k % 2000}.25,a note that nobody reads\n" for k in range(20_000)
    )
    text = ROWS.split("\n")[0] + ",note\n" + rows
    path = tmp_path / "flight.csv"
    path.write_text(text)
    tracemalloc.start()
    run = tl.load(path, SIGNALS)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert run.steps == 19_999 and most < 4 * len(text)


def test_bytes_in_the_place_of_an_array_are_refused(tmp_path):
    path = tmp_path / "flight.npz"
    np.savez(path, t=np.arange(3.0), commands=np.zeros((3, 1)))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("states", "hello")
    with pytest.raises(tl.InvalidInput, match="expected an array states"):
        tl.load(path, SIGNALS)

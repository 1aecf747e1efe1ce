"""Columns that are missing in a log are paired with those that are probably meant, each with its own."""

import numpy as np
import pytest

import twinloop as tl
from twinloop.logs.files import ELSEWHERE
from twinloop.logs.headers import listed

SIGNALS = tl.Signals(
    [
        tl.State("roll", "rad", 1.0),
        tl.State("pitch", "rad", 1.0),
        tl.State("p", "rad/s", 5.0),
        tl.State("roll_rate", "rad/s", 5.0),
    ],
    [tl.Command("tx", "1", (-1.0, 1.0)), tl.Command("tz", "1", (-1.0, 1.0))],
    dt=0.02,
)
NONE_ALIKE = "name columns as the signals are named."
NAMES = ["t", "roll", "pitch", "p", "roll_rate", "tx", "tz"]


def refused(tmp_path, names):
    path = tmp_path / "log.csv"
    path.write_text(",".join(names) + "\n" + ",".join("0" * len(names)) + "\n", encoding="utf-8")
    with pytest.raises(tl.InvalidInput) as refusal:
        tl.load(path, SIGNALS)
    said = str(refusal.value).partition(" missing: ")[2]
    assert said.endswith(ELSEWHERE)
    return said.removesuffix(ELSEWHERE)


@pytest.mark.parametrize(
    "header",
    [
        ["t [s]", "roll [rad]", "pitch [rad]", "p [rad/s]", "roll_rate [rad/s]", "tx [1]", "tz [1]"],
        ["Time (s)", "Roll (rad)", "Pitch (rad)", "P (rad/s)", "Roll_Rate (rad/s)", "TX", "TZ"],
        ["t_s", "roll_rad", "pitch_rad", "p_rad_s", "roll_rate_radps", "tx_1", "tz_1"],
        ["timestamp", "roll_deg", "pitch_deg", "p_deg_s", "roll_rate_degps", "TX", "Tz"],
    ],
)
def test_each_name_is_paired_with_its_own_column_with_its_unit(tmp_path, header):
    pairs = ", ".join(f"{column!r} for {name}" for name, column in zip(NAMES, header, strict=True))
    assert refused(tmp_path, header) == f"did you mean {pairs}?"
    assert refused(tmp_path, header[::-1]) == f"did you mean {pairs}?"


def test_a_column_that_another_signal_has_is_not_suggested(tmp_path):
    assert refused(tmp_path, NAMES[:-1]) == NONE_ALIKE  # no tz, and t is none
    assert refused(tmp_path, ["timestamp", *NAMES[1:]]) == "did you mean 'timestamp' for t?"
    assert refused(tmp_path, ["t", "rol", *NAMES[2:]]) == "did you mean 'rol' for roll?"
    assert refused(tmp_path, ["t", *NAMES[2:]]) == NONE_ALIKE  # roll_rate is no roll


def test_a_column_in_another_unit_is_said_to_be(tmp_path):
    said = refused(tmp_path, ["t", "roll [deg]", *NAMES[2:]])
    assert said == "did you mean 'roll [deg]' for roll (which is in rad)?"


def test_a_list_that_is_cut_says_so():
    assert listed([f"c{k}" for k in range(20)]).endswith("c18, c19")
    assert listed([f"c{k}" for k in range(21)]).endswith("c18, c19, …") and listed([]) == "none"


THEIRS = ["Time", "IMU roll", "IMU pitch", "wx", "IMU rate", "Out 1", "Out 2"]
COLUMNS = dict(zip(NAMES, THEIRS, strict=True))


def loaded(tmp_path, header, columns, rows=3):
    """A log whose k-th column is k tenths of the time."""
    path = tmp_path / "log.csv"
    table = [[f"{0.02 * row * (1 + 0.1 * place):.6f}" for place in range(len(header))] for row in range(rows)]
    path.write_text("\n".join(",".join(row) for row in [header, *table]) + "\n", encoding="utf-8")
    return tl.load(path, SIGNALS, columns=columns)


@pytest.mark.parametrize("theirs", [NAMES, [], ["t"], ["roll", "tz"]], ids=len)
def test_columns_of_other_names_are_read_where_they_are_named(tmp_path, theirs):
    columns = {name: COLUMNS[name] for name in NAMES if name not in theirs}
    header = [columns.get(name, name) for name in NAMES]
    run = loaded(tmp_path, header, columns)
    own = loaded(tmp_path, NAMES, None)
    for one, other in ((run.t, own.t), (run.states, own.states), (run.commands, own.commands)):
        np.testing.assert_array_equal(one, other)


def test_a_log_that_has_the_signals_own_names_needs_no_others(tmp_path):
    own = loaded(tmp_path, NAMES, None)
    with pytest.warns(
        tl.RemarkWarning, match=r"No column is called 'Time', .*: t, roll, .* are read from the columns"
    ):
        there = loaded(tmp_path, NAMES, COLUMNS)
    np.testing.assert_array_equal(there.states, own.states)


def test_a_mistyped_column_is_said_to_be_absent_and_blanks_around_a_name_do_not_count(tmp_path):
    header = [*NAMES, "IMU roll "]
    with pytest.warns(
        tl.RemarkWarning, match="No column is called 'IMU rol': roll is read from the column of that"
    ):
        loaded(tmp_path, header, {"roll": "IMU rol"})
    run = loaded(tmp_path, header, {"roll": " IMU roll "})
    np.testing.assert_allclose(run.states[:, 0], 1.7 * run.t, atol=1e-6)


def test_a_column_that_was_named_comes_before_one_of_the_signals_own_name(tmp_path):
    run = loaded(tmp_path, [*NAMES, "IMU roll"], {"roll": "IMU roll"})
    np.testing.assert_allclose(run.states[:, 0], 1.7 * run.t, atol=1e-6)


def test_two_columns_may_be_exchanged_by_their_names(tmp_path):
    run = loaded(tmp_path, NAMES, {"roll": "pitch", "pitch": "roll"})
    np.testing.assert_array_equal(run.states[:, [1, 0]], loaded(tmp_path, NAMES, None).states[:, :2])


def test_a_column_that_is_mistyped_is_named_where_the_signal_is_missing_too(tmp_path):
    header = ["Roll (rad)" if name == "roll" else name for name in NAMES]
    with pytest.raises(tl.InvalidInput) as refusal:
        loaded(tmp_path, header, {"roll": "Rol (rad)", "p": "gyro x"})
    said = str(refusal.value)
    assert (
        "; roll ('Rol (rad)' under [log], or by `columns`) is missing: did you mean 'Roll (rad)' for roll?"
        in said
    )
    header = ["gyro z [rad/s]" if name == "p" else name for name in NAMES if name != "roll"]
    with pytest.raises(tl.InvalidInput) as refusal:
        loaded(tmp_path, header, {"p": "gyro_z [rad/s] "})
    said = str(refusal.value)
    assert "; roll, p ('gyro_z [rad/s]' under [log], or by `columns`) are missing: did you mean" in said
    assert "'gyro z [rad/s]' for p?" in said


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"rol": "IMU roll"}, "roll"),
        ({"roll": "A", "pitch": "A"}, "expected a column of its own for 'pitch', found 'A' for 'roll', too"),
        ([("roll", "IMU roll")], "expected a column's name for each signal's"),
        ({"roll": 3}, "expected a column of its own for 'roll', found 3"),
    ],
)
def test_names_of_no_signal_or_of_two_are_refused(tmp_path, columns, said):
    with pytest.raises(tl.InvalidInput) as refusal:
        loaded(tmp_path, NAMES, columns)
    assert said in str(refusal.value)


def test_what_is_missing_is_said_beside_the_columns_that_the_log_has(tmp_path):
    with pytest.raises(tl.InvalidInput, match=r"found Time, IMU roll.*t (is|are) missing|t, roll"):
        loaded(tmp_path, THEIRS, {name: COLUMNS[name] for name in NAMES if name != "t"})


def test_a_unit_in_the_header_that_is_not_the_signals_is_noted(tmp_path):
    header = ["Roll [deg]" if name == "roll" else name for name in NAMES]
    with pytest.warns(tl.RemarkWarning, match=r"'Roll \[deg\]' is read as roll, which is in rad"):
        loaded(tmp_path, header, {"roll": "Roll [deg]"})

"""Columns that are missing in a log are paired with those that are probably meant, each with its own."""

import pytest

import twinloop as tl
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
NAMES = ["t", "roll", "pitch", "p", "roll_rate", "tx", "tz"]


def refused(tmp_path, names):
    path = tmp_path / "log.csv"
    path.write_text(",".join(names) + "\n" + ",".join("0" * len(names)) + "\n", encoding="utf-8")
    with pytest.raises(tl.InvalidInput) as refusal:
        tl.load(path, SIGNALS)
    return str(refusal.value).partition(" missing: ")[2]


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
    assert refused(tmp_path, NAMES[:-1]) == "name columns as the signals are named."  # no tz, and t is none
    assert refused(tmp_path, ["timestamp", *NAMES[1:]]) == "did you mean 'timestamp' for t?"
    assert refused(tmp_path, ["t", "rol", *NAMES[2:]]) == "did you mean 'rol' for roll?"
    assert (
        refused(tmp_path, ["t", *NAMES[2:]]) == "name columns as the signals are named."
    )  # roll_rate is no roll


def test_a_column_in_another_unit_is_said_to_be(tmp_path):
    said = refused(tmp_path, ["t", "roll [deg]", *NAMES[2:]])
    assert said == "did you mean 'roll [deg]' for roll (which is in rad)?"


def test_a_list_that_is_cut_says_so():
    assert listed([f"c{k}" for k in range(20)]).endswith("c18, c19")
    assert listed([f"c{k}" for k in range(21)]).endswith("c18, c19, …") and listed([]) == "none"

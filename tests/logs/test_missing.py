"""Single readings that a log lacks are put half-way between their neighbours; two in a row are not made up."""

import numpy as np
import pytest

import twinloop as tl
from twinloop.errors import RemarkWarning
from twinloop.logs.missing import filled

STATES = [tl.State("x", "m", 1.0), tl.State("yaw", "deg", 180.0, periodic=360.0)]
SIGNALS = tl.Signals(STATES, [tl.Command("u", "N", (-1.0, 1.0))], dt=0.1)


def readings(rows=60):
    t = np.arange(rows)
    return np.column_stack([np.sin(t / 9), (10.0 * t + 180.0) % 360.0 - 180.0])


def without(places):
    found = readings()
    for row, column in places:
        found[row, column] = np.nan
    return found


def test_readings_without_gaps_stay():
    whole = readings()
    assert filled(whole, STATES) == (whole, ())


def test_a_single_one_is_filled_in_and_counted_by_its_state():
    found, (remark,) = filled(without([(7, 0), (9, 0), (18, 1)]), STATES)
    assert found[[7, 9], 0] == pytest.approx(readings()[[7, 9], 0], abs=0.01)
    # Row 18 is where the heading jumps from 170 to -170 degrees.
    assert found[18, 1] % 360.0 == pytest.approx(180.0) and readings()[17:20:2, 1].tolist() == [170.0, -170.0]
    assert "2 of x and 1 of yaw: each is taken half-way" in remark.sentence and not remark.serious
    there = np.isfinite(without([(7, 0), (9, 0), (18, 1)]))
    assert (found[there] == readings()[there]).all()


def test_where_an_angle_may_have_wrapped_and_nobody_says_so_nothing_is_made_up():
    undeclared = [STATES[0], tl.State("yaw", "deg", 180.0)]
    holes = without([(18, 1)])
    found, remarks = filled(holes, undeclared)
    assert remarks == () and np.isnan(found[18, 1])
    # Half a turn and more between two readings of a wheel's angle is no jump that is known.
    wheel = np.column_stack([3.0 * np.arange(60)])
    wheel[30] = np.nan
    assert filled(wheel, [tl.State("turned", "1", 100.0)])[0][30] == pytest.approx(90.0)
    assert np.isnan(filled(wheel, [tl.State("turned", "rad", 100.0)])[0][30]).all()


@pytest.mark.parametrize("rows", [[7, 8], [0], [59], [5, 9, 13, 17], [20, 21, 30]])
def test_two_in_a_row_ends_and_many_are_not(rows):
    holes = without([(row, 0) for row in rows])
    found, remarks = filled(holes, STATES)
    assert remarks == () and np.isnan(found[rows, 0]).all()


def test_what_is_infinite_is_no_missing_reading():
    holes = readings()
    holes[7, 0] = np.inf
    assert filled(holes, STATES)[1] == ()


@pytest.mark.parametrize("kind", [".csv", ".npz"])
def test_a_log_with_them_is_read_with_a_warning_and_a_command_may_not_be_missing(tmp_path, kind):
    def loaded(states, commands):
        path, t = tmp_path / f"log{kind}", 0.1 * np.arange(60)
        if kind == ".npz":
            np.savez(path, t=t, states=states, commands=commands)
        else:
            rows = [
                ",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row)
                for row in np.column_stack([t, states, commands])
            ]
            path.write_text("\n".join(["t,x,yaw,u", *rows]) + "\n")
        return tl.load(path, SIGNALS)

    commands = np.zeros((60, 1))
    with pytest.warns(RemarkWarning, match=r"1 of x: it is taken half-way .* \(filled-in\)"):
        run = loaded(without([(7, 0)]), commands)
    assert run.states[7, 0] == pytest.approx(readings()[7, 0], abs=0.01)
    commands[7] = np.nan
    with pytest.raises(tl.InvalidInput, match="expected a finite number for u"):
        loaded(readings(), commands)


def test_only_of_a_reading_is_it_said_that_its_cell_may_be_empty(tmp_path):
    path = tmp_path / "log.csv"
    for broken, said in (("0.1,#N/A,0,0", "leave the cell empty"), ("0.1,0,0,#N/A", "; correct it.")):
        path.write_text(f"t,x,yaw,u\n0,0,0,0\n{broken}\n0.2,0,0,0\n0.3,0,0,0\n")
        with pytest.raises(tl.InvalidInput, match=said):
            tl.load(path, SIGNALS)

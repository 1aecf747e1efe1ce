"""`twinloop check`: what is wrong with a log is said before it is told, each fault by its own name."""

import json
import pickle
import re

import numpy as np
import pytest

import twinloop as tl
from command import invoke
from lives import RIG, SIGNALS, by_hand
from twinloop.logs import write_columns
from twinloop.trajectory import check_recorded

FULL = RIG.replace('derivative_of = "angle"', 'derivative_of = "angle"\nenvelope = [-12.0, 12.0]')


@pytest.fixture
def checked(tmp_path):
    """What is said of a good log after it was changed."""

    def look(change=lambda log: None, *more):
        run, noise = by_hand(120, seed=2), np.random.default_rng(1)
        states = run.states + noise.normal(size=run.states.shape) * [1e-3, 5e-3]
        log = {"t": run.t, "angle": states[:, 0], "rate": states[:, 1], "torque": run.commands[:, 0]}
        log = {name: values.copy() for name, values in log.items()}
        change(log)
        (tmp_path / "rig.toml").write_text(FULL)
        write_columns(tmp_path / "flight.csv", log)
        return invoke("check", str(tmp_path / "flight.csv"), str(tmp_path / "rig.toml"), *more)

    return look


def test_nothing_is_said_against_a_good_log(checked):
    said = checked()
    assert said.exit_code == 0 and "The log can be used for learning." in said.stdout
    assert "121 rows over 6 s, one in 50 ms (20 Hz)" in said.stdout and "✗" not in said.stdout
    assert "○" not in said.stdout
    found = json.loads(checked(lambda log: None, "--json").stdout)
    assert found["fit"] and found["gaps"] == 0 and found["period"] == pytest.approx(0.05)
    angle, rate, torque = found["columns"]
    noise = {"angle": 1e-3, "rate": 5e-3}
    for column, values in (
        (angle, by_hand(120, seed=2).states[:, 0]),
        (rate, by_hand(120, seed=2).states[:, 1]),
    ):
        true = values.std() / noise[column["name"]]
        assert 3.0 < column["moved"] < 1.2 * true  # the noise is guessed from above
    commands = by_hand(120, seed=2).commands
    assert torque["at_bound"] == pytest.approx((np.abs(commands) == 2.0).mean()) and torque["beyond"] == 0.0


def changed(name, value, rows=slice(None)):
    def change(log):
        log[name][rows] = value(log[name][rows]) if callable(value) else value

    return change


def without(rows):
    def change(log):
        for name, values in log.items():
            log[name] = np.delete(values, [row for row in rows if row < len(values)])

    return change


FAULTS = {
    "period": (changed("t", lambda t: 1e3 * t), "look whether t is in s"),
    "gaps": (without([30, 31, 32, 70]), "in 2 places, about 4 in all, the first after 1.45 s (line 31)"),
    "jitter": (changed("t", lambda t: t + 0.002 * (np.arange(len(t)) % 2)), "up to 4 %"),
    "order": (changed("t", 1.0, 50), "line 52"),
    "not-a-number": (changed("rate", np.nan, [40, 41]), "rate has no finite number in 2 of 121 rows"),
    "still": (changed("rate", 0.25), "0.25 rad/s in every row"),
    "frozen": (changed("angle", lambda x: x[0], slice(60, 90)), "froze"),
    "derivative": (changed("rate", lambda x: -x), "declared derivative"),
    "scale": (changed("angle", lambda x: 1e3 * x), "check its unit"),
    "beyond-bounds": (changed("torque", lambda u: 100.0 * u), "beyond its bounds"),
    "envelope": (changed("rate", lambda x: x + 25.0), "outside its envelope in 100 % of the rows"),
    "short": (without(range(2, 121)), "2 rows"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_called_by_its_name_and_ends_with_one(checked, fault):
    change, words = FAULTS[fault]
    said = checked(change)
    assert said.exit_code == 1 and words in said.stdout and "Correct what is marked" in said.stdout
    assert fault in {each["code"] for each in json.loads(checked(change, "--json").stdout)["remarks"]}


def test_a_log_of_a_head_alone_is_too_short(checked):
    said = checked(without(range(121)))
    assert said.exit_code == 1 and "The log has 0 rows" in said.stdout and said.stdout.count("✗") == 2


def test_of_a_single_row_it_is_said_that_it_is_short_and_nothing_else(checked):
    said = checked(without(range(1, 121)))
    assert said.exit_code == 1 and said.stdout.count("✗") == 2
    assert "1 row over 0 s" in said.stdout and "The log has 1 row: at least 3 are needed" in said.stdout


NOTES = {
    "constant-command": (changed("torque", 1.0), "torque is 1 N m in every row"),
    "saturated": (changed("torque", lambda u: np.sign(u) * 2.0), "at a bound in 100 %"),
    "envelope": (changed("rate", lambda x: np.where(np.arange(len(x)) == 60, 13.0, x)), "outside its envelope"),
    "late": (changed("angle", lambda x: np.r_[[x[0]] * 2, x[:-2]]), "later than rate, which moves it"),
    "little-moved": (
        changed("rate", lambda x: np.random.default_rng(4).normal(size=x.shape)), "little can be learnt about it"
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", NOTES)
def test_what_is_worth_a_look_is_noted(checked, code):
    change, words = NOTES[code]
    found = json.loads(checked(change, "--json").stdout)
    assert {"code": code, "severity": "note"} in [
        {key: each[key] for key in ("code", "severity")} for each in found["remarks"]
    ]
    assert words in checked(change).stdout


def test_a_log_without_a_column_and_a_strange_archive_are_misuse(checked, tmp_path):
    checked()
    rig = str(tmp_path / "rig.toml")
    (tmp_path / "other.csv").write_text("t,angle,torque\n0,1,2\n")
    missing = invoke("check", str(tmp_path / "other.csv"), rig)
    assert missing.exit_code == 2 and "rate" in missing.stderr
    np.savez(tmp_path / "x.npz", t=np.zeros(4), states=np.zeros((4, 3)), commands=np.zeros((3, 1)))
    shaped = invoke("check", str(tmp_path / "x.npz"), rig)
    assert shaped.exit_code == 2 and "(4, 3)" in shaped.stderr
    np.savez(tmp_path / "x.npz", t=np.zeros(4), states=np.array([["a"] * 2] * 4), commands=np.zeros((3, 1)))
    assert invoke("check", str(tmp_path / "x.npz"), rig).exit_code == 2


ROWS = {
    "a time that repeats": (changed("t", 2.45, 50), 50),
    "a row that was lost": (without([51]), 50),
    "a reading out of scale": (changed("angle", 1e9, 50), 50),
    "a command beyond its bounds": (changed("torque", 50.0, 50), 50),
    "no number": (changed("rate", np.nan, [50, 51]), 50),
}


@pytest.mark.parametrize("fault", ROWS)
def test_a_row_of_a_file_is_the_line_that_an_editor_shows(checked, tmp_path, fault):
    change, row = ROWS[fault]
    where = re.compile(r"\b(?:row|line) \d+")
    file, rig = tmp_path / "flight.csv", tmp_path / "rig.toml"
    assert set(where.findall(checked(change).stdout)) <= {f"line {row + 2}"}
    assert where.findall(invoke("identify", str(file), "--config", str(rig)).stderr) == [f"line {row + 2}"]
    file.write_text("\n\n" + file.read_text())
    assert where.findall(invoke("identify", str(file), "--config", str(rig)).stderr) == [f"line {row + 4}"]


def test_a_row_of_arrays_is_their_index():
    run = by_hand(120, seed=2)
    signals = tl.Signals(SIGNALS.states, SIGNALS.commands, run.t[1] - run.t[0])
    states, late = run.states.copy(), run.t.copy()
    states[50, 0], late[50] = 1e9, late[49]
    with pytest.raises(tl.InvalidInput, match=r"found 1e\+09 at row 50; check its unit"):
        check_recorded(tl.Trajectory(run.t, states, run.commands), tl.Limits(signals), None)
    with pytest.raises(tl.InvalidInput, match="at row 50; sort") as refused:
        tl.Trajectory(late, run.states, run.commands)
    assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)
    found = tl.check_log(late, run.states, run.commands, signals)
    assert "at row 50, 2.45 s" in found.remarks[0].sentence


def five_times_as_often(log):
    t = log["t"]
    often = np.linspace(t[0], t[-1], 5 * (len(t) - 1) + 1)
    for name in ("angle", "rate"):
        log[name] = np.interp(often, t, log[name])
    log["torque"] = np.repeat(log["torque"], 5)
    log["t"] = often


def often_and_frozen(log):
    five_times_as_often(log)
    log["angle"][300:450] = log["angle"][0]


@pytest.mark.parametrize(
    ("change", "codes"),
    [(five_times_as_often, {"period"}), (often_and_frozen, {"period", "frozen"})],
)
def test_of_a_wrong_period_no_consequences_are_told(checked, change, codes):
    assert {each["code"] for each in json.loads(checked(change, "--json").stdout)["remarks"]} == codes


def spaced(*steps):
    """Rows that are so far apart, s, again and again."""

    def change(log):
        log["t"] = np.r_[0.0, np.cumsum(np.resize(steps, len(log["t"]) - 1))]

    return change


@pytest.mark.parametrize(
    ("steps", "worst"), [((0.06, 0.04), 20), ((0.04, 0.06), 20), ((0.04, 0.04, 0.07), 40), ((0.08, 0.02), 60)]
)
@pytest.mark.parametrize("rows", [120, 121])
def test_times_that_jitter_around_their_period_are_no_other_period(checked, steps, worst, rows):
    def change(log):
        without(range(rows, 121))(log)  # the median of an odd number of steps is one of them
        spaced(*steps)(log)

    said = checked(change)
    assert said.exit_code == 1 and "apart" not in said.stdout and "missing" not in said.stdout
    assert f"departs by up to {worst} % from dt" in said.stdout and "twinloop check --even" in said.stdout
    found = json.loads(checked(change, "--json").stdout)
    assert {each["code"] for each in found["remarks"]} == {"jitter"} and found["gaps"] == 0
    assert found["period"] == pytest.approx(0.05, rel=0.01) and found["jitter"] == pytest.approx(worst / 100)


def test_times_that_jitter_are_brought_onto_the_period_and_a_part_is_taken(checked, tmp_path):
    log = tmp_path / "even.csv"
    said = checked(spaced(0.055, 0.045), "--even", "-o", str(log))
    assert said.exit_code == 0 and "were brought onto it" in said.stdout and "departs" not in said.stdout
    columns = np.genfromtxt(log, delimiter=",", names=True)
    assert np.allclose(np.diff(columns["t"]), 0.05)
    part = checked(lambda log: None, "--from", "1", "--to", "3", "-o", str(tmp_path / "part.csv"))
    assert part.exit_code == 0, part.output
    columns = np.genfromtxt(tmp_path / "part.csv", delimiter=",", names=True)
    assert columns["t"][[0, -1]] == pytest.approx([1.0, 3.0]) and len(columns) == 41


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ((0.025,), 0.025),
        ((0.026, 0.026, 0.024), 0.026),
        ((0.1,), 0.1),
        # Rows that were lost on the way do not make another period the declared one.
        ((*[0.025] * 20, 0.5), 0.025),
        ((*[0.025] * 5, 0.075), 0.025),
    ],
)
def test_a_log_of_another_period_is_told_it(checked, steps, told):
    said = checked(spaced(*steps))
    assert said.exit_code == 1 and f"Rows are {told:g} s apart" in said.stdout


def test_rows_that_are_lost_where_times_jitter_are_said_to_be(checked):
    def change(log):
        spaced(0.06, 0.04)(log)
        without([30])(log)

    found = {
        each["code"]: each["sentence"] for each in json.loads(checked(change, "--json").stdout)["remarks"]
    }
    assert set(found) == {"gaps", "jitter"} and "in 1 place, about 1 in all" in found["gaps"]


def repeated(log):
    for name, values in log.items():
        log[name] = np.repeat(values, 3)


def reversed_rows(log):
    for name, values in log.items():
        log[name] = values[::-1].copy()


def test_rows_that_are_repeated_or_in_reverse_are_said_to_be(checked):
    said = checked(repeated)
    assert said.exit_code == 1 and "363 rows over 6 s.\n" in said.stdout
    assert "242 rows have the time of the row before, the first at line 3, 0 s" in said.stdout
    said = checked(reversed_rows)
    assert said.exit_code == 1 and "121 rows.\n" in said.stdout
    assert "in reverse order, the last time first: sort them by t" in said.stdout


def test_times_since_1970_have_the_digits_in_which_they_differ(checked, tmp_path):
    def since_1970(*changes):
        def change(log):
            log["t"] = log["t"] + 1.7e9
            for each in changes:
                each(log)

        return change

    def refused():
        return invoke("identify", str(tmp_path / "flight.csv"), "--config", str(tmp_path / "rig.toml")).stderr

    back = since_1970(changed("t", 1.7e9 + 2.4, 50))
    assert "line 52, from 1700000002.45 s to 1700000002.4 s: sort" in checked(back).stdout
    assert "found 1700000002.45 s and then 1700000002.4 s at line 52" in refused()
    copy = since_1970(changed("t", 1.7e9 + 2.45, 50))
    assert "the first at line 52, 1700000002.45 s: remove" in checked(copy).stdout
    assert "after 1700000002.45 s (line 51)" in checked(since_1970(without([50]))).stdout
    assert "after line 51, t = 1700000002.45 s; put in a row" in refused()
    assert "has no finite number" in checked(since_1970(changed("rate", np.nan, [50, 51]))).stdout
    assert "line 52, t = 1700000002.5 s (2 such rows)" in refused()


def test_empty_cells_of_a_historian_are_counted_and_a_slow_period_is_told_in_seconds(tmp_path):
    (tmp_path / "oven.toml").write_text(
        'dt = 10.0\n[states.heat]\nunit = "K"\nscale = 10.0\n[commands.power]\nunit = "W"\nbounds = [0.0, 9.0]\n'
    )

    def checked(empty):
        rows = [f"{10 * k};{'' if k in empty else np.sin(k / 5)};{k % 9}" for k in range(60)]
        (tmp_path / "oven.csv").write_text("\n".join(["t;heat;power", *rows]))
        return invoke("check", str(tmp_path / "oven.csv"), str(tmp_path / "oven.toml"))

    said = checked((5, 6))
    assert "60 rows over 590 s, one in 10 s." in said.stdout
    assert said.exit_code == 1 and "heat has no finite number in 2 of 60 rows: fill in" in said.stdout
    # Single ones are filled in, and that is said.
    said = checked((5, 9))
    assert said.exit_code == 0 and "lacks single readings, 2 of heat: each is taken half-way" in said.stdout


def test_a_quote_that_nobody_closes_takes_no_rows_away(checked, tmp_path):
    assert checked().exit_code == 0
    head, *rows = (tmp_path / "flight.csv").read_text().splitlines()
    rows = [row + (',"motor hot' if at == 50 else ",") for at, row in enumerate(rows)]
    (tmp_path / "flight.csv").write_text("\n".join([f"{head},note", *rows]))
    refused = invoke("check", str(tmp_path / "flight.csv"), str(tmp_path / "rig.toml"))
    assert refused.exit_code != 0 and "unexpected end of data" in refused.output


def test_a_part_of_a_log_is_not_written_over_it(checked, tmp_path):
    log = tmp_path / "flight.csv"
    refused = checked(lambda log: None, "--from", "0", "--to", "1", "-o", str(log))
    assert refused.exit_code != 0 and "expected another file than the log" in refused.output
    assert len(log.read_text().splitlines()) == 1 + 121


def test_of_a_rate_that_no_sensor_reads_nothing_is_said_that_its_state_explains(tmp_path):
    (tmp_path / "rig.toml").write_text(
        'dt = 0.1\nlags = 1\n[states.x]\nunit = "m"\nscale = 1.0\n[commands.u]\nunit = "N"\nbounds = [-1.0, 1.0]\n'
    )

    def checked(rows):
        (tmp_path / "log.csv").write_text("\n".join(["t,x,u", *rows]) + "\n")
        return invoke("check", str(tmp_path / "log.csv"), str(tmp_path / "rig.toml"))

    said = checked([])
    assert said.exit_code == 1 and "The log has 0 rows" in said.stdout and said.stdout.count("✗") == 2
    x = np.where(np.isin(np.arange(60), (20, 21)), np.nan, np.sin(np.arange(60) / 5))
    said = checked([f"{0.1 * k:.1f},{'' if np.isnan(x[k]) else x[k]},{k % 3 - 1}" for k in range(60)])
    assert "x has no finite number in 2 of 60 rows" in said.stdout and "x_rate has" not in said.stdout
    # A rate that is mostly noise is no sensor that moved too little.
    noisy = np.linspace(0.0, 0.05, 60) + 0.003 * np.random.default_rng(0).standard_normal(60)
    said = checked([f"{0.1 * k:.1f},{noisy[k]},{k % 3 - 1}" for k in range(60)])
    assert said.exit_code == 0 and "little" not in said.stdout


def test_an_angle_that_was_logged_a_turn_away_is_inside_its_envelope():
    yaw = tl.State("yaw", "rad", scale=3.14, periodic=True, envelope=(-1.0, 1.0))
    signals = tl.Signals(
        [yaw, tl.State("rate", "rad/s", 2.0, derivative_of="yaw")],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        dt=0.05,
    )
    t = 0.05 * np.arange(201)
    noise = 1e-3 * np.random.default_rng(0).normal(size=(201, 2))
    states = (
        np.stack([np.mod(-0.3 + 0.2 * np.sin(0.8 * t), 2.0 * np.pi), 0.16 * np.cos(0.8 * t)], axis=1) + noise
    )
    commands = np.random.default_rng(1).uniform(-0.5, 0.5, (200, 1))

    def beyond(states):
        found = tl.check_log(t, states, commands, signals)
        return found.columns[0].beyond, "envelope" in {remark.code for remark in found.remarks}

    assert beyond(states) == (0.0, False)
    gone = states.copy()
    gone[:50, 0] += 1.2  # beyond, on the turn of the log
    outside = np.abs(gone[:, 0] - 2.0 * np.pi) > 1.0
    share = outside.mean()
    assert share > 0.1 and beyond(gone) == (pytest.approx(share), True)
    gone[outside.argmax(), 0] = np.nan  # neither inside nor outside
    assert beyond(gone)[0] == pytest.approx((201 * share - 1) / 200)

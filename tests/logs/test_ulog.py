"""Logs of PX4: fields by name onto one period, quaternions as angles, gaps and hostile files refused."""

import json
import struct
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import twinloop as tl
from command import invoke
from lives import RIG
from twinloop.logs import read_log
from ulogs import MAGIC, message, ulog

pytest.importorskip("pyulog", reason="twinloop[ulog] is not installed")

SIGNALS = tl.Signals(
    [tl.State("roll", "rad", scale=1.0), tl.State("p", "rad/s", scale=5.0, derivative_of="roll")],
    [tl.Command("aileron", "1", bounds=(-1.0, 1.0))],
    dt=0.02,
)
FORMATS = {
    "vehicle_attitude": "uint64_t timestamp;double[4] q;",
    "rates": "uint64_t timestamp;double[3] xyz;",
    "actuator": "uint64_t timestamp;double[2] control;",
}
COLUMNS = {"roll": "vehicle_attitude.roll", "p": "rates.xyz[0]", "aileron": "actuator/1.control[1]"}


def quaternion(yaw, pitch, roll):
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    return [w, x, y, z]


def roll(t):
    return 4.0 * t  # more than a turn in two seconds


def rows(seconds=2.0, without=()):
    found = []
    for k in range(round(seconds / 0.005)):
        at = 0.0013 + 0.005 * k
        found.append((at, "vehicle_attitude", 0, quaternion(0.3, -0.2, roll(at))))
    for k in range(round(seconds / 0.011)):
        at = 0.011 * k
        found.append((at, "rates", 0, [np.sin(at), 0.0, 0.0]))
    for k in range(round(seconds / 0.02) + 1):
        found.append((0.02 * k, "actuator", 0, [9.0, 9.0]))
        found.append((0.02 * k + 0.004, "actuator", 1, [0.0, 0.01 * (k % 50)]))
    return sorted(
        row for row in found if not any(row[1] == topic and a < row[0] < b for topic, a, b in without)
    )


def written(tmp_path, content):
    path = tmp_path / "flight.ulg"
    path.write_bytes(content)
    return path


def test_fields_of_several_rates_come_onto_one_period(tmp_path):
    run = tl.load(written(tmp_path, ulog(FORMATS, rows())), SIGNALS, columns=COLUMNS)
    start = 0.004  # the command comes last
    t = start + 0.02 * np.arange(len(run.t))
    np.testing.assert_allclose(run.t, t - start, atol=1e-12)
    np.testing.assert_allclose(run.states[:, 0], roll(t), atol=1e-6)  # a straight line, and no jump by a turn
    np.testing.assert_allclose(run.states[:, 1], np.sin(t), atol=2e-5)  # 11 ms apart: half of 0.011² / 8
    np.testing.assert_allclose(run.commands[:, 0], 0.01 * (np.arange(run.steps) % 50), atol=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
@settings(max_examples=25)
def test_angles_are_those_that_the_quaternion_was_made_of(yaw, pitch, turned):
    held = [
        (0.01 * k, topic, 1 if topic == "actuator" else 0, values)
        for k in range(20)
        for topic, values in (
            ("actuator", [0.0, 0.0]), ("rates", [0.0, 0.0, 0.0]), ("vehicle_attitude", quaternion(yaw, pitch, turned))
        )
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), ulog(FORMATS, held))
        for name, angle in (("roll", turned), ("pitch", pitch), ("yaw", yaw)):
            run = tl.load(path, SIGNALS, columns={**COLUMNS, "roll": f"vehicle_attitude.{name}"})
            np.testing.assert_allclose(run.states[:, 0], angle, atol=1e-9)


def test_a_part_of_a_log_is_the_same_as_the_whole_there(tmp_path):
    path = written(tmp_path, ulog(FORMATS, rows()))
    part = tl.load(path, SIGNALS, columns=COLUMNS, start=0.5, stop=1.1)
    assert part.steps == 30
    np.testing.assert_allclose(part.states[:, 0], roll(0.5 + part.t), atol=1e-6)


@pytest.mark.parametrize("topic", ["vehicle_attitude", "rates", "actuator"])
def test_a_gap_is_refused_and_said_but_not_where_it_is_not_asked_for(tmp_path, topic):
    path = written(tmp_path, ulog(FORMATS, rows(without=[(topic, 1.0, 1.06)])))
    with pytest.raises(tl.InvalidInput, match=rf"samples of {topic}.*at most 2 periods \(40 ms\)"):
        tl.load(path, SIGNALS, columns=COLUMNS)
    assert tl.load(path, SIGNALS, columns=COLUMNS, stop=0.9).steps > 40


@pytest.mark.parametrize(
    ("columns", "more", "word"),
    [
        (None, {}, "expected the field of each state and command"),
        ({**COLUMNS, "roll": "vehicle_atitude.roll"}, {}, "did you mean 'vehicle_attitude'"),
        ({**COLUMNS, "roll": "vehicle_attitude.rol"}, {}, "field of vehicle_attitude"),
        ({**COLUMNS, "roll": "vehicle_attitude/3.roll"}, {}, "the instances 0"),
        ({**COLUMNS, "roll": "roll"}, {}, "topic.field"),
        ({**COLUMNS, "roll": 3}, {}, "topic.field"),
        ({**COLUMNS, "yaw": "vehicle_attitude.yaw"}, {}, "yaw"),
        ({"roll": "vehicle_attitude.roll"}, {}, "a field for 'p'"),
        (COLUMNS, {"start": 5.0}, "where all fields are there"),
        (COLUMNS, {"start": 1.0, "stop": 1.01}, "at least two periods"),
    ],
)
def test_what_was_asked_for_wrongly_is_said(tmp_path, columns, more, word):
    path = written(tmp_path, ulog(FORMATS, rows()))
    with pytest.raises(tl.InvalidInput, match=word):
        tl.load(path, SIGNALS, columns=columns, **more)


def refused(path, columns=COLUMNS, **more):
    with pytest.raises(tl.InvalidInput) as refusal:
        tl.load(path, SIGNALS, columns=columns, **more)
    return str(refusal.value)


def test_a_topic_whose_format_alone_is_there_has_no_samples(tmp_path):
    formats = FORMATS | {
        "torque": "uint64_t timestamp;double[3] xyz;",
        "other": "uint64_t timestamp;double x;",
    }
    path = written(tmp_path, ulog(formats, [*rows(), (3.0, "other", 0, [1.0])]))
    said = refused(path, {**COLUMNS, "aileron": "torque.xyz[0]"})
    assert "found its format alone" in said and said.endswith("actuator, other, rates, vehicle_attitude.")
    assert "did you mean 'other'" in refused(path, {**COLUMNS, "aileron": "othr.x"})
    empty = written(tmp_path, ulog({}, []))
    assert "found no topic at all" in refused(empty)


def test_angles_of_a_quaternion_are_among_the_fields_that_are_named(tmp_path):
    path = written(tmp_path, ulog(FORMATS, rows()))
    assert "did you mean 'roll'" in refused(path, {**COLUMNS, "roll": "vehicle_attitude.rol"})
    assert "roll, pitch, yaw, q[0]" in refused(path, {**COLUMNS, "roll": "vehicle_attitude.heading"})
    assert "did you mean 'xyz" in refused(path, {**COLUMNS, "p": "rates.xy[0]"})


def test_times_that_repeat_or_go_back_are_said_with_their_place(tmp_path):
    twice = [row for row in rows() for _ in range(1 + (row[1] == "rates" and row[0] > 1.0))]
    said = refused(written(tmp_path, ulog(FORMATS, twice)))
    count = sum(row[1] == "rates" and row[0] > 1.0 for row in rows())
    assert (
        f"rates.xyz[0] at increasing times, found {count} that repeat" in said and "the first 1.001 s" in said
    )
    back = [(4.0 - row[0] if row[1] == "rates" else row[0], *row[1:]) for row in rows()]
    assert "found 3.989 s after 4 s" in refused(written(tmp_path, ulog(FORMATS, back)))
    one = [row for row in rows() if row[1] != "rates" or row[0] == 0.0]
    assert "at least two, found 1" in refused(written(tmp_path, ulog(FORMATS, one)))


def test_a_log_that_was_cut_is_read_until_then_and_it_is_said(tmp_path):
    whole = ulog(FORMATS, rows())
    path = written(tmp_path, whole[: round(0.6 * len(whole))])
    with pytest.warns(tl.RemarkWarning, match=r"ends within a message.* can be read until 1\.\d+ s") as said:
        run = tl.load(path, SIGNALS, columns=COLUMNS)
    until = float(str(said[0].message).partition("until ")[2].split()[0])
    assert until - 0.02 < run.t[-1] + 0.004 < until  # the last rows of a period, and the first command
    np.testing.assert_allclose(run.states[:, 0], roll(0.004 + run.t), atol=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert tl.load(path, SIGNALS, columns=COLUMNS, stop=1.0).steps == 49  # a part before that is whole
        tl.load(written(tmp_path, whole), SIGNALS, columns=COLUMNS)
    path = written(tmp_path, whole[:-3])
    fields = 'angle = "vehicle_attitude.pitch"\nrate = "rates.xyz[0]"\ntorque = "actuator/1.control[1]"\n'
    (tmp_path / "rig.toml").write_text(RIG + "[log]\n" + fields)
    found = json.loads(invoke("check", str(path), str(tmp_path / "rig.toml"), "--json").stdout)
    assert [each["severity"] for each in found["remarks"] if each["code"] == "cut"] == ["note"]


@pytest.mark.parametrize("trash", [bytes(range(256)) * 8, b"\xff" * 300, b"D" * 2000, b"\xf0\xf0Dxyz" * 50])
def test_a_log_that_is_damaged_within_is_not_taken_for_one_that_was_cut(tmp_path, trash):
    whole = ulog(FORMATS, rows())
    at = round(0.4 * len(whole))
    assert len(whole) - at > 10_000 + len(trash)
    said = refused(written(tmp_path, whole[:at] + trash + whole[at + len(trash) :]))
    assert "expected a whole log, found a damaged one" in said


def test_a_log_that_was_cut_at_any_byte_of_a_message_was_cut(tmp_path):
    whole = ulog(FORMATS, rows())
    for lost in range(1, 40):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            assert tl.load(written(tmp_path, whole[:-lost]), SIGNALS, columns=COLUMNS).steps > 90
        assert all("ends within a message" in str(each.message) for each in said)


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2.0 * np.pi), ("deg", 360.0)])
def test_a_heading_that_wraps_between_two_samples_goes_on(tmp_path, unit, turn):
    def heading(t):
        return turn * (0.45 + 0.3 * t)

    formats = {"position": "uint64_t timestamp;double heading;", "actuator": FORMATS["actuator"]}
    samples = [
        (0.013 * k, "position", 0, [heading(0.013 * k) - turn * np.rint(heading(0.013 * k) / turn)])
        for k in range(150)
    ]
    sent = [(0.02 * k, "actuator", 0, [0.0, 0.0]) for k in range(98)]
    signals = tl.Signals([tl.State("yaw", unit, turn)], SIGNALS.commands, dt=0.02)
    columns = {"yaw": "position.heading", "aileron": "actuator.control[0]"}
    run = tl.load(written(tmp_path, ulog(formats, sorted(samples + sent))), signals, columns=columns)
    np.testing.assert_allclose(run.states[:, 0], heading(run.t), atol=1e-3 * turn)


@pytest.mark.parametrize("field", ["vehicle_attitude.roll", "heading.roll"])
def test_samples_that_are_no_numbers_are_missing_alone(tmp_path, field):
    """Two samples of 5 ms touch one row of 20 ms at most; behind them the angle goes on as if they were there."""
    formats = FORMATS | {"heading": "uint64_t timestamp;double roll;"}
    lost = (1.0, 1.01)
    samples = [
        (at, topic, instance, [np.nan] * len(values) if lost[0] < at < lost[1] and topic in field else values)
        for at, topic, instance, values in rows()
    ]
    for k in range(400):
        at = 0.005 * k
        wrapped = (roll(at) + np.pi) % (2.0 * np.pi) - np.pi
        samples.append((at, "heading", 0, [np.nan if lost[0] < at < lost[1] else wrapped]))
    signals = tl.Signals([SIGNALS.states[0]], SIGNALS.commands, dt=0.02)
    columns = {"roll": field, "aileron": COLUMNS["aileron"]}
    found = read_log(
        written(tmp_path, ulog(formats, sorted(samples, key=lambda row: row[0]))), signals, columns=columns
    )
    missing = np.isnan(found.states[:, 0])
    assert 0 < missing.sum() <= 2
    np.testing.assert_allclose(found.states[~missing, 0], roll(0.004 + found.t[~missing]), atol=1e-6)


def bomb():
    """A few bytes that ask for 60000² fields."""
    formats = {"vehicle_attitude": "uint64_t timestamp;inner[60000] a;", "inner": "double[60000] b;"}
    body = b"".join(message("F", f"{name}:{fields}".encode()) for name, fields in formats.items())
    added = message("A", struct.pack("<BH", 0, 0) + b"vehicle_attitude")
    return MAGIC + struct.pack("<Q", 0) + message("B", bytes(40)) + body + added


def endless():
    body = message("F", b"vehicle_attitude:uint64_t timestamp;vehicle_attitude[2] again;")
    added = message("A", struct.pack("<BH", 0, 0) + b"vehicle_attitude")
    return MAGIC + struct.pack("<Q", 0) + message("B", bytes(40)) + body + added


@pytest.mark.parametrize(
    "content",
    [b"", b"\x80\x04pickle", MAGIC, MAGIC + bytes(8), bomb(), endless(), ulog(FORMATS, [])],
    ids=["empty", "pickle", "cut", "nothing", "bomb", "endless", "no data"],
)
def test_hostile_and_damaged_files_are_one_sentence(tmp_path, content):
    with pytest.raises(tl.InvalidInput, match=r"flight\.ulg"):
        tl.load(written(tmp_path, content), SIGNALS, columns=COLUMNS)


@given(st.data())
@settings(max_examples=60)
def test_a_log_with_any_bytes_changed_is_read_or_refused(data):
    content = bytearray(ulog(FORMATS, rows(0.2)))
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), bytes(content))
        try:
            assert tl.load(path, SIGNALS, columns=COLUMNS).steps >= 2
        except tl.InvalidInput as refusal:
            assert "flight.ulg" in str(refusal) or "Trajectory" in str(refusal)


def test_without_its_package_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(tl.NotAvailable, match=r"pip install 'twinloop\[ulog\]'"):
        tl.load(written(tmp_path, ulog(FORMATS, rows())), SIGNALS, columns=COLUMNS)


def test_check_reads_it_by_the_campaign_file_and_writes_what_can_be_told(tmp_path):
    fields = 'angle = "vehicle_attitude.pitch"\nrate = "rates.xyz[0]"\ntorque = "actuator/1.control[1]"\n'
    (tmp_path / "rig.toml").write_text(RIG + "[log]\n" + fields)
    path = written(tmp_path, ulog(FORMATS, rows(3.0)))
    csv = tmp_path / "flight.csv"
    part = ("--from", "0.5", "--to", "2.5", "-o", str(csv), "--json")
    said = invoke("check", str(path), str(tmp_path / "rig.toml"), *part)
    found = json.loads(said.stdout)
    assert found["rows"] == 41 and found["gaps"] == 0 and found["period"] == pytest.approx(0.05)
    signals = tl.Signals(
        [tl.State("angle", "rad", scale=3.0), tl.State("rate", "rad/s", scale=8.0, derivative_of="angle")],
        [tl.Command("torque", "N m", bounds=(-2.0, 2.0))], dt=0.05,
    )  # fmt: skip
    columns = {"angle": "vehicle_attitude.pitch", "rate": "rates.xyz[0]", "torque": "actuator/1.control[1]"}
    straight = tl.load(path, signals, columns=columns, start=0.5, stop=2.5)
    told = tl.load(csv, signals)
    np.testing.assert_array_equal(told.states, straight.states)
    np.testing.assert_array_equal(told.commands, straight.commands)

"""Parameter files say what the gains are, read by others; what must not reach an autopilot never gets into one."""

import json
import math

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from twinloop.autopilots import Autopilot, Parameter
from twinloop.autopilots.declared import declared
from twinloop.autopilots.files import FORMATS

NAMES = {
    "px4": "MC_ROLLRATE_P",
    "px4-shell": "MC_ROLLRATE_P",
    "ardupilot": "ATC_RAT_RLL_P",
    "betaflight": "p_roll",
    "ros2": "gains.roll.kp",
    "json": "roll kp",
}
KINDS = pytest.mark.parametrize("kind", FORMATS)


def autopilot(kind, node="/**", **parameter):
    return Autopilot(kind, {"roll.kp": Parameter(NAMES[kind], **parameter)}, node)


def read(kind, text):
    """The one value of a file, as its readers find it."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    match kind:
        case "px4":
            (row,) = [line.split("\t") for line in lines]
            assert row[:3] == ["1", "1", NAMES[kind]] and row[4] in ("9", "6")
            return float(row[3])
        case "px4-shell":
            assert lines[1:] == ["param save"]
            command, set_, name, value = lines[0].split(" ")
            assert (command, set_, name) == ("param", "set", NAMES[kind])
            return float(value)
        case "ardupilot":
            (row,) = lines
            name, value = row.split(",")
            assert name == NAMES[kind]
            return float(value)
        case "betaflight":
            assert lines[1:] == ["save"] and lines[0].startswith(f"set {NAMES[kind]} = ")
            return float(lines[0].rpartition(" ")[2])
        case "ros2":
            (parameters,) = (node["ros__parameters"] for node in yaml.safe_load(text).values())
            return parameters[NAMES[kind]]
        case "json":
            return json.loads(text)["parameters"][NAMES[kind]]


@pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind != "betaflight"])
@given(gain=st.floats(-1e6, 1e6))
def test_the_file_holds_the_value_in_the_precision_of_the_autopilot(kind, gain):
    found = read(kind, autopilot(kind, scale=2.0, offset=0.5).text({"roll.kp": gain}, "new"))
    assert isinstance(found, float)
    expected = 2.0 * gain + 0.5
    assert found == (expected if kind in ("ros2", "json") else float(np.float32(expected))) or np.float32(
        found
    ) == np.float32(expected)


@given(gain=st.floats(-1e6, 1e6))
def test_what_betaflight_would_cut_off_is_refused_unless_it_may_be_rounded(gain):
    expected = 10.0 * gain
    if expected != int(expected):
        with pytest.raises(tl.InvalidInput, match="expected a whole number, for betaflight cuts off"):
            autopilot("betaflight", scale=10.0).text({"roll.kp": gain}, "new")
    else:
        held = np.float32(expected)
        assert read("betaflight", autopilot("betaflight", scale=10.0).text({"roll.kp": gain}, "new")) == held
    rounded = autopilot("betaflight", scale=10.0, whole=True).text({"roll.kp": gain}, "new")
    assert read("betaflight", rounded) == round(expected)


@KINDS
@pytest.mark.parametrize("gain", [math.nan, math.inf, -math.inf, 1e308])
def test_what_is_not_finite_is_refused(kind, gain):
    with pytest.raises(tl.InvalidInput, match="finite"):
        autopilot(kind, scale=10.0).text({"roll.kp": gain}, "new")


@KINDS
def test_limits_hold_to_the_last_digit_and_whole_numbers_are_rounded_before(kind):
    pilot = autopilot(kind, scale=100.0, limits=(0.0, 45.0), whole=True)
    assert read(kind, pilot.text({"roll.kp": 0.4549}, "new")) == 45
    for gain in (0.456, -0.006):
        with pytest.raises(tl.InvalidInput, match="expected 0 to 45"):
            pilot.text({"roll.kp": gain}, "new")
    assert isinstance(pilot.values({"roll.kp": 0.2})[NAMES[kind]], int)


def test_single_precision_cannot_hold_what_is_larger():
    with pytest.raises(tl.InvalidInput, match="32 bits"):
        autopilot("px4").text({"roll.kp": 1e300}, "new")
    with pytest.raises(tl.InvalidInput, match="32 bits"):
        autopilot("betaflight", whole=True).text({"roll.kp": 1e10}, "new")


HOSTILE = [
    "A\nparam set MOT_X 1",
    "A;B",
    'A"',
    "A B",
    "",
    "a: b",
    "../A",
    "<b>",
    "A\x00",
    "A,1",
    "é\u2028",
    "save\r",
]


@KINDS
@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_breaks_out_of_its_line(kind, name):
    if kind == "json" and name and all(ord(each) > 31 for each in name):
        text = Autopilot(kind, {"g": Parameter(name)}).text({"g": 1.0}, "new")
        assert json.loads(text) == {"parameters": {name: 1.0}}
        return
    with pytest.raises(tl.InvalidInput):
        Autopilot(kind, {"g": Parameter(name)})


@KINDS
@given(heading=st.text())
def test_no_heading_breaks_out_of_its_comment(kind, heading):
    bare, headed = (autopilot(kind).text({"roll.kp": 5.0}, each) for each in ("", heading))
    assert read(kind, headed) == 5.0
    assert len(headed.splitlines()) == len(bare.splitlines())


@pytest.mark.parametrize("node", ["/x\n/**", "a b", "", "/1", "x:", "/**:"])
def test_no_node_breaks_out_of_its_line(node):
    with pytest.raises(tl.InvalidInput, match="node"):
        autopilot("ros2", node)
    assert (
        autopilot("ros2", "/hover/controller").text({"roll.kp": 1.0}, "x").splitlines()[1]
        == "/hover/controller:"
    )


@pytest.mark.parametrize(
    "word", ["y", "N", "Yes", "no", "on", "OFF", "true", "False", "null", "only", "gains.on"]
)
def test_a_word_that_yaml_takes_for_a_value_stays_a_name(word):
    node = word.replace(".", "/")
    text = Autopilot("ros2", {"roll.kp": Parameter(word)}, node).text({"roll.kp": 1.5}, "x")
    assert yaml.safe_load(text) == {node: {"ros__parameters": {word: 1.5}}}


def test_every_gain_has_a_parameter_and_every_parameter_a_gain():
    pilot = Autopilot("px4", {"a": Parameter("A"), "b": None})
    assert pilot.values({"a": 1.0, "b": 0.0}) == {"A": 1.0}
    with pytest.raises(tl.InvalidInput, match="expected 0"):
        pilot.values({"a": 1.0, "b": 0.1})
    with pytest.raises(tl.InvalidInput, match="'c'"):
        pilot.values({"a": 1.0, "b": 0.0, "c": 2.0})
    with pytest.raises(tl.InvalidInput, match="'b'"):
        pilot.values({"a": 1.0})
    with pytest.raises(tl.InvalidInput, match="twice"):
        Autopilot("px4", {"a": Parameter("A"), "b": Parameter("A")})
    with pytest.raises(tl.InvalidInput, match="autopilot"):
        Autopilot("px5", {})


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (3, "section"),
        ({"kinds": "px4"}, "kind"),
        ({"kind": 4}, "texts"),
        ({"node": ["/x"]}, "texts"),
        ({"parameters": {"a": True}}, "section"),
        ({"parameters": {"a": {"scale": 1.0}}}, "name"),
        ({"parameters": {"a": {"name": "A", "factor": 1.0}}}, "factor"),
        ({"parameters": {"a": {"name": "A", "scale": math.nan}}}, "scale"),
        ({"parameters": {"a": {"name": "A", "scale": 0}}}, "not 0"),
        ({"parameters": {"a": {"name": "A", "limits": [1, 0]}}}, "limits"),
        ({"parameters": {"a": {"name": "A", "whole": 1}}}, "whole"),
        ({"parameters": {"a": {"name": 7}}}, "name"),
    ],
)
def test_a_declaration_that_cannot_be_used_is_refused(table, said):
    with pytest.raises(tl.InvalidInput, match=said):
        declared(table, "rig.toml")


def test_a_declaration_is_read():
    found = declared(
        {"kind": "px4", "parameters": {"a": "A", "b": False, "c": {"name": "C", "limits": [0, 1]}}}, "x"
    )
    assert found.kind == "px4" and found.parameters["b"] is None
    assert found.autopilot("ardupilot").values({"a": 1.0, "b": 0.0, "c": 0.5}) == {"A": 1.0, "C": 0.5}

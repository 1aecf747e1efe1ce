"""What differs between a store and what is asked for, in words."""

import twinloop as tl
from twinloop.records.differing import differences

NAMES = ("roll", "pitch", "yaw", "p", "q", "r")
BODY = tl.RigidBody(NAMES[:3], NAMES[3:])


def record(order=NAMES, of=None, body=None):
    states = [
        tl.State(name, "rad/s" if name in BODY.rates else "rad", 1.0, derivative_of=(of or {}).get(name))
        for name in order
    ]
    return {
        "signals": tl.Signals(states, [tl.Command("u", "1", (-1.0, 1.0))], 0.1, kinematics=body).to_record()
    }


def test_nothing_differs_from_itself():
    assert differences(record(), record()) == ""


def test_a_state_is_named_with_the_field_that_differs():
    said = differences(record(of={"p": "roll"}), record())
    assert said == "signals: state p: derivative_of: 'roll' in the store, none now"


def test_no_more_than_three_are_shown_and_the_others_counted():
    said = differences(record(of=dict(zip(NAMES[3:], NAMES[:3], strict=True))), record(body=BODY))
    assert said.count("derivative_of") == 3 and said.endswith("; and 1 more")


def test_a_body_that_is_new_is_shown_in_words():
    said = differences(record(), record(body=BODY))
    assert said.startswith(
        "signals: kinematics: none in the store, angles ['roll', 'pitch', 'yaw'], rates ['p'"
    )


def test_states_that_are_missing_or_in_another_order_are_named():
    assert differences(record(), record(NAMES[:5])) == "signals: state r: in the store, none now"
    said = differences(record(), record(NAMES[::-1]))
    assert said.startswith("signals: states: in the order roll, pitch")


def test_where_the_two_are_is_said_in_the_words_that_are_asked_for():
    file, system = record(NAMES[:5]), record(NAMES[:4], of={"p": "roll"})
    said = differences(file, system, ("in the file", "in the system"))
    assert "state p: derivative_of: none in the file, 'roll' in the system" in said
    assert "state q: in the file, none in the system" in said
    said = differences(system, file, ("in the system", "in the file"))
    assert "state q: none in the system, there in the file" in said


def test_long_values_are_shown_from_where_they_differ():
    one, other = ("a" * 200 + end for end in "xy")
    said = differences({"name": one}, {"name": other})
    assert "x'" in said and "y'" in said and len(said) < 150

"""What a person reads, and what JSON can hold."""

import json
import math

import numpy as np
import pytest

from twinloop.console import Estimate, duration
from twinloop.history import Progress
from twinloop.presets import options_of
from twinloop.result import plain, to_json
from twinloop.text import table


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (42.0, "42 s"), (59.6, "1 min 00 s"), (185.0, "3 min 05 s"), (7800.0, "2 h 10 min")],
)
def test_a_length_of_time_is_written_for_a_person(seconds, text):
    assert duration(seconds) == text


def test_a_table_has_columns_of_equal_width():
    lines = table(["name", "value"], [["a", 0.123456], ["longer", None], ["c", 7]]).splitlines()
    assert lines[0] == "name     value"
    assert lines[2:] == ["a       0.1235", "longer       –", "c            7"]


def test_what_is_not_finite_becomes_null_in_json():
    text = to_json({"a": math.inf, "b": [math.nan, 1.5], "c": np.float64(2.0), "d": (np.int64(3), None)})
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": 2.0, "d": [3, None]}
    assert text.endswith("}\n")


def test_a_number_keeps_its_bits_in_json():
    values = [0.1, 1.0 / 3.0, 5e-324, -1.7976931348623157e308]
    assert json.loads(to_json({"values": np.array(values)}))["values"] == values


def test_json_refuses_what_it_cannot_hold():
    with pytest.raises(TypeError, match="expected numbers"):
        plain(object())


def progress(phase, iteration, generation, generations):
    return Progress(phase, iteration, generation, generations, 1, (0,), (), (), 1, 1)


def test_the_time_left_shrinks_to_nothing_with_the_work(monkeypatch):
    clock = iter(range(100))
    monkeypatch.setattr("twinloop.console.time.monotonic", lambda: float(next(clock)))
    options = options_of("paper", {"model_generations": 10, "test_generations": 5})
    estimate = Estimate(options, experiments=1)
    assert estimate.remaining(progress("experiment", 0, 0, 0)) is None
    left = [estimate.remaining(progress("models", 1, generation, 10)) for generation in range(1, 11)]
    assert left == pytest.approx([9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0])

"""Faces show numbers and compute none: what was foretold is foretold before, and nobody flies a flight again."""

import ast
from pathlib import Path

import numpy as np
import pytest

import twinloop as tl
from lives import PLANT, begun
from twinloop.faces.result import summary
from twinloop.law.twin import Twin

FACES = Path(tl.__file__).parent / "faces"
COMPUTING = {"simulate", "free_run", "as_flown", "spread", "norm", "normalised_error", "argsort", "corrcoef"}
"""Calls that make numbers which an engineer reads."""


def called(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def test_no_face_flies_or_measures():
    found = {
        (path.name, name)
        for path in FACES.rglob("*.py")
        for name in called(ast.parse(path.read_text("utf-8")))
        if name in COMPUTING
    }
    assert not found


@pytest.fixture(scope="module")
def foretold():
    """A campaign of three flights, and what its twin said of each test before it was flown."""
    campaign, said = begun(), {}
    for _ in range(2):
        test = campaign.ask()
        said[test.number] = campaign.twin.simulate(test)
        campaign.tell(test, PLANT.run(test))
    return campaign, said


def test_a_series_holds_what_the_twin_foretold_before_the_flight_with_its_band_of_that_time(foretold):
    campaign, said = foretold
    first, *flown = summary(campaign, {"name": "x"}, {})["experiments"]
    assert first["series"]["predicted"] is None and first["series"]["predicted_band"] is None
    for experiment in flown:
        series, before = experiment["series"], said[experiment["test"]]
        np.testing.assert_array_equal(series["predicted"], before.states)
        np.testing.assert_array_equal(series["predicted_band"], before.band)
        assert series["predicted"] != series["simulated"]


def test_the_controller_to_fly_has_its_prediction_as_a_series(foretold):
    campaign, _ = foretold
    series = summary(campaign, {"name": "x"}, {})["controller"]["series"]
    expected = campaign.twin.simulate(campaign.best_test)
    for key, values in (("t", expected.t), ("commands", expected.commands), ("predicted", expected.states),
                        ("predicted_band", expected.band)):  # fmt: skip
        np.testing.assert_array_equal(series[key], values)


def test_the_twin_flies_each_flight_once_however_many_faces_show_it(foretold, monkeypatch, tmp_path):
    campaign, _ = foretold
    tests = {run.test.number for run in campaign.experiments}
    campaign._shown_twin, seen, simulate = None, [], Twin._simulated

    def counted(twin, test):
        if twin is campaign.twin and test.number in tests and test.excitation is not None:
            seen.append(test.number)
        return simulate(twin, test)

    monkeypatch.setattr(Twin, "_simulated", counted)
    summary(campaign, {"name": "x"}, {})
    campaign.plot(tmp_path / "picture.svg")
    campaign.plot.flights()
    campaign.report()
    assert len(seen) == len(set(seen)) > 0


def test_a_twin_that_has_learnt_more_is_another_one_and_a_look_is_not():
    campaign = begun()
    twin = campaign.twin
    assert campaign.twin is twin
    test = campaign.ask()
    campaign.tell(test, PLANT.run(test))
    assert campaign.twin is not twin
    assert len(campaign.twin.errors) == 2

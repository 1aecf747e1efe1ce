"""The studies: smoke runs of each, and their statistics recomputed."""

import json
import statistics

import pytest
from click.testing import CliRunner

from twinloop.faces.cli import main
from twinloop.reproduce.paper import TABLE_3
from twinloop.reproduce.study import Setting, begin, deviation, mean
from twinloop.reproduce.table2 import forgot_from


def reproduce(*arguments):
    done = CliRunner().invoke(main, ["reproduce", *arguments])
    assert done.exit_code == 0, done.stderr
    return done.stdout


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Pictures are written where we stand."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_table_1_shows_the_papers_settings_beside_ours():
    text = reproduce("table1", "--smoke")
    for words in ("15000", "250", "Table I", "+ − × ÷"):
        assert words in text
    assert " 1 run asked" in text
    rows = {row["setting"]: row for row in json.loads(reproduce("table1", "--json"))["rows"]}
    stated = [row for row in rows.values() if row["paper"] not in ("not stated", "the whole set")]
    assert all(row["paper"] == row["ours"] for row in stated)


@pytest.fixture(scope="module")
def table2():
    return json.loads(reproduce("table2", "--smoke", "--json", "--seed", "3"))


def test_table_2_has_lists_by_iteration_from_0(table2):
    for key in ("mean", "std", "normalised_mean", "normalised_std"):
        assert len(table2[key]) == 8
        assert all(isinstance(value, float) for value in table2[key])
    assert table2["iterations"] == list(range(8))
    assert table2["paper"]["mean"] == [0.204, 0.024, 0.029, 0.129, 0.341, 0.357, 0.394, 0.389]
    assert table2["paper"]["std"] == [0.175, 0.030, 0.030, 0.167, 0.250, 0.327, 0.265, 0.403]
    assert table2["smoke"] is True and table2["runs_finished"] == 2


def test_table_2_is_the_statistics_of_its_runs(table2):
    for i in range(8):
        raw = [run["closed_loop"][i] for run in table2["runs"]]
        normalised = [run["normalised"][i] for run in table2["runs"]]
        assert table2["mean"][i] == pytest.approx(statistics.fmean(raw))
        assert table2["std"][i] == pytest.approx(statistics.stdev(raw))
        assert table2["normalised_mean"][i] == pytest.approx(statistics.fmean(normalised))
        assert table2["normalised_std"][i] == pytest.approx(statistics.stdev(normalised))
    for run in table2["runs"]:
        assert 1.8 <= run["natural_frequency"] <= 2.2
        assert run["normalised"][1] == pytest.approx(run["closed_loop"][1] / run["frozen_error"])
        assert len(run["final_distances"]) == 7
    assert table2["runs"][0]["natural_frequency"] != table2["runs"][1]["natural_frequency"]


def test_table_2_as_text_shows_both_sides():
    text = reproduce("table2", "--smoke", "--runs", "1", "--generations", "2")
    assert "paper, mean" in text and "ours, mean" in text and "smoke" in text.lower()


def test_table_3_compares_both_versions_after_iterations_1_and_7():
    result = json.loads(reproduce("table3", "--smoke", "--generations", "5", "--json"))
    assert result["iterations"] == [1, 7]
    assert result["paper"] == TABLE_3 and TABLE_3["two_objectives"] == {"mean": 0.72, "std": 3.11}
    for version in ("two_objectives", "three_objectives"):
        ours = result[version]
        for i in range(2):
            distances = ours["final_distances"][i]
            assert len(distances) == 2
            assert ours["mean"][i] == pytest.approx(statistics.fmean(distances))
            assert ours["std"][i] == pytest.approx(statistics.stdev(distances))
            assert ours["median"][i] == pytest.approx(statistics.median(distances))
    assert all(0.0 <= p <= 1.0 for p in result["mann_whitney_p"])
    assert round(result["doing_nothing"], 3) == 1.429


def test_figure_6_draws_one_line_for_each_test(elsewhere):
    result = json.loads(reproduce("figure6", "--smoke", "--generations", "5", "--json"))
    assert (elsewhere / "figure6.svg").read_text(encoding="utf-8").count(">test ") == 7
    assert [record["tests"] for record in result["iterations"][1:]] == [list(range(i)) for i in range(1, 8)]
    scores = {run["run"]: run["score"] for run in result["runs"]}
    assert result["most_successful"] == min(scores, key=scores.get)


def test_figure_6_is_drawn_where_it_was_asked_for(elsewhere):
    text = reproduce("figure6", "--smoke", "--runs", "1", "--generations", "2", "--plot", "mine.png")
    assert (elsewhere / "mine.png").read_bytes().startswith(b"\x89PNG")
    assert "mine.png" in text and not (elsewhere / "figure6.svg").exists()


def test_a_runs_first_controller_depends_on_the_studys_seed_and_its_number_alone():
    def frequency(seed, number):
        return begin(Setting("table2", 5, 10, seed, 1), number, None).natural_frequency

    assert frequency(0, 1) == frequency(0, 1)
    assert len({frequency(seed, number) for seed in (0, 1) for number in (0, 1, 2)}) == 6


def test_forgetting_is_what_its_definition_says():
    assert forgot_from([0.2, 0.02, 0.03, 0.05, 0.09]) is None
    assert forgot_from([0.2, 0.02, 0.03, 0.13, 0.34]) == 3
    assert forgot_from([0.01, 0.2, 0.9, 0.9]) is None  # iteration 0 is not a memory
    assert forgot_from([0.2, 0.001, 0.09, 0.11]) == 3


def test_statistics_of_too_few_values_are_none():
    assert mean([]) is None and deviation([1.0]) is None
    assert deviation([1.0, 3.0]) == pytest.approx(2.0**0.5)

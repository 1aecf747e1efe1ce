"""Pictures of a campaign: what was flown, what was foretold, and equal files for equal campaigns."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import twinloop as tl
from twinloop.faces.plots import _near, _runs, campaign_picture

QUICK = {
    "moves": 1000,
    "generations": 0,
    "lags": False,
    "libraries": ("linear", "quadratic"),
    "evaluations": 200,
    "passes": 1,
    "committee_size": 3,
    "tuning_steps": 5,
    "candidates": 8,
}


@pytest.fixture(scope="module")
def campaign():
    """Two flights of a noisy quadrotor, the first of them cut."""
    system = tl.systems.Quadrotor(noise=1e-3)
    found = tl.Campaign(
        system.signals,
        controller=system.controller,
        initial_state=system.initial_state,
        target_state=system.target_state,
        duration=system.duration,
        options=QUICK,
    )
    test = found.test(system.default_gains)
    run = system.run(test)
    found.tell(
        test, tl.Trajectory(run.t[:81], run.states[:81], run.commands[:80], ended="aborted", reason="cut")
    )
    return found.run(system, experiments=2)


def picture(campaign, path):
    campaign_picture(campaign, path, "integrated absolute error (rad s)")
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def drawn(campaign, tmp_path_factory):
    return picture(campaign, tmp_path_factory.mktemp("drawn") / "runs.svg")


def test_a_flight_that_was_cut_and_one_that_was_not_are_both_drawn(drawn):
    for words in (
        "test 0",
        "test 1",
        "90 % band of the twin",
        "predicted ± spread",
        "integrated absolute error",
    ):
        assert words in drawn


def test_the_same_campaign_is_drawn_as_the_same_file(campaign, drawn, tmp_path):
    assert picture(campaign, tmp_path / "runs.svg") == drawn


def test_the_share_inside_the_band_is_counted_from_the_readings(campaign, drawn):
    run = campaign.experiments[1]
    low, high = campaign.twin.simulate(run.test).band
    rows = min(len(low), len(run.trajectory.states))
    inside = (run.trajectory.states[1:rows] >= low[1:rows]) & (run.trajectory.states[1:rows] <= high[1:rows])
    assert f"{100.0 * np.mean(inside):.0f} % of the readings inside the band" in drawn


def test_a_target_that_no_flight_came_near_is_on_the_axis(campaign):
    run = campaign.experiments[1]
    far = run.test.target_state + 9.0
    run = SimpleNamespace(number=1, test=replace(run.test, target_state=far), trajectory=run.trajectory)
    beside = SimpleNamespace(run=run, simulated=run.trajectory, places=None)
    found = SimpleNamespace(twin=SimpleNamespace(noise=None), best=None, beside=[beside], names=["test 1"])
    figure = Figure()
    _runs(figure, SimpleNamespace(signals=campaign.signals, experiments=[run], examine=lambda: found))
    ends = run.trajectory.states[-1]
    for axes, state, target, last in zip(figure.axes, campaign.signals.states, far, ends, strict=True):
        value = _near(target, last, state)
        low, high = axes.get_ylim()
        assert low < value < high

"""What a notebook shows: every value as HTML, with names escaped."""

import pytest

import lives
import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step


@pytest.fixture(scope="module")
def campaign():
    return lives.learnt(pendulum_step, 2)


def test_campaign_twin_test_and_trajectory_show_themselves(campaign):
    shown = campaign._repr_html_()
    assert "unseen-flight" in shown and "Twin:" in shown and "<table>" in shown
    assert "d rate / dt" in campaign.twin._repr_html_()
    assert "angle.kp" in campaign.tests[0]._repr_html_()
    run = campaign.experiments[0].trajectory
    assert run._repr_html_().startswith("<svg") and "state 2" in run._repr_html_()
    simulated = campaign.twin.simulate(campaign.tests[0])
    assert "90 % band" in simulated._repr_html_()
    assert "nothing was told" in lives.new("default")._repr_html_()


def test_a_reason_is_shown_and_never_run(campaign):
    test = campaign.test(PENDULUM_GAINS).explained(0.1, 0.0, "<script>alert(1)</script>")
    assert "<script" not in test._repr_html_() and "&lt;script&gt;" in test._repr_html_()
    run = campaign.experiments[0].trajectory
    cut = tl.Trajectory(run.t, run.states, run.commands, ended="aborted", reason="<img src=x>")
    assert "<img" not in cut._repr_html_()

"""What a test sheet says against its own prediction: the band leaves the envelope, the twin is not reliable."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_CONTROLLER, PENDULUM_GAINS
from lives import SMALL
from twinloop.campaign.assessment import Advice
from twinloop.campaign.examination.check import Check, Checks
from twinloop.faces.cautions import advised_to_stop, leaving
from twinloop.faces.sheet import Sheet, _table
from twinloop.remarks import serious
from twinloop.store import StoredAs

SIGNALS = tl.Signals(
    [
        tl.State("angle", "rad", scale=3.0, envelope=(-1.0, 1.5)),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-8.0, 8.0)),
    ],
    [tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)
T = 0.05 * np.arange(21)


@pytest.fixture
def campaign():
    return tl.Campaign(
        SIGNALS, controller=PENDULUM_CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0,
        threads=1, options=SMALL,
    )  # fmt: skip


def predicted(low=-0.1, high=0.1, rate=0.0):
    """A run at rest with a band; its ends may vary in time."""
    band = np.zeros((2, 21, 2))
    band[0, :, 0], band[1, :, 0], band[0, :, 1] = low, high, rate
    return tl.Trajectory(T, np.zeros((21, 2)), np.zeros((20, 1)), band=band)


def said(campaign, run, against=()):
    test = campaign.test(PENDULUM_GAINS)
    return Sheet(StoredAs("rig.db"), test, "rig-test-0.csv", campaign.setup, run, against).text


def test_a_band_that_leaves_the_envelope_is_said(campaign):
    assert "The band" not in said(campaign, predicted()) + said(campaign, None)
    to_the_end, for_a_while = np.where(T > 0.62, 1.6, 0.1), np.where((T > 0.32) & (T < 0.58), -1.2, -0.1)
    assert (
        "\nThe band of angle leaves its envelope from 0.65 s on: the twin is not sure of this flight.\n"
        in said(campaign, predicted(high=to_the_end))
    )
    assert "of angle leaves its envelope between 0.35 and 0.55 s:" in said(
        campaign, predicted(low=for_a_while)
    )
    both = predicted(high=to_the_end, rate=np.where(np.arange(21) == 3, -9.0, 0.0))
    assert leaving(SIGNALS, both) == {"angle": (pytest.approx(0.65), 1.0), "rate": (pytest.approx(0.15),) * 2}
    assert "from 0.65 s on, that of rate leaves its envelope at 0.15 s:" in said(campaign, both)


def test_a_band_a_turn_away_is_inside_where_its_angle_is():
    angle = tl.State("angle", "rad", scale=3.0, envelope=(-1.0, 1.5), periodic=True)
    signals = replace(SIGNALS, states=[angle, SIGNALS.states[1]])
    turn = 2.0 * np.pi
    assert leaving(signals, predicted(low=turn - 0.4, high=turn - 0.2)) == {}
    assert leaving(signals, predicted(low=turn - 0.4, high=turn + 1.6)) == {"angle": (0.0, 1.0)}


def test_a_twin_that_is_not_reliable_is_said_with_the_first_reason(campaign):
    against = [serious("free-run", "It misses angle."), serious("unmoved", "Nothing drives rate.")]
    line = "\nThe twin is not reliable yet (free-run, unmoved): It misses angle. twinloop show rig.db has the whole.\n"
    assert line in said(campaign, predicted(), against)
    assert "not reliable" not in said(campaign, predicted())
    test = campaign.test(PENDULUM_GAINS)
    rig = StoredAs("rig.db")
    found = Sheet(rig, test, "rig-test-0.csv", campaign.setup, predicted(high=2.0), against).facts
    assert found["serious"] == ["free-run", "unmoved"] and found["band_leaves"] == {"angle": [0.0, 1.0]}


def test_where_the_advice_is_to_stop_a_sheet_says_so_first(campaign):
    test = campaign.test(PENDULUM_GAINS)
    advice = Advice(1, True, 1e-5, 1e-3, 1e-3, True)

    fails = Check("delay", "controller", 0.6, 1.0, False, True, "It bears 0.6 periods more.")

    def advised(measured=0.4, checks=(), **changes):
        best = replace(test.quiet(), measured=measured)
        return advised_to_stop(
            SimpleNamespace(
                history=[0],
                advice=replace(advice, **changes),
                best_test=best,
                checks=lambda: Checks(checks),
            )
        )

    to_stop = "The advice is to stop: for the controller another flight would bring less than the scatter of"
    assert advised().startswith(to_stop)
    told = Sheet(StoredAs("rig.db"), test, "rig-test-0.csv", campaign.setup, advice=advised(), flown=True)
    assert told.text.splitlines()[1] == advised()
    assert told.facts["advice"] == advised()
    # Before the controller to fly has flown there is a flight to be made.
    assert advised(measured=None) == advised(stop=False) == advised(stop=None) == ""
    # Nor is it the advice where the verdict is that a check fails.
    assert advised(checks=[fails]) == ""
    assert replace(told, advice="").facts["advice"] is None
    assert "advice" not in said(campaign, None)
    for nothing in (SimpleNamespace(history=[]), SimpleNamespace(history=[0], advice=None)):
        assert advised_to_stop(nothing) == ""


def test_a_sheet_says_what_is_scaled_and_what_a_program_does_that_cannot(campaign):
    text = said(campaign, None)
    assert "rig-test-0.csv has the rows to be scaled." in text and "hold_back = false under [options]" in text
    quiet = replace(campaign.test(PENDULUM_GAINS), excitation=None, hold_back=None)
    assert "hold_back" not in Sheet(StoredAs("rig.db"), quiet, "rig-test-0.csv", campaign.setup).text


def test_a_line_break_in_a_unit_makes_no_row_of_its_own():
    one, other = (_table(["gain", "unit"], [["kp", unit]]) for unit in ("rad\nkd  9 \u202e", "rad kd 9"))
    assert one == other and one.count("\n") == 2

"""Sweeps are what the autopilots' own generators make, and their settings are refused where those cannot make them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import chirp

import twinloop as tl
from twinloop.autopilots import Sweep
from twinloop.autopilots.declared import declared
from twinloop.errors import NotAvailable
from twinloop.test import Test

SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 3.0), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-2.0, 2.0)), tl.Command("fan", "V", (0.0, 5.0))],
    dt=0.005,
)
STEPS = 1200
SWEEP = Sweep("torque", "rate roll", 0.4, 1.0, 15.0, 5.0, scale=100.0)
FADED = Sweep("torque", "mixer roll", 0.1, 1.0, 15.0, 6.0, fade_in=2.0, fade_out=1.0)


def stepped(sweep, t):
    """ArduPilot's generator, sample by sample."""
    stay, low = 2.0 / sweep.first, 2.0 * math.pi * sweep.first
    rate = math.log(sweep.last / sweep.first)
    if t <= 0.0 or t > sweep.duration:
        return 0.0
    window = 1.0
    if t <= sweep.fade_in:
        window = 0.5 * (1.0 - math.cos(math.pi * t / sweep.fade_in))
    elif t > sweep.duration - sweep.fade_out:
        window = 0.5 * (1.0 + math.cos(math.pi * (t - sweep.duration + sweep.fade_out) / sweep.fade_out))
    if t <= stay:
        return sweep.amplitude * window * math.sin(low * t - low * stay)
    share = (t - stay) / (sweep.duration - stay)
    return (
        sweep.amplitude
        * window
        * math.sin(low * (sweep.duration - stay) / rate * (math.exp(rate * share) - 1.0))
    )


@given(
    first=st.floats(0.5, 3.0),
    ratio=st.floats(1.1, 5.0),
    duration=st.floats(4.5, 6.0),
    fades=st.floats(0.0, 2.0),
)
def test_ardupilot_dwells_sweeps_and_fades(first, ratio, duration, fades):
    sweep = Sweep("fan", "mixer thrust", 0.3, first, first * ratio, duration, fades, 0.5 * fades)
    found = sweep.excitation("ardupilot", SIGNALS, STEPS)
    expected = [stepped(sweep, k * SIGNALS.dt) if k * SIGNALS.dt < duration else 0.0 for k in range(STEPS)]
    np.testing.assert_allclose(found[:, 1], expected, atol=1e-9)
    assert not found[:, 0].any()


@given(first=st.floats(0.2, 3.0), ratio=st.floats(1.1, 5.0), duration=st.integers(1, 6))
def test_betaflight_is_a_logarithmic_cosine_that_is_smaller_below_1_hz(first, ratio, duration):
    first, last = round(first, 1), round(first * ratio + 0.1, 1)
    sweep = Sweep("torque", "rate yaw", 0.5, first, last, duration, scale=100.0)
    found = sweep.excitation("betaflight", SIGNALS, STEPS)[:, 0]
    t = SIGNALS.dt * np.arange(STEPS)
    small = np.minimum(first * (last / first) ** (t / duration), 1.0)
    expected = np.where(
        t < duration, 0.5 * small * chirp(t, first, duration, last, method="logarithmic"), 0.0
    )
    np.testing.assert_allclose(found, expected, atol=1e-9)


def asked(excitation, steps=STEPS):
    described = tl.controllers.StateFeedback(("angle",), (-1.0, 1.0))
    family = described.bind(SIGNALS)
    return Test(
        family, np.zeros(family.size), np.zeros(2), np.zeros(2), steps, excitation=excitation, number=7
    )


def test_betaflight_is_told_in_whole_numbers():
    text = SWEEP.settings("betaflight", asked(SWEEP.excitation("betaflight", SIGNALS, STEPS)))
    head, *lines, last = text.splitlines()
    assert head.startswith("# ") and "test 7" in head and last == "save"
    assert dict(line.removeprefix("set ").split(" = ") for line in lines) == {
        "chirp_amplitude_roll": "40",
        "chirp_amplitude_pitch": "0",
        "chirp_amplitude_yaw": "0",
        "chirp_frequency_start_deci_hz": "10",
        "chirp_frequency_end_deci_hz": "150",
        "chirp_time_seconds": "5",
        "chirp_lag_freq_hz": "30",
        "chirp_lead_freq_hz": "30",
    }


def test_ardupilot_is_told_its_parameters():
    text = FADED.settings("ardupilot", asked(FADED.excitation("ardupilot", SIGNALS, STEPS)))
    found = dict(line.split(",") for line in text.splitlines() if not line.startswith("#"))
    assert {name: float(value) for name, value in found.items()} == {
        "SID_AXIS": 10.0,
        "SID_MAGNITUDE": pytest.approx(0.1),
        "SID_F_START_HZ": 1.0,
        "SID_F_STOP_HZ": 15.0,
        "SID_T_FADE_IN": 2.0,
        "SID_T_REC": 6.0,
        "SID_T_FADE_OUT": 1.0,
    }


@pytest.mark.parametrize("which", ["none", "another", "both commands", "of the other autopilot"])
def test_a_test_with_another_excitation_has_no_chirp_settings(which):
    own = SWEEP.excitation("betaflight", SIGNALS, STEPS)
    excitation = {
        "none": None,
        "another": 1.001 * own,
        "both commands": own + np.array([0.0, 1e-6]),
        "of the other autopilot": SWEEP.excitation("ardupilot", SIGNALS, STEPS),
    }[which]
    with pytest.raises(NotAvailable, match="one axis"):
        SWEEP.settings("betaflight", asked(excitation))


@pytest.mark.parametrize(
    ("kind", "change", "said"),
    [
        ("px4", {}, "makes chirps"),
        ("betaflight", {"axis": "mixer roll"}, "axis"),
        ("betaflight", {"first": 1.05}, "whole number"),
        ("betaflight", {"duration": 4.5}, "whole number"),
        ("betaflight", {"amplitude": 40.0}, "1 to 500"),
        ("betaflight", {"fade_in": 1.0}, "fading"),
        ("ardupilot", {"first": 0.005}, "two cycles"),
        ("ardupilot", {"fade_out": 5.0}, "expected fading|T_FADE_OUT|SID"),
        ("ardupilot", {"axis": "tail rotor"}, "axis"),
        ("ardupilot", {"command": "pump"}, "command"),
        ("ardupilot", {"last": 30.0}, "an eighth"),
        ("ardupilot", {"duration": 7.0}, "at least 7 s"),
    ],
)
def test_a_sweep_that_an_autopilot_cannot_make_is_refused(kind, change, said):
    given = {**{name: getattr(SWEEP, name) for name in SWEEP.__dataclass_fields__}, **change}
    if change == {"fade_out": 5.0}:
        given |= {"fade_out": 5.5, "duration": 6.0}
    with pytest.raises(tl.InvalidInput, match=said):
        Sweep(**given).excitation(kind, SIGNALS, STEPS)


@pytest.mark.parametrize(
    "change",
    [
        {"amplitude": math.nan}, {"amplitude": 0.0}, {"last": 0.5}, {"last": math.inf}, {"fade_in": -1.0},
        {"fade_in": 3.0, "fade_out": 3.0}, {"duration": -1.0}, {"scale": math.nan},
        {"axis": ["rate roll"]}, {"command": 3},
    ],
)  # fmt: skip
def test_numbers_that_make_no_sweep_are_refused(change):
    given = {**{name: getattr(SWEEP, name) for name in SWEEP.__dataclass_fields__}, **change}
    with pytest.raises(tl.InvalidInput, match="Sweep"):
        Sweep(**given)


def test_a_sweep_is_declared_in_a_file():
    table = {
        "command": "torque",
        "axis": "rate roll",
        "amplitude": 0.4,
        "first": 1,
        "last": 15,
        "duration": 5,
    }
    assert declared({"sweep": {**table, "scale": 100}}, "rig.toml").sweep == SWEEP
    with pytest.raises(tl.InvalidInput, match="duration"):
        declared({"sweep": {key: value for key, value in table.items() if key != "duration"}}, "rig.toml")
    with pytest.raises(tl.InvalidInput, match="speed"):
        declared({"sweep": {**table, "speed": 1}}, "rig.toml")

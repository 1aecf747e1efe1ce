"""What motion has filled, beside Runge-Kutta steps that are written out."""

import warnings

import numpy as np
import pytest

import twinloop as tl
from twinloop.identification.stored import stored
from twinloop.law.actuation import HiddenState

DT = 0.05
SIGNALS = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("force", "N", (-1.0, 1.0))], DT)


def inputs(steps):
    """Speed at the start, the middle and the end of each period, and a command that stays 0."""
    times = DT * (np.arange(steps)[:, np.newaxis] + np.array([0.0, 0.5, 1.0]))
    return [np.stack([np.sin(1.0 + 3.0 * at), np.zeros(steps)], axis=1) for at in times.T]


@pytest.mark.parametrize("settled", [False, True])
def test_a_storage_takes_one_step_of_order_four_a_period(settled):
    time, steps = 0.3, 40
    one = HiddenState((), False, 0.0, time, (0,), settled)
    start, middle, end = stored(one, inputs(steps), [slice(0, steps)], SIGNALS)
    now = np.array([time * np.sin(1.0) / 2.0 if settled else 0.0])
    for k in range(steps):
        assert start[k] == pytest.approx(now, abs=1e-12)
        begun, first = k * DT, now

        def filling(x, t):
            return np.sin(1.0 + 3.0 * t) / 2.0 - x / time

        k1 = filling(first, begun)
        k2 = filling(first + DT / 2 * k1, begun + DT / 2)
        k3 = filling(first + DT / 2 * k2, begun + DT / 2)
        k4 = filling(first + DT * k3, begun + DT)
        now = first + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        assert end[k] == pytest.approx(now, rel=1e-9, abs=1e-12)
        # Hermite's, through both ends.
        other = filling(now, begun + DT)
        assert middle[k] == pytest.approx(0.5 * (first + now) + DT / 8 * (k1 - other), rel=1e-9, abs=1e-12)


def test_a_time_far_below_a_period_is_no_reason_to_warn():
    steps = 4000
    one = HiddenState((), False, 0.0, DT / 50.0, (0,), False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = stored(one, inputs(steps), [slice(0, steps)], SIGNALS)
    assert not np.isfinite(found).all()

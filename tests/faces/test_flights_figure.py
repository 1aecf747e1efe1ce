"""Flights beside the twin, drawn: however short a flight was, its free run breaks only where it begins again."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lives
import twinloop as tl
from twinloop.campaign.examination.beside import Beside
from twinloop.faces.figures.flights import flights


def recorded(steps, at):
    times = lives.SIGNALS.dt * np.arange(steps + 1)
    return tl.Trajectory(times, np.full((steps + 1, 2), at), np.zeros((steps, 1)))


def twin_lines(figure):
    return [mark for panel in figure.panels for mark in panel.marks if getattr(mark, "name", "") == "twin"]


@given(steps=st.integers(1, 40), simulated=st.integers(1, 40), share=st.floats(0.01, 1.0))
def test_a_free_run_breaks_at_readings_alone_whatever_its_length(steps, simulated, share):
    piece = max(1, round(share * steps))
    flown, line = recorded(steps, 0.5), recorded(simulated, 0.1)
    beside = Beside(SimpleNamespace(test=None), flown, line, None, None, piece)
    drawn = twin_lines(
        flights(
            SimpleNamespace(
                signals=lives.SIGNALS, names=["a"], beside=[beside], experiments=[beside.run], learnt=1
            )
        )
    )
    again = lives.SIGNALS.dt * np.array([k for k in range(piece, min(steps, simulated), piece)])
    assert len(drawn) == 2
    for mark in drawn:
        gaps = np.flatnonzero(np.isnan(mark.y))
        assert mark.x[gaps] == pytest.approx(again)
        assert np.all(mark.y[gaps + 1] == 0.5) and np.array_equal(mark.x[gaps + 1], mark.x[gaps])
        assert len(mark.y) == simulated + 1 + 2 * len(gaps)


@pytest.mark.parametrize("steps", [3, 9, 10, 11, 20])
def test_a_flight_that_was_stopped_is_drawn_beside_the_whole_test_on_the_twin(steps):
    campaign = lives.begun()
    asked = campaign.ask()
    whole = lives.PLANT.run(asked)
    assert whole.steps == 20
    campaign.tell(asked, whole if steps == whole.steps else lives.cut(whole, steps))
    assert campaign.twin is not None
    for figure in (campaign.plot.unseen(), campaign.plot.flights()):
        assert figure._repr_svg_().startswith("<svg")
        for mark in twin_lines(figure):
            assert np.isfinite(mark.y).all()
            assert len(mark.y) == whole.steps + 1

"""A law that diverges nearly everywhere gives way to the one known before, tuned again, that follows nearly as well."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.identify_and_plan.tame import follows_nearly, is_wild
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.settings import IdentificationOptions

SIGNALS = tl.Signals(
    [tl.State("speed", "m/s", 1.0)], [tl.Command("force", "N", (-10.0, 10.0), scale=1.0)], 0.05
)
WORKERS = _core.Workers(1)


def setup():
    controller = tl.controllers.PID(
        axes=[("speed", None)], gains={"speed.kp": (0.0, 9.0), "speed.ki": (0.0, 2.0), "speed.kd": 0.0}
    )
    return tl.Campaign(
        SIGNALS, controller=controller, initial_state=[0.0], target_state=[1.0], duration=2.0, progress=None
    ).setup  # fmt: skip


def law(drag):
    """speed' = force - drag speed."""
    lines = [f"r2 = r0 * {-drag!r}", "r2 = r2 + r1"]
    return _core.Model(_core.Program.parse(program_text(2, 1, 5, [lines])), "acceleration", SIGNALS.engine)


@pytest.mark.parametrize(
    ("drag", "known", "wild"), [(-20.0, 1.0, True), (1.0, 2.0, False), (-20.0, -20.0, False)]
)
def test_a_law_is_wild_that_runs_away_where_the_known_one_lasts(drag, known, wild):
    # A drag of -20 per second is more than any gain of the box holds: speed grows by e^20 in a second.
    assert is_wild(law(drag), law(known), setup(), Unit(1).part(2), WORKERS) is wild


def held(worst, believable=True):
    return SimpleNamespace(worst=worst, believable=believable)


def test_a_tame_law_follows_nearly_as_well_up_to_twice_the_squares():
    assert follows_nearly(held(0.02), held(0.01)) and not follows_nearly(held(0.0201), held(0.01))
    assert follows_nearly(held(0.4), held(float("inf")))
    assert not follows_nearly(held(0.01, believable=False), held(0.01))


def run(drag, seed, steps=80):
    """Of a system with such a drag under commands that step at random."""
    random = np.random.default_rng(seed)
    force = np.repeat(random.uniform(-1.0, 1.0, steps // 10), 10)[:, np.newaxis]
    speed = np.zeros((steps + 1, 1))
    kept = np.exp(-drag * SIGNALS.dt)
    for k, pushed in enumerate(force):
        speed[k + 1] = kept * speed[k] + (1.0 - kept) / drag * pushed
    return Run.of(speed + 1e-3 * random.standard_normal(speed.shape), force)


def test_a_law_known_before_is_tuned_on_all_runs_and_nothing_is_searched():
    options = IdentificationOptions(form="acceleration", generations=0)
    before = identify_runs([run(2.0, 1)], SIGNALS, options, workers=WORKERS)
    runs = [run(2.0, 1), run(3.0, 2), run(3.0, 3)]
    steps = []
    again = identify_runs(
        runs, SIGNALS, options.as_known, earlier=before, workers=WORKERS, iteration=1, watch=steps.append
    )
    assert {"terms", "actuators", "hidden"}.isdisjoint(steps)
    # Of the known terms none that is needed is lost and none comes, and their constants are those of all runs.
    (was,), (now,) = (found.sums for found in (before, again))
    assert set(now.weights) <= set(was.weights) and now.weights != was.weights

"""White disturbances are normal, and nothing foretells them: others are suspected to be what the law lacks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.streams import Unit
from twinloop.campaign.identify_and_plan.misses import misses_of
from twinloop.campaign.identify_and_plan.suspects import comes_at_moments, suspects_of
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.law.noise import Noise

DT, STEPS, SENSOR, KICK = 0.02, 300, 1e-4, 0.02
SIGNALS = tl.Signals(
    [tl.State("speed", "m/s", 1.0)], [tl.Command("force", "N", (-10.0, 10.0), scale=1.0)], DT
)
FAMILY = tl.controllers.StateFeedback(["speed"], (0.0, 20.0)).bind(SIGNALS)
TEST = tl.Test(FAMILY, np.array([2.0]), [0.5], np.zeros(1), STEPS)
LIMITS, WORKERS = Limits(SIGNALS), _core.Workers(1)
MODEL = _core.Model(
    _core.Program.parse(program_text(2, 1, 3, [["r2 = r1 + 0.0"]])), "acceleration", SIGNALS.engine
)
"""speed' = force."""


def kicks(random, kind):
    """What stirs the speed in each period, of variance KICK²: always, or at single moments."""
    if kind == "always":
        return KICK * random.standard_normal(STEPS)
    return KICK * np.sqrt(20.0) * random.standard_normal(STEPS) * (random.random(STEPS) < 0.05)


def flights(kind, drag=0.0, count=3):
    """Flights of a mass that is stirred, and braked by what the law does not know."""
    found = []
    for seed in range(count):
        random, controller = np.random.default_rng(seed), TEST.controller()
        controller.reset()
        v, stirred = 0.5, kicks(random, kind)
        states, sent = [[v + SENSOR * random.standard_normal()]], []
        for k in range(STEPS):
            u = controller.command(np.array(states[-1]), TEST.target(k))
            v += DT * (float(u[0]) - drag * v * abs(v)) + stirred[k]
            states.append([v + SENSOR * random.standard_normal()])
            sent.append(u)
        run = tl.Trajectory(DT * np.arange(STEPS + 1), np.array(states), np.array(sent))
        found.append(SimpleNamespace(test=TEST, number=seed, replayed=TEST, trajectory=run))
    return found


def identified(white=KICK):
    chain = Chain(
        (0,), 0, "acceleration", np.full(1, SENSOR**2), np.full(1, SENSOR**2), Motion(white**2 / DT, 0.0, 0.1)
    )
    return SimpleNamespace(model=MODEL, chains=[chain], offsets=np.zeros(1))


def test_of_a_single_flight_nobody_knows_where_what_stirs_comes_from():
    one = flights("always", count=1)
    assert suspects_of(identified(), one, LIMITS, WORKERS) == [0]
    assert suspects_of(identified(), one * 2, LIMITS, WORKERS) == [0]


def test_what_stirs_in_each_period_is_not_suspected():
    assert suspects_of(identified(), flights("always"), LIMITS, WORKERS) == []


def test_what_comes_at_single_moments_is_suspected():
    assert suspects_of(identified(), flights("moments"), LIMITS, WORKERS) == [0]


def test_what_the_speed_foretells_is_suspected():
    assert suspects_of(identified(), flights("always", drag=8.0), LIMITS, WORKERS) == [0]


def test_where_nothing_stirs_nothing_is_suspected():
    assert suspects_of(identified(white=0.0), flights("moments"), LIMITS, WORKERS) == []


@pytest.mark.parametrize("count", [100, 300, 3000])
def test_errors_are_peaked_where_their_kurtosis_is(count):
    random = np.random.default_rng(count)
    normal = [random.standard_normal(count) for _ in range(400)]
    assert sum(map(comes_at_moments, normal)) <= 2
    # That of uniform ones is 1.8.
    assert not comes_at_moments(random.random(count) - 0.5)
    for errors in normal[:20]:
        thick = errors * np.where(np.arange(count) % 20 == 0, 20.0, 1.0)
        assert comes_at_moments(thick) and stats.kurtosis(thick, fisher=False) > 4.5


def test_a_suspect_explains_nothing_for_certain():
    flown = flights("moments")
    noise = Noise(np.full(1, SENSOR), np.full(1, KICK))
    beside = (noise, {}, Unit(0), LIMITS, WORKERS)
    assert misses_of(MODEL, flown, *beside) == []
    (speed,) = misses_of(MODEL, flown, *beside, [0])
    assert speed.state == 0 and speed.undecided and len(speed.flights) == 2 and speed.times > 3.0
    # One flight is missed by less than a tenth of how far it went.
    assert speed.share > 0.1
    assert noise.calmer([0]).moves[0] == 0.0 and noise.calmer([]).moves[0] == KICK

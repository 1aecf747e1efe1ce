"""Dry friction around a point: a carriage whose loop, as it slides, is that of a mass alone, by formula."""

import math

import numpy as np
import pytest
import scipy.optimize
import scipy.signal

import twinloop as tl
from law_twins import SIGNALS as PENDULUM_SIGNALS
from law_twins import twin_of
from twinloop.campaign.examination.delay_borne import MOST, periods_borne
from twinloop.campaign.examination.loops import loops_around
from twinloop.law.linear.friction import has_friction, sliding
from twinloop.law.linear.margins import margins_of

DT, PUSH, FORCE, WIDTH = 0.02, 4.0, 0.5, 0.05
KP, KD = 1.5, 0.9
SIGNALS = tl.Signals(
    states=[
        tl.State("position", "m", 1.0, envelope=(-1.0, 1.0)),
        tl.State("speed", "m/s", 2.0, derivative_of="position"),
    ],
    commands=[tl.Command("force", "N", (-3.0, 3.0))],
    dt=DT,
)
PD = tl.controllers.PID(
    [("position", "speed")],
    {"position.kp": (0.0, 5.0), "position.ki": 0.0, "position.kd": (0.0, 5.0)},
)
CARRIAGE = [
    f"r3 = r2 * {PUSH * SIGNALS.commands[0].size}",
    f"r4 = r1 * {1.0 / WIDTH}",
    "r4 = tanh(r4)",
    f"r4 = r4 * {FORCE}",
    "r3 = r3 - r4",
]


def carriage():
    return twin_of(CARRIAGE, signals=SIGNALS, inputs=3)


def setup(start=-0.5):
    return tl.Campaign(
        SIGNALS, controller=PD, initial_state=[start, 0.0], target_state=[0.5, 0.0], duration=8.0
    ).setup


def margins(twin, genes=(KP, KD)):
    around = [loops_around(twin, setup(), np.array(genes), "axes", slides) for slides in (False, True)]
    (loops, names), (slides, _) = around
    return loops, slides, margins_of(loops, names, "axes", slides)


def delay_margin(loop, low, high):
    """From L over frequency: the phase that is left at its only crossover, as a time."""
    crossover = scipy.optimize.brentq(lambda w: abs(loop(w)) - 1.0, low, high)
    return (math.pi + np.angle(loop(crossover))) % (2.0 * math.pi) / crossover


def as_a_mass(w):
    """L of a mass under a held force, with neither friction nor approximation."""
    z = np.exp(1j * w * DT)
    return PUSH * (KP * DT * DT / 2.0 * (z + 1.0) / (z - 1.0) ** 2 + KD * DT / (z - 1.0))


def as_damped(w):
    """L of the same mass behind a damper with the slope of the friction at rest, from SciPy."""
    A, B = np.array([[0.0, 1.0], [0.0, -FORCE / WIDTH]]), np.array([[0.0], [PUSH]])
    A, B, *_ = scipy.signal.cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), DT)
    answer = np.linalg.solve(np.exp(1j * w * DT) * np.eye(2) - A, B[:, 0])
    return KP * answer[0] + KD * answer[1]


def test_as_it_slides_a_loop_is_that_of_the_mass_alone_and_as_it_sticks_that_of_a_damper():
    loops, slides, _ = margins(carriage())
    for model, loop in ((loops[0], as_damped), (slides[0], as_a_mass)):
        frequencies = np.geomspace(0.01, 0.99 * math.pi / DT, 50)
        np.testing.assert_allclose(model.response(0, frequencies), [loop(w) for w in frequencies], rtol=1e-4)
    sticks, slid = loops[0].margins(0, "position"), slides[0].margins(0, "position")
    assert slid.delay == pytest.approx(delay_margin(as_a_mass, 1.0, 20.0), rel=1e-6)
    assert sticks.delay == pytest.approx(delay_margin(as_damped, 0.01, 20.0), rel=1e-4)
    assert sticks.delay > 5.0 * slid.delay


def test_margins_are_the_worse_of_the_two_and_say_which():
    loops, slides, found = margins(carriage())
    both = [each[0].margins(0, "position") for each in (loops, slides)]
    for row in (*found.nominal, *found.worst):
        assert row.friction == "sliding" and row.delay == both[1].delay
        assert row.gain == min(one.gain for one in both)
        assert row.sensitivity == max(one.sensitivity for one in both)
    assert "  sliding\n" in str(found) and "dry friction" in str(found)


def test_a_loop_that_only_its_sticking_makes_stable_is_not_stable():
    """Without a damper of its own: what looks like one at rest is none to a larger motion."""
    loops, slides, found = margins(carriage(), (KP, 0.0))
    assert loops[0].margins(0, "position").stable and not slides[0].margins(0, "position").stable
    assert not found.nominal[0].stable and found.nominal[0].friction == "sliding"


def test_without_dry_friction_nothing_slides():
    plain = twin_of(CARRIAGE[:1], signals=SIGNALS, inputs=3)
    loops, slides, found = margins(plain)
    assert len(loops) == 1 and not slides and found.worst[0].friction == ""
    assert "sliding" not in str(found)


@pytest.mark.parametrize("of", ["r0", "r2"])
def test_what_saturates_an_angle_or_a_command_is_no_friction(of):
    law = twin_of([f"r4 = tanh({of})"]).law
    assert not has_friction(law) and sliding(law, np.zeros(2)) is law


@pytest.mark.parametrize(("wide", "rubs"), [(0.1, False), (20.0, True)])
def test_only_a_steep_tanh_of_a_speed_is_dry_friction(wide, rubs):
    law = twin_of([f"r5 = r1 * {wide!r}", "r4 = tanh(r5)"]).law
    assert has_friction(law) is rubs


def test_a_difference_of_speeds_rubs_and_a_law_keeps_all_else():
    signals = tl.Signals(
        states=[tl.State(name, "m/s", 1.0) for name in ("v", "w")],
        commands=[tl.Command("force", "N", (-1.0, 1.0))],
        dt=DT,
    )
    rub = ["r5 = r0 - r1", "r5 = r5 * 30.0", "r5 = tanh(r5)"]
    twin = twin_of([*rub, "r3 = r2 - r5", "r6 = r1 * 0.3", "r4 = r5 - r6"], signals=signals, inputs=3)
    at = np.array([0.04, 0.01])
    slides = tl.Twin(sliding(twin.law, at).model(), signals)
    # The force that rubs is what it is at the point; its slope is gone.
    found, before = slides.linearise(at, [0.2]), twin.linearise(at, [0.2])
    np.testing.assert_allclose(found.drift, before.drift, rtol=1e-12)
    np.testing.assert_allclose(found.A, [[0.0, 0.0], [0.0, -0.3]], atol=1e-12)
    np.testing.assert_allclose(found.B, before.B, rtol=1e-12)


def by_hand(periods, start, steps, parts=50):
    """The largest distance of a flight of the carriage under Coulomb's own friction, written out in small steps."""
    x, v, waiting, most = start, 0.0, [0.0] * periods, abs(start)
    for _ in range(steps):
        waiting.append(min(3.0, max(-3.0, KP * (0.5 - x) - KD * v)))
        pushed = PUSH * waiting.pop(0)
        for _ in range(parts):
            h = DT / parts
            free = v + h * pushed
            v = math.copysign(max(0.0, abs(free) - h * FORCE), free)  # it stops, and does not turn round
            x += h * v
            most = max(most, abs(x))
    return most


@pytest.mark.parametrize("start", [-0.5, -0.9])
def test_the_delay_that_a_flight_bears_is_that_of_coulombs_friction_written_out(start):
    twin = carriage()
    campaign = tl.Campaign(
        SIGNALS, controller=PD, initial_state=[start, 0.0], target_state=[0.5, 0.0], duration=8.0
    )
    test = campaign.test({"position.kp": KP, "position.kd": KD})
    found = periods_borne([twin.model], test, twin.limits)
    kept = [by_hand(periods, start, test.steps) <= 1.0 for periods in range(MOST + 1)]
    assert found == kept.index(False) - 1
    # As it sticks the loop seems to bear far more.
    sticking = margins(twin)[0][0].margins(0, "position").delay / DT
    assert 0 < found < MOST < sticking


def test_a_member_on_which_the_flight_fails_anyway_has_no_say_but_the_twin_has():
    twin = carriage()
    campaign = tl.Campaign(
        SIGNALS, controller=PD, initial_state=[-0.5, 0.0], target_state=[0.5, 0.0], duration=8.0
    )
    test = campaign.test({"position.kp": KP, "position.kd": KD})
    away = twin_of([f"r3 = r2 * {-PUSH}"], signals=SIGNALS, inputs=3)
    alone = periods_borne([twin.model], test, twin.limits)
    assert periods_borne([twin.model, away.model], test, twin.limits) == alone
    assert periods_borne([away.model, twin.model], test, twin.limits) == 0


def test_a_command_that_acts_on_nothing_is_never_late():
    model = twin_of(["r4 = r0 * -1.0"], signals=PENDULUM_SIGNALS)
    feedback = tl.controllers.StateFeedback(None, (-1.0, 1.0))
    campaign = tl.Campaign(
        PENDULUM_SIGNALS, controller=feedback, initial_state=[0.1, 0.0], target_state=[0.0, 0.0], duration=2.0
    )
    test = campaign.test(np.full(campaign.family.size, 0.1))
    assert periods_borne([model.model], test, model.limits) == MOST

"""What is no more than the inaccuracy of a law is not called a disturbance from outside."""

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.campaign.identify_and_plan.exactness import driven, may_be_inexactness, shows
from twinloop.identification.records import Run
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.law.actuation import Actuation

SIGNALS = tl.Signals(
    [tl.State("x", "m", 1.0), tl.State("v", "m/s", 2.0, derivative_of="x")],
    [tl.Command("force", "N", (-10.0, 10.0))],
    0.1,
)


def chain(correlated, output=0):
    """Of v, then x, with sensors of 1 mm/s and 1 mm."""
    return Chain(
        (1, 0), output, "acceleration", np.array([1e-6, 1e-6]), np.zeros(2), Motion(0.0, correlated, 1.0)
    )


@pytest.mark.parametrize(("missed", "seen"), [(1e-3, False), (3e-3, True)])
def test_a_free_run_shows_a_disturbance_where_it_misses_by_more_than_the_sensor_scatters(missed, seen):
    free = np.zeros((200, 2))
    for state in (0, 1):
        read = free.copy()
        read[:, state] += missed * np.where(np.arange(200) % 2, 1.0, -1.0)
        assert shows([(read, free)], chain(1.0), Limits(SIGNALS)) is seen
    assert shows([], chain(1.0), Limits(SIGNALS))


def test_what_a_law_drives_is_the_variance_of_its_output_over_the_flights():
    force, states = 10.0 * np.sin(np.arange(200) / 5.0)[:, None], np.zeros((201, 2))
    states[:, 1] = np.linspace(0.0, 1.0, 201)
    lines = ["r3 = r2 * 4.0", "r4 = r1 * -0.5", "r3 = r3 + r4"]
    model = _core.Model(
        _core.Program.parse(program_text(3, 1, 5, [lines])), "acceleration", SIGNALS.engine,
        Actuation.direct(SIGNALS).actuators,
    )  # fmt: skip
    (drive,) = driven(model, [Run.of(states, force).continued(SIGNALS)], SIGNALS)
    between = 0.5 * (states[1:, 1] + states[:-1, 1])
    assert drive == pytest.approx((4.0 * force[:, 0] / 10.0 - 0.5 * between).var(), rel=1e-6)
    # A hundredth of what it drives it may be wrong by, a tenth it may not.
    assert may_be_inexactness(chain(1e-4 * drive), [drive]) and not may_be_inexactness(
        chain(1e-2 * drive), [drive]
    )
    assert not may_be_inexactness(chain(1e-9, output=None), [drive])
    assert not may_be_inexactness(chain(1e-9), [0.0])

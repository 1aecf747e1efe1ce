"""Parts of a run begin with what their actuators give there, whatever else commands fill."""

import numpy as np
import pytest

import twinloop as tl
from oracles import same_bits
from twinloop.identification.proposals.parts import SHARES, cut
from twinloop.identification.records import Run
from twinloop.law.actuation import Actuation, Actuator, HiddenState

SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0)],
    [tl.Command("torque", "N m", (-2.0, 2.0)), tl.Command("fan", "V", (0.0, 5.0))],
    0.02,
)
LAGS = (0.1, 0.0)
FILLED = HiddenState((0,), False, 0.0, 0.3)
STORED = HiddenState((), False, 0.0, 0.3, states=(0,))


@pytest.mark.parametrize("hidden", [(), (FILLED,), (STORED,), (FILLED, STORED)])
def test_what_is_hidden_changes_nothing_in_how_the_actuators_of_a_part_begin(hidden):
    stream = np.random.default_rng(0)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (20, 2)), 5, axis=0)
    run = Run.of(stream.normal(size=(101, 1)), commands)
    actuators = tuple(Actuator(lag) for lag in LAGS)
    effects, _, _ = Actuation(actuators).effects(SIGNALS, commands)
    parts = cut(run, SIGNALS, Actuation(actuators, hidden))
    assert len(parts) == len(SHARES)
    for (part, begun), (first, last) in zip(parts, SHARES, strict=True):
        begins, ends = int(100 * first), int(100 * last)
        assert same_bits(part.commands, commands[begins:ends])
        assert begun.hidden == hidden
        rests = [actuator.rest for actuator in begun.actuators]
        assert rests == (effects[begins].tolist() if begins else [None, None])

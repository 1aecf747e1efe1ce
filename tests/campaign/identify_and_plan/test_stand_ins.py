"""A lag in a law that explains nothing is no actuator, and is said to stand for something else."""

import twinloop as tl
from twinloop.campaign.identify_and_plan.stand_ins import claimed, stand_ins
from twinloop.law.actuation import Actuation, Actuator

SIGNALS = tl.Signals(
    [tl.State("speed", "m/s", 1.0)],
    [
        tl.Command("force", "N", (-1.0, 1.0)),
        tl.Command("brake", "1", (0.0, 1.0)),
        tl.Command("gear", "", (0.0, 1.0)),
    ],
    0.1,
)
LATE = Actuation((Actuator(0.25, 0), Actuator(), Actuator(0.0, 2)))


def test_of_a_law_that_explains_the_flights_the_actuators_are_those_of_the_law():
    assert claimed(LATE, SIGNALS, explained=True) == LATE.actuators
    assert not list(stand_ins(LATE, SIGNALS, explained=True))


def test_of_one_that_does_not_none_is_claimed_and_each_late_command_is_named():
    assert all(actuator.direct for actuator in claimed(LATE, SIGNALS, explained=False))
    (said,) = stand_ins(LATE, SIGNALS, explained=False)
    assert "force (lag 0.25 s), gear (delay 2 periods)" in said.sentence and "brake" not in said.sentence
    assert "not logged" in said.sentence and "No actuator was identified" in said.sentence


def test_commands_that_act_at_once_need_no_remark():
    assert not list(stand_ins(Actuation.direct(SIGNALS), SIGNALS, explained=False))

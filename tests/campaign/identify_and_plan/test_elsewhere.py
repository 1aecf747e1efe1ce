"""Under controllers drawn from the whole box of gains laws are compared flight by flight."""

from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from strategies import program_text
from twinloop import _core
from twinloop._ground.steps import unwatched
from twinloop._ground.streams import Unit
from twinloop.campaign.identify_and_plan.elsewhere import (
    DRAWN,
    Elsewhere,
    drawn_controllers,
    elsewhere,
    lasting_under,
)
from twinloop.campaign.identify_and_plan.learning import Learner
from twinloop.law.flight import fly

SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 5.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-10.0, 10.0), scale=1.0)],
    0.02,
)
GAINS = {"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 9.0), "angle.kd": (0.0, 20.0)}
UNIT, WORKERS = Unit(3).part(2, 4), _core.Workers(2)


def setup():
    controller = tl.controllers.PID(axes=[("angle", "rate")], gains=GAINS)
    return tl.Campaign(
        SIGNALS, controller=controller, initial_state=[0.5, 0.0], target_state=[0.0, 0.0], duration=2.0, progress=None
    ).setup  # fmt: skip


def law(damping):
    """rate' = torque − damping · rate: damped ones follow, others swing ever more or run away."""
    lines = [["r3 = r1 * " + repr(-damping), "r3 = r3 + r2"]]
    return _core.Model(_core.Program.parse(program_text(3, 1, 4, lines)), "acceleration", SIGNALS.engine)


def slowly(members, before, asked):
    """The same, one flight after the other."""
    genes = asked.family.from_unit(UNIT.stream("candidates").uniforms(DRAWN, asked.family.size))
    scales = np.array([1.0, 5.0])

    def part(one, two):
        lasts = [run.ended == "completed" for run in (one, two)]
        if not all(lasts):
            return any(lasts)
        off, moved = one.states - two.states, one.states - one.states[0]
        return np.square(off / scales).mean() > 0.04 * np.square(moved / scales).mean()

    drawn = apart = changed = 0
    for each in genes:
        test = tl.Test(asked.family, each, asked.initial_state, asked.target_state, asked.steps)
        first, *others, known = (fly(model, test, limits=asked.limits) for model in (*members, before))
        if any(run.ended == "completed" for run in (first, *others, known)):
            drawn += 1
            parted = [part(first, other) for other in others]
            apart += sum(parted) > len(parted) / 2
            changed += part(first, known)
    return Elsewhere(drawn, apart, changed, DRAWN - drawn)


@pytest.mark.parametrize(
    ("dampings", "before"),
    [((1.0, 1.02, 0.98), 1.1), ((1.0, 6.0, 0.98, 5.0), 4.0), ((-1.0, 1.0, -3.0), -6.0), ((-9.0, -9.5), -9.0)],
)
def test_laws_part_where_their_flights_do(dampings, before):
    members, asked = [law(each) for each in dampings], setup()
    found = elsewhere(members, law(before), asked, UNIT, WORKERS)
    assert found == slowly(members, law(before), asked)
    assert found == elsewhere(members, law(before), asked, UNIT, _core.Workers(1))


def test_what_is_known_well_is_the_same_everywhere_and_what_is_not_is_apart():
    near, far = law(1.0), law(8.0)
    assert elsewhere([near, law(1.01)], law(1.02), setup(), UNIT, WORKERS)[1:] == (0, 0, 0)
    assert elsewhere([near, far, far], near, setup(), UNIT, WORKERS).apart > DRAWN / 2
    assert elsewhere([near, near], far, setup(), UNIT, WORKERS).changed > DRAWN / 2


def test_laws_that_all_diverge_where_the_one_known_before_lasts_are_changed_there():
    wild = [law(-9.0), law(-9.1)]
    lost = DRAWN - lasting_under(wild, setup(), drawn_controllers(setup(), UNIT), WORKERS)[0]
    found = elsewhere(wild, law(1.0), setup(), UNIT, WORKERS)
    assert found.drawn == DRAWN and found.changed >= lost > DRAWN / 2
    nowhere = elsewhere(wild, None, setup(), UNIT, WORKERS)
    assert nowhere.lost == lost and nowhere.drawn == DRAWN - lost and nowhere.all_drawn == DRAWN


def test_a_single_law_parts_from_none():
    assert elsewhere([law(1.0)], None, setup(), UNIT, WORKERS)[1:] == (0, 0, 0)


def test_a_law_lasts_under_as_many_of_the_drawn_controllers_as_it_does_one_by_one():
    asked, laws = setup(), [law(each) for each in (1.0, -1.0, -9.0)]
    genes = asked.family.from_unit(UNIT.stream("candidates").uniforms(DRAWN, asked.family.size))
    tests = [
        tl.Test(asked.family, each, asked.initial_state, asked.target_state, asked.steps) for each in genes
    ]
    counted = [
        sum(fly(model, test, limits=asked.limits).ended == "completed" for test in tests) for model in laws
    ]
    assert lasting_under(laws, asked, drawn_controllers(asked, UNIT), WORKERS) == counted
    assert counted[0] == DRAWN and counted[2] < DRAWN / 2  # both kinds are there


@pytest.mark.parametrize(
    ("explained", "damping", "missed", "invalid"),
    [
        (False, 1.0, [], True),
        (True, 1.0, ["rate"], False),
        (True, -9.0, ["rate"], True),
        # Where nothing speaks against a law its machine may well diverge under most controllers.
        (True, -9.0, [], False),
    ],
)
def test_a_law_is_invalid_where_a_model_error_may_be_what_explains_it_and_it_is_wild(
    explained, damping, missed, invalid
):
    asked = setup()
    learner = Learner(asked, asked.options, WORKERS, unwatched)
    answer = SimpleNamespace(
        explained=explained, believed=[law(damping)], misses=lambda flights, setup, workers: missed
    )
    assert learner._invalid(answer, SimpleNamespace(flights=[None, None])) is invalid

"""What flown gains are worth without the excitation of their flight."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS
from lives import CONTROLLER, SIGNALS, THOROUGH
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.alone import best_alone, share_of


@pytest.fixture
def learnt(pendulum):
    """A campaign that has learnt the pendulum from two flights, with two more of one excitation and of none."""
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options=THOROUGH,
    )  # fmt: skip
    campaign.run(pendulum, 2)
    steps = campaign.experiments[0].test.steps
    push = np.full((steps, 1), 1.5)
    genes = [np.array(CONTROLLER.bind(SIGNALS).genes(PENDULUM_GAINS)), np.array([4.0, 1.0, 0.5])]
    for gains, excitation in zip(genes, (push, None), strict=True):
        test = campaign.test(
            dict(zip(CONTROLLER.bind(SIGNALS).names, gains.tolist(), strict=True)), excitation=excitation
        )
        campaign.tell(test, pendulum.run(test))
    _ = campaign.twin
    return campaign


def test_the_share_is_that_of_the_system(learnt, pendulum):
    excited = next(run.test for run in reversed(learnt.experiments) if run.test.excitation is not None)
    quiet = learnt.test(excited.parameters, excitation=None)
    within, without = (pendulum.run(test).states for test in (excited, quiet))
    qualities = [np.abs(states[1:, 0] - 1.0).sum() for states in (without, within)]
    method = learnt._method

    found = share_of(method.planner, method._committee(learnt._book), excited, 1)

    assert found == pytest.approx(qualities[0] / qualities[1], rel=0.02)
    assert abs(found - 1.0) > 0.05  # or it shows nothing
    assert share_of(method.planner, method._committee(learnt._book), quiet, 1) == 1.0
    method.planner.options = replace(method.planner.options, alone=False)
    assert share_of(method.planner, method._committee(learnt._book), excited, 1) == 1.0


def test_gains_are_not_the_best_for_what_their_excitation_did(learnt):
    method, book = learnt._method, learnt._book
    committee = method._committee(learnt._book)
    worth = {
        run.number: run.quality * share_of(method.planner, committee, run.test, 1)
        for run in learnt.experiments
    }

    assert best_alone(method.planner, committee, book, 1).number == min(worth, key=worth.get)
    distrusted = type(committee)(committee.members, committee.sds, trusted=False)
    assert best_alone(method.planner, distrusted, book, 1) is standing.best_flown(book)

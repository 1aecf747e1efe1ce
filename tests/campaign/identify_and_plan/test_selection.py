"""Which flights are learnt of many: within the room there is, the newest always, surprises and recent ones in turn."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from lives import PLANT, SMALL, begun
from twinloop.campaign.identify_and_plan.selection import learnt_from


def flight(number, steps, before, frozen=1.0):
    states = np.full((steps, 2), float(number))
    return SimpleNamespace(
        number=number, before=before, frozen=frozen,
        trajectory=SimpleNamespace(states=states, commands=states[:-1]),
    )  # fmt: skip


FLIGHTS = st.lists(st.tuples(st.integers(2, 40), st.none() | st.floats(0.0, 9.0)), min_size=1, max_size=12)


@given(FLIGHTS, st.integers(10, 300))
def test_what_is_learnt_fits_and_the_newest_is_among_it(shapes, most):
    flights = [flight(i, steps, before) for i, (steps, before) in enumerate(shapes)]
    learnt = learnt_from(flights, most)
    numbers = [run.number for run in learnt]
    assert numbers == sorted(set(numbers)) and numbers[-1] == len(flights) - 1
    total = sum(steps for steps, _ in shapes)
    sizes = [len(run.trajectory.states) for run in learnt]
    assert len(learnt) == len(flights) if total <= most else sum(sizes) <= most or len(learnt) == 1
    # None that was left out would still have found room.
    left = [run for run in flights if run.number not in numbers]
    assert all(len(run.trajectory.states) > most - sum(sizes) for run in left)


def test_surprises_stay_however_old_they_are():
    flights = [flight(i, 10, 5.0 if i == 3 else 0.01 * i) for i in range(50)]
    assert [run.number for run in learnt_from(flights, 40)] == [3, 47, 48, 49]


def test_a_campaign_with_more_flights_than_it_learns_goes_on_and_counts_them_all():
    campaign = begun(options={**SMALL, "most_readings": 65})
    for gain in (1.5, 2.5, 3.0):
        test = campaign.test({"angle.kp": gain, "angle.ki": 1.0, "angle.kd": 0.3})
        campaign.tell(test, PLANT.run(test))
    asked = campaign.ask()
    assert isinstance(asked, tl.Test)
    assert len(campaign.twin.errors) == 4 == len(campaign.experiments)
    # Three of 21 readings fit into 65.
    assert campaign._method.memory.latest.identified.readings <= 65 * 2

"""What is learnt of much: of many flights the newest, surprises and recent ones in turn; of long logs lively parts."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from lives import PLANT, SIGNALS, SMALL, begun
from twinloop.campaign.identify_and_plan.selection import PARTS, learnt_from, shortened


def flight(number, readings, before, frozen=1.0, states=None, test="a test"):
    states = np.full((readings, 2), float(number)) if states is None else states
    return SimpleNamespace(
        number=number, before=before, frozen=frozen, test=test,
        trajectory=SimpleNamespace(states=states, commands=0.5 * states[:-1, :1], steps=len(states) - 1),
    )  # fmt: skip


FLIGHTS = st.lists(st.tuples(st.integers(2, 40), st.none() | st.floats(0.0, 9.0)), min_size=1, max_size=12)


@given(FLIGHTS, st.integers(10, 300))
def test_what_is_learnt_fits_and_the_newest_is_among_it(shapes, most):
    flights = [flight(i, steps, before) for i, (steps, before) in enumerate(shapes)]
    learnt = learnt_from(flights, most, SIGNALS)
    numbers = [one.experiment.number for one in learnt]
    assert numbers == sorted(set(numbers)) and numbers[-1] == len(flights) - 1
    total = sum(steps for steps, _ in shapes)
    sizes = [one.readings for one in learnt]
    assert all(one.parts == ((0, one.experiment.trajectory.steps),) for one in learnt)
    assert not shortened(learnt, 0.1)
    assert len(learnt) == len(flights) if total <= most else sum(sizes) <= most or len(learnt) == 1
    # None that was left out would still have found room.
    left = [run for run in flights if run.number not in numbers]
    assert all(len(run.trajectory.states) > most - sum(sizes) for run in left)


def test_surprises_stay_however_old_they_are():
    flights = [flight(i, 10, 5.0 if i == 3 else 0.01 * i) for i in range(50)]
    assert [one.experiment.number for one in learnt_from(flights, 40, SIGNALS)] == [3, 47, 48, 49]


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


def lively(readings, moves):
    """A log that is at rest but for some stretches (first, last), in which it goes to and fro."""
    states = np.zeros((readings, 2))
    for first, last in moves:
        states[first:last, 0] = np.sin(0.7 * np.arange(last - first))
    return states


def test_of_a_long_log_the_parts_are_learnt_in_which_it_moves():
    log = flight(
        0, 4001, None, states=lively(4001, [(300, 380), (1200, 1290), (2500, 2600), (3500, 3580)]), test=None
    )
    (learnt,) = learnt_from([log], 400, SIGNALS)
    assert learnt.readings <= 400 and len(learnt.parts) == PARTS
    for (first, last), (states, commands) in zip(learnt.parts, learnt.recorded(), strict=True):
        assert states.tobytes() == log.trajectory.states[first : last + 1].tobytes()
        assert len(states) == len(commands) + 1 and states[:, 0].std() > 0.3
    (said,) = shortened([learnt], 0.1)
    assert said.code == "parts-of-logs" and not said.serious and "Of one log" in said.sentence


@given(st.lists(st.integers(2, 900), min_size=1, max_size=5), st.integers(10, 600))
def test_logs_share_the_room_and_tests_are_learnt_whole(lengths, most):
    draw = np.random.default_rng(0)
    logs = [
        flight(i, length, None, states=draw.standard_normal((length, 2)), test=None)
        for i, length in enumerate(lengths)
    ]
    test = flight(len(logs), 8, 0.1)
    learnt = learnt_from([*logs, test], most, SIGNALS)
    assert sum(one.readings for one in learnt) <= most
    assert learnt[-1].experiment is test and learnt[-1].parts == ((0, 7),)
    for one in learnt:
        steps = one.experiment.trajectory.steps
        assert all(0 <= first < last <= steps for first, last in one.parts)
        assert all(a[1] <= b[0] for a, b in zip(one.parts, one.parts[1:], strict=False))
    if most >= 40 * (len(logs) + 1):
        # Each has its share of what the test leaves.
        share = max(most - 8, most // 2) // len(logs)
        assert len(learnt) == len(logs) + 1
        assert all(
            one.readings >= min(share, one.experiment.trajectory.steps + 1) - PARTS for one in learnt[:-1]
        )


def test_a_twin_of_a_long_log_is_held_against_all_of_it_and_says_what_it_has_learnt():
    campaign = begun(options={**SMALL, "most_readings": 80})
    test = campaign.test({"angle.kp": 1.5, "angle.ki": 1.0, "angle.kd": 0.3})
    runs = [PLANT.run(test) for _ in range(8)]
    states, commands = (
        np.concatenate([getattr(run, name)[:20] for run in runs]) for name in ("states", "commands")
    )
    states = np.concatenate([states, runs[-1].states[20:21]])
    campaign.attach(tl.Trajectory(SIGNALS.dt * np.arange(len(states)), states, commands))
    assert "parts-of-logs" in [remark.code for remark in campaign.twin.remarks]
    assert len(campaign.experiments[-1].trajectory.states) == 161
    assert campaign._method.memory.latest.identified.readings <= 80 * 2

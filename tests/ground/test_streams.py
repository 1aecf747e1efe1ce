"""Streams of random numbers: by name, and no two units of work share one."""

from typing import get_args

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground import streams
from twinloop._ground.streams import Purpose, Unit
from twinloop.systems.sensors import run_stream
from twinloop_exam.campaigns import random_gains
from twinloop_exam.systems import Draw, subject

COMMON = {"sensors", "off_start", "band"}
"""What all flights that are compared share on purpose: common random numbers."""


@pytest.fixture
def drawn(monkeypatch):
    """The names of all streams that are asked for, in their order."""
    names, named = [], Unit.named

    def recorded(unit, purpose):
        names.append(named(unit, purpose))
        return names[-1]

    monkeypatch.setattr(streams.Unit, "named", recorded)
    return names


def test_no_two_units_of_work_of_a_campaign_share_a_stream(drawn):
    system = tl.systems.Quadrotor(noise=1e-3, seed=1)
    options = {
        "moves": 400, "starts": 1, "generations": 2, "population": 40, "passes": 2, "restarts": 2, "draws": 4,
        "committee_size": 6, "candidates": 32, "evaluations": 512, "target_range": (0.1,) * 6,
    }  # fmt: skip
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=0.8, seed=5, threads=1, options=options,
    )  # fmt: skip
    campaign.run(system, experiments=2)
    campaign.twin.simulate(campaign.best_test)
    work = [name for name in drawn if name[1] not in COMMON]
    assert len(work) == len(set(work)) > 50
    used = {purpose for _, purpose, _ in drawn}
    assert used >= {"subsets", "terms", "members", "gains", "fine_gains", "candidates", "ends", "band"}
    assert {purpose: {path for _, p, path in drawn if p == purpose} for purpose in COMMON & used} == {
        purpose: {(0,)} for purpose in COMMON & used
    }


def test_streams_of_one_name_are_one_and_of_others_are_others():
    names = [
        Unit(seed, path).named(purpose)
        for seed in (0, 1)
        for purpose in ("gains", "members")
        for path in ((0,), (1,), (0, 0), (0, 1), (1, 0), (0, 0, 0), (0, 0, 0, 0, 0))
    ]
    first = {name: _core.Stream(name).uniforms(4).tobytes() for name in names}
    assert len(set(first.values())) == len(names)
    assert all(_core.Stream(name).uniforms(4).tobytes() == bits for name, bits in first.items())


def test_the_noise_of_a_system_is_none_of_a_campaigns_draws():
    """Streams of systems were those of campaigns from the 78th run on, while both were keyed by plain numbers."""
    noise = {run: run_stream(0, run).standard_normal(3).tobytes() for run in range(100)}
    campaigns = {
        Unit(0, (number,)).stream(p).normals(3).tobytes() for number in range(3) for p in get_args(Purpose)
    }
    assert len(set(noise.values())) == 100
    assert campaigns.isdisjoint(noise.values())


def test_random_gains_of_an_exam_are_drawn_apart_from_the_noise_of_its_system(drawn):
    """They were drawn from the bits of the second run's noise."""
    list(random_gains(subject("quadrotor"), 3, 2))
    assert drawn == [(3, "exam", (Draw.RANDOM_GAINS,))]
    gains = Unit(3).part(Draw.RANDOM_GAINS).stream("exam").uniforms(9)
    assert np.intersect1d(gains, np.concatenate([run_stream(3, run).random(9) for run in range(3)])).size == 0


def test_python_and_the_engine_know_the_same_purposes():
    assert set(get_args(Purpose)) <= set(_core.purposes())
    with pytest.raises(ValueError, match="purpose of single"):
        _core.Stream((0, "luck", [0]))
    with pytest.raises(ValueError, match="1 to 5 numbers"):
        _core.Stream((0, "gains", []))
    with pytest.raises(ValueError, match="1 to 5 numbers"):
        _core.Stream((0, "gains", [0] * 6))


def test_numbers_are_drawn_where_they_should_be():
    stream = Unit(1).part(2).stream("exam")
    assert stream.normals(2, 3).shape == (2, 3)
    assert all(2.0 <= stream.uniform(2.0, 3.0) < 3.0 for _ in range(100))
    assert all(0.1 <= stream.log_uniform(0.1, 10.0) <= 10.0 for _ in range(100))
    assert {stream.below(3) for _ in range(100)} == {0, 1, 2}
    uniform, normal = stream.uniforms(100_000), stream.normals(100_000)
    assert abs(uniform.mean() - 0.5) < 0.01 and abs(normal.mean()) < 0.02 and abs(np.std(normal) - 1.0) < 0.02
    with pytest.raises(ValueError, match="at least 1"):
        stream.below(0)
    with pytest.raises(ValueError, match="0 < low"):
        stream.log_uniform(0.0, 1.0)

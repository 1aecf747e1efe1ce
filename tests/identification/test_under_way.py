"""An identification that is kept between two proposals and read back goes on to the same bits."""

import numpy as np
import pytest

from sameness import same, through_json
from small_plants import fans, gravity, pendulum_like, swung
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import UnderWay, identify_runs
from twinloop.identification.searches import PROPOSALS

QUICK = {"moves": 1500, "starts": 2, "generations": 1, "population": 20, "committee_size": 4, "tuning_steps": 5,
         "form": "acceleration"}  # fmt: skip


def one_run():
    return pendulum_like(), [swung(gravity, 0, noise=1e-3)], [], None


def with_a_hidden_state():
    """What was known of two runs is a second start on three."""
    signals, runs = fans(3, fading=3.0)
    known = learnt(signals, runs[:2], [np.ones(2)], None)
    assert known.actuation.hidden
    return signals, runs, [np.ones(2)], known


def learnt(signals, runs, rests, known, **more):
    options = options_of("default", QUICK)
    return identify_runs(
        runs, signals, options, rests=rests, seed=3, iteration=len(runs), earlier=known,
        workers=_core.Workers(1), **more,
    )  # fmt: skip


class NextStep(Exception):
    """Ends an identification once it has come to one more step."""


def next_step(under_way):
    raise NextStep(under_way)


@pytest.mark.parametrize(("posed", "starts"), [(one_run, 1), (with_a_hidden_state, 2)])
def test_it_goes_on_from_every_step_that_was_kept_to_the_same_bits(posed, starts):
    """To the next step from each, so to the end from all."""
    signals, runs, rests, known = posed()
    kept = []
    whole = learnt(signals, runs, rests, known, keep=kept.append)
    assert len(kept) == 1 + starts * (1 + len(PROPOSALS))
    read = [UnderWay.from_record(through_json(step.to_record()), signals) for step in kept]
    assert same(read, kept)
    for step, after in zip(read[:-1], kept[1:], strict=True):
        with pytest.raises(NextStep) as reached:
            learnt(signals, runs, rests, known, under_way=step, keep=next_step)
        assert same(reached.value.args[0], after)
    rest = []
    assert same(learnt(signals, runs, rests, known, under_way=read[-1], keep=rest.append), whole)
    assert rest == []

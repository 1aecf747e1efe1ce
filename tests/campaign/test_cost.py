"""What a campaign has cost: every kind of run is counted once, seconds and qualities add up."""

import dataclasses
import math

import numpy as np
import pytest

from lives import OTHER_GAINS, PLANT, SIGNALS, begun, by_hand, cut, made
from twinloop.faces.report.cost import cost_table
from twinloop.faces.report.tables.flights import data
from twinloop.faces.result import summary


def test_every_kind_of_run_is_counted_once_and_seconds_add_up():
    campaign = begun(duration=1.0)
    assert (campaign.cost.runs, campaign.cost.seconds, campaign.cost.given_away) == (
        1,
        pytest.approx(1.0),
        0.0,
    )
    second = campaign.test(OTHER_GAINS)
    campaign.tell(second, PLANT.run(second))
    aborted, failed, silent, never = (campaign.test(OTHER_GAINS) for _ in range(4))
    campaign.tell(aborted, cut(PLANT.run(aborted), 8))
    campaign.tell_failed(failed, "the motor cut out", partial=cut(PLANT.run(failed), 5))
    campaign.tell_failed(silent, "it did not start")
    campaign.abandon(never)
    campaign.attach(by_hand(30))
    cost = campaign.cost
    assert (cost.runs, cost.cut, cost.failed, cost.attached, cost.abandoned) == (5, 1, 2, 1, 1)
    assert cost.seconds == pytest.approx(0.05 * (20 + 20 + 8 + 5 + 30))
    qualities = [run.quality for run in campaign.experiments if run.quality is not None]
    assert cost.best == min(qualities) and len(qualities) == 2
    assert cost.given_away == pytest.approx(max(qualities) - min(qualities))


def test_the_envelope_that_was_used_and_left_is_said():
    campaign = made()
    test = campaign.test(OTHER_GAINS)
    run = PLANT.run(test)
    states = np.array(run.states)
    states[5:7, 1] = 15.0  # bounds are ± 12
    campaign.tell(test, type(run)(run.t, states, run.commands))
    assert campaign.cost.left_envelope == 1 and campaign.cost.usage == pytest.approx(15.0 / 12.0)


def test_the_report_says_it_with_units():
    table = cost_table(summary(begun(), {}, {}), 75.0)
    said = {row[0]: row[1] for row in table.rows}
    assert said["recorded flight time"] == "1 s" and said["of these cut, failed"] == "0, 0"
    assert said["cumulative regret"].startswith("0 rad s over a best of ")
    assert said["elapsed time to the last recorded flight"] == "1 min 15 s"
    assert math.isfinite(float(said["largest use of the envelope"].split()[0]))


@pytest.mark.parametrize("declared", [True, False])
def test_nothing_is_used_of_an_envelope_that_is_not_declared(declared):
    states = [dataclasses.replace(s, envelope=s.envelope if declared else None) for s in SIGNALS.states]
    campaign = begun(signals=dataclasses.replace(SIGNALS, states=states))
    (row,) = data(campaign.examine()).rows
    said = {row[0]: row[1] for row in cost_table(summary(campaign, {}, {}), None).rows}
    used = 100.0 * campaign.cost.usage
    if declared:
        assert used > 0.0 and float(row[6]) == pytest.approx(used, rel=1e-3)
        assert said["largest use of the envelope"] == f"{used:.3g} %"
        assert said["runs that left the envelope"] == "0"
    else:
        assert row[6] == "–"
        assert said["largest use of the envelope"] == "none declared"
        assert said["runs that left the envelope"] == "–"

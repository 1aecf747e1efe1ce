"""Campaigns that earlier versions have written are read, and go on.

The files in `earlier/` were written by version 0.1.0 at commit afe2f00: a pendulum, two flights, a third one asked for.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import twinloop as tl
from conftest import pendulum_step
from lives import CONTROLLER, SIGNALS
from sameness import through_json
from twinloop.campaign.history import Planned
from twinloop.campaign.setup import Setup
from twinloop.identification.search.structure import Sum

EARLIER = Path(__file__).parent / "earlier"
LAWS = {"default": "- 24.6074*sin(angle)", "paper": "521.991/(212.8*angle + 930.573)"}
"""What the version that wrote them had printed of their twins."""


@pytest.fixture(params=sorted(LAWS))
def written(request):
    return json.loads((EARLIER / f"{request.param}.json").read_text(encoding="utf-8"))


def test_what_was_told_and_learnt_is_read(written):
    campaign = tl.Campaign.from_record(written, threads=1)
    runs = [run for _, run in written["logbook"]["experiments"]]
    assert len(campaign.experiments) == len(runs) == 2 and len(campaign.waiting) == 1
    for experiment, run in zip(campaign.experiments, runs, strict=True):
        assert np.array_equal(experiment.trajectory.states, run["trajectory"]["states"])
    assert LAWS[campaign.setup.preset] in campaign.twin.equations()


def test_errors_in_the_units_of_states_are_read_as_those_of_the_preset(written):
    campaign = tl.Campaign.from_record(written, threads=1)
    scales = np.array(
        [state.scale if campaign.setup.preset == "default" else 1.0 for state in SIGNALS.states]
    )
    for experiment, (_, run) in zip(campaign.experiments, written["logbook"]["experiments"], strict=True):
        states = np.array(run["trajectory"]["states"]) / scales
        assert experiment.frozen == pytest.approx(np.square(states[1:] - states[0]).mean(), rel=1e-12)
        if run["before"] is None:
            assert experiment.normalised_before is None
        else:
            ratio = run["before"] / run["frozen"]
            assert experiment.normalised_before == pytest.approx(ratio, rel=1e-12)


def test_subsets_that_had_no_names_are_read():
    written = json.loads((EARLIER / "default.json").read_text(encoding="utf-8"))
    (before,) = written["memory"]["latest"]["identified"]["sums"]
    found = Sum.from_record(before)
    assert len(found.others) == len(before["others"]) > 0
    for other, (terms, above) in zip(found.others, before["others"], strict=True):
        assert other.terms == tuple(terms) and other.above == above
    again = Sum.from_record(through_json(found.to_record()))
    assert again.others == found.others and again.subsets[0].terms == tuple(found.weights)


def test_it_goes_on_and_what_it_writes_now_is_read_again(written):
    campaign = tl.Campaign.from_record(written, threads=1)
    again = tl.Campaign.from_record(through_json(campaign.to_record()), threads=1)
    for each in (campaign, again):
        rig, test = tl.systems.Simulated(SIGNALS, pendulum_step, noise=1e-3), each.waiting[0]
        each.tell(test, rig.run(test))
    assert campaign.twin.equations(17) == again.twin.equations(17)
    assert np.array_equal(campaign.best_test.genes, again.best_test.genes)


def test_an_unknown_key_of_an_earlier_version_is_refused_by_its_name(written):
    written["memory"]["latest"]["luck"] = 1.0
    with pytest.raises(tl.InvalidInput, match="luck"):
        tl.Campaign.from_record(written)


def test_of_a_test_without_a_committee_nothing_was_estimated():
    now = Planned(1, (2.0,), None, None, None, None, None, None, "Chosen without a committee.")
    zeros = {"predicted": "nan", "spread": 0.0, "risk": 0.0, "safe": True, "bits": 0.0, "gain": 0.0}
    assert Planned.from_record({**now.to_record(), **zeros, "version": 1}) == now
    assert Planned.from_record(through_json(now.to_record())) == now
    judged = Planned(1, (2.0,), 1.5, 0.1, 0.05, True, 3.0, 0.2, "It tells most.")
    assert Planned.from_record({**judged.to_record(), "version": 1}) == judged


@pytest.mark.parametrize("contacts", [True, False])
def test_where_contacts_were_not_searched_dry_friction_was_not_either(contacts):
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0,
    )  # fmt: skip
    record = campaign.setup.to_record()
    record |= {"version": 1, "options": {**record["options"], "contacts": contacts}}
    del record["options"]["friction"]
    found = Setup.from_record(record)
    assert found.options.contacts is found.options.friction is contacts
    again = Setup.from_record(through_json(found.to_record()))
    assert again.options == found.options

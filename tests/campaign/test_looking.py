"""Looking changes nothing: what is asked next, what flies in the end and the band are functions of `tell` and `ask`."""

import copy
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import twinloop as tl
from conftest import PENDULUM_GAINS
from lives import FULL_LIFE, LIFE, PLANT, WITHDRAWN_LIFE, StopAt, lived, new, outcome, stored
from sameness import same
from twinloop.faces.result import summary
from twinloop.planning.planner import Planner

LOOKS = {
    "twin": lambda campaign: campaign.twin.simulate(campaign.experiments[0].test),
    "best_test": lambda campaign: campaign.best_test,
    "controller": lambda campaign: campaign.controller.command([0.1, 0.0], [1.0, 0.0]),
    "committee": lambda campaign: campaign.committee,
    "history": lambda campaign: campaign.history,
    "experiments": lambda campaign: campaign.experiments,
    "printing": lambda campaign: f"{campaign!r}{campaign}",
    "summary": lambda campaign: summary(campaign, {}, {}),
    "copy": copy.copy,
}
UNSEEN = {preset: None for preset in ("paper", "default")}


def unseen(preset):
    if UNSEEN[preset] is None:
        UNSEEN[preset] = outcome(lived(new(preset), LIFE))
    return UNSEEN[preset]


def seen(preset, looks):
    """A campaign of which, after step k, one sees `looks[k]`, in that order."""

    def look(campaign, step):
        for what in looks.get(step, ()):
            LOOKS[what](campaign)
        return campaign

    return outcome(lived(new(preset), LIFE, look))


@given(
    st.dictionaries(
        st.integers(0, len(LIFE) - 1), st.lists(st.sampled_from(sorted(LOOKS)), max_size=3), max_size=6
    )
)
@settings(max_examples=25)
def test_looking_at_a_campaign_of_the_paper_changes_no_bit(looks):
    assert seen("paper", looks) == unseen("paper")


@pytest.mark.parametrize(
    "looks",
    [
        {0: ["twin"]},
        {0: ["best_test"], 4: ["controller", "history"]},
        {4: ["committee", "best_test"], 7: ["twin"], 8: ["summary"]},
        {step: ["printing", "controller", "copy", "twin"] for step in range(len(LIFE))},
    ],
    ids=["a look before the second run", "between two answers", "before more runs", "everywhere"],
)
def test_looking_at_a_campaign_of_default_changes_no_bit(looks):
    assert seen("default", looks) == unseen("default")


@pytest.mark.parametrize(
    ("preset", "life"), [("default", FULL_LIFE), ("default", WITHDRAWN_LIFE), ("paper", WITHDRAWN_LIFE)]
)
def test_looking_changes_no_bit_of_what_follows_attached_failed_abandoned_and_withdrawn_flights(preset, life):
    def look(campaign, step):
        for what in ("controller", "twin", "printing"):
            LOOKS[what](campaign)
        return copy.copy(campaign)

    expected = outcome(lived(new(preset), life))
    assert outcome(lived(new(preset), life, look)) == expected


def test_a_campaign_is_not_pickled_and_the_refusal_says_what_keeps_it():
    campaign = new("default")
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        with pytest.raises(tl.InvalidInput, match=r"campaign\.save\(path\).*campaign\.to_record\(\)"):
            pickle.dumps(campaign, protocol)


@pytest.mark.parametrize("preset", ["paper", "default"])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_goes_on_with_the_same_bits(preset, copied):
    kept = []

    def look(campaign, step):
        kept.append(campaign)
        return copied(campaign)

    assert outcome(lived(new(preset), LIFE, look)) == unseen(preset)
    # Those that stayed behind know nothing of what came after.
    for step, campaign in enumerate(kept):
        assert len(campaign.experiments) == sum(event != "ask" for event in LIFE[: step + 1])


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_shares_nothing(copied):
    plant = PLANT
    campaign = new("paper").run(plant, 2)
    before = outcome(campaign)
    other = copied(campaign)
    asked = other.ask()
    other.tell(asked, plant.run(asked))
    other.threads, other.interrupted = 7, True
    assert outcome(campaign) == before
    assert campaign.threads == 1 and not campaign.interrupted
    # A test that was asked of the one before it was copied may be told to both; one asked since may not.
    again = campaign.ask()
    assert again.same_as(asked)
    stranger = other.ask()
    with pytest.raises(tl.InvalidInput, match="as it was made"):
        campaign.tell(stranger, plant.run(stranger))


def test_a_look_that_was_interrupted_changes_nothing():
    for preset, call in (("paper", 1), ("paper", 3), ("default", 2), ("default", 6)):

        def look(campaign, step, call=call):
            # After the last one a look shows the best so far, as it should.
            campaign.progress = StopAt(call) if step < len(LIFE) - 1 else None
            try:
                _ = campaign.twin, campaign.best_test
            except KeyboardInterrupt:
                assert campaign.interrupted
            campaign.progress = None
            return campaign

        assert outcome(lived(new(preset), LIFE, look)) == unseen(preset)


# From a store


def refuse(*_):
    raise AssertionError("a look has tuned gains")


def looked(path, monkeypatch):
    """The controller to fly, as whoever reads the store sees it; tuning fails."""
    monkeypatch.setattr(Planner, "tune", refuse)
    campaign = tl.Campaign.load(path, read_only=True, threads=1)
    campaign.interrupted = True
    best = campaign.best_test
    monkeypatch.undo()
    return best


def test_whoever_looks_at_a_store_tunes_nothing(tmp_path, monkeypatch):
    """The controller stands there with what was learnt; after a flight that is not learnt yet it is still the one."""
    path = tmp_path / "hover.db"
    campaign = stored(path, "default")
    first = campaign.test(PENDULUM_GAINS)
    campaign.tell(first, PLANT.run(first))
    best = campaign.best_test
    assert same(looked(path, monkeypatch), best)
    asked = campaign.ask()
    known = looked(path, monkeypatch)
    assert same(known.genes, best.genes) and known.predicted == best.predicted
    campaign.tell(asked, PLANT.run(asked))
    assert looked(path, monkeypatch).reason
    campaign.tell_failed(campaign.ask(), "the motor cut out")
    assert looked(path, monkeypatch).reason
    campaign.close()


def test_a_twin_on_which_nothing_was_tuned_yet_shows_the_gains_known_before(tmp_path, monkeypatch):
    path = tmp_path / "hover.db"
    campaign = stored(path, "default")
    first = campaign.test(PENDULUM_GAINS)
    campaign.tell(first, PLANT.run(first))
    _ = campaign.twin
    assert "No gains were tuned on this twin yet." in looked(path, monkeypatch).reason
    assert same(looked(path, monkeypatch).genes, first.genes)
    campaign.tell(campaign.ask(), PLANT.run(campaign.tests[1]))
    _ = campaign.twin
    assert "No gains were tuned on this twin yet." in looked(path, monkeypatch).reason
    campaign.close()

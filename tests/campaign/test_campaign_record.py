"""A campaign that is rebuilt from its record goes on with the same bits, in this process and in another."""

import json
import subprocess
import sys

import pytest

import twinloop as tl
from lives import LIFE, lived, new
from sameness import same, through_json
from twinloop.campaign.history import Lesson
from twinloop.law.actuation import Actuation, Actuator, HiddenState
from twinloop.records import to_text

ELSEWHERE = """
import json, sys
import twinloop as tl
campaign = tl.Campaign.from_record(json.load(sys.stdin), threads=1)
tests = [campaign.ask(), campaign.ask(last=True), campaign.best_test]
print(json.dumps([test.to_record() for test in tests]))
print(json.dumps(campaign.to_record()))
"""


def rebuilt(campaign):
    return tl.Campaign.from_record(through_json(campaign.to_record()), threads=1)


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_another_process_asks_what_the_original_asks(preset):
    campaign = lived(new(preset, seed=4), LIFE[:6])
    written = to_text(campaign.to_record())
    answer = subprocess.run(
        [sys.executable, "-c", ELSEWHERE], input=written, capture_output=True, text=True, check=True
    )
    tests, record = (json.loads(line) for line in answer.stdout.splitlines())
    assert tests == [
        test.to_record() for test in (campaign.ask(), campaign.ask(last=True), campaign.best_test)
    ]
    assert to_text(record) == to_text(campaign.to_record())


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_rebuilt_after_each_event_is_the_one_that_was_not(preset):
    plain = lived(new(preset, seed=1), LIFE)
    moved = lived(new(preset, seed=1), LIFE, lambda campaign, step: rebuilt(campaign))
    for pair in zip(plain.experiments, moved.experiments, strict=True):
        assert same(*(run.trajectory for run in pair))
        assert same(*(run.before for run in pair)) and same(*(run.test.genes for run in pair))
    assert same(plain.history, moved.history)
    assert same(plain.twin.members, moved.twin.members) and same(plain.twin.model, moved.twin.model)
    assert same(plain.best_test.genes, moved.best_test.genes)


def test_what_was_looked_at_in_between_is_kept_too():
    campaign = lived(new("default"), LIFE[:4])
    best = campaign.best_test
    found = rebuilt(campaign)
    assert to_text(found.to_record()) == to_text(campaign.to_record())
    assert same(found.best_test, best)


def test_an_iteration_that_was_interrupted_goes_on_where_it_stopped():
    stopped = []

    def stop(progress):
        if progress.phase == "models" and progress.generation >= 2 and not stopped:
            stopped.append(progress.generation)
            raise KeyboardInterrupt

    campaign = lived(new("paper"), LIFE[:1])
    campaign.progress = stop
    with pytest.raises(KeyboardInterrupt):
        campaign.ask()
    record = through_json(campaign.to_record())
    assert record["memory"]["latest"]["ahead"] > 0
    assert same(tl.Campaign.from_record(record).ask().genes, lived(new("paper"), LIFE[:1]).ask().genes)


def test_tests_of_the_original_can_be_told_to_the_one_that_was_rebuilt(new_campaign, pendulum):
    campaign = new_campaign()
    first = campaign.test(pendulum.default_gains)
    found = rebuilt(campaign)
    found.tell(first, pendulum.run(first))
    assert len(found.experiments) == 1 and len(campaign.experiments) == 0


def damaged(record, path, value):
    """A record with another value somewhere."""
    record = through_json(record)
    place = record
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return record


@pytest.mark.parametrize(
    ("path", "value", "word"),
    [
        (["setup", "options", "model_populaton"], 3, "did you mean 'model_population'"),
        (["setup", "steps"], 10**15, "steps"),
        (["setup", "preset"], "papers", "'paper'"),
        (["setup", "controller", "kind"], "piid", "did you mean 'pid'"),
        (["logbook", "experiments", 0, 0], 7, "number of a test"),
        (["logbook", "tests", 0, "number"], 3, "keep the tests in their order"),
        (["logbook", "experiments", 0, 1, "trajectory", "t"], [0.0], "shape"),
        (["memory", "latest", "experiments"], 3, "another campaign"),
        (["memory", "latest", "ahead"], 10**6, "generations left"),
        (["memory", "latest", "models", "population", 0], "program inputs=1", "expected"),
        (["memory", "latest", "models", "generation"], -1, "at least 0"),
        (["memory", "kind"], "memory_of_default", "memory_of_paper"),
    ],
)
def test_a_campaign_that_never_was_is_refused(path, value, word):
    record = lived(new("paper"), LIFE[:3]).to_record()
    with pytest.raises(tl.InvalidInput, match=word):
        tl.Campaign.from_record(damaged(record, path, value))


HIDDEN = {
    "commands": [0],
    "squared": False,
    "rest": None,
    "time": 1.0,
    "states": [],
    "settled": False,
    "turns": 0.0,
    "gap": 0.0,
    "damping": 0.0,
}


@pytest.fixture(scope="module")
def remembered():
    return lived(new("default"), LIFE[:3]).to_record()


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        (["actuation", "actuators", 0, "lag"], -1.0, "actuation.actuators[0].lag"),
        (["actuation", "actuators", 0, "lag"], "inf", "actuation.actuators[0].lag"),
        (["actuation", "actuators", 0, "delay"], -1, "actuation.actuators[0].delay"),
        (["actuation", "actuators", 0, "delay"], 1001, "actuation.actuators[0].delay"),
        (["actuation", "actuators", 0, "rest"], "inf", "actuation.actuators[0].rest"),
        (["actuation", "hidden"], [HIDDEN | {"time": 0.0}], "actuation.hidden[0].time"),
        (["actuation", "hidden"], [HIDDEN | {"rest": "nan"}], "actuation.hidden[0].rest"),
        (["actuation", "hidden"], [HIDDEN | {"settled": True}], "actuation.hidden[0]"),
        (["actuation", "hidden"], [HIDDEN | {"commands": [1]}], ""),
        (["sums", 0, "weights", 0, 0], -1, ""),
        (["sums", 0, "chain", "states", 0], -1, ""),
        (["sums", 0, "chain", "form"], "x", "sums[0].chain"),
        (["sums", 0, "chain", "motion", "white"], -1.0, "sums[0].chain.motion"),
        (["chains", 0, "sensors", 0], "inf", "chains[0].sensors"),
    ],
)
def test_what_cannot_have_been_learnt_is_refused_by_its_place(remembered, path, value, place):
    identified = ["memory", "latest", "identified"]
    with pytest.raises(tl.InvalidInput) as refusal:
        tl.Campaign.from_record(damaged(remembered, [*identified, *path], value))
    whole = ".".join(["memory_of_default.latest.identified", *([place] if place else [])])
    assert f"ecord {whole}" in str(refusal.value)


GUST = {"states": [1, 0], "form": "acceleration", "sd": 0.1, "correlation_time": 0.3}


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        (["noise", "sensors", 0], "inf", "noise.sensors"),
        (["noise", "sensors", 0], -1.0, "noise.sensors"),
        (["noise", "moves", 1], "nan", "noise.moves"),
        (["noise", "correlated"], [GUST | {"sd": "inf"}], "noise.correlated[0].sd"),
        (["noise", "correlated"], [GUST | {"correlation_time": 0.0}], "noise.correlated[0].correlation_time"),
        (["noise", "dt"], "nan", "noise.dt"),
        (["inflation"], "inf", "inflation"),
    ],
)
def test_a_band_that_cannot_be_drawn_is_refused_by_its_place(remembered, path, value, place):
    with pytest.raises(tl.InvalidInput) as refusal:
        tl.Campaign.from_record(damaged(remembered, ["memory", "latest", "ensembles", 0, *path], value))
    assert f"ecord memory_of_default.latest.ensembles[0].{place}: expected" in str(refusal.value)


def test_what_was_learnt_from_more_runs_than_there_are_is_refused():
    record = through_json(lived(new("default"), LIFE[:3]).to_record())
    record["logbook"]["experiments"].pop()
    with pytest.raises(tl.InvalidInput, match="another campaign"):
        tl.Campaign.from_record(record)


def test_a_record_names_every_option_so_that_later_defaults_do_not_matter():
    for preset in ("default", "paper"):
        assert set(new(preset).setup.to_record()["options"]) == set(vars(new(preset).options))


@pytest.mark.parametrize("kind", ["lesson", "actuation"])
def test_hidden_states_of_earlier_versions_are_read(kind, remembered):
    """The first version wrote bare lists of lessons, the second one named what states fill; none turned."""
    names, later = ("commands", "squared", "rest", "time"), {"states": [], "settled": False}
    own = Actuation((Actuator(),), (HiddenState((0,), True, None, 0.7),))
    if kind == "lesson":
        lesson = remembered["memory"]["latest"]["lessons"][0]
        record, read = {**lesson, "hidden": own.to_record()["hidden"]}, Lesson.from_record
    else:
        record, read = own.to_record(), Actuation.from_record
    expected = read(record)
    assert expected.hidden == own.hidden
    first = {name: record["hidden"][0][name] for name in names}
    unnamed = [list(first.values())] if kind == "lesson" else [first]
    for version, hidden in ((1, unnamed), (2, [{**first, **later}])):
        assert read({**record, "version": version, "hidden": hidden}).hidden == own.hidden

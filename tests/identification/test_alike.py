"""Of laws that the readings hardly tell apart the one that lasts longest is believed; of others, none is."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from twinloop.identification.alike import HARDLY, longer_lasting
from twinloop.identification.evidence import Evidence

CONTEXT = SimpleNamespace(levels=(), reports=())


@dataclass(frozen=True)
class Law:
    """A hypothesis by the name of its model."""

    name: str
    length: float
    stable: bool = True
    of_part: bool = False
    tuned: bool = True
    searches: int = 1
    offsets: object = None

    @property
    def evidence(self):
        return Evidence(self.tuned, self.stable, False, self.length)

    @property
    def fit(self):
        return SimpleNamespace(model=self.name) if self.tuned else None


def law(name, length, **changes):
    return Law(name, length, offsets=np.zeros(1), **changes)


BEST = law("best", 0.0, searches=7)


def believed(rivals, counts, owed=None):
    asked = []

    def lasting(models):
        asked.append(list(models))
        return [counts[name] for name in models]

    found = longer_lasting(CONTEXT, BEST, rivals, lambda one: (owed or {}).get(one.name, 0.0), lasting)
    # What is drawn from here on is what would be drawn for the best one.
    assert found is None or found.searches == BEST.searches
    return "best" if found is None else found.name, asked


def test_a_rival_that_is_as_likely_and_lasts_longer_is_believed():
    rivals = [law("other", 0.9 * HARDLY), law("wild", 1.0)]
    assert believed(rivals, {"best": 20, "other": 25, "wild": 3})[0] == "other"
    assert believed(rivals, {"best": 25, "other": 25, "wild": 25})[0] == "best"
    # Of two that last as long it is the likelier one.
    assert believed(rivals, {"best": 20, "other": 25, "wild": 25})[0] == "wild"


@pytest.mark.parametrize(
    "rival",
    [
        law("other", 1.1 * HARDLY),
        law("other", -50.0, stable=False),
        law("other", -50.0, tuned=False),
        law("other", 1.0, of_part=True),
    ],
)
def test_no_rival_is_believed_that_is_worse_or_not_worked_out(rival):
    found, asked = believed([rival], {"best": 1, "other": 32})
    assert found == "best" and asked == []


def test_what_a_law_owes_counts():
    rivals = [law("more terms", 1.0), law("known", 40.0)]
    counts = {"best": 1, "more terms": 32, "known": 31}
    assert believed(rivals, counts, {"more terms": 12.0})[0] == "best"
    # Where the best one owes as much, the one known before comes near it.
    assert believed(rivals, counts, {"best": 36.0, "more terms": 48.0})[0] == "known"


def test_models_are_asked_for_with_the_likeliest_first():
    _, asked = believed([law("b", 5.0), law("a", 2.0)], {"best": 9, "a": 9, "b": 9})
    assert asked == [["best", "a", "b"]]

"""Logbooks made of events by hand, and beside them a plain list of what happened to each test."""

from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st

import lives
import twinloop as tl
from twinloop.campaign.history import Experiment, Planned
from twinloop.campaign.logbook import Logbook

SETUPS = {preset: lives.new(preset).setup for preset in ("default", "paper")}
STEPS = SETUPS["default"].steps
RUNS = ("inside", "outside", "cut")
"""Runs to the end inside the envelope, to the end but outside for two readings, and one that was cut."""
EVENTS = (
    *(f"tell {kind}" for kind in RUNS),
    "make",
    "make elsewhere",
    "ask",
    "fail",
    "fail on record",
    "abandon",
    "attach",
)

events = st.lists(
    st.tuples(st.sampled_from(EVENTS), st.integers(0, 7), st.sampled_from([0.5, 1.0, 1.5, 4.0])), max_size=16
)
"""What happens, to which test of those there are, and with which quality."""


@dataclass
class Life:
    """What happened to one test."""

    gains: int
    at_home: bool
    asked: bool
    runs: list = field(default_factory=list)
    failures: int = 0
    on_record: int = 0
    abandoned: bool = False

    @property
    def flown(self):
        return bool(self.runs) or self.failures > 0

    @property
    def qualities(self):
        return [quality for kind, quality in self.runs if kind != "cut"]

    @property
    def kept(self):
        """Of each flight, whether it kept the envelope; a failure without a record is a flight that did not."""
        unrecorded = self.failures - self.on_record
        return [kind == "inside" and not self.failures for kind, _ in self.runs] + [False] * unrecorded

    @property
    def flies(self):
        return self.runs != [] and all(kind == "inside" for kind, _ in self.runs) and not self.failures


def trajectory(kind="inside"):
    """A run of the pendulum that stands still, but for two readings where it is outside."""
    steps = 5 if kind == "cut" else STEPS
    states = np.zeros((steps + 1, 2))
    states[2:4, 1] = 12.5 if kind == "outside" else 0.0
    ended = ("aborted", "somebody stopped it") if kind == "cut" else ("completed", "")
    return tl.Trajectory(lives.SIGNALS.dt * np.arange(steps + 1), states, np.zeros((steps, 1)), *ended)


def run_of(test, kind="inside", quality=1.0):
    """An experiment of a test, with the quality that is wanted."""
    known = None if kind == "cut" else quality
    return Experiment(test, trajectory(kind), None, 1.0, known, known)


def attached():
    run = trajectory()
    replay = tl.Replay(lives.SIGNALS, run.states[0], run.commands)
    return Experiment(replay, run, None, 1.0, None, None, attached=True)


def genes_of(number):
    family = SETUPS["default"].family
    return family.from_unit(np.full(family.size, 0.2 + 0.2 * number))


def planned(test):
    """What `default` writes down of a test that it asks for."""
    return Planned(test.number, tuple(test.genes.tolist()), 1.0, 0.1, 0.05, True, 3.0, 0.2, "it tells most")


def enter(book, life, event, quality):
    """Enters what happened to the test of a life."""
    test = book.tests[life]
    kind = event.partition(" ")[2]
    if event.startswith("tell"):
        book.enter(run_of(test, kind, quality))
    elif event.startswith("fail"):
        book.fail(test, "the motor cut out", trajectory("cut") if kind else None, lambda alone: None)
    elif event == "abandon":
        book.abandon(test)
    elif event == "attach":
        book.enter(attached())


def happened(life, event, quality):
    """The same for the plain list."""
    if event.startswith("tell"):
        life.runs.append((event.partition(" ")[2], quality))
    elif event.startswith("fail"):
        life.failures += 1
        life.runs += [("cut", None)] if event == "fail on record" else []
        life.on_record += event == "fail on record"
    elif event == "abandon":
        life.abandoned = True


def written(wanted, preset="default"):
    """A logbook, the lives of its tests, and the number of the test of each run, None for an attached one."""
    book, known, order = Logbook(SETUPS[preset]), [], []
    for event, which, quality in wanted:
        if event in ("make", "make elsewhere", "ask") or not known:
            away = event == "make elsewhere"
            test = book.new_test(genes_of(which % 3), initial_state=np.array([0.1, 0.0]) if away else None)
            known.append(Life(which % 3, not away, event == "ask"))
            if event == "ask":
                book.asked.append((1 + len(book.asked) // 2, planned(test)))
            continue
        number = which % len(known)
        if event == "abandon" and known[number].flown:
            continue
        enter(book, number, event, quality)
        happened(known[number], event, quality)
        if event.startswith("tell") or event in ("fail on record", "attach"):
            order.append(None if event == "attach" else number)
    return book, known, order

"""Progress: how much time is left, and what a person is shown meanwhile."""

import io

import pytest
from rich.console import Console

from twinloop._ground.steps import STEPS
from twinloop.campaign.history import Progress
from twinloop.campaign.presets import options_of
from twinloop.campaign.remaining import USUAL, StepEstimate
from twinloop.faces.console import Watch


def progress(phase, told, tests=(), errors=()):
    number = list(STEPS).index(phase) + 1 if phase in STEPS else 0
    return Progress(phase, told, number, len(STEPS), told, tests, (), errors, 8, 0)


def flown(experiments):
    """All that a campaign reports, in order."""
    for told in range(experiments + 1):
        for step in STEPS if told else ():
            if not (told == experiments and step == "candidates"):
                yield progress(step, told)
        if told < experiments:
            yield progress("experiment", told)


def test_every_step_of_the_preset_has_words_and_a_share():
    assert tuple(USUAL) == STEPS


def test_the_time_left_of_default_is_right_where_steps_take_their_usual_share(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("twinloop.campaign.remaining.time.monotonic", lambda: clock[0])
    estimate = StepEstimate(experiments=3)
    whole = sum(USUAL[p.phase][1] * (1 + p.experiments) for p in flown(3) if p.phase in STEPS)
    told = []
    for now in flown(3):
        left = estimate.remaining(now)
        if left is not None:
            told.append((clock[0], left))
        clock[0] += USUAL[now.phase][1] * (1 + now.experiments) if now.phase in STEPS else 0.0
    assert len(told) > 20
    for moment, left in told:
        assert moment + left == pytest.approx(whole)


def test_steps_that_were_passed_over_are_expected_no_more(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("twinloop.faces.console.time.monotonic", lambda: clock[0])
    estimate, seen = StepEstimate(experiments=2), ("noise", "terms")
    for step in seen:
        estimate.remaining(progress(step, 1))
        clock[0] += 2.0 * USUAL[step][1]
    left = estimate.remaining(progress("candidates", 1))
    steps = [*seen, "candidates"]
    assert left == pytest.approx(2.0 * USUAL["candidates"][1] + 3.0 * sum(USUAL[s][1] for s in steps[:-1]))


def test_nothing_is_said_of_the_time_left_before_anything_is_known():
    assert StepEstimate(experiments=2).remaining(progress("experiment", 0)) is None


def test_a_slow_step_never_makes_the_time_left_negative(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr("twinloop.campaign.remaining.time.monotonic", lambda: clock[0])
    estimate = StepEstimate(experiments=1)
    estimate.remaining(progress("noise", 1))
    clock[0] = 0.1
    estimate.remaining(progress("actuators", 1))
    clock[0] = 1000.0
    assert estimate.remaining(progress("actuators", 1)) >= 0.0


def test_the_table_on_a_terminal_names_the_step_and_the_errors():
    watch = Watch(options_of("default"), 4, "quadrotor")
    watch(progress("terms", 2, (0, 1), (1.5e-5, 2e-5)))
    screen = Console(file=io.StringIO(), width=120)
    screen.print(watch._now())
    shown = screen.file.getvalue()
    for words in (
        "quadrotor",
        "2 of 4",
        f"{STEPS.index('terms') + 1} of {len(STEPS)}, selecting terms",
        "closed loop",
        "2e-05",
    ):
        assert words in shown

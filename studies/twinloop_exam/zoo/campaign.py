"""One campaign on one plant, preset and options as they come, measured after each flight."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from twinloop.campaign import Campaign, controller_to_fly
from twinloop.campaign.assessment import disturbances
from twinloop.campaign.history import Lesson
from twinloop.errors import RemarkWarning, SystemFailure, TwinloopError
from twinloop.records import plain
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam.ablations import ablation
from twinloop_exam.measures import violated
from twinloop_exam.version import version
from twinloop_exam.zoo import honesty
from twinloop_exam.zoo.held_out import COUNT, HeldOut, held_out, repeats
from twinloop_exam.zoo.honesty import Flight
from twinloop_exam.zoo.optima import best_quality, under_noise
from twinloop_exam.zoo.plant import Plant, true_states
from twinloop_exam.zoo.plants import plant as plant_named

Measured = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One campaign.

    Args:
        plant: its name.
        seed: of the campaign and of the sensors.
        flights: in all, the first included.
        options: of the preset, other than its own; for smoke runs, and of the idea that is switched off.
        held_out: controllers that twins are judged on.
        without: name of the ablation; nothing: the whole preset.
    """

    plant: str
    seed: int
    flights: int = 5
    options: tuple[tuple[str, object], ...] = ()
    held_out: int = COUNT
    without: str = ""

    @property
    def name(self) -> str:
        """What tells it from the others."""
        return f"{self.plant}, seed {self.seed}" + (f", without {self.without}" if self.without else "")

    @property
    def asked(self) -> dict[str, Any]:
        """Its options by name, in plain types."""
        return {name: plain(value) for name, value in self.options}

    def ablated(self, name: str) -> Job:
        """The same with one idea switched off.

        Args:
            name: of the ablation.

        Raises:
            InvalidInput: an unknown name.
        """
        options = {**dict(self.options), **ablation(name).options}
        return replace(self, options=tuple(options.items()), without=name)


def fly(job: Job) -> Measured:
    """Flies a campaign and measures it.

    Args:
        job: which.

    Returns:
        A plain dictionary: what `Job` says, the optimum, one dictionary a flight, and "failure" where it ended early.
    """
    plant = plant_named(job.plant)
    found: Measured = {
        "plant": job.plant,
        "seed": job.seed,
        "flights_asked": job.flights,
        "without": job.without,
        "options": job.asked,
        "version": version(),
        "optimum": best_quality(plant),
        "optimum_under_noise": best_quality(plant, noisy=True),
        "flights": [],
        "failure": None,
    }
    clock = time.process_time()
    with warnings.catch_warnings():
        # What is remarked stands in the rows.
        warnings.simplefilter("ignore", RemarkWarning)
        try:
            _fly(job, plant, found)
        except TwinloopError as failure:
            found["failure"] = str(failure)
    found["cpu_seconds"] = time.process_time() - clock
    return found


def _fly(job: Job, plant: Plant, found: Measured) -> None:
    system, asked, judge = plant.make(job.seed), plant.asked, _judge(job.plant, job.held_out)
    found["held_out"] = [len(judge.tests), judge.tried]
    campaign = Campaign(
        system.signals,
        controller=asked.controller,
        initial_state=asked.start,
        target_state=asked.target,
        duration=asked.duration,
        weights=dict(asked.weights) or None,
        seed=job.seed,
        options=dict(job.options) or None,
        threads=1,
        progress=None,
    )
    flown: list[Flight] = []
    repeated: list[Flight] = []
    test = campaign.test(asked.first)
    for number in range(job.flights):
        row, flight = _flown(plant, system, campaign, test)
        if flight is not None:
            flown.append((test, flight))
            if repeats(plant, test, true_states(plant.truth.run(test))):
                repeated.append((test, flight))
        clock = time.process_time()
        last = number == job.flights - 1
        # What is learnt of the last flight, and the test that would come next, cost what any other `ask` does.
        following = None if last else campaign.ask(last=number == job.flights - 2)
        twin = campaign.twin
        if not last:
            row["ask_seconds"] = time.process_time() - clock
        row |= _known(plant, campaign, judge, flown, repeated)
        found["flights"].append(row)
        if following is not None:
            test = following
    found["confident"] = honesty.confident(campaign)
    found["equations"] = twin.equations(4)


@cache
def _judge(name: str, count: int) -> HeldOut:
    """Flown once a process: it is the same for all campaigns on a plant."""
    return held_out(plant_named(name), count)


def _flown(plant: Plant, system: Any, campaign: Campaign, test: Test) -> tuple[Measured, Trajectory | None]:
    """Flies a test and tells it."""
    row: Measured = {"predicted": test.predicted, "spread": test.spread, "reason": test.reason}
    try:
        flight = system.run(test)
    except SystemFailure as failure:
        campaign.tell_failed(test, str(failure))
        return {**row, "ended": "failed", "left": True, "flown": None, "measured": None}, None
    campaign.tell(test, flight)
    measured = campaign.experiments[-1].quality
    row |= {
        "ended": flight.ended,
        "left": violated(flight, system.signals),
        "flown": plant.judged(flight, test),
        "gains_quality": plant.true_quality(test.genes),
        "gains_in_noise": under_noise(plant, test.genes),
        "gains": test.parameters,
        "measured": measured,
    }
    return _plain(row), flight


def _known(
    plant: Plant, campaign: Campaign, judge: HeldOut, flown: list[Flight], repeated: list[Flight]
) -> Measured:
    """What is measured of the twin and the controller to fly."""
    twin = campaign.twin
    lesson = [record for record in campaign.history if isinstance(record, Lesson)][-1]
    accuracy = judge.judged(twin)
    best = controller_to_fly(campaign)[0]
    structures, felt = honesty.found(twin, lesson), disturbances(twin, lesson)
    return _plain(
        {
            "best_test": None if best is None else plant.true_quality(best.genes),
            "best_test_in_noise": None if best is None else under_noise(plant, best.genes),
            **accuracy._asdict(),
            "found": structures,
            "false": [name for name in structures if name not in plant.has],
            "lags": list(lesson.lags),
            "delays": list(lesson.delays),
            "rates": list(lesson.rates),
            "offsets": list(lesson.offsets),
            "hidden": [list(each) for each in lesson.hidden],
            "sensors": list(lesson.sensors),
            "disturbances": [
                [each.name, each.white, each.correlated, each.correlation_time] for each in felt
            ],
            "empty": honesty.empty_equations(twin, flown),
            "missed": honesty.misses(plant, twin, flown),
            "missed_repeated": honesty.misses(plant, twin, repeated),
            "serious": sorted({one.code for one in (*lesson.remarks, *twin.remarks) if one.serious}),
            "noted": sorted({one.code for one in (*lesson.remarks, *twin.remarks) if not one.serious}),
            "follows": lesson.follows,
            "misfit": lesson.misfit,
            "form": lesson.form,
            "terms": lesson.terms,
        }
    )


def _plain(row: Measured) -> Measured:
    """With null for what is not finite, which JSON does not have; "inf" where a large number means something."""
    plain: Measured = {}
    for name, value in row.items():
        if isinstance(value, float | np.floating) and not np.isfinite(value):
            plain[name] = "inf" if value > 0.0 else None
        else:
            plain[name] = float(value) if isinstance(value, np.floating) else value
    return plain

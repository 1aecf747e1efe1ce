"""One campaign of the exam: flown experiment by experiment, measured after each."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from twinloop._ground.streams import Unit
from twinloop.campaign import Campaign, controller_to_fly
from twinloop.law.flight import fly
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop_exam import quality
from twinloop_exam.held_out import HeldOut
from twinloop_exam.kinds import Campaigner
from twinloop_exam.measures import QUANTILES, coverage, number_of_terms, quantiles, violated
from twinloop_exam.systems import Draw, Subject

Measured = tuple[int, dict[str, float | None], Trajectory | None, float]
"""k, measures by name, the k-th flight, seconds since the one before."""


def campaign(
    who: Campaigner, subject: Subject, held_out: HeldOut, seed: int, experiments: int, threads: int | None
) -> Iterator[Measured]:
    """Flies a campaign.

    Args:
        who: the learner.
        subject: the system.
        held_out: what its twin is judged on.
        seed: of the system and the campaign.
        experiments: after Υ0.
        threads: of the engine; None: all that there are. No number but the seconds depends on it.

    Yields:
        What was measured after each experiment, Υ0 first. `ask_seconds` is what the `ask` that followed the
        experiment took of processors, learning included, so that nothing else on the machine counts; after the
        last one there is `learn_seconds` instead.
    """
    clock, rig = time.monotonic(), subject.rig(seed)
    arguments = dict(who.arguments)
    if who.preset != "paper":  # which knows one quality only, and refuses the argument
        arguments = {"quality": subject.quality, **arguments}
    loop = Campaign(
        rig.signals,
        controller=rig.controller,
        initial_state=rig.initial_state,
        target_state=rig.target_state,
        duration=rig.duration,
        preset=who.preset,
        seed=seed,
        options=who.options,
        threads=threads,
        progress=None,
        **arguments,  # type: ignore[arg-type]
    )
    predicts = "final_distance" if who.preset == "paper" else subject.quality
    test, twin = loop.test(rig.default_gains), None
    for k in range(experiments + 1):
        flight = rig.run(test)
        measures = of_flight(subject, test, flight)
        if k:
            measures |= _foretold(predicts, twin, test, flight)
        loop.tell(test, flight)
        started = time.process_time()
        following = loop.ask() if k < experiments else None
        twin = loop.twin
        measures["ask_seconds" if following is not None else "learn_seconds"] = time.process_time() - started
        measures |= of_twin(twin, held_out) | of_controller(subject, controller_to_fly(loop)[0])
        yield k, measures, flight, time.monotonic() - clock
        clock = time.monotonic()
        test = test if following is None else following


def random_gains(subject: Subject, seed: int, experiments: int) -> Iterator[Measured]:
    """Flies Υ0, then gains uniform in their box.

    Args:
        subject: the system.
        seed: of the system and the gains.
        experiments: after Υ0.

    Yields:
        What was measured of each flight.
    """
    rig = subject.rig(seed)
    draw = Unit(seed).part(Draw.RANDOM_GAINS).stream("exam")
    for k in range(experiments + 1):
        clock = time.monotonic()
        genes = subject.family.genes(rig.default_gains)
        if k:
            genes = subject.family.from_unit(draw.uniforms(subject.family.size))
        test = subject.test(genes)
        flight = rig.run(test)
        yield k, of_flight(subject, test, flight), flight, time.monotonic() - clock


def of_twin(twin: Twin, held_out: HeldOut) -> dict[str, float | None]:
    """Held-out errors and size of a twin.

    Args:
        twin: to be judged.
        held_out: controllers and true runs.

    Returns:
        Measures by name.
    """
    # Without the committee's band, which `twin.simulate` would draw for each of the controllers.
    errors = held_out.errors(lambda test: fly(twin.model, test, limits=twin.limits))
    return {
        **dict(zip(QUANTILES, quantiles(errors, list(QUANTILES.values())), strict=True)),
        "diverged": float(np.isinf(errors).sum()),
        "terms": float(number_of_terms(twin.model.program)),
    }


def of_controller(subject: Subject, best: Test | None) -> dict[str, float | None]:
    """True quality of the controller to fly.

    Args:
        subject: the system.
        best: test with the controller's gains; None where there is no controller to fly.

    Returns:
        Measures by name.
    """
    return {"quality": None if best is None else subject.judged(subject.test(best.genes, best.family))}


def of_flight(subject: Subject, test: Test, flight: Trajectory) -> dict[str, float | None]:
    """True quality and safety of one experiment.

    Args:
        subject: the system.
        test: that was flown.
        flight: what happened.

    Returns:
        Measures by name.
    """
    return {
        "flown_quality": quality.of_states(subject.quality, quality.true_states(flight), test),
        "violated": float(violated(flight, subject.signals)),
    }


def _foretold(predicts: str, twin: Twin | None, test: Test, flight: Trajectory) -> dict[str, float | None]:
    """What was said of an experiment before it was flown, against what was measured."""
    found: dict[str, float | None] = {}
    predicted = test.predicted
    if predicted is not None and np.isfinite(predicted):
        measured = quality.of_states(predicts, flight.states, test)
        found |= {"predicted": predicted, "measured": measured, "predicted_minus_flown": predicted - measured}
    if twin is not None:
        band = twin.simulate(test).band
        if band is not None:
            found["coverage"] = coverage(np.asarray(band), flight.states)
    return found

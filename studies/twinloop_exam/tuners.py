"""Optimisers of gains on the system itself: no twin, one flight an evaluation."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop_exam import quality
from twinloop_exam.campaigns import Measured, of_flight
from twinloop_exam.kinds import Optimum, Tuner
from twinloop_exam.systems import Draw, Subject

Evaluate = Callable[[Floats], float]
"""Quality of gains given in the unit cube (size,), to be minimised."""


class _OutOfFlightsError(Exception):
    """Ends an optimiser that would go on for ever."""


def tune(who: Tuner, subject: Subject, seed: int, flights: int) -> list[Measured]:
    """Optimises gains, the first controller first.

    Args:
        who: the optimiser.
        subject: the system.
        seed: of the system and the optimiser.
        flights: on the system in all.

    Returns:
        After each flight, k from 0: the true quality of the best controller measured so far.
    """
    rig, family = subject.rig(seed), subject.family
    first = family.genes(rig.default_gains)
    found: list[Measured] = []
    best: list[Any] = [np.inf, 0.0]  # as measured, and its true quality
    clock = [time.monotonic()]

    def fly(units: Floats) -> float:
        if len(found) == flights:
            raise _OutOfFlightsError
        genes = first if not found else family.from_unit(units)
        test = subject.test(genes)
        flight = rig.run(test)
        value = quality.of_states(subject.quality, flight.states, test)
        if value < best[0]:
            best[:] = [value, subject.true_quality(genes)]
        now = time.monotonic()
        measures = {"quality": float(best[1]), **of_flight(subject, test, flight)}
        found.append((len(found), measures, None, now - clock[0]))
        clock[0] = now
        return value

    start = family.to_unit(first)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Gaussian processes with few points, and experimental features
        with suppress(_OutOfFlightsError):
            METHODS[who.method](fly, start, who.settings, seed, flights)
    return found


def optimum(who: Optimum, subject: Subject) -> Iterator[Measured]:
    """The best controller that CMA-ES finds on the true system, from several starts.

    Args:
        who: how long it searches.
        subject: the system.

    Yields:
        One result: its quality, as every controller is judged.
    """
    clock = time.monotonic()
    family = subject.family
    draws = who.draws if subject.judged_runs else 0
    flights = who.patient.get(subject.name, who.flights)

    def evaluate(units: Floats) -> float:
        return subject.true_quality(family.from_unit(units), runs=draws, seed=1)

    draw = Unit(seed=20).part(Draw.OPTIMUM).stream("exam")
    first = family.to_unit(family.genes(subject.true_rig.default_gains))
    bests = []
    for number in range(who.starts):
        best: list[Any] = [np.inf, first]
        used = [0]

        def fly(units: Floats, best: list[Any] = best, used: list[int] = used) -> float:
            if used[0] == flights:
                raise _OutOfFlightsError
            used[0] += 1
            value = evaluate(units)
            if value < best[0]:
                best[:] = [value, np.array(units)]
            return value

        start = first if number == 0 else draw.uniforms(family.size)
        with suppress(_OutOfFlightsError):
            cma_es(fly, start, {"step": 0.2}, number, flights)
        bests.append((best[0], best[1]))
    winner = min(bests, key=lambda pair: float(pair[0]))
    measures: dict[str, float | None] = {
        "quality": subject.true_quality(family.from_unit(winner[1])),
        "worst_start": max(float(value) for value, _ in bests),
        "best_start": float(winner[0]),
    }
    yield 0, measures, None, time.monotonic() - clock


def gaussian_process(
    evaluate: Evaluate, start: Floats, settings: Mapping[str, object], seed: int, flights: int
) -> None:
    """Bayesian optimisation with a Gaussian process, by `bayesian-optimization`.

    It is MIT, kept up, needs scikit-learn and scipy alone, and has ask and tell; BoTorch would bring PyTorch.

    Args:
        evaluate: one flight.
        start: of the first, in the unit cube.
        settings: "acquisition" ("ei" or "ucb"), "random" (flights before the process is asked).
        seed: of the optimiser.
        flights: in all.
    """
    from bayes_opt import BayesianOptimization, acquisition

    names = [f"g{i:03d}" for i in range(len(start))]
    rule = (
        acquisition.ExpectedImprovement(xi=0.0)
        if settings["acquisition"] == "ei"
        else acquisition.UpperConfidenceBound(kappa=2.0)
    )
    optimiser = BayesianOptimization(
        f=None,
        pbounds={name: (0.0, 1.0) for name in names},
        acquisition_function=rule,
        random_state=seed,
        verbose=0,
        allow_duplicate_points=True,
    )
    draw = Unit(seed).part(Draw.GAUSSIAN_PROCESS).stream("exam")
    for number in range(flights):
        if number == 0:
            units = start
        elif number <= int(str(settings["random"])):
            units = draw.uniforms(len(start))
        else:
            suggested = optimiser.suggest()
            units = np.array([float(suggested[name]) for name in names])
        value = evaluate(units)
        optimiser.register(params=dict(zip(names, units.tolist(), strict=True)), target=-value)


def cma_es(
    evaluate: Evaluate, start: Floats, settings: Mapping[str, object], seed: int, flights: int
) -> None:
    """CMA-ES, by `cmaes`.

    Args:
        evaluate: one flight.
        start: mean of the first generation, in the unit cube; it is also the first flight.
        settings: "step" (first standard deviation, in ranges of a gain).
        seed: of the optimiser.
        flights: in all.
    """
    import cmaes

    bounds = np.tile([0.0, 1.0], (len(start), 1))
    optimiser = cmaes.CMA(
        mean=np.clip(start, 0.01, 0.99), sigma=float(str(settings["step"])), bounds=bounds, seed=seed + 1
    )
    evaluate(start)
    for _ in range(flights):  # generations; the flights are counted elsewhere
        asked = [optimiser.ask() for _ in range(optimiser.population_size)]
        optimiser.tell([(units, evaluate(units)) for units in asked])


def tree_parzen(
    evaluate: Evaluate, start: Floats, settings: Mapping[str, object], seed: int, flights: int
) -> None:
    """The tree-structured Parzen estimator, by Optuna.

    Args:
        evaluate: one flight.
        start: of the first, in the unit cube.
        settings: "random" (flights before the estimator is asked).
        seed: of the optimiser.
        flights: in all.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    names = [f"g{i:03d}" for i in range(len(start))]
    sampler = optuna.samplers.TPESampler(
        seed=seed, n_startup_trials=int(str(settings["random"])), multivariate=True
    )
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial(dict(zip(names, start.tolist(), strict=True)))
    for _ in range(flights):
        trial = study.ask()
        units = np.array([trial.suggest_float(name, 0.0, 1.0) for name in names])
        study.tell(trial, evaluate(units))


METHODS: dict[str, Callable[[Evaluate, Floats, Mapping[str, object], int, int], None]] = {
    "gaussian_process": gaussian_process,
    "cma_es": cma_es,
    "tree_parzen": tree_parzen,
}
"""Optimisers by name."""

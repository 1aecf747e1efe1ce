"""The best controllers that CMA-ES finds on the plants without noise: kept in a file, made by `bench zoo --optima`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.errors import NotAvailable
from twinloop_exam.zoo.plant import Plant

FILE = Path(__file__).with_name("optima.json")
STARTS = 4
FROM_FIRST = 2
"""Starts from the first controller; the others are random, of which few are alive where a plant is unstable."""
FLIGHTS = 300
"""Of each start."""
STEP, POLISH = 0.2, 0.05
"""First standard deviations of a start, and of a round that goes on from the best, in ranges of a gain."""
ROUNDS, LEAST = 8, 1e-3
"""At most so many rounds; none after one that gained a smaller share than this."""
NOISY, NOISE_SEED = 20, 987_654
"""Flights over which noise is averaged; its seed is far from those of campaigns."""
DRAW = 11
"""Tells the stream of the random starts from others of the exam."""


class _OutOfFlightsError(Exception):
    """Ends an optimiser that has used its flights."""


def optimum(plant: Plant, flights: int = FLIGHTS, starts: int = STARTS) -> dict[str, Any]:
    """Searches from the first controller and from random ones, then goes on from the best for as long as that pays.

    Args:
        plant: to be flown without noise.
        flights: of each start.
        starts: how many.

    Returns:
        "quality" of the best, of the "first" controller, and of the best of each start ("starts"), with the best
        "gains" by name, their quality "under_noise", and the number of "flights" of each.
    """
    family = plant.family
    draw = Unit(0).part(DRAW).stream("exam")
    first = family.genes(plant.asked.first)
    begun = [
        family.to_unit(first) if number < FROM_FIRST else draw.uniforms(family.size)
        for number in range(starts)
    ]
    found = [_searched(plant, start, STEP, number, flights) for number, start in enumerate(begun)]
    best = min(found, key=lambda pair: pair[0])
    for number in range(ROUNDS):
        better = _searched(plant, best[1], POLISH, starts + number, flights)
        gained = (best[0] - better[0]) / best[0]
        best = min(best, better, key=lambda pair: pair[0])
        if gained < LEAST:
            break
    return {
        "quality": best[0],
        "first": plant.true_quality(first),
        "starts": [value for value, _ in found],
        "gains": family.parameters(family.from_unit(best[1])),
        "flights": flights,
        "under_noise": under_noise(plant, family.from_unit(best[1])),
    }


def under_noise(plant: Plant, gains: Floats) -> float:
    """Mean quality on true states of gains (size,) that are flown as a learner flies, without excitation."""
    system, test = plant.make(NOISE_SEED), plant.test(gains)
    return float(np.mean([plant.judged(system.run(test), test) for _ in range(NOISY)]))


def _searched(plant: Plant, start: Floats, step: float, seed: int, flights: int) -> tuple[float, Floats]:
    """The best of one run of CMA-ES: its quality, and its gains in the unit cube."""
    from twinloop_exam.tuners import cma_es

    flown: list[tuple[float, Floats]] = []

    def fly(units: Floats) -> float:
        if len(flown) == flights:
            raise _OutOfFlightsError
        flown.append((plant.true_quality(plant.family.from_unit(units)), units.copy()))
        return flown[-1][0]

    with suppress(_OutOfFlightsError):
        cma_es(fly, start, {"step": step}, seed, flights)
    return min(flown, key=lambda pair: pair[0])


def kept(path: Path = FILE) -> dict[str, Any]:
    """What the file holds, by the plants' names; nothing where there is none."""
    return dict(json.loads(path.read_text("utf-8"))) if path.exists() else {}


def keep(found: Mapping[str, Any], path: Path = FILE) -> None:
    """Writes optima beside those that are there."""
    together = {**kept(path), **found}
    text = json.dumps({name: together[name] for name in sorted(together)}, indent=1)
    path.write_text(text + "\n", "utf-8")


def best_quality(plant: Plant, noisy: bool = False) -> float:
    """Of the best controller that is known.

    Args:
        plant: whose.
        noisy: on true states under the noise of its sensors and its disturbances, rather than without.

    Raises:
        NotAvailable: it was not searched yet.
    """
    found = kept()
    if plant.name not in found:
        raise NotAvailable(
            f"Optimum of {plant.name}: expected it in {FILE.name}, found none; search it with"
            f" `twinloop bench zoo --optima --plants {plant.name}`."
        )
    return float(found[plant.name]["under_noise" if noisy else "quality"])

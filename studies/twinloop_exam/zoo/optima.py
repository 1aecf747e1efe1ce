"""The best controllers that CMA-ES finds on the plants without noise: kept in a file, made by `bench zoo --optima`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from twinloop.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.streams import Unit
from twinloop_exam.zoo.plant import Plant

FILE = Path(__file__).with_name("optima.json")
STARTS = 4
FLIGHTS = 300
"""Of each start."""
STEP = 0.2
"""First standard deviation, in ranges of a gain."""
DRAW = 11
"""Tells the stream of the random starts from others of the exam."""


class _OutOfFlightsError(Exception):
    """Ends an optimiser that has used its flights."""


def optimum(plant: Plant, flights: int = FLIGHTS, starts: int = STARTS) -> dict[str, Any]:
    """Searches from the first controller, then from random ones.

    Args:
        plant: to be flown without noise.
        flights: of each start.
        starts: how many.

    Returns:
        "quality" of the best, of the "first" controller, and of the best of each start ("starts"), with the best
        "gains" by name and the number of "flights" of each.
    """
    from twinloop_exam.tuners import cma_es

    family = plant.family
    draw = Unit(0).part(DRAW).stream("exam")
    found: list[tuple[float, Floats]] = []
    first = family.genes(plant.asked.first)
    for number in range(starts):
        flown: list[tuple[float, Floats]] = []

        def fly(units: Floats, flown: list[tuple[float, Floats]] = flown) -> float:
            if len(flown) == flights:
                raise _OutOfFlightsError
            flown.append((plant.true_quality(family.from_unit(units)), units.copy()))
            return flown[-1][0]

        start = family.to_unit(first) if number == 0 else draw.uniforms(family.size)
        with suppress(_OutOfFlightsError):
            cma_es(fly, start, {"step": STEP}, number, flights)
        found.append(min(flown, key=lambda pair: pair[0]))
    best = min(found, key=lambda pair: pair[0])
    return {
        "quality": best[0],
        "first": plant.true_quality(first),
        "starts": [value for value, _ in found],
        "gains": family.parameters(family.from_unit(best[1])),
        "flights": flights,
    }


def kept(path: Path = FILE) -> dict[str, Any]:
    """What the file holds, by the plants' names; nothing where there is none."""
    return dict(json.loads(path.read_text("utf-8"))) if path.exists() else {}


def keep(found: Mapping[str, Any], path: Path = FILE) -> None:
    """Writes optima beside those that are there."""
    together = {**kept(path), **found}
    text = json.dumps({name: together[name] for name in sorted(together)}, indent=1)
    path.write_text(text + "\n", "utf-8")


def best_quality(plant: Plant) -> float:
    """Of the best controller that is known.

    Args:
        plant: whose.

    Raises:
        NotAvailable: it was not searched yet.
    """
    found = kept()
    if plant.name not in found:
        raise NotAvailable(
            f"Optimum of {plant.name}: expected it in {FILE.name}, found none; search it with"
            f" `twinloop bench zoo --optima --plants {plant.name}`."
        )
    return float(found[plant.name]["quality"])

"""What was measured: one JSON file a campaign, in a folder; a campaign that is there is not flown again."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from twinloop.errors import InvalidInput
from twinloop_exam.zoo.campaign import Job, Measured
from twinloop_exam.zoo.optima import best_quality
from twinloop_exam.zoo.plants import plant


def path_of(job: Job, folder: Path) -> Path:
    """Where a campaign is kept."""
    without = f"-without-{job.without}" if job.without else ""
    return folder / f"{job.plant}-{job.seed}-{job.flights}{without}.json"


def keep(job: Job, measured: Measured, folder: Path) -> None:
    """Writes a campaign; whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    path = path_of(job, folder)
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(measured, indent=1) + "\n", "utf-8")
    os.replace(unfinished, path)


def _which(found: Measured) -> tuple[Any, ...]:
    """What tells a campaign from others; a file of before ablations is of the whole preset."""
    return found.get("plant"), found.get("seed"), found.get("without", ""), found.get("options", {})


def kept(jobs: Iterable[Job], folder: Path) -> dict[Job, Measured]:
    """The campaigns that a folder holds.

    Args:
        jobs: that are looked for.
        folder: where.

    Returns:
        What was measured, by job.

    Raises:
        InvalidInput: a file that is something else.
    """
    there: dict[Job, Measured] = {}
    for job in jobs:
        path = path_of(job, folder)
        if not path.exists():
            continue
        try:
            found = json.loads(path.read_text("utf-8"))
        except ValueError as reason:
            raise InvalidInput(
                f"{path}: expected a campaign as JSON, found: {reason}; remove the file."
            ) from reason
        if not isinstance(found, dict) or _which(found) != (job.plant, job.seed, job.without, job.asked):
            raise InvalidInput(
                f"{path}: expected the campaign {job.name}, found another one, or other options; remove the file."
            )
        of = plant(job.plant)
        # A better controller may have been found since it was flown.
        found |= {"optimum": best_quality(of), "optimum_under_noise": best_quality(of, noisy=True)}
        there[job] = found
    return there

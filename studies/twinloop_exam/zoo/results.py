"""What was measured: one JSON file a campaign, in a folder; a campaign that is there is not flown again."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from twinloop.errors import InvalidInput
from twinloop_exam.zoo.campaign import Job, Measured
from twinloop_exam.zoo.optima import best_quality
from twinloop_exam.zoo.plants import plant


def path_of(job: Job, folder: Path) -> Path:
    """Where a campaign is kept."""
    return folder / f"{job.plant}-{job.seed}-{job.flights}.json"


def keep(job: Job, measured: Measured, folder: Path) -> None:
    """Writes a campaign; whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    path = path_of(job, folder)
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(measured, indent=1) + "\n", "utf-8")
    os.replace(unfinished, path)


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
        if not isinstance(found, dict) or (found.get("plant"), found.get("seed")) != (job.plant, job.seed):
            raise InvalidInput(
                f"{path}: expected the campaign {job.name}, found another one; remove the file."
            )
        of = plant(job.plant)
        # A better controller may have been found since it was flown.
        found |= {"optimum": best_quality(of), "optimum_under_noise": best_quality(of, noisy=True)}
        there[job] = found
    return there

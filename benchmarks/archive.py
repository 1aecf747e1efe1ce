"""Archive: points that none dominates, offered in batches, beside a filter of all after each batch."""

import moocore
import numpy as np

from measure import Disagreement, Line, Section, interleaved, ratio
from twinloop import _core

COLUMNS, BATCH = 8, 250
OURS, MOOCORE = "twinloop, Archive.offer", "moocore, filter after each batch"


def report(smoke: bool) -> Section:
    offers = 1000 if smoke else 10_000
    section = Section(
        f"Archive: {offers} offers of {COLUMNS} objectives in batches of {BATCH}, none dominated"
    )
    points = np.random.default_rng(3).dirichlet(np.ones(COLUMNS), size=offers)
    batches = np.split(points, offers // BATCH)
    contestants = {OURS: lambda: _offered(batches), MOOCORE: lambda: _refiltered(batches)}
    sizes = {name: contestant() for name, contestant in contestants.items()}
    if set(sizes.values()) != {offers}:
        raise Disagreement(f"archive: expected {offers} members, found {sizes}.")
    times = interleaved(contestants, 2 if smoke else 9)
    for name in contestants:
        against = ratio(times, name, OURS) if name != OURS else None
        section.lines.append(Line("all offers", name, float(np.median(times[name])) * 1e3, "ms", against))
    return section


def _offered(batches: list[np.ndarray]) -> int:
    archive = _core.Archive(COLUMNS)
    for batch in batches:
        archive.offer(batch)
    return len(archive)


def _refiltered(batches: list[np.ndarray]) -> int:
    kept = np.empty((0, COLUMNS))
    for batch in batches:
        kept = moocore.filter_dominated(np.vstack([kept, batch]))
    return len(kept)

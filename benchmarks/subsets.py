"""Search over subsets: annealing by inner products and updated inverses, beside NumPy that solves each subset anew."""

import numpy as np

from measure import Disagreement, Line, Section, check_agreement, interleaved, ratio
from twinloop import _core
from twinloop._ground.streams import Unit

DT, STEPS, SIGNALS, LARGEST, COLDEST = 0.02, 400, 9, 16, 2.0
PRICE = 12.0
OURS, NUMPY = "twinloop", "NumPy, solved anew"


def library(rng: np.random.Generator) -> tuple[_core.Gram, np.ndarray]:
    """Products of smooth signals, three of which drive a state, as inner products: ours, and those of a plain array."""
    time = DT * np.arange(STEPS)
    waves = rng.uniform(0.5, 4.0, SIGNALS), rng.uniform(0.0, 6.0, SIGNALS)
    signals = np.sin(waves[0] * time[:, None] + waves[1])
    pairs = [signals[:, i] * signals[:, j] for i in range(SIGNALS) for j in range(i + 1)]
    features = np.ascontiguousarray(np.stack([*signals.T, *pairs], axis=1))
    increments = features @ _truth(features.shape[1]) + 0.05 * rng.normal(size=STEPS)
    readings = np.concatenate([[0.0], np.cumsum(increments)])[:, None]
    record = (readings, np.ones_like(readings), features, features, features)
    # What disturbs a period is all the noise there is: whitening is then the difference of neighbours.
    gram = _core.Regression(1, DT, "increment", [record]).gram([1e-12], (0.05**2, 0.0, 1.0))
    columns = np.concatenate([features, np.diff(readings, axis=0)], axis=1) / 0.05
    return gram, columns.T @ columns


def _truth(features: int) -> np.ndarray:
    truth = np.zeros(features)
    truth[[2, 11, 30]] = 0.8, -1.1, 0.6
    return truth


def annealed(products: np.ndarray, moves: int, seed: int) -> tuple[list[int], float]:
    """The best subset that a walk as ours comes across, each of them by `numpy.linalg.solve`, and its energy."""
    rng, features = np.random.default_rng(seed), len(products) - 1
    total = products[-1, -1]

    def energy(subset: list[int]) -> float:
        if not subset:
            return float(total)
        matrix, right = products[np.ix_(subset, subset)], products[subset, -1]
        return float(total - right @ np.linalg.solve(matrix, right) + PRICE * len(subset))

    here: list[int] = []
    now = energy(here)
    best, least = here, now
    hottest = max(0.02 * total, 100.0 * COLDEST)
    cooled = moves - moves // 10
    for n in range(moves):
        heat = hottest * (COLDEST / hottest) ** (n / cooled) if n < cooled else 0.0
        kind, there = rng.integers(3), list(here)
        if kind > 0 and there:
            there.pop(rng.integers(len(there)))
        if kind != 1 and len(there) < LARGEST:
            new = int(rng.integers(features))
            if new in there:
                continue
            there.append(new)
        change = (value := energy(there)) - now
        if change <= 0.0 or (heat > 0.0 and rng.random() < np.exp(-change / heat)):
            here, now = there, value
            if now < least:
                best, least = here, now
    return sorted(best), least


def report(smoke: bool) -> Section:
    section = Section(
        f"Subsets: annealing among {SIGNALS + SIGNALS * (SIGNALS + 1) // 2} terms, {LARGEST} at most"
    )
    gram, products = library(np.random.default_rng(5))
    prices, moves = np.full(gram.features, PRICE), 4000
    workers = _core.Workers(1)

    def ours() -> tuple[list[int], float]:
        unit = Unit(0, (0,)).named("subsets")
        return _core.search_subsets(
            [gram],
            [prices],
            moves=moves,
            largest=LARGEST,
            starts=1,
            unit=unit,
            coldest=COLDEST,
            workers=workers,
        )[0][0]

    (subset, value), (other, expected) = ours(), annealed(products, moves, 0)
    if list(subset) != other:
        raise Disagreement(f"subsets: expected {other}, found {subset}.")
    check_agreement("energy", np.array([value]), np.array([expected]))
    contestants = {OURS: ours, NUMPY: lambda: annealed(products, moves, 0)}
    times = interleaved(contestants, 3 if smoke else 21, at_least=0.0 if smoke else 0.05)
    for name in contestants:
        figure = float(np.median(times[name])) * 1e6 / moves
        against = ratio(times, name, OURS) if name != OURS else None
        section.lines.append(Line(f"{moves} moves", name, figure, "µs a move", against))
    section.notes.append(
        "Both walk from hot to cold by the same rules, on random numbers of their own, to the same subset."
    )
    return section

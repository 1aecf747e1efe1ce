"""Whitening: Gram matrices and likelihoods of noise, which one filter gives, beside that filter in NumPy."""

from collections.abc import Callable
from typing import Any

import numpy as np

from measure import Line, Section, check_agreement, interleaved, ratio
from twinloop import _core

DT, STEPS, FEATURES = 0.02, 400, 40
SENSORS, PROCESS, GUST, MEMORY = np.array([1e-2, 1e-3]), 1e-2, 4e-2, 0.3
OURS, NUMPY = "twinloop", "NumPy, a step for all columns"


def record(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Readings (n + 1, 2) of a speed and a place, coefficients (p,), and features (3, n, p) in each period."""
    time = DT * np.arange(STEPS)[:, None] + DT * np.array([0.0, 0.5, 1.0])[:, None, None]
    waves = rng.uniform(0.5, 6.0, FEATURES), rng.uniform(0.0, 6.0, FEATURES)
    features = np.ascontiguousarray(np.sin(waves[0] * time + waves[1]))
    coefficients = rng.normal(size=FEATURES)
    states = np.zeros((STEPS + 1, 2))
    for k, added in enumerate(increments(features) @ coefficients):
        states[k + 1] = [states[k, 0] + added[0], states[k, 1] + DT * states[k, 0] + added[1]]
    return states + rng.normal(size=states.shape) * np.sqrt(SENSORS), coefficients, features


def increments(features: np.ndarray) -> np.ndarray:
    """What each feature adds to the speed and the place in each period (n, 2, p): Simpson's rule."""
    start, middle, end = features
    return np.stack([start + 4.0 * middle + end, DT * (start + 2.0 * middle)], axis=1) * (DT / 6.0)


def gains(spread: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Gains (n + 1, 3, 2) and whitening matrices (n + 1, 2, 2) of a Kalman filter, its transition, and Σ log det S."""
    kept = np.exp(-DT / MEMORY)
    transition = np.array([[1.0, 0.0, DT], [DT, 1.0, DT * DT / 2.0], [0.0, 0.0, kept]])
    disturbance = np.zeros((3, 3))
    disturbance[:2, :2] = PROCESS * np.array([[DT, DT**2 / 2.0], [DT**2 / 2.0, DT**3 / 3.0]])
    disturbance[2, 2] = GUST * (1.0 - kept * kept)
    covariance = np.diag([*(spread * spread), GUST])
    found, roots, logarithm = np.empty((count, 3, 2)), np.empty((count, 2, 2)), 0.0
    for k in range(count):
        lower = np.linalg.cholesky(covariance[:2, :2] + np.diag(SENSORS))
        roots[k] = np.linalg.inv(lower)
        informed = covariance[:, :2] @ roots[k].T
        found[k] = informed @ roots[k]
        covariance = transition @ (covariance - informed @ informed.T) @ transition.T + disturbance
        logarithm += 2.0 * np.log(np.diag(lower)).sum()
    return found, roots, transition, logarithm


def spread(readings: np.ndarray) -> np.ndarray:
    return np.abs(readings).max(axis=0)


def products(readings: np.ndarray, features: np.ndarray) -> np.ndarray:
    """Inner products (p + 1, p + 1) of whitened features and, last, readings."""
    found, roots, transition, _ = gains(spread(readings), len(readings))
    added = np.append(increments(features), np.zeros((STEPS, 2, 1)), axis=2)
    state, rows = np.zeros((3, FEATURES + 1)), np.empty((STEPS + 1, 2, FEATURES + 1))
    for k, reading in enumerate(readings):
        # A feature is what its own response leaves; the readings are what their prediction leaves.
        innovation = -state[:2]
        innovation[:, -1] += reading
        rows[k] = roots[k] @ innovation
        state = transition @ (state + found[k] @ innovation)
        if k < STEPS:
            state[:2] += added[k]
    rows[:, :, :-1] *= -1.0
    whole = rows.reshape(-1, FEATURES + 1)
    return whole.T @ whole


def likelihood(residual: np.ndarray, about: np.ndarray) -> float:
    found, roots, transition, total = gains(about, len(residual))
    state = np.zeros(3)
    for k, reading in enumerate(residual):
        innovation = reading - state[:2]
        white = roots[k] @ innovation
        total += white @ white
        state = transition @ (state + found[k] @ innovation)
    return float(total)


def report(smoke: bool) -> Section:
    section = Section(f"Whitening: a chain of two states with gusts, {STEPS} steps, {FEATURES} features")
    readings, coefficients, features = record(np.random.default_rng(2))
    regression = _core.Regression(2, DT, "acceleration", [(readings, np.ones_like(readings), *features)])
    motion, workers = (PROCESS, GUST, MEMORY), _core.Workers(1)
    [residual] = regression.residuals(coefficients)
    about = spread(readings)
    gram, expected = regression.gram(SENSORS, motion, workers), products(readings, features)
    solved = gram.solve(list(range(8)), 0.0)
    assert solved is not None
    check_agreement("Gram, total", np.array([gram.total]), expected[-1:, -1])
    check_agreement(
        "Gram, least squares", solved[0], np.linalg.solve(expected[:8, :8], expected[:8, -1]), 1e-6
    )
    cases: dict[str, dict[str, Callable[[], Any]]] = {
        "Gram": {
            OURS: lambda: regression.gram(SENSORS, motion, workers),
            NUMPY: lambda: products(readings, features),
        },
        "likelihood of a noise": {
            OURS: lambda: regression.likelihood(coefficients, SENSORS, motion),
            NUMPY: lambda: likelihood(residual, about),
        },
    }
    one = cases["likelihood of a noise"]
    check_agreement("likelihood", np.array([one[OURS]()]), np.array([one[NUMPY]()]))
    for case, contestants in cases.items():
        times = interleaved(contestants, 3 if smoke else 41, at_least=0.0 if smoke else 0.02)
        for name in contestants:
            figure = float(np.median(times[name])) * 1e6
            section.lines.append(
                Line(case, name, figure, "µs", ratio(times, name, OURS) if name != OURS else None)
            )
    section.notes.append("The filter's covariances are part of both: each noise that is tried has its own.")
    return section

"""Tuning: a model's constants moved until its predictions leave least, beside SciPy's Levenberg and Marquardt."""

import numpy as np
from scipy.optimize import least_squares

from measure import Disagreement, Line, Section, check_agreement, interleaved, ratio
from twinloop import _core

DT, STEPS, RUNS = 0.02, 250, 2
TRUTH = np.array([-6.0, -0.4, 3.0, -0.2])
START = np.array([-4.0, -0.1, 2.0, 0.1])
SENSORS, PROCESS = np.array([4e-4, 1e-4]), 1e-3
SIGNALS = _core.Signals(DT, [1.0, 3.0], [(-2.0, 2.0)], [1.0], [None, 0])
OURS, SCIPY = "twinloop", "scipy, least_squares on NumPy, all slopes in one run"


def model(constants: np.ndarray) -> _core.Model:
    """acceleration = a sin(angle) + b rate + c u + d rate |rate|."""
    a, b, c, d = (float(constant) for constant in constants)
    lines = ["r3 = sin(r0)", f"r3 = r3 * {a!r}", f"r4 = r1 * {b!r}", "r3 = r3 + r4", f"r4 = r2 * {c!r}"]
    lines += ["r3 = r3 + r4", "r4 = abs(r1)", "r4 = r4 * r1", f"r4 = r4 * {d!r}", "r3 = r3 + r4"]
    text = "program inputs=3 outputs=1 registers=5\npage 1\n" + "\n".join(lines) + "\n"
    return _core.Model(_core.Program.parse(text), "acceleration", SIGNALS)


def moved(
    constants: np.ndarray, angle: np.ndarray, rate: np.ndarray, u: float
) -> tuple[np.ndarray, np.ndarray]:
    """A period by Runge and Kutta, for each row of constants (rows, 4)."""
    a, b, c, d = constants.T
    pushed = c * u

    def slope(angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        return a * np.sin(angle) + b * rate + pushed + d * rate * np.abs(rate)

    r1, s1 = rate, slope(angle, rate)
    r2 = rate + 0.5 * DT * s1
    s2 = slope(angle + 0.5 * DT * r1, r2)
    r3 = rate + 0.5 * DT * s2
    s3 = slope(angle + 0.5 * DT * r2, r3)
    r4 = rate + DT * s3
    s4 = slope(angle + DT * r3, r4)
    sixth = DT / 6.0
    return angle + sixth * (r1 + 2 * r2 + 2 * r3 + r4), rate + sixth * (s1 + 2 * s2 + 2 * s3 + s4)


def filters(readings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gains and whitening matrices (n + 1, 2, 2) of rate and angle, where nothing drives them but noise."""
    transition = np.array([[1.0, 0.0], [DT, 1.0]])
    disturbance = PROCESS * np.array([[DT, DT**2 / 2.0], [DT**2 / 2.0, DT**3 / 3.0]])
    covariance = np.diag(np.abs(readings).max(axis=0) ** 2)
    gains, roots = np.empty((len(readings), 2, 2)), np.empty((len(readings), 2, 2))
    for k in range(len(readings)):
        roots[k] = np.linalg.inv(np.linalg.cholesky(covariance + np.diag(SENSORS)))
        informed = covariance @ roots[k].T
        gains[k] = informed @ roots[k]
        covariance = transition @ (covariance - informed @ informed.T) @ transition.T + disturbance
    return gains, roots


def errors(constants: np.ndarray, runs: list) -> np.ndarray:
    """Whitened prediction errors (rows, ·) for each row of constants (rows, 4)."""
    found = []
    for readings, commands, gains, roots in runs:
        state = np.tile(readings[0], (len(constants), 1))
        white = np.empty((len(constants), STEPS + 1, 2))
        for k in range(STEPS + 1):
            innovation = readings[k] - state
            white[:, k] = innovation @ roots[k].T
            state = state + innovation @ gains[k].T
            if k < STEPS:
                angle, rate = moved(constants, state[:, 1], state[:, 0], commands[k, 0])
                state = np.stack([rate, angle], axis=1)
        found.append(white.reshape(len(constants), -1))
    return np.concatenate(found, axis=1)


def flights(rng: np.random.Generator) -> tuple[list, list]:
    """Records as the engine takes them (states: angle, rate), and as the filter in NumPy does."""
    records, runs = [], []
    for _ in range(RUNS):
        commands = np.repeat(rng.uniform(-2.0, 2.0, (STEPS // 25, 1)), 25, axis=0)
        angle, rate, states = np.array([0.4]), np.zeros(1), [[0.0, 0.4]]
        for u in commands[:, 0]:
            angle, rate = moved(TRUTH[None], angle, rate, u)
            states.append([rate[0], angle[0]])
        readings = np.array(states) + rng.normal(size=(STEPS + 1, 2)) * np.sqrt(SENSORS)
        records.append((np.ascontiguousarray(readings[:, ::-1]), np.ones((STEPS + 1, 2)), commands))
        runs.append((readings, commands, *filters(readings)))
    return records, runs


def by_scipy(runs: list) -> tuple[np.ndarray, float]:
    def slopes(constants: np.ndarray) -> np.ndarray:
        steps = 1e-6 * np.maximum(np.abs(constants), 1e-6)
        rows = errors(np.vstack([constants, constants + np.diag(steps)]), runs)
        return ((rows[1:] - rows[0]) / steps[:, None]).T

    found = least_squares(lambda c: errors(c[None], runs)[0], START, jac=slopes, method="lm")
    return found.x, float(2.0 * found.cost)


def report(smoke: bool) -> Section:
    section = Section(
        f"Tuning: 4 constants on {RUNS} runs of {STEPS} steps, predictions whitened by an observer"
    )
    records, runs = flights(np.random.default_rng(4))
    chains = [([1, 0], SENSORS.tolist(), (PROCESS, 0.0, 1.0), "acceleration")]
    limits, start, workers = _core.Limits(SIGNALS), model(START), _core.Workers(1)

    def ours() -> tuple[np.ndarray, float]:
        tuned, left, *_ = _core.tune(
            start, limits, chains, records, free=[0, 1, 2, 3], lags=[], iterations=30, workers=workers
        )
        return tuned.constants, left

    (constants, left), (expected, least) = ours(), by_scipy(runs)
    check_agreement("χ²", np.array([left]), np.array([least]), 1e-5)
    if not np.allclose(constants, expected, rtol=1e-2):
        raise Disagreement(f"constants: expected {expected}, found {constants}.")
    contestants = {OURS: ours, SCIPY: lambda: by_scipy(runs)}
    times = interleaved(contestants, 3 if smoke else 21, at_least=0.0 if smoke else 0.02)
    for name in contestants:
        figure = float(np.median(times[name])) * 1e3
        against = ratio(times, name, OURS) if name != OURS else None
        section.lines.append(Line("to the minimum", name, figure, "ms", against))
    section.notes.append(
        "Both start at the same constants; the covariance that ours finds beside them is in its time."
    )
    return section

"""Only outputs measured: a pendulum of which the angle alone is logged, its rate made of the past, and without it."""

import warnings

import numpy as np
from scipy.integrate import solve_ivp

import twinloop as tl

DT, NOISE = 0.05, 1e-3
# Without lags nothing moves the angle but itself; that this explains too little is what is shown here.
warnings.simplefilter("ignore", tl.RemarkWarning)


def logged(seed):
    """Ten seconds of angle (rad) and torque (N m), begun in motion."""
    stream = np.random.default_rng(seed)
    torques = np.repeat(stream.uniform(-1.0, 1.0, 40), 5)
    states = [stream.uniform(-0.5, 0.5, 2)]
    for torque in torques:
        moved = solve_ivp(
            lambda t, x, u=torque: [x[1], -9.0 * np.sin(x[0]) - 0.5 * x[1] + 4.0 * u],
            (0.0, DT),
            states[-1],
            rtol=1e-9,
        )
        states.append(moved.y[:, -1])
    angles = np.array(states)[:, :1] + NOISE * stream.standard_normal((len(states), 1))
    return tl.Trajectory(DT * np.arange(len(states)), angles, torques[:, np.newaxis])


runs = [logged(1), logged(2)]
for lags in (0, 1):
    signals = tl.Signals(
        states=[tl.State("angle", "rad", scale=np.pi)],
        commands=[tl.Command("torque", "N m", bounds=(-1.0, 1.0))],
        dt=DT,
        lags=lags,
    )
    twin = tl.identify(runs, signals, seed=0, progress=None)
    print(f"lags={lags}\n{twin.equations()}\n")
    print("\n".join(str(twin.fit(logged(seed))[0].fit) for seed in (3, 4, 5)))

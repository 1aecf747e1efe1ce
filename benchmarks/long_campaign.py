"""A long campaign: what `ask` costs after 10 and after 200 experiments of 1000 steps, and how much memory it takes.

    python benchmarks/long_campaign.py [--smoke]

Flights of a noisy pendulum under random gains are told; then one `ask` is timed, in a process of its own, in CPU time.
"""

import argparse
import json
import resource
import subprocess
import sys
import time

import numpy as np

import twinloop as tl

SIGNALS = tl.Signals(
    [
        tl.State("angle", "rad", scale=np.pi),
        tl.State("rate", "rad/s", scale=8.0, derivative_of="angle", envelope=(-12.0, 12.0)),
    ],
    [tl.Command("torque", "N m", bounds=(-2.0, 2.0))],
    dt=0.05,
)
GAINS = {"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)}
SMOKE = {"moves": 800, "starts": 1, "generations": 0, "lags": False, "hidden": False, "evaluations": 128,
         "candidates": 24, "committee_size": 4, "tuning_steps": 3, "draws": 2, "tuning_starts": 1}  # fmt: skip


def pendulum(state, command):
    """One period in two steps of the midpoint rule."""
    x, dt = np.asarray(state, dtype=float), SIGNALS.dt / 2

    def slope(x):
        return np.array([x[1], 20.0 * command[0] - 24.6 * np.sin(x[0]) - x[1]])

    for _ in range(2):
        x = x + dt * slope(x + dt / 2 * slope(x))
    return x


def ask(experiments, steps, options):
    """CPU seconds of one `ask` after so many experiments, and the most memory so far, MB."""
    plant = tl.systems.Simulated(SIGNALS, pendulum)
    campaign = tl.Campaign(
        SIGNALS, controller=tl.controllers.PID(axes=[("angle", "rate")], gains=GAINS), initial_state=[0.0, 0.0],
        target_state=[1.0, 0.0], duration=steps * SIGNALS.dt, threads=1, options=options,
        progress=None,
    )  # fmt: skip
    stream = np.random.default_rng(0)
    for _ in range(experiments):
        gains = {name: stream.uniform(0.2 * high, 0.6 * high) for name, (_, high) in GAINS.items()}
        test = campaign.test(gains)
        run = plant.run(test)
        noisy = run.states + 1e-3 * stream.standard_normal(run.states.shape)
        campaign.tell(test, tl.Trajectory(run.t, noisy, run.commands))
    clock = time.process_time()
    campaign.ask()
    seconds = time.process_time() - clock
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("--smoke", action="store_true", help="does it run? the numbers mean nothing")
    arguments.add_argument("--one", nargs=3, type=int, help=argparse.SUPPRESS)
    asked = arguments.parse_args()
    if asked.one:
        print(json.dumps(ask(asked.one[0], asked.one[1], SMOKE if asked.one[2] else {})))
        return
    rows = []
    for experiments, steps in ((3, 50), (12, 50)) if asked.smoke else ((10, 1000), (200, 1000)):
        words = [sys.executable, __file__, "--one", str(experiments), str(steps), str(int(asked.smoke))]
        answer = subprocess.run(words, capture_output=True, text=True, check=True).stdout
        rows.append((experiments, *json.loads(answer)))
        print(f"{experiments:4d} experiments of {steps} steps: ask {rows[-1][1]:.1f} s, {rows[-1][2]:.0f} MB")
    print(f"ratio: {rows[1][1] / rows[0][1]:.2f}")


if __name__ == "__main__":
    main()

"""What the guard costs in each period: a controller alone, and with a guard that looks ahead over several horizons."""

import numpy as np

import twinloop as tl
from measure import Disagreement, Line, Section, interleaved, ratio
from twinloop.guard import Guard

QUICK = {"moves": 600, "starts": 1, "generations": 0, "evaluations": 256, "candidates": 32, "tuning_steps": 4}
ALONE = "controller alone"


def report(smoke: bool) -> Section:
    """Periods of the built-in quadrotor."""
    system = tl.systems.Quadrotor(noise=1e-3)
    campaign = tl.Campaign(
        system.signals, controller=system.controller, initial_state=system.initial_state,
        target_state=system.target_state, duration=system.duration, threads=1, options=QUICK if smoke else {},
        progress=None,
    )  # fmt: skip
    campaign.run(system, 1 if smoke else 2)
    test = campaign.test(system.default_gains)
    flight = system.run(test)
    horizons = (0.0, 0.4) if smoke else (0.0, 0.2, 0.4, 0.8)
    controllers: dict[str, tl.controllers.Controller | Guard] = {ALONE: test.controller()}
    for horizon in horizons:
        controllers[f"guard, {horizon:g} s ahead"] = campaign.guard(test, horizon=horizon, clock=None)
    sent = {name: _flown(controller, test, flight.states) for name, controller in controllers.items()}
    for name, commands in sent.items():
        if not np.array_equal(commands, sent[ALONE]):
            raise Disagreement(f"{name}: other commands than the controller's own")
    runs = {
        name: (lambda controller=controller: _flown(controller, test, flight.states))
        for name, controller in controllers.items()
    }
    times = interleaved(runs, rounds=3 if smoke else 41)
    members = len(campaign.twin.members)
    section = Section("Guard: one period of the quadrotor (20 ms), as the loop calls it")
    for name in runs:
        section.lines.append(
            Line(f"{members} members", name, 1e6 * float(np.median(times[name])) / test.steps, "µs per period",
                 None if name == ALONE else ratio(times, name, ALONE))
        )  # fmt: skip
    section.notes.append("The ratio is how many times the controller's own time a guarded period takes.")
    return section


def _flown(controller: tl.controllers.Controller | Guard, test: tl.Test, readings: np.ndarray) -> np.ndarray:
    controller.reset()
    return np.array([controller.command(readings[k], test.target(k)) for k in range(test.steps)])

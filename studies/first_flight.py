"""The first flight does no harm: ten plants of different authority, each under a controller that is made for it.

    python studies/first_flight.py [--smoke] [--seeds 3] [--flights 10]

Three more answer more than their controller says: a damping of 0.15, and a load that swings lightly damped, of which
the controller knows nothing. Each plant is flown under the controller alone, with chirps of the preset's amplitude
whatever the controller is, with chirps that are sized by the controller, and with those of `campaign.test`, which are
held back as well by what the states do. Shown are how much of the envelope the true states used, worst over flights,
and the held-out error of the twin that a campaign learns from one such flight: mean squared error of free runs over
that of a model that never moves, median over controllers that have not flown, then over seeds.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import twinloop as tl
from twinloop._ground.arrays import Floats
from twinloop._ground.streams import Unit
from twinloop.law.flight import fly
from twinloop.planning.excitation import chirps

HELD_OUT = 12
"""Controllers that nobody flew."""
QUICK = {"moves": 600, "starts": 1, "committee_size": 4, "tuning_steps": 4, "generations": 0}
"""Options of `--smoke`."""
WAYS = ("alone", "2 %", "sized", "as it is")


@dataclass(frozen=True)
class Plant:
    """A plant with a trusted controller.

    Args:
        name: for the table.
        signals: of it.
        step: one period.
        family: of its controllers.
        gains: of the trusted one.
        target: where it leads from rest at 0.
        duration: of a flight, s.
        noise: of the sensors (n_x,).
    """

    name: str
    signals: tl.Signals
    step: Callable[[Floats, Floats], Floats]
    family: tl.controllers.PID
    gains: dict[str, float]
    target: Floats
    duration: float
    noise: Floats

    def run(self, test: tl.Test, seed: int | None) -> tl.Trajectory:
        """Flies a test, with noise where there is a seed."""
        if seed is None:
            return fly(self.step, test)
        random = np.random.Generator(np.random.Philox([seed, 77]))
        return fly(
            self.step, test, noise=self.noise * random.standard_normal((test.steps + 1, len(self.noise)))
        )


def mass(name: str, authority: float, damping: float = 0.8, sag: float = 0.0) -> Plant:
    """A turning mass: full command gives an acceleration of `authority` rad/s²; `sag` is a pendulum's share of it."""
    signals = tl.Signals(
        [
            tl.State("angle", "rad", scale=1.0, envelope=(-1.4, 1.4)),
            tl.State("rate", "rad/s", scale=6.0, derivative_of="angle", envelope=(-8.0, 8.0)),
        ],
        [tl.Command("torque", "N m", bounds=(-1.0, 1.0))],
        0.02,
    )

    def step(x: Floats, u: Floats) -> Floats:
        angle, rate = x
        for _ in range(4):
            rate += 0.005 * (authority * u[0] - sag * authority * np.sin(angle) - 0.3 * rate)
            angle += 0.005 * rate
        return np.array([angle, rate])

    frequency = 3.0
    kp, kd = frequency**2 / authority, 2.0 * damping * frequency / authority
    gains = {"angle.kp": kp, "angle.ki": 0.5 * kp, "angle.kd": kd}
    box = {name: (0.0, 4.0 * value) for name, value in gains.items()}
    family = tl.controllers.PID(axes=[("angle", "rate")], gains=box)
    return Plant(name, signals, step, family, gains, np.array([0.7, 0.0]), 3.0, np.array([1e-3, 5e-3]))


def swinging(name: str, authority: float, frequency: float, room: float) -> Plant:
    """The mass with a load that its torque swings, at so many rad/s, with a damping of 0.01; `room` in rad."""
    base = mass(name, authority)
    signals = tl.Signals(
        [
            *base.signals.states,
            tl.State("swing", "rad", scale=0.5 * room, envelope=(-room, room)),
            tl.State(
                "swing_rate",
                "rad/s",
                scale=0.5 * frequency * room,
                derivative_of="swing",
                envelope=(-frequency * room, frequency * room),
            ),
        ],
        list(base.signals.commands),
        base.signals.dt,
    )

    def step(x: Floats, u: Floats) -> Floats:
        angle, rate, swing, swing_rate = x
        for _ in range(4):
            rate += 0.005 * (authority * u[0] - 0.3 * rate)
            angle += 0.005 * rate
            swing_rate += 0.005 * (
                authority * u[0] - frequency**2 * swing - 2.0 * 0.01 * frequency * swing_rate
            )
            swing += 0.005 * swing_rate
        return np.array([angle, rate, swing, swing_rate])

    target, noise = np.array([*base.target, 0.0, 0.0]), np.array([*base.noise, 1e-3, 5e-3])
    return Plant(name, signals, step, base.family, base.gains, target, base.duration, noise)


def oven(name: str, authority: float) -> Plant:
    """A first-order plant: full command heats by `authority` K/s, and a tenth of the excess is lost in a second."""
    signals = tl.Signals(
        [tl.State("excess", "K", scale=20.0, envelope=(-5.0, 20.0))],
        [tl.Command("heat", "W", bounds=(-1.0, 1.0))],
        0.1,
    )

    def step(x: Floats, u: Floats) -> Floats:
        return x + 0.1 * (authority * u - 0.1 * x - 0.002 * x * np.abs(x))

    gains = {"excess.kp": 0.8 / authority, "excess.ki": 0.2 / authority, "excess.kd": 0.0}
    box = {"excess.kp": (0.0, 3.0 / authority), "excess.ki": (0.0, 1.0 / authority), "excess.kd": 0.0}
    family = tl.controllers.PID(axes=[("excess", None)], gains=box)
    return Plant(name, signals, step, family, gains, np.array([12.0]), 10.0, np.array([0.02]))


def quadrotor(name: str, size: float, frequency: float) -> Plant:
    """The built-in quadrotor with a share of its inertia: the smaller, the more its rotors turn it."""
    inertia = size * np.array([7.5e-3, 7.5e-3, 1.3e-2])
    rig = tl.systems.Quadrotor(inertia=inertia, rotor_inertia=size * 6e-5, natural_frequency=frequency)
    steps = rig.dynamics

    def step(x: Floats, u: Floats) -> Floats:
        return steps.step(x[np.newaxis], u[np.newaxis])[0]

    gains, noise = rig.default_gains, 1e-3 * np.array([1.0, 1.0, 1.0, 5.0, 5.0, 5.0])
    return Plant(name, rig.signals, step, rig.controller, gains, rig.target_state, rig.duration, noise)


PLANTS: tuple[Callable[[], Plant], ...] = (
    lambda: mass("mass, 10 rad/s²", 10.0),
    lambda: mass("mass, 100 rad/s²", 100.0),
    lambda: mass("mass, 1000 rad/s²", 1000.0),
    lambda: mass("mass, 1000 rad/s², damping 0.4", 1000.0, damping=0.4),
    lambda: mass("pendulum, 30 rad/s²", 30.0, sag=0.3),
    lambda: oven("oven, 3 K/s", 3.0),
    lambda: oven("oven, 100 K/s", 100.0),
    lambda: quadrotor("quadrotor", 1.0, 2.0),
    lambda: quadrotor("quadrotor, inertia / 5", 0.2, 2.5),
    lambda: quadrotor("quadrotor, inertia / 20", 0.05, 3.0),
    lambda: mass("mass, 1000 rad/s², damping 0.15", 1000.0, damping=0.15),
    lambda: swinging("swinging load, 12 rad/s", 1000.0, 12.0, 0.3),
    lambda: swinging("swinging load, 20 rad/s", 1000.0, 20.0, 0.12),
)


def usage(states: Floats, signals: tl.Signals) -> float:
    """The most of the envelope that was used, 1 at a bound."""
    worst = 0.0
    for column, state in zip(states.T, signals.states, strict=True):
        if state.envelope is not None:
            low, high = state.envelope
            worst = max(worst, float(np.abs(column - 0.5 * (low + high)).max() / (0.5 * (high - low))))
    return worst


def held_out(plant: Plant, campaign: tl.Campaign, count: int) -> float:
    """Median error on controllers that have not flown, with gains between half and twice the trusted ones."""
    twin, random = campaign.twin, np.random.Generator(np.random.Philox([5]))
    scales = np.array([state.scale for state in plant.signals.states])
    first, errors = campaign.tests[0].quiet(), []
    low, high = (np.array([getattr(gain, end) for gain in campaign.family.gains]) for end in ("low", "high"))
    for _ in range(count):
        genes = np.clip(first.genes * 2.0 ** random.uniform(-1.0, 1.0, len(first.genes)), low, high)
        test = dataclasses.replace(first, genes=genes)
        true, found = plant.run(test, None).states, twin.simulate(test).states
        if len(found) < len(true):
            errors.append(np.inf)
            continue
        moved = np.square((true - true[0]) / scales).mean()
        errors.append(float(np.square((true - found[: len(true)]) / scales).mean() / moved))
    return float(np.median(errors))


def begun(plant: Plant, way: str, seed: int, smoke: bool) -> tuple[tl.Campaign, tl.Test]:
    """A campaign and its first test."""
    options: dict[str, object] = {"hold_back": way != "sized", **(QUICK if smoke else {})}
    campaign = tl.Campaign(
        plant.signals,
        controller=plant.family,
        initial_state=np.zeros(plant.signals.n_x),
        target_state=plant.target,
        duration=plant.duration,
        seed=seed,
        threads=1,
        progress=None,
        options=options,
    )
    if way == "alone":
        return campaign, campaign.test(plant.gains, excitation=None)
    if way == "2 %":
        amplitude, fade = campaign.options.excitation, campaign.options.fade
        stream = Unit(seed).part(0).stream("excitation")
        added = chirps(plant.signals, campaign.setup.steps, amplitude, fade, stream)
        return campaign, campaign.test(plant.gains, added)
    return campaign, campaign.test(plant.gains)


def learnt(plant: Plant, seed: int, smoke: bool) -> list[float]:
    """Held-out error of the twin that is learnt from the first flight, each way."""
    errors: list[float] = []
    before: tl.Trajectory | None = None
    for way in WAYS:
        campaign, test = begun(plant, way, seed, smoke)
        run = plant.run(test, seed)
        # Where nothing was held back, the same flight teaches the same.
        if before is not None and np.array_equal(run.commands, before.commands):
            errors.append(errors[-1])
            continue
        campaign.tell(test, run)
        errors.append(held_out(plant, campaign, 3 if smoke else HELD_OUT))
        before = run
    return errors


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--smoke", action="store_true", help="two plants, one seed, two flights, a quick search"
    )
    parser.add_argument("--seeds", type=int, default=3, help="campaigns of each plant that learn; 0: none")
    parser.add_argument("--flights", type=int, default=10, help="first flights of each plant")
    chosen = parser.parse_args()
    plants = (PLANTS[2], PLANTS[-2]) if chosen.smoke else PLANTS
    seeds, flights = (1, 2) if chosen.smoke else (chosen.seeds, chosen.flights)
    columns = [f"used: {way}" for way in WAYS] + [f"held out: {way}" for way in WAYS] * (seeds > 0)
    print("| plant | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for make in plants:
        plant = make()
        used = [
            max(
                usage(plant.run(begun(plant, way, seed, chosen.smoke)[1], None).states, plant.signals)
                for seed in range(flights)
            )
            for way in WAYS
        ]
        errors = [learnt(plant, seed, chosen.smoke) for seed in range(seeds)]
        numbers = [f"{value:.3f}" for value in used]
        numbers += [f"{value:.1e}" for value in np.median(errors, axis=0)] if errors else []
        print(f"| {plant.name} | " + " | ".join(numbers) + " |", flush=True)


if __name__ == "__main__":
    main()

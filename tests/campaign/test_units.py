"""The preset `default` decides the same in any units: those of states, commands and time times powers of two.

A product with a power of two is exact, so what two campaigns decide can be compared to the last bit.
"""

import re

import numpy as np
import pytest

import twinloop as tl
from twinloop.law.flight import fly

QUICK = {
    "moves": 600, "starts": 1, "evaluations": 128, "candidates": 24, "committee_size": 4, "tuning_steps": 4,
    "draws": 2, "tuning_starts": 1, "generations": 0,
}  # fmt: skip
"""Options of a campaign of a few seconds."""


class Units:
    """Numbers of a quantity in these units, for each of 1 in those of SI: powers of two.

    Args:
        states: factors on the numbers of each state.
        command: on those of the command.
        time: on those of time.
    """

    def __init__(self, states, command=1.0, time=1.0):
        self.states, self.command, self.time = np.array(states, dtype=float), float(command), float(time)


class Plant:
    """A system in SI units, its readings with noise, that is measured and commanded in others.

    Args:
        units: that it is measured in.
    """

    names: tuple[tuple[str, str, float], ...]
    derivative: str | None = None
    noise: tuple[float, ...]
    start: tuple[float, ...]
    target: tuple[float, ...]
    dt = 0.125

    def __init__(self, units):
        self.units, self.runs = units, 0
        states = [
            tl.State(
                name, unit, scale * factor,
                derivative_of=self.derivative if i == 1 else None,
                envelope=(-4.0 * scale * factor, 4.0 * scale * factor),
            )
            for i, ((name, unit, scale), factor) in enumerate(zip(self.names, units.states, strict=True))
        ]  # fmt: skip
        bounds = (-2.0 * units.command, 2.0 * units.command)
        self.signals = tl.Signals(states, [tl.Command("u", "N", bounds)], self.dt * units.time)

    def step(self, x, u):
        raise NotImplementedError

    def run(self, test):
        units = self.units
        self.runs += 1
        random = np.random.default_rng(self.runs)
        noise = random.standard_normal((test.steps + 1, 2)) * np.array(self.noise) * units.states

        def step(x, u):
            return self.step(x / units.states, u[0] / units.command) * units.states

        return fly(step, test, noise=noise)

    def campaign(self, **changes):
        units = self.units
        controller = self.controller()
        self.default_gains = {name: 0.375 * high for name, (_, high) in controller.gains.items()}
        options = {**QUICK, **changes.pop("options", {})}
        return tl.Campaign(
            self.signals, controller=controller, initial_state=np.array(self.start) * units.states,
            target_state=np.array(self.target) * units.states, duration=24 * self.dt * units.time,
            preset="default", threads=1, options=options, **changes,
        )  # fmt: skip

    def controller(self):
        units = self.units
        first, second = (name for name, _, _ in self.names)
        # Gains are commands per state, per state and time, and commands times time per state.
        p = units.command / units.states[0]
        gains = {
            f"{first}.kp": (0.0, 4.0 * p),
            f"{first}.ki": (0.0, 1.0 * p / units.time),
            f"{first}.kd": (0.0, 2.0 * self.rate_gain()),
        }
        return tl.controllers.PID(axes=[(first, second if self.derivative else None)], gains=gains)

    def rate_gain(self):
        units = self.units
        return (
            units.command / units.states[1]
            if self.derivative
            else units.command * units.time / units.states[0]
        )


class Cart(Plant):
    """A cart with drag: accelerations."""

    names = (("place", "m", 1.0), ("speed", "m/s", 2.0))
    derivative = "place"
    noise = (2e-3, 4e-3)
    start, target = (0.0, 0.0), (1.0, 0.0)

    def step(self, x, u):
        place, speed = x
        for _ in range(5):
            speed = speed + 0.025 * (1.5 * u - 0.5 * speed * abs(speed) - 0.25 * place)
            place = place + 0.025 * speed
        return np.array([place, speed])


class FedBackCart(Cart):
    """The same under a feedback of its full state and of an integral, with gains by LQR among the starts."""

    def controller(self):
        units = self.units
        per_place, per_speed = units.command / units.states
        gains = {
            "place->u": (0.0, 4.0 * per_place),
            "speed->u": (0.0, 4.0 * per_speed),
            "place.integral->u": (0.0, 2.0 * per_place / units.time),
        }
        return tl.controllers.StateFeedback(["place", "speed"], gains, integral=["place"])


class Tanks(Plant):
    """Two vessels, of which one feeds the other: increments."""

    names = (("pressure", "Pa", 1.0), ("heat", "K", 2.0))
    noise = (2e-3, 4e-3)
    start, target = (0.25, 0.5), (1.0, 0.5)

    def step(self, x, u):
        pressure, heat = x
        following = (
            pressure + 0.125 * (0.75 * u - 0.5 * pressure),
            heat + 0.125 * (0.5 * pressure - 0.25 * heat),
        )
        return np.array(following)


class Outflow(Tanks):
    """A vessel that runs out as its pressure says, and heats another the more the emptier it is."""

    noise = (2e-4, 4e-3)

    def step(self, x, u):
        pressure, heat = x
        out = np.sign(pressure) * np.sqrt(abs(pressure))
        return np.array([pressure + 0.125 * (0.75 * u + 0.4 - 0.6 * out),
                         heat + 0.125 * (0.1 * u / max(pressure, 0.05) - 0.25 * heat)])  # fmt: skip


class Adrift(Tanks):
    """The same beside a heat that wanders about, which no law foretells."""

    def __init__(self, units):
        super().__init__(units)
        self.random = np.random.default_rng(1)

    def step(self, x, u):
        pressure, heat = x
        return np.array(
            [pressure + 0.125 * (0.75 * u - 0.5 * pressure), heat + 0.25 * self.random.standard_normal()]
        )


def decisions(plant, units, flights=3, **changes):
    """What a campaign of some flights decides, its numbers taken back to SI units."""
    system = plant(units)
    campaign = system.campaign(**changes)
    campaign.run(system, flights)
    scales = np.array([gain.high for gain in campaign.setup.family.gains])
    lessons = campaign.history
    twin = campaign.twin
    flown = twin.simulate(campaign.experiments[0].test)
    return {
        "noise": [(np.array(lesson.sensors) / units.states).tolist() for lesson in lessons],
        "terms": [lesson.terms for lesson in lessons],
        "lags": [[lag / units.time for lag in lesson.lags] for lesson in lessons],
        "delays": [lesson.delays for lesson in lessons],
        "misfit": [lesson.misfit for lesson in lessons],
        "committees": [lesson.follows for lesson in lessons],
        "genes": [(run.test.genes / scales).tolist() for run in campaign.experiments],
        # When two models part is told in seconds, whatever these are.
        "reasons": [re.sub(r"[^ ]* s after", "", run.test.reason) for run in campaign.experiments],
        "safe": [plan.safe for lesson in lessons for plan in lesson.asked],
        "bits": [plan.bits for lesson in lessons for plan in lesson.asked],
        "members": len(campaign.committee),
        "best": (campaign.best_test.genes / scales).tolist(),
        "followed": twin.follows,
        "errors": [(row.open_loop, row.closed_loop, row.normalised, row.before) for row in twin.errors],
        "unseen": [each.error for each in campaign.examine().unseen],
        "predictions": (flown.states / units.states).tolist(),
        "structure": [
            [(name, destination, first, second if isinstance(second, int) else None)
             for name, destination, first, second in member.program.instructions]
            for member in campaign.committee
        ],
    }  # fmt: skip


def same(found, expected):
    """Whether decisions are the same, to the last bit."""
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        assert found[key] == value, key


# A cart's speed is a place per time: its factor follows.
CARTS = {
    "places in fine units": Units([2.0**14, 2.0**14]),
    "places in coarse units": Units([2.0**-12, 2.0**-12]),
    "commands in fine units": Units([1.0, 1.0], command=2.0**16),
    "commands in coarse units": Units([1.0, 1.0], command=2.0**-13),
    "time in fine units": Units([1.0, 2.0**-10], time=2.0**10),
    "time in coarse units": Units([1.0, 2.0**9], time=2.0**-9),
    "all at once": Units([2.0**17, 2.0**11], command=2.0**-9, time=2.0**6),
}
TANKS = {
    "pressure in fine units": Units([2.0**17, 1.0]),
    "pressure in coarse units": Units([2.0**-14, 1.0]),
    "heat in fine units": Units([1.0, 2.0**12]),
    "all at once": Units([2.0**-11, 2.0**13], command=2.0**8, time=2.0**-8),
}


LAWS = {"increments": {"form": "increment"}, "a form that is searched": {}}


@pytest.fixture(scope="module")
def in_si():
    one = Units([1.0, 1.0])
    tanks = {law: decisions(Tanks, one, options=options) for law, options in LAWS.items()}
    return {Cart: decisions(Cart, one), FedBackCart: decisions(FedBackCart, one), **tanks}


@pytest.mark.parametrize("cart", [Cart, FedBackCart])
@pytest.mark.parametrize("units", CARTS.values(), ids=CARTS)
def test_a_cart_is_learnt_and_flown_alike_in_any_units(in_si, units, cart):
    same(decisions(cart, units), in_si[cart])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("units", TANKS.values(), ids=TANKS)
def test_vessels_are_learnt_and_flown_alike_in_any_units(in_si, units, law):
    same(decisions(Tanks, units, options=LAWS[law]), in_si[law])


@pytest.mark.parametrize("units", [Units([2.0**17, 2.0**-7]), Units([2.0**-17, 2.0**7])])
def test_a_twin_that_foretells_one_state_of_two_follows_or_not_in_any_units(units):
    expected = decisions(Adrift, Units([1.0, 1.0]), flights=2, options=LAWS["increments"])
    assert expected["followed"] == expected["committees"][-1]
    same(decisions(Adrift, units, flights=2, options=LAWS["increments"]), expected)


# A root is of a state in units of its scale, and what is divided by is too: no power of two is too odd or too far.
OUTFLOWS = {
    "pressure in fine units": Units([2.0**17, 1.0]),
    "pressure in coarse units": Units([2.0**-15, 1.0]),
    "heat in fine units": Units([1.0, 2.0**13]),
    "very fine units": Units([2.0**41, 2.0**40]),
    "very coarse units": Units([2.0**-41, 2.0**-39]),
    "time in fine units": Units([1.0, 1.0], time=2.0**30),
    "all at once": Units([2.0**-11, 2.0**15], command=2.0**7, time=2.0**-9),
}


@pytest.mark.parametrize("generations", [0, 2])
@pytest.mark.parametrize("units", OUTFLOWS.values(), ids=OUTFLOWS)
def test_roots_and_quotients_are_learnt_alike_in_any_units(units, generations):
    options = {"generations": generations}
    expected = decisions(Outflow, Units([1.0, 1.0]), flights=2, options=options)
    assert {"sqrt", "/"} <= {name for name, *_ in expected["structure"][0]}
    same(decisions(Outflow, units, flights=2, options=options), expected)


@pytest.mark.parametrize(("plant", "units"), [(Cart, CARTS["all at once"]), (Tanks, TANKS["all at once"])])
def test_evolved_terms_change_nothing_where_the_law_needs_none(plant, units):
    evolved = {"options": {"generations": 2, **(LAWS["increments"] if plant is Tanks else {})}}
    same(
        decisions(plant, units, flights=2, **evolved),
        decisions(plant, Units([1.0, 1.0]), flights=2, **evolved),
    )


# No library: what is learnt is grown, with constants, roots, waves and quotients of everything.
GROWN = {"libraries": (), "generations": 4, "population": 60, "form": "increment"}


@pytest.mark.parametrize("units", [OUTFLOWS["very coarse units"], OUTFLOWS["all at once"]])
def test_a_law_that_is_grown_is_the_same_in_any_units(units):
    expected = decisions(Outflow, Units([1.0, 1.0]), flights=2, options=GROWN)
    grown = {name for member in expected["structure"] for name, *_ in member}
    assert grown - {"+", "*"}, "nothing was grown but products"
    same(decisions(Outflow, units, flights=2, options=GROWN), expected)


@pytest.mark.parametrize("quality", ["ise", "final_distance"])
def test_no_quality_has_a_favourite_unit(quality):
    expected = decisions(Cart, Units([1.0, 1.0]), quality=quality)
    # The final distance weighs states as they are, a speed beside a place: both change together.
    same(decisions(Cart, Units([2.0**14, 2.0**14]), quality=quality), expected)

"""Two stirred reactors with rational laws: a reaction that its own substrate inhibits, and one on a catalyst."""

from __future__ import annotations

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task, about_rest

DILUTION, RATE, INHIBITION = 0.25, 1.4, 0.5
"""1/s, mol/(L s) and L²/mol²."""
SATURATION = 0.6
"""mol/L."""


def inhibited(z: Row, u: Row) -> Row:
    """Substrate and product, mol/L, under the substrate's concentration in the feed.

    The rate is Haldane's: RATE s / (SATURATION + s + INHIBITION s²).
    """
    s, p = z
    reaction = RATE * s / (SATURATION + s + INHIBITION * s * s)
    return [DILUTION * (u[0] - s) - reaction, reaction - DILUTION * p]


ADSORPTION = (2.0, 1.2)
"""Of the two species, L/mol."""
TURNOVER = 3.0
"""L/(mol s)."""
FLOW = 0.4
"""1/s."""


def on_catalyst(z: Row, u: Row) -> Row:
    """Two species, mol/L, under their concentrations in the feed.

    The rate is Langmuir's and Hinshelwood's: TURNOVER a b / (1 + Ka a + Kb b)².
    """
    a, b = z
    crowded = 1.0 + ADSORPTION[0] * a + ADSORPTION[1] * b
    reaction = TURNOVER * a * b / (crowded * crowded)
    return [FLOW * (u[0] - a) - reaction, FLOW * (u[1] - b) - reaction]


INHIBITED = Signals(
    [
        State("substrate", "mol/L", 2.0, envelope=(-0.05, 3.0)),
        State("product", "mol/L", 4.0, envelope=(-0.05, 6.0)),
    ],
    [Command("feed", "mol/L", (0.0, 8.0))],
    0.25,
)
CATALYST = Signals(
    [
        State("a", "mol/L", 2.0, envelope=(-0.05, 4.0)),
        State("b", "mol/L", 2.0, envelope=(-0.05, 4.0)),
    ],
    [Command("feed_a", "mol/L", (0.0, 6.0)), Command("feed_b", "mol/L of b", (0.0, 6.0))],
    0.1,
)


def _rest_of_inhibited(substrate: float) -> tuple[float, float]:
    """Product and feed at which a concentration of the substrate stays."""
    reaction = RATE * substrate / (SATURATION + substrate + INHIBITION * substrate * substrate)
    return reaction / DILUTION, substrate + reaction / DILUTION


def _rest_on_catalyst(a: float, b: float) -> tuple[float, float]:
    """The feed at which both stay."""
    crowded = 1.0 + ADSORPTION[0] * a + ADSORPTION[1] * b
    reaction = TURNOVER * a * b / (crowded * crowded)
    return a + reaction / FLOW, b + reaction / FLOW


def _inhibited_task(_: Machine) -> Task:
    product, feed = _rest_of_inhibited(0.3)
    wanted, _more = _rest_of_inhibited(0.7)
    family = PID(
        axes=[("product", None)],
        gains={"product.kp": (0.0, 8.0), "product.ki": (0.0, 3.0), "product.kd": 0.0},
        output=about_rest(feed),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[0.3, product],
        target=[0.7, wanted],
        duration=20.0,
        first={"product.kp": 0.3, "product.ki": 0.02},
        weights={"substrate": 0.0},
    )


def _catalyst_task(_: Machine) -> Task:
    family = PID(
        axes=[("a", None), ("b", None)],
        gains={
            "a.kp": (0.0, 20.0),
            "a.ki": (0.0, 20.0),
            "a.kd": 0.0,
            "b.kp": (0.0, 20.0),
            "b.ki": (0.0, 20.0),
            "b.kd": 0.0,
        },
        output=about_rest(*_rest_on_catalyst(0.5, 0.8)),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[0.5, 0.8],
        target=[1.2, 0.6],
        duration=8.0,
        first={"a.kp": 3.0, "a.ki": 2.5, "b.kp": 3.0, "b.ki": 2.5},
    )


HALDANE = Plant(
    "reactor-inhibited",
    "reactor, inhibited by its substrate",
    lambda seed: Machine(INHIBITED, Mechanism(runge_kutta(inhibited)), [4e-3, 8e-3], seed),
    _inhibited_task,
)
LANGMUIR = Plant(
    "reactor-catalyst",
    "reactor, two species on a catalyst",
    lambda seed: Machine(CATALYST, Mechanism(runge_kutta(on_catalyst)), [3e-3, 3e-3], seed),
    _catalyst_task,
)

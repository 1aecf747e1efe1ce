"""Autonomous systems of textbooks, with two initial states each: equations as text, constants inside.

Written from general knowledge of the field (Strogatz, *Nonlinear dynamics and chaos*; Murray, *Mathematical biology*;
and the papers that the systems are named after).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class System(NamedTuple):
    """Derivatives by state, an initial state to learn from and one to test on, and how long both runs are, s.

    `angles` are states in rad; `rates` names, for states that are declared derivatives, what they are derivatives of.
    """

    equations: dict[str, str]
    learnt: tuple[float, ...]
    tested: tuple[float, ...]
    length: float = 10.0
    angles: tuple[str, ...] = ()
    rates: Mapping[str, str] = MappingProxyType({})


TEXTBOOK = {
    "RC circuit": System({"q": "0.3 - 0.4*q"}, (10.0,), (3.5,)),
    "logistic growth": System({"x": "0.8*x - 0.0107*x**2"}, (7.3,), (21.0,)),
    "Allee effect": System({"x": "0.3*x**2 - 0.2*x - 0.1*x**3"}, (1.4,), (1.2,), 20.0),
    "critical slowing": System({"x": "-0.12*x**3"}, (3.4,), (1.6,)),
    "laser": System({"n": "1.8*n - 0.1*n**2"}, (0.5,), (31.0,)),
    "falling body": System({"v": "9.81 - 0.0021*v**2"}, (0.5,), (73.0,)),
    "budworm": System({"x": "0.78*x - 0.0096*x**2 - 2.1*x**2/(x**2 + 449.4)"}, (2.8,), (62.0,)),
    "harvested fish": System({"x": "0.4*x - 0.004*x**2 - 0.24*x/(x + 50)"}, (21.1,), (44.1,)),
    "gene switch": System({"x": "0.05 + 1.5*x**2/(1 + x**2) - 0.7*x"}, (0.3,), (4.2,), 15.0),
    "uptake": System({"s": "-1.2*s/(s + 0.6)"}, (5.0,), (2.5,), 6.0),
    "harmonic oscillator": System({"x": "v", "v": "-2.1*x"}, (0.4, -0.03), (0.0, 0.2)),
    "damped oscillator": System({"x": "v", "v": "-4.5*x - 0.43*v"}, (0.12, 0.043), (0.0, -0.3)),
    "Lotka-Volterra": System({"x": "1.2*x - 0.4*x*y", "y": "0.1*x*y - 0.8*y"}, (5.0, 2.0), (8.0, 4.3)),
    "competition": System({"x": "3*x - x**2 - 2*x*y", "y": "2*y - x*y - y**2"}, (2.3, 1.3), (4.1, 0.6)),
    "pendulum": System({"a": "w", "w": "-0.9*sin(a)"}, (-1.9, 0.4), (1.3, 0.8)),
    "damped pendulum": System({"a": "w", "w": "-4.2*sin(a) - 0.35*w"}, (2.4, 0.0), (-1.5, 1.0)),
    "epidemic": System({"s": "-0.004*s*i", "i": "0.004*s*i - 0.9*i"}, (470.0, 12.0), (900.0, 7.0)),
    "double well": System({"x": "v", "v": "x - x**3 - 0.18*v"}, (-1.8, -1.8), (5.8e-1, 1.2), 15.0),
    "glider": System({"v": "-0.2*v**2 - sin(a)", "a": "v - cos(a)/v"}, (3.0, 0.7), (2.2, 0.3), 5.0),
    "van der Pol": System({"x": "v", "v": "-x + 0.43*v - 0.43*x**2*v"}, (2.2, 0.0), (0.1, 3.2)),
    "glycolysis": System({"x": "-x + 0.08*y + x**2*y", "y": "0.6 - 0.08*y - x**2*y"}, (0.4, 0.31), (0.2, 1.4), 15.0),
    "Duffing": System({"x": "v", "v": "-0.5*x - 0.8*x**3 - 0.1*v"}, (1.5, 0.3), (-0.9, 1.9)),
    "Brusselator": System({"x": "1 - 4*x + x**2*y", "y": "3*x - x**2*y"}, (0.7, 1.0), (2.1, 1.3)),
    "grazed prey": System(
        {"x": "x - 0.2*x**2 - x*y/(1 + x)", "y": "0.8*x*y/(1 + x) - 0.4*y"}, (2.0, 1.0), (1.2, 2.1), 25.0
    ),
    "Lorenz": System(
        {"x": "10*y - 10*x", "y": "28*x - x*z - y", "z": "x*y - 2.667*z"}, (2.3, 8.1, 12.4), (9.0, 9.0, 29.0), 3.0
    ),
    "Roessler": System(
        {"x": "-y - z", "y": "x + 0.2*y", "z": "0.2 + x*z - 5.7*z"}, (2.3, 1.1, 0.8), (-0.1, 4.1, -2.1), 12.0
    ),
    "Euler's body": System(
        {"p": "0.5*q*r", "q": "-1.2*p*r", "r": "0.4*p*q"}, (1.0, 0.2, 0.7), (0.3, 1.1, -0.5)
    ),
    "Maxwell-Bloch": System(
        {"e": "0.1*p - 0.1*e", "p": "0.21*e*d - 0.21*p", "d": "1.054 - 0.34*d - 0.34*e*p"},
        (1.3, 1.1, 0.89), (0.1, 1.3, -0.2), 20.0,
    ),
    "compartments": System(
        {"a": "-0.6*a + 0.1*b", "b": "0.6*a - 0.5*b", "c": "0.4*b - 0.15*c"}, (5.0, 0.5, 0.2), (0.5, 4.0, 2.0)
    ),
    "Chen-Lee": System(
        {"x": "5*x - y*z", "y": "-10*y + x*z", "z": "-3.8*z + 0.3333*x*y"},
        (15.0, -15.0, -15.0), (8.0, 14.0, -10.0), 4.0
    ),
}  # fmt: skip

TUNED = tuple(sorted(TEXTBOOK)[::2])
"""The half that the identification may be tuned on."""
REPORTED = tuple(sorted(TEXTBOOK)[1::2])
"""The half that is reported."""

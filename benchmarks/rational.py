"""Autonomous systems whose laws are quotients, with two initial states each: saturation, and joints that share a mass.

Written from general knowledge of the field (Murray, *Mathematical biology*; Smith and Waltman, *The theory of the
chemostat*; Cornish-Bowden, *Fundamentals of enzyme kinetics*; Spong, *Robot modeling and control*). Those of machines
are of links without motors: what a motor adds to them is a term more above the line.
"""

from textbook import System

_CART = "(1 + 0.5*sin(a)**2)"
_ARM = "(0.18 - 0.0625*cos(b)**2)"
_TWO = "(1 - 0.5*cos(a - b)**2)"
_FURUTA = "(0.12*(0.3 + 0.12*sin(a)**2) - 0.0144*cos(a)**2)"
_SWEEP = "(0.24*sin(a)*cos(a)*P*w - 0.12*sin(a)*w**2 + 0.02*P)"
"""What bends a Furuta pendulum's arm, with the sign turned."""
_SWING = "(0.12*sin(a)*cos(a)*P**2 - 1.18*sin(a) - 0.01*w)"

RATIONAL = {
    "substrate and product": System(
        {"s": "-1.5*s/(0.8 + s)", "p": "1.5*s/(0.8 + s) - 0.3*p"}, (5.0, 0.2), (3.1, 1.4), 8.0
    ),
    "repression": System({"p": "2/(1 + p**4) - 0.5*p"}, (4.0,), (0.1,), 8.0),
    "toggle": System(
        {"u": "3/(1 + v**2) - u", "v": "3/(1 + u**2) - v"}, (0.2, 0.4), (2.0, 1.7), 8.0
    ),
    "repressilator": System(
        {"x": "4/(1 + z**4) - x", "y": "4/(1 + x**4) - y", "z": "4/(1 + y**4) - z"},
        (0.2, 1.0, 2.0), (1.5, 0.3, 0.6), 15.0,
    ),
    "chemostat": System(
        {"s": "1.6 - 0.4*s - 1.8*s*x/(0.7 + s)", "x": "0.9*s*x/(0.7 + s) - 0.4*x"}, (4.0, 0.2), (2.0, 1.0), 15.0
    ),
    "inhibited growth": System(
        {"s": "-1.2*s*x/(0.5 + s + 0.2*s**2)", "x": "0.6*s*x/(0.5 + s + 0.2*s**2)"}, (6.0, 0.3), (4.0, 0.5), 12.0
    ),
    "Holling II": System(
        {"x": "1.5*x - 0.3*x**2 - 1.2*x*y/(0.8 + x)", "y": "0.9*x*y/(0.8 + x) - 0.5*y"}, (2.0, 1.0), (0.8, 2.0), 25.0
    ),
    "Holling III": System(
        {"x": "x - 0.2*x**2 - 1.3*x**2*y/(1 + x**2)", "y": "0.7*x**2*y/(1 + x**2) - 0.3*y"},
        (3.0, 0.5), (1.0, 1.5), 25.0,
    ),
    "Holling IV": System(
        {"x": "x - 0.2*x**2 - 2*x*y/(1 + x + 0.6*x**2)", "y": "1.3*x*y/(1 + x + 0.6*x**2) - 0.3*y"},
        (0.5, 0.2), (1.0, 1.0), 40.0,
    ),
    "Beddington": System(
        {"x": "x - 0.2*x**2 - 1.4*x*y/(1 + x + 0.5*y)", "y": "0.9*x*y/(1 + x + 0.5*y) - 0.4*y"},
        (4.0, 0.4), (1.0, 2.0), 25.0,
    ),
    "shared prey": System(
        {"x": "x - 0.25*x**2 - 1.1*x*y/(x + y)", "y": "0.9*x*y/(x + y) - 0.4*y"}, (3.0, 0.4), (1.0, 1.0), 15.0
    ),
    "saturating growth": System({"x": "1.4*x/(1 + 0.5*x) - 0.4*x"}, (0.1,), (9.0,), 12.0),
    "phosphorylation": System({"x": "(1 - x)/(1.2 - x) - 0.7*x/(0.3 + x)"}, (0.02,), (0.97,), 6.0),
    "cascade": System(
        {"a": "0.3 - 1.1*a/(0.6 + a)", "b": "1.1*a/(0.6 + a) - 0.8*b/(0.4 + b)", "c": "0.8*b/(0.4 + b) - 0.25*c"},
        (4.0, 0.2, 0.1), (2.0, 1.0, 0.5), 12.0,
    ),
    "steep switch": System({"x": "0.1 + 1.6*x**4/(1 + x**4) - 0.4*x"}, (0.6,), (5.5,), 12.0),
    "quota": System(
        {
            "n": "0.6 - 0.2*n - 1.2*n*x/(0.5 + n)",
            "q": "1.2*n/(0.5 + n) - q + 0.4",
            "x": "0.8*x - 0.4*x/q",
        },
        (3.0, 0.6, 0.1), (2.0, 1.0, 0.3), 12.0,
    ),
    "competing inhibitor": System(
        {"s": "-2*s/(1 + s + 1.5*i)", "i": "-0.3*i"}, (4.0, 3.0), (5.0, 1.0), 8.0
    ),
    "saturated epidemic": System(
        {"s": "-0.9*s*i/(1 + 0.8*i)", "i": "0.9*s*i/(1 + 0.8*i) - 0.35*i"}, (4.0, 0.1), (3.0, 0.4), 12.0
    ),
    "Goodwin": System(
        {"x": "3/(1 + z**4) - 0.6*x", "y": "x - 0.6*y", "z": "y - 0.6*z"}, (0.1, 0.2, 1.5), (1.0, 0.5, 0.2), 15.0
    ),
    "electrostatic drive": System(
        {"x": "v", "v": "-4*x - 0.3*v + 0.4/(1 - x)**2"}, (0.45, 0.0), (0.1, 0.5), 10.0
    ),
    "Higgins": System(
        {"x": "0.6 - x*y**2", "y": "x*y**2 - 2*y/(2 + y)"}, (1.5, 0.5), (0.8, 1.2), 20.0
    ),
    "Lengyel-Epstein": System(
        {"x": "10 - x - 4*x*y/(1 + x**2)", "y": "2*x - 2*x*y/(1 + x**2)"}, (1.0, 3.0), (3.0, 6.0), 8.0
    ),
    "saturated gain": System(
        {"g": "1.5 - 0.3*g - g*n/(1 + 0.4*n)", "n": "g*n/(1 + 0.4*n) - 0.8*n"}, (3.0, 0.1), (1.0, 2.0), 15.0
    ),
    "stirred reactor": System(
        {"c": "0.5 - 0.5*c - 4*c*exp(-3/T)", "T": "0.5 - 0.5*T + 5*c*exp(-3/T)"}, (1.0, 1.0), (0.4, 2.0), 8.0
    ),
    "tube": System(
        {"x": "v", "v": "x*w**2 - 6*x - 0.4*v", "w": "(1 - 2*x*v*w - 0.3*w)/(0.5 + x**2)"},
        (0.7, 0.0, 1.5), (-0.4, 1.0, 0.5), 6.0, rates={"v": "x"},
    ),
    "elastic pendulum": System(
        {"r": "v", "v": "r*w**2 - 30*r + 30 + 9.81*cos(a) - 0.1*v", "a": "w", "w": "(-2*v*w - 9.81*sin(a))/r"},
        (1.2, 0.0, 1.2, 0.0), (1.5, 0.5, -0.8, 0.4), 4.0, angles=("a",), rates={"v": "r", "w": "a"},
    ),
    "cart and pendulum": System(
        {
            "x": "v",
            "v": f"(0.3*w**2*sin(a) + 4.905*sin(a)*cos(a) - 0.4*v)/{_CART}",
            "a": "w",
            "w": f"-(0.5*w**2*sin(a)*cos(a) + 24.525*sin(a) - 0.667*v*cos(a))/{_CART}",
        },
        (0.0, 0.5, 2.2, 0.0), (0.0, 0.0, -1.3, 3.0), 4.0, angles=("a",), rates={"v": "x", "w": "a"},
    ),
    "two-link arm": System(
        {
            "a": "w",
            "w": f"(0.3*(0.25*sin(b)*(2*w*W + W**2) - 0.05*w) - (0.3 + 0.25*cos(b))*(-0.25*sin(b)*w**2 - 0.05*W))"
            f"/{_ARM}",
            "b": "W",
            "W": "((0.9 + 0.5*cos(b))*(-0.25*sin(b)*w**2 - 0.05*W)"
            f" - (0.3 + 0.25*cos(b))*(0.25*sin(b)*(2*w*W + W**2) - 0.05*w))/{_ARM}",
        },
        (0.0, 3.0, 0.5, -4.0), (0.5, -2.0, 1.5, 5.0), 3.0, angles=("a", "b"), rates={"w": "a", "W": "b"},
    ),
    "double pendulum": System(
        {
            "a": "w",
            "w": "(-0.5*sin(a - b)*cos(a - b)*w**2 - 0.5*sin(a - b)*W**2 - 9.81*sin(a) + 4.905*cos(a - b)*sin(b))"
            f"/{_TWO}",
            "b": "W",
            "W": "(sin(a - b)*w**2 + 0.5*sin(a - b)*cos(a - b)*W**2 + 9.81*cos(a - b)*sin(a) - 9.81*sin(b))"
            f"/{_TWO}",
        },
        (1.4, 0.0, 2.0, 0.0), (-1.0, 1.0, 0.6, -2.0), 3.0, angles=("a", "b"), rates={"w": "a", "W": "b"},
    ),
    "Furuta": System(
        {
            "p": "P",
            "P": f"(-0.12*{_SWEEP} - 0.12*cos(a)*{_SWING})/{_FURUTA}",
            "a": "w",
            "w": f"((0.3 + 0.12*sin(a)**2)*{_SWING} + 0.12*cos(a)*{_SWEEP})/{_FURUTA}",
        },
        (0.0, 3.0, 2.0, 0.0), (0.0, -2.0, -1.0, 4.0), 3.0, angles=("p", "a"), rates={"P": "p", "w": "a"},
    ),
}  # fmt: skip

RATIONAL_TUNED = tuple(sorted(RATIONAL)[::2])
"""The half that the identification may be tuned on."""
RATIONAL_REPORTED = tuple(sorted(RATIONAL)[1::2])
"""The half that is reported."""

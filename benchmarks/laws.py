"""Laws of textbooks: learnt from one run, tested on another; how many equations and systems come right.

A system is right where the worst of its states is followed from the second initial state, free, with R² > 0.999; an
equation where, multiplied out, it has the terms of the truth and no others.
"""

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import twinloop as tl
from rational import RATIONAL, RATIONAL_REPORTED, RATIONAL_TUNED
from textbook import REPORTED, TEXTBOOK, TUNED
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.law.exports.symbolic import sympy_source
from twinloop.law.law import Law

STEPS = 149
FOLLOWED = 0.999
NOTHING = 1e-4
"""Share of the largest coefficient below which a term is rounding."""
SMOKE = ("RC circuit", "Lotka-Volterra", "cart and pendulum")
SYSTEMS = {**TEXTBOOK, **RATIONAL}
HALVES = {
    "textbook": {"tuned": TUNED, "reported": REPORTED, "both": tuple(sorted(TEXTBOOK))},
    "rational": {"tuned": RATIONAL_TUNED, "reported": RATIONAL_REPORTED, "both": tuple(sorted(RATIONAL))},
}
"""Names of systems by their kind, and by whether the identification may be tuned on them."""


def run_of(system, start):
    """States at each period (STEPS + 1, n_x), from equations integrated to rounding."""
    symbols = [sp.Symbol(name, real=True) for name in system.equations]
    names = {symbol.name: symbol for symbol in symbols}
    slopes = [sp.sympify(text, locals=names) for text in system.equations.values()]
    slope = sp.lambdify(symbols, slopes, "numpy")
    times = np.linspace(0.0, system.length, STEPS + 1)
    found = solve_ivp(
        lambda t, x: np.array(slope(*x), dtype=float),
        times[[0, -1]],
        start,
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-13,
    )
    return found.y.T


def signals_of(system, states):
    scales = np.abs(states).max(axis=0)
    return tl.Signals(
        states=[
            tl.State(name, _unit(system, name), float(s), derivative_of=system.rates.get(name))
            for name, s in zip(system.equations, scales, strict=True)
        ],
        commands=[tl.Command("idle", "1", (0.0, 1.0))],
        dt=system.length / STEPS,
    )


def _unit(system, name):
    if name in system.angles:
        return "rad"
    of = system.rates.get(name)
    return "1" if of is None else f"{_unit(system, of)}/s"


def right(found, truth):
    """Whether an equation has the terms of the true one."""
    return _terms(found) == _terms(truth)


def _terms(expression):
    """Terms above and below the line, without their coefficients; of sines at most the first power."""
    sides = []
    for side in sp.fraction(sp.together(_unsquared(sp.expand(expression)))):
        side = _unsquared(side)
        parts = [term.as_coeff_Mul() for term in sp.Add.make_args(sp.expand(side))]
        largest = max(abs(c) for c, _ in parts)
        sides.append(frozenset(term for c, term in parts if abs(c) > NOTHING * largest))
    return tuple(sides)


def _unsquared(expression):
    """Sums of angles multiplied out, and squares of sines as 1 less those of cosines."""
    expanded = sp.expand(sp.expand_trig(expression))
    return sp.expand(
        expanded.replace(
            lambda part: (
                part.is_Pow and isinstance(part.base, sp.sin) and part.exp.is_Integer and part.exp > 1
            ),
            lambda part: (
                part.base ** (part.exp % 2) * (1 - sp.cos(part.base.args[0]) ** 2) ** (part.exp // 2)
            ),
        )
    )


def learnt(name, noise, changes, seed=0):
    """What is learnt of one system, and how good it is."""
    system = SYSTEMS[name]
    clean = run_of(system, system.learnt)
    signals = signals_of(system, clean)
    random = np.random.default_rng([seed, *name.encode()])
    readings = clean + noise * clean.std(axis=0) * random.standard_normal(clean.shape)
    nothing = np.zeros((STEPS, 1))
    begun = time.process_time()
    options = options_of("default", changes)
    found = identify_runs([Run.of(readings, nothing)], signals, options, seed=seed, workers=_core.Workers(1))
    seconds = time.process_time() - begun
    law = Law.of(found.model, signals)
    script: dict[str, Any] = {}
    exec(sympy_source(law), script)  # the package's own text
    locals_ = {symbol.name: symbol for symbol in script["STATES"]}
    truths = [sp.sympify(text, locals=locals_) for text in system.equations.values()]
    idle = {symbol: 0 for symbol in script["COMMANDS"]}
    equations = [equation.subs(idle) for equation in script["EQUATIONS"]]
    return {
        "system": name,
        "noise": noise,
        "form": found.model.form,
        "right": [right(*pair) for pair in zip(equations, truths, strict=True)],
        "r2": followed(found.model, run_of(system, system.tested)),
        "seconds": seconds,
        "equations": [str(sp.N(equation, 4)) for equation in equations],
        "remarks": [remark.sentence for remark in found.remarks],
    }


def followed(model, states):
    """R² of a free run, of the state that it follows worst."""
    at, rows = states[:1], [states[0]]
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            at = model.step(at, np.zeros((1, 1)))
            rows.append(at[0])
        left = np.square(np.array(rows) - states).sum(axis=0)
        r2 = float((1.0 - left / np.square(states - states.mean(axis=0)).sum(axis=0)).min())
    return r2 if np.isfinite(r2) else -np.inf


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--smoke", action="store_true", help="two systems, a short search: does it run")
    parser.add_argument("--half", choices=["tuned", "reported", "both"], default="reported")
    parser.add_argument("--kind", choices=sorted(HALVES), default="textbook")
    parser.add_argument(
        "--noise", type=float, action="append", help="share of a state's deviation; 0 and 0.01"
    )
    parser.add_argument("--set", action="append", default=[], help="option=JSON of the preset `default`")
    parser.add_argument("--only", action="append", help="a system; may be repeated")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print every row")
    arguments = parser.parse_args()
    names = arguments.only or (SMOKE if arguments.smoke else HALVES[arguments.kind][arguments.half])
    changes = {key: json.loads(value) for key, _, value in (text.partition("=") for text in arguments.set)}
    if arguments.smoke:
        changes = {"moves": 1000, "starts": 1, "generations": 0, "committee_size": 2, **changes}
    work = [
        (name, noise, changes, seed)
        for noise in arguments.noise or (0.0, 0.01)
        for name in names
        for seed in range(arguments.seeds)
    ]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        rows = []
        for row in pool.map(learnt, *zip(*work, strict=True)):
            rows.append(row)
            if arguments.json:
                print(json.dumps(row), flush=True)
            else:
                marks = "".join("+" if well else "-" for well in row["right"])
                print(
                    f"{row['noise']:<6g}{row['system']:22}{row['form']:14}{marks:5}R2 {row['r2']:<12.6g}"
                    f"{row['seconds']:6.1f} s", flush=True,
                )  # fmt: skip
                for well, text in zip(row["right"], row["equations"], strict=True):
                    if not well:
                        print(f"        {text[:150]}", flush=True)
    for noise in dict.fromkeys(row["noise"] for row in rows):
        at = [row for row in rows if row["noise"] == noise]
        equations = [well for row in at for well in row["right"]]
        well = sum(row["r2"] > FOLLOWED for row in at)
        print(
            f"noise {noise:g}: equations {sum(equations)} of {len(equations)}, systems {well} of {len(at)}, median R2"
            f" {np.median([row['r2'] for row in at]):.6g}, median {np.median([row['seconds'] for row in at]):.1f} s",
            file=sys.stderr,
        )  # fmt: skip


if __name__ == "__main__":
    main()

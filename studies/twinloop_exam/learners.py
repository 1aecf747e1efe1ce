"""Who sits the exam, by name, each with its settings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace

from twinloop.errors import unknown
from twinloop_exam.ablations import ABLATIONS, NO_PRIOR, SMOKE_OPTIONS, TEST_KINDS
from twinloop_exam.kinds import Campaigner, Fitter, Flyer, Learner, Optimum, Tuner

VERSION = 1
"""Of the exam's measures; a higher one makes all rows in a store count as not measured."""

# Hyper-parameters were chosen by `twinloop bench power --tune --data random-gains`, seeds 0 to 9 of the
# system "quadrotor": the first of each table. The grid of operon was run on seeds 0 to 2 only, for its cost.
_RIDGES = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
_SPARSE = {"threshold": (0.3, 1.0, 3.0, 10.0), "alpha": (1e-2, 1.0, 10.0, 100.0)}
_SPARSE_INTEGRAL = {"threshold": (0.03, 0.1, 0.3), "alpha": (1e-8, 1e-7, 1e-6, 1e-5)}
_RIDGE_REGRESSION = (
    "ridge regression on all monomials to degree 2 in rates and commands (36 on the quadrotor)"
)
_FITTERS: tuple[Fitter, ...] = (
    Fitter(
        "least-squares",
        "least_squares",
        {"form": "increment", "ridge": 1e-6, "variables": "rates"},
        grid={"ridge": _RIDGES},
        what=_RIDGE_REGRESSION,
    ),
    Fitter(
        "least-squares-integral",
        "least_squares",
        {"form": "integral", "ridge": 1e-9, "variables": "rates"},
        grid={"ridge": _RIDGES},
        what=f"{_RIDGE_REGRESSION}, in the integral form",
    ),
    *(
        Fitter(
            name,
            "sindy",
            {
                "form": "integral" if name.endswith("integral") else "derivative",
                "threshold": threshold,
                "alpha": alpha,
                "ensemble": 20 if "ensemble" in name else 0,
                "variables": "rates",
            },
            package="pysindy",
            seconds=0.7 if "ensemble" in name else 0.2,
            grid=_SPARSE_INTEGRAL if name.endswith("integral") else _SPARSE,
            what=what,
        )
        for name, threshold, alpha, what in (
            ("sindy-stlsq", 1.0, 100.0, "PySINDy as its documentation has it"),
            ("sindy-stlsq-integral", 0.1, 1e-6, "PySINDy's optimiser on our integral rows"),
            ("sindy-ensemble", 1.0, 100.0, "PySINDy as its documentation has it, an ensemble"),
            ("sindy-ensemble-integral", 0.1, 1e-6, "an ensemble of PySINDy's optimiser on our integral rows"),
        )
    ),
    Fitter(
        "operon",
        "operon",
        {"window": 3, "evaluations": 50_000, "length": 60, "variables": "rates"},
        package="pyoperon",
        seconds=10.0,
        experiments=(1, 2, 4),
        grid={"window": (1, 3, 5, 9)},
        what="pyoperon on accelerations averaged over a window",
    ),
)
_TUNERS = (
    Tuner(
        "gp-bo",
        "gaussian_process",
        {"acquisition": "ucb", "random": 0},
        "bayes_opt",
        seconds=0.4,
        grid={"acquisition": ("ei", "ucb"), "random": (0, 3)},
        what="a Gaussian process on the gains alone, tuned on the system itself, C0 first",
    ),
    Tuner(
        "cma-es",
        "cma_es",
        {"step": 0.3},
        "cmaes",
        grid={"step": (0.1, 0.2, 0.3, 0.5)},
        what="the same by CMA-ES",
    ),
    Tuner(
        "optuna-tpe",
        "tree_parzen",
        {"random": 15},
        "optuna",
        grid={"random": (3, 5, 10, 15)},
        what="the same by Optuna",
    ),
)
_IN_EVERY_TABLE = {"libraries": "ours-evolved", **{f"{kind}-tests": f"ours-{kind}" for kind in TEST_KINDS}}
"""Ablations that are measured as the preset itself is, and who they are then."""
_CAMPAIGNERS = (
    Campaigner("ours", "default", experiments=10, longer={"quadrotor": 20}, what="the preset `default`"),
    Campaigner("ours-model", "default", arguments={"goal": "model"}, what="flights for the model alone"),
    Campaigner(
        "ours-control", "default", arguments={"goal": "control"}, what="flights for the controller alone"
    ),
    *(
        Campaigner(who, "default", ABLATIONS[name].options, what=f"without {ABLATIONS[name].without}")
        for name, who in _IN_EVERY_TABLE.items()
    ),
    Campaigner(
        "ours-no-prior", "default", NO_PRIOR, what="without libraries, and nothing known of derivatives"
    ),
    *(
        Campaigner(f"without-{name}", "default", each.options, experiments=2, what=f"without {each.without}")
        for name, each in ABLATIONS.items()
        if name not in _IN_EVERY_TABLE
    ),
    Campaigner("paper", "paper", {"model_generations": 1000}, seconds=5.0, what="the preset `paper`"),
)

_ALL: tuple[Learner, ...] = (
    *_CAMPAIGNERS,
    Flyer("random-gains", what="Υ0 and gains uniform in their box, for tuning the fits"),
    *_FITTERS,
    *_TUNERS,
    Optimum(
        "optimum",
        patient={name: 2000 for name in ("quadrotor-0", "quadrotor", "quadrotor-noisy")},
        what="CMA-ES on the true system, several starts; not a learner, a bar",
    ),
)

LEARNERS: dict[str, Learner] = {who.name: who for who in _ALL}
"""Who sits the exam, by name."""


def learner(name: str) -> Learner:
    """One who sits the exam.

    Args:
        name: of the learner.

    Raises:
        InvalidInput: an unknown name.
    """
    if name not in LEARNERS:
        raise unknown("learner", name, LEARNERS)
    return LEARNERS[name]


def _fewer(settings: Mapping[str, object], **most: int) -> dict[str, int]:
    """Those of a learner's counts that are larger than these."""
    counts = ((name, settings.get(name), limit) for name, limit in most.items())
    return {name: limit for name, count, limit in counts if isinstance(count, int) and count > limit}


def for_smoke(who: Learner) -> Learner:
    """The same learner with so little to do that nothing is learnt.

    Args:
        who: the learner.

    Returns:
        A copy.
    """
    match who:
        case Campaigner():
            options = {**who.options, **SMOKE_OPTIONS[who.preset]}
            return replace(who, options=options, experiments=1, longer={}, seconds=0.3)
        case Flyer():
            return replace(who, experiments=1)
        case Fitter():
            settings = {**who.settings, **_fewer(who.settings, evaluations=2000, ensemble=2)}
            return replace(who, settings=settings, experiments=(0, 1), seconds=min(who.seconds, 1.0))
        case Tuner():
            return replace(who, flights=4)
        case Optimum():
            return replace(who, flights=20, starts=1, draws=2, patient={}, seconds=1.0)


def key(who: Learner, data: Learner | None = None) -> str:
    """What makes rows of a store comparable: all settings of a learner, in a few characters.

    Args:
        who: the learner.
        data: the learner whose flights a fit is made on.

    Returns:
        12 hexadecimal digits; equal settings have equal ones.
    """
    # What an exam costs, where it is judged, and how it is described, changes no number of a row.
    chosen = {
        name: value
        for name, value in asdict(who).items()
        if name not in ("seconds", "experiments", "longer", "grid", "package", "what")
    }
    settings: dict[str, object] = {"version": VERSION, "kind": type(who).__name__, "learner": chosen}
    if isinstance(who, Fitter) and data is not None:
        settings["flights"] = key(data)
    text = json.dumps(settings, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:12]

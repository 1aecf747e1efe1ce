"""The one table of what is switched off or changed in ours: a name, and options of the preset."""

from __future__ import annotations

from collections.abc import Mapping

ABLATIONS: dict[str, Mapping[str, object]] = {
    "annealing": {"moves": 100, "starts": 1},
    "ladder": {"libraries": ("linear", "quadratic", "damping")},
    "directions": {"directions": False},
    "evolution": {"generations": 0},
    "parts": {"parts": False},
    "tuning": {"tuning": False},
    "second-pass": {"passes": 1},
    "lags": {"lags": False},
    "hidden": {"hidden": False},
    "noise-from-above": {"noise_from_above": False},
    "gusts": {"gusts": False},
    "disturbance-price": {"price_disturbances": False},
    "implicit": {"implicit": False},
    "contacts": {"contacts": False},
    "offsets": {"offsets": False},
    "hold-back": {"hold_back": False},
    "excitation": {"excitation": 0.0, "excitation_most": 0.0},
    "committee": {"committee_size": 1, "tuning_members": 1},
    "noise-draws": {"draws": 1},
    "starts": {"tuning_starts": 1},
}
"""Each idea of the preset `default` switched off: name → options. Studied at k ≤ 2 with 10 seeds."""

TEST_KINDS = ("random", "chirp", "prbs")
"""Same learner, other flights: values of the option `tests` beside "ask"."""

LIBRARIES_OFF: Mapping[str, object] = {"libraries": ()}
"""Evolved programs only: a column of every table."""

NO_PRIOR: Mapping[str, object] = {"form": "increment", **LIBRARIES_OFF}
"""Nothing is known of derivatives either."""

SMOKE_OPTIONS: dict[str, Mapping[str, object]] = {
    "paper": {
        "model_population": 20,
        "model_generations": 10,
        "test_population": 10,
        "test_generations": 4,
        "committee_size": 6,
        "mutants": 3,
    },
    "default": {
        "libraries": ("linear", "quadratic"),
        "generations": 1,
        "population": 70,
        "moves": 500,
        "starts": 1,
        "contacts": False,
        "friction": False,
        "lags": False,
        "hidden": False,
        "parts": False,
        "passes": 1,
        "committee_size": 3,
        "candidates": 16,
        "draws": 2,
        "evaluations": 128,
        "tuning_starts": 1,
    },
}
"""Options that make a preset fast and useless, for `--smoke`, by preset."""

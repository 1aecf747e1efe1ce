"""The one table of what is switched off or changed in ours: a name, and options of the preset."""

from __future__ import annotations

from collections.abc import Mapping

ABLATIONS: dict[str, Mapping[str, object]] = {}
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
    "default": {},
}
"""Options that make a preset fast and useless, for `--smoke`, by preset."""

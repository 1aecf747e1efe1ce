"""Who sits the exam, by name: ours, the paper's, fits to the same flights, optimisers of gains."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Protocol

from twinloop import _core
from twinloop.errors import InvalidInput, unknown
from twinloop.exam.ablations import ABLATIONS, LIBRARIES_OFF, NO_PRIOR, SMOKE_OPTIONS, TEST_KINDS
from twinloop.presets import options_of
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

VERSION = 1
"""Of the exam's measures; a higher one makes all rows in a store count as not measured."""


@dataclass(frozen=True)
class Campaigner:
    """A campaign: asks for its own flights, learns a twin, gives a controller.

    Args:
        name: of the learner.
        preset: of the campaign.
        options: of the preset that differ.
        arguments: of `Campaign` beside those that every preset takes.
        experiments: after Υ0, by default; more on the systems in `longer`.
        longer: experiments by system where they differ.
        seconds: guess of what one experiment costs, on one core.
    """

    name: str
    preset: str
    options: Mapping[str, object] = field(default_factory=dict)
    arguments: Mapping[str, object] = field(default_factory=dict)
    experiments: int = 4
    longer: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 20.0

    def why_missing(self) -> str | None:
        """Why it cannot be run in this version; None if it can."""
        try:
            options_of(self.preset, self.options)
        except InvalidInput as reason:
            return str(reason)
        return None


@dataclass(frozen=True)
class Flyer:
    """Υ0, then gains uniform in their box: flights that no learner chose, for tuning the fits.

    Args:
        name: of the learner.
        experiments: after Υ0.
        seconds: guess of what one experiment costs.
    """

    name: str
    experiments: int = 6
    seconds: float = 0.1

    def why_missing(self) -> str | None:
        """It needs nothing."""
        return None


@dataclass(frozen=True)
class Fitter:
    """A regression on flights that somebody else chose.

    Args:
        name: of the learner.
        module: of this package that has its `fit`.
        settings: its hyper-parameters.
        package: that it needs; empty: none.
        seconds: guess of what one fit costs, on one core.
        experiments: numbers of flights after Υ0 at which it is judged.
        grid: values that `--tune` tries for each hyper-parameter.
    """

    name: str
    module: str
    settings: Mapping[str, object]
    package: str = ""
    seconds: float = 0.2
    experiments: Sequence[int] = (0, 1, 2, 4, 10, 20)
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)

    def why_missing(self) -> str | None:
        """Why it cannot be run here; None if it can."""
        return _needs(self.package)

    def fit(self, trajectories: Sequence[Trajectory], signals: Signals, seed: int) -> _core.Model:
        """Learns a model.

        Args:
            trajectories: flights as measured.
            signals: of the system.
            seed: of what is random in it.

        Returns:
            A model that can be flown in closed loop.
        """
        method: _Fit = importlib.import_module(f"twinloop.exam.{self.module}").fit
        return method(trajectories, signals, self.settings, seed)


@dataclass(frozen=True)
class Tuner:
    """An optimiser of gains on the system itself; it learns no twin.

    Args:
        name: of the learner.
        method: a function of `twinloop.exam.tuners`.
        settings: its hyper-parameters.
        package: that it needs.
        flights: on the system, the first controller included.
        seconds: guess of what one flight costs.
        grid: values that `--tune` tries for each hyper-parameter.
    """

    name: str
    method: str
    settings: Mapping[str, object]
    package: str
    flights: int = 20
    seconds: float = 0.2
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)

    def why_missing(self) -> str | None:
        """Why it cannot be run here; None if it can."""
        return _needs(self.package)


@dataclass(frozen=True)
class Optimum:
    """CMA-ES on the true system, the bar for controllers; it is no learner and flies as often as it likes.

    Args:
        name: of the row.
        flights: of each start; on noisy systems each stands for `draws` runs with the same fixed noise.
        starts: the first from C0, the others random.
        draws: of the noise.
        seconds: guess of what it costs.
    """

    name: str
    flights: int = 500
    starts: int = 4
    draws: int = 20
    seconds: float = 60.0

    def why_missing(self) -> str | None:
        """Why it cannot be run here; None if it can."""
        return _needs("cmaes")


Learner = Campaigner | Flyer | Fitter | Tuner | Optimum


class _Fit(Protocol):
    def __call__(
        self, trajectories: Sequence[Trajectory], signals: Signals, settings: Mapping[str, object], seed: int
    ) -> _core.Model: ...


def _needs(package: str) -> str | None:
    if not package or importlib.util.find_spec(package) is not None:
        return None
    return f"the package {package!r} is not installed: pip install 'twinloop[exam]'"


# Hyper-parameters were chosen on seeds 0 to 9 of the system "quadrotor", flights of "random-gains", k = 2, by
# `twinloop bench power --tune --data random-gains`: the lowest median over seeds of the 90th percentile of
# the held-out error, or of the quality after 20 flights.
_RIDGES = (1e-12, 1e-10, 1e-8, 1e-6, 1e-4)
_FITTERS = (
    Fitter(
        "least-squares",
        "least_squares",
        {"form": "increment", "ridge": 1e-6, "variables": "rates"},
        grid={"ridge": _RIDGES},
    ),
    Fitter(
        "least-squares-integral",
        "least_squares",
        {"form": "integral", "ridge": 1e-10, "variables": "rates"},
        grid={"ridge": _RIDGES},
    ),
    *(
        Fitter(
            f"sindy-{kind}{suffix}",
            "sindy",
            {
                "form": form,
                "threshold": threshold,
                "alpha": 1e-6,
                "ensemble": members,
                "variables": "rates",
            },
            package="pysindy",
            seconds=0.7 if members else 0.2,
            grid={"threshold": thresholds, "alpha": (1e-10, 1e-6, 1e-2)},
        )
        for kind, members in (("stlsq", 0), ("ensemble", 20))
        for suffix, form, threshold, thresholds in (
            ("", "derivative", 0.1, (0.01, 0.1, 0.3, 1.0)),
            ("-integral", "integral", 0.01, (0.001, 0.01, 0.03, 0.1)),
        )
    ),
    Fitter(
        "operon",
        "operon",
        {"window": 5, "evaluations": 100_000, "length": 60, "variables": "rates"},
        package="pyoperon",
        seconds=25.0,
        experiments=(1, 2, 4),
        grid={"window": (1, 5, 9), "length": (30, 60)},
    ),
)
_TUNERS = (
    Tuner(
        "gp-bo",
        "gaussian_process",
        {"acquisition": "ei", "random": 3},
        "bayes_opt",
        seconds=1.0,
        grid={"acquisition": ("ei", "ucb"), "random": (0, 3)},
    ),
    Tuner("cma-es", "cma_es", {"step": 0.2}, "cmaes", grid={"step": (0.1, 0.2, 0.3)}),
    Tuner("optuna-tpe", "tree_parzen", {"random": 5}, "optuna", grid={"random": (3, 5, 10)}),
)
_CAMPAIGNERS = (
    Campaigner("ours", "default", experiments=10, longer={"quadrotor": 20}),
    Campaigner("ours-model", "default", arguments={"goal": "model"}),
    Campaigner("ours-control", "default", arguments={"goal": "control"}),
    Campaigner("ours-evolved", "default", LIBRARIES_OFF),
    Campaigner("ours-no-prior", "default", NO_PRIOR),
    *(Campaigner(f"ours-{kind}", "default", {"tests": kind}) for kind in TEST_KINDS),
    *(
        Campaigner(f"without-{name}", "default", options, experiments=2)
        for name, options in ABLATIONS.items()
    ),
    Campaigner("paper", "paper", {"model_generations": 1000}, seconds=30.0),
)

_ALL: tuple[Learner, ...] = (
    *_CAMPAIGNERS,
    Flyer("random-gains"),
    *_FITTERS,
    *_TUNERS,
    Optimum("optimum"),
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
            settings = {**who.settings, **({"evaluations": 2000} if "evaluations" in who.settings else {})}
            return replace(who, settings=settings, experiments=(0, 1), seconds=min(who.seconds, 1.0))
        case Tuner():
            return replace(who, flights=4)
        case Optimum():
            return replace(who, flights=20, starts=1, draws=2, seconds=1.0)


def key(who: Learner, data: Learner | None = None) -> str:
    """What makes rows of a store comparable: all settings of a learner, in a few characters.

    Args:
        who: the learner.
        data: the learner whose flights a fit is made on.

    Returns:
        12 hexadecimal digits; equal settings have equal ones.
    """
    # What an exam costs, and where it is judged, changes no number of a row.
    chosen = {
        name: value
        for name, value in asdict(who).items()
        if name not in ("seconds", "experiments", "longer", "grid", "package")
    }
    settings: dict[str, object] = {"version": VERSION, "kind": type(who).__name__, "learner": chosen}
    if isinstance(who, Fitter) and data is not None:
        settings["flights"] = key(data)
    text = json.dumps(settings, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:12]

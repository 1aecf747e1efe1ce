"""The kinds of learner that sit the exam: campaigns, fits to flights, optimisers of gains, the optimum."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from twinloop import _core
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory


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
        what: it is, for a table.
    """

    name: str
    preset: str
    options: Mapping[str, object] = field(default_factory=dict)
    arguments: Mapping[str, object] = field(default_factory=dict)
    experiments: int = 4
    longer: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 20.0
    what: str = ""

    def why_missing(self) -> str | None:
        """It needs nothing."""
        return None


@dataclass(frozen=True)
class Flyer:
    """Υ0, then gains uniform in their box: flights that no learner chose, for tuning the fits.

    Args:
        name: of the learner.
        experiments: after Υ0.
        seconds: guess of what one experiment costs.
        what: it is, for a table.
    """

    name: str
    experiments: int = 6
    seconds: float = 0.1
    what: str = ""

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
        what: it is, for a table.
    """

    name: str
    module: str
    settings: Mapping[str, object]
    package: str = ""
    seconds: float = 0.2
    experiments: Sequence[int] = (0, 1, 2, 4, 10, 20)
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)
    what: str = ""

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
        method: _Fit = importlib.import_module(f"twinloop_exam.{self.module}").fit
        return method(trajectories, signals, self.settings, seed)


@dataclass(frozen=True)
class Tuner:
    """An optimiser of gains on the system itself; it learns no twin.

    Args:
        name: of the learner.
        method: a function of `twinloop_exam.tuners`.
        settings: its hyper-parameters.
        package: that it needs.
        flights: on the system, the first controller included.
        seconds: guess of what one flight costs.
        grid: values that `--tune` tries for each hyper-parameter.
        what: it is, for a table.
    """

    name: str
    method: str
    settings: Mapping[str, object]
    package: str
    flights: int = 20
    seconds: float = 0.05
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)
    what: str = ""

    def why_missing(self) -> str | None:
        """Why it cannot be run here; None if it can."""
        return _needs(self.package)


@dataclass(frozen=True)
class Optimum:
    """CMA-ES on the true system, the bar for controllers; it is no learner and flies as often as it likes.

    Args:
        name: of the row.
        flights: of each start; on noisy systems each stands for `draws` runs with the same fixed noise.
        patient: flights by system where 500 are not enough to arrive: a bar must not be too easy.
        starts: the first from C0, the others random.
        draws: of the noise.
        seconds: guess of what it costs.
        what: it is, for a table.
    """

    name: str
    flights: int = 500
    starts: int = 4
    draws: int = 20
    patient: Mapping[str, int] = field(default_factory=dict)
    seconds: float = 60.0
    what: str = ""

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
    return f"the package {package!r} is not installed: pip install '.[exam]'"

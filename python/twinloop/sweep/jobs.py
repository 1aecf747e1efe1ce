"""What a sweep is made of: one job a campaign, named by all that tells it from the others."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from twinloop._ground.arrays import whole
from twinloop.campaign.presets import PRESETS, parsed
from twinloop.errors import InvalidInput, unknown
from twinloop.systems import BUILT_IN
from twinloop.systems.named import imported

MOST_JOBS = 100_000
NEEDED = ("signals", "controller", "initial_state", "target_state", "duration", "default_gains", "run")
"""What a system of a sweep says of itself: nobody is there to make a first test."""


@dataclass(frozen=True)
class Job:
    """One campaign.

    Args:
        system: `NAME` or `NAME:KEY=VALUE,…` of a built-in one, such as "quadrotor:noise=0.001" or "quadrotor:harsh";
            or `module:object`, which gives a system, or is a function of the seed that makes one.
        preset: of the campaign.
        seed: of the campaign and of its system.
        options: of the preset, as texts, by name.
        experiments: that it makes.
    """

    system: str
    preset: str
    seed: int
    options: tuple[tuple[str, str], ...]
    experiments: int

    @property
    def group(self) -> str:
        """All but the seed: what is compared over seeds."""
        changed = "".join(f", {name}={value}" for name, value in self.options)
        return f"{self.system}, {self.preset}{changed}"

    @property
    def name(self) -> str:
        """Of the campaign in the store of its sweep."""
        return f"{self.group}, seed {self.seed}"

    def values(self) -> dict[str, object]:
        """The options as a campaign takes them.

        Raises:
            InvalidInput: an option that the preset does not have, or a value that it cannot take.
        """
        return {name: parsed(self.preset, name, value) for name, value in self.options}


def crossed(
    systems: Sequence[str],
    seeds: Sequence[int],
    *,
    presets: Sequence[str] = ("default",),
    options: Mapping[str, Sequence[str]] | None = None,
    experiments: int = 4,
) -> list[Job]:
    """Every system with every preset, seed and value of every option; seeds change fastest.

    Args:
        systems: as `Job.system`.
        seeds: of the campaigns.
        presets: their names.
        options: values to try, as texts, by name; each has to be an option of all the presets.
        experiments: of each campaign.

    Raises:
        InvalidInput: a system, preset, option or value that is not there, none at all, or too many.
    """
    for preset in presets:
        if preset not in PRESETS:
            raise unknown("preset", preset, PRESETS)
    experiments = whole("Sweep, experiments", experiments, least=1)
    axes = dict(options or {})
    settings = [tuple(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    size = len(systems) * len(seeds) * len(presets) * len(settings)
    if not 0 < size <= MOST_JOBS:
        raise InvalidInput(
            f"Sweep: expected 1 to {MOST_JOBS} campaigns, found {size}; name systems, seeds, presets and values."
        )
    jobs = [
        Job(system, preset, seed, setting, experiments)
        for system in systems
        for preset in presets
        for setting in settings
        for seed in seeds
    ]
    for job in {job.group: job for job in jobs}.values():
        job.values()
        if len(job.name) > 200:
            raise InvalidInput(
                f"Sweep: expected names of at most 200 characters, found {job.name!r}; vary fewer options."
            )
    for system in systems:
        try:
            system_of(system, seeds[0])
        except InvalidInput:
            raise
        except (
            Exception
        ):  # this seed has no system: that is reported when it is flown, and the others are flown
            pass
    return jobs


def system_of(text: str, seed: int) -> Any:
    """A system to fly.

    Args:
        text: as `Job.system`.
        seed: of its noise.

    Raises:
        InvalidInput: no such system, or one that does not say of itself what a campaign needs.
        Exception: whatever else a function that makes a system raises, such as an OSError of a port.
    """
    name, _, rest = text.partition(":")
    if name in BUILT_IN:
        return _built_in(name, rest, seed)
    if not rest:
        raise unknown("system", text, BUILT_IN)
    found = imported(text, "is on the path of every worker")
    try:
        # A class or a function makes a system of the seed; anything else is one.
        system = found(seed=seed) if isinstance(found, type) or not hasattr(found, "run") else found
    except TypeError as failure:
        raise InvalidInput(
            f"System {text!r}: expected a system or a function of seed that makes one, found: {failure}; correct it."
        ) from failure
    missing = [needed for needed in NEEDED if not hasattr(system, needed)]
    if missing:
        raise InvalidInput(
            f"System {text!r}: expected {', '.join(NEEDED)}, found none of {', '.join(missing)}; a sweep begins each"
            " campaign by itself."
        )
    return system


def _built_in(name: str, rest: str, seed: int) -> Any:
    words = [word.strip() for word in rest.split(",") if word.strip()]
    harsh = "harsh" in words
    settings: dict[str, Any] = {"seed": seed}
    for word in words:
        key, equals, value = word.partition("=")
        if word == "harsh":
            continue
        if key != "noise" or not equals:
            raise InvalidInput(f"System {name}:{rest}: expected noise=NUMBER or harsh, found {word!r}.")
        try:
            settings["noise"] = float(value)
        except ValueError:
            raise InvalidInput(f"System {name}:{rest}: expected a number, found {value!r}.") from None
    if harsh:
        return BUILT_IN[name].harsh(**settings)
    return BUILT_IN[name](**settings)

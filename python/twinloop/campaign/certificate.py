"""The certificate of a controller to fly: what speaks for it, with numbers, and what was not tested; or a refusal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from twinloop._experiment.envelope import is_bounded
from twinloop._ground.texts import in_unit
from twinloop.campaign.examination.check import Checks
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.reaching import NOISE
from twinloop.campaign.history import Experiment
from twinloop.controllers.gains import FixedGain, Gain
from twinloop.law.linear.margins import Margins
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.campaign import Campaign


@dataclass(frozen=True)
class Use:
    """What a flight uses of the range of a state, beside what was flown before.

    Args:
        name: of the state.
        unit: of it.
        envelope: between which it is safe; None: nothing is declared.
        predicted: least and largest value of the predicted band.
        flown: least and largest reading of all flights, an angle continued through whole turns from the task's start.
        noise: standard deviation of its sensor; 0 where it is not known.
    """

    name: str
    unit: str
    envelope: tuple[float, float] | None
    predicted: tuple[float, float]
    flown: tuple[float, float]
    noise: float = 0.0

    @property
    def beyond_flown(self) -> bool:
        """Whether it leaves the flown range by more than the sensor scatters."""
        room = NOISE * self.noise
        return self.predicted[0] < self.flown[0] - room or self.predicted[1] > self.flown[1] + room


@dataclass(frozen=True, eq=False)
class Certificate:
    """A controller to fly with the evidence for it, or why there is none.

    Args:
        checks: all of the campaign.
        law_gains: of the controllers, with units and bounds.
        best: the controller to fly; None if there is none.
        old: the first controller that is known to fly, to return to; None if none is.
        experiments: that it was judged on.
        members: models of the committee.
        margins: of its loops; None if they cannot be computed, or if the twin does not follow its flights.
        step: the predicted flight of its task, with a band; None without a controller.
        uses: of the range of each state.
        not_tested: what was not tested, in sentences.
    """

    checks: Checks
    law_gains: tuple[Gain | FixedGain, ...]
    best: Test | None
    old: Test | None
    experiments: tuple[Experiment, ...]
    members: int
    margins: Margins | None
    step: Trajectory | None
    uses: tuple[Use, ...]
    not_tested: tuple[str, ...]

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why it is refused, in sentences; empty if it is granted."""
        return tuple(check.sentence for check in self.checks.failed)

    @property
    def cautions(self) -> tuple[str, ...]:
        """What does not forbid to fly it, but is worth a look, in sentences."""
        return tuple(check.sentence for check in self.checks if check.verdict == "look")

    @property
    def granted(self) -> bool:
        """Whether the controller may be flown, as far as checks can tell."""
        return self.best is not None and not self.refusals


def certificate(campaign: Campaign) -> Certificate:
    """The certificate of a campaign's controller.

    Args:
        campaign: with at least one run.

    Raises:
        NotAvailable: nothing was told.
    """
    found = campaign.examine()
    best, twin = found.best, found.twin
    step = found.planned
    uses = () if step is None else _uses(found, step)
    # Around a twin that does not follow its own flights margins say nothing of the system's.
    margins = found.margins if twin.follows else None
    why_none = found.no_margins if twin.follows else "The twin does not follow its flights."
    return Certificate(
        checks=checks(found),
        law_gains=tuple(campaign.family.law_gains),
        best=best,
        old=campaign.trusted,
        experiments=found.experiments,
        members=len(twin.members),
        margins=margins,
        step=step,
        uses=uses,
        not_tested=() if best is None else tuple(_not_tested(best, found.experiments, why_none, uses)),
    )


def _uses(found: Examination, step: Trajectory) -> tuple[Use, ...]:
    low, high = (step.states, step.states) if step.band is None else step.band
    sensors = np.zeros(found.signals.n_x) if found.sensors is None else found.sensors
    uses = []
    for i, state in enumerate(found.signals.states):
        flown = [run.states[:, i] for run in found.flown]
        uses.append(
            Use(
                name=state.name,
                unit=state.unit,
                envelope=state.envelope,
                predicted=(float(low[:, i].min()), float(high[:, i].max())),
                flown=(min(float(x.min()) for x in flown), max(float(x.max()) for x in flown)),
                noise=float(sensors[i]),
            )
        )
    return tuple(uses)


def _not_tested(
    best: Test, experiments: tuple[Experiment, ...], no_margins: str, uses: tuple[Use, ...]
) -> list[str]:
    """What nobody tested, from what is there."""
    signals = best.family.signals
    said = []
    if not any(run.number == best.number for run in experiments):
        said.append("These gains have not flown: everything stated about them is a prediction.")
    said.append(
        f"Other starts and targets than the task's, and flights longer than {best.steps * signals.dt:g} s."
    )
    said += [
        f"{use.name} is predicted between {use.predicted[0]:.3g} and {in_unit(f'{use.predicted[1]:.3g}', use.unit)},"
        f" and was flown between {use.flown[0]:.3g} and {use.flown[1]:.3g}: outside the flown range the twin"
        " extrapolates."
        for use in uses
        if use.beyond_flown
    ]
    if best.risk is None and is_bounded(signals):
        said.append(
            "How probably it leaves the envelope: there is no committee that estimates it, and a few flights inside do"
            " not show it."
        )
    bare = [use.name for use in uses if use.envelope is None]
    if bare:
        said.append(
            f"No envelope is declared for {', '.join(bare)}: whether the flight stays safe there was not checked."
        )
    if no_margins:
        said.append(f"Margins of stability. {no_margins}")
    said.append("Another load, battery, temperature or wind than in these flights, and wear.")
    return said

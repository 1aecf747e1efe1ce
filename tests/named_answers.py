"""Answers of a campaign that have names in place of models, and say how well each flight is followed."""

from dataclasses import dataclass

import numpy as np

from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.following import Following
from twinloop.campaign.identify_and_plan.learning import ROUGH
from twinloop.law.actuation import Actuation, Actuator


@dataclass(frozen=True)
class Known:
    """What little of an identification is looked at here."""

    model: str
    members: list
    remarks: list
    actuation: Actuation
    terms: int = 1


AT_ONCE = Actuator()


def identified_as(name, actuator=AT_ONCE, remarks=(ROUGH,)):
    """A linear law."""
    return Known(name, [name], list(remarks), Actuation((actuator,)))


def answer(free, frozen=1.0, follows=True, name="a", missed=True):
    """Of one member with such free runs."""
    rows = np.atleast_2d(free)
    followed = Following(
        rows, np.ones_like(rows), np.full(rows.shape[1], frozen), np.ones(rows.shape[1], dtype=int)
    )
    return Answer(identified_as(name), followed, follows, {}, (), missed, [name])

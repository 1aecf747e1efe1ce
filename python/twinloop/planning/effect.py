"""Effect: whether gains make a difference on a twin, and which cannot be tuned where it has no law of a state."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.controllers import Family
from twinloop.planning.excitation import off_by, usual_genes
from twinloop.planning.judging import Judge

OFF = (2.0**-3, 2.0**-6, 2.0**-10, 2.0**-20, 2.0**-30)
"""Shares of half the envelope by which a state is off: a little is within a dead band, and by more gains saturate."""
FAR = 0.75
"""Place in its box beyond which a gain is moved to the low end, and not to the high one."""
ROUNDING = 1e-12
"""Share of a command's scale below which a difference of commands is rounding."""


def gains_count(judge: Judge, members: Sequence[_core.Model], untunable: Sequence[int] = ()) -> bool:
    """Whether flights of the task differ, to the bit, between the middle of the gains' box and two of its corners.

    Where commands act on nothing that the quality counts, no flight on the twin tells one controller from another. A
    flight that diverges says that they act.

    Args:
        judge: of the campaign.
        members: of a committee.
        untunable: numbers of gains that are not asked, and stay in the middle.
    """
    family = judge.family
    corners = np.repeat([[0.0], [0.5], [1.0]], family.size, axis=1)
    corners[:, list(untunable)] = 0.5
    places = np.stack([family.from_unit(corner) for corner in corners])
    qualities = judge.quiet(members, places).qualities
    return bool((~np.isfinite(qualities) | (qualities != qualities[:, :, :1])).any())


def untunable_gains(
    judge: Judge, members: Sequence[_core.Model], lawless: Sequence[int], flown: Floats | None
) -> tuple[int, ...]:
    """Numbers of the gains that answer to states of which members have no law, or make no difference on them for that.

    All of them if none is found to answer: the controller answers to such a state in some way.

    Args:
        judge: of the campaign.
        members: of a committee.
        lawless: states that move, of which they have no law; none: all gains can be tuned.
        flown: the best gains flown (size,); None: none were.
    """
    if not lawless:
        return ()
    usual = usual_genes(judge.family)
    beside = [usual] if flown is None else [usual, flown]
    answer = {
        gain for genes in beside for gain in answering(judge.family, lawless, judge.task.first_target, genes)
    }
    if not answer:
        return tuple(range(judge.family.size))
    idle = set.intersection(*(set(without_effect(judge, members, genes)) for genes in beside))
    return tuple(sorted(answer | idle))


def without_effect(judge: Judge, members: Sequence[_core.Model], beside: Floats) -> tuple[int, ...]:
    """Numbers of the gains that alone change no flight of the task on any member, to the bit, at either end.

    Args:
        judge: of the campaign.
        members: of a committee.
        beside: gains (size,) beside which each is moved.
    """
    family = judge.family
    genes = np.tile(beside, (2, family.size, 1))
    for end, place in enumerate((0.0, 1.0)):
        ends = family.from_unit(np.full(family.size, place))
        genes[end, np.arange(family.size), np.arange(family.size)] = ends
    every = np.concatenate([beside[np.newaxis], *genes])
    qualities = judge.quiet(members, every).qualities
    moved = (qualities != qualities[:, :, :1]).any(axis=(0, 1))[1:].reshape(2, family.size).any(axis=0)
    return tuple(np.flatnonzero(~moved).tolist())


def answering(family: Family, states: Sequence[int], target: Floats, beside: Floats) -> tuple[int, ...]:
    """Numbers of the gains on which it depends how commands change as a state goes off its target.

    Args:
        family: of the controllers.
        states: that go off, one after another, for two periods: their rates and integrals are answered, too.
        target: from which they go off (n_x,).
        beside: gains (size,) beside which each is moved.
    """
    place = family.to_unit(beside)
    places = np.tile(place, (family.size + 1, 1))
    places[np.arange(family.size), np.arange(family.size)] = np.where(place < FAR, 1.0, 0.0)
    controllers = [family.controller(genes) for genes in family.from_unit(places)]
    least = ROUNDING * np.array([command.size for command in family.signals.commands])
    targets = np.tile(target, (3, 1))
    # A gain may change what is sent at the target itself, and answer to no state.
    there = [controller.commands(targets, targets) for controller in controllers]
    answers = np.zeros(family.size, dtype=np.bool_)
    for state, share in itertools.product(states, OFF):
        readings = targets.copy()
        readings[1:] = off_by(family.signals, state, target, share)
        *moved, unmoved = (
            controller.commands(readings, targets) - sent
            for controller, sent in zip(controllers, there, strict=True)
        )
        answers |= [(np.abs(sent - unmoved) > least).any() for sent in moved]
    return tuple(np.flatnonzero(answers).tolist())

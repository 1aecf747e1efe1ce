"""Ahead: what a twin says of the periods to come: whether the flight leaves its envelope, and what is read next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.law.reports import sensed
from twinloop.law.twin import Twin
from twinloop.signals import Bounds
from twinloop.test import Test


class Ahead:
    """A flight that is looked ahead of, from reading to reading.

    Args:
        committee: foretells whether the flight leaves; None: nothing does.
        best: foretells what is read next; None: nothing does. It may be the committee, by its best member.
    """

    def __init__(self, committee: _core.LookAhead | None, best: _core.LookAhead | None) -> None:
        self.committee = committee
        self.best = best
        self._every = [each for each in dict.fromkeys((committee, best)) if each is not None]

    @classmethod
    def of(cls, test: Test, twin: Twin | None, bounds: Sequence[Bounds], leaving: bool) -> Ahead:
        """That of a test on a twin.

        Flown blind a guard goes on from what it expected, in which a rate must not be half a period old: so where rates
        are computed of readings, the best member reads them as they are.

        Args:
            test: that is flown.
            twin: that foretells; None: nothing does.
            bounds: of the envelope, one pair for each state.
            leaving: whether it is asked if the flight leaves.

        Raises:
            InvalidInput: a twin and a test that do not fit each other.
            NotAvailable: a law in Python, whose memory cannot be predicted, and `leaving`.
        """
        if twin is None:
            return cls(None, None)
        members = list(twin.members or (twin.model,))
        blind = sensed(members[0])
        if not leaving:
            try:
                return cls(None, _look_ahead(test, twin, [blind], bounds))
            except NotAvailable:
                return cls(None, None)
        committee = _look_ahead(test, twin, members, bounds)
        return cls(committee, committee if blind is members[0] else _look_ahead(test, twin, [blind], bounds))

    def reset(self) -> None:
        """Back to the start of a flight."""
        for each in self._every:
            each.reset()

    def leaves(self, reading: Floats, periods: int) -> tuple[int, int] | None:
        """In how many periods a member first sees the flight leave, and which state does; None: none sees it.

        Args:
            reading: of this period (n_x,).
            periods: that are looked ahead.
        """
        found = None if self.committee is None else self.committee.leaving(reading, periods)
        return None if found is None else found[:2]

    def following(self, reading: Floats, command: Floats) -> Floats | None:
        """What is read next (n_x,); None where nothing foretells it.

        Args:
            reading: of this period (n_x,).
            command: that follows it (n_u,).
        """
        return None if self.best is None else self.best.following(reading, command)

    def sent(self, reading: Floats, target: Floats, command: Floats) -> None:
        """Goes on by a period.

        Args:
            reading: of it (n_x,).
            target: of it (n_x,).
            command: that was sent (n_u,).
        """
        for each in self._every:
            each.sent(reading, target, command)


def _look_ahead(
    test: Test, twin: Twin, members: Sequence[_core.Model], bounds: Sequence[Bounds]
) -> _core.LookAhead:
    try:
        return _core.LookAhead(
            members,
            twin.limits.setting(test.family.engine),
            test.genes,
            test.target_state,
            test.steps,
            np.array(bounds),
            excitation=test.excitation,
            hold_back=None if test.hold_back is None else test.hold_back.engine,
        )
    except ValueError as reason:
        if "expected a law of the engine" not in str(reason):
            raise InvalidInput(str(reason)) from reason
        raise NotAvailable(
            "Guard: expected a law of the engine, found one in Python, in whose memory nobody can look ahead; pass"
            " horizon=0, and readings, band and clock are watched."
        ) from reason

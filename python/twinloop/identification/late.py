"""Late: driven states whose sensors may give readings some periods late, found in short looks before all else.

An analyser, a camera or a receiver of positions tells what was there a while ago. Against its own derivative nothing of
that shows (`sensors/offsets`); against what drives the state, and what it drives, it does. But a lag may look like it,
and so may a state that is not logged. So what is found here is only tried: runs are learnt with it and without.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from twinloop._ground.elementary import log
from twinloop.identification.context import Context
from twinloop.identification.description import shortest
from twinloop.identification.forms import first_form
from twinloop.identification.records import Run
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.sensors.chains import Chain
from twinloop.identification.sensors.reported import as_sensed
from twinloop.identification.starts import begun
from twinloop.law.actuation import Actuation
from twinloop.law.reports import Held, late_in, reports_of

Ages = tuple[int, ...]
"""Periods by which each state's readings are late (n_x)."""
Group = tuple[int, ...]
"""States that are read late by the same."""
LONGEST = 10
"""Periods by which a reading is late at most."""
SHARE = 0.1
"""Share of the shortest run that this may be at most."""
PRICE = 24.0
"""What each late sensor must gain in χ²: how late it is, the choice of having one, and what a short look may miss."""
FURTHER = 6.0
"""What each period more than the first must gain."""
HOPELESS = -12.0
"""Gain of one period from which on a sensor is not looked at again once others are late."""
LOOKS = 2000
"""Number of the first look, by which what it draws is told from what others draw."""


def late(context: Context, logged: Sequence[Run]) -> Ages:
    """Periods by which readings of driven states may come late (n_x), each with all that it is the derivative of.

    Args:
        context: of the identification.
        logged: runs as they were logged.

    Returns:
        None late where one run is all there is, for in that states are functions of time; what was known before once
        lags and offsets are settled, or where nothing is searched anew.
    """
    n_x, known = context.signals.n_x, known_late(context)
    if context.earlier is not None and (context.settled or not context.options.anew):
        return known
    longest = min(LONGEST, int(SHARE * min(len(run.commands) for run in logged)))
    if not (context.options.offsets and context.several) or longest < 1:
        return (0,) * n_x
    looks = _Looks(context, logged, longest, itertools.count(LOOKS))
    if len(looks.chains) < 2:
        # Where all are late their commands are.
        return (0,) * n_x
    context.watch("noise")
    best = looks.first(known)
    groups = [group for group in looks.groups if not any(best.ages.get(i) for i in group)]
    while groups:
        tried = {group: looks.later(best, group) for group in groups}
        gains = {group: best.length - one.length for group, one in tried.items()}
        group = max(gains, key=gains.__getitem__)
        if not gains[group] > PRICE:
            break
        best = tried[group]
        groups = [one for one in groups if not set(one) & set(group) and gains[one] > HOPELESS]
    ages = [best.ages.get(i, 0) for i in range(n_x)]
    # By what all are late at least commands are.
    least = min(ages[chain[0]] for chain in looks.every)
    return tuple(max(0, age - least) for age in ages)


def known_late(context: Context) -> Ages:
    """By how many periods readings were late in what was learnt earlier (n_x); none where nothing was."""
    n_x, earlier = context.signals.n_x, context.earlier
    return late_in(() if earlier is None else reports_of(earlier.model, n_x), n_x)


def unread(context: Context, observer: Sequence[Chain]) -> float:
    """What the description of readings would have that are older than their runs, and count where none is late.

    Each is taken to be as long as that of a reading which another one foretells.

    Args:
        context: with runs of which some readings are late.
        observer: chains with the noise of their sensors.
    """
    sensors = {
        i: size for chain in observer for i, size in zip(chain.states, chain.sensors.tolist(), strict=True)
    }
    ages = late_in(context.reports, context.signals.n_x)
    each = sum(age * (1.0 + float(log(2.0 * sensors[i]))) for i, age in enumerate(ages) if age)
    return len(context.runs) * each


@dataclass(frozen=True)
class _Look:
    """What a short search has made of the runs.

    Args:
        ages: periods by which states' readings are late, by place; those of others are read in time.
        length: of the description of the readings.
        actuation: between commands and what was found.
    """

    ages: Mapping[int, int]
    length: float
    actuation: Actuation


@dataclass(frozen=True, eq=False)
class _Looks:
    """Short searches, the same readings counting in all.

    Args:
        context: of the identification.
        logged: runs as they were logged.
        longest: periods by which readings are late at most.
        numbers: of the searches.
    """

    context: Context
    logged: Sequence[Run]
    longest: int
    numbers: Iterator[int]

    @cached_property
    def every(self) -> list[Group]:
        """States of each chain."""
        context = self.context
        begins = begun(context, first_form(context.options, context.signals), context.first_pool(), LOOKS)
        return [chain.states for chain in begins.driven]

    @cached_property
    def chains(self) -> list[Group]:
        """Those that may be read late: not body rates, against which all that is turned is read."""
        signals = self.context.signals
        rates = () if signals.kinematics is None else signals.kinematics.rates
        known = self.context.reports or (None,) * signals.n_x
        return [
            chain
            for chain in self.every
            if not any(known[i] or signals.state_names[i] in rates for i in chain)
        ]

    @property
    def groups(self) -> list[Group]:
        """Chains each, and those together whose first states have one unit, for one device may read them all."""
        units: dict[str, list[Group]] = {}
        for chain in self.chains:
            units.setdefault(self.context.signals.states[chain[0]].unit, []).append(chain)
        together = [
            tuple(itertools.chain(*alike)) for alike in units.values() if 1 < len(alike) < len(self.every)
        ]
        return [*self.chains, *together]

    def first(self, known: Ages) -> _Look:
        """All in time, or as late as was known before; behind the actuators that were known before or none."""
        direct, earlier = Actuation.direct(self.context.signals), self.context.earlier
        several = list(dict.fromkeys([direct, *([] if earlier is None else [earlier.actuation.bare()])]))
        late = {i: age for i, age in enumerate(known) if age}
        return shortest([self._best(ages, several) for ages in ([{}, late] if late else [{}])], _length)

    def later(self, best: _Look, group: Group) -> _Look:
        """The same with a group that is late, as long as one period more makes the description shorter."""
        found = best
        for age in range(1, self.longest + 1):
            # Of commands that were taken to be late, sensors may have been.
            tried = self._best(
                {**best.ages, **dict.fromkeys(group, age)}, [found.actuation, *_sooner(found.actuation)]
            )
            if not found.length - tried.length > (FURTHER if age > 1 else 0.0):
                return found if age > 1 else tried
            found = tried
        return found

    def _best(self, ages: Mapping[int, int], several: Sequence[Actuation]) -> _Look:
        context, reports = self.context, list(self.context.reports or (None,) * self.context.signals.n_x)
        for i in itertools.chain(*self.chains):
            reports[i] = Held(1, 1, ages.get(i, 0))
        runs = [as_sensed(run, tuple(reports), context.signals, ignored=self.longest) for run in self.logged]
        brief, form = context.brief(runs), first_form(context.options, context.signals)
        looks = []
        for actuation in several:
            first = begun(brief, form, brief.first_pool(), next(self.numbers))
            found = from_both_sides(brief, replace(first, actuation=actuation))
            looks.append(_Look(ages, found.length, actuation))
        return shortest(looks, _length)


def _length(look: _Look) -> float:
    return look.length


def _sooner(actuation: Actuation) -> list[Actuation]:
    """The same with commands that act one period sooner; none where none are delayed."""
    actuators = tuple(one._replace(delay=max(0, one.delay - 1)) for one in actuation.actuators)
    return [] if actuators == actuation.actuators else [replace(actuation, actuators=actuators)]

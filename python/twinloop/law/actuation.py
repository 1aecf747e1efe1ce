"""What stands between commands and a law: actuators that lag or delay; hidden states that commands or states drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats, at_least_zero, number, whole
from twinloop.errors import InvalidInput
from twinloop.law.reports import reports_of, with_reports
from twinloop.records import Record, Recorded, with_names
from twinloop.signals import Signals

LONGEST_DELAY = 1000
"""Periods; the engine refuses more."""


class Actuator(NamedTuple):
    """The way from a command u to its effect e: de/dt = clip((u − e) / lag, ± rate).

    Args:
        lag: time constant of a first-order lag, s; 0 for none.
        delay: whole periods before a command begins to act.
        rest: command whose effect is there at the start of a run, in its unit; None: the first one.
        ramp: time in which the effect moves by the command's scale at most, s: the scale over the rate; 0 where no
            limit of the rate is known.
    """

    lag: float = 0.0
    delay: int = 0
    rest: float | None = None
    ramp: float = 0.0

    def rate(self, size: float) -> float:
        """At which the effect moves at most, of a command of this scale, in its unit a second; 0: no limit is known."""
        # As the engine does, to the bit.
        return 1.0 / ((1.0 / size) * self.ramp) if self.ramp > 0.0 else 0.0

    @property
    def direct(self) -> bool:
        """Whether a command acts at once."""
        return self.lag == 0.0 and self.delay == 0 and self.ramp == 0.0


def in_periods(count: int) -> str:
    """A number of periods in words."""
    return f"{count} period{'s' if count != 1 else ''}"


LATER: Mapping[str, object] = {"states": [], "settled": False, "turns": 0.0, "gap": 0.0, "damping": 0.0}
"""What hidden states of earlier versions did not have."""


class HiddenState(NamedTuple):
    """An unmeasured state h that commands or states drive: dh/dt = level − rest − h / time.

    The level is the mean over its sources of what each gives, in units of its scale. At the start of a run h is 0, or
    in steady state under the first level. Two neighbours that the same drives may turn into each other, as the place
    and the speed of a mass on a spring do: - h2 / turns is added to the first one's derivative, h1 / turns to the
    second's. Or the two are a mass behind a gap, such as the load of a gear with backlash: the law sees what presses on
    it and its rate, h1 = press(s, ds/dt) of the twist s, ds/dt = level - h2, and dh2/dt = h1 / turns² - h2 / time. At
    the start it moves along, in the middle of the gap.

    Args:
        commands: places of those that drive it; none where states do. What they drive alone is exact, for they are held
            over a period; two that turn are integrated with the states.
        squared: whether its sources drive it with their squares.
        rest: level that does not drive it; None, of commands that drive it alone: that of the first period.
        time: after which 1/e of it is left, s.
        states: places of the states that drive it; none where commands do.
        settled: whether a run begins with it in steady state; only where states drive it.
        turns: time in which it and its partner turn by one radian, s; 0 where it has none.
        gap: half of the gap between it and its partner, in units of the level times s; 0 where there is none.
        damping: of what presses beyond the gap, over its stiffness, s; 0 where there is no gap.
    """

    commands: tuple[int, ...]
    squared: bool
    rest: float | None
    time: float
    states: tuple[int, ...] = ()
    settled: bool = False
    turns: float = 0.0
    gap: float = 0.0
    damping: float = 0.0

    @property
    def integrated(self) -> bool:
        """Whether it is integrated with the states: where they drive it, or it turns into its partner."""
        return bool(self.states) or self.turns > 0.0

    def drivers(self, signals: Signals) -> dict[int, float]:
        """Places of what drives it, among the inputs of a law, each with the scale that it is in units of.

        Args:
            signals: of the system. Effects of commands are in units of theirs already.
        """
        by_states = {place: signals.states[place].scale for place in self.states}
        return {**by_states, **{signals.n_x + place: 1.0 for place in self.commands}}


def renewed_hidden(items: object) -> object:
    """Hidden states as earlier versions wrote them: without names, by commands alone, none that turned, or no gap."""
    found, later = with_names(items, HiddenState._fields, *LATER.values()), dict(LATER)
    if not isinstance(found, list):
        return found
    return [{**later, **one} if isinstance(one, dict) else one for one in found]


def partners(hidden: Sequence[HiddenState]) -> list[int]:
    """Place of the partner of each hidden state, its own where it has none."""
    found: list[int] = []
    for place, state in enumerate(hidden):
        second = bool(found) and found[-1] == place
        found.append(place if state.turns == 0.0 else place - 1 if second else place + 1)
    return found


def twists(hidden: Sequence[HiddenState]) -> dict[int, int]:
    """Places of twists before gaps, each with that of the rate of the mass behind it."""
    beside = enumerate(partners(hidden))
    return {place: partner for place, partner in beside if hidden[place].gap and partner > place}


@dataclass(frozen=True)
class Actuation(Recorded, kind="actuation"):
    """What a model sees of commands: their effects, then the states that they fill.

    Args:
        actuators: one a command.
        hidden: states that commands drive, then those that are integrated with the states.
    """

    actuators: tuple[Actuator, ...]
    hidden: tuple[HiddenState, ...] = ()

    VERSION = 5

    @staticmethod
    def direct(signals: Signals) -> Actuation:
        """Commands that act at once."""
        return Actuation((Actuator(),) * signals.n_u)

    @staticmethod
    def of(model: _core.Model, signals: Signals) -> Actuation:
        """That of a model, with an actuator for each command even where all act at once."""
        if not model.actuators:
            return Actuation.direct(signals)
        hidden = (
            HiddenState(tuple(commands), squared, rest, time, tuple(states), settled, *numbers)
            for commands, squared, rest, time, states, settled, *numbers in model.hidden
        )
        return Actuation(tuple(Actuator(*actuator) for actuator in model.actuators), tuple(hidden))

    @property
    def remembers(self) -> bool:
        """Whether commands of earlier periods act in a later one, too."""
        return bool(self.hidden) or not all(actuator.direct for actuator in self.actuators)

    def effects(self, signals: Signals, commands: Floats) -> list[Floats]:
        """What arrives of commands (n, n_u), then hidden states that they fill, within each period."""
        scales = np.array([command.size for command in signals.commands])
        filled = [state for state in self.hidden if not state.integrated]
        return _core.command_effects(self.actuators, filled, scales, signals.dt, commands)

    @property
    def stored(self) -> tuple[HiddenState, ...]:
        """Hidden states that are integrated with the states."""
        return tuple(state for state in self.hidden if state.integrated)

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Actuation:
        found = super()._read(record, where, given)
        for i, actuator in enumerate(found.actuators):
            _check_actuator(actuator, f"Record {where}.actuators[{i}]")
        for i, state in enumerate(found.hidden):
            _check_hidden(state, f"Record {where}.hidden[{i}]")
        for i, j in enumerate(partners(found.hidden)):
            if found.hidden[i] != dict(enumerate(found.hidden)).get(j):
                raise InvalidInput(
                    f"Record {where}.hidden[{i}]: expected a neighbour that it turns into, found none; it is damaged."
                )
        return found

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version: commands alone filled hidden states, none turned, had a gap, or ramped."""
        found = super().renewed(record)
        if "actuators" in found:
            bare = with_names(found["actuators"], Actuator._fields, 0.0)
            found["actuators"] = (
                [{"ramp": 0.0, **one} if isinstance(one, dict) else one for one in bare]
                if isinstance(bare, list)
                else bare
            )
        if "hidden" in found:
            found["hidden"] = renewed_hidden(found["hidden"])
        return found

    def at_once(self, commands: Sequence[int]) -> Actuation:
        """The same with some commands that act at once."""
        actuators = (Actuator() if i in commands else actuator for i, actuator in enumerate(self.actuators))
        return replace(self, actuators=tuple(actuators))

    def unlimited(self, commands: Sequence[int]) -> Actuation:
        """The same with some commands whose effect moves at any rate."""
        free = enumerate(self.actuators)
        actuators = (each._replace(ramp=0.0) if i in commands else each for i, each in free)
        return replace(self, actuators=tuple(actuators))

    def bare(self) -> Actuation:
        """The same without hidden states."""
        return replace(self, hidden=())


def alike_commands(signals: Signals, known: Actuation | None = None) -> tuple[tuple[int, ...], ...]:
    """Commands that are alike, by unit and bounds: they share an actuator, and fill hidden states together.

    Args:
        signals: of the system.
        known: actuators that were found; commands behind different ones are not alike. None: all may share one.
    """
    found: dict[tuple[object, ...], list[int]] = {}
    for i, command in enumerate(signals.commands):
        actuator = None if known is None else known.actuators[i]
        found.setdefault((command.unit, command.bounds, command.size, actuator), []).append(i)
    return tuple(tuple(group) for group in found.values())


def one_by_one(alike: Sequence[tuple[int, ...]], group: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    """Groups of alike commands, of which those of one are alike no more.

    Args:
        alike: groups of commands.
        group: one of them.
    """
    others = [other for other in alike if other != group]
    return tuple(sorted([*others, *((i,) for i in group)]))


def delayed(model: _core.Model, signals: Signals, periods: float = 1.0) -> _core.Model:
    """The same model with commands that act later, by a delay of whole periods and a lag of what is left.

    Args:
        model: of these signals.
        signals: of the system.
        periods: by how many.
    """
    actuation, whole = Actuation.of(model, signals), int(periods)
    lag = (periods - whole) * signals.dt
    late = [
        actuator._replace(delay=actuator.delay + whole, lag=actuator.lag + lag)
        for actuator in actuation.actuators
    ]
    return renewed(model, signals, actuators=late)


def renewed(
    model: _core.Model,
    signals: Signals,
    *,
    program: _core.Program | None = None,
    actuators: Sequence[Actuator] | None = None,
) -> _core.Model:
    """The same model with another program or other actuators, sent to and read as before.

    Args:
        model: of these signals.
        signals: of the system.
        program: of as many inputs and outputs; None: its own.
        actuators: one a command; None: its own.
    """
    found = _core.Model(
        model.program if program is None else program,
        model.form,
        signals.engine,
        actuators or model.actuators or None,
        model.hidden,
        model.offsets,
    )
    found = found.with_levels(model.levels) if model.levels else found
    return with_reports(found, reports_of(model, signals.n_x))


def _check_actuator(actuator: Actuator, where: str) -> None:
    """Refuses numbers that no actuator has."""
    at_least_zero(f"{where}.lag", actuator.lag)
    at_least_zero(f"{where}.ramp", actuator.ramp)
    if whole(f"{where}.delay", actuator.delay) > LONGEST_DELAY:
        raise InvalidInput(
            f"{where}.delay: expected at most {LONGEST_DELAY} periods, found {actuator.delay}; change it."
        )
    if actuator.rest is not None:
        number(f"{where}.rest", actuator.rest)


def _check_hidden(state: HiddenState, where: str) -> None:
    """Refuses what no hidden state is."""
    number(f"{where}.time", state.time, above=0.0)
    if state.rest is not None:
        number(f"{where}.rest", state.rest)
    for name in ("turns", "gap", "damping"):
        at_least_zero(f"{where}.{name}", getattr(state, name))
    plays = state.turns > 0.0 and state.damping > 0.0 and not state.settled and not state.squared
    if not plays if state.gap else state.damping:
        raise InvalidInput(
            f"{where}: expected a gap and a damping between two that turn into each other, neither squared nor settled,"
            " or neither of them, found others."
        )
    driven = bool(state.commands) != bool(state.states) and not (state.gap and state.commands)
    if not driven or (state.commands and state.settled) or (state.integrated and state.rest is None):
        raise InvalidInput(
            f"{where}: expected commands that drive it and that it is not settled, or states, and a rest where states"
            " drive it or it turns, found others."
        )

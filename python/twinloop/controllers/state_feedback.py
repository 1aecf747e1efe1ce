"""Feedback of the full state, and an optional mixer to the actuators."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from twinloop import _core
from twinloop.controllers.family import Family
from twinloop.controllers.gains import (
    FixedGain,
    Gain,
    GainBounds,
    bounds_by_name,
    gain_bounds,
    gain_of,
    gain_units,
)
from twinloop.controllers.mixer import Mixer, check_output
from twinloop.errors import InvalidInput, unknown
from twinloop.records import Recorded
from twinloop.signals import Signals


@dataclass(frozen=True, eq=False)
class StateFeedback(Recorded, kind="state_feedback"):
    """u = K (target − x) + K_I ∫(target − x): every output responds to the error of every state.

    The gain of "roll" on the first output is called "roll->u1", or "roll->torque" without a mixer, when the output is
    the command "torque"; that of an integral is "roll.integral->u1". Integrals are updated before they are used.
    There is no anti-windup.

    Args:
        states: names of the feedback states; None: all.
        gains: bounds of every gain: one (low, high) for all, or by name, where "roll" stands for the gains of roll on
            all outputs; a third item "log" where decades matter. A number instead fixes the gain.
        output: from the outputs u1, u2, … to the commands, possibly with an offset such as the thrust of hovering;
            None: output i is command i.
        integral: names of the states whose integrated error is fed back too.

    Raises:
        InvalidInput: a name that is given twice, no state at all, or bounds that cannot be used.
    """

    states: Sequence[str] | None
    gains: GainBounds | Mapping[str, GainBounds]
    output: Mixer | None = None
    integral: Sequence[str] = ()

    def __post_init__(self) -> None:
        states = None if self.states is None else _names("states", self.states)
        if states == ():
            raise InvalidInput(
                "StateFeedback, states: expected at least one state, found none; name some, or pass None for"
                " all."
            )
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "integral", _names("integral", self.integral))
        check_output("StateFeedback", self.output)
        if not isinstance(self.gains, Mapping):
            object.__setattr__(self, "gains", gain_bounds("StateFeedback, gains", self.gains))

    def bind(self, signals: Signals) -> FeedbackFamily:
        """The family over these signals; gains in rows of (states, integrals), one row an output.

        Args:
            signals: with these states.

        Returns:
            The family, its gains with units.

        Raises:
            InvalidInput: an unknown state, bounds for other gains, or a mixer for other commands.
        """
        index = {name: i for i, name in enumerate(signals.state_names)}
        states = tuple(signals.state_names if self.states is None else self.states)
        for name in (*states, *self.integral):
            if name not in index:
                raise unknown("state in a StateFeedback", name, index)
        if self.output is None:
            outputs = {command.name: command.unit for command in signals.commands}
        else:
            axes = self.output.matrix.shape[1]
            self.output.check(signals.n_u, axes)
            outputs = {f"u{j + 1}": self.output.unit for j in range(axes)}
        gains = self._gains(signals, states, outputs)
        engine = _core.Family.state_feedback(
            signals.engine,
            [index[name] for name in states],
            [index[name] for name in self.integral],
            len(outputs),
            [gain.engine for gain in gains],
            None if self.output is None else self.output.engine,
        )
        return FeedbackFamily(signals, gains, engine, states, tuple(self.integral), self.output)

    def _gains(
        self, signals: Signals, states: Sequence[str], outputs: Mapping[str, str]
    ) -> list[Gain | FixedGain]:
        """Name, unit and bounds of every gain, in the order of the law."""
        unit_of = {state.name: state.unit for state in signals.states}
        # What each gain multiplies: its name, the state behind it, and which of the three units it has.
        sources = [(name, name, 0) for name in states]
        sources += [(f"{name}.integral", name, 1) for name in self.integral]
        names = {f"{source}->{output}": source for output in outputs for source, _, _ in sources}
        bounds = bounds_by_name("StateFeedback", self._spread(names), list(names))
        gains = []
        for output, asked in outputs.items():
            for source, state, kind in sources:
                name = f"{source}->{output}"
                gains.append(gain_of(name, gain_units(asked, unit_of[state])[kind], bounds[name]))
        return gains

    def _spread(self, names: Mapping[str, str]) -> Mapping[str, GainBounds]:
        """Bounds by the full names of the gains, whatever way they were given."""
        given = self.gains
        if not isinstance(given, Mapping):
            return dict.fromkeys(names, given)
        rest = {name: bounds for name, bounds in given.items() if name not in names.values()}
        of_sources = {name: given[source] for name, source in names.items() if source in given}
        return {**of_sources, **rest}


@dataclass(frozen=True, eq=False)
class FeedbackFamily(Family):
    """A family of state feedbacks with its states, integrals and outputs; made by `StateFeedback.bind`.

    Args:
        signals: states and commands of the controllers.
        law_gains: all gains of the law, in its order.
        engine: the same family in the native engine.
        states: names of the states that are fed back.
        integral: names of the states whose error is integrated.
        output: from the outputs to the commands; None: output i is command i.
    """

    states: tuple[str, ...]
    integral: tuple[str, ...]
    output: Mixer | None


def _names(what: str, names: object) -> tuple[str, ...]:
    found = tuple(names) if isinstance(names, Iterable) and not isinstance(names, str) else (None,)
    if not all(isinstance(name, str) for name in found) or len(set(found)) != len(found):
        raise InvalidInput(
            f"StateFeedback, {what}: expected a list of names, each once, found {names!r}; correct it."
        )
    return found

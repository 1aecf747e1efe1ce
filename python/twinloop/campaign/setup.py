"""What a campaign is about, checked before anything is flown: signals, controllers, task, options, seed."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, floats, number, whole
from twinloop._ground.texts import in_unit
from twinloop._ground.values import Value
from twinloop.campaign.coevolution.search import grammar, settings_of_tests, variation
from twinloop.campaign.presets import AnyOptions, DefaultOptions, Options, options_of
from twinloop.controllers import Family, Mixer, UnboundFamily
from twinloop.errors import InvalidInput, NotAvailable, unknown
from twinloop.identification.terms.formulas import parsed_term
from twinloop.identification.terms.pool import Pool
from twinloop.identification.terms.priors import priors_of
from twinloop.planning.planner import GOALS
from twinloop.planning.quality import KINDS, Quality, quality_of, weights_of
from twinloop.records import Record, Recorded, checked_record, plain, read
from twinloop.signals import Signals
from twinloop.test import checked_target
from twinloop.unmeasured import columns_of, completed_rows, completed_state, lacks

MOST_STEPS = 10_000_000
"""Of a test in a record."""


@dataclass(frozen=True, eq=False)
class Setup(Value, Recorded, kind="setup"):
    """The question of a campaign.

    Args:
        signals: of the system.
        controller: the family of controllers as it was described.
        family: the same, bound to the signals.
        initial_state: where every test starts (n_x,), SI units, radians.
        target_state: where every test should end (n_x,), the same units; or where it should be at each state of a run
            (steps + 1, n_x).
        steps: of a test.
        preset: name of the set of options.
        options: the preset's, with those that were changed.
        seed: of all random numbers.
        goal: what flights are for, "both", "model" or "control".
        quality: what is minimised.
    """

    signals: Signals
    controller: UnboundFamily
    family: Family
    initial_state: Floats
    target_state: Floats
    steps: int
    preset: str
    options: AnyOptions
    seed: int
    goal: str
    quality: Quality

    VERSION = 2

    @cached_property
    def task(self) -> _core.Task:
        """Start, target and length, for the native engine."""
        return _core.Task(self.initial_state, self.target_state, self.steps)

    @property
    def predicted_flights(self) -> int | None:
        """Flights at most from which a risk is taken, of all members and draws; None where the preset has none."""
        options = self.options
        return options.committee_size * options.draws if isinstance(options, DefaultOptions) else None

    @property
    def in_scales(self) -> bool:
        """Whether errors are in units of the states' scales; the paper takes states as they are."""
        return isinstance(self.options, DefaultOptions)

    @cached_property
    def limits(self) -> Limits:
        """Where simulated runs count as diverged."""
        return Limits(self.signals, self.options.divergence_factor)

    @cached_property
    def setting(self) -> _core.Setting:
        """What tests are flown in, for the native engine."""
        return self.limits.setting(self.family.engine)

    @property
    def mixer(self) -> Mixer | None:
        """From the controller's axes to the commands; None where each axis is a command, or the controller has none."""
        output = getattr(self.controller, "output", None)
        return output if isinstance(output, Mixer) else None

    @property
    def final_target(self) -> Floats:
        """Where every test should end (n_x,)."""
        return self.target_state if self.target_state.ndim == 1 else self.target_state[-1]

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return (
            *("signals", "controller", "initial_state", "target_state", "steps"),
            *("preset", "options", "seed", "goal", "quality"),
        )

    def to_record(self) -> Record:
        """The arguments of the campaign, every option by name, those at their defaults too.

        Raises:
            NotAvailable: controllers without a plain form.
        """
        if not isinstance(self.controller, Recorded):
            raise NotAvailable(
                f"Campaign: expected controllers with a plain form, such as a PID, found"
                f" {type(self.controller).__name__}, which cannot be written down; use one of twinloop.controllers."
            )
        options = {field.name: plain(getattr(self.options, field.name)) for field in _fields(self.options)}
        named = {name: plain(getattr(self, name)) for name in self.recorded_fields()[:6]}
        return {
            **self._head(),
            **named,
            "options": options,
            "seed": self.seed,
            "goal": self.goal,
            "quality": self.quality.kind,
        }

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of the first version, in which contacts were searched with dry friction or not at all."""
        options = record.get("options")
        if isinstance(options, Mapping) and "contacts" in options:
            record = {**record, "options": {"friction": options["contacts"], **options}}
        return record

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Setup:
        found = checked_record(record, cls, cls.recorded_fields(), where)
        signals = read(Signals, found["signals"], f"{where}.signals")
        steps = read(int, found["steps"], f"{where}.steps")
        if not 2 <= steps <= MOST_STEPS:
            raise InvalidInput(f"Record {where}.steps: expected 2 to {MOST_STEPS}, found {steps}.")
        flights = Flights(
            signals,
            read(UnboundFamily, found["controller"], f"{where}.controller"),
            read(Floats, found["initial_state"], f"{where}.initial_state"),
            read(Floats, found["target_state"], f"{where}.target_state"),
            steps * signals.dt,
        )
        choices = Choices(
            read(str, found["preset"], f"{where}.preset"),
            read(dict[str, Any], found["options"], f"{where}.options"),
            read(int, found["seed"], f"{where}.seed"),
            read(str, found["goal"], f"{where}.goal"),
            read(str, found["quality"], f"{where}.quality"),
        )
        return checked(flights, choices)

    def none_selected(self) -> _core.SelectedTests:
        """No tests yet, for the native engine."""
        return _core.SelectedTests(self.setting)


@dataclass(frozen=True, eq=False)
class Flights:
    """What is flown, as a campaign was given it: not checked yet.

    Args:
        signals: of the system.
        controller: a family of controllers.
        initial_state: (n_x,), SI units, radians.
        target_state: (n_x,), the same units; or a reference that varies with time: a function of it in s, or a row for
            each period and one for the end.
        duration: of a test, s.
    """

    signals: object
    controller: object
    initial_state: ArrayLike
    target_state: ArrayLike | Callable[[float], ArrayLike]
    duration: object


@dataclass(frozen=True, eq=False)
class Choices:
    """How a campaign is to go about it, as it was given it: not checked yet.

    Args:
        preset: name of a set of options.
        options: other values for some of them.
        seed: of all random numbers.
        goal: what flights are for; None: the preset's.
        quality: what is minimised; None: the preset's.
        operators: that evolved programs may use; None: the preset's.
        weights: of states in the quality, by name, in place of 1 or 0; kept as the option `quality_weights`.
    """

    preset: str
    options: Mapping[str, object] | None
    seed: object
    goal: str | None
    quality: str | None
    operators: Sequence[str] | None = None
    weights: Mapping[str, float] | None = None


def checked(flights: Flights, choices: Choices) -> Setup:
    """The arguments of a campaign, if they can be used.

    Args:
        flights: what is flown.
        choices: how the campaign is to go about it.

    Returns:
        The setup.

    Raises:
        InvalidInput: one of them cannot be used.
    """
    signals, controller = _described(flights)
    steps, start, target = _task(flights, signals)
    if choices.preset == "paper" and not signals.difference(target, start).any():
        raise InvalidInput(
            "Campaign, target_state: expected a target away from the initial state, found both the same; "
            'the paper measures distances in that length, so move one of them, or choose preset="default".'
        )
    seed = whole("Campaign, seed", choices.seed)
    if seed >= 2**64:
        raise InvalidInput(
            f"Campaign, seed: expected less than 2**64, found {choices.seed}; choose a smaller one."
        )
    options = options_of(choices.preset, _changes(choices, signals))
    purpose, measure = _purpose(choices, options, signals)
    family = controller.bind(signals)
    setup = Setup(
        signals, controller, family, start, target, steps, choices.preset, options, seed, purpose, measure
    )
    _ = setup.task  # the engine refuses now rather than after the first flight
    _check_ends(setup)
    _check_use(options, signals)
    return setup


def _described(flights: Flights) -> tuple[Signals, UnboundFamily]:
    """Signals and controllers, if they are such."""
    if not isinstance(flights.signals, Signals):
        raise InvalidInput(
            f"Campaign, signals: expected twinloop.Signals, found {flights.signals!r}; describe them first."
        )
    if not isinstance(flights.controller, UnboundFamily):
        raise InvalidInput(
            "Campaign, controller: expected a family such as twinloop.controllers.PID, found"
            f" {type(flights.controller).__name__}; pass one that is bound to no signals."
        )
    return flights.signals, flights.controller


def _task(flights: Flights, signals: Signals) -> tuple[int, Floats, Floats]:
    """Steps of a test, where it starts and where it should end."""
    steps = _steps(number("Campaign, duration (s)", flights.duration, above=0.0), signals.dt)
    start = completed_state("Campaign, initial_state", flights.initial_state, signals)
    target = flights.target_state
    rows = _sampled(target, signals, steps) if callable(target) else target
    if lacks(rows, signals):
        rows = completed_rows("Campaign, target_state", rows, signals)
    return steps, start, checked_target("Campaign, target_state", rows, signals.n_x, steps)


def _changes(choices: Choices, signals: Signals) -> Mapping[str, object]:
    """Options other than the preset's, with those that have an argument of their own."""
    given = {} if choices.options is None else choices.options
    if not isinstance(given, Mapping):
        return given  # which is refused where options are read
    changes = dict(given)
    if choices.operators is not None:
        changes["operations" if choices.preset == "paper" else "operators"] = choices.operators
    if choices.weights:
        changes["quality_weights"] = _weighed(choices.weights, signals, choices, changes)
    return changes


def _weighed(
    weights: Mapping[str, float], signals: Signals, choices: Choices, options: Mapping[str, Any]
) -> tuple[float, ...]:
    """Weights by name as the option that holds them."""
    if choices.preset == "paper":
        raise InvalidInput(
            f"Campaign, weights: expected none with the preset 'paper', which weighs all states alike, found"
            f' {weights!r}; leave them out, or choose preset="default".'
        )
    if options.get("quality_weights"):
        raise InvalidInput(
            "Campaign: expected either weights or the option 'quality_weights', found both; leave one out."
        )
    quality = "iae" if choices.quality is None else choices.quality
    return tuple(weights_of(quality, signals, weights).tolist())


def _sampled(reference: Callable[[float], ArrayLike], signals: Signals, steps: int) -> Floats:
    """A function of time at the start of every period, and at the end of the last (steps + 1, its columns)."""
    times = [k * signals.dt for k in range(steps + 1)]
    values = [reference(t) for t in times]
    columns = columns_of(values[0], signals)
    rows = zip(times, values, strict=True)
    return np.array([floats(f"Campaign, target_state({t:g} s)", row, (columns,)) for t, row in rows])


def _check_use(options: AnyOptions, signals: Signals) -> None:
    """Refuses formulas and settings of searches now rather than after the first flight."""
    if isinstance(options, DefaultOptions):
        pool = Pool(signals.n_x + signals.n_u)
        for text in options.seed_terms:
            parsed_term(text, pool, signals)
        priors_of(options, pool, signals)
    if isinstance(options, Options):
        grammar(options, signals)
        variation(options, options.model_population)
        settings_of_tests(options)


def _purpose(choices: Choices, options: AnyOptions, signals: Signals) -> tuple[str, Quality]:
    """What flights are for and what is minimised; the paper knows one answer to each."""
    goal, quality = choices.goal, choices.quality
    if isinstance(options, DefaultOptions):
        purpose = "both" if goal is None else goal
        kind = "iae" if quality is None else quality
        for what, named, known in (("goal", purpose, GOALS), ("quality", kind, KINDS)):
            if named not in known:
                raise unknown(what, named, known)
        for name in ("quality_weights", "initial_range", "target_range"):
            numbers = getattr(options, name)
            if len(numbers) not in (0, signals.n_x) or not all(0.0 <= value < math.inf for value in numbers):
                raise InvalidInput(
                    f"Option {name!r}: expected {signals.n_x} finite numbers of at least 0, one a state, or none, found"
                    f" {numbers}; write one for each."
                )
        if options.quality_weights and not any(
            (*options.quality_weights, options.effort, options.effort_rate)
        ):
            raise InvalidInput(
                "Option 'quality_weights', or weights: expected one state to count at least, found 0 for each; any"
                " flight would be as good as any other."
            )
        weights, effort, rate = options.quality_weights, options.effort, options.effort_rate
        return purpose, quality_of(kind, signals, weights, effort, rate)
    for what, value, only in (("goal", goal, "both"), ("quality", quality, "final_distance")):
        if value not in (None, only):
            raise InvalidInput(
                f"Campaign, {what}: expected {only!r} with the preset {choices.preset!r}, found {value!r}; leave it"
                ' out, or choose preset="default".'
            )
    return "both", quality_of("final_distance", signals)


def _check_ends(setup: Setup) -> None:
    """Refuses a start or target that cannot be flown from or to."""
    ends = [("initial_state", setup.initial_state)]
    ends += [("target_state", row) for row in np.atleast_2d(setup.target_state)]
    for what, state in ends:
        _check_reachable(f"Campaign, {what}", state, setup.limits)
        if isinstance(setup.options, DefaultOptions):
            _check_inside(f"Campaign, {what}", state, setup.signals, setup.options.margin)


def _check_reachable(what: str, values: Floats, limits: Limits) -> None:
    """Refuses a start or target where every run would have been cut."""
    for value, state, limit in zip(values, limits.signals.states, limits.states, strict=True):
        if abs(value) >= limit:
            raise InvalidInput(
                f"{what}: expected {state.name} within {in_unit(f'{limit:g}', state.unit)}, the divergence factor"
                f" times its scale, found {value:g}; give it in the unit that is declared, or declare a larger scale."
            )


def _check_inside(what: str, values: Floats, signals: Signals, margin: float) -> None:
    """Refuses a start or target that no flight could keep the envelope with."""
    for value, state in zip(values, signals.states, strict=True):
        if state.envelope is not None:
            low, high = state.envelope
            room = 0.5 * margin * (high - low)
            if state.period is not None:
                middle = 0.5 * (low + high)
                value -= round((value - middle) / state.period) * state.period
            if not low + room <= value <= high - room:
                raise InvalidInput(
                    f"{what}: expected {state.name} within {in_unit(f'{low + room:g} to {high - room:g}', state.unit)},"
                    f" its envelope less the margin of {margin:g}, found {value:g}; declare a wider envelope, or move"
                    " it."
                )


def _fields(options: AnyOptions) -> tuple[dataclasses.Field[Any], ...]:
    return dataclasses.fields(options)


def refuse_arguments(where: str, found: Mapping[str, object], known: Sequence[str]) -> None:
    """Refuses arguments that this version does not have, by name.

    Args:
        where: what they were passed to.
        found: the arguments beside the known ones.
        known: names of the arguments that there are.

    Raises:
        InvalidInput: there is one.
    """
    for name in found:
        if difflib.get_close_matches(name, known, n=1, cutoff=0.75):
            raise unknown(f"argument of {where}", name, known)
        raise InvalidInput(
            f"{where}: expected arguments among {', '.join(known)}, found {name!r}, "
            "which this version does not have; leave it out."
        )


def _steps(duration: float, dt: float) -> int:
    periods = duration / dt
    if not periods <= MOST_STEPS:
        raise InvalidInput(
            f"Campaign, duration: expected at most {MOST_STEPS} periods of {dt:g} s, found {duration:g} s; choose a"
            " longer period or a shorter flight."
        )
    steps = round(periods)
    if abs(steps * dt - duration) > 1e-6 * duration or steps < 2:
        raise InvalidInput(
            f"Campaign, duration: expected a whole number of periods of {dt:g} s, at least 2, "
            f"found {duration:g} s; choose {max(2, steps) * dt:g} s."
        )
    return int(steps)

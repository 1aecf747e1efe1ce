"""The presets, and every option by name: what the paper leaves open, and each idea that goes beyond it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, overload

import numpy as np

from twinloop._experiment.limits import DIVERGENCE_FACTOR
from twinloop._ground.arrays import number
from twinloop._ground.texts import text
from twinloop.errors import InvalidInput, unknown
from twinloop.identification.settings import FORMS as ALL_FORMS
from twinloop.identification.settings import LEAST_MOVES, IdentificationOptions
from twinloop.identification.terms.libraries import LIBRARIES
from twinloop.law.forms import FORMS
from twinloop.planning.settings import TESTS, PlanningOptions

TRADEOFFS = ("raw", "normalised")


@dataclass(frozen=True)
class Options:
    """Options of a campaign; "the paper" is stated there, "our choice" is where it is silent.

    Args:
        model_population: models in the population (the paper).
        model_generations: generations of the model loop in each iteration (the paper).
        test_population: tests in the population (the paper).
        test_generations: generations of the test loop; None: a thirtieth of the models' with two objectives, a
            twentieth with three, at least 1 (the ratios of the paper's Table I).
        form: what a program's outputs mean, "absolute", "increment", "acceleration", "explicit-euler" or
            "semi-implicit-euler" (our choice).
        spare_registers: registers beside inputs and outputs (our choice).
        pages: pages of a program (the paper).
        page_length: instructions of a page (the paper).
        operations: what an instruction may compute (the paper).
        writable_inputs: whether an input register may be written (the paper).
        constant_share: share of second operands that are constants (our choice).
        constant_low: smallest magnitude of a new constant (our choice).
        constant_high: largest magnitude of a new constant (our choice).
        constant_step: relative standard deviation of a constant's mutation (our choice).
        mutation_rate: probability that an instruction mutates (our choice).
        aligned_pages: probability that crossover swaps pages at the same place (our choice).
        mutation_share: share of offspring made by mutation (our choice).
        crossover_share: share of offspring made by crossover (our choice).
        reproduction_share: share of offspring that are copies (our choice).
        elite_share: share of the population that is copied unchanged (our choice; elitism is the paper's).
        ranking_pressure: of the linear ranking, 1 to 2 (our choice; ranking selection is the paper's).
        divergence_factor: multiple of a state's scale beyond which a run counts as diverged (our choice).
        archive_cap: largest size of a non-dominated set (our choice).
        committee_size: members of the non-dominated set that judge tests (our choice).
        tradeoff: distance to the ideal point with objectives as they are, "raw" (the paper), or "normalised".
        control_quality: whether the test loop has the third objective (the paper's option).
        distance_cap: a final distance counts at most this many distances from start to target (our choice).
        mutants: mutants on which a test's instability is judged (our choice).
        mutant_step: standard deviation of a mutant's step, in ranges of the gain (our choice).
        test_mutation_step: standard deviation of a test's mutation, in ranges of the gain (our choice).

    Raises:
        InvalidInput: a value out of range.
    """

    model_population: int = 250
    model_generations: int = 15_000
    test_population: int = 100
    test_generations: int | None = None
    form: str = "absolute"
    spare_registers: int = 4
    pages: int = 5
    page_length: int = 10
    operations: tuple[str, ...] = ("+", "-", "*", "/")
    writable_inputs: bool = True
    constant_share: float = 0.5
    constant_low: float = 1e-3
    constant_high: float = 10.0
    constant_step: float = 0.1
    mutation_rate: float = 0.02
    aligned_pages: float = 0.5
    mutation_share: float = 0.6
    crossover_share: float = 0.3
    reproduction_share: float = 0.1
    elite_share: float = 0.1
    ranking_pressure: float = 1.8
    divergence_factor: float = DIVERGENCE_FACTOR
    archive_cap: int = 10_000
    committee_size: int = 100
    tradeoff: str = "raw"
    control_quality: bool = False
    distance_cap: float = 3.0
    mutants: int = 10
    mutant_step: float = 0.05
    test_mutation_step: float = 0.1

    @property
    def identifies(self) -> Literal[False]:
        """Whether a twin is identified by regression, with its noise and a committee, and not evolved as a whole."""
        return False

    @property
    def example(self) -> str:
        """An option with another value, as text."""
        return "pages=3"

    def __post_init__(self) -> None:
        _check(self, RANGES["paper"])
        for name in ("form", "tradeoff"):
            if getattr(self, name) not in CHOICES["paper"][name]:
                raise unknown(f"value of the option {name!r}", getattr(self, name), CHOICES["paper"][name])
        if self.constant_low >= self.constant_high:
            raise InvalidInput(
                f"Options constant_low, constant_high: expected low < high, found {self.constant_low:g} and "
                f"{self.constant_high:g}; exchange or widen them."
            )
        shares = self.mutation_share + self.crossover_share + self.reproduction_share
        if abs(shares - 1.0) > 1e-9:
            raise InvalidInput(
                "Options mutation_share, crossover_share, reproduction_share: expected a sum of 1, "
                f"found {shares:g}; change one of them."
            )
        if not self.operations:
            raise InvalidInput(
                "Option 'operations': expected at least one, found none; name one, such as '+'."
            )

    @property
    def generations_of_tests(self) -> int:
        """Generations of the test loop; by default with Table I's ratio."""
        if self.test_generations is not None:
            return self.test_generations
        return max(1, self.model_generations // (20 if self.control_quality else 30))


@dataclass(frozen=True)
class DefaultOptions(PlanningOptions, IdentificationOptions):
    """Options of the preset `default`: how a twin is identified, then how tests are planned.

    `IdentificationOptions` and `PlanningOptions` describe them.

    Raises:
        InvalidInput: a value out of range.
    """

    @property
    def identifies(self) -> Literal[True]:
        """Whether a twin is identified by regression, with its noise and a committee, and not evolved as a whole."""
        return True

    @property
    def example(self) -> str:
        """An option with another value, as text."""
        return "lags=false"

    def __post_init__(self) -> None:
        _check(self, RANGES["default"])
        for name in ("form", "tests"):
            if getattr(self, name) not in CHOICES["default"][name]:
                raise unknown(f"value of the option {name!r}", getattr(self, name), CHOICES["default"][name])
        for name in self.libraries:
            if name not in LIBRARIES:
                raise unknown("library", name, LIBRARIES)
        for name in self.operators:
            if name not in OPERATORS:
                raise unknown("operator", name, OPERATORS)
        if not self.libraries and (self.generations == 0 or not self.operators):
            raise InvalidInput(
                "Options libraries, generations, operators: expected a library or evolved programs, found neither;"
                " name a library, or set generations above 0 and name operators."
            )


OPERATORS = ("+", "-", "*", "/", "min", "max", "sin", "cos", "tanh", "exp", "sqrt", "abs")
"""What an evolved program may compute."""
AnyOptions = Options | DefaultOptions
"""Options of some preset."""

_MANY = 10**9
_DEFAULT_RANGES: dict[str, tuple[float, float]] = {
    "generations": (0, 100_000),
    "restarts": (1, 1000),
    "population": (10, 3000),
    "longest": (1, 1000),
    "moves": (LEAST_MOVES, _MANY),
    "starts": (1, 1000),
    "largest": (1, 200),
    "most_terms": (1, 3000),
    "most_readings": (10, 10_000_000),
    "longest_delay": (0, 100),
    "tuning_steps": (0, 1000),
    "passes": (1, 10),
    "committee_size": (1, 1000),
    "divergence_factor": (1, 1e6),
    "excitation": (0, 10),
    "excitation_most": (0, 10),
    "fade": (0, 1),
    "candidates": (2, 100_000),
    "nearness": (0, 1),
    "worse": (0, 10),
    "accuracy": (0, 1),
    "draws": (1, 1000),
    "margin": (0, 0.99),
    "reach_first": (0.01, 1),
    "reach_far": (0.01, 1),
    "reach_least": (0.01, 1),
    "reach_rest": (0, 1),
    "reach_growth": (0.1, 100),
    "reach_seen": (0, 1e6),
    "delay_least": (0, 10),
    "evaluations": (64, _MANY),
    "tuning_starts": (1, 100),
    "tuning_members": (1, 1000),
    "confidence": (0, 1),
    "effort": (0, 1e12),
    "effort_rate": (0, 1e12),
}
_RANGES: dict[str, tuple[float, float]] = {
    "model_population": (2, _MANY),
    "model_generations": (1, _MANY),
    "test_population": (2, _MANY),
    "test_generations": (1, _MANY),
    "spare_registers": (0, 1000),
    "pages": (1, 10_000),
    "page_length": (1, 10_000),
    "constant_share": (0, 1),
    "constant_low": (1e-12, 1e12),
    "constant_high": (1e-12, 1e12),
    "constant_step": (0, 10),
    "mutation_rate": (0, 1),
    "aligned_pages": (0, 1),
    "mutation_share": (0, 1),
    "crossover_share": (0, 1),
    "reproduction_share": (0, 1),
    "elite_share": (0, 1),
    "ranking_pressure": (1, 2),
    "divergence_factor": (1, 1e6),
    "archive_cap": (2, _MANY),
    "committee_size": (2, _MANY),
    "distance_cap": (1e-6, 1e6),
    "mutants": (2, 10_000),
    "mutant_step": (1e-9, 1),
    "test_mutation_step": (1e-9, 1),
}
RANGES = {"default": _DEFAULT_RANGES, "paper": _RANGES}
"""Least and greatest value of options, by preset and name; None is none of them."""
CHOICES: dict[str, dict[str, tuple[str, ...]]] = {
    "default": {"form": ALL_FORMS, "tests": TESTS, "libraries": LIBRARIES, "operators": OPERATORS},
    "paper": {"form": FORMS, "operations": OPERATORS, "tradeoff": TRADEOFFS},
}
"""Values of options, or of their items, by preset and name."""


@overload
def options_of(preset: Literal["paper"], changes: Mapping[str, object] | None = None) -> Options: ...
@overload
def options_of(preset: Literal["default"], changes: Mapping[str, object] | None = None) -> DefaultOptions: ...
@overload
def options_of(preset: str, changes: Mapping[str, object] | None = None) -> AnyOptions: ...
def options_of(preset: str, changes: Mapping[str, object] | None = None) -> AnyOptions:
    """A preset with some options changed.

    Args:
        preset: its name.
        changes: other values, by the names of the options.

    Returns:
        The options.

    Raises:
        InvalidInput: an unknown name, or a value that cannot be used.
    """
    if not isinstance(preset, str) or preset not in PRESETS:
        raise unknown("preset", preset, PRESETS)
    changes = {} if changes is None else changes
    if not isinstance(changes, Mapping):
        raise InvalidInput(
            f"Options: expected a dict of values by name, found {changes!r}; write {{name: value}}."
        )
    names = [field.name for field in dataclasses.fields(PRESETS[preset])]
    for name in changes:
        if name not in names:
            raise unknown(f"option of the preset {preset!r}", name, names)
    return dataclasses.replace(PRESETS[preset], **dict(changes))  # type: ignore[arg-type]


def parsed(preset: str, name: str, text: str) -> object:
    """The value of an option that was written as text.

    Args:
        preset: whose option it is.
        name: of the option.
        text: such as "300", "true", "none" or "+,-,*"; a comma inside brackets, as in "max(a, b)", separates nothing.

    Returns:
        A value of the option's type.

    Raises:
        InvalidInput: an unknown option, or text that is no such value.
    """
    if preset not in PRESETS:
        raise unknown("preset", preset, PRESETS)
    kinds = {field.name: str(field.type) for field in dataclasses.fields(PRESETS[preset])}
    if name not in kinds:
        raise unknown(f"option of the preset {preset!r}", name, kinds)
    kind = kinds[name]
    if kind == "str":
        return text
    if kind.startswith("tuple"):
        items = [item.strip() for item in _split(text) if item.strip()]
        return tuple(_number(name, item) for item in items) if "float" in kind else tuple(items)
    if kind == "bool" and text.lower() in ("true", "false"):
        return text.lower() == "true"
    if kind.endswith("None") and text.lower() == "none":
        return None
    return _number(name, text, kind)


def _split(text: str) -> Iterator[str]:
    """Parts of a list, between the commas outside all brackets."""
    start = depth = 0
    for i, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            yield text[start:i]
            start = i + 1
    yield text[start:]


def _number(name: str, text: str, kind: str = "float") -> float:
    try:
        return int(text) if kind.startswith("int") else float(text)
    except ValueError as reason:
        raise InvalidInput(
            f"Option {name!r}: expected {_article(kind)}, found {text!r}; write one."
        ) from reason


def _check(options: Any, ranges: Mapping[str, tuple[float, float]]) -> None:
    for field in dataclasses.fields(options):
        value = _typed(field.name, str(field.type), getattr(options, field.name))
        object.__setattr__(options, field.name, value)
    for name, (low, high) in ranges.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise InvalidInput(f"Option {name!r}: expected {low:g} to {high:g}, found {value!r}; change it.")


def _typed(name: str, kind: str, value: object) -> object:
    if kind.endswith("None") and value is None:
        return None
    if kind == "bool" and isinstance(value, (bool, np.bool_)):
        return bool(value)
    if kind.startswith("int") and isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return int(value)
    if kind == "float":
        return number(f"Option {name!r}", value)
    if kind == "str" and isinstance(value, str):
        return text(f"Option {name!r}", value)
    if kind.startswith("tuple[float") and isinstance(value, (tuple, list)):
        return tuple(number(f"Option {name!r}", each) for each in value)
    if (
        kind.startswith("tuple[str")
        and isinstance(value, (tuple, list))
        and all(isinstance(v, str) for v in value)
    ):
        return tuple(text(f"Option {name!r}", each) for each in value)
    raise InvalidInput(f"Option {name!r}: expected {_article(kind)}, found {value!r}; change it.")


def _article(kind: str) -> str:
    words = {"bool": "true or false", "str": "a word"}
    if kind.startswith("tuple"):
        return "a list of finite numbers" if "float" in kind else "a list of names"
    return words.get(kind, "a whole number")


PRESETS: dict[str, AnyOptions] = {"default": DefaultOptions(), "paper": Options()}
"""Sets of options by name."""

"""The test sheet: gains to set, start and target, the excitation, and the prediction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from twinloop._experiment.envelope import is_bounded
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated, in_unit, one_line
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import latest_lesson
from twinloop.campaign.data.begun import allowed_off
from twinloop.campaign.setup import Setup
from twinloop.controllers.in_words import formulas, reading_rules
from twinloop.faces.about_test import (
    excitation_words,
    foretold,
    hold_back_ranges,
    hold_back_words,
    reason,
    unknown_risk,
)
from twinloop.faces.cautions import band_leaves, leaving, not_reliable, serious_of, thin_margins
from twinloop.faces.ends import ends, varying, varying_words
from twinloop.faces.opening import fields_beside
from twinloop.faces.result import quality_facts
from twinloop.faces.telling import is_chosen, to_be_flown
from twinloop.faces.text import counted, quality_words, table
from twinloop.logs import TIME
from twinloop.planning.leaving import risk_of_what, risk_words
from twinloop.remarks import Remark
from twinloop.store import StoredAs
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import in_words

ROWS = 10
"""Of the predicted run on a sheet, after the first; the file has all."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A test that waits to be flown, with all that is said of it beforehand.

    Args:
        stored_as: under what the next command finds the campaign.
        test: to be flown.
        file: where its columns are.
        setup: of the campaign.
        predicted: its run on the twin; None where nothing is known yet.
        against: what speaks against the twin.
        waiting: tests that wait to be flown: of an alternative with equal gains it is said in what it differs.
        advice: to stop instead; empty where there is none.
        flown: whether any test was flown yet, recorded or failed; attached flights are of none.
        chosen: whether the campaign chose it, by `ask`; otherwise it is a person's own.
        called: what columns of logs are called, by signal, where they have other names.
        margins: what is said of them where they are thin.
    """

    stored_as: StoredAs
    test: Test
    file: str
    setup: Setup
    predicted: Trajectory | None = None
    against: Sequence[Remark] = ()
    waiting: Sequence[Test] = ()
    advice: str = ""
    flown: bool = False
    chosen: bool = False
    called: Mapping[str, str] = field(default_factory=dict)
    margins: Sequence[str] = ()

    @staticmethod
    def of(
        campaign: Campaign,
        stored_as: StoredAs,
        test: Test,
        predicted: Trajectory | None,
        file: str,
        advice: str,
    ) -> Sheet:
        """The sheet of a test of a campaign.

        Args:
            campaign: that it was made in.
            stored_as: under what the next command finds the campaign.
            test: to be flown.
            predicted: its run on the twin; None where nothing is known yet.
            file: where its columns are.
            advice: to stop instead; empty where there is none. Alternatives share it.
        """
        return Sheet(
            stored_as,
            test,
            file,
            campaign.setup,
            predicted,
            against=serious_of(latest_lesson(campaign)),
            waiting=to_be_flown(campaign),
            advice=advice,
            flown=campaign.runs > 0,
            chosen=is_chosen(campaign, test),
            called=fields_beside(stored_as.store),
            margins=thin_margins(campaign, test),
        )

    @property
    def facts(self) -> dict[str, object]:
        """What it says, for programs."""
        test, signals = self.test, self.test.family.signals
        leaves = leaving(signals, self.predicted)
        unknown = unknown_risk(test, self.flown, self.chosen) if test.risk is None else None
        return {
            "test": test.number,
            "gains": test.parameters,
            "formulas": formulas(self.setup.controller, test.family),
            "initial_state": dict(zip(signals.state_names, test.initial_state.tolist(), strict=True)),
            "target_state": {
                **dict(zip(signals.state_names, np.atleast_2d(test.target_state)[-1].tolist(), strict=True)),
                **{name: rows.tolist() for name, rows in varying(test).items()},
            },
            "steps": test.steps,
            "dt": signals.dt,
            "excited": test.excitation is not None,
            "hold_back": None if test.hold_back is None else test.hold_back.ranges(signals),
            "predicted": test.predicted,
            "spread": test.spread,
            "risk": test.risk,
            "risk_unknown": unknown,
            "band_leaves": {name: list(times) for name, times in leaves.items()},
            "serious": list(dict.fromkeys(remark.code for remark in self.against)),
            "advice": self.advice or None,
            "why": reason(test, self.predicted is not None, self.chosen),
            "file": self.file,
        }

    @property
    def text(self) -> str:
        """What it says, to be printed."""
        test, file, signals = self.test, self.file, self.test.family.signals
        units = {gain.name: gain.unit for gain in test.family.law_gains}
        gains = [[name, value, units[name]] for name, value in _set(test).items()]
        lines = [
            f"TEST {test.number} of {self.stored_as.store}: {test.steps} periods of {signals.dt:g} s",
            *([self.advice] if self.advice else []),
            "",
            _table(["set this gain", "to", "unit"], gains),
            "",
            *self._controller(),
            *_ends(test, file),
            "",
            _begin_within(test),
            "",
            excitation_words(test, file),
            *_held_back(test, file),
            *self._foreseen(),
            *band_leaves(signals, self.predicted),
            *self.margins,
            *_at_bounds(test),
            *not_reliable(self.stored_as, self.against),
            reason(test, self.predicted is not None, self.chosen),
            *_alike(test, self.waiting),
            *(f"{one}." for one in in_words(signals)),
            f"Record {', '.join(self._columns())}, then:",
            f"  {self.stored_as.to_type('tell', test.number, 'FLIGHT.csv')}",
        ]
        return "\n".join(lines) + "\n"

    def _controller(self) -> list[str]:
        """What these gains mean: nothing of a law in Python, which nobody else programs."""
        described, family = self.setup.controller, self.test.family
        lines = formulas(described, family)
        if not lines:
            return []
        rules = reading_rules(described, family.signals, lines)
        commands = "This is what they mean, in each period, in the units of the signals"
        return [
            f"{commands}:",
            "",
            *(f"  {line}" for line in lines),
            "",
            *([" ".join(rules), ""] if rules else []),
        ]

    def _foreseen(self) -> Iterator[str]:
        """The quality and the run that are predicted, and the risk."""
        test, predicted, bounded = self.test, self.predicted, is_bounded(self.test.family.signals)
        if test.predicted is not None and predicted is not None:
            measure = quality_facts(self.setup.quality)
            what = quality_words(measure["kind"], measure["unit"])
            yield f"Predicted quality, {what}: {foretold(test)}; what counts: {counted(measure)}."
            yield f"The predicted run with its band: {self.file}."
        if test.excitation is not None or predicted is not None:
            yield from ("", _expected(test, predicted), "")
        risk = (
            unknown_risk(test, self.flown, self.chosen)
            if test.risk is None
            else f"{risk_words(test.risk, self.setup.predicted_flights, bounded)}."
        )
        yield f"Risk of {risk_of_what(bounded)}: {risk}"

    def _columns(self) -> list[str]:
        """What a log of the flight has to have, as logs call it."""
        signals, called = self.test.family.signals, self.called
        read = [signals.state_names[i] for i in signals.measured]
        return [
            f"{name} ({called[name].strip()!r})" if name in called else name
            for name in (TIME, *read, *signals.command_names)
        ]


def _ends(test: Test, file: str) -> list[str]:
    """Where each state starts and leads; of a target that varies the first and the last row, for the file has all."""
    found = ends(test)
    leads = ["target"] if len(found[0].targets) == 1 else ["first target", "last target"]
    rows = [[each.state.name, each.start, *each.targets, each.state.unit] for each in found]
    lines = [_table(["state", "start", *leads, "unit"], rows)]
    if varies := varying_words(test, file):
        lines += ["", varies]
    return lines


def _expected(test: Test, predicted: Trajectory | None) -> str:
    """What is added to each command and where each state is expected to be, in a few rows of the file's."""
    signals = test.family.signals
    heads, cells = ["t, s"], [[f"{signals.dt * k:.4g}" for k in range(test.steps + 1)]]
    if test.excitation is not None:
        for i, command in enumerate(signals.commands):
            heads.append(f"add to {command.name}, {command.unit}".rstrip(", "))
            cells.append([f"{value:+.3g}" for value in test.excitation[:, i]])
    if predicted is not None:
        for i, state in enumerate(signals.states):
            heads.append(f"{state.name}, {state.unit}".rstrip(", "))
            middle = [f"{value:.3g}" for value in predicted.states[:, i]]
            if predicted.band is not None:
                ends = predicted.band[:, :, i].T
                middle = [
                    f"{one} ({low:.3g} to {high:.3g})" for one, (low, high) in zip(middle, ends, strict=True)
                ]
            cells.append(middle + ["diverged"] * (test.steps + 1 - len(middle)))
    chosen = sorted({round(k) for k in np.linspace(0, test.steps, min(test.steps, ROWS) + 1).tolist()})
    rows = [[column[k] if k < len(column) else "" for column in cells] for k in chosen]
    return _table(heads, rows)


def _at_bounds(test: Test) -> list[str]:
    """Gains at a bound of theirs, where the box decides and not the quality; those at 0 are not missed."""
    at = test.family.at_bounds(test.genes)
    ends = [
        f"{gain.name} is at its {at[gain.name]} one, {end:.4g}"
        for gain in test.family.gains
        if at[gain.name] and (end := gain.low if at[gain.name] == "lower" else gain.high) != 0.0
    ]
    return [f"Better gains may lie beyond their bounds: {enumerated(ends)}."] if ends else []


def _begin_within(test: Test) -> str:
    """How far from its start a flight may begin and still be compared."""
    allowed = zip(test.signals.states, allowed_off(test).tolist(), strict=True)
    ranges = ", ".join(f"{state.name} ± {in_unit(f'{off:.3g}', state.unit)}" for state, off in allowed)
    return f"Begin within {ranges}: a flight from elsewhere is learnt from, but its quality is not compared."


def _table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in which no line break of a text, such as a unit of somebody's, looks like a row of its own."""
    lines = [[one_line(each) if isinstance(each, str) else each for each in row] for row in rows]
    return table([one_line(head) for head in heads], lines)


def _held_back(test: Test, file: str) -> list[str]:
    """How a person's own program holds the excitation back; nothing where nothing does."""
    ranges = hold_back_ranges(test)
    if not ranges:
        return []
    units = {state.name: state.unit for state in test.family.signals.states}
    rows = [[name, inner, outer, units[name]] for name, (inner, outer) in ranges.items()]
    return [
        "",
        f"{hold_back_words(test)} {file} has the rows to be scaled. For a program that cannot do this, set hold_back ="
        " false under [options] and begin a new campaign: then the excitation stays small.",
        "",
        _table(["state", "inner range", "outer range", "unit"], rows),
    ]


def _alike(test: Test, waiting: Sequence[Test]) -> list[str]:
    """The tests that wait with the gains of this one, as far as a sheet shows them, and in what they differ."""
    return [
        f"Test {other.number}, which waits too, has these gains with {_otherwise(test, other)}."
        for other in waiting
        if other.number != test.number and _set(other) == _set(test)
    ]


def _otherwise(test: Test, other: Test) -> str:
    """In what a test with the same gains differs from another one."""
    asked = {
        "start": (test.initial_state, other.initial_state),
        "target": (test.target_state, other.target_state),
        "excitation": (test.excitation, other.excitation),
    }
    differs = [f"another {name}" for name, (one, two) in asked.items() if not _equal(one, two)]
    return enumerated(differs) if differs else "the same start, target and excitation"


def _equal(one: Floats | None, other: Floats | None) -> bool:
    return one is other if one is None or other is None else np.array_equal(one, other)


def _set(test: Test) -> dict[str, str]:
    """Gains as somebody sets them."""
    return {name: f"{value:.9g}" for name, value in test.parameters.items()}

"""The test sheet: gains to set, start and target, the excitation, and the prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from types import MappingProxyType

import numpy as np

from twinloop._experiment.envelope import is_bounded
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit, one_line, two_digits
from twinloop.campaign.data.begun import allowed_off
from twinloop.campaign.setup import Setup
from twinloop.faces.cautions import band_leaves, leaving, not_reliable
from twinloop.faces.ends import ends, varying, varying_words
from twinloop.faces.text import quality_words, table
from twinloop.logs import TIME
from twinloop.planning.leaving import risk_of_what, risk_words
from twinloop.planning.quality import quality_unit
from twinloop.remarks import Remark
from twinloop.store import StoredAs
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import in_words

ROWS = 10
"""Of the predicted run on a sheet, after the first; the file has all."""


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


def reason(test: Test, flown: bool, chosen: bool = False) -> str:
    """Why this test; of one with gains of a person's own what it is for.

    Args:
        test: to be flown.
        flown: whether there is any run yet.
        chosen: whether the campaign chose it, by `ask`; otherwise it is a person's own.
    """
    if test.reason:
        return test.reason
    if chosen:
        return "Chosen by the campaign, which tells its models apart with it: you have not vouched for these gains."
    excited = "" if test.excitation is None else ", with an excitation that shows what the commands do"
    known = (
        "nothing is known of the system before it."
        if not flown
        else "what is known comes from other flights."
    )
    return f"The controller that you already trust{excited}: {known}"


def foretold(test: Test) -> str:
    """The predicted quality with its spread; that there is none where the flight diverges on the twin.

    Args:
        test: that something was predicted of.
    """
    if test.predicted is None or not isfinite(test.predicted):
        return "none, as the flight diverges on the twin"
    return f"{test.predicted:.4g}" + ("" if test.spread is None else f" ± {test.spread:.3g}")


def unknown_risk(test: Test, flown: bool, chosen: bool = False) -> str:
    """What can be said of the risk of a test that no committee has judged: what is added to its controller's commands.

    Args:
        test: to be flown.
        flown: whether any test was flown yet, recorded or failed; attached flights are of none.
        chosen: whether the campaign chose it, by `ask`; otherwise it is a person's own.
    """
    unknown = (
        "not estimated: no committee has judged this test. Look at its gains before you fly it."
        if chosen
        else "not estimated: this test is your own, and no committee has judged it."
        if flown
        else "not estimated before the first flight."
    )
    if test.excitation is None:
        return f"{unknown} Nothing is added to the commands, so the risk is that of the controller."
    signals = test.family.signals
    text = (
        f"{unknown} It is the risk of the controller with an excitation of {_at_most(test, test.excitation)}"
    )
    ranges = {} if test.hold_back is None else test.hold_back.ranges(signals)
    if ranges:
        text += f"; it fades out as {_listed(list(ranges))} approaches the envelope, to nothing beyond the outer range"
    if unbounded := [name for name in signals.state_names if name not in ranges]:
        text += f"; it does not depend on {_listed(unbounded)}"
    return f"{text}."


def excitation_words(test: Test, file: str) -> str:
    """What is added to the commands, and where it stands.

    Args:
        test: to be flown.
        file: where its columns are.
    """
    if test.excitation is None:
        return "Excitation of the commands: none."
    return (
        f"Excitation of the commands: a row a period in {file}, {_at_most(test, test.excitation)}, added before the"
        " bounds."
    )


def hold_back_words(test: Test) -> str:
    """How a person's own program holds the excitation back; empty where nothing does.

    Args:
        test: to be flown.
    """
    if not hold_back_ranges(test):
        return ""
    return (
        "Scale it each period by the readings: the full row while every state is in its inner range, nothing once one"
        " has left its outer range, linear in between; the state with the smallest factor decides."
    )


def hold_back_ranges(test: Test) -> dict[str, tuple[str, str]]:
    """Inner and outer range of each state by which the excitation is held back, by name; empty where nothing does.

    Args:
        test: to be flown.
    """
    if test.excitation is None or test.hold_back is None:
        return {}
    return {
        name: (_range(ranges["full"]), _range(ranges["none"]))
        for name, ranges in test.hold_back.ranges(test.family.signals).items()
    }


def _at_most(test: Test, excitation: Floats) -> str:
    shares = [
        100.0 * float(size) / (command.bounds[1] - command.bounds[0])
        for size, command in zip(np.abs(excitation).max(axis=0), test.family.signals.commands, strict=True)
    ]
    return f"at most {two_digits(max(shares))} % of a command's range"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def facts(
    test: Test,
    file: Path,
    flown: bool,
    predicted: Trajectory | None,
    against: Sequence[Remark],
    advice: str = "",
    chosen: bool = False,
) -> dict[str, object]:
    """The sheet as values.

    Args:
        test: to be flown.
        file: where its columns are.
        flown: whether any test was flown yet, recorded or failed; attached flights are of none.
        predicted: its run on the twin; None where nothing is known yet.
        against: what speaks against the twin.
        advice: to stop instead; empty where there is none.
        chosen: whether the campaign chose it, by `ask`; otherwise it is a person's own.
    """
    signals = test.family.signals
    return {
        "test": test.number,
        "gains": test.parameters,
        "initial_state": dict(zip(signals.state_names, test.initial_state.tolist(), strict=True)),
        "target_state": {
            **dict(zip(signals.state_names, np.atleast_2d(test.target_state)[-1].tolist(), strict=True)),
            **{name: rows.tolist() for name, rows in varying(test).items()},
        },
        "steps": test.steps,
        "dt": signals.dt,
        "excited": test.excitation is not None,
        "hold_back": None if test.hold_back is None else test.hold_back.ranges(test.family.signals),
        "predicted": test.predicted,
        "spread": test.spread,
        "risk": test.risk,
        "risk_unknown": unknown_risk(test, flown, chosen) if test.risk is None else None,
        "band_leaves": {name: list(times) for name, times in leaving(signals, predicted).items()},
        "serious": list(dict.fromkeys(remark.code for remark in against)),
        "advice": advice or None,
        "why": reason(test, predicted is not None, chosen),
        "file": str(file),
    }


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
    """The tests that wait with the gains of this one, as far as a sheet shows them."""
    return [
        f"Test {other.number}, which waits too, has these gains with another excitation."
        for other in waiting
        if other.number != test.number and _set(other) == _set(test)
    ]


def _set(test: Test) -> dict[str, str]:
    """Gains as somebody sets them."""
    return {name: f"{value:.9g}" for name, value in test.parameters.items()}


def _range(ends: list[float | None]) -> str:
    low, high = ("any" if end is None else f"{end:.4g}" for end in ends)
    return f"{low} to {high}"


def sheet(
    stored_as: StoredAs,
    test: Test,
    predicted: Trajectory | None,
    file: str,
    setup: Setup,
    against: Sequence[Remark] = (),
    waiting: Sequence[Test] = (),
    advice: str = "",
    flown: bool = False,
    chosen: bool = False,
    called: Mapping[str, str] = MappingProxyType({}),
    margins: Sequence[str] = (),
) -> str:
    """The test sheet, to be printed.

    Args:
        stored_as: under what the next command finds the campaign.
        test: to be flown.
        predicted: its run on the twin; None where nothing is known yet.
        file: where its columns are.
        setup: of the campaign.
        against: what speaks against the twin.
        waiting: tests that wait to be flown: of an alternative with equal gains it is said in what it differs.
        advice: to stop instead; empty where there is none.
        flown: whether any test was flown yet, recorded or failed; attached flights are of none.
        chosen: whether the campaign chose it, by `ask`; otherwise it is a person's own.
        called: what columns of logs are called, by signal, where they have other names.
        margins: what is said of them where they are thin.
    """
    signals, units = test.family.signals, {gain.name: gain.unit for gain in test.family.law_gains}
    gains = [[name, value, units[name]] for name, value in _set(test).items()]
    lines = [
        f"TEST {test.number} of {stored_as.store}: {test.steps} periods of {signals.dt:g} s",
        *([advice] if advice else []),
        "",
        _table(["set this gain", "to", "unit"], gains),
        "",
        *_ends(test, file),
        "",
        _begin_within(test),
        "",
        excitation_words(test, file),
        *_held_back(test, file),
    ]
    if test.predicted is not None and predicted is not None:
        quality = setup.quality
        measure = quality_words(quality.kind, quality_unit(quality))
        lines.append(
            f"Predicted quality, {measure}: {foretold(test)}; the predicted run with its band: {file}."
        )
    if test.excitation is not None or predicted is not None:
        lines += ["", _expected(test, predicted), ""]
    bounded = is_bounded(signals)
    risk = (
        unknown_risk(test, flown, chosen)
        if test.risk is None
        else f"{risk_words(test.risk, setup.predicted_flights, bounded)}."
    )
    lines.append(f"Risk of {risk_of_what(bounded)}: {risk}")
    lines += band_leaves(signals, predicted)
    lines += margins
    lines += not_reliable(stored_as, against)
    lines += [reason(test, predicted is not None, chosen), *_alike(test, waiting)]
    lines += [f"{one}." for one in in_words(signals)]
    read = [signals.state_names[i] for i in signals.measured]
    columns = [
        f"{name} ({called[name].strip()!r})" if name in called else name
        for name in (TIME, *read, *signals.command_names)
    ]
    lines.append(f"Record {', '.join(columns)}, then:")
    lines.append(f"  {stored_as.to_type('tell', test.number, 'FLIGHT.csv')}")
    return "\n".join(lines) + "\n"

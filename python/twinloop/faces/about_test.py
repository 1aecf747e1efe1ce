"""About a test: what its sheet and the dashboard's card say of its reason, prediction, risk and excitation."""

from __future__ import annotations

from math import isfinite

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import two_digits
from twinloop.test import Test


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


def _range(ends: list[float | None]) -> str:
    low, high = ("any" if end is None else f"{end:.4g}" for end in ends)
    return f"{low} to {high}"

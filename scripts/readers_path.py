"""How many stops a reader makes who follows one run from `tell` to a printed coefficient.

A campaign of the preset `default` is flown twice. While its second run is told, learnt and printed, every call of a
Python function of the package is watched. The coefficient that is followed is the first number of the first equation.

Going back from it, a function has *made* a number if it is the innermost one that had it first: in what it returned, or
in what it passed to another function. A number that neither what a function returns nor what it was given holds is
gone; whoever has it later has made it again. Into a number went the engine's objects, the coefficients, the noise and
the arrays in the arguments of the function that made it; so on, until only readings are left, and what was known
before. A *stop* is then a function

1. that made the coefficient, or what went into it, or that called, over any number of others, a function that did;
2. that returns a value which holds the coefficient, as a number or as text; or
3. that is given the run while it is told, and returns or stores a value which holds it; not on behalf of one that does
   neither, such as one that looks at the run and warns.

Not counted are methods between double underscores, and accessors: one expression without a call of another function of
the package. A function within a function is read with it. Numbers of fewer than 12 characters are those that people
write: they do not tell where they come from. Of long arrays some numbers are looked at, not all.

A *room* is a folder of the package. A *return* is a stop that was not called by the one met before it: there the reader
goes back to a page that he has left.

    python scripts/readers_path.py [--list] [--system quadrotor] [--smoke]
"""

from __future__ import annotations

import argparse
import ast
import copy
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from types import CodeType, FrameType

import numpy as np

import twinloop as tl
from twinloop import _core

PACKAGE = str(Path(tl.__file__).parent) + "/"
SIDE_BY_SIDE = PACKAGE + "_ground/side_by_side.py"
"""What is read as a list of what some work makes of each of several things, wherever that is done."""
ENGINE = tuple(kind for kind in vars(_core).values() if isinstance(kind, type))
CHARACTERS, DEEPEST, SAMPLES = 12, 12, 16
LEFT_OUT = {"Signals", "Setup", "Pool", "Planner"}
"""What any function may look at, whatever is learnt."""
SMOKE = {"moves": 1500, "starts": 1, "generations": 1, "population": 20, "evaluations": 128, "candidates": 24,
         "committee_size": 4, "tuning_steps": 4, "draws": 2, "tuning_starts": 1}  # fmt: skip
Name = tuple[str, str]
"""File and function."""


@dataclass(eq=False)
class Call:
    """A call of a function of the package.

    Args:
        name: of the function.
        caller: the call that it is a part of.
        arguments: until it returns.
        number: of the call.
        begun: how many numbers had been made before it.
        given: whether an argument holds what is sought; `owned`: whether the first one does.
        returns: whether it has returned what is sought.
        sources: who made what went into what it has made; None: it has made nothing.
    """

    name: Name
    caller: Call | None
    arguments: list[object]
    number: int
    begun: int
    given: bool = False
    owned: bool = False
    returns: bool = False
    sources: list[Call] | None = None


class Watch:
    """Watches calls: who made which number, and who returned what holds the one that is looked for."""

    def __init__(self, sought: Callable[[object], bool]) -> None:
        self.sought = sought
        self.made_by: dict[object, Call | None] = {}
        self.stack: list[Call] = []
        self.entered: list[object] = []
        self.handed: list[Call] = []
        self.calling: set[Name] = set()
        self.count = 0
        self._known: dict[int, bool] = {}
        self._within: dict[int, frozenset[object]] = {}
        self._alive: list[object] = []
        self._open: set[int] = set()

    def __call__(self, frame: FrameType, event: str, answer: object) -> None:
        code = frame.f_code
        if (
            event not in ("call", "return")
            or not code.co_filename.startswith(PACKAGE)
            or code.co_name[0] == "<"
            or code.co_filename == SIDE_BY_SIDE
        ):
            return
        if event == "call":
            caller = self.stack[-1] if self.stack else None
            arguments = list(frame.f_locals.values())
            self.count += 1
            call = Call(_name(code), caller, arguments, self.count, len(self.entered))
            if caller is not None and caller.name != call.name:
                self.calling.add(caller.name)
            given = [self.holds(each, caller) for each in arguments]
            call.given, call.owned = any(given), given[:1] == [True]
            self.stack.append(call)
        else:
            call = self.stack.pop()
            call.returns = self.holds(answer, call)
            stores = call.given and not call.owned and self.holds(call.arguments[0], call)
            if call.returns or stores:
                self.handed.append(call)
            self._forget(call, answer)
            call.arguments = []

    def _forget(self, call: Call, answer: object) -> None:
        """Numbers that were made since a call began, and that nothing holds once it has returned, are gone."""
        pending = self.entered[call.begun :]
        if pending:
            held = [self._tokens(each) for each in (answer, *call.arguments)]
            left = [token for token in pending if any(token in tokens for tokens in held)]
            for token in set(pending).difference(left):
                del self.made_by[token]
            self.entered[call.begun :] = left

    def _tokens(self, value: object, deep: int = DEEPEST) -> frozenset[object]:
        """Numbers and engine objects within a value."""
        if isinstance(value, float):
            return frozenset([abs(float(value))])
        if value is None or isinstance(value, (int, str, type, Path)) or deep < 0:
            return frozenset()
        key = id(value)
        if key in self._within:
            return self._within[key]
        self._within[key] = frozenset()
        own = [key] if isinstance(value, ENGINE) else []
        found = frozenset(own).union(*(self._tokens(part, deep - 1) for part in parts_of(value)))
        if key in self._known:
            self._within[key] = found
        else:
            del self._within[key]
        return found

    def holds(self, value: object, maker: Call | None, deep: int = DEEPEST) -> bool:
        """Whether a value holds what is sought; all numbers in it that are new were made by a call."""
        if isinstance(value, float):
            if len(repr(float(value))) >= CHARACTERS:
                self._enter(abs(float(value)), maker)
            return self.sought(value)
        if isinstance(value, str):
            return self.sought(value)
        if value is None or isinstance(value, (int, type, Path)) or deep < 0:
            return False
        key = id(value)
        if key in self._known:
            return self._known[key]
        if key in self._open:
            return False
        self._open.add(key)
        if isinstance(value, ENGINE):
            self._enter(key, maker)
        found = self.sought(value)
        for part in parts_of(value):
            found = self.holds(part, maker, deep - 1) or found
        self._open.discard(key)
        if isinstance(value, (np.ndarray, tuple, *ENGINE)) or _frozen(value):
            self._known[key] = found
            self._alive.append(value)
        return found

    def _enter(self, token: object, maker: Call | None) -> None:
        if token not in self.made_by:
            self.made_by[token] = maker
            self.entered.append(token)
            if maker is not None and maker.sources is None:
                tokens = frozenset().union(*(self._tokens(each) for each in ingredients(maker.arguments)))
                maker.sources = [self.made_by[each] for each in tokens if self.made_by.get(each) is not None]


def parts_of(value: object) -> list[object]:
    """What a value is made of."""
    if isinstance(value, np.ndarray):
        if value.dtype != np.float64 or not value.size:
            return []
        flat = value.reshape(-1)
        return flat[:: max(1, flat.size // SAMPLES)].tolist()
    if isinstance(value, _core.Model):
        return [value.constants]
    if isinstance(value, dict):
        return list(value.values())
    if isinstance(value, (list, tuple, set, frozenset)):
        return list(value)
    if type(value).__module__.startswith("twinloop.") and type(value).__name__ not in LEFT_OUT:
        return list(getattr(value, "__dict__", {}).values())
    return []


def _frozen(value: object) -> bool:
    return is_dataclass(value) and type(value).__dataclass_params__.frozen


def _name(code: CodeType) -> Name:
    return code.co_filename.removeprefix(PACKAGE), code.co_qualname.split(".<locals>")[0]


def went_into(maker: Call | None) -> list[Call]:
    """A call, those that made what went into what it made, and those above them."""
    waiting, met, found = [maker], set(), {}
    while waiting:
        call = waiting.pop()
        if call is None or call.number in met:
            continue
        met.add(call.number)
        waiting += call.sources or []
        while call is not None:
            found[call.number] = call
            call = call.caller
    return list(found.values())


def ingredients(arguments: list[object]) -> list[object]:
    """What may go into a number: arrays and numbers that are arguments, coefficients and noise of chains in them."""
    found, waiting, met = [], [], set()
    for each in arguments:
        for one in each if isinstance(each, list | tuple) else [each]:
            if isinstance(one, float | np.ndarray):
                found.append(one)
        waiting.append(each)
    while waiting:
        each = waiting.pop()
        if id(each) in met or isinstance(each, np.ndarray | str | int | float | type(None)):
            continue
        met.add(id(each))
        numbers = isinstance(each, dict) and {(type(k), type(v)) for k, v in each.items()} == {(int, float)}
        if numbers or isinstance(each, ENGINE) or type(each).__name__ == "Chain":
            found.append(each)
        else:
            waiting += parts_of(each)
    return found


def counted(names: set[Name], calling: set[Name]) -> set[Name]:
    """Names without accessors and methods between double underscores."""
    found = set()
    for file, name in names:
        last = name.rsplit(".", 1)[-1]
        if last.startswith("__") and last.endswith("__"):
            continue
        if (file, name) in calling or not _one_expression(file, name):
            found.add((file, name))
    return found


def _one_expression(file: str, name: str) -> bool:
    body: list[ast.stmt] = ast.parse((Path(PACKAGE) / file).read_text(encoding="utf-8")).body
    for part in name.split("."):
        body = next(node for node in body if getattr(node, "name", None) == part).body
    documented = isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant)
    statements = [node for node in body[documented:] if not isinstance(node, ast.Assert)]
    return len(statements) == 1 and isinstance(statements[0], ast.Return | ast.Expr)


SIGNALS = tl.Signals(
    states=[tl.State("speed", "m/s", scale=2.0)],
    commands=[tl.Command("throttle", "1", bounds=(-1.0, 1.0))],
    dt=0.05,
)


def slower(x, u):
    """A boat: what drives it, less the water's drag."""
    return [x[0] + SIGNALS.dt * (2.0 * u[0] - 0.7 * x[0] - 0.4 * abs(x[0]) * x[0])]


def campaign_of(system: str, options: dict[str, object]) -> tuple[tl.Campaign, tl.Test, tl.Trajectory]:
    if system == "boat":
        first = {"speed.kp": 0.5, "speed.ki": 0.3, "speed.kd": 0.0}
        plant = tl.systems.Simulated(SIGNALS, slower, noise=1e-3, default_gains=first)
        gains = {"speed.kp": (0.0, 3.0), "speed.ki": (0.0, 3.0), "speed.kd": (0.0, 0.1)}
        campaign = tl.Campaign(
            SIGNALS, controller=tl.controllers.PID(axes=[("speed", None)], gains=gains),
            initial_state=[0.0], target_state=[1.0], duration=5.0, options=options, progress=None,
        )  # fmt: skip
    else:
        plant = tl.systems.Quadrotor(noise=1e-3) if system == "quadrotor" else tl.systems.Quadrotor.harsh()
        campaign = tl.Campaign(
            plant.signals, controller=plant.controller, initial_state=plant.initial_state,
            target_state=plant.target_state, duration=plant.duration, options=options,
            progress=None,
        )  # fmt: skip
    first = campaign.test(plant.default_gains)
    campaign.tell(first, plant.run(first))
    test = campaign.ask()
    return campaign, test, plant.run(test)


def watched(sought: Callable[[object], bool], given: list[object], act: Callable[[], object]) -> Watch:
    watch = Watch(sought)
    for each in given:
        watch.holds(each, None, 40)
    watch._known.clear()
    sys.setprofile(watch)
    try:
        act()
    finally:
        sys.setprofile(None)
    return watch


def _goes_on(call: Call, handed: Sequence[Call]) -> bool:
    """Whether what a call hands on goes on: all that called it, but for the outermost, hand it on, too."""
    above = call.caller
    while above is not None and above.caller is not None:
        if above not in handed:
            return False
        above = above.caller
    return True


def path(system: str, options: dict[str, object]) -> tuple[str, list[tuple[Name, Name | None]]]:
    """The coefficient as it is printed, and each stop with the one that it is called by, in the order they are met."""
    campaign, test, run = campaign_of(system, options)
    ahead = copy.deepcopy(campaign)
    ahead.tell(ahead.tests[test.number], run)
    _, printed = ahead.twin.equations().split("\n\n", 1)
    text = re.search(r"\d+\.\d+", printed)[0]
    value = next(c for c in np.abs(ahead.twin.model.constants).tolist() if f"{c:.6g}" == text)
    reading = float(run.states[0, 0])

    told = watched(
        lambda each: isinstance(each, float) and each == reading, [], lambda: campaign.tell(test, run)
    )
    calls = [(0, call) for call in told.handed if call.given and _goes_on(call, told.handed)]
    learnt = watched(
        lambda each: (
            abs(each) == value if isinstance(each, float) else isinstance(each, str) and text in each
        ),
        [campaign.__dict__, campaign._method.__dict__, campaign._book.__dict__],
        lambda: campaign.twin.equations(),
    )
    calls += [(1, call) for call in went_into(learnt.made_by[value])]
    calls += [(1, call) for call in learnt.handed if call.returns]
    names = counted({call.name for _, call in calls}, told.calling | learnt.calling)
    found: dict[Name, Name | None] = {}
    for _, call in sorted(calls, key=lambda each: (each[0], each[1].number)):
        if call.name in names and call.name not in found:
            above = call.caller
            while above is not None and above.name not in names:
                above = above.caller
            found[call.name] = None if above is None else above.name
    return text, list(found.items())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--list", action="store_true", help="each stop, under the one that calls it")
    parser.add_argument("--system", choices=["boat", "quadrotor", "harsh"], default="boat")
    parser.add_argument("--smoke", action="store_true", help="with little work for each step")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore", tl.RemarkWarning)
    # The path of a law that is found anew is the longer one.
    text, stops = path(chosen.system, {"steady": False} | (SMOKE if chosen.smoke else {}))
    names = [name for name, _ in stops]
    returns = sum(by is not None and by != before for (_, by), before in zip(stops[1:], names, strict=False))
    files = {file for file, _ in names}
    rooms = {str(Path(file).parent) for file in files}
    if chosen.list:
        for (file, name), by in stops:
            print(f"{file:<55} {name:<40} {'' if by is None else by[1]}")
    print(
        f"the coefficient {text}: {len(stops)} stops in {len(files)} files of {len(rooms)} rooms, {returns} returns"
    )


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("Interrupted: nothing was counted.")

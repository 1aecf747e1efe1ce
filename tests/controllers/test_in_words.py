"""The formulas of a controller in words give the commands that the controller sends."""

import math
import re

import numpy as np
import pytest

import twinloop as tl
from twinloop.controllers.in_words import formulas, reading_rules

DT = 0.02
STATES = [
    tl.State("roll", "rad", 1.0),
    tl.State("roll_rate", "rad/s", 4.0, derivative_of="roll"),
    tl.State("yaw", "rad", 3.0, periodic=True),
    tl.State("yaw_rate", "rad/s", 4.0, derivative_of="yaw"),
]
SIGNALS = tl.Signals(
    STATES, [tl.Command("left", "N", (-0.7, 1.1)), tl.Command("right", "N", (-1.0, 0.8))], DT
)
MIXED = tl.controllers.Mixer(np.array([[1.0, -0.5], [-1.0, -0.25]]), np.array([0.3, -0.2]), power=0.5)
AXES = [("roll", "roll_rate"), ("yaw", None)]
GAINS = {f"{axis}.{term}": (0.0, 2.0) for axis in ("roll", "yaw") for term in ("kp", "ki", "kd")}
CASCADE = {"roll.kp": (0.0, 6.0), "yaw.kp": 3.0} | {
    f"{axis}_rate.{term}": (0.0, 1.0) for axis in ("roll", "yaw") for term in ("kp", "ki", "kd")
}
FAMILIES = {
    "pid": tl.controllers.PID(AXES, GAINS, MIXED, anti_windup="clamping", derivative_filter=0.03),
    "bare": tl.controllers.PID(AXES, {**GAINS, "roll.ki": 0.0, "yaw.kd": 0.0}),
    "cascade": tl.controllers.Cascade(
        [("roll", "roll_rate"), ("yaw", "yaw_rate")], CASCADE, rate_limits={"roll_rate": 1.5},
        anti_windup="clamping",
    ),
    "feedback": tl.controllers.StateFeedback(None, (-1.0, 1.0), MIXED, integral=["yaw"]),
    "some": tl.controllers.StateFeedback(["roll", "yaw"], {"roll": (0.0, 2.0), "yaw": 0.4}),
}  # fmt: skip


class ByHand:
    """A person's program: the lines, and the rules by which they are read."""

    def __init__(self, described, family, genes):
        self.lines, self.memory, self.described = formulas(described, family), {}, described
        self.gains = family.parameters(genes)

    def command(self, state, target):
        read = dict(zip(SIGNALS.state_names, state, strict=True))
        known = {
            "clip": lambda v, low, high: min(max(v, low), high),
            "turned": lambda e: math.remainder(e, math.tau),
        }
        known["signed_power"] = lambda v, p: math.copysign(abs(v) ** p, v)
        before, self.wound = dict(self.memory), {}
        for line in self.lines:
            name, text = line.split(" = ", 1)
            filters = re.findall(r"filtered\(((?:[^()]|\([^()]*\))*)\)", text)
            for inside in filters:
                now = self._value(inside, known, read, target)
                moved = self.memory.get(("filtered", inside), now)
                moved += DT / (DT + self.described.derivative_filter) * (now - moved)
                self.memory["filtered", inside] = moved
                text = text.replace(f"filtered({inside})", f"({moved!r})")
            known[name] = self._value(text, known, read, target)
        self.memory |= {("last", name): value for name, value in read.items()}
        commands = [known[command.name] for command in SIGNALS.commands]
        self._held(before, commands)
        return commands

    def _value(self, text, known, read, target):
        for gain in sorted(self.gains, key=len, reverse=True):
            text = text.replace(gain, repr(self.gains[gain]))
        for name in sorted(read, key=len, reverse=True):
            slope = self.memory.get(("last", name), read[name])
            moved = known["turned"](read[name] - slope) if name == "yaw" else read[name] - slope
            text = text.replace(f"d({name})/dt", f"({moved / DT!r})")
            text = re.sub(rf"target of {name}\b", f"({target[SIGNALS.state_names.index(name)]!r})", text)
            text = re.sub(rf"(?<![\w∫]){name}\b", f"({read[name]!r})", text)
        for error in re.findall(r"∫(\w+)", text):
            if error not in self.wound:
                self.wound[error] = known[error] * DT
                self.memory["∫", error] = self.memory.get(("∫", error), 0.0) + self.wound[error]
            text = text.replace(f"∫{error}", f"({self.memory['∫', error]!r})")
        return eval(text, {}, known)

    def _held(self, before, commands):
        if not getattr(self.described, "anti_windup", None):
            return
        mixer, axes = self.described.output, [name for name, _ in self.described.axes]
        matrix = np.eye(2) if mixer is None else mixer.matrix
        for error, step in self.wound.items():
            axis = axes.index(error.removeprefix("e_").removesuffix("_rate"))
            pushed = self.gains[f"{error.removeprefix('e_')}.ki"] * step * matrix[:, axis]
            for push, sent, command in zip(pushed, commands, SIGNALS.commands, strict=True):
                low, high = command.bounds
                if (sent == high and push > 0.0) or (sent == low and push < 0.0):
                    self.memory["∫", error] = before.get(("∫", error), 0.0)


@pytest.mark.parametrize("described", FAMILIES.values(), ids=FAMILIES)
def test_a_program_written_by_the_formulas_sends_the_same_commands(described):
    family, stream = described.bind(SIGNALS), np.random.default_rng(5)
    for _ in range(8):
        genes = family.from_unit(stream.uniform(size=family.size))
        controller, by_hand = family.controller(genes), ByHand(described, family, genes)
        states = np.cumsum(stream.normal(0.0, 0.3, (40, 4)), axis=0)
        states[:, 2] = [math.remainder(yaw, math.tau) for yaw in states[:, 2]]
        target = stream.normal(0.0, 0.5, 4)
        for state in states:
            np.testing.assert_allclose(
                by_hand.command(state.tolist(), target.tolist()), controller.command(state, target), atol=1e-8
            )


def test_formulas_are_as_a_person_writes_them():
    described = FAMILIES["pid"]
    lines = formulas(described, described.bind(SIGNALS))
    assert lines == [
        "e_roll = target of roll - roll",
        "e_yaw = turned(target of yaw - yaw)",
        "u_roll = roll.kp * e_roll + roll.ki * ∫e_roll - roll.kd * filtered(roll_rate)",
        "u_yaw = yaw.kp * e_yaw + yaw.ki * ∫e_yaw - yaw.kd * filtered(d(yaw)/dt)",
        "left = clip(signed_power(1 * u_roll - 0.5 * u_yaw + 0.3, 0.5), -0.7, 1.1)",
        "right = clip(signed_power(- 1 * u_roll - 0.25 * u_yaw - 0.2, 0.5), -1, 0.8)",
    ]
    said = "\n".join(reading_rules(described, SIGNALS, lines))
    assert all(
        word in said for word in ("∫e", "at a bound", "d(x)/dt", "0.4 of the way", "|v|^p", "shorter way")
    )


def test_a_term_of_a_gain_that_is_fixed_at_0_is_left_out_and_what_is_not_there_is_not_explained():
    described = FAMILIES["bare"]
    lines = formulas(described, described.bind(SIGNALS))
    assert lines[2] == "left = clip(roll.kp * e_roll - roll.kd * roll_rate, -0.7, 1.1)"
    assert "/dt" not in "".join(lines) and len(reading_rules(described, SIGNALS, lines)) == 2


def test_of_a_class_in_python_there_are_no_formulas():
    class Push:
        def __init__(self, k):
            self.k = k

        def reset(self):
            pass

        def command(self, state, target):
            return [self.k, -self.k]

    described = tl.controllers.Custom(Push, {"k": (0.0, 1.0)})
    assert formulas(described, described.bind(SIGNALS)) == []

"""Controllers written in Python: the engine's bits where they say the same, one at a time, in one thread."""

import threading

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, TINY
from oracles import same_bits
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.contracts import check_controller, check_system
from twinloop.controllers import Custom

threads = set()


class PlainPid:
    """The engine's PID on the angle of the pendulum, in the same order of operations."""

    def __init__(self, kp, ki, kd):
        self.kp, self.ki, self.kd = kp, ki, kd

    def reset(self):
        self.integral = 0.0

    def command(self, state, target):
        threads.add(threading.get_ident())
        error = float(target[0] - state[0])
        self.integral += error * 0.05
        return [self.kp * error + self.ki * self.integral - self.kd * float(state[1])]


GAINS = {"kp": (0.0, 6.0), "ki": (0.0, 6.0), "kd": (0.0, 1.0)}
UNITS = {"kp": "N m/rad", "ki": "N m/(rad s)", "kd": "N m s/rad"}


@pytest.fixture
def custom(pendulum_signals):
    return Custom(PlainPid, GAINS, UNITS).bind(pendulum_signals)


@pytest.fixture
def native(pendulum_signals, pendulum_controller):
    return pendulum_controller.bind(pendulum_signals)


def test_it_keeps_to_the_contract(pendulum, pendulum_signals):
    check_controller(Custom(PlainPid, GAINS), pendulum_signals)
    gains = {name.removeprefix("angle."): value for name, value in PENDULUM_GAINS.items()}
    check_system(pendulum, Custom(PlainPid, GAINS), gains=gains, target_state=np.array([1.0, 0.0]))


def test_gains_have_names_units_and_bounds(custom):
    assert [(gain.name, gain.unit, gain.low, gain.high) for gain in custom.gains] == [
        (name, UNITS[name], *GAINS[name]) for name in GAINS
    ]


def test_a_fixed_gain_reaches_the_law(pendulum_signals):
    family = Custom(PlainPid, {"kp": (0.0, 6.0), "ki": 0.0, "kd": 0.25}).bind(pendulum_signals)
    assert family.size == 1 and family.parameters([2.0]) == {"kp": 2.0, "ki": 0.0, "kd": 0.25}
    assert family.controller([2.0]).command([0.0, 1.0], [0.5, 0.0])[0] == 0.75


def test_a_single_controller_has_the_engines_bits_and_is_clipped(custom, native):
    one, other = (family.controller([5.0, 3.0, 0.4]) for family in (custom, native))
    for _ in range(2):
        for state in np.random.default_rng(0).normal(size=(30, 2)):
            assert same_bits(one.command(state, [1.0, 0.0]), other.command(state, [1.0, 0.0]))
        one.reset()
        other.reset()


def test_roll_outs_of_many_lanes_have_the_engines_bits(custom, native, pendulum_signals):
    model = pendulum_model(pendulum_signals)
    genes = np.random.default_rng(1).random((43, 3)) * [6.0, 6.0, 1.0]
    task = _core.Task([0.0, 0.0], [1.0, 0.0], 20)
    noise = np.random.default_rng(2).normal(0.0, 0.01, (43, 21, 2))
    runs = [
        _core.rollout(model, Limits(pendulum_signals).setting(family.engine), genes, task, noise=noise)
        for family in (custom, native)
    ]
    for name in ("states", "measured", "commands", "lasted"):
        assert same_bits(*(getattr(run, name) for run in runs))


def pendulum_model(signals):
    program = _core.Program.parse(
        "program inputs=3 outputs=1 registers=5\npage 1\nr4 = sin(r0)\nr4 = r4 * -24.5\nr3 = r2 * 41.0\nr3 = r3 + r4\n"
    )
    return _core.Model(program, "acceleration", signals.engine)


def run_of(pendulum, controller, prefix, preset, options):
    campaign = tl.Campaign(
        pendulum.signals,
        controller=controller,
        initial_state=[0.0, 0.0],
        target_state=[1.0, 0.0],
        duration=1.0,
        preset=preset,
        threads=3,
        options=options,
    )
    gains = {f"{prefix}{name}": PENDULUM_GAINS[f"angle.{name}"] for name in ("kp", "ki", "kd")}
    first = campaign.test(gains, excitation=None)
    campaign.tell(first, pendulum.run(first))
    asked = campaign.ask()
    campaign.tell(asked, pendulum.run(asked))
    return asked, campaign.best_test


@pytest.mark.parametrize("preset", ["paper", "default"])
def test_a_campaign_asks_for_the_bits_that_it_asks_for_with_the_engines_law(
    pendulum, pendulum_controller, preset
):
    few = {"moves": 500, "starts": 1, "generations": 0, "lags": False, "committee_size": 3, "draws": 2}
    few |= {"tuning_steps": 4, "candidates": 8, "evaluations": 64}
    options = TINY if preset == "paper" else few
    threads.clear()
    ours = run_of(pendulum, Custom(PlainPid, GAINS), "", preset, options)
    theirs = run_of(pendulum, pendulum_controller, "angle.", preset, options)
    for one, other in zip(ours, theirs, strict=True):
        assert same_bits(one.genes, other.genes) and one.predicted == other.predicted
    assert threads == {threading.get_ident()}


class Faulty(PlainPid):
    """Breaks after some commands."""

    answer: object = [0.0]
    left = 0

    def command(self, state, target):
        type(self).left -= 1
        if type(self).left >= 0:
            return super().command(state, target)
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


@pytest.mark.parametrize(
    ("answer", "error", "sentence"),
    [
        (ZeroDivisionError("no rate"), ZeroDivisionError, "no rate"),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        # No advice about an input: the engine refuses with these kinds, too.
        (ValueError("no table"), ValueError, "^no table$"),
        (OverflowError("too far"), OverflowError, "^too far$"),
        (np.linalg.LinAlgError("singular"), np.linalg.LinAlgError, "^singular$"),
        ([0.0, 1.0], tl.InvalidInput, "1 finite numbers"),
        (None, tl.InvalidInput, "1 finite numbers, found None"),
        ("left", tl.InvalidInput, "1 finite numbers, found 'left'"),
        ([np.nan], tl.InvalidInput, "finite numbers"),
    ],
)
def test_what_a_law_raises_comes_out_of_whatever_flew_it(pendulum_signals, pendulum, answer, error, sentence):
    Faulty.answer = answer
    family = Custom(Faulty, GAINS).bind(pendulum_signals)
    model = pendulum_model(pendulum_signals)
    test = tl.Test(family, np.array([2.0, 1.0, 0.3]), np.zeros(2), np.array([1.0, 0.0]), 20)
    for fly in (
        lambda: pendulum.run(test),
        lambda: tl.Twin(model, pendulum_signals).simulate(test),
        lambda: [test.controller().command([0.0, 0.0], [1.0, 0.0]) for _ in range(6)],
    ):
        Faulty.left = 5
        with pytest.raises(error, match=sentence) as raised:
            fly()
        assert type(raised.value) is error
    # Nothing of it is left for the next one.
    Faulty.left = 10**9
    assert pendulum.run(test).ended == "completed"


def test_a_law_that_cannot_be_made_is_refused(pendulum_signals):
    class NoReset:
        def command(self, state, target):
            return [0.0]

    with pytest.raises(tl.InvalidInput, match="without reset"):
        Custom(lambda kp: NoReset(), {"kp": (0, 1)}).bind(pendulum_signals)
    with pytest.raises(
        tl.InvalidInput, match=r"kp, kq by name, found PlainPid\(kp, ki, kd\): .*'ki'; give its"
    ):
        Custom(PlainPid, {"kp": (0, 1), "kq": (0, 1)})
    with pytest.raises(tl.InvalidInput, match=r"found NoReset\(\): got an unexpected keyword argument 'kp'"):
        Custom(NoReset, {"kp": (0, 1)})
    with pytest.raises(tl.InvalidInput, match="a class of controllers"):
        Custom(None, GAINS)
    with pytest.raises(tl.InvalidInput, match="at least one gain with bounds"):
        Custom(PlainPid, {"kp": 1.0, "ki": 0.0, "kd": 0.0}).bind(pendulum_signals)
    with pytest.raises(tl.InvalidInput, match="names that can be arguments"):
        Custom(PlainPid, {"angle.kp": (0, 1)})
    with pytest.raises(tl.InvalidInput, match="units by the names"):
        Custom(PlainPid, GAINS, {"kq": "s"})
    with pytest.raises(tl.InvalidInput, match="expected a dict"):
        Custom(PlainPid, [1.0])


def test_a_campaign_with_such_controllers_has_no_record(new_campaign):
    campaign = new_campaign(controller=Custom(PlainPid, GAINS))
    with pytest.raises(tl.NotAvailable, match="Custom"):
        campaign.setup.to_record()

"""What cannot be used is refused in one sentence: what was expected, what was found; never a traceback."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from lives import made
from twinloop.campaign.presets import options_of, parsed

STATE, COMMAND = tl.State("x", "m", 1.0), tl.Command("u", "V", (-1.0, 1.0))
GAINS = {"x.kp": (0.0, 1.0), "x.ki": (0.0, 1.0), "x.kd": (0.0, 1.0)}
T, X, U = np.arange(4) * 0.1, np.zeros((4, 1)), np.zeros((3, 1))


def spoilt(array, value):
    array = np.array(array)
    array.flat[1] = value
    return array


def one_sentence(error):
    """The message, checked to be one sentence that names what was expected and what was found."""
    message = str(error)
    assert "\n" not in message
    assert message.endswith((".", "?")), message
    known = message.startswith("Unknown ") and ("did you mean" in message or "expected one of" in message)
    assert known or (re.search("expected", message, re.IGNORECASE) and "found" in message), message
    return message


DATA = {
    "a matrix for times": lambda: tl.Trajectory([[0.0, 0.1]], X, U),
    "no times": lambda: tl.Trajectory([], np.zeros((0, 1)), np.zeros((0, 1))),
    "a vector for states": lambda: tl.Trajectory(T, X[:, 0], U),
    "a row of states too few": lambda: tl.Trajectory(T, X[:-1], U),
    "as many commands as states": lambda: tl.Trajectory(T, X, np.zeros((4, 1))),
    "transposed states": lambda: tl.Trajectory(T, np.zeros((2, 4)), U),
    "NaN in states": lambda: tl.Trajectory(T, spoilt(X, np.nan), U),
    "masked states": lambda: tl.Trajectory(T, np.ma.masked_equal(X + np.arange(4.0)[:, None], 2.0), U),
    "infinity in states": lambda: tl.Trajectory(T, spoilt(X, np.inf), U),
    "NaN in commands": lambda: tl.Trajectory(T, X, spoilt(U, np.nan)),
    "NaN in times": lambda: tl.Trajectory(spoilt(T, np.nan), X, U),
    "infinity in true states": lambda: tl.Trajectory(T, X, U, true_states=spoilt(X, -np.inf)),
    "true states of another shape": lambda: tl.Trajectory(T, X, U, true_states=X[:2]),
    "times that stand still": lambda: tl.Trajectory([0.0, 0.1, 0.1, 0.2], X, U),
    "times that run back": lambda: tl.Trajectory(T[::-1], X, U),
    "words for numbers": lambda: tl.Trajectory(T, [["a"], ["b"], ["c"], ["d"]], U),
    "complex numbers": lambda: tl.Trajectory(T, X + 1j, U),
    "ragged rows": lambda: tl.Trajectory(T, [[0.0], [0.0, 1.0], [0.0], [0.0]], U),
    "an end that there is none of": lambda: tl.Trajectory(T, X, U, ended="complete"),
    "an end that is no text": lambda: tl.Trajectory(T, X, U, ended=np.array(["completed", "aborted"])),
    "no reason at all": lambda: tl.Trajectory(T, X, U, ended="aborted", reason=None),
    "a number for a reason": lambda: tl.Trajectory(T, X, U, ended="aborted", reason=7),
    "half a character in a reason": lambda: tl.Trajectory(T, X, U, ended="aborted", reason="\udcff"),
}
SIGNALS = {
    "no state": lambda: tl.Signals([], [COMMAND], 0.1),
    "no command": lambda: tl.Signals([STATE], [], 0.1),
    "something that is no state": lambda: tl.Signals(["x"], [COMMAND], 0.1),
    "a name twice": lambda: tl.Signals([STATE, STATE], [COMMAND], 0.1),
    "a state and a command of one name": lambda: tl.Signals([STATE], [tl.Command("x", "V", (0, 1))], 0.1),
    "a period of zero": lambda: tl.Signals([STATE], [COMMAND], 0.0),
    "a negative period": lambda: tl.Signals([STATE], [COMMAND], -0.1),
    "a period that is NaN": lambda: tl.Signals([STATE], [COMMAND], np.nan),
    "a period in words": lambda: tl.Signals([STATE], [COMMAND], "20 ms"),
    "bounds the wrong way round": lambda: tl.Command("u", "V", (1.0, -1.0)),
    "equal bounds": lambda: tl.Command("u", "V", (1.0, 1.0)),
    "infinite bounds": lambda: tl.Command("u", "V", (-np.inf, np.inf)),
    "one bound": lambda: tl.Command("u", "V", (1.0,)),
    "a bound alone": lambda: tl.Command("u", "V", 1.0),
    "an envelope the wrong way round": lambda: tl.State("x", "m", 1.0, envelope=(1.0, -1.0)),
    "a noise below zero": lambda: tl.State("x", "m", 1.0, noise=-1e-3),
    "a noise that is NaN": lambda: tl.State("x", "m", 1.0, noise=np.nan),
    "a noise that is a word": lambda: tl.State("x", "m", 1.0, noise="small"),
    "a scale of zero": lambda: tl.State("x", "m", 0.0),
    "a scale that is NaN": lambda: tl.State("x", "m", np.nan),
    "a scale that is true": lambda: tl.State("x", "m", True),
    "a word of Python's for a name": lambda: tl.State("lambda", "m", 1.0),
    "a unit that is a number": lambda: tl.Command("u", 3, (0.0, 1.0)),
    "the derivative of a list": lambda: tl.State("v", "m/s", 1.0, derivative_of=[]),
    "a body of lists": lambda: tl.RigidBody([[], [], []], [[], [], []]),
    "a scale beyond all numbers": lambda: tl.State("x", "m", 10**400),
    "a scale that nobody can print": lambda: tl.State("x", "m", 10**5000),
    "half a character in a unit": lambda: tl.State("x", "m\ud800", 1.0),
    "a name with a space": lambda: tl.State("roll rate", "rad/s", 1.0),
    "a name that is a number": lambda: tl.Command("1", "V", (0.0, 1.0)),
    "the derivative of nothing": lambda: tl.Signals(
        [tl.State("v", "m/s", 1.0, derivative_of="y"), STATE], [COMMAND], 0.1
    ),
    "the derivative of itself": lambda: tl.Signals(
        [tl.State("v", "m/s", 1.0, derivative_of="v")], [COMMAND], 0.1
    ),
    "derivatives in a ring": lambda: tl.Signals(
        [tl.State("v", "1", 1.0, derivative_of="w"), tl.State("w", "1", 1.0, derivative_of="v")],
        [COMMAND],
        0.1,
    ),
    "two derivatives of one state": lambda: tl.Signals(
        [STATE, *(tl.State(n, "m/s", 1.0, derivative_of="x") for n in "vw")], [COMMAND], 0.1
    ),
}
PIDS = {
    "a mixer whose unit is a number": lambda: tl.controllers.Mixer([[1.0]], unit=3),
    "a mixer without a unit": lambda: tl.controllers.Mixer([[1.0]], unit=None),
    "an unknown gain": lambda: tl.controllers.PID(axes=[("x", None)], gains={**GAINS, "x.kq": (0, 1)}),
    "a missing gain": lambda: tl.controllers.PID(axes=[("x", None)], gains={"x.kp": (0.0, 1.0)}),
    "gain bounds the wrong way round": lambda: tl.controllers.PID(
        axes=[("x", None)], gains={**GAINS, "x.kp": (1.0, 0.0)}
    ),
    "gain bounds that are NaN": lambda: tl.controllers.PID(
        axes=[("x", None)], gains={**GAINS, "x.kp": (0.0, np.nan)}
    ),
    "decades from zero": lambda: tl.controllers.PID(
        axes=[("x", None)], gains={**GAINS, "x.kp": (0.0, 1.0, "log")}
    ),
    "another scale": lambda: tl.controllers.PID(
        axes=[("x", None)], gains={**GAINS, "x.kp": (0.1, 1.0, "lin")}
    ),
    "a bound alone": lambda: tl.controllers.PID(axes=[("x", None)], gains={**GAINS, "x.kp": (1.0,)}),
    "gains in a list": lambda: tl.controllers.PID(axes=[("x", None)], gains=[1.0, 2.0, 3.0]),
    "no axis": lambda: tl.controllers.PID(axes=[], gains={}),
    "an axis twice": lambda: tl.controllers.PID(axes=[("x", None)] * 2, gains=GAINS),
    "an axis that is a word": lambda: tl.controllers.PID(axes=["x"], gains=GAINS),
    "an output that is a matrix": lambda: tl.controllers.PID(
        axes=[("x", None)], gains=GAINS, output=np.eye(2)
    ),
    "a mixer of NaN": lambda: tl.controllers.Mixer([[np.nan]]),
    "a mixer that is a vector": lambda: tl.controllers.Mixer([1.0, 2.0]),
    "an offset of another length": lambda: tl.controllers.Mixer([[1.0], [2.0]], [1.0]),
    "a power of zero": lambda: tl.controllers.Mixer([[1.0]], power=0.0),
    "an axis over no state": lambda: tl.controllers.PID(
        axes=[("z", None)], gains={name.replace("x", "z"): b for name, b in GAINS.items()}
    ).bind(tl.Signals([STATE], [COMMAND], 0.1)),
    "fewer axes than commands": lambda: tl.controllers.PID(axes=[("x", None)], gains=GAINS).bind(
        tl.Signals([STATE], [COMMAND, tl.Command("w", "V", (0.0, 1.0))], 0.1)
    ),
    "a mixer for other commands": lambda: tl.controllers.PID(
        axes=[("x", None)], gains=GAINS, output=tl.controllers.Mixer([[1.0], [1.0]])
    ).bind(tl.Signals([STATE], [COMMAND], 0.1)),
}
OPTIONS = {
    "an unknown preset": lambda: options_of("papr"),
    "an unknown option": lambda: options_of("paper", {"model_generation": 5}),
    "options in a list": lambda: options_of("paper", ["pages"]),
    "no generations": lambda: options_of("paper", {"model_generations": 0}),
    "half a generation": lambda: options_of("paper", {"model_generations": 2.5}),
    "a population of one": lambda: options_of("paper", {"model_population": 1}),
    "a share above one": lambda: options_of("paper", {"constant_share": 1.5}),
    "a share that is NaN": lambda: options_of("paper", {"elite_share": np.nan}),
    "shares that are not whole together": lambda: options_of("paper", {"mutation_share": 0.9}),
    "constants the wrong way round": lambda: options_of("paper", {"constant_low": 5.0, "constant_high": 1.0}),
    "a form that there is none of": lambda: options_of("paper", {"form": "absolut"}),
    "a trade-off that there is none of": lambda: options_of("paper", {"tradeoff": "best"}),
    "half a character in a form": lambda: options_of("paper", {"form": "increment\ud800"}),
    "half a character in a term": lambda: options_of("default", {"seed_terms": ["x\ud800"]}),
    "no operations": lambda: options_of("paper", {"operations": []}),
    "operations in one word": lambda: options_of("paper", {"operations": "+-"}),
    "an option beyond all numbers": lambda: options_of("default", {"margin": 10**400}),
    "numbers beyond all": lambda: options_of("default", {"initial_range": [10**400, 1.0]}),
    "a number for a choice": lambda: options_of("paper", {"control_quality": 1}),
    "a word for a number": lambda: parsed("paper", "pages", "three"),
    "a word for a choice": lambda: parsed("paper", "control_quality", "maybe"),
    "an option that there is none of": lambda: parsed("paper", "pagez", "3"),
}
QUADROTORS = {
    "negative noise": lambda: tl.systems.Quadrotor(noise=-1e-3),
    "noise that is NaN": lambda: tl.systems.Quadrotor(noise=np.nan),
    "signs that there are none of": lambda: tl.systems.Quadrotor(gyroscopic="printed"),
    "a massless vehicle": lambda: tl.systems.Quadrotor(mass=0.0),
    "an inertia of two axes": lambda: tl.systems.Quadrotor(inertia=(1.0, 1.0)),
    "a negative inertia": lambda: tl.systems.Quadrotor(inertia=(1.0, -1.0, 1.0)),
    "a top speed below hovering": lambda: tl.systems.Quadrotor(top_speed=100.0),
    "a negative rotor inertia": lambda: tl.systems.Quadrotor(rotor_inertia=-1.0),
    "a seed that is half": lambda: tl.systems.Quadrotor(seed=0.5),
    "a negative seed": lambda: tl.systems.Quadrotor(seed=-1),
    "a frequency of zero": lambda: tl.systems.Quadrotor(natural_frequency=0.0),
}
TABLE = {
    f"{group}: {name}": call
    for group, calls in {
        "trajectory": DATA,
        "signals": SIGNALS,
        "PID": PIDS,
        "options": OPTIONS,
        "quadrotor": QUADROTORS,
    }.items()
    for name, call in calls.items()
}


@pytest.mark.parametrize("case", TABLE)
def test_what_cannot_be_used_is_refused_in_one_sentence(case):
    with pytest.raises(tl.InvalidInput) as refusal:
        TABLE[case]()
    one_sentence(refusal.value)
    assert isinstance(refusal.value, ValueError)


def test_a_family_that_is_bound_already_is_called_that_and_not_written_out(new_campaign):
    with pytest.raises(tl.InvalidInput, match="found Family; pass one that is bound to no signals"):
        new_campaign(controller=new_campaign().family)


CAMPAIGNS = {
    "no signals": {"signals": None},
    "a controller that is none": {"controller": "PID"},
    "a controller for other states": {
        "controller": tl.controllers.PID(axes=[("x", None)], gains=GAINS),
    },
    "a start of another length": {"initial_state": [0.0]},
    "a start that is NaN": {"initial_state": [0.0, np.nan]},
    "a target that is infinite": {"target_state": [np.inf, 0.0]},
    "a target that is a matrix": {"target_state": [[1.0, 0.0]]},
    "a target that moves in one state of two": {"target_state": lambda t: [t]},
    "a target that ends too soon": {"target_state": [[0.0, 0.0], [1.0, 0.0]]},
    "a target at the start": {"target_state": [0.0, 0.0]},
    "no duration": {"duration": 0.0},
    "a negative duration": {"duration": -1.0},
    "a duration that is NaN": {"duration": np.nan},
    "a duration of one period": {"duration": 0.05},
    "a duration between two periods": {"duration": 1.03},
    "a duration of more periods than a record holds": {"duration": 1e300},
    "a preset that there is none of": {"preset": "fast"},
    "an option that there is none of": {"options": {"generations": 5}},
    "an operation that there is none of": {"options": {"operations": ["+", "pow"]}},
    "too many registers": {"options": {"spare_registers": 1000000}},
    "an elite of everyone": {"options": {"elite_share": 1.0}},
    "less pressure than none": {"options": {"ranking_pressure": 0.99}},
    "a negative seed": {"seed": -1},
    "a seed of 65 bits": {"seed": 2**64},
    "half a seed": {"seed": 0.5},
    "no threads": {"threads": 0},
    "nothing to call": {"progress": 3},
    "a misspelt argument": {"targt_state": [1.0, 0.0]},
    "an argument of another version": {"dashboard": True},
}


@pytest.mark.parametrize("case", CAMPAIGNS)
def test_a_campaign_that_cannot_work_is_refused_before_anything_is_flown(new_campaign, case):
    with pytest.raises(tl.InvalidInput) as refusal:
        new_campaign(**CAMPAIGNS[case])
    one_sentence(refusal.value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [np.float16, np.float32, np.int8])
def test_numbers_of_numpy_count_as_the_same_of_python(kind):
    """Also those that have no room for the largest number."""
    records = [
        made(
            options={"margin": of(0), "initial_range": [of(1), of(2)]},
            weights={"rate": of(2)},
            controller=tl.controllers.PID(
                axes=[("angle", "rate")],
                gains={"angle.kp": (of(0), of(6)), "angle.ki": of(1), "angle.kd": (0.0, 1.0)},
            ),
        ).setup.to_record()
        for of in (kind, float)
    ]
    assert records[0] == records[1]


@pytest.fixture
def told(new_campaign, pendulum):
    """A campaign with its first experiment, a test, and the twin."""
    campaign = new_campaign()
    first = campaign.test(PENDULUM_GAINS)
    campaign.tell(first, pendulum.run(first))
    return SimpleNamespace(campaign=campaign, system=pendulum, test=first, twin=campaign.twin)


def slower(system):
    signals = system.signals
    return tl.systems.Simulated(tl.Signals(signals.states, signals.commands, 2.0 * signals.dt), pendulum_step)


def tell_as(e, number):
    """Tells a run to a test of the campaign under another number."""
    e.campaign.tell(replace(e.test, number=number), e.campaign.experiments[0].trajectory)


CALLS = {
    "an unknown gain": lambda e: e.campaign.test({**PENDULUM_GAINS, "angle.kq": 1.0}),
    "a missing gain": lambda e: e.campaign.test({"angle.kp": 1.0}),
    "a gain out of its bounds": lambda e: e.campaign.test({**PENDULUM_GAINS, "angle.kp": 7.0}),
    "a gain that is NaN": lambda e: e.campaign.test({**PENDULUM_GAINS, "angle.kp": np.nan}),
    "a gain in words": lambda e: e.campaign.test({**PENDULUM_GAINS, "angle.kp": "high"}),
    "two gains": lambda e: e.campaign.test([1.0, 2.0]),
    "an excitation": lambda e: e.campaign.test(PENDULUM_GAINS, excitation=np.zeros(20)),
    "a test without its number": lambda e: tell_as(e, None),
    "a test whose number is half": lambda e: tell_as(e, 0.5),
    "a test with a number below zero": lambda e: tell_as(e, -1),
    "a test with a number that was not reached": lambda e: tell_as(e, 10**9),
    "no system": lambda e: e.campaign.run("rig"),
    "a system of another period": lambda e: e.campaign.run(slower(e.system), 2),
    "half an experiment": lambda e: e.campaign.run(e.system, 1.5),
    "no experiment": lambda e: e.campaign.run(e.system, 0),
    "a failure with half a character": lambda e: e.campaign.tell_failed(e.test, "cut \udcff"),
    "a withdrawal with half a character": lambda e: e.campaign.withdraw(0, "cut \udcff"),
    "no digits": lambda e: e.twin.equations(digits=0),
    "eighteen digits": lambda e: e.twin.equations(digits=18),
    "a state of another width": lambda e: e.twin.predict([0.0, 0.0, 0.0], [0.0]),
    "a state that is NaN": lambda e: e.twin.predict([0.0, np.nan], [0.0]),
    "commands of another width": lambda e: e.twin.simulate_commands([0.0, 0.0], np.zeros((3, 2))),
    "fewer commands than states": lambda e: e.twin.predict(np.zeros((3, 2)), np.zeros((2, 1))),
    "something that is no test": lambda e: e.twin.simulate([1.0, 2.0, 3.0]),
    "a run that nobody asked for": lambda e: e.system.run(PENDULUM_GAINS),
    "signals of a system that are none": lambda e: tl.systems.Simulated("angle", pendulum_step),
    "a step that is no function": lambda e: tl.systems.Simulated(e.system.signals, 3.0),
}


@pytest.mark.parametrize("case", CALLS)
def test_a_call_that_cannot_be_answered_is_refused(told, case):
    with pytest.raises(tl.InvalidInput) as refusal:
        CALLS[case](told)
    one_sentence(refusal.value)
    assert [run.test.number for run in told.campaign.experiments] == [0]


def test_a_test_of_another_system_is_refused(told, first_test, quadrotor):
    for runner in (told.system.run, told.twin.simulate):
        with pytest.raises(tl.InvalidInput, match="expected the states") as refusal:
            runner(first_test)
        one_sentence(refusal.value)
    with pytest.raises(tl.InvalidInput, match="expected the states"):
        quadrotor.run(told.test)


def test_a_test_at_another_period_is_refused(told, pendulum_controller, pendulum_signals):
    slower = tl.Signals(pendulum_signals.states, pendulum_signals.commands, 0.1)
    test = tl.Test(pendulum_controller.bind(slower), [1.0, 1.0, 0.5], [0.0, 0.0], [1.0, 0.0], 20)
    with pytest.raises(tl.InvalidInput, match=r"expected the period 0\.05 .* found 0\.1"):
        told.system.run(test)


# Systems that fail


def raising(x, u):
    raise ZeroDivisionError("motor cut out")


def late(x, u):
    if x[0] > 0.01:
        raise RuntimeError("cable torn")
    return pendulum_step(x, u)


FAILURES = {
    "raises": (raising, r"raised ZeroDivisionError at step 0: motor cut out"),
    "raises later": (late, r"raised RuntimeError at step [1-9]\d*: cable torn"),
    "returns one number too many": (lambda x, u: np.zeros(3), r"2 numbers.*found the shape \(3,\)"),
    "returns a matrix": (lambda x, u: np.zeros((1, 2)), r"2 numbers.*found the shape \(1, 2\)"),
    "returns nothing": (lambda x, u: None, r"2 numbers"),
    "returns words": (lambda x, u: ("a", "b"), r"2 numbers"),
}


@pytest.mark.parametrize("case", FAILURES)
def test_a_step_function_that_fails_says_where(new_campaign, pendulum_signals, case):
    step, sentence = FAILURES[case]
    system = tl.systems.Simulated(pendulum_signals, step, default_gains=PENDULUM_GAINS)
    campaign = new_campaign()
    with pytest.raises(tl.SystemFailure, match=sentence) as failure:
        campaign.run(system, 1)
    assert "\n" not in str(failure.value)
    assert campaign.experiments == ()


def test_what_a_failing_system_says_is_kept_whatever_is_in_it(new_campaign, pendulum):
    """Such as the name of a file in another encoding."""

    def torn(run):
        raise tl.SystemFailure("cannot read log-\udcff.csv")

    campaign = new_campaign()
    with pytest.raises(tl.SystemFailure):
        campaign.run(Lying(pendulum, torn), 1)
    assert [failure.reason for failure in campaign.failures] == [r"cannot read log-\udcff.csv"]


def test_a_run_with_more_steps_than_a_record_may_hold_is_refused_when_it_is_told(told, monkeypatch):
    monkeypatch.setattr("twinloop.trajectory.MOST_ITEMS", 10)
    with pytest.raises(tl.InvalidInput, match="less than 10 steps"):
        told.campaign.tell(told.test, told.system.run(told.test))
    assert len(told.campaign.experiments) == 1


def test_the_error_of_a_step_function_is_kept_as_the_cause(new_campaign, pendulum_signals):
    system = tl.systems.Simulated(pendulum_signals, raising, default_gains=PENDULUM_GAINS)
    with pytest.raises(tl.SystemFailure) as failure:
        new_campaign().run(system, 1)
    assert isinstance(failure.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e9])
def test_a_step_that_is_not_finite_or_far_away_ends_the_run_there(pendulum_signals, told, value):
    def step(x, u):
        return (x[0] + 0.1, 0.0) if x[0] < 0.45 else (value, 0.0)

    run = tl.systems.Simulated(pendulum_signals, step).run(told.test)
    assert run.ended == "diverged" and run.steps == 5 and run.reason
    assert np.isfinite(run.states).all()


class Lying(tl.System):
    """Answers with what it was given."""

    def __init__(self, system, answer):
        self.system, self.answer = system, answer

    @property
    def signals(self):
        return self.system.signals

    @property
    def default_gains(self):
        return PENDULUM_GAINS

    def run(self, test):
        return self.answer(self.system.run(test))


ANSWERS = {
    "another period": lambda r: tl.Trajectory(r.t * 1.1, r.states, r.commands),
    "a jittering period": lambda r: tl.Trajectory(spoilt(r.t, 0.052), r.states, r.commands),
    "nothing": lambda r: None,
    "a bare array": lambda r: r.states,
    "an empty run": lambda r: tl.Trajectory(r.t[:1], r.states[:1], r.commands[:0]),
    "a run of one step": lambda r: tl.Trajectory(r.t[:2], r.states[:2], r.commands[:1]),
    "another state too many": lambda r: tl.Trajectory(r.t, np.hstack([r.states, r.states]), r.commands),
    "millivolts for volts": lambda r: tl.Trajectory(r.t, r.states, r.commands * 1e3),
    "degrees for radians": lambda r: tl.Trajectory(r.t, r.states * 1e4 + 1e4, r.commands),
}


@pytest.mark.parametrize("case", ANSWERS)
def test_a_system_that_answers_with_something_useless_is_refused(new_campaign, pendulum, case):
    campaign = new_campaign()
    with pytest.raises(tl.InvalidInput) as refusal:
        campaign.run(Lying(pendulum, ANSWERS[case]), 2)
    one_sentence(refusal.value)
    assert campaign.experiments == ()


def test_a_jitter_within_one_percent_is_learnt_from(new_campaign, pendulum):
    campaign = new_campaign()
    honest = Lying(pendulum, lambda r: tl.Trajectory(spoilt(r.t, 0.0504), r.states, r.commands))
    assert len(campaign.run(honest, 1).experiments) == 1


def test_a_system_without_a_first_controller_says_what_to_do(new_campaign, pendulum_signals):
    bare = tl.systems.Simulated(pendulum_signals, pendulum_step)
    with pytest.raises(tl.NotAvailable, match=r"make one with campaign\.test"):
        new_campaign().run(bare, 1)


def test_data_are_copied_and_cannot_be_changed_behind_the_campaigns_back():
    states = np.zeros((4, 1))
    run = tl.Trajectory(T, states, U)
    states[:] = np.nan
    assert np.isfinite(run.states).all()
    with pytest.raises(ValueError, match="read-only"):
        run.states[0] = 1.0

"""Campaigns on a small pendulum: made, begun, lived through all events, kept in a store; and what they came to."""

from contextlib import contextmanager

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_CONTROLLER, PENDULUM_GAINS, PENDULUM_SIGNALS, TINY, pendulum_step
from twinloop.records import to_text
from twinloop.store import Store

SIGNALS, CONTROLLER = PENDULUM_SIGNALS, PENDULUM_CONTROLLER
SMALL = {
    "moves": 800, "starts": 1, "generations": 0, "lags": False, "evaluations": 128, "candidates": 24,
    "committee_size": 4, "tuning_steps": 3, "draws": 2, "tuning_starts": 1,
}  # fmt: skip
RIG = """
dt = 0.05
[states.angle]
unit = "rad"
scale = 3.141592653589793
[states.rate]
unit = "rad/s"
scale = 8.0
derivative_of = "angle"
[commands.torque]
unit = "N m"
bounds = [-2.0, 2.0]
[options]
committee_size = 4
"""
"""What a campaign file says of the signals."""
THOROUGH = {**SMALL, "moves": 1500, "evaluations": 256, "candidates": 32, "tuning_steps": 4}
"""Where it matters that the twin is right."""
OTHER_GAINS = {**PENDULUM_GAINS, "angle.kp": 1.2}

LIFE = ("tell", "tell", "ask", "ask", "tell", "tell", "ask", "tell", "own", "own")
"""Two runs before the first question, two questions at once, their answers, and runs that nobody asked for."""


FULL_LIFE = ("tell", "attach", "ask", "fail", "ask", "ask", "abandon", "tell", "attach", "attach")
"""The same with flights that nobody asked for, a test that failed and one that was never flown."""

WITHDRAWN_LIFE = (
    *("tell", "tell", "ask", "tell", "ask", "withdraw"),
    *("own", "ask", "tell", "withdraw", "tell", "ask"),
)
"""With flights that were recorded by mistake: one that a question had learnt, and one that none had."""


def new(preset, seed=0):
    return tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        preset=preset, seed=seed, options=TINY if preset == "paper" else SMALL,
    )  # fmt: skip


def lived(campaign, life, look=lambda campaign, step: campaign):
    """A campaign after its events; `look` sees it after each, and gives the campaign that goes on."""
    stream = np.random.default_rng(5)
    plant = tl.systems.Simulated(SIGNALS, pendulum_step)
    waiting = [campaign.test(gains) for gains in (PENDULUM_GAINS, OTHER_GAINS)]
    for step, event in enumerate(life):
        if event == "ask":
            waiting.append(campaign.ask())
        elif event == "attach":
            campaign.attach(plant.run(campaign.experiments[0].test))
        elif event == "fail":
            campaign.tell_failed(waiting.pop(0), "the motor cut out")
        elif event == "abandon":
            campaign.abandon(waiting.pop(0))
        elif event == "withdraw":
            campaign.withdraw(campaign.experiments[-1], "the log of another flight")
        else:
            test = campaign.test(OTHER_GAINS) if event == "own" else waiting.pop(0)
            run = plant.run(test)
            noisy = run.states + 1e-3 * stream.standard_normal(run.states.shape)
            campaign.tell(test, tl.Trajectory(run.t, noisy, run.commands))
        campaign = look(campaign, step)
    return campaign


def learnt(step, experiments, signals=SIGNALS):
    """A campaign on a pendulum that is read with noise."""
    plant = tl.systems.Simulated(signals, step)
    campaign = tl.Campaign(
        signals, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=2.0,
        threads=1, options={"moves": 3000, "generations": 0, "lags": False, "candidates": 64, "draws": 4},
    )  # fmt: skip
    stream, test = np.random.default_rng(3), campaign.test(PENDULUM_GAINS)
    for told in range(1, experiments + 1):
        run = plant.run(test)
        noisy = run.states + [1e-3, 5e-3] * stream.standard_normal(run.states.shape)
        campaign.tell(test, tl.Trajectory(run.t, noisy, run.commands))
        test = campaign.ask() if told < experiments else test
    return campaign


def with_end_stop(x, u):
    """A pendulum that hits something hard at 0.8 rad."""
    angle, rate = pendulum_step(x, u)
    return (0.8, -0.4 * abs(rate)) if angle > 0.8 else (angle, rate)


def outcome(campaign):
    """Everything that a campaign has asked and found, as one comparable value."""
    best, twin = campaign.best_test, campaign.twin
    run = twin.simulate(campaign.experiments[0].test)
    return {
        "asked": [(test.genes.tobytes(), None if test.excitation is None else test.excitation.tobytes())
                  for test in campaign._book.tests],
        "before": [run.before for run in campaign.experiments],
        "history": campaign.history,
        "program": str(twin.model.program),
        "committee": [str(member.program) for member in campaign.committee],
        "best": (best.number, best.genes.tobytes(), best.predicted, best.measured, best.reason),
        "band": None if run.band is None else run.band.tobytes(),
    }  # fmt: skip


PLANT = tl.systems.Simulated(SIGNALS, pendulum_step, default_gains=PENDULUM_GAINS)


def made(**changes):
    arguments = {
        "controller": CONTROLLER, "initial_state": [0.0, 0.0], "target_state": [1.0, 0.0], "duration": 1.0,
        "threads": 1, **changes, "options": {**SMALL, **changes.get("options", {})},
    }  # fmt: skip
    return tl.Campaign(arguments.pop("signals", SIGNALS), **arguments)


def begun(**changes):
    campaign = made(**changes)
    first = campaign.test(PENDULUM_GAINS)
    campaign.tell(first, PLANT.run(first))
    return campaign


def cut(run, steps, ended="aborted", reason="stopped"):
    rows = slice(steps + 1)
    return tl.Trajectory(run.t[rows], run.states[rows], run.commands[:steps], ended=ended, reason=reason)


def by_hand(steps, seed=0):
    """What a pilot did: a record under commands of no controller, of its own length."""
    stream, states, commands = np.random.default_rng(seed), [np.array([0.2, -0.1])], []
    for k in range(steps):
        commands.append(np.array([1.2 * np.sin(0.3 * k) + 0.4 * stream.normal()]).clip(-2.0, 2.0))
        states.append(np.array(pendulum_step(states[-1], commands[-1])))
    return tl.Trajectory(SIGNALS.dt * np.arange(steps + 1), np.array(states), np.array(commands))


def stored(path, preset="paper", **changes):
    """A campaign on the pendulum that is kept in a store."""
    arguments = {
        "controller": CONTROLLER, "initial_state": [0.0, 0.0], "target_state": [1.0, 0.0], "duration": 1.0,
        "preset": preset, "options": TINY if preset == "paper" else SMALL, "threads": 1, **changes,
    }  # fmt: skip
    return tl.Campaign(arguments.pop("signals", SIGNALS), store=path, **arguments)


def plain(campaign):
    """All of a campaign but what tells it from others."""
    record = campaign.to_record()
    return to_text(record).replace(record["logbook"]["identity"], "")


def flown(campaign, pendulum):
    """A campaign with one experiment."""
    first = campaign.test(pendulum.default_gains)
    campaign.tell(first, pendulum.run(first))
    return campaign


class StopAt:
    """A progress callback that is Ctrl-C at its n-th call."""

    def __init__(self, call):
        self.calls = call

    def __call__(self, progress):
        self.calls -= 1
        if self.calls == 0:
            raise KeyboardInterrupt


def one_writer_after_another(campaign, where, system):
    """Checks that once another one writes its campaign, the first one does not: it says so, and nothing is lost."""
    first = campaign.tests[0]
    campaign.tell(first, system.run(first))  # nobody else has opened it: nothing has happened yet
    second = stored(where)
    assert len(second.experiments) == 2
    for act in (
        lambda: campaign.tell(first, system.run(first)),
        campaign.ask,
        lambda: campaign.test(OTHER_GAINS),
    ):
        with pytest.raises(tl.StoreFailure, match="another one has opened it since"):
            act()
    assert (len(campaign.tests), len(campaign.experiments)) == (1, 2)
    second.tell(first, system.run(first))
    second.ask()
    campaign.close()
    assert plain(tl.Campaign.load(where, read_only=True)) == plain(second)
    second.close()


@contextmanager
def behind_commits(monkeypatch, happens):
    """Something happens behind each commit, before anybody can know of it."""
    whole = Store.transaction

    @contextmanager
    def transaction(store):
        with whole(store) as connection:
            yield connection
        happens()

    with monkeypatch.context() as during:
        during.setattr(Store, "transaction", transaction)
        yield


EVENTS = {
    "test": lambda campaign, run: campaign.test(OTHER_GAINS),
    "ask": lambda campaign, run: campaign.ask(),
    "tell": lambda campaign, run: campaign.tell(campaign.tests[0], run),
    "attach": lambda campaign, run: campaign.attach(run),
    "fail": lambda campaign, run: campaign.tell_failed(campaign.tests[0], "the motor cut out"),
    "abandon": lambda campaign, run: campaign.abandon(campaign.tests[1]),
    "withdraw": lambda campaign, run: campaign.withdraw(0, "the log of another flight"),
}
"""What enters something, done to a campaign with one flight and a test that waits."""

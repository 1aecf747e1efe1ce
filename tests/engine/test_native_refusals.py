"""No call of the native engine panics: what is for another campaign, empty, of another width or huge is refused.

Every function and method that `_core.pyi` names has a call that works. Each of its arguments in turn is then replaced
by that of campaigns with other signals, and by values that no campaign has.
"""

import ast
import inspect
import math
from pathlib import Path

import numpy as np
import pytest

import twinloop
from twinloop import InvalidInput, _core

STUB = ast.parse(Path(twinloop.__file__).with_name("_core.pyi").read_text(encoding="utf-8"))
REFUSALS = (InvalidInput, TypeError)
"""What a refusal may be; a TypeError only where a text, a flag or an object of the engine is asked for."""


LAWS = ("pid", "cascade", "state_feedback", "python")


class Nothing:
    """A controller that asks for nothing."""

    def __init__(self, commands):
        self.commands = commands

    def reset(self):
        pass

    def command(self, state, target):
        return np.zeros(self.commands)


class World:
    """What a campaign hands to the engine: signals of its own, and everything that is made for them.

    Args:
        n_x: states.
        n_u: commands.
        dt: period, s.
        factor: on the bounds and scales of commands.
    """

    def __init__(self, n_x, n_u, dt, factor=1.0):
        random = np.random.default_rng(n_x)
        self.n_x, self.n_u, self.dt = n_x, n_u, dt
        self.scales, self.bounds = np.ones(n_x), [(-factor, factor)] * n_u
        self.command_scales = np.full(n_u, factor)
        self.derivatives = [None] * n_x
        self.signals = _core.Signals(dt, self.scales, self.bounds, self.command_scales, self.derivatives)
        self.gain_bounds, self.output = [(0.0, 1.0, False)] * 3, (np.ones((n_u, 1)), np.zeros(n_u), 1.0)
        self.family = _core.Family.pid(self.signals, [(0, None)], self.gain_bounds, self.output)
        self.grammar = _core.Grammar(n_x + n_u, n_x, pages=2, page_length=3)
        self.program, self.other_program = self.grammar.random(n_x, 2)
        last = n_x + n_u
        constants = [f"r{last + i} = r{i} * 0.5" for i in range(n_x)]
        head = f"program inputs={n_x + n_u} outputs={n_x} registers={2 * n_x + n_u}\npage 1\n"
        self.law = _core.Program.parse(head + "\n".join(constants) + "\n")
        self.constants = [0.25] * n_x
        self.actuators = [(0.1 * dt, 1, 0.0, 0.0)] * n_u
        self.model = _core.Model(self.law, "absolute", self.signals, self.actuators)
        self.start, self.target = np.zeros(n_x), np.full(n_x, 0.5)
        self.task = _core.Task(self.start, self.target, 4)
        self.gains = np.full((1, 3), 0.5)
        self.states, self.commands = random.normal(size=(5, n_x)), random.normal(size=(4, n_u))
        self.limits = _core.Limits(self.signals)
        self.setting = _core.Setting(self.limits, self.family)
        empty = _core.SelectedTests(self.setting)
        self.selected = empty.with_test(self.gains[0], self.target, self.states, self.commands)
        self.inner = np.array([(-1.0, 1.0)] * n_x)
        self.hold_back = _core.HoldBack(self.inner, 2.0 * self.inner)
        self.ahead = _core.LookAhead(
            [self.model], self.setting, self.gains[0], self.target, 4, [(-2.0, 2.0)] * n_x
        )
        self.variation = _core.Variation(4)
        self.workers = _core.Workers(1)
        self.settings = _core.TestSettings(mutants=2)
        self.flights = _core.Flights(self.setting, self.gains, self.start[None], self.target[None], 4)
        self.quality = _core.Quality("iae", np.ones(n_x))
        self.envelope = [(-2.0, 2.0)] * n_x
        self.noise = np.zeros((1, 5, n_x))
        self.excitation, self.disturbance = np.zeros((1, 4, n_u)), np.zeros((1, 4, n_x))
        self.chains = [([i], [0.01], (0.01, 0.0, 1.0), "increment") for i in range(n_x)]
        self.records = [(self.states, np.ones((5, n_x)), self.commands)]
        features = random.normal(size=(4, n_x))
        self.readings = [(self.states[:, :1], np.ones((5, 1)), features, features, features)]
        self.regression = _core.Regression(1, dt, "acceleration", self.readings)
        self.coefficients, self.sensors, self.motion = np.ones(n_x), np.full(1, 0.1), (0.1, 0.0, 1.0)
        self.gram = self.regression.gram(self.sensors, self.motion)
        self.search = _core.ModelSearch.start(
            self.grammar, "absolute", self.variation, 0, self.selected, self.workers
        )
        self.model_of_search = self.search.best_model
        self.test_search = _core.TestSearch.start(
            [self.model_of_search],
            self.setting,
            self.task,
            self.settings,
            self.variation,
            0,
            1,
            self.workers,
        )
        self.runs = _core.rollout(self.model, self.setting, self.gains, self.task)
        self.objectives = random.normal(size=(6, n_x))
        self.archive = _core.Archive(n_x)


def calls(world):
    """Every call, by the name in the stub: a function, and arguments by name with which it works."""
    w = world
    signals = {
        "dt": w.dt,
        "state_scales": w.scales,
        "command_bounds": w.bounds,
        "command_scales": w.command_scales,
        "derivative_of": w.derivatives,
        "kinematics": None,
        "periods": None,
    }
    law = {"gains": w.gain_bounds, "output": w.output}
    filtered = {"derivative_filter": 0.1, "anti_windup": True}
    vehicle = {
        "dt": w.dt,
        "arm": 0.1,
        "inertia": [0.1, 0.1, 0.2],
        "rotor_inertia": 0.0,
        "thrust_factor": 1e-5,
        "drag_factor": 1e-6,
        "gyroscopic": "physical",
    }
    quadrotor = _core.Quadrotor(**vehicle)
    starts = {"initial_states": w.start[None], "target_states": w.target[None]}
    motion = {"sensors": w.sensors, "motion": w.motion}
    judged = {"models": [w.model], "selected": w.selected, "workers": w.workers}
    recorded = {"model": w.model, "limits": w.limits, "chains": w.chains, "records": w.records}
    problem = (w.regression, w.coefficients, w.sensors, w.motion, w.sensors * 1e-3, (1e-6, 0.0, 1.0))
    crossed = {"first": w.program, "second": w.other_program, "seed": 0}
    flown = {"setting": w.setting, "parameters": w.gains, "task": w.task}
    ahead = {
        "members": [w.model], "setting": w.setting, "parameters": w.gains[0], "target": w.target, "steps": 5,
        "envelope": np.array([(-1.0, 1.0)] * w.n_x), "excitation": np.zeros((5, w.n_u)),
        "hold_back": w.hold_back,
    }  # fmt: skip
    learnt = {"form": "absolute", "signals": w.signals}
    found = {
        "vector_widths": (_core.vector_widths, {}),
        "Workers": (_core.Workers, {"threads": 1, "width": "auto"}),
        "LookAhead": (_core.LookAhead, ahead),
        "LookAhead.reset": (w.ahead.reset, {}),
        "LookAhead.leaving": (w.ahead.leaving, {"reading": w.states[0], "horizon": 3}),
        "LookAhead.sent": (
            w.ahead.sent,
            {"reading": w.states[0], "target": w.target, "command": w.commands[0]},
        ),
        "LookAhead.following": (w.ahead.following, {"state": w.states[0], "command": w.commands[0]}),
        "Program.parse": (_core.Program.parse, {"text": str(w.program)}),
        "Program.effective": (w.program.effective, {}),
        "Program.run": (w.program.run, {"inputs": np.ones((2, w.n_x + w.n_u)), "workers": w.workers}),
        "Program.__len__": (w.program.__len__, {}),
        "Program.__eq__": (w.program.__eq__, {}),
        "Grammar": (
            _core.Grammar,
            {"inputs": w.n_x, "outputs": w.n_x, "spare_registers": 1, "pages": 2, "page_length": 3},
        ),
        "Grammar.random": (w.grammar.random, {"seed": 0, "count": 2}),
        "Grammar.mutate": (w.grammar.mutate, {"program": w.program, "seed": 0}),
        "Grammar.crossover": (w.grammar.crossover, crossed),
        "Signals": (_core.Signals, signals),
        "Model": (_core.Model, {"program": w.law, **learnt, "actuators": w.actuators, "hidden": []}),
        "Model.shape": (_core.Model.shape, learnt),
        "Model.with_offsets": (w.model.with_offsets, {"offsets": [0.0] * w.n_x}),
        "Model.with_reports": (
            w.model.with_reports,
            {"held": [(0, 3, 1, 2)], "computed": [(w.n_x - 1, 0, 0.5, 2.0)]},
        ),
        "Model.with_levels": (w.model.with_levels, {"levels": [[0.0, 1.0]] * w.n_u}),
        "Model.states_of": (w.model.states_of, {"readings": w.states[1:]}),
        "Model.with_constants": (w.model.with_constants, {"constants": w.constants, "lags": [0.2] * w.n_u}),
        "Model.step": (
            w.model.step,
            {
                "states": w.states[1:],
                "commands": w.commands,
                "workers": w.workers,
                "past": np.zeros((4, 3, w.n_u)),
            },
        ),
        "Quadrotor": (_core.Quadrotor, vehicle),
        "Quadrotor.derivative": (quadrotor.derivative, {"state": np.zeros(6), "command": np.zeros(4)}),
        "Quadrotor.step": (
            quadrotor.step,
            {"states": np.zeros((2, 6)), "commands": np.zeros((2, 4)), "past": np.zeros((2, 3, 4))},
        ),
        "Family.pid": (_core.Family.pid, {"signals": w.signals, "axes": [(0, None)], **law, **filtered}),
        "Family.cascade": (
            _core.Family.cascade,
            {
                "signals": w.signals,
                "axes": [(0, w.n_x - 1, 1.0)],
                **law,
                "gains": [*w.gain_bounds, 0.5],
                **filtered,
            },
        ),
        "Family.state_feedback": (
            _core.Family.state_feedback,
            {"signals": w.signals, "states": [0, 1], "integrals": [0], "outputs": 1, **law},
        ),
        "Family.python": (
            _core.Family.python,
            {"signals": w.signals, "make": lambda gains: Nothing(w.n_u), "gains": w.gain_bounds},
        ),
        "Family.controller": (
            w.family.controller,
            {"parameters": w.gains[0], "excitation": w.excitation[0], "hold_back": w.hold_back},
        ),
        "Controller.reset": (w.family.controller(w.gains[0]).reset, {}),
        "Controller.copied": (w.family.controller(w.gains[0]).copied, {}),
        "Controller.command": (
            w.family.controller(w.gains[0]).command,
            {"state": w.start, "target": w.target},
        ),
        "Task": (_core.Task, {"initial": w.start, "target": w.target, "steps": 4}),
        "rollout": (
            _core.rollout,
            {
                "dynamics": w.model,
                **flown,
                "noise": w.noise,
                "excitation": w.excitation,
                "hold_back": w.hold_back,
                "disturbance": w.disturbance,
            },
        ),
        "HoldBack": (_core.HoldBack, {"full": w.inner, "none": 2.0 * w.inner}),
        "Limits": (_core.Limits, {"signals": w.signals, "divergence_factor": 10.0}),
        "Setting": (_core.Setting, {"limits": w.limits, "family": w.family}),
        "SelectedTests": (_core.SelectedTests, {"setting": w.setting}),
        "SelectedTests.with_record": (
            w.selected.with_record,
            {"states": w.states, "commands": w.commands},
        ),
        "SelectedTests.with_test": (
            w.selected.with_test,
            {
                "parameters": w.gains[0],
                "target": w.target,
                "states": w.states,
                "commands": w.commands,
                "excitation": w.excitation[0],
                "hold_back": w.hold_back,
            },
        ),
        "SelectedTests.__len__": (w.selected.__len__, {}),
        "open_loop": (_core.open_loop, judged),
        "closed_loop": (_core.closed_loop, judged),
        "k_step": (_core.k_step, {**judged, "steps": 2}),
        "final_distances": (_core.final_distances, {"models": [w.model], **flown}),
        "discrimination": (_core.discrimination, {"distances": np.ones((3, 2)), "cap": 3.0}),
        "instability": (_core.instability, {"distances": np.ones((3, 2)), "cap": 3.0}),
        "Flights": (
            _core.Flights,
            {
                "setting": w.setting,
                "parameters": w.gains,
                **starts,
                "steps": 4,
                "excitation": w.excitation,
                "hold_back": w.hold_back,
            },
        ),
        "Flights.__len__": (w.flights.__len__, {}),
        "Quality": (
            _core.Quality,
            {"kind": "ise", "weights": np.ones(w.n_x), "effort": 0.0, "effort_rate": 0.0},
        ),
        "qualities": (
            _core.qualities,
            {
                "dynamics": [w.model],
                "flights": w.flights,
                "quality": w.quality,
                "envelope": w.envelope,
                "noise": w.noise,
                "offsets": np.zeros((1, w.n_x)),
                "measured": True,
            },
        ),
        "disagreements": (
            _core.disagreements,
            {"models": [w.model], "flights": w.flights, "sds": w.scales, "cap": 100.0},
        ),
        "command_effects": (
            _core.command_effects,
            {
                "actuators": w.actuators,
                "hidden": [([0], True, None, 1.0, [], False, 0.0, 0.0, 0.0)],
                "scales": w.command_scales,
                "dt": w.dt,
                "commands": w.commands,
            },
        ),
        "Regression": (
            _core.Regression,
            {"states": 1, "dt": w.dt, "form": "acceleration", "records": w.readings},
        ),
        "Regression.residuals": (w.regression.residuals, {"coefficients": w.coefficients}),
        "Regression.log_determinant": (w.regression.log_determinant, motion),
        "Regression.likelihood": (w.regression.likelihood, {"coefficients": w.coefficients, **motion}),
        "Regression.gram": (w.regression.gram, {**motion, "workers": w.workers}),
        "Gram.part": (w.gram.part, {"features": [w.n_x - 1]}),
        "Gram.with_prior": (w.gram.with_prior, {"precisions": np.ones(w.n_x)}),
        "Gram.with_rows": (w.gram.with_rows, {"rows": np.ones((2, w.n_x + 1))}),
        "Gram.solve": (w.gram.solve, {"subset": [w.n_x - 1], "ridge": 0.0}),
        "Gram.least_squares": (w.gram.least_squares, {"subset": [w.n_x - 1], "ridge": 0.0}),
        "behind_gap": (
            _core.behind_gap,
            {"mass": (0.03, 0.004, 0.003, 0.5), "rates": np.zeros((4, 3)), "dt": 0.01},
        ),
        "most_likely_noises": (_core.most_likely_noises, {"problems": [problem]}),
        "search_subsets": (
            _core.search_subsets,
            {
                "grams": [w.gram],
                "prices": [np.ones(w.n_x)],
                "moves": 20,
                "largest": 2,
                "starts": 2,
                "unit": (0, "subsets", [0]),
                "coldest": 2.0,
            },
        ),
        "tune": (
            _core.tune,
            {
                **recorded,
                "free": [w.n_x - 1],
                "lags": [[w.n_u - 1]],
                "iterations": 2,
                "draws": 1,
                "unit": (0, "subsets", [0]),
            },
        ),
        "linearised": (_core.linearised, {**recorded, "free": [w.n_x - 1], "lags": [[w.n_u - 1]]}),
        "predictions": (_core.predictions, recorded),
        "ranks": (_core.ranks, {"objectives": w.objectives}),
        "crowding_distances": (
            _core.crowding_distances,
            {"objectives": w.objectives, "ranks": np.zeros(6, dtype=int)},
        ),
        "select": (_core.select, {"objectives": w.objectives, "count": 2}),
        "ideal_point": (_core.ideal_point, {"objectives": w.objectives}),
        "best_tradeoff": (_core.best_tradeoff, {"objectives": w.objectives, "normalised": True}),
        "Archive": (_core.Archive, {"columns": w.n_x, "width": "auto"}),
        "Archive.offer": (w.archive.offer, {"objectives": w.objectives}),
        "Archive.prune": (w.archive.prune, {"cap": 2}),
        "Archive.__len__": (w.archive.__len__, {}),
        "Variation": (
            _core.Variation,
            {
                "population": 4,
                "mutation_share": 0.6,
                "crossover_share": 0.3,
                "reproduction_share": 0.1,
                "elite_share": 0.1,
                "ranking_pressure": 1.8,
                "archive_cap": 10,
            },
        ),
        "ModelSearch.start": (
            _core.ModelSearch.start,
            {
                "grammar": w.grammar,
                "form": "absolute",
                "variation": w.variation,
                "seed": 0,
                "selected": w.selected,
                "workers": w.workers,
            },
        ),
        "ModelSearch.learn": (w.search.learn, {"selected": w.selected, "workers": w.workers}),
        "ModelSearch.advance": (
            w.search.advance,
            {"selected": w.selected, "generations": 1, "workers": w.workers},
        ),
        "ModelSearch.committee": (w.search.committee, {"size": 2}),
        "TestSettings": (
            _core.TestSettings,
            {
                "control_quality": True,
                "distance_cap": 3.0,
                "mutants": 2,
                "mutant_step": 0.05,
                "mutation_step": 0.1,
            },
        ),
        "TestSearch.start": (
            _core.TestSearch.start,
            {
                "committee": [w.model_of_search],
                "setting": w.setting,
                "task": w.task,
                "settings": w.settings,
                "variation": w.variation,
                "seed": 0,
                "iteration": 1,
                "workers": w.workers,
            },
        ),
        "TestSearch.advance": (w.test_search.advance, {"generations": 1, "workers": w.workers}),
    }
    found |= restored(world)
    return found


def restored(world):
    """Calls that make values of what was read off them, and calls on records."""
    w = world
    instructions = [("*", w.n_x + w.n_u, 0, 0.5), ("sin", w.n_x + w.n_u, 1, None)]
    of_models = {
        "grammar": w.grammar,
        "form": "absolute",
        "variation": w.variation,
        "signals": w.signals,
        "counters": w.search.counters,
        "population": w.search.population,
        "population_objectives": w.search.population_objectives,
        "archive": [model.program for model in w.search.archive],
        "archive_objectives": w.search.archive_objectives,
        "workers": w.workers,
    }
    of_tests = {
        "committee": [w.model_of_search],
        "setting": w.setting,
        "task": w.task,
        "settings": w.settings,
        "variation": w.variation,
        "counters": w.test_search.counters,
        "flat": False,
        "population": w.test_search.population,
        "population_objectives": w.test_search.population_objectives,
        "archive": w.test_search.archive_genes,
        "archive_objectives": w.test_search.archive_objectives,
        "workers": w.workers,
    }
    shape = {"inputs": w.n_x + w.n_u, "outputs": w.n_x, "registers": 2 * w.n_x + w.n_u}
    return {
        **drawn(w),
        "replay": (
            _core.replay,
            {
                "dynamics": w.model,
                "limits": w.limits,
                "initial": w.start,
                "commands": w.commands,
                "noise": w.noise,
                "disturbance": w.disturbance,
                "workers": w.workers,
            },
        ),
        "Quality.recorded": (
            w.quality.recorded,
            {"signals": w.signals, "target": w.target, "states": w.states, "commands": w.commands},
        ),
        "usages": (_core.usages, {"signals": w.signals, "envelope": w.envelope, "states": w.states}),
        "Program": (_core.Program, {**shape, "pages": [instructions]}),
        "ModelSearch.restored": (_core.ModelSearch.restored, of_models),
        "TestSearch.restored": (_core.TestSearch.restored, of_tests),
    }


def drawn(world):
    """Calls on streams of random numbers, elementary functions and CMA-ES."""
    w, unit = world, (0, _core.purposes()[0], [1])
    stream, search = _core.Stream(unit), _core.CmaEs(np.full(w.n_x, 0.5), 0.2, 6, unit)
    elementary = {
        name: (getattr(_core, name), {"x": np.ones(3)}) for name in ("exp", "log", "sin", "cos", "tanh")
    }
    return {
        **elementary,
        "power": (_core.power, {"x": 2.0, "y": 3.0}),
        "purposes": (_core.purposes, {}),
        "eigen": (_core.eigen, {"matrix": np.eye(w.n_x)}),
        "Stream": (_core.Stream, {"unit": unit}),
        "Stream.uniform": (stream.uniform, {"low": 0.0, "high": 1.0}),
        "Stream.below": (stream.below, {"n": 3}),
        "Stream.log_uniform": (stream.log_uniform, {"low": 0.5, "high": 2.0}),
        "Stream.uniforms": (lambda shape: stream.uniforms(*shape), {"shape": (2, 3)}),
        "Stream.normals": (lambda shape: stream.normals(*shape), {"shape": (2, 3)}),
        "CmaEs": (_core.CmaEs, {"mean": np.full(w.n_x, 0.5), "step": 0.2, "population": 6, "unit": unit}),
        "CmaEs.ask": (search.ask, {}),
        "CmaEs.tell": (search.tell, {"points": search.ask(), "values": np.arange(6.0)}),
        "Family.places": (w.family.places, {"parameters": w.gains}),
        "Family.at": (w.family.at, {"places": w.gains}),
    }


OURS = World(2, 1, 0.1)
OTHERS = [World(6, 4, 0.1), World(1, 2, 0.1), World(2, 1, 0.2), World(2, 1, 0.1, factor=3.0)]
"""Of more signals, of fewer, of another period, of other bounds and scales."""
CALLS = calls(OURS)
HUGE = 2**40
HOSTILE = [
    None,
    (),
    [],
    [[]],
    [[[]]],
    [None],
    [()],
    "",
    "absolute",
    "no such",
    b"",
    {},
    object(),
    lambda x, u: x,
    True,
    0,
    -1,
    3,
    2**64,
    10**400,
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    5e-324,
    -0.5,
    np.zeros(0),
    np.zeros((0, 2)),
    np.zeros((2, 0)),
    np.zeros((0, 0, 0)),
    np.ones(3),
    np.ones((3, 3)),
    np.ones((2, 2, 2)),
    np.full(2, math.nan),
    np.full((5, 2), math.inf),
    np.full((1, 5, 2), math.nan),
    [[0, 1], [1]],
    [[]] * 3,
    [0, 99],
    [99],
    [(99, 99)],
    [(0, None)] * 9,
    [0, 0],
    ["+", "?"],
]
"""Nothing, too little, too much, and what is no number."""
LONG = {"generations", "moves", "iterations", "count"}
"""Arguments of which more is only longer; a huge count is tried apart."""


def members():
    """Names of functions and methods of the stub; a class stands for its constructor."""
    for node in STUB.body:
        if isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.ClassDef):
            for member in node.body:
                decorated = [ast.unparse(d) for d in getattr(member, "decorator_list", [])]
                if isinstance(member, ast.FunctionDef) and "property" not in decorated:
                    yield node.name if member.name == "__new__" else f"{node.name}.{member.name}"


def attempt(function, arguments):
    """The exception that a call raises; None where it answers. A panic is no `Exception` and is not caught."""
    try:
        with np.errstate(invalid="ignore"):  # NumPy's own, where NaN becomes a whole number
            function(**arguments)
    except REFUSALS as refusal:
        return refusal
    return None


def test_every_function_of_the_stub_has_a_call():
    assert set(members()) == set(CALLS)


@pytest.mark.parametrize("name", CALLS)
def test_the_call_works_on_its_own_campaign_and_on_others(name):
    for world in (OURS, *OTHERS[:1]):
        function, arguments = calls(world)[name]
        if name == "Program.__eq__":
            arguments = {}
            assert function(world.program)
        else:
            function(**arguments)


def holds_the_engines_own(value):
    """Whether an argument is an object of the engine that was made for a campaign, or a list of them."""
    first = value[0] if isinstance(value, list) and value else value
    anybodys = _core.Workers | _core.Variation | _core.TestSettings
    return type(first).__module__ == "twinloop._core" and not isinstance(first, anybodys)


STARTS = {
    ("Model.shape", "signals"),
    ("Limits", "signals"),
    ("SelectedTests", "setting"),
    *((f"Family.{law}", "signals") for law in LAWS),
}
"""Arguments that all others are numbers for."""
NUMBERS = {
    "hold_back",
    "program",
    "first",
    "second",
    "grammar",
    "task",
    "quality",
    "grams",
    "population",
    "archive",
}
"""Arguments that are made of numbers without a unit or a period: others where they are more or fewer."""
ALONE = {
    ("Model", "signals"),
    ("Flights", "setting"),
    ("tune", "model"),
    ("linearised", "model"),
    ("predictions", "model"),
    ("ModelSearch.start", "selected"),
    ("ModelSearch.restored", "signals"),
    ("Quality.recorded", "signals"),
    ("usages", "signals"),
}
"""Arguments that the others, arrays, fit where they are as many."""


@pytest.mark.parametrize("name", CALLS)
def test_what_is_made_for_other_signals_is_refused(name):
    function, arguments = CALLS[name]
    for other in OTHERS:
        same_size = (other.n_x, other.n_u) == (OURS.n_x, OURS.n_u)
        for argument, value in arguments.items():
            if not holds_the_engines_own(value) or (name, argument) in STARTS:
                continue
            if same_size and (argument in NUMBERS or (name, argument) in ALONE):
                continue
            foreign = calls(other)[name][1][argument]
            refusal = attempt(function, {**arguments, argument: foreign})
            assert isinstance(refusal, InvalidInput), f"{name} answers with {argument} of another campaign"


@pytest.mark.parametrize("name", CALLS)
def test_hostile_arguments_are_refused_or_answered_but_never_a_panic(name):
    function, arguments = CALLS[name]
    for argument in arguments:
        for hostile in HOSTILE:
            if argument in LONG and isinstance(hostile, int) and hostile > 3:
                continue
            attempt(function, {**arguments, argument: hostile})


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        ("Grammar", "pages"),
        ("Grammar", "page_length"),
        ("Grammar", "spare_registers"),
        ("Grammar", "inputs"),
        ("Grammar.random", "count"),
        ("Variation", "population"),
        ("TestSettings", "mutants"),
        ("search_subsets", "starts"),
        ("tune", "draws"),
        ("Task", "steps"),
        ("Flights", "steps"),
        ("LookAhead", "steps"),
        ("Archive", "columns"),
        ("Workers", "threads"),
        ("CmaEs", "population"),
        ("k_step", "steps"),
        ("Regression", "states"),
        ("Family.state_feedback", "outputs"),
    ],
)
def test_counts_that_no_machine_can_hold_are_refused(name, argument):
    function, arguments = CALLS[name]
    for huge in (HUGE, 2**63, 2**64 - 1):
        assert isinstance(attempt(function, {**arguments, argument: huge}), InvalidInput), huge


def test_a_search_that_is_advanced_on_tests_it_was_not_judged_on_is_refused():
    gains, target = OURS.gains[0], OURS.target
    empty = _core.SelectedTests(OURS.setting)
    other = empty.with_test(gains, target, OURS.states + 0.5, OURS.commands)
    with pytest.raises(InvalidInput, match="last judged on"):
        OURS.search.advance(other, 1, OURS.workers)
    assert OURS.search.learn(other, OURS.workers).advance(other, 1, OURS.workers).generation == 1


def test_a_crossover_never_makes_more_instructions_than_a_program_may_have():
    page = "\n".join(["r1 = r0 * 0.5"] * 20_000)
    head = "program inputs=1 outputs=1 registers=2\n"
    first = _core.Program.parse(f"{head}page 1\n{page}\npage 2\nr1 = r0 + 1.0\n")
    second = _core.Program.parse(f"{head}page 1\nr1 = r0 - 1.0\npage 2\n{page}\n")
    grammar = _core.Grammar(1, 1, spare_registers=0, aligned_pages=0.0)
    for seed in range(8):
        for child in grammar.crossover(first, second, seed):
            assert len(child) <= 2**15
            np.testing.assert_array_equal(child.effective().run([[2.0]]), child.run([[2.0]]))


def test_no_flight_on_no_model_has_the_shape_that_its_lists_say():
    empty = _core.SelectedTests(OURS.setting)
    assert _core.open_loop([OURS.model], empty).shape == (1, 0)
    assert all(part.shape == (0, 1) for part in _core.closed_loop([], OURS.selected))
    nobody = np.zeros((0, 3))
    distances = _core.final_distances([OURS.model], OURS.setting, nobody, OURS.task)
    assert distances.shape == (1, 0)


def test_the_stub_and_the_engine_name_the_same_arguments():
    for name, (function, arguments) in CALLS.items():
        if "__" not in name and arguments:
            assert set(arguments) <= set(inspect.signature(function).parameters), name

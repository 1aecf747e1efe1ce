"""Types of the native engine: numbers in, numbers out; the packages above it give them names and units."""

from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Floats = NDArray[np.float64]
_Integers = NDArray[np.int64]
_Instruction = tuple[str, int, int, int | float | None]
"""(operation, destination, first, second): a register an int, a constant a float, no operand None."""
_Counters = tuple[int, int, int, int, int, int]
"""Seed, iteration, generation, evaluations, spared offspring, generations with a capped archive."""
_Actuator = tuple[float, int, float | None, float]
"""Lag (s), delay (periods), and the command whose effect is there at the start of a run; None: the first one."""
_Hidden = tuple[Sequence[int], bool, float | None, float, Sequence[int], bool, float, float, float]
"""Commands, whether squares fill it, the mean at rest (scaled; None: of the first period), time (s), states that fill
it where no commands do, whether a run begins with it settled, in which it turns with its neighbour (s; 0: none), half
of the gap between them (0: none), and the damping of what presses beyond it over its stiffness (s)."""
_Motion = tuple[float, float, float]
"""Variance of a white disturbance, variance of a lasting one, time after which that is forgotten to 1/e (s)."""
_Chain = tuple[Sequence[int], Sequence[float], _Motion, str]
"""States, the driven one first; variance of each sensor; disturbances; whether features are derivatives."""
_Gains = Sequence[float | tuple[float, float, bool]]
"""Of a law in its order: a number that fixes a gain, or low, high and whether the scale is logarithmic."""
_Output = tuple[ArrayLike, ArrayLike, float]
"""Matrix (n_u, outputs), offset (n_u,) and power; without one output i of a law is command i."""
_Name = tuple[int, str, Sequence[int]]
"""Seed, purpose, and the one to five numbers that lead to a unit of work, which its stream is named by."""
_Record = tuple[ArrayLike, ArrayLike, ArrayLike]
"""Readings (n + 1, n_x), weights (n + 1, n_x) and commands (n, n_u) of a run."""

__all__ = [
    "Archive",
    "CmaEs",
    "Controller",
    "Family",
    "Flights",
    "Gram",
    "Grammar",
    "HoldBack",
    "Limits",
    "LookAhead",
    "Model",
    "ModelSearch",
    "Program",
    "Quadrotor",
    "Quality",
    "Regression",
    "Runs",
    "SelectedTests",
    "Setting",
    "Signals",
    "Stream",
    "Task",
    "TestSearch",
    "TestSettings",
    "Variation",
    "Workers",
    "__version__",
    "behind_gap",
    "best_tradeoff",
    "closed_loop",
    "command_effects",
    "cos",
    "crowding_distances",
    "disagreements",
    "discrimination",
    "eigen",
    "exp",
    "final_distances",
    "ideal_point",
    "instability",
    "k_step",
    "linearised",
    "log",
    "most_likely_noises",
    "open_loop",
    "power",
    "predictions",
    "purposes",
    "qualities",
    "ranks",
    "replay",
    "rollout",
    "search_subsets",
    "select",
    "sin",
    "tanh",
    "tune",
    "usages",
    "vector_widths",
]

__version__: str

def vector_widths() -> list[str]:
    """Vector widths that this processor has, narrowest first."""

@final
class Workers:
    """How work is carried out, never what comes out: a number of threads and a vector width."""

    def __new__(cls, threads: int = 1, width: str = "auto") -> Workers: ...
    @property
    def threads(self) -> int: ...
    @property
    def width(self) -> str: ...

@final
class Stream:
    """The random numbers of one unit of work, one after another."""

    def __new__(cls, unit: _Name) -> Stream: ...
    def uniform(self, low: float = 0.0, high: float = 1.0) -> float:
        """One number between two, the first included."""
    def below(self, n: int) -> int:
        """One of 0, …, n − 1."""
    def log_uniform(self, low: float, high: float) -> float:
        """One number between two above 0, uniform in its logarithm."""
    def uniforms(self, *shape: int) -> _Floats:
        """An array of a shape, uniform in [0, 1)."""
    def normals(self, *shape: int) -> _Floats:
        """An array of a shape, standard normal."""

def purposes() -> list[str]:
    """What random numbers may be for."""

def exp(x: ArrayLike) -> _Floats:
    """e to the power of each number, in the shape of x."""

def log(x: ArrayLike) -> _Floats:
    """The natural logarithm of each number, in the shape of x."""

def sin(x: ArrayLike) -> _Floats:
    """The sine of each angle (rad), in the shape of x."""

def cos(x: ArrayLike) -> _Floats:
    """The cosine of each angle (rad), in the shape of x."""

def tanh(x: ArrayLike) -> _Floats:
    """The hyperbolic tangent of each number, in the shape of x."""

def power(x: float, y: float) -> float:
    """x to the power of y."""

def eigen(matrix: ArrayLike) -> tuple[_Floats, _Floats]:
    """Eigenvalues (n,), ascending, and eigenvectors (n, n), a row each, of a symmetric matrix (n, n)."""

@final
class CmaEs:
    """A search by CMA-ES for the least value of a function, as a value."""

    def __new__(cls, mean: ArrayLike, step: float, population: int, unit: _Name) -> CmaEs: ...
    @property
    def generation(self) -> int: ...
    @property
    def mean(self) -> _Floats:
        """Middle of the distribution (n,)."""
    @property
    def step(self) -> float:
        """Factor on the square root of the covariance."""
    @property
    def covariance(self) -> _Floats:
        """Shape of the distribution (n, n)."""
    @property
    def stopped(self) -> bool:
        """Whether nothing more is to be had from this search."""
    def ask(self) -> _Floats:
        """Points of this generation (population, n); the same ones when asked again."""
    def tell(self, points: ArrayLike, values: ArrayLike) -> CmaEs:
        """The search that knows the values (population,) of points (population, n)."""

@final
class Program:
    """Pages of instructions over registers: inputs first, then outputs, then spare ones."""

    def __new__(
        cls, inputs: int, outputs: int, registers: int, pages: Sequence[Sequence[_Instruction]]
    ) -> Program: ...
    @staticmethod
    def parse(text: str) -> Program: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def registers(self) -> int: ...
    @property
    def page_lengths(self) -> list[int]: ...
    @property
    def instructions(self) -> list[_Instruction]: ...
    @property
    def intron_share(self) -> float: ...
    def effective(self) -> Program: ...
    def run(self, inputs: ArrayLike, workers: Workers | None = None) -> _Floats:
        """Outputs (rows, outputs) of inputs (rows, inputs)."""
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Grammar:
    """What programs may look like and how they vary."""

    def __new__(
        cls,
        inputs: int,
        outputs: int,
        *,
        spare_registers: int = 4,
        pages: int = 5,
        page_length: int = 10,
        operations: Sequence[str] = ...,
        writable_inputs: bool = True,
        constant_share: float = 0.5,
        constant_low: float = 1e-3,
        constant_high: float = 10.0,
        constant_step: float = 0.1,
        mutation_rate: float = 0.02,
        aligned_pages: float = 0.5,
    ) -> Grammar: ...
    def random(self, seed: int, count: int = 1) -> list[Program]: ...
    def mutate(self, program: Program, seed: int) -> Program: ...
    def crossover(self, first: Program, second: Program, seed: int) -> tuple[Program, Program]:
        """Both with one page exchanged; one that would have more instructions than a program may stays as it is."""

@final
class Signals:
    """Period, scales, bounds and derivatives of states and commands, as numbers."""

    def __new__(
        cls,
        dt: float,
        state_scales: ArrayLike,
        command_bounds: ArrayLike,
        command_scales: ArrayLike,
        derivative_of: Sequence[int | None],
        kinematics: tuple[Sequence[int], Sequence[int]] | None = None,
        *,
        periods: Sequence[float | None] | None = None,
    ) -> Signals:
        """kinematics: the states of a rigid body's three angles (roll, pitch, yaw) and of its three rates."""
    @property
    def substeps(self) -> int: ...

@final
class Model:
    """A program with the form that makes it dynamics: "absolute", "increment", "acceleration", "explicit-euler" or
    "semi-implicit-euler"."""

    def __new__(
        cls,
        program: Program,
        form: str,
        signals: Signals,
        actuators: Sequence[_Actuator] | None = None,
        hidden: Sequence[_Hidden] = ...,
        offsets: Sequence[float] = ...,
    ) -> Model:
        """A program of states, commands and hidden states; these need actuators, one a command.

        offsets (n_x,): by how much later than others each state is read, s; empty: none is.
        """
    @staticmethod
    def shape(form: str, signals: Signals) -> tuple[int, int]:
        """Inputs and outputs that a program must have for this form."""
    @property
    def program(self) -> Program: ...
    @property
    def form(self) -> str: ...
    @property
    def actuators(self) -> list[_Actuator]:
        """One a command; none at all where every command acts at once and nothing is hidden."""
    @property
    def hidden(self) -> list[_Hidden]:
        """States that commands fill, then those that are integrated with the states; inputs of the program after the
        commands."""
    @property
    def constants(self) -> _Floats:
        """Of the effective program, in its order."""
    @property
    def offsets(self) -> list[float]:
        """By how much later than others each state is read (n_x,), s; empty where all are read in time."""
    def with_offsets(self, offsets: Sequence[float]) -> Model:
        """The same model, read so much later (n_x,), s: only states that others give may be."""
    @property
    def reports(self) -> tuple[list[tuple[int, int, int, int]], list[tuple[int, int, float, float]]]:
        """What is given of its readings, as `with_reports` takes it; empty where all are given as they are."""
    def with_reports(
        self, held: Sequence[tuple[int, int, int, int]], computed: Sequence[tuple[int, int, float, float]]
    ) -> Model:
        """The same model, of whose readings so much is given: of slow sensors (state, periods, first, age), and of
        rates that are computed (state, of, kept, share)."""
    @property
    def levels(self) -> list[list[float]]:
        """Of each command, rising; empty where all are sent as they are."""
    def with_levels(self, levels: Sequence[Sequence[float]]) -> Model:
        """The same model, to which controllers' commands are sent in levels (n_u); without any, as they are."""
    def states_of(self, readings: ArrayLike) -> _Floats:
        """The states (rows, n_x) whose readings these are, each at the start of a run."""
    def with_constants(self, constants: Sequence[float], lags: Sequence[float] | None) -> Model:
        """The same model without introns, with other constants, and, unless None, other lags and times of
        hidden states."""
    def step(
        self,
        states: ArrayLike,
        commands: ArrayLike,
        workers: Workers | None = None,
        past: ArrayLike | None = None,
    ) -> _Floats:
        """Next states (rows, n_x) of states (rows, n_x) and commands (rows, n_u).

        past (rows, p, n_u): what was commanded since each row's run began, the oldest first; None: it begins now.
        """

@final
class Quadrotor:
    """Attitude dynamics of a quadrotor under four rotor speeds, one Runge-Kutta step a period."""

    def __new__(
        cls,
        dt: float,
        *,
        arm: float,
        inertia: ArrayLike,
        rotor_inertia: float,
        thrust_factor: float,
        drag_factor: float,
        gyroscopic: str,
        drag: Sequence[float] = ...,
        motor_lag: float = 0.0,
        hover_speed: float = 0.0,
    ) -> Quadrotor: ...
    def derivative(self, state: ArrayLike, command: ArrayLike) -> _Floats:
        """Rates and accelerations (6,) of a state (6,), with the rotors turning as commanded (4,)."""
    def step(
        self,
        states: ArrayLike,
        commands: ArrayLike,
        workers: Workers | None = None,
        past: ArrayLike | None = None,
    ) -> _Floats:
        """States (rows, 6) a period later; lagging rotors began at hover speed and followed a `past` (rows, p, 4)."""

@final
class Family:
    """Controllers that differ by a bounded parameter vector; one law for the search and the real run."""

    @staticmethod
    def pid(
        signals: Signals,
        axes: Sequence[tuple[int, int | None]],
        gains: _Gains,
        output: _Output | None = None,
        *,
        derivative_filter: float = 0.0,
        anti_windup: bool = False,
    ) -> Family:
        """One PID an axis (angle, rate or None); gains (K_P, K_I, K_D) per axis; the filter's time in s."""
    @staticmethod
    def cascade(
        signals: Signals,
        axes: Sequence[tuple[int, int, float]],
        gains: _Gains,
        output: _Output | None = None,
        *,
        derivative_filter: float = 0.0,
        anti_windup: bool = False,
    ) -> Family:
        """A loop on an angle around a PID on its rate: (angle, rate, limit); gains (K, K_P, K_I, K_D) per axis."""
    @staticmethod
    def state_feedback(
        signals: Signals,
        states: Sequence[int],
        integrals: Sequence[int],
        outputs: int,
        gains: _Gains,
        output: _Output | None = None,
    ) -> Family:
        """Feedback of errors and integrals; gains (states, integrals) per output."""
    @staticmethod
    def python(signals: Signals, make: Callable[[list[float]], object], gains: _Gains) -> Family:
        """Controllers that `make` makes of a list of gains, with reset() and command(state, target)."""
    @property
    def size(self) -> int: ...
    def places(self, parameters: ArrayLike) -> _Floats:
        """Places (rows, size) of parameters (rows, size), 0 to 1 between the bounds, on each one's scale."""
    def at(self, places: ArrayLike) -> _Floats:
        """Parameters (rows, size) at places (rows, size), those beyond a bound at the bound."""
    def controller(
        self, parameters: ArrayLike, excitation: ArrayLike | None = None, hold_back: HoldBack | None = None
    ) -> Controller:
        """excitation (n, n_u): a row is added to each command in turn, nothing after the last."""

@final
class HoldBack:
    """How much of an excitation is sent, by what the states do; ranges (n_x, 2), infinite where there are none."""

    def __new__(cls, full: ArrayLike, none: ArrayLike) -> HoldBack: ...

@final
class Controller:
    """One controller of a family, with its memory."""

    @property
    def parameters(self) -> _Floats: ...
    def reset(self) -> None: ...
    def command(self, state: ArrayLike, target: ArrayLike) -> _Floats: ...
    def copied(self) -> Controller:
        """The same in the midst of the same run, with a memory of its own."""

@final
class Task:
    """Where runs start, where they should end, how long they last."""

    def __new__(cls, initial: ArrayLike, target: ArrayLike, steps: int) -> Task:
        """Target (n_x,), or a row for each state (steps + 1, n_x)."""

@final
class Runs:
    """What a roll-out leaves: `m` runs of `n` steps; NaN after a run has stopped."""

    @property
    def states(self) -> _Floats:
        """True states (m, n + 1, n_x)."""
    @property
    def read(self) -> _Floats:
        """What sensors without noise read of them (m, n + 1, n_x)."""
    @property
    def measured(self) -> _Floats:
        """What the controller read (m, n + 1, n_x)."""
    @property
    def commands(self) -> _Floats:
        """Commands (m, n, n_u)."""
    @property
    def lasted(self) -> _Integers:
        """Steps before each run stopped (m,); n if it did not."""

@final
class LookAhead:
    """Where a flight is in its midst, and what a committee says of the periods to come."""

    def __new__(
        cls,
        members: Sequence[Model],
        setting: Setting,
        parameters: ArrayLike,
        target: ArrayLike,
        steps: int,
        envelope: ArrayLike,
        *,
        excitation: ArrayLike | None = None,
        hold_back: HoldBack | None = None,
    ) -> LookAhead:
        """Parameters (size,), target (n_x,) or (steps + 1, n_x), envelope (n_x, 2), excitation (steps, n_u)."""
    def reset(self) -> None: ...
    def leaving(self, reading: ArrayLike, horizon: int) -> tuple[int, int, int] | None:
        """Periods until the soonest leaving within a horizon if the controller goes on, the state, and the member."""
    def sent(self, reading: ArrayLike, target: ArrayLike, command: ArrayLike) -> None:
        """Moves on by a period."""
    def following(self, state: ArrayLike, command: ArrayLike) -> _Floats:
        """What the first member makes of a state and a command, a period later."""

def replay(
    dynamics: Model | Quadrotor,
    limits: Limits,
    initial: ArrayLike,
    commands: ArrayLike,
    *,
    noise: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    anchors: ArrayLike | None = None,
    workers: Workers | None = None,
) -> Runs:
    """Free runs from a state (n_x,) under commands (n, n_u), without a controller: m of them.

    noise (m, n + 1, n_x) is added to what is read, disturbance (m, n, n_x) to the true state after each step. A run
    goes on from its anchors (m, n + 1, n_x) where these are no NaN, and is read there; memories go on as they are, and
    the true state that is kept is what the run came to before.
    """

def rollout(
    dynamics: Model | Quadrotor | Callable[[_Floats, _Floats], ArrayLike],
    setting: Setting,
    parameters: ArrayLike,
    task: Task,
    *,
    noise: ArrayLike | None = None,
    excitation: ArrayLike | None = None,
    hold_back: HoldBack | None = None,
    disturbance: ArrayLike | None = None,
    workers: Workers | None = None,
) -> Runs:
    """Closes the loop of each controller (m, size) around the dynamics.

    noise (m, n + 1, n_x) is added to what the controller reads, excitation (m, n, n_u) to what it commands
    before the bounds clip it, disturbance (m, n, n_x) to the true state after each step. A Python callable
    takes a state (n_x,) and a command (n_u,), returns the next state, and is called on this thread.
    """

@final
class Limits:
    """Where runs of a system count as diverged: at a multiple of the scale of a state."""

    def __new__(cls, signals: Signals, divergence_factor: float = 10.0) -> Limits: ...

@final
class Setting:
    """Limits, and controllers for the same signals: what runs are flown in."""

    def __new__(cls, limits: Limits, family: Family) -> Setting: ...

@final
class SelectedTests:
    """The tests that were run on the system, with their trajectories."""

    def __new__(cls, setting: Setting) -> SelectedTests: ...
    def with_test(
        self,
        parameters: ArrayLike,
        target: ArrayLike,
        states: ArrayLike,
        commands: ArrayLike,
        excitation: ArrayLike | None = None,
        hold_back: HoldBack | None = None,
    ) -> SelectedTests:
        """These and one more: states (n + 1, n_x) as measured, commands (n, n_u), excitation (≥ n, n_u)."""
    def with_record(self, states: ArrayLike, commands: ArrayLike) -> SelectedTests:
        """These and an attached run, judged under its commands: states (n + 1, n_x), commands (n, n_u)."""
    def __len__(self) -> int: ...

def open_loop(models: Sequence[Model], selected: SelectedTests, workers: Workers | None = None) -> _Floats:
    """One-step-ahead error of each model on each test (models, tests); infinite where it is not finite."""

def k_step(
    models: Sequence[Model], selected: SelectedTests, steps: int, workers: Workers | None = None
) -> _Floats:
    """Error of free runs of some steps from every recorded state, under the recorded commands (models, tests)."""

def closed_loop(
    models: Sequence[Model], selected: SelectedTests, workers: Workers | None = None
) -> tuple[_Floats, _Integers]:
    """Free-run error with the controller in the loop, infinite where the run diverged, and the steps that it lasted,
    both (models, tests)."""

def final_distances(
    models: Sequence[Model],
    setting: Setting,
    parameters: ArrayLike,
    task: Task,
    *,
    workers: Workers | None = None,
) -> _Floats:
    """Distance of the last state to the target (models, tests); infinite where the run diverged."""

def discrimination(distances: ArrayLike, cap: float) -> _Floats:
    """1 / variance over models (tests,) of distances (models, tests), each capped."""

def instability(distances: ArrayLike, cap: float) -> _Floats:
    """Variance over mutants (tests,) of distances (mutants, tests); one at the cap counts as cap squared."""

@final
class Flights:
    """Candidate flights of one length, each with its own gains, start, target and excitation."""

    def __new__(
        cls,
        setting: Setting,
        parameters: ArrayLike,
        initial_states: ArrayLike,
        target_states: ArrayLike,
        steps: int,
        *,
        excitation: ArrayLike | None = None,
        hold_back: HoldBack | None = None,
    ) -> Flights:
        """parameters (K, size), initial and target states (K, n_x), excitation (K, steps, n_u)."""
    @property
    def steps(self) -> int: ...
    def __len__(self) -> int: ...

@final
class Quality:
    """What a flight is judged by: "iae", "ise" or "final_distance", plus what commands cost."""

    def __new__(
        cls, kind: str, weights: ArrayLike, *, effort: float = 0.0, effort_rate: float = 0.0
    ) -> Quality: ...
    @property
    def kind(self) -> str: ...
    def recorded(self, signals: Signals, target: ArrayLike, states: ArrayLike, commands: ArrayLike) -> float:
        """Of a recorded run: target (n_x,) or rows of it (≥ n + 1, n_x), states (n + 1, n_x), commands (n, n_u)."""

def usages(signals: Signals, envelope: Sequence[tuple[float, float] | None], states: ArrayLike) -> _Floats:
    """The largest share of an envelope that each state (rows, n_x) uses: 1 at a bound (rows,)."""

def qualities(
    dynamics: Sequence[Model] | Quadrotor,
    flights: Flights,
    quality: Quality,
    envelope: Sequence[tuple[float, float] | None],
    *,
    noise: ArrayLike | None = None,
    offsets: ArrayLike | None = None,
    disturbances: ArrayLike | None = None,
    measured: bool = False,
    workers: Workers | None = None,
) -> tuple[_Floats, _Floats]:
    """Quality and usage of the envelope of every flight, both (members, draws, K).

    noise (D, n + 1, n_x) is added to what the controllers read, offsets (D, n_x) to the initial states, and
    disturbances (D, n, n_x) to the true state after each step; all are the same for all candidates and members.
    measured: the quality is that of the readings.
    """

def disagreements(
    models: Sequence[Model],
    flights: Flights,
    sds: ArrayLike,
    *,
    cap: float = 100.0,
    workers: Workers | None = None,
) -> tuple[_Floats, _Integers]:
    """log det(I + D Dᵀ) of each flight (K,), and where members are the furthest apart (K, 4)."""

def command_effects(
    actuators: Sequence[_Actuator],
    hidden: Sequence[_Hidden],
    scales: ArrayLike,
    dt: float,
    commands: ArrayLike,
) -> list[_Floats]:
    """What arrives of commands (n, n_u), then the states that they fill, at the start, the middle and the end of each
    period, (n, n_u + hidden) each."""

def behind_gap(mass: tuple[float, float, float, float], rates: ArrayLike, dt: float) -> _Floats:
    """What presses on a mass behind a gap, and its rate, at the start, the middle and the end of each period (n, 6).

    mass: how fast it turns, half of its gap, its damping and its time; rates of what drives it at these times (n, 3).
    """

@final
class Regression:
    """Records of one chain of states with the features that may drive it, p of them."""

    def __new__(
        cls,
        states: int,
        dt: float,
        form: str,
        records: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike, ArrayLike]],
    ) -> Regression:
        """records: readings and weights (n + 1, states), features at start, middle and end (n, p)."""
    def residuals(self, coefficients: ArrayLike) -> list[_Floats]:
        """Readings less what coefficients (p,) explain, (n + 1, states) for each record."""
    def likelihood(self, coefficients: ArrayLike, sensors: ArrayLike, motion: _Motion) -> float:
        """−2 log of the likelihood of the residuals, up to a constant."""
    def log_determinant(self, sensors: ArrayLike, motion: _Motion) -> float:
        """Of the readings' covariance: the part of the likelihood that residuals have no share in."""
    def gram(self, sensors: ArrayLike, motion: _Motion, workers: Workers | None = None) -> Gram:
        """Inner products under sensors' variances (states,) and disturbances of the motion."""

@final
class Gram:
    """Inner products of whitened features and readings."""

    @property
    def features(self) -> int: ...
    @property
    def readings(self) -> int: ...
    @property
    def total(self) -> float:
        """Sum of squares of the whitened readings."""
    def part(self, features: Sequence[int]) -> Gram:
        """Of some of the features, in the order given."""
    def with_rows(self, rows: ArrayLike) -> Gram:
        """With more rows (m, p + 1), whitened already: features, and a reading at the end."""
    def with_prior(self, precisions: ArrayLike) -> Gram:
        """With a normal prior about 0 on every coefficient, of given precisions (p,): inverse variances."""
    def solve(self, subset: Sequence[int], ridge: float = 0.0) -> tuple[_Floats, _Floats, float] | None:
        """Coefficients (k,), their covariance (k, k) and χ²; None where the features are collinear."""
    def least_squares(self, subset: Sequence[int], ridge: float = 0.0) -> tuple[_Floats, float] | None:
        """Coefficients and χ² alone, which takes a third of the time."""

def most_likely_noises(
    problems: Sequence[tuple[Regression, ArrayLike, ArrayLike, _Motion, ArrayLike, _Motion]],
    workers: Workers | None = None,
) -> list[tuple[_Floats, _Motion, float]]:
    """For each problem, sensors' variances and motion under which residuals are most likely, and −2 log of that.

    problems: a regression, coefficients (p,), sensors' variances and motion to start from, and the least of both.
    """

def search_subsets(
    grams: Sequence[Gram],
    prices: Sequence[ArrayLike],
    *,
    moves: int,
    largest: int,
    starts: int,
    unit: _Name,
    coldest: float = 2.0,
    workers: Workers | None = None,
) -> list[list[tuple[list[int], float]]]:
    """For each problem, subsets with their energies χ² + prices, best first."""

def tune(
    model: Model,
    limits: Limits,
    chains: Sequence[_Chain],
    records: Sequence[_Record],
    *,
    free: Sequence[int],
    lags: Sequence[Sequence[int]],
    iterations: int,
    draws: int = 0,
    unit: _Name | None = None,
    workers: Workers | None = None,
) -> tuple[Model, float, int, _Floats, list[Model]]:
    """The model with free constants, and lags of groups of commands and times of hidden states, moved until the least
    is left. `lags` numbers commands, then hidden states.

    Returns it with χ² (infinite where it diverges), readings that counted, the covariance of what was free, each
    value being known to its own size beforehand, and members drawn from that as far as the records bear them.
    """

def linearised(
    model: Model,
    limits: Limits,
    chains: Sequence[_Chain],
    records: Sequence[_Record],
    *,
    free: Sequence[int],
    lags: Sequence[Sequence[int]],
    workers: Workers | None = None,
) -> Gram | None:
    """Inner products of the slopes of whitened prediction errors by what is free, as `tune` has it, and of minus the
    errors: a regression on them is a step of Gauss and Newton. None where the model diverges."""

def predictions(
    model: Model,
    limits: Limits,
    chains: Sequence[_Chain],
    records: Sequence[_Record],
    *,
    workers: Workers | None = None,
) -> list[tuple[_Floats, _Floats, _Floats]] | None:
    """Of each run whitened prediction errors (n + 1, n_x), and states (n + 1, n_x) and correlated disturbances (n + 1,
    chains) once each reading was used; 0 for a chain without."""

def ranks(objectives: ArrayLike) -> _Integers: ...
def crowding_distances(objectives: ArrayLike, ranks: ArrayLike) -> _Floats: ...
def select(objectives: ArrayLike, count: int) -> _Integers: ...
def ideal_point(objectives: ArrayLike) -> _Floats: ...
def best_tradeoff(objectives: ArrayLike, normalised: bool = False) -> int: ...

@final
class Archive:
    """Non-dominated set of rows, each with the number under which it was offered."""

    def __new__(cls, columns: int, width: str = "auto") -> Archive: ...
    def offer(self, objectives: ArrayLike) -> _Integers:
        """Offers rows (n, columns) in order; the numbers of the members after it."""
    def prune(self, cap: int) -> bool: ...
    @property
    def objectives(self) -> _Floats: ...
    @property
    def members(self) -> _Integers: ...
    def __len__(self) -> int: ...

@final
class Variation:
    """How a generation is made out of the last: population, shares, elitism, ranking, cap of the archive."""

    def __new__(
        cls,
        population: int,
        *,
        mutation_share: float = 0.6,
        crossover_share: float = 0.3,
        reproduction_share: float = 0.1,
        elite_share: float = 0.1,
        ranking_pressure: float = 1.8,
        archive_cap: int = 10_000,
        normalised_tradeoff: bool = False,
    ) -> Variation: ...

@final
class ModelSearch:
    """The model loop as a value: every method that moves it returns a new one."""

    @staticmethod
    def start(
        grammar: Grammar,
        form: str,
        variation: Variation,
        seed: int,
        selected: SelectedTests,
        workers: Workers,
    ) -> ModelSearch:
        """A random population, evaluated, and its non-dominated set."""
    @staticmethod
    def restored(
        grammar: Grammar,
        form: str,
        variation: Variation,
        signals: Signals,
        counters: _Counters,
        population: Sequence[Program],
        population_objectives: ArrayLike,
        archive: Sequence[Program],
        archive_objectives: ArrayLike,
        workers: Workers,
    ) -> ModelSearch:
        """The search that these were read off."""
    def learn(self, selected: SelectedTests, workers: Workers) -> ModelSearch:
        """The same population and non-dominated set, judged on more tests: a new iteration, generation 0."""
    def advance(self, selected: SelectedTests, generations: int, workers: Workers) -> ModelSearch:
        """Some generations later, on the tests that it was last judged on."""
    @property
    def counters(self) -> _Counters: ...
    @property
    def iteration(self) -> int: ...
    @property
    def generation(self) -> int: ...
    @property
    def evaluations(self) -> int:
        """Models that were run on the tests since the start."""
    @property
    def spared(self) -> int:
        """Offspring that were not run: their effective code was their parent's."""
    @property
    def capped_generations(self) -> int: ...
    @property
    def intron_share(self) -> float:
        """Mean over the population."""
    @property
    def population(self) -> list[Program]: ...
    @property
    def population_objectives(self) -> _Floats: ...
    @property
    def archive_size(self) -> int: ...
    @property
    def archive(self) -> list[Model]: ...
    @property
    def archive_objectives(self) -> _Floats:
        """(members, 2 N): open loop and closed loop of each test in turn."""
    @property
    def best(self) -> int:
        """The member that is the best trade-off."""
    @property
    def best_model(self) -> Model: ...
    @property
    def best_objectives(self) -> _Floats: ...
    def committee(self, size: int) -> list[int]:
        """At most `size` members, the best trade-off first, spread by crowding."""

@final
class TestSettings:
    """What the test loop optimises: mutants, caps, the optional third objective."""

    def __new__(
        cls,
        *,
        control_quality: bool = False,
        distance_cap: float = 3.0,
        mutants: int = 10,
        mutant_step: float = 0.05,
        mutation_step: float = 0.1,
    ) -> TestSettings: ...

@final
class TestSearch:
    """The test loop as a value."""

    @staticmethod
    def start(
        committee: Sequence[Model],
        setting: Setting,
        task: Task,
        settings: TestSettings,
        variation: Variation,
        seed: int,
        iteration: int,
        workers: Workers,
    ) -> TestSearch:
        """A random population of tests over a committee whose first member is the best trade-off."""
    @staticmethod
    def restored(
        committee: Sequence[Model],
        setting: Setting,
        task: Task,
        settings: TestSettings,
        variation: Variation,
        counters: _Counters,
        flat: bool,
        population: ArrayLike,
        population_objectives: ArrayLike,
        archive: ArrayLike,
        archive_objectives: ArrayLike,
        workers: Workers,
    ) -> TestSearch:
        """The search that these were read off, over the same committee."""
    def advance(self, generations: int, workers: Workers) -> TestSearch: ...
    @property
    def counters(self) -> _Counters: ...
    @property
    def generation(self) -> int: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def capped_generations(self) -> int: ...
    @property
    def archive_size(self) -> int: ...
    @property
    def population(self) -> _Floats:
        """Genes (population, size)."""
    @property
    def population_objectives(self) -> _Floats: ...
    @property
    def archive_genes(self) -> _Floats: ...
    @property
    def archive_objectives(self) -> _Floats:
        """(members, 2 or 3): discrimination, instability, control quality."""
    @property
    def best(self) -> int: ...
    @property
    def best_genes(self) -> _Floats: ...
    @property
    def best_objectives(self) -> _Floats: ...
    @property
    def flat(self) -> bool:
        """Whether the random tests all ended at one distance on the best model: it ignores the commands."""

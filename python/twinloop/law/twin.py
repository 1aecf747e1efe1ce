"""The twin: a learnt simulator made of readable equations, with its known error."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop._ground.arrays import Floats, at_least_zero, floats, number
from twinloop._ground.showing import Shown
from twinloop._ground.values import Value
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.law.accuracy import ErrorTable, FitTable, TestErrors, fit_table
from twinloop.law.beginning import start_of
from twinloop.law.equations import Equations
from twinloop.law.exports.environment import Reward, environment
from twinloop.law.exports.gymnasium_source import Episode
from twinloop.law.exports.taking import taken_twin
from twinloop.law.flight import fly
from twinloop.law.flown import Span, far_beyond, spans
from twinloop.law.law import Law
from twinloop.law.linear.plant import linearised, resting, trimmed
from twinloop.law.linear.state_space import Linear
from twinloop.law.noise import Noise
from twinloop.law.pieces import in_pieces, judged_length
from twinloop.law.uncertainty import DRAWS, NINE_OF_TEN, committee_runs, spread_of
from twinloop.records import Record, Recorded, checked_record, from_text, read
from twinloop.records.reading import text_of
from twinloop.remarks import Remark, warn
from twinloop.signals import Signals
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory, check_recorded, completed, continued
from twinloop.unmeasured import completed_state

STARTS = 5.0
"""Standard deviations of a sensor by which a flight's first reading may be off the state that its test asks for."""


class Twin(Shown, Value, Recorded, kind="twin"):
    """A model that replaces the system in simulations.

    Args:
        model: the engine's model.
        signals: of the system.
        errors: on the selected tests.
        limits: where a simulated run counts as diverged; None: at ten times a state's scale.
        members: of the committee, for the band of a simulated run; none: no band.
        noise: of sensors and disturbances, for the band.
        seed: of the band's random numbers.
        inflation: calibration factor on the spread of the members.
        remarks: diagnostics of the twin and the data.
        follows: whether its free runs follow at least half of the flights that it was learnt from; None: by its
            errors.
        flights: that it was learnt from; its exports are checked on them.
    """

    def __init__(
        self,
        model: _core.Model,
        signals: Signals,
        errors: Iterable[TestErrors] = (),
        limits: Limits | None = None,
        members: Sequence[_core.Model] = (),
        noise: Noise | None = None,
        seed: int = 0,
        inflation: float = 1.0,
        flights: Sequence[Trajectory] = (),
        remarks: Sequence[Remark] = (),
        follows: bool | None = None,
    ) -> None:
        self.flights = tuple(flights)
        self.inflation = inflation
        self.remarks = tuple(remarks)
        self.members = tuple(members)
        self.noise = noise
        self.seed = seed
        self.model = model
        self.signals = signals
        self.errors = ErrorTable(errors)
        self.follows = self.errors.follow() if follows is None else follows
        self._limits = Limits(signals) if limits is None else limits
        if self._limits.signals != signals:
            raise InvalidInput(
                "Twin, limits: expected those of its signals, found others; make Limits(signals)."
            )
        self._free_runs: dict[tuple[int, int], tuple[Test | Replay, Trajectory, Trajectory]] = {}

    @property
    def limits(self) -> Limits:
        """Where a simulated run counts as diverged."""
        return self._limits

    @property
    def divergence_factor(self) -> float:
        """Multiple of a state's scale at which that is, as records have it."""
        return self._limits.divergence_factor

    VERSION = 8

    @classmethod
    def recorded_fields(cls) -> tuple[str, ...]:
        """Names of the fields that a record has, in order."""
        return (
            *("signals", "model", "errors", "divergence_factor", "members", "noise", "seed", "inflation"),
            *("flights", "follows", "remarks"),
        )

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of an earlier version, which told from the errors whether the twin follows, and had no remarks."""
        return {"follows": None, "remarks": [], **super().renewed(record)}

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Twin:
        # The first version wrote sensors' offsets beside the models.
        known = (*cls.recorded_fields(), "offsets")
        found = checked_record(record, cls, known, where, optional=("offsets",))
        signals = read(Signals, found["signals"], f"{where}.signals")
        given = (signals, *given)
        models = [read(_core.Model, found["model"], f"{where}.model", given)]
        models += read(tuple[_core.Model, ...], found["members"], f"{where}.members", given)
        if found.get("offsets"):
            late = read(tuple[float, ...], found["offsets"], f"{where}.offsets")
            models = [model.with_offsets(late) for model in models]
        errors = ErrorTable(read(tuple[TestErrors, ...], found["errors"], f"{where}.errors"))
        noise = read(Noise | None, found["noise"], f"{where}.noise")
        follows = read(bool | None, found["follows"], f"{where}.follows")
        if follows is None and noise is not None:
            # Earlier versions had errors in the units of the states, as noise is.
            follows = errors.follow(float(np.square(noise.sensors).mean()))
        twin = cls(
            models[0],
            signals,
            errors,
            Limits(
                signals, number(f"Record {where}.divergence_factor", found["divergence_factor"], above=0.0)
            ),
            models[1:],
            noise,
            read(int, found["seed"], f"{where}.seed"),
            at_least_zero(f"Record {where}.inflation", found["inflation"]),
            read(tuple[Trajectory, ...], found["flights"], f"{where}.flights"),
            read(tuple[Remark, ...], found["remarks"], f"{where}.remarks"),
            follows,
        )
        widths = {(flight.states.shape[1], flight.commands.shape[1]) for flight in twin.flights}
        noisy = twin.noise is None or len(twin.noise.sensors) == len(twin.noise.moves) == signals.n_x
        if widths - {(signals.n_x, signals.n_u)} or not noisy:
            raise InvalidInput(
                f"Record {where}: expected noise and flights of {signals.n_x} states and {signals.n_u}"
                " commands, found others; it is damaged."
            )
        return twin

    def export(
        self,
        to: str | Path,
        *,
        kind: str | None = None,
        precision: str = "double",
        force: bool = False,
        episode: Episode | None = None,
    ) -> str | tuple[Path, ...]:
        """The twin for use elsewhere, with its lags, delays, hidden states and all digits.

        | kind | file | what it is |
        |---|---|---|
        | `python` | `.py` | `simulate(initial_state, commands)` and a class with `step`; it needs nothing but Python |
        | `c` | `.c`, `.h` | C99 with one period per call; no allocation, nothing but <math.h> |
        | `fmu3`, `fmu2` | `.fmu` | for co-simulation by FMI 3.0 or 2.0: C sources, and a binary for this machine |
        | `casadi` | `.py` | CasADi functions of one period, `start` and `step` |
        | `control` | `.py` | `system`, a nonlinear system of python-control |
        | `gymnasium` | `.py` | `TwinEnv`, an environment of Gymnasium |
        | `sympy` | `.py` | a script that makes SymPy expressions; divisions are plain ones |
        | `latex` | `.tex` | equations for a paper, multiplied out, with six digits |
        | `json` | `.json` | the twin itself, with its flights: `twinloop.load_twin` reads it back to the bit |

        Modules of Python, C and FMUs are run on the commands of the flights that the twin was learnt from and compared
        with the twin; SymPy is evaluated at their states. Differences above 1e-9 of a state's scale are refused (1e-3
        in single precision). Unless forced, the serious remarks on the twin are said as `RemarkWarning`s.

        Args:
            to: a kind, or the path of a file with the suffix of one.
            kind: of the file, if its suffix is not enough: "casadi", "control", "fmu2", "gymnasium", "sympy".
            precision: of C, "double" or "float".
            force: exports also a twin that does not follow its own flights, without the comparison.
            episode: start, target and length of an environment; None: those of the first flight, with the target 0.

        Returns:
            The text if `to` is a kind (in C the header, then the source), else the paths that were written.

        Raises:
            InvalidInput: no such kind, or a path that cannot be written.
            NotTrusted: the twin does not follow its own flights.
            NotAvailable: the export could not be checked on them.
        """
        if not force:
            warn(self.remarks, stacklevel=2)
        return taken_twin(self, to, kind, precision, force, episode)

    @cached_property
    def law(self) -> Law:
        """Equations, kinematics, actuators, hidden states, sensors' offsets and integrator, as a value."""
        return Law.of(self.model, self.signals)

    @cached_property
    def flown(self) -> tuple[Span, ...]:
        """Between which values its flights have shown each state; beyond them its law is extrapolated."""
        return spans(self.signals, self.flights)

    @property
    def without_flights(self) -> Twin:
        """The same model alone, without flights, errors and committee: it does not warn of runs beyond the flights."""
        return Twin(self.model, self.signals, limits=self._limits, noise=self.noise)

    def remarked(self, remarks: Iterable[Remark]) -> Twin:
        """The same twin with further diagnostics.

        Args:
            remarks: what else there is to say of it.
        """
        found = copy.copy(self)
        found.remarks = (*self.remarks, *remarks)
        return found

    def equations(self, digits: int = 6) -> str:
        """The twin as text, which SymPy reads as well if its `locals` have a symbol for each name.

        Without them `sympify` takes names such as I, E, S, N or beta for something of SymPy's own. The export `sympy`
        is a script that makes its symbols itself.

        Args:
            digits: significant digits of constants; 17 give every bit.

        Returns:
            A legend, then the equations, multiplied out, with the ± of each constant if the twin has a committee.
            With 17 digits they are as the program computes them.

        Raises:
            InvalidInput: digits out of range.
        """
        law, *members = (Law.of(model, self.signals) for model in (self.model, *self.members))
        return str(Equations(law, members, digits, self.flown))

    def simulate(self, test: Test | Replay, initial_state: ArrayLike | None = None) -> Trajectory:
        """Flies a test on the twin instead of the system.

        A `RemarkWarning` names a state that goes further beyond the `flown` range than this is wide.

        Args:
            test: any test for the same signals.
            initial_state: another start (n_x,), SI units, radians; None: the test's own.

        Returns:
            The predicted run: readings of sensors without noise, and true states, cut where it diverges; with a
            `band` if the twin has a committee.

        Raises:
            InvalidInput: the test is for other signals, or the start for other states.
        """
        check_signals(test, self.signals)
        if initial_state is not None:
            start = completed_state("Initial state", initial_state, self.signals)
            test = dataclasses.replace(test, initial_state=start)
        run = self._simulated(test)
        warn(far_beyond(self.flown, run, self.signals), stacklevel=2)
        return run

    def _simulated(self, test: Test | Replay) -> Trajectory:
        run = fly(self.model, test, limits=self.limits)
        spread = self.spread(test)
        if spread is None or self.noise is None:
            return run
        mean, variance = (values[: len(run.states)] for values in spread)
        half = NINE_OF_TEN * np.sqrt(
            self.inflation * self.inflation * variance + np.square(self.noise.sensors)
        )
        return dataclasses.replace(run, band=np.stack([mean - half, mean + half]))

    def as_flown(self, test: Test | Replay, flown: Trajectory) -> Test | Replay:
        """A test with the start of its flight, for a comparison with the flight.

        Args:
            test: of the flight, or the commands of an attached flight.
            flown: the flight.

        Returns:
            The test; a state starts at its first reading if this is further from the test's start than sensor noise
            explains. Recorded commands are flown in the pieces of `piece_of`, each from its own first reading.
        """
        if isinstance(test, Replay):
            start = start_of(self.model, flown.states, flown.commands, self.limits)
            whole = dataclasses.replace(test, initial_state=start)
            return in_pieces(whole, self.model, flown.states, self.piece_of(flown))
        begun = self.began(flown)
        explained = np.zeros_like(begun) if self.noise is None else STARTS * self.noise.sensors
        off = np.abs(self.signals.difference(begun, test.initial_state)) > explained
        return dataclasses.replace(test, initial_state=np.where(off, begun, test.initial_state))

    def free_run(self, test: Test | Replay, flown: Trajectory) -> Trajectory:
        """A test flown on the twin from where its flight began, to be shown beside the flight.

        Args:
            test: of the flight, or the commands of an attached flight.
            flown: the flight.

        Returns:
            The predicted run, as from `simulate`. It is cached for the same flight.
        """
        key = id(test), id(flown)
        if key not in self._free_runs:
            # With both of them: as long as they are here, their numbers are nobody else's.
            whole = completed(flown, self.signals, test.initial_state)
            self._free_runs[key] = test, flown, self._simulated(self.as_flown(test, whole))
        return self._free_runs[key][2]

    def began(self, flown: Trajectory) -> Floats:
        """The initial state of a flight, from its first reading.

        Args:
            flown: of the same signals.

        Returns:
            The state (n_x,).
        """
        states: Floats = self.model.states_of(flown.states[:1])
        began: Floats = states[0]
        return began

    def spread(self, test: Test | Replay) -> tuple[Floats, Floats] | None:
        """Mean and variance of a test's flights over members and disturbances, drawn together.

        Args:
            test: any test for the same signals.

        Returns:
            Mean and variance of the readings without sensor noise (n + 1, n_x), over the runs that do not diverge;
            None if the twin has no committee.
        """
        drawn = self.drawn(test, DRAWS)
        return None if drawn is None else spread_of(drawn[0], self.signals)

    def drawn(self, test: Test | Replay, draws: int) -> tuple[Floats, Floats] | None:
        """Runs of a test by each member, under drawn disturbances and sensor noise.

        Args:
            test: any test for the same signals.
            draws: for each member.

        Returns:
            Readings without sensor noise (members × draws, n + 1, n_x), NaN after a run has diverged, and that noise;
            None if the twin has no committee.
        """
        if not self.members or self.noise is None:
            return None
        return committee_runs(self.members, self.noise, test, draws, self.limits, self.seed)

    def predict(self, states: ArrayLike, commands: ArrayLike, past: ArrayLike | None = None) -> Floats:
        """The state one period later.

        With lags, delays and hidden states it depends on earlier commands. Without a `past` each row is the first
        period of a run.

        Args:
            states: (n_x,) or (rows, n_x), SI units, radians; true ones, while a rate that a record computes of readings
                is half a period old.
            commands: (n_u,) or (rows, n_u), in their units.
            past: earlier commands of the run, (p, n_u) or, one run per row, (rows, p, n_u), the oldest first, in the
                commands' units; None: none yet.

        Returns:
            The states one period later, in the shape of `states`; not finite if the model's are not.

        Raises:
            InvalidInput: shapes that do not fit.
            NotAvailable: a past of a law with hidden states that measured states drive: earlier commands do not give
                them.
        """
        if past is not None and self.law.actuation.stored:
            raise NotAvailable(
                "Twin.predict, past: expected a law whose memory earlier commands tell, found a hidden state that"
                " motion fills; run it from the start with simulate_commands."
            )
        single = np.ndim(states) == 1
        x = floats("States", np.atleast_2d(states), (None, self.signals.n_x))
        u = floats("Commands", np.atleast_2d(commands), (len(x), self.signals.n_u))
        before = None
        if past is not None:
            rows = np.asarray(past)[np.newaxis] if np.ndim(past) == 2 and single else past
            before = floats("Past commands", rows, (len(x), None, self.signals.n_u))
        following = self.model.step(x, u, past=before)
        return following[0] if single else following

    def env(
        self,
        initial_state: ArrayLike,
        target_state: ArrayLike,
        steps: int,
        *,
        reward: Reward | None = None,
        noisy: bool = False,
    ) -> Any:
        """The twin as an environment of Gymnasium: observations are states, actions are commands, a step is a period.

        An episode begins at the initial state, or at `reset(options={"initial_state": …})`; it is truncated after
        `steps`, and terminates if the twin diverges. Lags, delays and hidden states act as in `simulate`; late or
        early sensors are read as if they were on time. Commands are in their own units, not normalised. Each call
        makes a new environment.

        Args:
            initial_state: of an episode (n_x,), SI units, radians.
            target_state: for the reward (n_x,), the same units.
            steps: of an episode.
            reward: called with state (n_x,), command (n_u,) and next state (n_x,); by default −dt Σ |next − target| /
                scale.
            noisy: whether observations have the estimated sensor noise.

        Returns:
            A `gymnasium.Env`.

        Raises:
            NotAvailable: Gymnasium is not installed.
            InvalidInput: states or steps that cannot be used.
        """
        return environment(self.without_flights, initial_state, target_state, steps, reward, noisy)

    def linearise(self, at: ArrayLike, command: ArrayLike | None = None, discrete: bool = False) -> Linear:
        """The twin around a point, by exact derivatives of its equations.

        Actuators are at rest under the command of the point; hidden states are 0, or where the state settles them. Dry
        friction has its slope there: at rest it is a strong damper, but of the slowest motion alone.

        Args:
            at: state (n_x,), SI units, radians.
            command: (n_u,), in the units of the commands; None: the command that holds the state best, near the
                middle of the bounds or the rest of the actuators.
            discrete: whether A and B describe a period instead of the derivative at an instant.

        Returns:
            A and B with the names of their states and commands; in continuous time delays are separate.

        Raises:
            InvalidInput: shapes that do not fit.
            NotAvailable: no finite derivatives there, or a discrete law without `discrete=True`.
        """
        state = completed_state("State to linearise at", at, self.signals)
        if command is None:
            point = trimmed(self.law, state, resting(self.law))
        else:
            point = floats("Command to linearise at", command, (self.signals.n_u,))
        return linearised(self.law, state, point, discrete)

    def simulate_commands(self, initial_state: ArrayLike, commands: ArrayLike) -> Trajectory:
        """A free run under given commands, without a controller; lags and hidden states begin at rest, as in a flight.

        A `RemarkWarning` names a state that goes further beyond the `flown` range than this is wide.

        Args:
            initial_state: (n_x,), SI units, radians.
            commands: (n, n_u), in their units, each held for one period; they are clipped to their bounds.

        Returns:
            The predicted run: readings of sensors without noise, and true states, cut where it diverges.

        Raises:
            InvalidInput: shapes that do not fit.
        """
        state = completed_state("Initial state", initial_state, self.signals)
        u = floats("Commands", commands, (None, self.signals.n_u))
        low, high = np.array([command.bounds for command in self.signals.commands]).T
        sent = np.clip(u if len(u) else [low], low, high)
        run = fly(self.model, Replay(self.signals, state, sent), limits=self.limits)
        warn(far_beyond(self.flown, run, self.signals), stacklevel=2)
        return run if len(u) else Trajectory(np.zeros(1), run.states[:1], u, true_states=state[np.newaxis])

    def piece_of(self, trajectory: Trajectory) -> int:
        """Steps for which the twin is held against a record under its commands before it begins again at a reading.

        All of them, unless the free run leaves the record, and by the twin itself noise and disturbances take any free
        run away from it, as on a system that is unstable without its controller: then as many as a right model could be
        followed.

        Args:
            trajectory: of the same signals, with at least one step.

        Returns:
            Steps, from 1 to all of the record.

        Raises:
            InvalidInput: other columns, or no step.
        """
        trajectory = completed(trajectory, self.signals)
        check_recorded(trajectory, self.limits, None, least=1)
        noise = Noise.of_sensors(np.zeros(self.signals.n_x)) if self.noise is None else self.noise
        return judged_length(self.model, trajectory, noise, self.limits)

    def fit(self, trajectory: Trajectory) -> FitTable:
        """How well the twin's free run under the recorded commands follows a record.

        It begins where the first readings say that the record does. On a system that is unstable without its controller
        it begins again at a reading after each `piece_of`.

        Args:
            trajectory: of the same signals, with at least one step.

        Returns:
            RMSE, FIT % and R² of each state, over all readings after the first.

        Raises:
            InvalidInput: other columns, or no step.
        """
        trajectory = completed(trajectory, self.signals)
        check_recorded(trajectory, self.limits, None, least=1)
        states = continued(trajectory, self.signals, trajectory.states[0]).states
        start = start_of(self.model, states, trajectory.commands, self.limits)
        whole = Replay(self.signals, start, trajectory.commands)
        sent = in_pieces(whole, self.model, states, self.piece_of(trajectory))
        free, read = fly(self.model, sent, limits=self.limits).states, states[1:]
        return fit_table(self.signals, read, free[1:] if len(free) > len(read) else None)

    def __repr__(self) -> str:
        return f"Twin(form={self.model.form!r}, tests={len(self.errors)})"


def load_twin(path: str | Path) -> Twin:
    """A twin that was exported as JSON.

    Args:
        path: of the file.

    Returns:
        The twin, with the same numbers to the bit.

    Raises:
        InvalidInput: no such file, a file that is too large, or one without a twin.
    """
    what = f"Twin {str(path)!r}"
    return Twin.from_record(from_text(text_of(Path(path), what), what))

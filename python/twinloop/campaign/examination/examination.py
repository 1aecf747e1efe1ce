"""A campaign looked at as an engineer does; each number is computed when it is first asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.campaign.examination.beside import Beside, beside
from twinloop.campaign.examination.correlation import (
    Correlations,
    autocorrelation,
    crosscorrelation,
    lags_of,
)
from twinloop.campaign.examination.data import DataQuality, data_quality, movements
from twinloop.campaign.examination.delay_borne import periods_borne
from twinloop.campaign.examination.frequency import Responses, frequency_responses
from twinloop.campaign.examination.learning import ErrorMap, error_map
from twinloop.campaign.examination.loops import (
    ClosedCurves,
    LoopCurves,
    closed_curves,
    loop_curves,
    loops_around,
)
from twinloop.campaign.examination.poles import Pole, poles
from twinloop.campaign.examination.reaching import Ending, ending
from twinloop.campaign.examination.rivals import Rival
from twinloop.campaign.examination.steps import StepAnswer, moved_states, step_answer
from twinloop.campaign.examination.unseen import TwinBefore, Unseen, unseen_flights
from twinloop.campaign.examination.use import (
    Effort,
    GainSlope,
    effort,
    gain_slopes,
    outside_of,
    strongest_commands,
)
from twinloop.campaign.history import Experiment, Iteration, Lesson, called
from twinloop.campaign.setup import Setup
from twinloop.errors import NotAvailable
from twinloop.law.law import Law
from twinloop.law.linear.friction import has_friction, sliding
from twinloop.law.linear.margins import Loops, Margins, margins_of
from twinloop.law.linear.plant import linearised, resting, trimmed
from twinloop.law.twin import Twin
from twinloop.planning.proposal import Fared
from twinloop.test import Test
from twinloop.trajectory import Trajectory, continued


@dataclass(frozen=True, eq=False)
class Known:
    """What a campaign and its method know, by themselves and of earlier twins.

    Args:
        setup: of the campaign.
        experiments: all of them, at least one.
        twin: that was learnt last.
        history: a record for each time that something was learnt.
        best_test: gives the controller to fly; raises `NotAvailable` where there is none.
        twins: that were known earlier, the oldest first.
        error: of a model on an experiment, over the whole of it.
        innovations: of each experiment that was learnt, as far as it was (n + 1, n_x), whitened; None where there are
            none.
        rivals: sums of terms that were considered, the chosen ones among them.
        fared: how some gains (size,) have fared so far, failures included.
    """

    setup: Setup
    experiments: tuple[Experiment, ...]
    twin: Twin
    history: Sequence[Iteration | Lesson]
    best_test: Callable[[], Test]
    twins: Sequence[TwinBefore]
    error: Callable[[_core.Model, Experiment], float]
    innovations: Sequence[Floats] | None
    rivals: Sequence[Rival]
    fared: Callable[[Floats], Fared]


@dataclass(frozen=True, eq=False)
class Frequency:
    """The twin around the target beside what the flights show, from one input of the loops to one state.

    Args:
        input: name of the axis or command.
        state: that this input moves most.
        frequencies: of the twin's response (f,), rad/s.
        twin: complex gains (models, f), the twin's first; with dry friction all as it slides, then as it sticks.
        flown: responses that the flights show.
        place: of the input and the state in `flown`.
    """

    input: str
    state: str
    frequencies: Floats
    twin: np.ndarray
    flown: Responses | None
    place: tuple[int, int]


@dataclass(frozen=True, eq=False)
class _FoundLoops:
    """Loops of the controller to fly around the twin, then around each member of its committee.

    Args:
        sticking: as dry friction sticks, or without any.
        sliding: as it slides; empty without any.
        names: of the places where they are broken.
    """

    sticking: Sequence[Loops]
    sliding: Sequence[Loops]
    names: Sequence[str]

    @property
    def all(self) -> Sequence[Loops]:
        """What is drawn: sliding, as in flights, then sticking."""
        return [*self.sliding, *self.sticking]


class Examination:
    """The numbers that an engineer checks, each computed on first access.

    Args:
        known: of a campaign, which is not changed.
    """

    def __init__(self, known: Known) -> None:
        self.setup, self.signals = known.setup, known.setup.signals
        self.experiments = known.experiments
        self.names = called(self.experiments)
        self.twin = known.twin
        self.twins_before, self._error, self._fared = known.twins, known.error, known.fared
        self._history = known.history
        self.innovations = known.innovations
        self.rivals = tuple(known.rivals)
        self.best: Test | None = None
        self.no_controller = ""
        try:
            self.best = known.best_test()
        except NotAvailable as reason:
            self.no_controller = str(reason)

    @cached_property
    def flown(self) -> tuple[Trajectory, ...]:
        """What was flown, one run an experiment, with angles that are continued from the task's start."""
        start = self.setup.initial_state
        return tuple(continued(run.trajectory, self.signals, start) for run in self.experiments)

    @property
    def distance(self) -> float:
        """From the task's start to its target, in the states' units."""
        way = self.signals.difference(self.setup.final_target, self.setup.initial_state)
        return float(np.linalg.norm(way))

    # The twin

    @property
    def learnt(self) -> int:
        """Number of experiments that the twin has learnt; they are the first ones."""
        return len(self._history[-1].tests) if self._history else 0

    @cached_property
    def unseen(self) -> tuple[Unseen, ...]:
        """Flights beside their predictions from before learning, in the order of `tell`."""
        return unseen_flights(self.experiments, self.twins_before, self.setup)

    @cached_property
    def beside(self) -> tuple[Beside, ...]:
        """Each experiment beside the free run of the present twin."""
        return tuple(beside(self.twin, run) for run in self.experiments)

    @cached_property
    def _lags(self) -> int:
        lengths = [] if self.innovations is None else [len(found) - 1 for found in self.innovations]
        return lags_of(lengths)

    @cached_property
    def autocorrelation(self) -> Correlations | None:
        """Of the innovations of each state (n_x, lags); None without innovations, or if flights are too short."""
        if self.innovations is None or self._lags == 0:
            return None
        return autocorrelation([found[1:] for found in self.innovations], self._lags)

    @cached_property
    def crosscorrelation(self) -> Correlations | None:
        """Of each state's innovations with each earlier command (n_x, n_u, lags); None as for `autocorrelation`."""
        if self.innovations is None or self._lags == 0:
            return None
        commands = [
            run.trajectory.commands[: len(found) - 1]
            for run, found in zip(self.experiments, self.innovations, strict=False)
        ]
        return crosscorrelation([found[1:] for found in self.innovations], commands, self._lags)

    @cached_property
    def errors(self) -> ErrorMap:
        """Error of each twin on each flight, learnt or not."""
        known = {before.learnt: before.twin.model for before in self.twins_before}
        return error_map(self._history, self.experiments, known, self._error)

    @property
    def has_friction(self) -> bool:
        """Whether the twin has dry friction, which damps strongly as it sticks, and not at all as it slides."""
        return has_friction(self.twin.law)

    @cached_property
    def open_poles(self) -> tuple[Pole, ...]:
        """Poles of the twin at the target, as dry friction sticks; empty if it cannot be linearised there."""
        return self._open_poles(self.twin.law)

    @cached_property
    def sliding_open_poles(self) -> tuple[Pole, ...]:
        """The same as dry friction slides; empty without any."""
        if not self.has_friction:
            return ()
        return self._open_poles(sliding(self.twin.law, self.setup.final_target))

    def _open_poles(self, law: Law) -> tuple[Pole, ...]:
        target, discrete = self.setup.final_target, law.form != "acceleration"
        try:
            plant = linearised(law, target, trimmed(law, target, resting(law)), discrete)
        except NotAvailable:
            return ()
        return poles(np.linalg.eigvals(plant.A), plant.dt)

    @cached_property
    def data(self) -> tuple[DataQuality, ...]:
        """Data quality of each flight."""
        found = []
        for place, run in enumerate(self.experiments):
            own = (
                None
                if self.innovations is None or place >= len(self.innovations)
                else self.innovations[place]
            )
            saturated = max((each.saturated for each in effort(run.trajectory, self.signals)), default=0.0)
            found.append(data_quality(run, self.sensors, own, saturated))
        return tuple(found)

    @cached_property
    def movement(self) -> tuple[str, float] | None:
        """The measured state that moved least, its largest motion in a flight in sensor noises; None: unknown noise."""
        found = [
            movements(continued(flown, self.signals, flown.states[0]).states, self.sensors)
            for flown in (run.trajectory for run in self.experiments)
        ]
        known = [each for each in found if each is not None]
        if not known:
            return None
        most = np.max(known, axis=0)
        place = int(np.argmin(most))
        return self.signals.state_names[place], float(most[place])

    @property
    def sensors(self) -> Floats | None:
        """Standard deviation of each state's sensor (n_x,), 0 of a state that has none; None: unknown."""
        if self.twin.noise is None:
            return None
        sensors = self.twin.noise.sensors.copy()
        sensors[list(self.signals.unmeasured)] = 0.0
        return sensors

    # The controller

    @property
    def quality_misses(self) -> tuple[float, ...]:
        """Predicted minus flown quality of each flight that has both, in predicted spreads; infinite: it diverged."""
        return tuple(
            (test.predicted - run.quality) / test.spread if math.isfinite(test.predicted) else math.inf
            for run in self.experiments
            if (test := run.test) is not None
            and not run.off_start
            and run.quality is not None
            and test.predicted is not None
            and test.spread
        )

    @property
    def last_miss(self) -> float | None:
        """The same of the last one; None: there is none."""
        return self.quality_misses[-1] if self.quality_misses else None

    @cached_property
    def _found_loops(self) -> _FoundLoops | str:
        """The loops, or why there are none."""
        if self.best is None:
            return self.no_controller
        try:
            sticking, names = loops_around(self.twin, self.setup, self.best.genes, "axes")
            sliding, _ = loops_around(self.twin, self.setup, self.best.genes, "axes", slides=True)
        except NotAvailable as reason:
            return str(reason)
        return _FoundLoops(sticking, sliding, names)

    @property
    def _loops(self) -> _FoundLoops | None:
        return None if isinstance(self._found_loops, str) else self._found_loops

    @property
    def no_margins(self) -> str:
        """Why there are no margins; empty where there are some."""
        return self._found_loops if isinstance(self._found_loops, str) else ""

    @cached_property
    def margins(self) -> Margins | None:
        """Of the controller to fly, at the target; None if it or the twin cannot be linearised there."""
        found = self._loops
        return None if found is None else margins_of(found.sticking, found.names, "axes", found.sliding)

    @cached_property
    def delay_borne(self) -> int:
        """Periods of more delay that the planned flight bears on all models; 0 without a controller."""
        if self.best is None:
            return 0
        return periods_borne([self.twin.model, *self.twin.members], self.best.quiet(), self.twin.limits)

    @cached_property
    def loops(self) -> tuple[LoopCurves, ...]:
        """Each loop over frequency, with dry friction also of each model as it slides; empty without margins."""
        return () if self._loops is None else loop_curves(self._loops.all, self._loops.names)

    @cached_property
    def closed(self) -> ClosedCurves | None:
        """Effect of sensor noise on commands and of disturbances on states; None without margins.

        With dry friction as it slides: what moves a state at all has overcome it.
        """
        return None if self._loops is None else closed_curves(self._loops.all[0], self.setup, self.twin.noise)

    @cached_property
    def closed_poles(self) -> tuple[Pole, ...]:
        """Poles of the twin's closed loops, as dry friction sticks."""
        return () if self._loops is None else poles(self._loops.sticking[0].closed_poles(), self.signals.dt)

    @cached_property
    def sliding_closed_poles(self) -> tuple[Pole, ...]:
        """The same as dry friction slides; empty without any."""
        if not self.has_friction or self._loops is None:
            return ()
        return poles(self._loops.sliding[0].closed_poles(), self.signals.dt)

    @cached_property
    def responses(self) -> tuple[Frequency, ...]:
        """For each axis, or command, the state that it moves most: the twin at the target, and the flights.

        With dry friction first as it slides, as it does in flights.
        """
        if self._loops is None:
            return ()
        loops, names, dt = self._loops.all, self._loops.names, self.signals.dt
        frequencies = np.geomspace(2e-3 * np.pi / dt, np.pi / dt * (1.0 - 1e-9), 200)
        found = [loop.plant.response(frequencies)[:, : self.signals.n_x] @ loop.of_axes for loop in loops]
        inputs = [self._of_axes(run.trajectory.commands) for run in self.experiments]
        outputs = [run.states[:-1] for run in self.flown]
        flown = frequency_responses(
            inputs, outputs, dt, None if self.twin.noise is None else self.twin.noise.sensors
        )
        scales = np.array([state.scale for state in self.signals.states])
        size = (np.abs(found[0][len(frequencies) // 2 :]) / scales[:, np.newaxis]).mean(axis=0)
        chosen = []
        for place, name in enumerate(names):
            state = int(np.argmax(size[:, place]))
            gains = np.stack([each[:, state, place] for each in found])
            state_name = self.signals.state_names[state]
            chosen.append(Frequency(name, state_name, frequencies, gains, flown, (place, state)))
        return tuple(chosen)

    def _of_axes(self, commands: Floats) -> Floats:
        """What the axes have asked for, from the commands that were sent; the commands where there are no axes."""
        mixer = self.setup.mixer
        if mixer is None or mixer.offset is None:
            return commands
        linear = np.sign(commands) * np.abs(commands) ** (1.0 / mixer.power) - mixer.offset
        return np.asarray(linear @ np.linalg.pinv(mixer.matrix).T)

    @cached_property
    def planned(self) -> Trajectory | None:
        """The flight of the controller to fly on the twin, without excitation, with its band."""
        return None if self.best is None else self.twin.simulate(self.best.quiet())

    @cached_property
    def best_flights(self) -> tuple[Experiment, ...]:
        """Flights of the gains of the controller to fly, with any excitation."""
        if self.best is None:
            return ()
        genes = self.best.genes.tobytes()
        return tuple(
            run for run in self.experiments if run.test is not None and run.test.genes.tobytes() == genes
        )

    @cached_property
    def fared(self) -> Fared:
        """How the gains of the controller to fly have fared; without an excitation, where they have flown so."""
        return Fared(0, 0) if self.best is None else self._fared(self.best.genes)

    @cached_property
    def best_flown(self) -> Experiment | None:
        """The last flight of the controller to fly without excitation; None: there was none."""
        quiet = [run for run in self.best_flights if run.test is not None and run.test.excitation is None]
        return quiet[-1] if quiet else None

    @cached_property
    def ending(self) -> Ending | None:
        """Where the controller to fly ends its task; None where it moves with time, or no whole flight is known."""
        flight = self.planned if self.best_flown is None else self.best_flown.trajectory
        if flight is None or flight.steps < self.setup.steps or self.setup.target_state.ndim > 1:
            return None
        sensors = None if self.twin.noise is None else self.twin.noise.sensors
        setup = self.setup
        return ending(
            flight, self.signals, setup.initial_state, setup.final_target, setup.quality.weights, sensors
        )

    @cached_property
    def first_flown(self) -> Experiment | None:
        """The first planned flight: the old gains, perhaps with an excitation."""
        return next((run for run in self.experiments if run.test is not None), None)

    @cached_property
    def old(self) -> Trajectory | None:
        """The twin's flight with the old gains on the campaign's own task, without excitation."""
        if self.first_flown is None or self.first_flown.test is None or self.best is None:
            return None
        return self.twin.simulate(replace(self.best.quiet(), genes=self.first_flown.test.genes))

    @cached_property
    def moved(self) -> tuple[int, ...]:
        """States whose target differs from their start; all states if none does."""
        scales = [state.scale for state in self.signals.states]
        found = moved_states(self.setup.initial_state, self.setup.final_target, scales)
        return tuple(found) or tuple(range(self.signals.n_x))

    def step(self, trajectory: Trajectory) -> tuple[StepAnswer, ...]:
        """The step response of a flight of the campaign's task, for each state whose target differs from its start.

        Args:
            trajectory: flown or predicted.
        """
        start, target = self.setup.initial_state, self.setup.final_target
        if self.setup.target_state.ndim > 1:
            return ()
        scales = [state.scale for state in self.signals.states]
        return tuple(
            step_answer(
                self.signals.state_names[i],
                trajectory.t,
                trajectory.states[:, i],
                float(start[i]),
                float(target[i]),
            )
            for i in moved_states(start, target, scales)
        )

    def strongest(self, state: int) -> list[int]:
        """The two commands that go most with a state in the planned flight, or in the last one; all if there are few.

        Args:
            state: its place.

        Returns:
            Their places.
        """
        flight = self.experiments[-1].trajectory if self.planned is None else self.planned
        return strongest_commands(flight, self.signals, state)

    def effort(self, trajectory: Trajectory) -> tuple[Effort, ...]:
        """The use of each command by a flight.

        Args:
            trajectory: flown or predicted.
        """
        return effort(trajectory, self.signals)

    @cached_property
    def slopes(self) -> tuple[GainSlope, ...]:
        """The quality against each gain, with the other gains fixed; empty without a controller."""
        return () if self.best is None else gain_slopes(self.twin, self.setup, self.best)

    @cached_property
    def beyond(self) -> float | None:
        """Share of the planned flight beyond the range of states and commands that was flown."""
        if self.planned is None or self.planned.steps == 0:
            return None
        flown = np.concatenate([np.hstack([run.states[:-1], run.commands]) for run in self.flown])
        return outside_of(flown, np.hstack([self.planned.states[:-1], self.planned.commands]))

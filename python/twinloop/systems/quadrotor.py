"""The paper's plant: the attitude of a quadrotor under four rotor speeds (paper, section V)."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats, at_least_zero, floats, number, whole
from twinloop.controllers import PID, Mixer
from twinloop.errors import unknown
from twinloop.law.flight import fly
from twinloop.signals import Command, Signals, State
from twinloop.systems.base import System
from twinloop.systems.gusts import as_disturbance, gust_accelerations
from twinloop.systems.repeatable import Repeatable
from twinloop.systems.sensors import attitude_noise, run_stream
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

GRAVITY = 9.81
"""m/s²."""
ANGLES = ("roll", "pitch", "yaw")
GYROSCOPIC = ("physical", "print")
INTEGRAL_GAIN = 0.004
"""K_I of the first controller, N m/(rad s)."""
GUSTS = 1
"""Which of a run's streams the gusts are drawn from; the sensors' own stream does not know of them."""


class Quadrotor(Repeatable, System, kind="quadrotor"):
    """Six states (three angles, three rates), four rotor speeds, 20 ms a command, the paper's task of 2 s.

    The constants are those of the OS4 (S. Bouabdallah, EPFL thesis, 2007); the paper's own are not public.

    Args:
        noise: standard deviation of the sensors, rad on angles and five times as many rad/s on rates. The controller
            reads the noisy state and the noisy state is recorded; the trajectory's `true_states` has the true one.
        seed: of the noise; run r of this object draws from a stream of (seed, r).
        gyroscopic: signs of the two rotor terms, "physical" (+, −) or "print" (−, −) as in the paper.
        natural_frequency: of the first controller's roll, pitch and yaw, rad/s.
        damping: of the first controller.
        mass: kg.
        arm: from the centre to a rotor, m.
        inertia: about the three axes, kg m².
        rotor_inertia: kg m².
        thrust_factor: thrust over squared speed, N s².
        drag_factor: torque over squared speed, N m s².
        top_speed: of a rotor, rad/s.
        drag: torque −drag |rate| rate that brakes the three axes, N m s²: one number, or one per axis.
        motor_lag: time constant at which a rotor follows its commanded speed, s; the rotors start at hover
            speed, and their speeds are not among the states.
        gusts: standard deviation of a random angular acceleration of each axis, rad/s², correlated over
            0.2 s; run r draws it from another stream of (seed, r).

    Raises:
        InvalidInput: a constant that is not above zero, a noise, drag, lag or gust below zero, or an unknown
            `gyroscopic`.
    """

    def __init__(
        self,
        *,
        noise: float = 0.0,
        seed: int = 0,
        gyroscopic: str = "physical",
        natural_frequency: float = 2.0,
        damping: float = 0.8,
        mass: float = 0.650,
        arm: float = 0.23,
        inertia: Sequence[float] = (7.5e-3, 7.5e-3, 1.3e-2),
        rotor_inertia: float = 6e-5,
        thrust_factor: float = 3.13e-5,
        drag_factor: float = 7.5e-7,
        top_speed: float = 300.0,
        drag: float | Sequence[float] = 0.0,
        motor_lag: float = 0.0,
        gusts: float = 0.0,
    ) -> None:
        if gyroscopic not in GYROSCOPIC:
            raise unknown("gyroscopic", gyroscopic, GYROSCOPIC)
        self.noise = at_least_zero("Quadrotor, noise (rad)", noise)
        self.seed = whole("Quadrotor, seed", seed)
        self.gyroscopic = gyroscopic
        self.natural_frequency = number("Quadrotor, natural_frequency (rad/s)", natural_frequency, above=0.0)
        self.damping = number("Quadrotor, damping", damping, above=0.0)
        self.mass = number("Quadrotor, mass (kg)", mass, above=0.0)
        self.arm = number("Quadrotor, arm (m)", arm, above=0.0)
        self.inertia = floats("Quadrotor, inertia (kg m²)", inertia, (3,))
        for axis, value in zip(ANGLES, self.inertia.tolist(), strict=True):
            number(f"Quadrotor, inertia of {axis} (kg m²)", value, above=0.0)
        self.thrust_factor = number("Quadrotor, thrust_factor (N s²)", thrust_factor, above=0.0)
        self.drag_factor = number("Quadrotor, drag_factor (N m s²)", drag_factor, above=0.0)
        self.rotor_inertia = at_least_zero("Quadrotor, rotor_inertia (kg m²)", rotor_inertia)
        # One number becomes three, whatever it is: what it is not is said below.
        self.drag = floats("Quadrotor, drag (N m s²)", [drag] * 3 if np.ndim(drag) == 0 else drag, (3,))
        for axis, value in zip(ANGLES, self.drag.tolist(), strict=True):
            at_least_zero(f"Quadrotor, drag of {axis} (N m s²)", value)
        self.motor_lag = at_least_zero("Quadrotor, motor_lag (s)", motor_lag)
        self.gusts = at_least_zero("Quadrotor, gusts (rad/s²)", gusts)
        self.hover_speed = math.sqrt(self.mass * GRAVITY / (4.0 * self.thrust_factor))
        self.top_speed = number("Quadrotor, top_speed (rad/s)", top_speed, above=self.hover_speed)
        self.runs = 0
        self._signals = _signals(self.hover_speed, self.top_speed)
        self._dynamics = _core.Quadrotor(
            self._signals.dt,
            arm=self.arm,
            inertia=self.inertia,
            rotor_inertia=self.rotor_inertia,
            thrust_factor=self.thrust_factor,
            drag_factor=self.drag_factor,
            gyroscopic=self.gyroscopic,
            drag=self.drag.tolist(),
            motor_lag=self.motor_lag,
            hover_speed=self.hover_speed,
        )

    @classmethod
    def harsh(cls, noise: float = 1e-3, seed: int = 0) -> Quadrotor:
        """The same vehicle in rougher air with slower motors, to judge a method with wrong models.

        At the fastest moment of the first controller's flight the drag equals that controller's own damping, so it
        matters throughout; |rate| rate is no polynomial. The lag of 30 ms is that of small brushless motors: one and
        a half periods that no state shows. The gusts of 0.5 rad/s² are a quarter of the first controller's initial
        acceleration in roll, and limit how well any model can predict a run.

        Args:
            noise: standard deviation of the sensors, as in the constructor, rad.
            seed: of noise and gusts.

        Returns:
            A quadrotor with drag 0.05 N m s², motor lag 0.03 s and gusts 0.5 rad/s².
        """
        return cls(noise=noise, seed=seed, drag=0.05, motor_lag=0.03, gusts=0.5)

    @property
    def signals(self) -> Signals:
        """Three angles, three rates, four rotor speeds, 20 ms."""
        return self._signals

    @property
    def dynamics(self) -> _core.Quadrotor:
        """The true dynamics, for oracles only."""
        return self._dynamics

    @property
    def initial_state(self) -> Floats:
        """At rest and level (6,)."""
        return np.zeros(6)

    @property
    def target_state(self) -> Floats:
        """At rest at −30°, 30°, −70°, in rad (6,)."""
        return np.array([math.radians(angle) for angle in (-30.0, 30.0, -70.0, 0.0, 0.0, 0.0)])

    @property
    def duration(self) -> float:
        """Length of a test, s."""
        return 2.0

    @property
    def controller(self) -> PID:
        """One PID per axis in N m, converted to rotor speeds at hover thrust; the box of the gains is ours."""
        box = {"kp": (0.0, 0.3), "ki": (0.0, 0.1), "kd": (0.0, 0.1)}
        return PID(
            axes=[(angle, f"{angle}_rate") for angle in ANGLES],
            gains={f"{angle}.{term}": bounds for angle in ANGLES for term, bounds in box.items()},
            output=self._mixer(),
        )

    @property
    def default_gains(self) -> dict[str, float]:
        """The first controller, C0, by name."""
        return gains_from_frequency(self.inertia.tolist(), self.natural_frequency, self.damping)

    def run(self, test: Test) -> Trajectory:
        """Flies one test; a run that leaves ten times a state's scale is cut there and says so.

        Args:
            test: to fly.

        Returns:
            The measured run, with `true_states`.

        Raises:
            InvalidInput: the test is for other signals.
        """
        check_signals(test, self._signals)
        dt = self._signals.dt
        noise = disturbance = None
        if self.noise > 0.0:
            noise = attitude_noise(run_stream(self.seed, self.runs), test.steps, self.noise)
        if self.gusts > 0.0:
            stream = run_stream(self.seed, self.runs, GUSTS)
            disturbance = as_disturbance(gust_accelerations(stream, test.steps, self.gusts, dt), dt)
        self.runs += 1
        return fly(self._dynamics, test, noise=noise, disturbance=disturbance)

    def __deepcopy__(self, memo: dict[int, object]) -> Quadrotor:
        """A vehicle of its own, whose next run is the one that this would make."""
        memo[id(self._dynamics)] = self._dynamics  # it never changes
        copied = copy.copy(self)
        memo[id(self)] = copied
        vars(copied).update(copy.deepcopy(vars(self), memo))
        return copied

    def _mixer(self) -> Mixer:
        """Squared speeds from torques at hover thrust (specification, section 5)."""
        tilt = 1.0 / (2.0 * self.arm * self.thrust_factor)
        turn = 1.0 / (4.0 * self.drag_factor)
        matrix = [[0.0, tilt, -turn], [-tilt, 0.0, turn], [0.0, -tilt, -turn], [tilt, 0.0, turn]]
        offset = [self.mass * GRAVITY / (4.0 * self.thrust_factor)] * 4
        return Mixer(np.array(matrix), np.array(offset), power=0.5, unit="N m")


def gains_from_frequency(
    inertia: Sequence[float], natural_frequency: float, damping: float = 0.8, integral: float = INTEGRAL_GAIN
) -> dict[str, float]:
    """Gains that make each axis a second-order system: K_P = I ω², K_D = 2 ζ ω I.

    Args:
        inertia: about roll, pitch and yaw, kg m².
        natural_frequency: ω, rad/s.
        damping: ζ.
        integral: K_I of every axis, N m/(rad s).

    Returns:
        Nine gains by name.
    """
    gains = {}
    for angle, moment in zip(ANGLES, inertia, strict=True):
        gains[f"{angle}.kp"] = moment * natural_frequency * natural_frequency
        gains[f"{angle}.ki"] = integral
        gains[f"{angle}.kd"] = 2.0 * damping * natural_frequency * moment
    return gains


def gains_from_backstepping(
    inertia: Sequence[float], c1: float, c2: float, lambda_: float
) -> dict[str, float]:
    """Integral backstepping (paper, section V): K_P = I (1 + λ + c1 c2), K_I = I c2 λ, K_D = I (c1 + c2).

    Args:
        inertia: about roll, pitch and yaw, kg m².
        c1: rate at which the tracking error shrinks, 1/s.
        c2: rate at which the rate error shrinks, 1/s.
        lambda_: weight of the integral.

    Returns:
        Nine gains by name.
    """
    gains = {}
    for angle, moment in zip(ANGLES, inertia, strict=True):
        gains[f"{angle}.kp"] = moment * (1.0 + lambda_ + c1 * c2)
        gains[f"{angle}.ki"] = moment * c2 * lambda_
        gains[f"{angle}.kd"] = moment * (c1 + c2)
    return gains


def _signals(hover_speed: float, top_speed: float) -> Signals:
    envelope = {"roll": math.radians(60.0), "pitch": math.radians(60.0), "yaw": math.radians(180.0)}
    angles = [State(name, "rad", math.pi, envelope=(-limit, limit)) for name, limit in envelope.items()]
    rates = [
        State(f"{name}_rate", "rad/s", 10.0, derivative_of=name, envelope=(-5.0, 5.0)) for name in ANGLES
    ]
    rotors = [Command(f"rotor_{i}", "rad/s", (0.0, top_speed), scale=hover_speed) for i in range(1, 5)]
    return Signals(states=angles + rates, commands=rotors, dt=0.02)

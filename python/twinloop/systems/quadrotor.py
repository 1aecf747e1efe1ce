"""The paper's plant: the attitude of a quadrotor under four rotor speeds (paper, section V)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from twinloop import _core
from twinloop.arrays import Floats, floats, number, whole
from twinloop.controllers import PID, Mixer
from twinloop.errors import InvalidInput, engine_input, unknown
from twinloop.flight import fly
from twinloop.signals import Command, Signals, State
from twinloop.systems.base import System
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

GRAVITY = 9.81
"""m/s²."""
ANGLES = ("roll", "pitch", "yaw")
GYROSCOPIC = ("physical", "print")
INTEGRAL_GAIN = 0.004
"""K_I of the first controller, N m/(rad s)."""


class Quadrotor(System):
    """Six states (three angles, three rates), four rotor speeds, 20 ms a command, the paper's task of 2 s.

    The constants are those of the OS4 (S. Bouabdallah, EPFL thesis, 2007); the paper's own are not public.

    Args:
        noise: standard deviation of the sensors, rad on angles and five times as many rad/s on rates. The
            controller reads the noisy state and the noisy state is recorded; the trajectory's `true_states`
            keep the other.
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

    Raises:
        InvalidInput: a constant that is not a number above zero, or an unknown `gyroscopic`.
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
    ) -> None:
        if gyroscopic not in GYROSCOPIC:
            raise unknown("gyroscopic", gyroscopic, GYROSCOPIC)
        self.noise = number("Quadrotor, noise (rad)", noise)
        if self.noise < 0.0:
            raise InvalidInput(
                f"Quadrotor, noise (rad): expected at least 0, found {noise}; change its sign."
            )
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
        self.rotor_inertia = number("Quadrotor, rotor_inertia (kg m²)", rotor_inertia)
        if self.rotor_inertia < 0.0:
            raise InvalidInput(
                f"Quadrotor, rotor_inertia (kg m²): expected at least 0, found {rotor_inertia}; change its"
                " sign."
            )
        self.hover_speed = math.sqrt(self.mass * GRAVITY / (4.0 * self.thrust_factor))
        self.top_speed = number("Quadrotor, top_speed (rad/s)", top_speed, above=self.hover_speed)
        self.runs = 0
        self._signals = _signals(self.hover_speed, self.top_speed)
        with engine_input():
            self._dynamics = _core.Quadrotor(
                self._signals.dt,
                arm=self.arm,
                inertia=self.inertia,
                rotor_inertia=self.rotor_inertia,
                thrust_factor=self.thrust_factor,
                drag_factor=self.drag_factor,
                gyroscopic=self.gyroscopic,
            )

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
        """One PID an axis in N m, turned into rotor speeds at hover thrust; the box of the gains is ours."""
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
            test: what to fly.

        Returns:
            The measured run, with `true_states`.

        Raises:
            InvalidInput: the test is for other signals.
        """
        check_signals(test, self._signals)
        noise = None
        if self.noise > 0.0:
            stream = np.random.Generator(np.random.Philox(np.random.SeedSequence([self.seed, self.runs])))
            deviations = self.noise * np.array([1.0, 1.0, 1.0, 5.0, 5.0, 5.0])
            noise = deviations * stream.standard_normal((test.steps + 1, 6))
        self.runs += 1
        return fly(self._dynamics, test, noise=noise)

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

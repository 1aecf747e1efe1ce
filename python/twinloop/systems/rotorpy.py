"""A vehicle that was not built for Twinloop: the attitude of a multirotor of the simulator RotorPy."""

from __future__ import annotations

import dataclasses
import importlib
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from twinloop._ground.arrays import Floats, at_least_zero, whole
from twinloop.controllers import PID, Mixer
from twinloop.errors import NotAvailable, unknown
from twinloop.law.flight import fly
from twinloop.signals import Command, RigidBody, Signals, State
from twinloop.systems.base import System
from twinloop.systems.quadrotor import ANGLES, gains_from_frequency
from twinloop.systems.repeatable import Repeatable
from twinloop.systems.sensors import attitude_noise, run_stream
from twinloop.test import Test, check_signals
from twinloop.trajectory import Trajectory

VEHICLES = ("hummingbird", "crazyflie")
RATES = ("p", "q", "r")
PERIOD = 0.02
"""Period of the commands, s."""
TUMBLED = math.radians(85.0)
"""Roll or pitch at which a run is over, rad: near 90° the Euler angles jump."""
FIRST_FREQUENCY = 3.0
"""Natural frequency of the first controller's axes, rad/s."""
FIRST_INTEGRAL = 0.5
"""K_I of the first controller over the axis's inertia, 1/s³."""


class RotorPy(Repeatable, System, kind="rotorpy"):
    """Roll, pitch, yaw and body rates under four commanded rotor speeds, 20 ms a command, 2 s.

    The vehicle is RotorPy's own object with its published parameters: lagging motors, drag of body and
    rotors, a rigid body that flies off while it is tilted. Its position, velocity and rotor speeds are
    hidden. (S. Folk, J. Paulos, V. Kumar, "RotorPy: a Python-based multirotor simulator with aerodynamics",
    2023.)

    Args:
        vehicle: "hummingbird" (0.5 kg, motors of 5 ms) or "crazyflie" (30 g, motors of 72 ms).
        noise: standard deviation of the sensors, rad on angles and five times as many rad/s on rates; the noisy state
            is read and recorded, `true_states` has the true one.
        seed: of the noise; run r of this object draws from a stream of (seed, r).

    Raises:
        InvalidInput: an unknown vehicle, or a noise below zero.
        NotAvailable: RotorPy or scipy is not installed.
    """

    def __init__(self, vehicle: str = "hummingbird", *, noise: float = 0.0, seed: int = 0) -> None:
        if vehicle not in VEHICLES:
            raise unknown("vehicle of RotorPy", vehicle, VEHICLES)
        self.noise = at_least_zero("RotorPy, noise (rad)", noise)
        self.seed = whole("RotorPy, seed", seed)
        self.vehicle = vehicle
        self.runs = 0
        self._multirotor = _multirotor(vehicle)
        self.inertia = np.diag(self._multirotor.inertia).copy()
        self._signals = _signals(self._multirotor)

    @property
    def signals(self) -> Signals:
        """Three Euler angles (turned in the order yaw, pitch, roll), three body rates, four rotor speeds."""
        return self._signals

    @property
    def initial_state(self) -> Floats:
        """At rest and level (6,)."""
        return np.zeros(6)

    @property
    def target_state(self) -> Floats:
        """At rest at −25°, 25°, −50°, in rad (6,)."""
        return np.array([math.radians(angle) for angle in (-25.0, 25.0, -50.0, 0.0, 0.0, 0.0)])

    @property
    def duration(self) -> float:
        """Length of a test, s."""
        return 2.0

    @property
    def controller(self) -> PID:
        """One PID per axis in N m, converted to rotor speeds at hover thrust; the box follows the inertia."""
        box = {"kp": 400.0, "ki": 100.0, "kd": 60.0}
        gains = {
            f"{angle}.{term}": (0.0, top * moment)
            for angle, moment in zip(ANGLES, self.inertia.tolist(), strict=True)
            for term, top in box.items()
        }
        return PID(axes=list(zip(ANGLES, RATES, strict=True)), gains=gains, output=self._mixer())

    @property
    def default_gains(self) -> dict[str, float]:
        """The first controller, C0, by name: deliberately soft."""
        gains = gains_from_frequency(self.inertia.tolist(), FIRST_FREQUENCY)
        for angle, moment in zip(ANGLES, self.inertia.tolist(), strict=True):
            gains[f"{angle}.ki"] = FIRST_INTEGRAL * moment
        return gains

    def run(self, test: Test) -> Trajectory:
        """Flies one test; a run that tumbles, or leaves ten times a state's scale, is cut there and says so.

        Args:
            test: to fly.

        Returns:
            The measured run, with `true_states`.

        Raises:
            InvalidInput: the test is for other signals.
        """
        check_signals(test, self._signals)
        noise = None
        if self.noise > 0.0:
            noise = attitude_noise(run_stream(self.seed, self.runs), test.steps, self.noise)
        self.runs += 1
        flight = _Flight(self._multirotor, test.initial_state)
        flown = fly(flight, test, noise=noise)
        if flight.tumbled and flown.ended == "diverged":
            when = self._signals.dt * (flown.steps + 1)
            reason = f"the vehicle tumbled: roll or pitch passed 85°, {when:.3g} s after the start"
            return dataclasses.replace(flown, reason=reason)
        return flown

    def _mixer(self) -> Mixer:
        """Squared speeds from torques, by the vehicle's own allocation, at hover thrust."""
        multirotor = self._multirotor
        offset = [multirotor.mass * multirotor.g / (4.0 * multirotor.k_eta)] * 4
        matrix = multirotor.TM_to_f[:, 1:] / multirotor.k_eta
        return Mixer(matrix, np.array(offset), power=0.5, unit="N m")


class _Flight:
    """One run: the vehicle's full state, of which Twinloop sees the attitude."""

    def __init__(self, multirotor: Any, initial_state: Floats) -> None:
        self.multirotor = multirotor
        self.tumbled = False
        hover = _hover_speed(multirotor)
        self.state: Mapping[str, Any] = {
            "x": np.zeros(3),
            "v": np.zeros(3),
            "q": _quaternion(*initial_state[:3].tolist()),
            "w": np.array(initial_state[3:]),
            "wind": np.zeros(3),
            "rotor_speeds": np.full(4, hover),
        }

    def __call__(self, state: Floats, command: Floats) -> Floats:
        """The attitude one period later; `state` says nothing that the vehicle does not know."""
        self.state = self.multirotor.step(self.state, {"cmd_motor_speeds": command}, PERIOD)
        following = np.array([*_euler_angles(*self.state["q"].tolist()), *self.state["w"].tolist()])
        self.tumbled = bool((np.abs(following[:2]) > TUMBLED).any())
        # Not a number ends the run: what comes after a tumble is no attitude to learn from.
        return np.full(6, np.nan) if self.tumbled else following


def _multirotor(vehicle: str) -> Any:
    """RotorPy's vehicle, its parameters untouched; only the integrator's steps are ours."""
    try:
        library = importlib.import_module("rotorpy.vehicles.multirotor")
        parameters = importlib.import_module(f"rotorpy.vehicles.{vehicle}_params").quad_params
        integrate = importlib.import_module("scipy.integrate")
    except ImportError as missing:
        raise NotAvailable(
            f"systems.RotorPy: expected the packages rotorpy and scipy, found that {missing.name} is missing;"
            ' `pip install scipy`, then `pip install --no-deps "rotorpy>=3,<4"` (its planner, which is not'
            " used here, would bring in a package under the GPL)."
        ) from missing
    # As long as the motors' time constant at most: the fastest thing there is.
    step = PERIOD / math.ceil(PERIOD / parameters["tau_m"])
    return library.Multirotor(
        parameters,
        control_abstraction="cmd_motor_speeds",
        aero=True,
        integrator_kwargs={"method": _fixed_steps(integrate.OdeSolver, step)},
    )


def _fixed_steps(solver: Any, step: float) -> Any:
    """A method for scipy's `solve_ivp`: Runge–Kutta of order four in equal steps.

    The default, steps of its own choice, takes about twice as many evaluations and is less exact, for it
    starts anew in every period.
    """

    class FixedSteps(solver):  # type: ignore[misc]
        t: float
        y: Floats

        def __init__(
            self,
            fun: Callable[[float, Floats], Floats],
            t0: float,
            y0: Floats,
            t_bound: float,
            vectorized: bool = False,
        ) -> None:
            super().__init__(fun, t0, y0, t_bound, vectorized)
            self.steps = max(1, round((t_bound - t0) / step))
            self.h = (t_bound - t0) / self.steps
            self.done = 0

        def _step_impl(self) -> tuple[bool, None]:
            h, t, y = self.h, self.t, self.y
            k1 = self.fun(t, y)
            k2 = self.fun(t + 0.5 * h, y + 0.5 * h * k1)
            k3 = self.fun(t + 0.5 * h, y + 0.5 * h * k2)
            k4 = self.fun(t + h, y + h * k3)
            self.y = y + (h / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            self.done += 1
            self.t = self.t_bound if self.done == self.steps else t + h
            return True, None

    return FixedSteps


def _signals(multirotor: Any) -> Signals:
    envelope = {"roll": math.radians(80.0), "pitch": math.radians(80.0), "yaw": math.radians(180.0)}
    angles = [State(name, "rad", math.pi, envelope=(-limit, limit)) for name, limit in envelope.items()]
    # Body rates are no derivatives of Euler angles: a rigid body ties the two together.
    rates = [State(name, "rad/s", 10.0, envelope=(-10.0, 10.0)) for name in RATES]
    bounds = (float(multirotor.rotor_speed_min), float(multirotor.rotor_speed_max))
    hover = _hover_speed(multirotor)
    rotors = [Command(f"rotor_{i}", "rad/s", bounds, scale=hover) for i in range(1, 5)]
    body = RigidBody([angle.name for angle in angles], list(RATES))
    return Signals(states=angles + rates, commands=rotors, dt=PERIOD, kinematics=body)


def _hover_speed(multirotor: Any) -> float:
    """The speed at which four rotors carry the weight, rad/s."""
    return math.sqrt(multirotor.mass * multirotor.g / (4.0 * multirotor.k_eta))


def _quaternion(roll: float, pitch: float, yaw: float) -> Floats:
    """The attitude (i, j, k, w) after turning by yaw, then pitch, then roll."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in (roll, pitch, yaw)
    )
    return np.array([
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ])  # fmt: skip


def _euler_angles(i: float, j: float, k: float, w: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw of an attitude, rad."""
    sine = min(1.0, max(-1.0, 2.0 * (w * j - k * i)))
    return (
        math.atan2(2.0 * (w * i + j * k), 1.0 - 2.0 * (i * i + j * j)),
        math.asin(sine),
        math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)),
    )

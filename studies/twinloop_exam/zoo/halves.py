"""Which plants methods may be tuned on, and which are reported on. Stated before any campaign was flown on them.

The second half is no longer unseen: docs/zoo.md says what was developed on it since.

Both halves have each kind: a built-in vehicle, one of RotorPy, two rigid bodies, an aircraft, an environment of
Gymnasium, linked bodies, a chemical, a biological and a thermal or fluid system, and motors and masses with a
nonlinearity that is no polynomial.
"""

from __future__ import annotations

HALVES: dict[str, tuple[str, ...]] = {
    "tune": (
        "quadrotor", "rotorpy-hummingbird", "body-late", "body-semi-implicit", "aircraft", "pendulum", "arm",
        "reactor-inhibited", "chemostat", "tanks", "motor-friction", "motor-backlash",
    ),
    "report": (
        "quadrotor-harsh", "rotorpy-crazyflie", "body-drag", "body-delayed", "aircraft-hidden", "cart-pole",
        "double-pendulum", "reactor-catalyst", "gene", "heater", "motor-backlash-hidden", "end-stop",
    ),
}  # fmt: skip
"""Names of plants, by half."""

"""All plants of the zoo, by name."""

from __future__ import annotations

from twinloop.errors import unknown
from twinloop_exam.zoo import (
    aircraft,
    arm,
    biology,
    body_delayed,
    body_drag,
    body_late,
    body_semi_implicit,
    end_stop,
    environments,
    heater,
    motors,
    quadrotors,
    reactors,
    rotorpy,
    tanks,
)
from twinloop_exam.zoo.plant import Plant

PLANTS: dict[str, Plant] = {
    plant.name: plant
    for plant in (
        quadrotors.QUADROTOR,
        quadrotors.HARSH,
        rotorpy.HUMMINGBIRD,
        rotorpy.CRAZYFLIE,
        body_late.PLANT,
        body_drag.PLANT,
        body_delayed.PLANT,
        body_semi_implicit.PLANT,
        aircraft.LOGGED,
        aircraft.HIDDEN,
        environments.PENDULUM,
        environments.CART_POLE,
        environments.DOUBLE_PENDULUM,
        arm.PLANT,
        reactors.HALDANE,
        reactors.LANGMUIR,
        biology.MONOD,
        biology.HILL,
        tanks.PLANT,
        heater.PLANT,
        motors.FRICTION,
        motors.BACKLASH,
        motors.BACKLASH_HIDDEN,
        end_stop.PLANT,
    )
}


def plant(name: str) -> Plant:
    """A plant of the zoo.

    Args:
        name: its name.

    Raises:
        InvalidInput: there is none of this name.
    """
    if name not in PLANTS:
        raise unknown("plant of the zoo", name, PLANTS)
    return PLANTS[name]

"""Your own box of gains: bounds, decades where they matter, and a mixer from axes to actuators."""

import numpy as np

import twinloop as tl

system = tl.systems.Quadrotor()
own = system.controller.output  # the map from torques to rotor speeds; any tl.controllers.Mixer will do
box = {"kp": (1e-3, 0.3, "log"), "ki": (0.0, 0.02), "kd": (1e-3, 0.1, "log")}
controller = tl.controllers.PID(
    axes=[("roll", "roll_rate"), ("pitch", "pitch_rate"), ("yaw", None)],  # yaw rate: difference of the angle
    gains={f"{axis}.{term}": bounds for axis in ("roll", "pitch", "yaw") for term, bounds in box.items()},
    output=tl.controllers.Mixer(own.matrix, own.offset, power=0.5, unit="N m"),
)
tl.contracts.check_controller(controller, system.signals)

campaign = tl.Campaign(
    system.signals,
    controller=controller,
    initial_state=np.zeros(6),
    target_state=np.deg2rad([-20.0, 20.0, 0.0, 0.0, 0.0, 0.0]),
    duration=2.0,
    goal="control",
)
campaign.run(system, experiments=2)

for gain, value in zip(campaign.family.gains, campaign.best_test.genes, strict=True):
    print(f"{gain.name:10} {value:8.4f} {gain.unit}")

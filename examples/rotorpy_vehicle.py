"""A vehicle by others: the Crazyflie of the simulator RotorPy."""

import twinloop as tl

system = tl.systems.RotorPy("crazyflie", noise=1e-3)
tl.contracts.check_system(system, steps=10)
campaign = tl.Campaign(
    system.signals,
    controller=system.controller,
    initial_state=system.initial_state,
    target_state=system.target_state,
    duration=system.duration,
    goal="control",
    options={"evaluations": 1500},  # gains tuned less thoroughly than by default, and more quickly
)
campaign.run(system, experiments=2)
for run in campaign.experiments:
    print(f"test {run.number}: {run.trajectory.ended}, quality {run.quality:.3g}")
print(campaign.twin.errors)

"""A MuJoCo environment as the system: InvertedPendulum-v5, a cart that must move by 0.3 m with its pole upright."""

import twinloop as tl

gains = {"position": -0.3, "angle": -8.0, "velocity": -0.5, "rate": -1.0}
system = tl.systems.Gymnasium(
    "InvertedPendulum-v5",
    noise={"position": 1e-3, "angle": 1e-3, "velocity": 5e-3, "rate": 5e-3},
    default_gains={f"{state}->drive": gain for state, gain in gains.items()},
)
controller = tl.controllers.StateFeedback(
    None, gains={"position": (-5.0, 0.0), "angle": (-30.0, 0.0), "velocity": (-5.0, 0.0), "rate": (-8.0, 0.0)}
)
campaign = tl.Campaign(
    system.signals,
    controller=controller,
    initial_state=[0.0, 0.05, 0.0, 0.0],
    target_state=[0.3, 0.0, 0.0, 0.0],
    duration=4.0,
)
campaign.run(system, experiments=2)
for run in campaign.experiments:
    print(f"test {run.number}: {run.trajectory.ended}, quality {run.quality:.3g}")
print(campaign.twin.equations())

"""An environment of Gymnasium by others: Pendulum-v1, near its top, read through sensors with noise."""

import twinloop as tl

system = tl.systems.Gymnasium(
    "Pendulum-v1",  # its angle is read from a cosine and a sine, its state set after each reset
    noise={"angle": 0.002, "rate": 0.01},
    default_gains={"angle.kp": 12.0, "angle.ki": 1.0, "angle.kd": 3.0},
)
controller = tl.controllers.PID(
    axes=[("angle", "rate")],
    gains={"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.0, 10.0)},
)
tl.contracts.check_system(system, controller)

campaign = tl.Campaign(
    system.signals, controller=controller, initial_state=[0.3, 0.0], target_state=[0.0, 0.0], duration=2.0
)
campaign.run(system, experiments=3)
print(campaign.twin.equations())
print(campaign.controller.parameters)

# The twin is offered back as an environment, for whoever wants to train something else on it.
twin = campaign.twin.env(initial_state=[0.3, 0.0], target_state=[0.0, 0.0], steps=40)
state, _ = twin.reset(seed=0)
total, over = 0.0, False
while not over:
    action = campaign.controller.command(state, [0.0, 0.0])
    state, reward, terminated, truncated, _ = twin.step(action)
    total, over = total + reward, terminated or truncated
print(f"an episode on the twin ends at {state}, with a return of {total:.3g}")

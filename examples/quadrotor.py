"""The double loop, by hand: ask for a test, fly it, tell what happened."""

import twinloop as tl

system = tl.systems.Quadrotor(noise=1e-3)
campaign = tl.Campaign(
    system.signals,
    controller=system.controller,
    initial_state=system.initial_state,
    target_state=system.target_state,
    duration=system.duration,
    seed=0,
    options={"model_generations": 200},  # leave this line out for the paper's 15 000
)

first = campaign.test(system.default_gains)  # a controller that we already trust
campaign.tell(first, system.run(first))

for _ in range(3):
    test = campaign.ask()  # learns models, then picks the test on which they disagree
    campaign.tell(test, system.run(test))

print(campaign.twin.equations())
print(campaign.twin.errors)
best = campaign.best_test
print(f"test {best.number}: predicted {best.predicted:.3g}, measured {best.measured:.3g}")
print(campaign.controller.parameters)

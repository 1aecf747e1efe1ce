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
)

first = campaign.test(system.default_gains)  # a controller that we already trust, gently excited
campaign.tell(first, system.run(first))

for last in (False, True):
    test = campaign.ask(last=last)  # learns a twin and a committee, then plans the next flight
    print(f"predicted {test.predicted:.3g} ± {test.spread:.1g}, risk {test.risk:.2g}. {test.reason}")
    campaign.tell(test, system.run(test))

print(campaign.twin.equations())
print(campaign.twin.errors)
best = campaign.best_test  # the controller to fly, without excitation
print(f"test {best.number}: predicted {best.predicted:.3g}, measured {best.measured}. {best.reason}")
print(campaign.controller.parameters)

simulated = campaign.twin.simulate(best)  # with the band in which nine of ten readings are expected
print(simulated.states[-1], simulated.band[:, -1])

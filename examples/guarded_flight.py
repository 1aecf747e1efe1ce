"""A flight with a guard in the loop: gains that would leave the envelope are replaced before they do."""

import twinloop as tl

system = tl.systems.Quadrotor(noise=1e-3)
campaign = tl.Campaign(
    system.signals,
    controller=system.controller,
    initial_state=system.initial_state,
    target_state=system.target_state,
    duration=system.duration,
    seed=0,
    options={"generations": 0},  # a quicker search than the default: what is shown here is the guard
)
campaign.run(system, 2)

stiff = {**system.default_gains, "roll.kp": 0.3, "roll.kd": 0.0, "pitch.kp": 0.3, "pitch.kd": 0.0}
test = campaign.test(stiff, excitation=None)

# In a loop of your own. Here the rig is the true model; the clock is not watched, for it runs faster than time.
guard = campaign.guard(test, clock=None)
state = test.initial_state
for k in range(test.steps):
    command = guard.command(
        state, test.target(k)
    )  # the test's own, or once it has tripped the first controller's
    state = system.dynamics.step(state[None], command[None])[0]
print(guard.tripped, guard.reason)
flown = guard.trajectory(state)
print(flown.ended, flown.steps, "of", test.steps)
campaign.tell(test, flown)

# A built-in system, or any other that closes the loop with the test's controller.
guarded = campaign.guarded(system)
campaign.run(guarded, 4)
print([run.trajectory.ended for run in campaign.experiments])

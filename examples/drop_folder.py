"""A rig with a program of its own: it takes test sheets from a folder, and writes one log for each."""

import json
import math
import threading
import time
from pathlib import Path

import twinloop as tl

signals = tl.Signals(
    states=[tl.State("angle", "rad", math.pi), tl.State("rate", "rad/s", 8.0, derivative_of="angle")],
    commands=[tl.Command("torque", "N m", (-2.0, 2.0))],
    dt=0.05,
)


def rig(folder):
    """Stands for the rig's own program: a pendulum under a PID, which knows nothing of Twinloop."""
    while True:
        for sheet in folder.glob("test-*.json"):
            log = folder / f"flight-{sheet.stem[5:]}.csv"
            if log.exists():
                continue
            test = json.loads(sheet.read_text())
            dt, gains, added = test["dt"], test["gains"], test["excitation"]
            angle, rate = test["initial_state"]["angle"], test["initial_state"]["rate"]
            lines, integral = ["t,angle,rate,torque"], 0.0
            for k in range(test["steps"] + 1):
                error = test["target_state"]["angle"] - angle
                integral += error * dt
                torque = gains["angle.kp"] * error + gains["angle.ki"] * integral - gains["angle.kd"] * rate
                if added and k < test["steps"]:
                    torque += added["torque"][k]
                torque = max(-2.0, min(2.0, torque))
                lines.append(f"{k * dt!r},{angle!r},{rate!r},{torque!r}")
                rate += dt * (torque - 1.2 * math.sin(angle) - 0.05 * rate) / 0.05
                angle += dt * rate
            log.write_text("\n".join(lines) + "\n")
        time.sleep(0.1)


plant = tl.systems.Folder("drop", signals, timeout=60.0, settled=0.5)
threading.Thread(target=rig, args=(Path("drop"),), daemon=True).start()
campaign = tl.Campaign(
    signals,
    controller=tl.controllers.PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.0, 6.0), "angle.ki": (0.0, 6.0), "angle.kd": (0.0, 1.0)},
    ),
    initial_state=[0.0, 0.0],
    target_state=[1.0, 0.0],
    duration=2.0,
    goal="control",
)
campaign.test({"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.3})  # flown first
campaign.run(plant, experiments=2)
for file in sorted(Path("drop").iterdir()):
    print(file)
print(campaign.twin.equations())

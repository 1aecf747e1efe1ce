"""Three days with a rig: a laptop that dies, a flight that is stopped, a motor that cuts out; docs/three-days.md."""

import csv
import math
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

CAMPAIGN = """\
dt = 0.02                        # period of the commands, s

[states.angle]
unit = "rad"
scale = 1.5
envelope = [-1.0, 2.0]           # the arm meets the frame at -1.2 and 2.2

[states.rate]
unit = "rad/s"
scale = 5.0
derivative_of = "angle"
envelope = [-12.0, 12.0]

[commands.torque]
unit = "N m"
bounds = [-2.0, 2.0]

[controller]
kind = "pid"
axes = [["angle", "rate"]]

[controller.gains]
"angle.kp" = [0.0, 10.0]
"angle.ki" = [0.0, 10.0]
"angle.kd" = [0.0, 1.0]

[task]
initial_state = [0.0, 0.0]       # hanging down, at rest
target_state = [1.0, 0.0]        # lifted, at rest
duration = 2.0

[first]                          # what the arm has been run with for years
"angle.kp" = 2.0
"angle.ki" = 2.0
"angle.kd" = 0.2

[campaign]
goal = "control"

[options]                        # less thorough than the defaults, and quicker
libraries = ["linear", "damping", "friction", "trigonometric"]
generations = 0
evaluations = 1500
"""
FIRST = {"angle.kp": 2.0, "angle.ki": 2.0, "angle.kd": 0.2}
STEPS, DT = 100, 0.02


def rig(log, gains, excitation, seed, until=STEPS):
    """Flies the arm for `until` periods and writes what its encoder and its gyroscope read; it stands for hardware."""
    noise = random.Random(seed)
    angle, rate, integral = noise.gauss(0.0, 0.005), 0.0, 0.0  # nobody sets an arm to exactly zero
    lines = ["t,angle,rate,torque"]
    for k in range(until + 1):
        angle_read, rate_read = angle + noise.gauss(0.0, 0.001), rate + noise.gauss(0.0, 0.01)
        integral += (1.0 - angle_read) * DT
        torque = (
            gains["angle.kp"] * (1.0 - angle_read)
            + gains["angle.ki"] * integral
            - gains["angle.kd"] * rate_read
        )
        torque = max(-2.0, min(2.0, torque + (excitation[k] if k < len(excitation) else 0.0)))
        lines.append(f"{k * DT:.2f},{angle_read:.5f},{rate_read:.4f},{torque:.5f}")
        for _ in range(200):
            friction = 0.06 * math.tanh(rate / 0.1) + 0.03 * rate
            rate += DT / 200 * (torque - 1.2 * math.sin(angle) - friction) / 0.05
            angle += DT / 200 * rate
    Path(log).write_text("\n".join(lines) + "\n")


def twinloop(*command, expected=(0,), shown=True):
    """What one command prints; it is printed here as well, as a person would see it."""
    done = subprocess.run([sys.executable, "-m", "twinloop", *command], capture_output=True, text=True)
    if shown:
        print("$", shlex.join(["twinloop", *command]), end=f"\n{done.stdout}{done.stderr}", flush=True)
        print(f"(exit code {done.returncode})\n" if done.returncode else "", flush=True)
    if done.returncode not in expected:
        raise SystemExit(f"expected an exit code of {expected}, found {done.returncode}: {done.stderr}")
    return done.stdout


def tests(printed):
    """What the person reads off printed sheets: the number of each test with its gains."""
    sheets = re.split(r"^TEST (\d+) ", printed, flags=re.MULTILINE)[1:]
    gains = [dict(re.findall(r"^(angle\.k.) +(\S+)", text, re.MULTILINE)) for text in sheets[1::2]]
    return [
        (int(n), {name: float(g[name]) for name in FIRST}) for n, g in zip(sheets[::2], gains, strict=True)
    ]


def fly(test, seed, until=STEPS):
    """What the person does with a sheet: types its gains into the rig's program, loads its file, and presses start."""
    number, gains = test
    with open(f"rig-test-{number}.csv") as file:
        excitation = [float(row.get("excitation_torque") or 0.0) for row in csv.DictReader(file)]
    rig(f"flight-{number}.csv", gains, excitation, seed, until)


def killed(*command):
    """The laptop dies in the middle of a command: soon after it has written to the store that it began."""
    journal = Path("rig.db-wal")
    process = subprocess.Popen([sys.executable, "-m", "twinloop", *command], stdout=subprocess.PIPE)
    while process.poll() is None and not (journal.exists() and journal.stat().st_size):
        time.sleep(0.005)
    time.sleep(0.1)
    process.kill()
    printed = process.communicate()[0].decode()
    print("$", shlex.join(["twinloop", *command]), end=f"\n{printed}Killed\n\n", flush=True)
    if process.returncode != -signal.SIGKILL or printed:
        raise SystemExit("expected a command that was killed at work, found one that had finished")


# Monday. Two logs are old; the first flight is that of the gains that the arm has always had.
twinloop("new", "rig.toml")
Path("rig.toml").write_text(CAMPAIGN)  # stands for an editor
for number in range(2):
    rig(f"old-{number}.csv", FIRST, [], seed=100 + number)
    twinloop("attach", "rig.db", f"old-{number}.csv")
fly(tests(twinloop("ask", "rig.db"))[0], seed=0)
twinloop("tell", "rig.db", "0", "flight-0.csv")

# Tuesday. The laptop dies while it plans; a flight is stopped by hand, and in the next one the motor cuts out.
for name in ("rig.db", "rig.toml"):
    shutil.copy(name, name.replace("rig", "spare"))
killed("ask", "rig.db")
twinloop("show", "rig.db")
sheet = twinloop("ask", "rig.db")
undisturbed = twinloop("ask", "spare.db", shown=False)
assert undisturbed.replace("spare", "rig") == sheet, "the laptop that lived asks for another test"
fly(tests(sheet)[0], seed=1, until=60)
twinloop("tell", "rig.db", "1", "flight-1.csv", expected=(2,))
twinloop("tell", "rig.db", "1", "--aborted", "flight-1.csv", "--reason", "someone opened the door")
twinloop("certify", "rig.db", "-o", "tuesday", expected=(0, 1))
twinloop("ask", "rig.db")
twinloop("tell", "rig.db", "2", "--failed", "the motor cut out at the start")

# Wednesday. Two alternatives, of which one is flown; then the best gains, and what to take away.
first, other = tests(twinloop("ask", "rig.db", "--batch", "2"))
fly(first, seed=3)
twinloop("tell", "rig.db", f"{first[0]}", f"flight-{first[0]}.csv")
twinloop("abandon", "rig.db", f"{other[0]}")
fly(tests(twinloop("ask", "rig.db", "--last"))[0], seed=5)
twinloop("tell", "rig.db", "5", "flight-5.csv")
twinloop("show", "rig.db")
twinloop("report", "rig.db", "-o", "rig.html")
twinloop("certify", "rig.db", "-o", "wednesday", expected=(0, 1))
twinloop("export", "rig.db", "controller", "--to", "c", "--output", "arm.c")
twinloop("export", "rig.db", "twin", "--to", "python", "--output", "arm.py", expected=(0, 2))

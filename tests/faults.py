"""Kills a campaign at random moments, resumes it, and compares bits with one that was never killed.

    python tests/faults.py [--kills 100] [--preset paper|default] [--seed 0]

Half of the kills come after a random time, half at a random statement of SQL, often in the middle of a `tell`.
"""

import argparse
import hashlib
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import twinloop as tl
from twinloop.records import to_text

EXPERIMENTS = 3
OPTIONS = {
    "paper": {
        "model_population": 30, "model_generations": 60, "test_population": 12, "test_generations": 8,
        "committee_size": 6, "mutants": 3,
    },
    "default": {
        "moves": 400, "starts": 1, "generations": 0, "lags": False, "hidden": False, "evaluations": 128,
        "candidates": 24, "committee_size": 3, "tuning_steps": 2, "draws": 2, "tuning_starts": 1, "parts": False,
        "libraries": ("linear",),
    },
}  # fmt: skip


def fly(store, preset):
    """The whole campaign on a noisy quadrotor, from wherever its store has it."""
    system = tl.systems.Quadrotor(noise=1e-3, seed=7)
    campaign = tl.Campaign(
        system.signals,
        controller=system.controller,
        initial_state=system.initial_state,
        target_state=system.target_state,
        duration=1.0,
        preset=preset,
        seed=3,
        options=OPTIONS[preset],
        threads=1,
        store=store,
    )
    campaign.run(system, EXPERIMENTS)
    return digest(campaign)


def digest(campaign):
    """A hash of all that was flown, learnt and found, without what tells campaigns apart."""
    # First the look: what it learns is kept too, and a kill may come right after that.
    best = to_text(campaign.best_test.to_record())
    record = campaign.to_record()
    text = to_text(record) + best + campaign.twin.equations(17)
    return hashlib.sha256(text.replace(record["logbook"]["identity"], "").encode()).hexdigest()


def die_at_statement(number):
    """Ends this process, without any chance to tidy up, before its n-th statement of SQL or commit."""
    from sqlalchemy import Engine, event

    left = [number]

    @event.listens_for(Engine, "commit")
    @event.listens_for(Engine, "before_cursor_execute")
    def count(*_):
        left[0] -= 1
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGKILL)


def telling(store, log, statement):
    """Tells the log of its second test to a campaign, and dies at the n-th statement of that."""
    campaign, rows = tl.Campaign.load(store, threads=1), np.load(log)
    run = tl.Trajectory(rows["t"], rows["states"], rows["commands"])
    die_at_statement(statement)
    campaign.tell(campaign.tests[1], run)


def withdrawing(store, statement):
    """Withdraws the last flight of a campaign, and dies at the n-th statement of that."""
    campaign = tl.Campaign.load(store, threads=1)
    die_at_statement(statement)
    campaign.withdraw(campaign.experiments[-1], "the log of another flight")


def exit_code_of(work, *arguments):
    """How a process ends that does this alone, forked off one that has imported what takes long."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["twinloop", "twinloop.store"])
    child = processes.Process(target=work, args=arguments)
    child.start()
    child.join()
    return child.exitcode


def started(store, preset, statement=0):
    """The campaign in a process of its own."""
    command = [
        sys.executable,
        __file__,
        "--fly",
        str(store),
        "--preset",
        preset,
        "--statement",
        str(statement),
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def killed_and_resumed(preset, kills, seed, say=lambda line: None):
    """Campaigns that are killed now and then; all must end as the one that was not.

    Returns:
        How many kills struck a running campaign, and how many campaigns came to their end.
    """
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        whole = started(Path(folder) / "whole.db", preset)
        expected, seconds = whole.communicate()[0].strip(), time.monotonic() - begun
        assert whole.returncode == 0 and expected, "the campaign without a kill failed"
        struck = ended = 0
        while struck < kills:
            store = Path(folder) / f"{ended}.db"
            while True:
                by_statement = struck < kills and draw.random() < 0.5
                child = started(store, preset, draw.randint(1, 60) if by_statement else 0)
                if struck < kills and not by_statement:
                    try:
                        child.wait(draw.uniform(0.2, 1.0) * seconds)
                    except subprocess.TimeoutExpired:
                        child.kill()
                answer = child.communicate()[0].strip()
                if child.returncode == 0:
                    break
                assert child.returncode == -signal.SIGKILL, f"ended by itself with {child.returncode}"
                struck += 1
            ended += 1
            say(f"{preset}: {struck} kills, {ended} campaigns")
            assert answer == expected, (
                f"campaign {ended} of {preset}, seed {seed}: other bits after {struck} kills"
            )
    return struck, ended


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--preset", choices=list(OPTIONS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fly")
    parser.add_argument("--statement", type=int, default=0)
    given = parser.parse_args()
    if given.fly:
        if given.statement:
            die_at_statement(given.statement)
        print(fly(given.fly, given.preset))
        return
    for preset in [given.preset] if given.preset else list(OPTIONS):
        struck, ended = killed_and_resumed(preset, given.kills, given.seed, print)
        print(f"{preset}: {struck} kills in {ended} campaigns, every one with the bits of the one without")


if __name__ == "__main__":
    main()

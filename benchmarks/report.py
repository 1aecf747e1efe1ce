"""The report of a campaign: how long `twinloop report` takes after 20 experiments, and how large its page is.

    python benchmarks/report.py [--smoke] [STORE…]

Without stores the noisy quadrotor is flown first, which takes minutes. Each report is a process of its own; the start
of Python counts. The bar is 5 s and, beside its data, 2 MB.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BAR = 5.0
"""Seconds that a report of 20 experiments may take."""
FASTER = ("moves=800", "starts=1", "generations=0", "lags=false", "hidden=false", "evaluations=64", "candidates=16",
          "committee_size=4", "tuning_steps=3", "draws=2", "tuning_starts=1")  # fmt: skip


def called(*words):
    """Calls the command line, and gives seconds on the clock and of CPU time."""
    before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, "-m", "twinloop", *map(str, words)], check=True, capture_output=True)
    after, seconds = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - clock
    return seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def flown(store, experiments, smoke):
    """A campaign on the noisy quadrotor."""
    options = [word for option in FASTER for word in ("--set", option)] if smoke else []
    called("run", "quadrotor", "--noise", "1e-3", "--experiments", experiments, "--store", store, *options)


def measured(store, rounds):
    """Medians of seconds and CPU seconds of its report, bytes of the page, and how many experiments there are."""
    page = store.with_suffix(".html")
    times = [called("report", store, "-o", page) for _ in range(rounds)]
    shown = subprocess.run([sys.executable, "-m", "twinloop", "show", str(store), "--json"],
                           check=True, capture_output=True, text=True)  # fmt: skip
    told = json.loads(shown.stdout)["store"]["told"]
    clock, cpu = (statistics.median(each) for each in zip(*times, strict=True))
    return told, clock, cpu, page.stat().st_size


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("stores", nargs="*", type=Path, help="of campaigns that were flown before")
    arguments.add_argument("--smoke", action="store_true", help="does it run? the numbers mean nothing")
    asked = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        stores = asked.stores or [Path(folder) / "quadrotor.db"]
        if not asked.stores:
            flown(stores[0], 3 if asked.smoke else 20, asked.smoke)
        for store in stores:
            told, clock, cpu, size = measured(store, 1 if asked.smoke else 5)
            # On a machine with nothing else to do the clock shows what the processor was busy for.
            verdict = "within" if cpu <= BAR else "over"
            print(
                f"{store.name}: {told} experiments, {cpu:.1f} s of CPU time, {verdict} {BAR:g} s"
                f" ({clock:.1f} s on the clock); {size / 1e6:.2f} MB"
            )


if __name__ == "__main__":
    main()

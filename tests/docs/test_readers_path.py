"""A reader who follows one run from `tell` to a printed coefficient does not meet ever more stops."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_path_from_tell_to_a_printed_coefficient_has_no_more_stops_than_architecture_says():
    said_to_be = re.search(r"(\d+) stops", (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"))
    command = [sys.executable, ROOT / "scripts" / "readers_path.py", "--smoke", "--list"]
    *listed, said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    names = [line.split()[1] for line in listed]
    assert len(names) == len(set(names)) == int(re.search(r"(\d+) stops", said)[1]) <= int(said_to_be[1])
    steps = (
        "Campaign.tell",
        "Campaign.twin",
        "identify_runs",
        "search",
        "tune",
        "Twin.equations",
        "_equation",
    )
    met = [name for name in names if name in steps]
    assert sorted(met) == sorted(steps)
    # A law that was known before is tuned first, and its terms are searched again afterwards.
    known = "renewed" in names
    steps = [
        "Campaign.tell",
        "Campaign.twin",
        "identify_runs",
        *sorted(("search", "tune"), reverse=known),
        *steps[5:],
    ]
    assert met == steps

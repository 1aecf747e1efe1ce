"""Studies whose numbers stand in the documentation run."""

import subprocess
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.mark.parametrize(("study", "rows"), [("first_flight.py", 2), ("guarded_flights.py", 6)])
def test_a_study_prints_its_table(study, rows):
    done = subprocess.run(
        [sys.executable, STUDIES / study, "--smoke"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    table = done.stdout.splitlines()
    assert len(table) >= 2 + rows and len({line.count("|") for line in table}) == 1

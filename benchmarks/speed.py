"""Speed of the engine beside the packages that one would use otherwise: ratios of CPU time, of one run.

Every contestant is run in turn, round after round, on one thread; a ratio is the median over the rounds, with
its quartiles. Results are compared before they are timed: a disagreement ends the run with exit code 1. A
missed bar does not: a benchmark is no test.
"""

import argparse
import json
import os
import sys

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

from rich.console import Console
from rich.table import Table

import archive
import closed_loop
import committees
import filters
import fitting
import generations
import guard
import ranking
import rows
import subsets
from measure import Disagreement, Section

SECTIONS = {
    "rows": rows.report,
    "closed-loop": closed_loop.report,
    "ranking": ranking.report,
    "archive": archive.report,
    "generations": generations.report,
    "whitening": filters.report,
    "subsets": subsets.report,
    "tuning": fitting.report,
    "committees": committees.report,
    "guard": guard.report,
}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--smoke", action="store_true", help="tiny sizes: does it run, do the results agree")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--only", choices=SECTIONS, action="append", help="a section; may be repeated")
    arguments = parser.parse_args()
    reports = []
    for name in arguments.only or SECTIONS:
        try:
            section = SECTIONS[name](arguments.smoke)
        except Disagreement as disagreement:
            print(f"Results disagree in the section {name!r}: {disagreement}", file=sys.stderr)
            return 1
        reports.append(section)
        if not arguments.json:
            _print(section)
    if arguments.smoke and not arguments.json:
        print("Smoke mode: the results agree; sizes and rounds are too few for the figures to mean anything.")
    if arguments.json:
        print(json.dumps([section.as_json() for section in reports], indent=2, ensure_ascii=False))
    return 0


def _print(section: Section) -> None:
    console = Console(width=None if sys.stdout.isatty() else 140)
    table = Table("case", "contestant", title=section.title, title_justify="left")
    table.add_column("figure", justify="right")
    table.add_column("unit")
    table.add_column("CPU time / twinloop's", justify="right")
    table.add_column("quartiles")
    table.add_column("bar")
    for line in section.lines:
        spread = line.ratio
        times = (
            ["", ""]
            if spread is None
            else [f"{spread.median:.2f} ×", f"{spread.low:.2f} to {spread.high:.2f}"]
        )
        table.add_row(line.case, line.contestant, f"{line.figure:.4g}", line.unit, *times, line.verdict)
    console.print(table)
    for note in section.notes:
        console.print(note, markup=False)


if __name__ == "__main__":
    sys.exit(main())

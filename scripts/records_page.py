"""Writes the tables of docs/concepts/records.md out of the docstrings: python scripts/records_page.py."""

import inspect
import re
from pathlib import Path

import twinloop.campaign.coevolution.snapshots  # the kinds that `import twinloop` does not bring along
import twinloop.systems.rotorpy  # noqa: F401
from twinloop.records import KINDS

PAGE = Path(__file__).parents[1] / "docs" / "concepts" / "records.md"
FIELDS = {
    "campaign": {
        "setup": "the question",
        "logbook": "all that was asked and told",
        "memory": "what was learnt: `memory_of_default` or `memory_of_paper`",
    },
    "logbook": {
        "identity": "tells campaigns apart",
        "tests": "every test that was made, in order",
        "experiments": "`[number of the test, experiment]`, in the order they were told",
        "asked": "`[iteration, planned or test_loop]` of each test that was asked for",
        "failures": "tests that failed, each behind its number",
        "abandoned": "numbers of tests that will not be flown",
        "withdrawals": "flights that count no more: their experiments and failures are still in the lists above",
    },
    "pool": {
        "inputs": "how many inputs a program has",
        "operations": "how many there are to choose from",
        "nodes": '`[operation, operand, second]`: the number of a node, `{"constant": value}`, or None; inputs come '
        'first, `["one", 0, None]` is 1',
        "rungs": "the rung of the ladder on which a term stands, by node",
        "found": "description length in nats of terms that were read off a model, by node",
    },
    "setup": {
        "controller": "the family of controllers, as it was described",
        "options": "every option of the preset by name",
        "quality": 'what is minimised: "iae", "ise" or "final_distance"',
    },
    "quadrotor": {"runs": "how many it has made: the noise of the next one depends on it"},
    "twin": {
        "divergence_factor": "multiple of a state's scale beyond which a simulated run counts as diverged"
    },
    "rotorpy": {"runs": "how many it has made: the noise of the next one depends on it"},
}
"""Fields that are no arguments of their class, or other than these."""


def described(doc):
    """Arguments by name, as a docstring describes them."""
    found, current = {}, None
    _, _, arguments = doc.partition("Args:\n")
    for line in arguments.split("\n"):
        start = re.match(r"    (\w+): (.*)", line)
        if start:
            current = start.group(1)
            found[current] = start.group(2)
        elif line.startswith("        ") and current:
            found[current] += f" {line.strip()}"
        else:
            break
    return found


def tables():
    """A section for each kind."""
    sections = []
    for kind, cls in sorted(KINDS.items()):
        doc = inspect.getdoc(cls) or ""
        words = described(doc) | FIELDS.get(kind, {})
        rows = [
            f"| `{name}` | {words[name].rstrip('.').replace('|', '/')} |" for name in cls.recorded_fields()
        ]
        first = doc.split("\n")[0]
        sections.append("\n".join([f"### `{kind}`", "", first, "", "| field | |", "|---|---|", *rows, ""]))
    return "## Kinds\n\n" + "\n".join(sections)


def page():
    """The page as it should be."""
    text = PAGE.read_text(encoding="utf-8")
    return text[: text.index("## Kinds\n")] + tables()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

"""Each room has a front: the files that others import. All of its other files are its own affair, and stay so."""

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python/twinloop"
MODULES = {
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts): file
    for file in PACKAGE.rglob("*.py")
    if file.name != "__init__.py"
}

# A file that is added here may be imported from outside its room; a file that no one imports any more leaves the list.
FRONTS = {
    "_experiment": "envelope hold_back limits rates replay",
    "_ground": (
        "arrays elementary loading rounding showing side_by_side slopes steps streams texts times values versions"
        " writing"
    ),
    "autopilots": "declared files sweep",
    "campaign": (
        "agreement assessment campaign_file certificate cost from_logs history keeping persistence presets "
        "provenance remaining setup withdrawing"
    ),
    "campaign/coevolution": "method search",
    "campaign/data": (
        "begun copies declared excited gains lateness levels odd_one_out readings reports rows sent wrapped"
    ),
    "campaign/examination": (
        "beside check checking correlation data examination frequency learning log_check loops poles "
        "reaching rivals steps unseen use"
    ),
    "campaign/identify_and_plan": "method track_record",
    "controllers": "custom family gains in_words riccati state_feedback",
    "faces": "answering cli console files notebook plots result run_info terminal",
    "faces/dashboard": "command",
    "faces/figures": "catalogue figure plots saving style svg units",
    "faces/report": "command page source",
    "faces/report/tables": "controller flights table twin",
    "faces/text": "controller table twin verdict words",
    "guard": "guarded",
    "identification": "identified identify outliers records remarks settings",
    "identification/fit": "alternation committee fitting models predictions promises settling tuning",
    "identification/proposals": (
        "apart at_once bare contacts delays exponentials friction gaps hidden lags parts second_look storage terms"
        " undisturbed"
    ),
    "identification/search": (
        "behind_a_law directions drives hidden masses moderation noise problem screen selection structure walks"
    ),
    "identification/sensors": "chains euler_steps noise offsets reported",
    "identification/terms": (
        "attitude bounds candidates denominators directions exponentials formulas friction hinges joints libraries "
        "pool priors sizes"
    ),
    "law": (
        "accuracy actuation beginning ending equations expressions flight flown forms law levels noise parsing pieces "
        "play reports twin uncertainty"
    ),
    "law/exports": "environment export gymnasium_source taking",
    "law/exports/fmu": "running unit",
    "law/linear": "friction margins plant state_space storage",
    "planning": (
        "effect excitation failed gusts judging leaving planner proposal quality reasons scored seen settings worth"
    ),
    "records": "reading",
    "reproduce": "command",
    "store": "uninterrupted",
    "sweep": "command progress seeds workers",
    "systems": "base named patience quadrotor raised stepped",
}


def imported(file):
    """Modules of the package that a file imports, also by their names in a text."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def fronts():
    """By room the files that are imported from outside of it; what is in a room within a room is inside of both."""
    found = defaultdict(set)
    for importer in (*PACKAGE.rglob("*.py"), *(ROOT / "studies").rglob("*.py")):
        for name in imported(importer):
            file = MODULES.get(name)
            if file is not None and file.parent not in (PACKAGE, *importer.parents):
                found[file.parent.relative_to(PACKAGE).as_posix()].add(file.stem)
    return dict(found)


def test_only_the_front_of_a_room_is_imported_from_outside():
    listed = {room: set(names.split()) for room, names in FRONTS.items()}
    found = fronts()
    entered = {room: sorted(names - listed.get(room, set())) for room, names in found.items()}
    unused = {room: sorted(names - found.get(room, set())) for room, names in listed.items()}
    assert not any(entered.values()), f"imported from outside, but not at the front: {entered}"
    assert not any(unused.values()), f"at the front, but not imported from outside: {unused}"


LOADERS = {"_ground/showing.py", "campaign/own_progress.py", "campaign/reporting.py"}
"""Files that load a face when somebody wants to see something; import-linter does not see it, for it is a call."""


def loads_itself(file):
    """Whether a file loads a module of the package by its name, as a text."""
    calls = [node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Call)]
    loading = [
        call for call in calls if ast.unparse(call.func).split(".")[-1] in ("import_module", "__import__")
    ]
    parts = [part for call in loading for argument in call.args for part in ast.walk(argument)]
    return any(isinstance(part, ast.Constant) and str(part.value).startswith("twinloop") for part in parts)


def test_only_these_files_below_the_faces_load_one_by_its_name():
    below = [file for file in PACKAGE.rglob("*.py") if file.relative_to(PACKAGE).parts[0] != "faces"]
    assert {file.relative_to(PACKAGE).as_posix() for file in below if loads_itself(file)} == LOADERS

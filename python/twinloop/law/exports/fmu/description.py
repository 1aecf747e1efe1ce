"""What an FMU says of itself: the model description and the build description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from twinloop._core import __version__
from twinloop._ground.arrays import Floats
from twinloop._ground.texts import one_line
from twinloop.law.law import Law

Tree = ElementTree.Element
TIME = 0
"""Value reference of the time; then come states, commands, hidden states, and what late sensors read."""


@dataclass(frozen=True)
class Variable:
    """One variable of an FMU.

    Args:
        name: as equations call it.
        reference: its number.
        causality: "independent", "output", "input" or "local".
        attributes: unit, bounds, nominal and start where it has them, as text.
        description: for a person.
    """

    name: str
    reference: int
    causality: str
    attributes: dict[str, str]
    description: str = ""


def variables(law: Law, start: Floats, rest: Floats) -> list[Variable]:
    """All of them, by their references.

    Args:
        law: of the twin.
        start: state where it begins unless another is set (n_x,).
        rest: commands until others are set (n_u,).
    """
    signals = law.signals
    taken = {*signals.state_names, *signals.command_names, *law.hidden_symbols}
    time = "time"
    while time in taken:
        time += "_"
    found = [Variable(time, TIME, "independent", {"unit": "s"})]
    for state, value in zip(signals.states, start.tolist(), strict=True):
        attributes = {"unit": one_line(state.unit), "nominal": repr(state.scale), "start": repr(value)}
        found.append(Variable(state.name, len(found), "output", attributes))
    for command, value in zip(signals.commands, rest.tolist(), strict=True):
        low, high = (repr(bound) for bound in command.bounds)
        attributes = {"unit": one_line(command.unit), "min": low, "max": high, "start": repr(value)}
        found.append(Variable(command.name, len(found), "input", attributes, "held for a period"))
    for name in law.hidden_symbols:
        found.append(Variable(name, len(found), "local", {}, "a hidden state that commands drive"))
    for place in late_states(law):
        state, name = signals.states[place], f"{signals.state_names[place]}_read"
        while name in taken:
            name += "_"
        told = f"what its sensor reads, {law.offsets[place]:+.6g} s after the states that the equations drive"
        attributes = {"unit": one_line(state.unit), "nominal": repr(state.scale)}
        found.append(Variable(name, len(found), "output", attributes, told))
        taken.add(name)
    return found


def late_states(law: Law) -> list[int]:
    """Places of the states that are read late or early.

    Args:
        law: of the twin.
    """
    return [place for place, offset in enumerate(law.offsets) if offset != 0.0]


def model_description(
    version: int, law: Law, name: str, token: str, listed: Sequence[Variable], said: str = ""
) -> bytes:
    """modelDescription.xml.

    Args:
        version: of FMI, 2 or 3.
        law: of the twin.
        name: of the model, which is its identifier in C, too.
        token: by which its binary knows it.
        listed: its variables.
        said: against it, in a sentence.

    Returns:
        UTF-8.
    """
    third = version == 3
    root = ElementTree.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{version}.0",
            "modelName": name,
            ("instantiationToken" if third else "guid"): token,
            "description": f"A twin, learnt from flights. {said}".strip(),
            "generationTool": f"Twinloop {__version__}",
            "variableNamingConvention": "flat",
            **({} if third else {"numberOfEventIndicators": "0"}),
        },
    )
    state = "FMUState" if third else "FMUstate"
    simulation = _child(
        root,
        "CoSimulation",
        {
            "modelIdentifier": name,
            "canHandleVariableCommunicationStepSize": "false",
            f"canGetAndSet{state}": "true",
            f"canSerialize{state}": "true",
            **({"fixedInternalStepSize": repr(law.signals.dt)} if third else {}),
            **({} if third else {"canNotUseMemoryManagementFunctions": "true"}),
        },
    )
    if not third:
        files = _child(simulation, "SourceFiles")
        for file in source_files(version, name):
            _child(files, "File", {"name": file})
    units = sorted({unit for each in listed if (unit := each.attributes.get("unit"))})
    defined = _child(root, "UnitDefinitions")
    for unit in units:
        _child(defined, "Unit", {"name": unit})
    _child(root, "DefaultExperiment", {"startTime": "0.0", "stepSize": repr(law.signals.dt)})
    listing = _child(root, "ModelVariables")
    for each in listed:
        _variable(listing, each, third)
    structure = _child(root, "ModelStructure")
    _structure(structure, listed, third)
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def build_description(name: str) -> bytes:
    """sources/buildDescription.xml of FMI 3.0.

    Args:
        name: the model's identifier.
    """
    root = ElementTree.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = _child(root, "BuildConfiguration", {"modelIdentifier": name})
    files = _child(configuration, "SourceFileSet", {"language": "C99"})
    for file in source_files(3, name):
        _child(files, "SourceFile", {"name": file})
    _child(configuration, "Library", {"name": "m"})
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def source_files(version: int, name: str) -> tuple[str, str]:
    """What is compiled.

    Args:
        version: of FMI, 2 or 3.
        name: the model's identifier.
    """
    return f"fmi{version}-functions.c", f"{name}.c"


def _child(parent: Tree, tag: str, attributes: dict[str, str] | None = None) -> Tree:
    return ElementTree.SubElement(parent, tag, {k: v for k, v in (attributes or {}).items() if v})


def _variable(listing: Tree, each: Variable, third: bool) -> None:
    initial = {"output": "exact" if "start" in each.attributes else "calculated", "local": "calculated"}
    common = {
        "name": each.name,
        "valueReference": str(each.reference),
        "causality": each.causality,
        "variability": "continuous",
        "initial": initial.get(each.causality, ""),
        "description": each.description,
    }
    if third:
        _child(listing, "Float64", {**common, **each.attributes})
    else:
        _child(_child(listing, "ScalarVariable", common), "Real", each.attributes)


def _structure(structure: Tree, listed: Sequence[Variable], third: bool) -> None:
    """What depends on inputs at once: nothing does."""
    outputs = [each for each in listed if each.causality == "output"]
    read = [each for each in outputs if "start" not in each.attributes]
    for group, unknown, those in (
        ("Outputs", "Output", outputs),
        ("InitialUnknowns", "InitialUnknown", read),
    ):
        if not those:
            continue
        parent = structure if third else _child(structure, group)
        for each in those:
            number = {"valueReference": str(each.reference)} if third else {"index": str(each.reference + 1)}
            # What is read at first depends on the states that were set; it is left open on which.
            found = _child(parent, unknown if third else "Unknown", number)
            if group == "Outputs":
                found.set("dependencies", "")

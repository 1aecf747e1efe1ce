"""`twinloop settings`: a test as an autopilot takes it: its gains, its commands over time, its chirp."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.writing import write_whole
from twinloop.autopilots.sweep import AXES
from twinloop.campaign import Campaign
from twinloop.campaign.assessment import foreseen
from twinloop.errors import NotAvailable
from twinloop.faces.answering import answer, json_option
from twinloop.faces.columns import excitation_columns
from twinloop.faces.for_autopilots import for_an_autopilot, prepared
from twinloop.faces.telling import numbered, to_be_flown
from twinloop.logs import TIME, write_columns
from twinloop.test import Test


@click.command()
@click.argument("store")
@click.argument("test", type=int)
@for_an_autopilot
@json_option
def settings(
    store: str,
    test: int,
    output: Path,
    kind: str | None,
    mapping: Path | None,
    name: str | None,
    as_json: bool,
) -> None:
    """Write a TEST of STORE as settings: gains, commands over time and, where it can be, a chirp.

    Writes test-N-commands.csv into FOLDER and, with --autopilot, first restore.* with the gains of the first test known
    to fly, then test-N.* with those of this one, and test-N-sweep.* where its excitation is the declared sweep of
    ArduPilot or Betaflight; where it is not, a sentence says why.
    """
    given = prepared(store, name, kind, mapping)
    campaign, declared, autopilot = given.campaign, given.declared, given.autopilot
    asked = numbered(campaign, test)
    texts: dict[str, str] = {}
    said: list[str] = []
    if autopilot is not None and declared is not None:
        old, restore = _to_go_back_to(campaign), f"restore{autopilot.suffix}"
        if old is None:
            # One of an earlier time would hold gains that have failed since.
            (output / restore).unlink(missing_ok=True)
            said.append("No restore file: no test is known to fly; keep the gains that the vehicle has now.")
        else:
            whose = f"The gains of test {old.number}: load to go back."
            texts[restore] = autopilot.text(old.parameters, whose)
        texts[f"test-{test}{autopilot.suffix}"] = autopilot.text(
            asked.parameters, f"The gains of test {test}."
        )
        if declared.sweep is not None and autopilot.kind in AXES:
            try:
                texts[f"test-{test}-sweep{autopilot.suffix}"] = declared.sweep.settings(autopilot.kind, asked)
            except NotAvailable as reason:
                said.append(str(reason))
        elif asked.excitation is not None:
            said.append(
                f"Chirp settings: expected [autopilot.sweep] and one of {', '.join(AXES)}, which sweep one axis by"
                " themselves; send the table of commands."
            )
    if asked.excitation is not None and asked.hold_back is not None:
        said.append(
            "The excitation is to be held back as the test sheet says; the table has the rows to be scaled."
        )
    columns = _columns(campaign, asked)
    output.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        write_whole(output / file, text)
    table = output / f"test-{test}-commands.csv"
    write_columns(table, columns)
    written = [str(output / file) for file in [*texts, table.name]]
    notes = " ".join(said)
    text = f"Wrote {', '.join(written)}. {notes}".rstrip()
    answer({"files": written, "note": notes}, text, as_json)


def _to_go_back_to(campaign: Campaign) -> Test | None:
    """The first test that is known to fly; before any was told of, the first one that waits."""
    return campaign.trusted if campaign.runs else next(iter(to_be_flown(campaign)), None)


def _columns(campaign: Campaign, test: Test) -> dict[str, Floats]:
    """A row a period: what is added to the commands and, where there is a twin, what they will be on it."""
    signals = campaign.signals
    columns = {TIME: signals.dt * np.arange(test.steps, dtype=np.float64)}
    columns |= excitation_columns(test)
    predicted = foreseen(campaign, test)
    if predicted is not None:
        columns |= {
            f"predicted_{name}": predicted.commands[:, i] for i, name in enumerate(signals.command_names)
        }
    return columns

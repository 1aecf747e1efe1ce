"""What verbs that write files for an autopilot share: their options, the campaign, and what is declared for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from twinloop.autopilots import Autopilot
from twinloop.autopilots.declared import Declared
from twinloop.autopilots.files import FORMATS
from twinloop.campaign import Campaign
from twinloop.campaign.campaign_file import read_autopilot
from twinloop.errors import InvalidInput
from twinloop.faces.answering import name_option
from twinloop.faces.from_file import file_beside
from twinloop.faces.opening import opened_to_look

Command = TypeVar("Command", bound=Callable[..., Any])


def for_an_autopilot(command: Command) -> Command:
    """Options of a command that writes into a folder, for an autopilot too: `output`, `kind`, `mapping` and `name`.

    Args:
        command: of click.
    """
    for option in (
        name_option,
        click.option(
            "--mapping",
            type=Path,
            metavar="FILE.toml",
            help="File with its names of the gains, and its sweep; by default STORE.toml, [autopilot].",
        ),
        click.option("--autopilot", "kind", help=f"Write parameter files for {', '.join(FORMATS)}."),
        click.option(
            "-o",
            "--output",
            type=Path,
            required=True,
            metavar="FOLDER",
            help="Folder to write into; made if it does not exist.",
        ),
    ):
        command = option(command)
    return command


@dataclass(frozen=True)
class Prepared:
    """A campaign to look at, and what its gains are written for.

    Args:
        campaign: of the store, as it was written last.
        name: of the campaign.
        declared: what is declared of an autopilot; None: nothing.
        autopilot: that was chosen; None: none.
    """

    campaign: Campaign
    name: str
    declared: Declared | None
    autopilot: Autopilot | None


def prepared(store: str, name: str | None, kind: str | None, mapping: Path | None) -> Prepared:
    """Opens a campaign to look at it, with what is declared of an autopilot.

    Args:
        store: a file, or the address of a server.
        name: of the campaign; None: the only one.
        kind: of autopilot that was asked for; None: the one that is declared, if any is.
        mapping: file of the declaration; None: the campaign file beside the store.

    Raises:
        InvalidInput: no store, no such campaign, a campaign file beside it that describes another one, a declaration
            that cannot be used, or none where a kind was asked for.
        StoreFailure: the store cannot be read.
    """
    campaign, known = opened_to_look(store, name)
    declared, autopilot = _declared(store, kind, mapping)
    return Prepared(campaign, known, declared, autopilot)


def _declared(store: str, kind: str | None, mapping: Path | None) -> tuple[Declared | None, Autopilot | None]:
    file = file_beside(store) if mapping is None else mapping
    declared = read_autopilot(file) if file is not None and (file.exists() or mapping is not None) else None
    chosen = kind if kind is not None or declared is None else declared.kind
    if declared is not None and chosen is not None:
        return declared, declared.autopilot(chosen)
    if kind is not None:
        where = "a file to name with --mapping" if file is None else str(file)
        raise InvalidInput(
            f"--autopilot: expected a section [autopilot.parameters] in {where}, found none; declare there what it"
            " calls each gain."
        )
    return declared, None

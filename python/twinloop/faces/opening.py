"""Opens the campaign of a store, which must be the one that the campaign file beside it describes."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import click

from twinloop._ground.texts import to_type
from twinloop.campaign import Campaign
from twinloop.campaign.agreement import check_agreement
from twinloop.campaign.campaign_file import read_fields, read_file
from twinloop.campaign.keeping import gone_on_with, look
from twinloop.errors import InvalidInput
from twinloop.faces.console import LINE_SECONDS, Watch
from twinloop.faces.from_file import file_beside
from twinloop.faces.telling import unlearnt
from twinloop.store import shown_name

BEGUN = "campaign"
"""Name of a campaign that nobody named."""


def opened_by_hand(store: str, name: str | None = None, threads: int | None = None) -> Campaign:
    """The campaign of a store, to be written; it is begun from the file beside it where the store has none.

    Args:
        store: a file, or the address of a server.
        name: of the campaign; None: the only one.
        threads: of the engine; None: all.

    Raises:
        InvalidInput: neither a store nor a file, a file that describes another campaign, no such campaign, or several
            and no name.
        StoreFailure: somebody else writes the campaign.
    """
    file = file_beside(store)
    if file is not None and file.exists():
        begun = file.with_suffix(".db")
        # A name that was mistyped must not begin a second campaign.
        if begun.exists() and not Path(store).exists():
            raise InvalidInput(
                f"Store {store}: expected {begun}, which has the campaign of {file}, found another name; for another"
                " campaign, copy the file."
            )
        known = (gone_on_with(store, name) if Path(store).exists() else None) or name or BEGUN
        return with_plain_progress(read_file(file).campaign(store=store, name=known, threads=threads), known)
    if file is None or Path(store).exists():
        return with_plain_progress(Campaign.load(store, name, threads=threads), name or BEGUN)
    raise InvalidInput(
        f"Store {store}: expected it, or the campaign file {file} to begin it from, found neither; write one with:"
        f" {to_type('new', file)}."
    )


def fields_beside(store: str) -> Mapping[str, str]:
    """What the columns of logs are called, by signal, by the campaign file beside a store; nothing where none says so.

    Args:
        store: a file, or the address of a server.

    Raises:
        InvalidInput: the file cannot be read.
    """
    file = file_beside(store)
    return read_fields(file) if file is not None and file.is_file() else {}


def opened_to_look(store: str, name: str | None) -> tuple[Campaign, str]:
    """A campaign of a store that nothing is written to, for what is granted by it or sent to a rig; and its name.

    Args:
        store: a file, or the address of a server.
        name: of the campaign; None: the only one.

    Raises:
        InvalidInput: no store, no such campaign, or a file beside it that describes another one.
        StoreFailure: the store cannot be read.
    """
    known = look(store, name, read_only=True).name
    campaign = Campaign.load(store, known, read_only=True)
    check_beside(store, campaign, known)
    return with_plain_progress(campaign, known), known


def with_plain_progress(campaign: Campaign, name: str) -> Campaign:
    """The same campaign; its progress is a line now and then where standard error has no place for its table.

    Args:
        campaign: that may have to learn.
        name: of it.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        campaign.progress = Watch(campaign.options, len(campaign.experiments), name, after=LINE_SECONDS)
    return campaign


def say_if_unlearnt(store: str, campaign: Campaign, name: str) -> None:
    """Says on standard error that what is learnt to look at a campaign is not kept, if it has to be learnt first.

    Args:
        store: that nothing is written to.
        campaign: as the store has it.
        name: of the campaign.
    """
    said = not_kept(store, campaign, name)
    if said:
        click.echo(said, err=True)


def not_kept(store: str, campaign: Campaign, name: str) -> str:
    """That what is learnt to look at a campaign is not kept, if it has to be learnt first; empty where not.

    Args:
        store: that nothing is written to.
        campaign: as the store has it.
        name: of the campaign.
    """
    missing = unlearnt(campaign)
    if not missing:
        return ""
    keeps = to_type("learn", shown_name(store), *(() if name == BEGUN else ("--name", name)))
    return f"{missing}. What is learnt now is not kept; to keep it: {keeps}."


def check_beside(store: str, campaign: Campaign, name: str) -> None:
    """Refuses a campaign file beside a store that says something else than the campaign was begun with.

    Args:
        store: a file, or the address of a server.
        campaign: as the store has it.
        name: of the campaign.

    Raises:
        InvalidInput: they differ, or the file cannot be read.
    """
    file = file_beside(store)
    if file is not None and file.is_file():
        check_agreement(file, campaign, shown_name(store), name)


def changed_since(store: str, campaign: Campaign, name: str) -> str:
    """That the campaign file beside a store says something else than the campaign was begun with; empty where not.

    Args:
        store: a file, or the address of a server.
        campaign: as the store has it.
        name: of the campaign.
    """
    try:
        check_beside(store, campaign, name)
    except InvalidInput as reason:
        return f"The campaign file {file_beside(store)} was changed since, and is not used here: {reason}"
    return ""


def say_if_changed(store: str, campaign: Campaign, name: str) -> None:
    """Says it on standard error, where results are only shown.

    Args:
        store: a file, or the address of a server.
        campaign: as the store has it.
        name: of the campaign.
    """
    said = changed_since(store, campaign, name)
    if said:
        click.echo(said, err=True)

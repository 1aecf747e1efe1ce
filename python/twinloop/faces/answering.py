"""What a verb says at its end: a sentence for a person, or one JSON object for a program."""

from __future__ import annotations

from collections.abc import Mapping

import click

from twinloop.campaign import Campaign
from twinloop.campaign.persistence import stored_as
from twinloop.faces.result import to_json
from twinloop.faces.terminal import is_utf_8
from twinloop.store import StoredAs

name_option = click.option("--name", help="Name of the campaign, if the store holds several.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
threads_option = click.option(
    "--threads", type=int, help="Number of threads; all by default. Results do not depend on it."
)


def answer(facts: Mapping[str, object], sentence: str, as_json: bool, err: bool = False) -> None:
    """Prints what was done.

    Args:
        facts: for a program.
        sentence: for a person.
        as_json: which of the two.
        err: whether the sentence goes to standard error, where the verb's own output is a file or a table.
    """
    if as_json:
        click.echo(to_json(facts, ascii_only=not is_utf_8()), nl=False)
    else:
        click.echo(sentence, err=err)


def next_command(campaign: Campaign, verb: str, *words: object) -> str:
    """A command on a campaign for a person to type next; it names the campaign where its store holds several.

    Args:
        campaign: that is written now.
        verb: such as "withdraw".
        words: arguments behind the store.
    """
    return (stored_as(campaign) or StoredAs("STORE")).to_type(verb, *words)

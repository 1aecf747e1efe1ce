"""Where a report's campaign comes from: a store, or a record in a file."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from twinloop.campaign import Campaign
from twinloop.campaign.keeping import look
from twinloop.campaign.provenance import as_typed, without_tokens
from twinloop.errors import InvalidInput, NotAvailable
from twinloop.faces.working import knows_nothing
from twinloop.records.reading import from_text, text_of
from twinloop.store import Stored, is_address, shown_name

OWN = "a system of your own"
"""A system that has no name."""


@dataclass(frozen=True)
class Source:
    """A campaign with what is known about it.

    Args:
        campaign: to be looked at, as it was learnt last.
        name: of it.
        system: what it experimented on, in a few words.
        sessions: that have worked on it, as texts: begun, command, versions, machine.
        elapsed: seconds from its beginning to the last `tell`; None without a store.
    """

    campaign: Campaign
    name: str
    system: str
    sessions: Sequence[Mapping[str, str]]
    elapsed: float | None = None


def source(where: str, name: str | None = None, threads: int | None = None) -> Source:
    """Opens a campaign to look at it; nothing is changed, and a writer is not held up.

    Args:
        where: a store, or a file with the record of a campaign as JSON.
        name: of the campaign in a store that holds several; of a record, for its title.
        threads: of the engine; None: all.

    Raises:
        InvalidInput: neither of both, or no such campaign.
        NotAvailable: nothing was told yet.
    """
    found = _of_record(Path(where), name, threads) if _is_json(where) else _of_store(where, name, threads)
    if not found.campaign.experiments:
        raise NotAvailable(
            f"Report: expected a campaign with at least one experiment, found {found.name!r} without one; fly a"
            " controller that you trust, and tell it."
        )
    # What was learnt so far is enough, if anything was.
    found.campaign.interrupted = not knows_nothing(found.campaign)
    return found


def _is_json(where: str) -> bool:
    path = Path(where)
    if is_address(where) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(64).lstrip()[:1] == b"{"


def _of_record(path: Path, name: str | None, threads: int | None) -> Source:
    what = f"File {str(path)!r}"
    record = from_text(text_of(path, what), what)
    if not isinstance(record, dict) or record.get("kind") != "campaign":
        raise InvalidInput(
            f"{what}: expected the record of a campaign, as campaign.to_record() gives, found another JSON; a result"
            " that `--output` wrote has no flights to examine: keep the campaign with --store."
        )
    return Source(Campaign.from_record(record, threads=threads), name or path.stem, OWN, ())


def _of_store(where: str, name: str | None, threads: int | None) -> Source:
    held = look(where, name, read_only=True)
    kind = OWN if held.system is None else str(held.system.get("kind", "")).replace("_", " ")
    campaign = Campaign.load(where, held.name, read_only=True, threads=threads)
    sessions = [_session(session) for session in held.sessions]
    return Source(campaign, held.name, kind, sessions, _elapsed(held))


def _elapsed(held: Stored) -> float | None:
    if not held.told_at:
        return None
    began, ended = (datetime.fromisoformat(when) for when in (held.created, held.told_at[-1]))
    return max(0.0, (ended - began).total_seconds())


def _session(found: Mapping[str, Any]) -> dict[str, str]:
    versions = found.get("versions")
    return {
        "begun": str(found.get("started", ""))[:16].replace("T", " "),
        "command": shlex.join(
            as_typed(without_tokens([shown_name(str(word)) for word in found.get("command") or ()]))
        ),
        "versions": ", ".join(f"{k} {v}" for k, v in versions.items())
        if isinstance(versions, Mapping)
        else "",
        "machine": f"{found.get('processor', '')}, {found.get('system', '')}".strip(", "),
    }

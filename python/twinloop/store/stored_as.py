"""Under what a campaign is found again: its store, and its name where the store holds several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from twinloop._ground.texts import to_type
from twinloop.store.address import shown_name


@dataclass(frozen=True)
class StoredAs:
    """Under what a campaign is found again.

    Args:
        store: a file, or the address of a server without its passwords.
        name: of the campaign; None: the only one of its store, which nobody has to name.
    """

    store: str
    name: str | None = None

    @classmethod
    def among(cls, store: str, name: str, campaigns: Sequence[Any]) -> StoredAs:
        """Under what a campaign of a store is found.

        Args:
            store: a file, or the address of a server.
            name: of the campaign.
            campaigns: all that the store holds.
        """
        return cls(shown_name(store), name if len(campaigns) > 1 else None)

    def to_type(self, verb: str, *words: object) -> str:
        """A command of twinloop on this campaign, as a shell takes it.

        Args:
            verb: such as "tell".
            words: arguments behind the store.
        """
        return to_type(verb, self.store, *words, *([] if self.name is None else ["--name", self.name]))

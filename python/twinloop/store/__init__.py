"""The durable store: campaigns in a database, so that nothing that was told is ever lost."""

from twinloop.store.approvals import approve, approved
from twinloop.store.database import Store, is_address, opened, shown_name
from twinloop.store.keeper import Keeper, Kept, begun, found, kept
from twinloop.store.watching import Doing, doing, state

__all__ = [
    "Doing",
    "Keeper",
    "Kept",
    "Store",
    "approve",
    "approved",
    "begun",
    "doing",
    "found",
    "is_address",
    "kept",
    "opened",
    "shown_name",
    "state",
]

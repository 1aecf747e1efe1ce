"""The durable store: campaigns in a database, so that no run is ever lost."""

from twinloop.store.address import is_address, shown_name
from twinloop.store.approvals import approve, approved
from twinloop.store.database import Store, opened
from twinloop.store.keeper import Keeper, Stored, begun, found, listed, only_name
from twinloop.store.stored_as import StoredAs
from twinloop.store.watching import Doing, doing, state

__all__ = [
    "Doing",
    "Keeper",
    "Store",
    "Stored",
    "StoredAs",
    "approve",
    "approved",
    "begun",
    "doing",
    "found",
    "is_address",
    "listed",
    "only_name",
    "opened",
    "shown_name",
    "state",
]

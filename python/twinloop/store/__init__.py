"""The durable store: campaigns in a database, so that nothing that was told is ever lost."""

from twinloop.store.approvals import approve, approved, state
from twinloop.store.database import Store, opened
from twinloop.store.keeper import Keeper, Kept, begun, found, kept

__all__ = ["Keeper", "Kept", "Store", "approve", "approved", "begun", "found", "kept", "opened", "state"]

"""Which version of the code measures: that of the package, and the commit of the repository that it stands in."""

from __future__ import annotations

from importlib import metadata

from twinloop._ground.versions import WHAT_DECIDES, commit


def version() -> str:
    """Such as "0.1.0 at 8f36b7c", "0.1.0 at 8f36b7c with changes", or "0.1.0" outside a repository."""
    released, at = metadata.version("twinloop"), commit((*WHAT_DECIDES, "studies"))
    return released if at is None else f"{released} at {at}"

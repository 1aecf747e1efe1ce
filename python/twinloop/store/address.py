"""Where a store is: a file, or the address of a server, of which others may not read the passwords."""

from __future__ import annotations

import re
from pathlib import Path

SECRET = re.compile("pass|pwd|secret|token", re.IGNORECASE)
"""Names of what an address may say behind `?` that nobody else may read."""


def is_address(where: str | Path) -> bool:
    """Whether a store is named by the address of a server, and not by a file.

    Args:
        where: a file, or an address such as "postgresql+psycopg://user@host/database".
    """
    return "://" in str(where)


def shown_name(where: str | Path) -> str:
    """What a store may be called where others read it: the file, or the address without its passwords.

    Args:
        where: a file, the address of a server, or a word of a command with one, such as "--store=postgresql://host/db".
    """
    text = str(where)
    found = re.search(r"[\w+]*://", text)
    return text if found is None else text[: found.start()] + _without_secrets(text[found.start() :])


def _without_secrets(address: str) -> str:
    """An address with its passwords masked; one without any stays as it is."""
    try:
        from sqlalchemy import make_url

        url = make_url(address)
    except Exception:  # whatever it is: what cannot be read may be a password
        return _without_beginning(address)
    if address.count("@") > (url.username is not None):
        return _without_beginning(address)
    secrets = [name for name in url.query if SECRET.search(name)]
    if url.password is None and not secrets:
        return address
    masked = url.update_query_dict(dict.fromkeys(secrets, "***"))
    return masked.render_as_string(hide_password=True).replace("%2A%2A%2A", "***")


def _without_beginning(address: str) -> str:
    """An address that has no one reading: all that may belong to a password is dropped."""
    scheme, _, rest = address.partition("://")
    before, at, host = rest.rpartition("@")
    # Behind a question mark the last @ may stand in a password, too.
    return f"{scheme}://***" if not at or "?" in before else f"{scheme}://***@{host.partition('?')[0]}"

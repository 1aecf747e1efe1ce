"""The verb `twinloop dashboard`: serves a store on this machine, or to others who know a token."""

from __future__ import annotations

import secrets
import socket
from contextlib import suppress
from typing import Any

import click

from twinloop.errors import InvalidInput, NotAvailable
from twinloop.faces.answering import answer, json_option, threads_option
from twinloop.faces.dashboard.fence import LOOPBACK

PORT = 8731
SHORTEST = 16
"""Characters of a token."""


@click.command()
@click.argument("store")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="0: any free one."
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen on; others than loopback require a token.",
)
@click.option("--token", help=f"Of at least {SHORTEST} characters; by default one is made and printed.")
@threads_option
@json_option
def dashboard(
    store: str, port: int, host: str, token: str | None, threads: int | None, as_json: bool
) -> None:
    """Show STORE in the browser: a live report, the next test, and forms to approve it and to record its flight."""
    server, address = prepared(store, port, host, token, threads)
    answer({"address": address}, f"Dashboard: {address}  (Ctrl-C ends it)", as_json)
    with suppress(KeyboardInterrupt):  # the way to end it: there is nothing to say of that
        server.run()


def prepared(
    store: str,
    port: int = PORT,
    host: str = "127.0.0.1",
    token: str | None = None,
    threads: int | None = None,
) -> tuple[Any, str]:
    """A server that is bound already, and the address to open.

    Args:
        store: the file, or the address of a database.
        port: to listen on; 0: any free one.
        host: address to listen on.
        token: that is asked for; None: none on loopback, one of our own elsewhere.
        threads: of the engine.

    Raises:
        InvalidInput: no store, a port that is taken, or a token that is too short.
        NotAvailable: the packages of the extra `dashboard` are missing.
    """
    try:
        import uvicorn

        from twinloop.faces.dashboard.app import application
    except ImportError as missing:
        raise NotAvailable(
            f"The dashboard needs {missing.name}, which is not installed: pip install 'twinloop[dashboard]'."
        ) from missing
    from twinloop.faces.dashboard.desk import Desk

    if token is not None and len(token) < SHORTEST:
        raise InvalidInput(
            f"--token: expected at least {SHORTEST} characters, found {len(token)}; make it longer."
        )
    if not host.strip():
        raise InvalidInput("--host: expected an address of this machine, found none; such as 127.0.0.1.")
    here = host in ("127.0.0.1", "localhost", "::1")
    secret = token or ("" if here else secrets.token_urlsafe(24))
    desk = Desk(store, threads)
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        bound = socket.create_server((host, port), family=family)
    except OSError as failure:
        raise InvalidInput(
            f"--host, --port: expected an address of this machine with a free port, found {host} and {port}:"
            f" {failure.strerror or failure}; choose another."
        ) from failure
    name = f"[{host}]" if ":" in host else host
    named = (*LOOPBACK, name) if here or host in ("0.0.0.0", "::") else (name,)
    if host in ("0.0.0.0", "::"):
        own, addresses = socket.gethostname(), _addresses()
        named = (*named, own, *addresses)
        # A name that this machine itself cannot resolve opens nothing.
        name = own if addresses else "[::1]" if ":" in host else "127.0.0.1"
    config = uvicorn.Config(application(desk, named, secret), log_level="warning", server_header=False)
    address = f"http://{name}:{bound.getsockname()[1]}/" + (f"?token={secret}" if secret else "")
    return Bound(uvicorn.Server(config), bound), address


def _addresses() -> list[str]:
    """Addresses that this machine's own name stands for; none where it does not resolve.

    Often it is one of loopback alone. The fence knows under which address of the machine a request has come.
    """
    try:
        return socket.gethostbyname_ex(socket.gethostname())[2]
    except (OSError, UnicodeError):
        return []


class Bound:
    """A server on a socket that is its own already, so that its address is known before it runs.

    Args:
        server: of uvicorn.
        bound: the socket that it listens on.
    """

    def __init__(self, server: Any, bound: socket.socket) -> None:
        self.server, self.socket = server, bound

    def run(self) -> None:
        """Serves until it is told to stop."""
        self.server.run(sockets=[self.socket])

    def stop(self) -> None:
        """Ends it."""
        self.server.should_exit = True

"""The fence: who may talk to the dashboard. Pages of other sites, other hosts and strangers may not."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Mapping, MutableMapping, Sequence
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]
COOKIE = "twinloop_token"
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
HEADERS = [
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]


class Fence:
    """Stands before an application of ASGI.

    A name that is not the server's own is refused, so that no page elsewhere can reach it under a name that it has made
    point here. Where there is a token, the address at which the request has arrived is the server's own, too: no page
    elsewhere has that. What changes anything has to come from a page of the server's own. Where there is a token, it
    has to be known: it comes in the address once, and in a cookie from then on. All ports of a host share their
    cookies, so that the cookie's name has the port: another dashboard of the host has a cookie of its own.

    Args:
        app: behind it.
        hosts: names that the server goes by, without a port.
        token: that is asked for; empty on loopback alone.
    """

    def __init__(self, app: App, hosts: Sequence[str], token: str = "") -> None:
        self.app = app
        self.hosts = {host.lower() for host in hosts}
        self.token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets a request through, or answers it with a sentence."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        headers = {key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]}
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await _answer(send, *refusal)
            return

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS, *self._cookie(scope, headers)]
            await send(message)

        await self.app(scope, receive, guarded)

    def _refusal(self, scope: Scope, headers: Mapping[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if _name(host) not in self.hosts and not (self.token and _name(host) == _arrived(scope)):
            return 421, "Expected the server's own name in the address, found another one."
        if scope["method"] not in ("GET", "HEAD"):
            origin = headers.get("origin")
            if not _is_of(origin, host) or headers.get("sec-fetch-site", "same-origin") != "same-origin":
                return 403, "Expected a page of this dashboard, found another origin."
        if self.token and not self._knows(scope, headers):
            return (
                401,
                "Expected the token in the address that the command has printed, found none that is right.",
            )
        return None

    def _knows(self, scope: Scope, headers: Mapping[str, str]) -> bool:
        given = (*_kept(headers.get("cookie", ""), _cookie_of(headers)), *_asked(scope))
        return any(hmac.compare_digest(one.encode(), self.token.encode()) for one in given)

    def _cookie(self, scope: Scope, headers: Mapping[str, str]) -> list[tuple[bytes, bytes]]:
        if not self.token or self.token not in _asked(scope):
            return []
        cookie = f"{_cookie_of(headers)}={self.token}"
        return [(b"set-cookie", f"{cookie}; HttpOnly; SameSite=Strict; Path=/".encode())]


def _name_and_port(host: str) -> tuple[str, str]:
    """Both parts of a host as a browser writes it; no port where it is the usual one."""
    name, _, port = host.lower().rpartition(":")
    return (name, port) if name and port.isdecimal() else (host.lower(), "")


def _name(host: str) -> str:
    return _name_and_port(host)[0]


def _cookie_of(headers: Mapping[str, str]) -> str:
    """Name of the cookie; the port is that of the browser's address, which behind a tunnel is not the server's own."""
    port = _name_and_port(headers.get("host", ""))[1]
    return f"{COOKIE}_{port}" if port else COOKIE


def _arrived(scope: Scope) -> str | None:
    """The address of this machine at which a request has arrived, as a browser writes it; None where it is unknown."""
    server = scope.get("server")
    if not server or not server[0]:
        return None
    address = str(server[0]).lower().partition("%")[0]
    return f"[{address}]" if ":" in address else address


def _is_of(origin: str | None, host: str) -> bool:
    """Whether an origin is that of a page of this server; one that is no address is foreign."""
    try:
        return origin is not None and urlsplit(origin).netloc.lower() == host.lower()
    except ValueError:
        return False


def _kept(cookies: str, wanted: str) -> list[str]:
    """Tokens among the cookies of a request.

    All ports of a host share their cookies, so others stand beside, in any form: those are passed over, not read.
    """
    pairs = (each.partition("=") for each in cookies.split(";"))
    return [value.strip() for name, _, value in pairs if name.strip() == wanted]


def _asked(scope: Scope) -> list[str]:
    return parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])


async def _answer(send: Send, status: int, sentence: str) -> None:
    headers = [(b"content-type", b"text/plain; charset=utf-8"), *HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": (sentence + "\n").encode()})

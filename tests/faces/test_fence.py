"""The fence of the dashboard: under which names it answers, and to whom."""

import asyncio

import pytest

pytest.importorskip("starlette", reason="twinloop[dashboard] is not installed")

from twinloop.faces.dashboard.fence import Fence

TOKEN = "a-secret-that-is-long"
OWN = "twinloop_token_8731"
KNOWN = f"{OWN}={TOKEN}"


async def behind(scope, receive, send):
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def status(fence, method="GET", server=("127.0.0.1", 8731), **headers):
    """Status of the answer to a request."""
    sent = []

    async def send(message):
        sent.append(message)

    pairs = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
    scope = {"type": "http", "method": method, "headers": pairs, "query_string": b"", "server": server}
    asyncio.run(fence(scope, None, send))
    return sent[0]["status"]


@pytest.mark.parametrize(
    ("server", "host"),
    [("192.168.1.5", "192.168.1.5:8731"), ("fe80::1%eth0", "[fe80::1]:8731"), ("fd00::A", "[fd00::a]")],
)
def test_where_a_token_is_asked_for_the_address_of_the_machine_is_a_name_of_its_own(server, host):
    fence, open_to_all = Fence(behind, ["rig-pc"], TOKEN), Fence(behind, ["rig-pc"])
    # A browser leaves the usual port out.
    known = KNOWN if host.endswith(":8731") else f"twinloop_token={TOKEN}"
    assert status(fence, server=(server, 8731), host=host, cookie=known) == 200
    assert status(fence, server=(server, 8731), host=host) == 401
    assert status(open_to_all, server=(server, 8731), host=host) == 421
    for other in ("evil.example", "192.168.1.6", "[fe80::2]", ""):
        assert status(fence, server=(server, 8731), host=other, cookie=KNOWN) == 421
        assert status(fence, server=None, host=other, cookie=KNOWN) == 421


@pytest.mark.parametrize(
    "others",
    ["theme=dark; {}", 'prefs={{"a": 1}}; {}', '{}; prefs={{"a": 1}}', "a b=1; {}", "x=é; {}", "foo; {}", "k[0]=1; {};",
     "tz=Europe/Paris (CET);{}", f"{OWN}=another; {{}}"],
)  # fmt: skip
def test_the_token_is_known_whatever_other_cookies_the_host_has(others):
    fence = Fence(behind, ["rig-pc"], TOKEN)
    assert status(fence, host="rig-pc:8731", cookie=others.format(KNOWN)) == 200
    for wrong in (f"{OWN}=another", OWN, f"{OWN}={TOKEN}x", f"x{KNOWN}", f"x={KNOWN}"):
        assert status(fence, host="rig-pc:8731", cookie=others.format(wrong)) == 401


@pytest.mark.parametrize("origin", ["http://[", "http://rig-pc:8731]", "null", "", "http://rig-pc:1"])
def test_an_origin_that_is_no_address_of_the_server_is_foreign(origin):
    fence = Fence(behind, ["rig-pc"], TOKEN)
    said = {"host": "rig-pc:8731", "cookie": KNOWN}
    assert status(fence, "POST", origin=origin, **said) == 403
    assert status(fence, "POST", **said) == 403
    assert status(fence, "POST", origin="http://rig-pc:8731", **said) == 200


def cookie_of(fence, host, token):
    """What a fence tells a browser to keep that comes with a token."""
    sent = []

    async def send(message):
        sent.append(message)

    scope = {
        "type": "http", "method": "GET", "headers": [(b"host", host.encode())],
        "query_string": f"token={token}".encode(), "server": ("127.0.0.1", 8731),
    }  # fmt: skip
    asyncio.run(fence(scope, None, send))
    (cookie,) = [value.decode() for name, value in sent[0]["headers"] if name == b"set-cookie"]
    return cookie.partition(";")[0]


def test_two_dashboards_of_one_host_do_not_log_each_other_out():
    """A browser keeps one cookie of a name for a host, whatever the port; through a tunnel both ports may be 8731."""
    tokens = {"rig-pc:8731": TOKEN, "rig-pc:9000": "another-that-is-long", "rig-pc": "a-third-one-is-long"}
    fences = {host: Fence(behind, ["rig-pc"], token) for host, token in tokens.items()}
    jar = {}
    for host, token in tokens.items():
        name, _, value = cookie_of(fences[host], host, token).partition("=")
        jar[name] = value
    cookies = "; ".join(f"{name}={value}" for name, value in jar.items())
    assert [status(fence, host=host, cookie=cookies) for host, fence in fences.items()] == [200, 200, 200]
    # The cookie of one is worth nothing at another.
    for host, fence in fences.items():
        others = "; ".join(f"{name}={value}" for name, value in jar.items() if value != tokens[host])
        assert status(fence, host=host, cookie=others) == 401

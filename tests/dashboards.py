"""A dashboard that runs, how it is called, and what is told to it."""

import contextlib
import http.client
import threading
import time
from urllib.parse import urlsplit

import twinloop as tl
from conftest import PENDULUM_GAINS
from lives import PLANT, stored
from twinloop.faces.dashboard.command import prepared
from twinloop.logs import write_columns


def begun(path):
    """The path of a store with one flight told and a test that waits."""
    campaign = stored(path, preset="default")
    test = campaign.test(PENDULUM_GAINS)
    campaign.tell(test, PLANT.run(test))
    campaign.ask()
    campaign.close()
    return path


@contextlib.contextmanager
def served(store, **how):
    """A dashboard that runs, and its address."""
    server, address = prepared(str(store), 0, threads=1, **how)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    for _ in range(100):
        if server.server.started:
            break
        time.sleep(0.05)
    try:
        yield address
    finally:
        server.stop()
        thread.join(10.0)


def call(address, method, path, body=None, **headers):
    """Status, headers and text of an answer."""
    where = urlsplit(address)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=60)
    sent = {"Origin": f"http://{where.netloc}"} if method == "POST" else {}
    connection.request(method, path, body, {**sent, **{k.replace("_", "-"): v for k, v in headers.items()}})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, dict(answer.getheaders()), text


def flight(path, test, steps=None):
    """The log of a test, as a rig would have written it."""
    run = PLANT.run(test)
    n = run.steps if steps is None else steps
    columns = {"t": run.t[: n + 1], "angle": run.states[: n + 1, 0], "rate": run.states[: n + 1, 1]}
    write_columns(path, {**columns, "torque": run.commands[:n, 0]})
    return path.read_bytes()


def look(store, name="campaign"):
    return tl.Campaign.load(store, name, read_only=True)

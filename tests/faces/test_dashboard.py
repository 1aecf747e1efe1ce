"""The dashboard as people and strangers meet it: over HTTP, and in a browser."""

import contextlib
import dataclasses
import json
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from urllib.parse import urlsplit

import numpy as np
import pytest

import twinloop as tl
from command import hearing_ctrl_c, invoke
from conftest import PENDULUM_GAINS
from dashboards import begun, call, flight, look, served
from lives import OTHER_GAINS, PLANT, by_hand, stored

pytest.importorskip("starlette", reason="twinloop[dashboard] is not installed")
pytest.importorskip("uvicorn", reason="twinloop[dashboard] is not installed")

from twinloop.campaign.assessment import Advice
from twinloop.campaign.examination.check import Checks
from twinloop.campaign.identify_and_plan.learning import Learner
from twinloop.faces.dashboard import app, desk
from twinloop.faces.dashboard.command import prepared
from twinloop.logs import write_columns

HOSTILE = "<script>alert(1)</script> & ../../etc"


@pytest.fixture
def store(tmp_path):
    return begun(tmp_path / "hover.db")


def test_a_test_is_approved_told_and_the_next_one_planned(store, tmp_path):
    with served(store) as address:
        shown = json.loads(call(address, "GET", "/c/1/tests")[2])
        assert [test["number"] for test in shown["tests"]] == [1] and shown["tests"][0]["approved"] is None
        assert call(address, "POST", "/c/1/tests/1/approve")[0] == 200
        assert json.loads(call(address, "GET", "/c/1/tests")[2])["tests"][0]["approved"]
        sheet = call(address, "GET", "/c/1/tests/1/sheet")[2]
        assert "TEST 1" in sheet and "angle.kp" in sheet
        columns = call(address, "GET", "/c/1/tests/1/columns.csv")[2]
        assert columns.startswith("t,") and "predicted_angle" in columns
        log = flight(tmp_path / "flight.csv", look(store).tests[1])
        status, _, said = call(address, "POST", "/c/1/tests/1/log?file=flight.csv", log)
        assert status == 200 and "2 experiments" in said
        assert call(address, "POST", "/c/1/ask", "{}")[0] == 202
        for _ in range(300):
            state = json.loads(call(address, "GET", "/c/1/state")[2])
            if state["working"] is None:
                break
            time.sleep(0.1)
        assert state["failed"] is None
    campaign = look(store)
    assert [test.number for test in campaign.waiting] == [2]
    np.testing.assert_array_equal(
        campaign.experiments[1].trajectory.states, PLANT.run(campaign.tests[1]).states
    )


def test_a_card_and_its_sheet_say_that_the_advice_is_to_stop(store, monkeypatch):
    def shown():
        with served(store) as address:
            (card,) = json.loads(call(address, "GET", "/c/1/tests")[2])["tests"]
            return card["advice"], call(address, "GET", "/c/1/tests/1/sheet")[2]

    monkeypatch.setattr(tl.Campaign, "advice", Advice(1, True, 1e-2, 1e-3, 1e-3, False))
    card, sheet = shown()
    assert card == "" and "The advice" not in sheet
    monkeypatch.setattr(tl.Campaign, "advice", Advice(1, True, 1e-5, 1e-3, 1e-3, True))
    best = dataclasses.replace(look(store).best_test, measured=0.1)
    monkeypatch.setattr(tl.Campaign, "best_test", best)
    card, sheet = shown()
    assert not tl.Campaign.load(store, read_only=True).checks().passed
    assert card == "" and "The advice" not in sheet, (
        "as the report on the same page, which finds checks that fail"
    )
    monkeypatch.setattr(tl.Campaign, "checks", lambda campaign: Checks())
    card, sheet = shown()
    assert card.startswith("The advice is to stop: ") and f"\n{card}\n" in sheet


def test_a_card_has_the_ends_of_a_target_that_varies_with_time(tmp_path):
    path = tmp_path / "arm.db"
    campaign = stored(path, "default", target_state=lambda t: [0.5 + 0.5 * t, 0.0])
    campaign.test(OTHER_GAINS)
    campaign.close()
    with served(path) as address:
        (card,) = json.loads(call(address, "GET", "/c/1/tests")[2])["tests"]
    assert [row[:3] for row in card["ends"]] == [
        ["state", "start", "target"],
        ["angle (rad)", "0", "0.5 to 1"],
        ["rate (rad/s)", "0", "0"],
    ]


def test_a_card_says_that_a_target_varies_that_ends_where_it_began(tmp_path):
    path = tmp_path / "arm.db"
    campaign = stored(path, "default", target_state=lambda t: [0.75 if 0.2 < t < 0.7 else 0.5, 0.0])
    campaign.test(OTHER_GAINS)
    campaign.close()
    with served(path) as address:
        (card,) = json.loads(call(address, "GET", "/c/1/tests")[2])["tests"]
        sheet = call(address, "GET", "/c/1/tests/0/sheet")[2]
        columns = call(address, "GET", "/c/1/tests/0/columns.csv")[2].splitlines()
    assert [row[2] for row in card["ends"]] == ["target", "0.5", "0"]
    said = "The target varies with time: arm-test-0.csv has a row of it a period (target_angle)."
    assert card["varies"] == said and f"\n{said}\n" in sheet
    assert "target_angle" in columns[0].split(",")


@pytest.mark.parametrize("before", ["nothing", "a log", "a flight", "a failure"])
def test_of_the_risk_of_a_test_of_ones_own_it_is_said_why_it_is_unknown(tmp_path, before):
    path = tmp_path / "arm.db"
    campaign = stored(path, "default")
    if before == "a flight":
        test = campaign.test(PENDULUM_GAINS)
        campaign.tell(test, PLANT.run(test))
    elif before == "a log":
        campaign.attach(by_hand(30))
    elif before == "a failure":
        campaign.tell_failed(campaign.test(PENDULUM_GAINS), "motor")
    own = campaign.test(OTHER_GAINS)
    campaign.close()
    with served(path) as address:
        (card,) = json.loads(call(address, "GET", "/c/1/tests")[2])["tests"]
        sheet = call(address, "GET", f"/c/1/tests/{own.number}/sheet")[2]
    first = card["risk_unknown"].startswith("not estimated before the first flight. It is the risk of")
    later = card["risk_unknown"].startswith(
        "not estimated: this test is your own, and no committee has judged it. It "
    )
    assert (first, later) == ((True, False) if before in ("nothing", "a log") else (False, True))
    assert f"Risk of leaving the envelope: {card['risk_unknown']}\n" in sheet


def test_what_went_wrong_is_told(store, tmp_path):
    with served(store) as address:
        log = flight(tmp_path / "flight.csv", look(store).tests[1], steps=10)
        status, _, said = call(address, "POST", "/c/1/tests/1/log?file=flight.csv", log)
        assert status == 422 and "found 10" in said
        status, _, _ = call(address, "POST", "/c/1/tests/1/log?file=a.csv&reason=wind", log)
        assert status == 200
        assert look(store).experiments[1].trajectory.reason == "wind"
        told, other = (flight(tmp_path / "other.csv", look(store).tests[i]) for i in (0, 1))
        status, _, said = call(address, "POST", "/c/1/log?file=x.csv", told)
        assert status == 422 and "recorded already" in said
        assert call(address, "POST", "/c/1/log?file=x.csv", other)[0] == 200
    with served(store) as address:
        other = tl.Campaign.load(store, threads=1)
        asked = other.ask()
        assert call(address, "POST", f"/c/1/tests/{asked.number}/abandon", "{}")[0] == 409  # a second writer
        other.close()
        words = json.dumps({"reason": "the motor cut out"})
        assert call(address, "POST", f"/c/1/tests/{asked.number}/failed", words)[0] == 200
    assert [failure.reason for failure in look(store).failures] == ["the motor cut out"]


def test_what_speaks_against_a_flight_is_said_as_the_commands_say_it(store, tmp_path):
    """The torque of test 1 with its sign exchanged is none that its controller gives; a part counts twice."""
    test = look(store).tests[1]
    flew = PLANT.run(test)
    columns = {
        "t": flew.t,
        "angle": flew.states[:, 0],
        "rate": flew.states[:, 1],
        "torque": -flew.commands[:, 0],
    }
    write_columns(tmp_path / "flight.csv", columns)
    copy = tmp_path / "copy.db"
    shutil.copy(store, copy)
    part = flight(tmp_path / "part.csv", look(store).tests[0], steps=10)
    with served(store) as address:
        flown = (tmp_path / "flight.csv").read_bytes()
        status, _, told = call(address, "POST", "/c/1/tests/1/log?file=flight.csv", flown)
        assert status == 200
        status, _, attached = call(address, "POST", "/c/1/log?file=part.csv", part)
        assert status == 200
    for answer, typed, sentence in (
        (told, ("tell", str(copy), "1", str(tmp_path / "flight.csv")), "none that its controller gives"),
        (attached, ("attach", str(copy), str(tmp_path / "part.csv")), "so that they count twice"),
    ):
        lines = json.loads(answer)["said"].splitlines()[1:]
        printed = invoke(*typed).stderr.replace("copy.db", "hover.db").splitlines()
        assert lines == [line for line in printed if line.startswith("Against this flight: ")]
        assert any(sentence in line for line in lines)


def test_of_several_campaigns_a_card_its_sheet_and_its_file_are_those_of_one(store, tmp_path):
    """The second campaign of the store, flown in part: its sheet is the one that `ask` prints."""
    second = stored(store, "default", name="my arm", seed=1)
    first = second.test(OTHER_GAINS)
    second.tell(first, PLANT.run(first))
    asked = second.ask()
    second.close()
    part = flight(tmp_path / "part.csv", first, steps=15)
    with served(store) as address:
        (card,) = json.loads(call(address, "GET", "/c/2/tests")[2])["tests"]
        sheet = call(address, "GET", "/c/2/tests/1/sheet")[2]
        _, headers, columns = call(address, "GET", "/c/2/tests/1/columns.csv")
        printed = invoke("ask", str(store), "--name", "my arm").stdout
        said = json.loads(call(address, "POST", "/c/2/log?file=part.csv", part)[2])["said"]
    assert sheet == printed.replace(f"{store.parent}/", "")
    assert sheet.endswith("  twinloop tell hover.db 1 FLIGHT.csv --name 'my arm'\n")
    assert said.endswith(f"twinloop withdraw {store} LOG --reason WHY --name 'my arm'")
    (file,) = store.parent.glob("hover-test-1-of-my-arm-*.csv")
    assert f"a row a period in {file.name}," in card["excitation"] and asked.excitation is not None
    assert file.name in headers["content-disposition"] and columns == file.read_text(encoding="utf-8")


def test_a_log_that_was_told_is_not_told_twice(store, tmp_path):
    """The second test asks for other gains than the first: the same digits can only be the same file."""
    told = flight(tmp_path / "flight.csv", look(store).tests[0])
    with served(store) as address:
        status, _, said = call(address, "POST", "/c/1/tests/1/log?file=flight.csv", told)
    assert status == 422 and "Log flight.csv: expected a new flight" in json.loads(said)["failed"]
    assert len(look(store).experiments) == 1


def test_a_flight_that_was_recorded_by_mistake_is_withdrawn_and_its_test_waits_again(store, tmp_path):
    wrong = json.dumps({"reason": "degrees, not radians"})
    other = flight(tmp_path / "other.csv", look(store).tests[1])
    with served(store) as address:
        assert call(address, "POST", "/c/1/log?file=other.csv", other)[0] == 200
        shown = json.loads(call(address, "GET", "/c/1/tests")[2])["recorded"]
        assert [each["which"] for each in shown] == ["0", "attached-1"]
        assert [each["words"] for each in shown] == [
            "the flight of test 0",
            "attached flight 1 (other.csv, 20 steps)",
        ]
        status, _, said = call(address, "POST", "/c/1/flights/attached-1/withdraw", wrong)
        assert status == 200 and "attached flight 1 (other.csv, 20 steps). 1 experiment left." in said
        status, _, said = call(address, "POST", "/c/1/flights/0/withdraw", wrong)
        assert status == 200 and "Test 1 abandoned: planned with it." in said
        shown = json.loads(call(address, "GET", "/c/1/tests")[2])
        assert [test["number"] for test in shown["tests"]] == [0] and shown["recorded"] == []
        # What waits again may be approved and told again, also the test that nobody asked for.
        assert call(address, "POST", "/c/1/tests/0/approve")[0] == 200
        right = flight(tmp_path / "right.csv", look(store).tests[0])
        assert call(address, "POST", "/c/1/tests/0/log?file=right.csv", right)[0] == 200
    campaign = look(store)
    assert [(each.test, each.reason) for each in campaign.withdrawals] == [
        (None, "degrees, not radians"),
        (0, "degrees, not radians"),
    ]
    assert [campaign.status(test) for test in campaign.tests] == ["flown", "abandoned"]


@pytest.mark.parametrize(
    ("which", "word"),
    [("7", "expected a recorded flight, 0, found 7"), ("attached-1", "found attached-1"), ("1", "found 1"),
     ("other.csv", "found other.csv"), ("..%2Fother.csv", "Not Found")],
)  # fmt: skip
def test_only_a_recorded_flight_is_withdrawn_and_no_file_is_read(store, tmp_path, monkeypatch, which, word):
    monkeypatch.chdir(tmp_path)
    flight(tmp_path / "other.csv", look(store).tests[0])
    with served(store) as address:
        status, _, said = call(address, "POST", f"/c/1/flights/{which}/withdraw", json.dumps({"reason": "x"}))
        assert status in (404, 422) and word in said
        status, _, said = call(address, "POST", "/c/1/flights/0/withdraw", json.dumps({"reason": " "}))
        assert status == 422 and "say why" in said
        elsewhere = {"Origin": "http://evil.example"}
        assert (
            call(address, "POST", "/c/1/flights/0/withdraw", json.dumps({"reason": "x"}), **elsewhere)[0]
            == 403
        )
    assert look(store).withdrawals == ()


@pytest.mark.parametrize("path", ["/c/1/tests/1/log", "/c/1/log"])
@pytest.mark.parametrize("body", [b"no columns", b"t,angle,rate,torque\n0,0,0,0\n.05,x,0,0\n", b"\xff"])
def test_messages_call_a_log_as_it_was_called_where_it_came_from(store, path, body):
    with served(store) as address:
        said = call(address, "POST", f"{path}?file=C:%5Clogs%5Cgust%0A7.csv", body)[2]
    assert "gust7.csv" in said and "/" not in json.loads(said)["failed"] and "C:" not in said


@pytest.mark.parametrize(
    ("path", "body", "word"),
    [
        ("/c/1/tests/1/log?file=flight.csv", b"no columns", "column"),
        ("/c/1/tests/1/log?file=flight.exe", b"", "csv"),
        ("/c/1/tests/1/log?file=../../../etc/passwd", b"", "csv"),
        ("/c/1/tests/1/log?file=a.npz", b"\x80\x04pickle", "NumPy"),
        ("/c/1/tests/99/log?file=a.csv", b"t,angle,rate,torque\n0,0,0,0\n.05,0,0,0\n", "0 to 1"),
        ("/c/1/tests/1/failed", b"{}", "say why"),
        ("/c/1/tests/1/failed", b"[1", "JSON"),
        ("/c/1/tests/0/approve", b"", "waits"),
        ("/c/7/tests/1/approve", b"", "expected 1, the only one of this store, found 7"),
        ("/c/..%2F..%2Fetc/tests/1/approve", b"", "Not Found"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_changes_nothing(store, path, body, word):
    with served(store) as address:
        before = call(address, "GET", "/c/1/state")[2]
        status, _, said = call(address, "POST", path, body)
        assert status in (404, 422) and word in said and "Traceback" not in said
        assert call(address, "GET", "/c/1/state")[2] == before


def test_an_upload_without_end_is_cut_off(store, monkeypatch):
    monkeypatch.setattr(app, "MOST_BYTES", 100_000)
    with served(store) as address:
        with contextlib.suppress(ConnectionError, BrokenPipeError):
            status, _, said = call(address, "POST", "/c/1/log?file=a.csv", bytes(5_000_000))
            assert status == 422 and "at most" in said
        assert call(address, "GET", "/c/1/state")[0] == 200


def test_pages_elsewhere_and_other_names_are_refused(store):
    with served(store) as address:
        before = call(address, "GET", "/c/1/state")[2]
        for headers in (
            {"Origin": "http://evil.example"},
            {"Origin": "null"},
            {"Sec_Fetch_Site": "cross-site"},
            {"Origin": "http://127.0.0.1:1"},
        ):
            assert call(address, "POST", "/c/1/tests/1/abandon", "{}", **headers)[0] == 403
        assert call(address, "GET", "/", Host="evil.example")[0] == 421
        assert call(address, "GET", "/c/1/state", Host="127.0.0.1.evil.example:80")[0] == 421
        assert call(address, "GET", "/c/1/state")[2] == before
        _, headers, _ = call(address, "GET", "/c/1")
        assert "default-src 'self'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff" and "access-control-allow-origin" not in headers


def test_others_need_the_token(store):
    with served(store, token="a-secret-that-is-long") as address:
        assert address.endswith("?token=a-secret-that-is-long")
        assert call(address, "GET", "/c/1")[0] == 401
        assert call(address, "GET", "/c/1?token=another")[0] == 401
        assert call(address, "POST", "/c/1/tests/1/approve", "{}")[0] == 401
        status, headers, _ = call(address, "GET", "/c/1?token=a-secret-that-is-long")
        cookie = headers["set-cookie"]
        assert status == 200 and "HttpOnly" in cookie and "SameSite=Strict" in cookie
        known = cookie.partition(";")[0]
        assert call(address, "GET", "/c/1/state", Cookie=known)[0] == 200
        assert call(address, "POST", "/c/1/tests/1/approve", "{}", Cookie=known)[0] == 200


def test_a_host_that_others_see_gets_a_token_of_its_own(store):
    server, address = prepared(str(store), 0, host="0.0.0.0")
    server.socket.close()
    assert len(urlsplit(address).query) > 30
    with pytest.raises(tl.InvalidInput, match="16 characters"):
        prepared(str(store), 0, token="short")


def test_a_machine_whose_name_does_not_resolve_is_served_all_the_same(store, monkeypatch):
    def unknown(name):
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "gethostbyname_ex", unknown)
    with served(store, host="0.0.0.0") as address:
        assert urlsplit(address).hostname == "127.0.0.1"
        assert call(address, "GET", f"/c/1?{urlsplit(address).query}")[0] == 200


def test_a_machine_answers_under_the_address_at_which_it_is_reached_and_no_other(store, monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "rig-pc")
    monkeypatch.setattr(socket, "gethostbyname_ex", lambda name: (name, [], ["127.0.1.1"]))
    with served(store, host="0.0.0.0") as address:
        here = urlsplit(address)
        assert here.hostname == "rig-pc"
        # All of 127/8 is this machine: an address that nobody has told of, as that of a network is.
        reached = f"http://127.0.0.77:{here.port}/"
        path = f"/c/1?{here.query}"
        assert call(reached, "GET", path)[0] == 200
        assert call(reached, "GET", path, Host=f"rig-pc:{here.port}")[0] == 200
        for other in ("127.0.0.78", "192.168.1.5", "evil.example", "127.0.0.77.evil.example", "[127.0.0.77]"):
            assert call(reached, "GET", path, Host=f"{other}:{here.port}")[0] == 421


def test_a_store_that_is_none_and_a_port_that_is_taken_are_refused(store, tmp_path):
    with pytest.raises(tl.InvalidInput):
        prepared(str(tmp_path / "none.db"), 0)
    with served(store) as address, pytest.raises(tl.InvalidInput, match="free port"):
        prepared(str(store), urlsplit(address).port)


def test_ctrl_c_ends_it_without_a_word(store):
    """It is the way to end it, and no failure."""
    process = subprocess.Popen(
        [sys.executable, "-m", "twinloop", "dashboard", str(store), "--port", "0"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=hearing_ctrl_c,
    )  # fmt: skip
    address = process.stdout.readline().split()[1]
    for _ in range(200):
        with contextlib.suppress(ConnectionError):
            assert call(address, "GET", "/c/1")[0] == 200
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=30)[1] == "" and process.returncode == 0


def test_names_of_strangers_stay_text(tmp_path):
    path = tmp_path / "many.db"
    for name in (HOSTILE, "other"):
        campaign = stored(path, name=name)
        campaign.test(PENDULUM_GAINS)
        campaign.close()
    with served(path) as address:
        page = call(address, "GET", "/")[2]
        assert "<script>alert" not in page and "&lt;script&gt;" in page
        assert "None yet" not in page and page.count("<li>") == 2
        assert "<script>alert" not in call(address, "GET", "/c/1")[2]
        assert call(address, "GET", "/c/1/tests/0/sheet")[0] == 200


def test_the_first_test_of_a_campaign_may_be_approved(tmp_path):
    campaign = stored(tmp_path / "new.db", preset="default")
    campaign.test(PENDULUM_GAINS)
    campaign.close()
    with served(tmp_path / "new.db") as address:
        assert call(address, "POST", "/c/1/tests/0/approve")[0] == 200
        (test,) = json.loads(call(address, "GET", "/c/1/tests")[2])["tests"]
        assert test["number"] == 0 and test["approved"]


def test_only_one_long_thing_goes_on_at_a_time(store, monkeypatch):
    table = desk.Desk(str(store), threads=1)
    held = threading.Event()
    monkeypatch.setattr(tl.Campaign, "ask", lambda *_, **__: held.wait(10.0))
    table.ask("campaign", False)
    with pytest.raises(tl.InvalidInput, match="no other task"):
        table.ask("campaign", False)
    with pytest.raises(tl.InvalidInput, match="no other task"):
        table.abandon("campaign", 1)
    held.set()
    for _ in range(100):
        if table.state("campaign")["working"] is None:
            break
        time.sleep(0.05)
    table.abandon("campaign", 1)


def test_the_pages_of_a_server_are_headed_without_its_password(monkeypatch):
    monkeypatch.setattr(desk, "opened", lambda _: contextlib.ExitStack())  # something to be closed
    assert desk.Desk("postgresql://me:s3cret@h").title == "postgresql://me:***@h"


@pytest.fixture
def unlearnt(tmp_path):
    """A store with a flight that was told, another test that waits, and nothing learnt."""
    campaign = stored(tmp_path / "rig.db", preset="default")
    test = campaign.test(PENDULUM_GAINS)
    campaign.tell(test, PLANT.run(test))
    campaign.test(PENDULUM_GAINS)
    campaign.close()
    return tmp_path / "rig.db"


def test_looking_learns_nothing_and_says_what_is_not_learnt_yet(unlearnt, monkeypatch):
    monkeypatch.setattr(Learner, "learnt", lambda *_, **__: pytest.fail("learnt"))
    said = "Not learnt yet: 1 experiment; to learn now, plan the next test."
    with served(unlearnt) as address:
        status, _, report = call(address, "GET", "/c/1/report")
        assert status == 200 and said in report and "Traceback" not in report
        assert json.loads(call(address, "GET", "/c/1/tests")[2])["unlearnt"] == said
        assert "TEST 1" in call(address, "GET", "/c/1/tests/1/sheet")[2]
        columns = call(address, "GET", "/c/1/tests/1/columns.csv")[2]
        assert columns.startswith("t,") and "predicted" not in columns


def test_the_report_of_what_was_learnt_stays_while_a_later_flight_is_not(store, tmp_path, monkeypatch):
    log = flight(tmp_path / "flight.csv", look(store).tests[1])
    with served(store) as address:
        assert json.loads(call(address, "GET", "/c/1/tests")[2])["unlearnt"] == ""
        assert call(address, "POST", "/c/1/tests/1/log?file=flight.csv", log)[0] == 200
        monkeypatch.setattr(Learner, "learnt", lambda *_, **__: pytest.fail("learnt"))
        assert "1 experiment;" in json.loads(call(address, "GET", "/c/1/tests")[2])["unlearnt"]
        assert "<html" in call(address, "GET", "/c/1/report")[2]


def test_who_asks_for_a_report_at_the_same_time_waits_for_the_same_page(store, monkeypatch):
    made = []

    def page(found):
        made.append(found.campaign.threads)
        time.sleep(0.3)
        return "the page"

    monkeypatch.setattr(app, "source_page", page)
    with served(store) as address:
        asking = [threading.Thread(target=call, args=(address, "GET", "/c/1/report")) for _ in range(3)]
        for each in asking:
            each.start()
        for each in asking:
            each.join()
        assert call(address, "GET", "/c/1/report")[2] == "the page"
    assert made == [1]  # once, with as many threads as the dashboard was given

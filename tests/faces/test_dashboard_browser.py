"""The dashboard in a browser, as people use it: they drop logs on it, approve, and watch what others do."""

import contextlib
import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="twinloop[dashboard] is not installed")
pytest.importorskip("uvicorn", reason="twinloop[dashboard] is not installed")

import twinloop as tl
from browser import SIZES, browser, kept, serious
from conftest import PENDULUM_GAINS
from dashboards import begun, flight, look, served
from lives import SIGNALS, stored
from twinloop.faces.about_test import excitation_words, hold_back_words, reason, unknown_risk

ENVELOPES = ((-2.0, 2.0), (-20.0, 20.0))
BOUNDED = tl.Signals(
    states=[
        dataclasses.replace(state, envelope=envelope)
        for state, envelope in zip(SIGNALS.states, ENVELOPES, strict=True)
    ],
    commands=SIGNALS.commands,
    dt=SIGNALS.dt,
)

RUN = """
import sys, time
sys.path.insert(0, sys.argv[1])
import twinloop as tl
from lives import PLANT, SIGNALS

class Slow:
    signals = SIGNALS
    def run(self, test):
        time.sleep(3.0)  # a flight takes its time
        return PLANT.run(test)

campaign = tl.Campaign.load(sys.argv[2], threads=1)
campaign.run(Slow(), 3)
"""
"""What another process does with a store while somebody looks at it."""


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@contextlib.contextmanager
def shown(chromium, address, size="desktop"):
    """A page, with what its console said."""
    width, height, scheme = SIZES[size]
    context = chromium.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page, said = context.new_page(), []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(address)
    try:
        yield page, said
    finally:
        context.close()


def dropped(page, zone, path):
    """Drops a file on a place of the page, as a hand with a mouse does."""
    make = """([name, text]) => {
        const held = new DataTransfer();
        held.items.add(new File([text], name, { type: "text/csv" }));
        return held;
    }"""
    held = page.evaluate_handle(make, [path.name, path.read_text()])
    page.locator(zone).dispatch_event("dragover", {"dataTransfer": held})
    page.locator(zone).dispatch_event("drop", {"dataTransfer": held})


@pytest.mark.parametrize("size", ["desktop", "phone", "dark"])
def test_a_log_is_dropped_and_the_page_follows(chromium, tmp_path, size):
    store = begun(tmp_path / "hover.db")
    with served(store) as address, shown(chromium, address, size) as (page, said):
        page.get_by_role("heading", name="Test 1").wait_for()
        page.get_by_role("button", name="Approve").click()
        page.get_by_text("Approved 20").wait_for()
        page.frame_locator("#report").locator("svg.plot").first.wait_for()
        page.wait_for_timeout(300)
        kept(page, f"dashboard-{size}")
        assert serious(page) == []
        bad = tmp_path / "bad.csv"
        bad.write_text("a,b\n1,2\n")
        dropped(page, ".test .drop", bad)
        page.get_by_role("alert").get_by_text("column").wait_for()
        flight(tmp_path / "flight.csv", look(store).tests[1])
        dropped(page, ".test .drop", tmp_path / "flight.csv")
        page.get_by_text("2 experiments are stored").wait_for()
        page.get_by_text("No test is waiting").wait_for(timeout=30_000)
        page.get_by_role("button", name="Plan the next test").click()
        page.get_by_role("heading", name="Test 2").wait_for(timeout=60_000)
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]
        # A refused upload is an answer that the browser reports by itself.
        assert [text for text in said if "422" not in text] == []
    assert len(look(store).experiments) == 2


@pytest.mark.parametrize("size", ["desktop", "phone"])
def test_the_first_test_says_before_it_is_approved_what_is_flown_and_what_it_risks(chromium, tmp_path, size):
    campaign = stored(tmp_path / "first.db", preset="default", signals=BOUNDED)
    first = campaign.test(PENDULUM_GAINS)
    campaign.close()
    with served(tmp_path / "first.db") as address, shown(chromium, address, size) as (page, said):
        page.get_by_role("heading", name="Test 0").wait_for()
        card = " ".join(page.locator("article.test").inner_text().split())
        before = card[: card.index("Approve")]
        assert reason(first, flown=False) in before
        assert "state start target inner range outer range angle (rad) 0 1 " in before
        assert excitation_words(first, "first-test-0.csv") in before and "% of a command's range" in before
        assert hold_back_words(first) and hold_back_words(first) in before
        assert f"Risk of leaving the envelope: {unknown_risk(first, flown=False)}" in before
        kept(page, f"dashboard-first-{size}")
        assert serious(page) == [] and said == []
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]


def test_what_is_said_while_a_test_is_planned_goes_once_it_is_planned(chromium, tmp_path):
    store = begun(tmp_path / "hover.db")
    with served(store) as address, shown(chromium, address) as (page, _):
        page.get_by_role("heading", name="Test 1").wait_for()
        page.get_by_role("button", name="Plan the next test").click()
        page.get_by_text("Learning, and planning the next test.").wait_for()
        page.get_by_role("heading", name="Test 2").wait_for(timeout=60_000)
        page.get_by_text("Up to date.").wait_for()
        assert page.locator("#said").inner_text() == ""


def test_a_log_that_is_chosen_is_told_too(chromium, tmp_path):
    store = begun(tmp_path / "hover.db")
    flight(tmp_path / "flight.csv", look(store).tests[1])
    with served(store) as address, shown(chromium, address) as (page, said):
        page.locator(".test input[type=file]").set_input_files(tmp_path / "flight.csv")
        page.get_by_text("2 experiments are stored").wait_for()
        assert said == []


@pytest.mark.parametrize("size", ["desktop", "phone"])
def test_a_flight_is_withdrawn_once_that_is_confirmed_and_said_why(chromium, tmp_path, size):
    store = begun(tmp_path / "hover.db")
    with served(store) as address, shown(chromium, address, size) as (page, said):
        asked, answers = [], iter([False, True])

        def answer(dialog):
            asked.append(dialog.message)
            dialog.accept() if next(answers) else dialog.dismiss()

        page.on("dialog", answer)
        page.get_by_text("Withdraw a flight that was recorded by mistake").click()
        button = page.get_by_role("button", name="Withdraw")
        page.get_by_role("combobox", name="Flight").select_option("the flight of test 0")
        button.click()
        page.get_by_role("alert").get_by_text("say why").wait_for()
        assert asked == [] and serious(page) == []
        kept(page, f"dashboard-withdrawing-{size}")
        page.get_by_label("What was wrong with it").fill("columns exchanged")
        button.click()
        page.wait_for_timeout(300)
        assert (
            len(asked) == 1 and "Withdraw the flight of test 0?" in asked[0] and look(store).withdrawals == ()
        )
        button.click()
        page.get_by_role("alert").get_by_text(
            "Withdrawn: the flight of test 0. 0 experiments left."
        ).wait_for()
        page.get_by_role("heading", name="Test 0").wait_for()
        page.get_by_text("Withdraw a flight that was recorded by mistake").wait_for(state="hidden")
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]
        assert [text for text in said if "422" not in text] == []
    (withdrawn,) = look(store).withdrawals
    assert (withdrawn.test, withdrawn.reason) == (0, "columns exchanged")


def test_a_campaign_that_another_process_runs_is_seen_to_work_and_grow(chromium, tmp_path):
    """Nobody touches the page: it says what is being done, then shows what came of it."""
    store = begun(tmp_path / "hover.db")
    with served(store) as address, shown(chromium, address) as (page, said):
        report = page.frame_locator("#report")
        report.get_by_text("1 experiment on").wait_for()
        tests = str(Path(__file__).parents[1])
        with subprocess.Popen([sys.executable, "-c", RUN, tests, str(store)]) as other:
            status = page.get_by_role("status")
            status.get_by_text("Working: flying experiment 2 of 3").wait_for(timeout=60_000)
            kept(page, "dashboard-watching")
            assert page.get_by_role("button", name="Plan the next test").is_disabled()
            report.get_by_text("2 experiments on").wait_for(timeout=60_000)
            report.get_by_text("3 experiments on").wait_for(timeout=60_000)
            status.get_by_text("Up to date").wait_for(timeout=60_000)
            assert other.wait(60) == 0
        assert page.get_by_role("button", name="Plan the next test").is_enabled()
        assert said == []


def test_html_in_the_columns_of_a_log_stays_text(chromium, tmp_path):
    store, bad = begun(tmp_path / "hover.db"), tmp_path / "bad.csv"
    with served(store) as address, shown(chromium, address) as (page, said):
        asked = []
        page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
        page.get_by_role("heading", name="Test 1").wait_for()
        bad.write_text("t,<img src=x onerror=alert(1)>angle,rate,torque\n0,0,0,0\n0.05,0,0,0\n")
        dropped(page, ".test .drop", bad)
        page.get_by_role("alert").get_by_text("<img src=x onerror=alert(1)>angle").wait_for()
        assert page.locator("#said img").count() == 0 and asked == []
        assert [text for text in said if "422" not in text] == []

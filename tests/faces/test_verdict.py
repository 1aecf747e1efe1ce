"""The verdict: one, whoever shows it; and a terminal does not say otherwise than the report of the same campaign."""

import html
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

import lives
import twinloop as tl
from conftest import pendulum_step
from twinloop.campaign.examination import checking
from twinloop.campaign.examination.examination import Examination
from twinloop.faces.answers import FLY_ANOTHER
from twinloop.faces.cli import main
from twinloop.faces.report.page import report_page
from twinloop.faces.result import summary
from twinloop.faces.text import render
from twinloop.faces.verdict import of_next, verdict

pytest.importorskip("jinja2", reason="twinloop[report] is not installed")


@pytest.fixture(scope="module")
def hasty():
    """A campaign whose advice is to stop, with a controller that bears less than a period of delay."""
    campaign = lives.learnt(pendulum_step, 4)
    assert campaign.advice.stop and [check.name for check in campaign.checks().failed] == ["delay"]
    return campaign


@pytest.fixture
def good(hasty, monkeypatch):
    """The same where half a period would do, so that all checks hold."""
    monkeypatch.setattr(checking, "PERIODS", 0.5)
    assert hasty.checks().passed
    return hasty


def on_page(campaign):
    """The answers of the report's page, as a person reads them."""
    text = report_page(campaign, "p", {"name": "p"}, {})
    return [html.unescape(said) for said in re.findall(r'class="answer"><span[^>]*>.</span> ([^<]*)<', text)]


def in_terminal(campaign):
    """The lines of the terminal's verdict, without their subject."""
    return [line.partition(": ")[2] for line in str(campaign).split("\n\n")[1].splitlines()]


def same(page, terminal):
    return all(
        said.startswith(answer[:1].lower() + answer[1:]) for answer, said in zip(page, terminal, strict=True)
    )


def test_where_all_is_well_report_and_terminal_say_so(good):
    page, (twin, controller, following) = on_page(good), in_terminal(good)
    assert page[0] == "Trust it within the flown range" and page[2] == "Stop"
    assert same(page[:2], [twin, controller]) and "normalised error of 4 flights at most" in twin
    assert "stop; another flight would bring less" in following and "All checks" not in str(good)


def test_a_twin_that_the_report_does_not_trust_is_not_advised_on_in_a_terminal(good, monkeypatch):
    monkeypatch.setattr(checking, "INSIDE", 1.01)
    page, terminal = on_page(good), in_terminal(good)
    assert page == ["Do not trust it", "Not on this twin's prediction", "Find out what the twin lacks"]
    assert same(page, terminal)
    (band,) = good.checks().failed
    assert terminal[0] == f"do not trust it. {band.sentence} All checks: print(campaign.checks())"
    text = str(good)
    assert text.count("All checks:") == 1 and "normalised error of" not in text
    assert not re.search(r"\bstop\b", text.split("FLIGHTS")[0] + text.split("CONTROLLER")[1])
    assert "not to be trusted yet, so it cannot say" in " ".join(text.split("ANOTHER EXPERIMENT?")[1].split())


@pytest.mark.parametrize(
    ("misses", "words"),
    [
        ((0.3, -1.9, 2.1), "Of the 3 qualities that it predicted, 2 came within 2 of their spreads."),
        ((0.3,), "The only quality that it predicted came within 2 of its spreads."),
        ((np.inf,), "The only quality that it predicted did not come within 2 of its spreads."),
    ],
)
def test_of_a_twin_that_fails_it_is_said_what_it_foretold(good, monkeypatch, misses, words):
    monkeypatch.setattr(checking, "INSIDE", 1.01)
    monkeypatch.setattr(Examination, "quality_misses", property(lambda found: misses))
    found = good.examine()
    (twin, *_) = verdict(found, good.checks(), summary(good, {"name": "p"}, {}))
    assert not twin.good and twin.text.endswith(words)


def test_a_controller_that_is_refused_is_not_one_to_fly_in_a_terminal(hasty):
    page, terminal = on_page(hasty), in_terminal(hasty)
    assert page == ["Trust it within the flown range", "Do not fly it", "Ask for a calmer controller"]
    assert same(page, terminal) and not hasty.certificate().granted
    (delay,) = hasty.checks().failed
    assert delay.sentence in terminal[1] and terminal[1].endswith(" All checks: print(campaign.checks())")
    text = str(hasty)
    assert "CONTROLLER, NOT TO BE FLOWN: " in text and "CONTROLLER TO FLY" not in text
    assert "For the controller, stop" not in text and "ask for a calmer one" in text


def test_the_strongest_reason_is_a_serious_remark_for_it_says_what_to_do():
    campaign = lives.learnt(lives.with_end_stop, 2)
    reasons = summary(campaign, {"name": "p"}, {})["verdict"]["twin"]["reasons"]
    grave = [remark.sentence for remark in campaign.twin.remarks if remark.serious]
    failed = [each.sentence for each in campaign.checks().failed if each.subject == "twin"]
    assert grave and reasons[: len(grave)] == grave
    assert reasons[len(grave) :] == [each for each in failed if each != " ".join(grave)]


def test_json_has_the_verdict_and_show_names_the_command_that_has_the_rest(good, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(checking, "INSIDE", 1.01)
    tl.Campaign.from_record(good.to_record()).save("rig.db")
    shown = CliRunner().invoke(main, ["show", "rig.db"])
    assert shown.exit_code == 0 and " All checks: twinloop report rig.db\n" in shown.stdout
    known = json.loads(CliRunner().invoke(main, ["show", "rig.db", "--json"]).stdout)["result"]["verdict"]
    band = next(check for check in good.checks() if check.name == "band")
    assert known["twin"] == {"answer": "Do not trust it", "good": False, "reasons": [band.sentence]}
    assert known["controller"]["answer"] == "Not on this twin's prediction"
    assert known["next"] == {"answer": "Find out what the twin lacks", "good": False, "reasons": []}


def test_what_an_estimate_of_another_time_says_is_no_advice_on_the_page_either(good):
    result = summary(good, {"name": "p"}, {})
    result["advice"] |= {"trusted": False, "stop": None, "gain": 0.0}
    said = of_next(good.examine(), good.checks(), result)
    assert said.answer == FLY_ANOTHER and "cannot say" in said.text
    result["verdict"]["next"]["answer"] = said.answer
    assert "Next: look into the remarks, then fly another test" in render(result)


def test_without_a_controller_both_ask_for_another_one(good):
    found = good.examine()
    found.best = None
    result = summary(good, {"name": "p"}, {}, found) | {
        "no_controller": "No controller to fly: none is safe."
    }
    assert result["verdict"]["next"]["answer"] == "Fly another controller that you trust"
    assert "Controller: none to fly: none is safe.\nNext: fly another controller that you trust" in render(
        result
    )

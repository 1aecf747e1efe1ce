"""The report as people open it: in a browser, on a desk and on a phone, in light and in dark, and printed."""

import pytest

import lives
from browser import SIZES, browser, kept, opened, serious
from conftest import pendulum_step
from twinloop.faces.figures.catalogue import FIGURES
from twinloop.faces.report.page import report_page

pytest.importorskip("jinja2", reason="twinloop[report] is not installed")


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    for name, campaign in (
        ("good", lives.learnt(pendulum_step, 4)),
        ("bad", lives.learnt(lives.with_end_stop, 3)),
    ):
        text = report_page(campaign, f"pendulum, {name}", {"name": "a pendulum"}, {})
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["good", "bad"])
def test_a_report_opens_without_a_complaint_and_keeps_nobody_out(chromium, pages, name, size):
    with opened(chromium, pages / f"{name}.html", size) as (page, said):
        kept(page, f"report-{name}-{size}")
        assert said == []
        assert serious(page) == []
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]  # only what may be scrolled is wider than the screen


def test_every_figure_has_something_drawn_in_it(chromium, pages):
    with opened(chromium, pages / "good.html", "desktop") as (page, _):
        for name in FIGURES:
            drawn = page.locator(f"figure#{name} svg.plot path, figure#{name} rect.cell")
            assert drawn.count() > 0, name
            for panel in page.locator(f"figure#{name} .panel").all():
                box = panel.bounding_box()
                assert box["width"] > 150 and box["height"] > 80, name


def test_numbers_stand_under_the_pointer_and_a_drag_looks_closer(chromium, pages):
    with opened(chromium, pages / "good.html", "desktop") as (page, said):
        plot = page.locator("figure#unseen svg.plot").first
        plot.scroll_into_view_if_needed()
        box = plot.bounding_box()
        before = plot.get_attribute("viewBox")
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        told = page.locator("#tip").inner_text()
        assert "flown:" in told and "twin:" in told and "1\n" in told + "\n"  # half of the two seconds
        page.mouse.down()
        page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 0.9 * box["height"], steps=4)
        page.mouse.up()
        x, _, wide, _ = (float(number) for number in plot.get_attribute("viewBox").split())
        whole = float(before.split()[2])
        assert x == pytest.approx(0.5 * whole, rel=0.05) and wide == pytest.approx(0.3 * whole, rel=0.05)
        plot.dblclick()
        assert plot.get_attribute("viewBox").split() == before.split()
        assert said == []


def test_a_link_of_the_verdict_leads_to_its_evidence(chromium, pages):
    with opened(chromium, pages / "bad.html", "phone") as (page, _):
        page.locator(".verdict .links a").first.click()
        target = page.evaluate("location.hash.slice(1)")
        top = page.evaluate(f"document.getElementById('{target}').getBoundingClientRect().top")
        assert -5 <= top < 200


def test_a_report_can_be_printed(chromium, pages):
    with opened(chromium, pages / "good.html", "desktop") as (page, said):
        printed = page.pdf(format="A4")
        assert printed.startswith(b"%PDF") and said == []
        assert 3 <= printed.count(b"/Type /Page\n") + printed.count(b"/Type /Page ") <= 40

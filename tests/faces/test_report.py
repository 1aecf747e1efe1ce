"""The report: what it says first, that links lead somewhere, that nothing is fetched, and nothing strange gets in."""

import dataclasses
import html
import re
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import lives
import twinloop as tl
from conftest import pendulum_step
from twinloop.campaign.examination.check import Check, Checks
from twinloop.campaign.examination.reaching import Ending, Miss
from twinloop.campaign.from_logs import learnt_from_logs
from twinloop.faces.certificate import facts
from twinloop.faces.cli import main
from twinloop.faces.figures.axis import axis
from twinloop.faces.figures.catalogue import FIGURES
from twinloop.faces.figures.figure import Band, Cells, Figure, Line, Panel
from twinloop.faces.figures.flights import step
from twinloop.faces.figures.svg import drawing, panel_svg
from twinloop.faces.report.moot import moot
from twinloop.faces.report.page import report_page
from twinloop.faces.report.source import OWN
from twinloop.faces.report.tables.controller import margins as margins_table
from twinloop.faces.result import summary
from twinloop.faces.text.controller import advice_text, advice_words
from twinloop.faces.text.verdict import verdict as verdict_text
from twinloop.faces.verdict import of_next, verdict, verdict_facts
from twinloop.records import to_text

pytest.importorskip("jinja2", reason="twinloop[report] is not installed")


class Elements(HTMLParser):
    """Every element with its attributes, and all text."""

    def __init__(self, text):
        super().__init__()
        self.found, self.text = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def good():
    return lives.learnt(pendulum_step, 4)


@pytest.fixture(scope="module")
def bad():
    return lives.learnt(lives.with_end_stop, 3)


@pytest.fixture(scope="module")
def page(good):
    return report_page(good, "pendulum", {"name": "a pendulum"}, {})


def first_words(text):
    """What stands before the checks, as a person reads it."""
    before = "".join(Elements(text[text.index("<body>") : text.index('id="checks"')]).text)
    return re.sub(r"\s+", " ", before)


def test_the_verdict_comes_first_with_numbers(good, bad, page):
    words = first_words(page)
    assert "Trust it" in words and "Do not trust it" not in words
    last = good.examine().unseen[-1]
    assert (
        f"FIT of its free run is {np.min(last.fit):.3g} %" in words
        and f"{100 * last.inside:.0f} % of the readings" in words
    )
    found = good.examine()
    for share in (found.autocorrelation.outside, found.crosscorrelation.outside):
        assert f"{100 * share:.0f} % of " in words
    assert "residuals are noise" not in words
    of_bad = first_words(report_page(bad, "stop", {"name": "a pendulum"}, {}))
    assert "Do not trust it" in of_bad and "Fly it" not in of_bad


def test_a_flight_is_named_before_it_is_spoken_of(good):
    band = Check("band", "twin", 0.5, 0.75, False, True, "Half of the readings were inside.")
    of_twin, *_ = verdict(good.examine(), Checks([band]), summary(good, {"name": "p"}, {}))
    assert of_twin.text.startswith("Too many readings of the last unseen flight were outside its band.")


def table(text, name):
    """Cells of a table of the page, row by row; none where something else stands in its place."""
    part = text[text.index(f'id="{name}"') :]
    part = part[: part.index("</section>")]
    rows = re.findall(r"<tr>(.*?)</tr>", part, re.DOTALL)
    return [[html.unescape(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)] for row in rows]


def test_a_controller_that_flew_has_one_prediction_the_one_before_its_flight():
    campaign = lives.learnt(pendulum_step, 3)
    best = campaign.best_test
    if best.measured is None:  # fly it, as a person would
        test = campaign.ask(last=True)
        campaign.tell(test, lives.PLANT.run(test))
        best = campaign.best_test
    before = next(run.test for run in campaign.experiments if run.number == best.number)
    assert best.measured is not None and before.predicted is not None
    assert best.predicted != before.predicted  # what the twin makes of a flight that it has learnt
    result = summary(campaign, {"name": "p"}, {})
    assert (result["controller"]["predicted"], result["controller"]["spread"]) == (
        before.predicted,
        before.spread,
    )
    page = report_page(campaign, "p", {"name": "p"}, {})
    assert f"lower is better): {before.predicted:.4g} ± {before.spread:.2g} predicted, " in first_words(page)
    (row,) = (row for row in table(page, "flights-table") if row[0] == f"test {best.number}")
    assert row[1:3] == [f"{before.predicted:.4g}", f"{before.spread:.2g}"]
    certified = facts(campaign, campaign.certificate(), "p.db", "p", None, {})["prediction"]
    assert (certified["quality"], certified["spread"]) == (before.predicted, before.spread)


def test_gains_that_have_flown_only_with_an_excitation_are_not_said_never_to_have_flown(bad):
    found = bad.examine()
    assert found.best_flights and all(run.test.excitation is not None for run in found.best_flights)
    assert step(found).title.endswith("predicted, flown only with an excitation")
    result = summary(bad, {"name": "p"}, {})
    result["controller"]["measured"] = None  # where a flight with an excitation does not measure them
    _, of_controller, _ = verdict(found, bad.checks(), result)
    assert "predicted, flown only with an excitation; the first gains" in of_controller.text


def test_numbers_that_rest_on_a_twin_that_does_not_follow_give_way_to_the_reason(page, good, monkeypatch):
    assert table(page, "margins") and "Not shown" not in page
    monkeypatch.setattr(
        tl.Twin, "follows", property(lambda twin: False, lambda twin, follows: None), raising=False
    )
    text = report_page(good, "stop", {"name": "a pendulum"}, {})
    shown = text[text.index('id="controller"') : text.index('id="campaign"')]
    assert not table(text, "margins") and shown.count("does not follow the flights") > 5
    assert all(row[2:] == ["–"] * 4 for row in table(text, "steps")[1:] if not row[1].startswith("flown"))
    assert not {"stable", "sensitivity", "delay"} & {check.name for check in good.checks()}
    assert "not predicted, as the twin does not follow its flights" in first_words(text)
    assert "Do not trust it" in first_words(text)


def test_a_loop_that_is_unstable_has_no_margins(good):
    found = good.examine()
    (nominal,) = found.margins.nominal
    unstable = dataclasses.replace(nominal, stable=False)
    for changes, cells in (({"worst": (unstable,)}, 1), ({"worst": (unstable,), "nominal": (unstable,)}, 2)):
        rows = margins_table(SimpleNamespace(margins=dataclasses.replace(found.margins, **changes))).rows
        assert [row[2:] == [*["–"] * 7, "NO"] for row in rows] == [place < cells for place in range(2)]
    found.margins = dataclasses.replace(found.margins, nominal=(unstable,))
    assert "unstable" in moot(found)["nyquist"] and "closed-poles" not in moot(found)


def test_what_is_trusted_is_said_with_its_range(page, good):
    runs = [run.trajectory for run in good.experiments]
    assert "within the flown range, for flights of up to 2 s" in first_words(page)
    angles = np.concatenate([run.states[:, 0] for run in runs])
    row = next(row for row in table(page, "ranges") if row[0] == "angle")
    assert row[1] == "rad" and [float(cell.replace("−", "-")) for cell in row[2:]] == pytest.approx(
        [angles.min(), angles.max()], rel=1e-3
    )


@pytest.mark.parametrize(
    ("name", "system", "title"),
    [("hover", "quadrotor", "hover"), ("campaign", "quadrotor", "quadrotor"), ("campaign", OWN, "angle, rate"),
     ("campaign", "campaign", "angle, rate")],
)  # fmt: skip
def test_a_campaign_that_nobody_named_is_called_by_its_system_or_its_states(good, name, system, title):
    assert f"<h1>{title}</h1>" in report_page(good, name, {"name": system}, {})


def test_every_link_leads_to_something_on_the_page(page, bad):
    for text in (page, report_page(bad, "stop", {"name": "a pendulum"}, {})):
        elements = Elements(text).found
        ids = [a["id"] for _, a in elements if "id" in a]
        targets = [a["href"][1:] for tag, a in elements if tag == "a"]
        assert len(ids) == len(set(ids)) and len(targets) > 15
        assert set(targets) <= set(ids)


def test_the_page_needs_no_network_and_is_small(page):
    for tag, attributes in Elements(page).found:
        assert tag not in ("link", "iframe", "object", "embed", "img"), tag
        assert not {"src", "srcset", "action"} & set(attributes)
    assert "@import" not in page and "url(" not in page
    assert "default-src 'none'" in page
    assert len(page.encode()) < 2_000_000


def test_the_spread_of_a_test_that_waits_is_no_power_of_ten(good, monkeypatch):
    test = SimpleNamespace(number=4, predicted=212.6, spread=99.7, risk=0.028, reason="Because.")
    monkeypatch.setattr("twinloop.faces.report.page.awaited", lambda campaign: [test])
    text = "".join(Elements(report_page(good, "pendulum", {"name": "a pendulum"}, {})).text)
    assert "Test 4 waits to be flown: quality 212.6 ± 100 predicted, risk " in text
    assert "risk not estimated" not in text
    test.risk = None
    text = "".join(Elements(report_page(good, "pendulum", {"name": "a pendulum"}, {})).text)
    assert "predicted, risk not estimated. Because." in text


def test_a_test_whose_run_was_withdrawn_waits_again(good):
    campaign = tl.Campaign.from_record(good.to_record(), threads=1)
    campaign.test({"angle.kp": 1.0, "angle.ki": 0.0, "angle.kd": 0.1})
    number = campaign.experiments[-1].number
    campaign.withdraw(campaign.experiments[-1].test, "the wrong log")
    text = "".join(Elements(report_page(campaign, "pendulum", {"name": "a pendulum"}, {})).text)
    assert f"Test {number} waits to be flown" in text and "No test is waiting" not in text
    # One of one's own may have been made only to see what the twin predicts.
    assert text.count("waits to be flown") == 1


def test_strange_names_and_reasons_are_shown_and_never_run(good):
    strange = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>"
    campaign = tl.Campaign.from_record(good.to_record(), threads=1)
    campaign.tell_failed(campaign.test({"angle.kp": 1.0, "angle.ki": 0.0, "angle.kd": 0.1}), strange)
    text = report_page(
        campaign,
        strange,
        {"name": strange},
        {},
        [dict.fromkeys(("begun", "command", "versions", "machine"), strange)],
    )
    elements = Elements(text)
    assert sum(tag == "script" for tag, _ in elements.found) == 1
    assert not [tag for tag, attributes in elements.found if tag == "img" or "onerror" in attributes]
    assert "".join(elements.text).count("alert(2)") >= 5


def test_names_in_drawings_are_escaped():
    panel = Panel("<b>", [Line([0, 1], [0, 1], "a", '"><script>')], "</svg>", "&")
    for text in (panel_svg(panel), drawing(Figure("f", "<i>", [panel]))):
        assert "<b>" not in text and "<script>" not in text
        assert "&lt;b&gt;" in text


def test_lines_stand_where_their_numbers_are():
    panel = Panel(
        "t",
        [Line([0.0, 5.0, 10.0], [1.0, np.nan, 3.0], "a"), Band([0.0, 10.0], [0, 0], [4, 4], "a")],
        x_range=(0.0, 10.0),
        y_range=(0.0, 4.0),
    )
    text = panel_svg(panel)
    high, wide = (float(value) for value in re.search(r'class="plot".*?', text) and (162.0, 312.0))
    path = re.search(r'<path d="(M[^"]+)" class="line a"', text).group(1)
    assert path == f"M0 {high * 0.75:g}M{wide:g} {high * 0.25:g}"  # a gap where a number is none


def test_a_long_line_that_is_thinned_keeps_its_gaps():
    y = np.sin(np.linspace(0.0, 60.0, 20_001))
    y[::2000] = np.nan
    path = re.search(
        r'<path d="(M[^"]+)" class="line a"', panel_svg(Panel("t", [Line(np.arange(y.size), y, "a")]))
    )
    assert path.group(1).count("M") == 10


def test_the_words_below_a_table_begin_inside_it_however_few_its_columns():
    words = "identification (experiments learnt)"
    for columns in (1, 2, 12):
        cells = Cells(np.zeros((1, columns)), [["1"] * columns], ["log 1"], ["1"] * columns)
        text = panel_svg(Panel("t", [cells], words))
        middle = float(
            re.search(rf'<text x="([0-9.]+)"[^>]*class="label middle">{re.escape(words)}', text)[1]
        )
        assert middle - 3.1 * len(words) >= 0.0


def test_each_state_of_all_flights_begins_a_line_of_its_own(good, page):
    part = page[page.index('id="flights"') :]
    kinds = re.findall(r'<div class="(panel|panel first)"', part[: part.index("</figure>")])
    assert kinds == ["panel first", *["panel"] * (len(good.experiments) - 1)] * good.signals.n_x


def test_a_page_has_one_unit_for_an_angle_whether_it_is_a_state_or_a_command():
    ball = tl.Signals([tl.State("tilt", "rad", 1.0)], [tl.Command("setpoint", "rad", (-1.0, 1.0))], 0.02)
    stream = np.random.default_rng(0)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (15, 1)), 10, axis=0)
    states = [np.zeros(1)]
    for command in commands:
        states.append(0.8 * states[-1] + 0.2 * command)
    run = tl.Trajectory(ball.dt * np.arange(151), np.array(states), commands)
    _, campaign = learnt_from_logs([run], ball, options={"committee_size": 4}, threads=1)
    text = report_page(campaign, "ball", {"name": "a ball"}, {}, controller=False)
    assert [row[1] for row in table(text, "ranges")[1:]] == ["rad", "rad"] and "°" not in text


@pytest.mark.parametrize("log", [False, True])
def test_ticks_of_an_axis_are_inside_and_even(log):
    stream = np.random.default_rng(1)
    for _ in range(200):
        values = 10.0 ** stream.uniform(-6, 6) * (np.abs(stream.normal(size=5)) + 1e-3)
        found = axis([values], 300.0, log)
        places = found.place(np.array([value for value, _ in found.ticks]))
        assert ((places >= -1e-6) & (places <= 300.0 + 1e-6)).all()
        assert 1 <= len(places) <= 12
        assert (found.place(values) >= 0.0).all() and (found.place(values) <= 300.0).all()
        if not log and len(places) > 2:
            assert np.diff(places) == pytest.approx(np.diff(places)[0], rel=1e-6)


def test_every_figure_is_drawn_or_says_why_not(good):
    for name in FIGURES:
        figure = getattr(good.plot, name)()
        assert figure.name == name and figure.panels
        assert figure._repr_svg_().startswith("<svg")
    with pytest.raises(AttributeError, match="unseen"):
        good.plot.weather  # noqa: B018
    with pytest.raises(tl.NotAvailable, match="something to show"):
        lives.learnt(pendulum_step, 1).plot.unseen()


def test_figures_are_saved_for_a_paper(good, tmp_path):
    pytest.importorskip("vl_convert", reason="twinloop[paper] is not installed")
    figure = good.plot.errors()
    for ending, begins in ((".svg", b"<svg"), (".png", b"\x89PNG"), (".pdf", b"%PDF")):
        figure.save(tmp_path / f"errors{ending}")
        assert (tmp_path / f"errors{ending}").read_bytes().startswith(begins)
    with pytest.raises(tl.InvalidInput, match=r"\.svg or \.pdf or \.png"):
        figure.save(tmp_path / "errors.doc")


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def timeless(page):
    """A page without what only a store knows: who worked on the campaign, and how long that took on the clock."""
    page = re.sub(r"<tr><th scope=\"row\">elapsed time.*</tr>\n", "", page[: page.index('id="again"')])
    return page.replace(" Elapsed time includes learning, planning, flying and pauses.", "")


def test_a_store_and_a_record_give_the_same_report(good, tmp_path):
    store, record = tmp_path / "pendulum.db", tmp_path / "pendulum.json"
    _ = good.best_test  # all that was told is learnt
    good.save(store, "pendulum")
    record.write_text(to_text(good.to_record()), encoding="utf-8")
    pages = []
    for where in (store, record):
        output = tmp_path / f"{where.suffix[1:]}.html"
        answer = run("report", where, "-o", output)
        assert answer.exit_code == 0, answer.output
        text = output.read_text(encoding="utf-8")
        pages.append(timeless(text))
    assert pages[0] == pages[1]
    own = good.report(tmp_path / "own.html", "pendulum")
    assert "elapsed time" in (tmp_path / "db.html").read_text(encoding="utf-8")
    assert timeless(own) == pages[0].replace("a system of your own", "pendulum")


def test_two_campaigns_stand_side_by_side(good, bad, tmp_path):
    for campaign, name in ((good, "good"), (bad, "bad")):
        campaign.save(tmp_path / f"{name}.db", name)
    answer = run("compare", tmp_path / "good.db", tmp_path / "bad.db", "-o", tmp_path / "both.html")
    assert answer.exit_code == 0, answer.output
    assert re.search(r"^twin +trust it +do not trust it$", answer.stdout, re.MULTILINE)
    assert "good against bad" in (tmp_path / "both.html").read_text(encoding="utf-8")


INCOMPARABLE = {
    "the kind of quality": {"quality": "ise"},
    "what counts in it": {"weights": {"angle": 2.0}},
    "the start": {"initial_state": [0.25, 0.0]},
    "the target": {"target_state": [0.9, 0.0]},
    "the duration": {"duration": 2.0},
}


@pytest.mark.parametrize("aspect", INCOMPARABLE)
def test_qualities_of_other_tasks_are_shown_as_what_cannot_be_compared(aspect, tmp_path):
    for name, changes in (("one", {}), ("other", INCOMPARABLE[aspect])):
        lives.begun(preset="default", **changes).save(tmp_path / f"{name}.db", name)
    page = tmp_path / "both.html"
    answer = run("compare", tmp_path / "one.db", tmp_path / "other.db", "-o", page)
    assert answer.exit_code == 0, answer.output
    (row,) = (line for line in answer.stdout.splitlines() if line.startswith(f"{aspect} "))
    one, other = re.split("  +", row)[1:]
    assert one != other
    sentence = f"The qualities of these campaigns cannot be compared: they differ in {aspect}."
    assert answer.stdout.splitlines()[-1] == sentence and sentence in page.read_text(encoding="utf-8")
    assert "better" not in answer.stdout
    assert all(line.split("  ")[0] not in INCOMPARABLE or line == row for line in answer.stdout.splitlines())


def test_qualities_of_one_task_are_compared(tmp_path):
    for seed in (0, 1):
        lives.begun(preset="default", seed=seed).save(tmp_path / f"{seed}.db", f"seed {seed}")
    answer = run("compare", tmp_path / "0.db", tmp_path / "1.db")
    assert answer.exit_code == 0 and "lower is better" in answer.stdout
    assert "cannot be compared" not in answer.stdout
    assert not any(line.startswith("the ") for line in answer.stdout.splitlines())


def test_campaigns_of_one_name_are_told_apart_by_their_stores(good, bad, tmp_path):
    for campaign, name in ((good, "good"), (bad, "bad")):
        campaign.save(tmp_path / f"{name}.db", "campaign")
    head = run("compare", tmp_path / "good.db", tmp_path / "bad.db").stdout.splitlines()[0]
    assert "good.db" in head and "bad.db" in head and "campaign" not in head.split()


def test_what_is_no_campaign_is_refused_in_a_sentence(tmp_path):
    other, broken = tmp_path / "other.json", tmp_path / "broken.json"
    other.write_text('{"kind": "test"}')
    broken.write_text("{" * 5000)
    for where, words in (
        (other, "the record of a campaign"),
        (broken, "expected JSON"),
        (tmp_path / "none.db", "none.db"),
    ):
        answer = run("report", where, "-o", tmp_path / "x.html")
        assert answer.exit_code == 2 and words in answer.stderr, answer.output
    assert run("report", other, "-o", tmp_path / "x.pdf").exit_code == 2
    assert not (tmp_path / "x.html").exists()


def test_a_campaign_of_the_preset_paper_has_a_report():
    campaign = lives.new("paper").run(lives.PLANT, 2)
    page = report_page(campaign, "paper", {"name": "a pendulum"}, {})
    assert "preset paper" in page and "You decide" in page


def test_every_flight_that_had_not_been_learnt_has_the_band_of_its_time(good):
    found = good.examine()
    assert len(found.unseen) == 3 and all(0.75 < each.inside <= 1.0 for each in found.unseen)
    caption = FIGURES["unseen"](found).caption
    assert re.search(
        r"Earlier unseen flights, each with the twin of that time: test 1 \d+ %, test 2 \d+ %\.", caption
    )
    # The band of the first planned flight is that of the twin that planned it.
    planned = tl.Campaign.from_record(good.to_record())
    again = planned.examine().unseen[0]
    np.testing.assert_array_equal(again.predicted.band, found.unseen[0].predicted.band)


def test_bands_that_an_older_version_has_not_kept_are_said_to_be_unknown(good):
    record = good.to_record()
    for name in ("asked", "latest"):
        del record["memory"][name]["ensembles"]
    caption = FIGURES["unseen"](tl.Campaign.from_record(record).examine()).caption
    assert "Of 2 earlier unseen flights the band is no longer known." in caption


@pytest.mark.parametrize(("fails", "answer"), [(True, "Ask for a calmer controller"), (False, "Stop")])
def test_where_the_twin_is_good_and_its_controller_is_not_another_flight_is_no_answer(fails, answer):
    delay = Check("delay", "controller", 0.6, 1.0, not fails, True, "It bears 0.6 periods more.")
    result = {"quality": {"unit": "rad s"}, "advice": {"gain": 1e-5, "scatter": 1e-3, "stop": True}}
    found = SimpleNamespace(best=object(), margins=object(), ending=None)
    said = of_next(found, Checks([delay]), result)
    assert said.answer == answer and said.good is (None if fails else True)
    assert ("delay" in said.text) is fails


def test_where_the_target_is_missed_nobody_is_told_just_to_stop(good, monkeypatch):
    miss = Miss(tl.State("temp", "degC", 50.0), 40.0, 19.8, 0.99)
    end = Ending((miss,), ((tl.Command("heater", "kW", (0.0, 20.0)), 20.0),))
    words = "19.8 degC from temp's target of 40 degC, with heater at its bound of 20 kW"
    result = {"quality": {"unit": ""}, "advice": {"gain": 1e-5, "scatter": 1e-3, "stop": True}}
    said = of_next(SimpleNamespace(best=object(), margins=object(), ending=end), Checks([]), result)
    assert said.answer != "Stop" and said.good is None and words in said.text
    found = good.examine()
    found.ending, checked = end, Checks([])
    _, of_controller, _ = verdict(found, checked, summary(good, {"name": "p"}, {}))
    assert of_controller.good is None and words in of_controller.text
    shown = summary(good, {"name": "p"}, {})
    shown["controller"]["off_target"] = str(end)
    shown["advice"] |= {"trusted": True, "stop": True, "gain": 1e-5, "scatter": 1e-3}
    shown["verdict"] = verdict_facts(verdict(found, checked, shown))
    assert all(words in said(shown) for said in (verdict_text, advice_text))


def test_a_quality_without_a_unit_leaves_no_gap_in_a_sentence(good, page):
    result = summary(good, {"name": "a pendulum"}, {})
    assert " ".join(advice_words(result).split()) in " ".join("".join(Elements(page).text).split())
    for unit in ("", "1"):
        result["quality"]["unit"] = unit
        found = SimpleNamespace(best=object(), margins=object(), ending=None)
        for stop in (True, False):
            result["advice"] |= {"gain": 0.2, "scatter": 0.1, "trusted": True, "stop": stop}
            for words in (advice_words(result), of_next(found, Checks([]), result).text):
                assert "0.2" in words and not re.search(r" [.,;1]", words)


def test_tables_of_the_report_are_in_the_units_of_its_figures(good, page):
    (row,) = (row for row in table(page, "noise") if row[0] == "angle")
    sensor = summary(good, {"name": "p"}, {})["twin"]["states"][0]["sensor"]
    assert row[1] == "rad" and float(row[3]) == pytest.approx(sensor, rel=1e-3)


def test_checks_that_could_not_be_made_are_what_comes_next(good):
    result = {"quality": {"unit": ""}, "advice": {"gain": 0.0, "scatter": 1e-3, "stop": True}}
    found = SimpleNamespace(best=object(), margins=None, ending=None, no_margins="There is no slope.")
    unmade = Check("stable", "controller", None, None, False, True, "Not made: there is no slope.")
    said = of_next(found, Checks([unmade]), result)
    assert "There is no slope." in said.text and "narrower bounds" not in said.text
    assert "margins" not in dict(said.links)  # there is no table of them on the page

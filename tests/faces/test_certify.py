"""The certificate of a controller: granted or refused with its reason, and the files that set gains or restore them."""

import dataclasses
import json
from html.parser import HTMLParser

import numpy as np
import pytest
from click.testing import CliRunner

import twinloop as tl
from browser import SIZES, browser, kept, opened, serious
from command import invoke
from conftest import PENDULUM_GAINS
from lives import CONTROLLER, SIGNALS, SMALL
from twinloop.campaign.certificate import Use, certificate
from twinloop.faces.certificate import _plots, facts, page
from twinloop.faces.cli import main
from twinloop.faces.report.tables.twin import ranges

MAPPING = """
[autopilot]
kind = "px4"
[autopilot.parameters]
"angle.kp" = { name = "MC_PITCH_P", scale = 0.1, limits = [0.0, 1.0] }
"angle.ki" = { name = "MC_PITCH_I", offset = 0.5 }
"angle.kd" = "MC_PITCH_D"
"""

NAMESPACE = "http://www.w3.org/2000/svg"
"""A name that drawings carry, and no address that anything is fetched from."""


class Page(HTMLParser):
    """Texts and tags of a page."""

    def __init__(self, text):
        super().__init__()
        self.texts, self.tags, self.outside = [], [], []
        self.feed(text)
        self.text = " ".join(" ".join(self.texts).split())

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.outside += [value for name, value in attributes if name in ("src", "href", "onload", "onclick")]

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A campaign whose controller is granted, and where it is kept."""
    pytest.importorskip("sqlalchemy")
    store = tmp_path_factory.mktemp("rig") / "rig.db"
    campaign = rig_campaign()
    campaign.run(plant(), experiments=3)
    campaign.save(store)
    assert not campaign.certificate().refusals
    return campaign, store


def swinging(state, command):
    """A period of a linear pendulum, in small steps."""
    angle, rate = state
    for _ in range(50):
        rate += 0.001 * (11.0 * command[0] - 0.8 * rate - 5.0 * angle)
        angle += 0.001 * rate
    return angle, rate


def plant():
    return tl.systems.Simulated(SIGNALS, swinging, default_gains=PENDULUM_GAINS, noise=[0.005, 0.02])


def rig_campaign():
    return tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options={**SMALL, "draws": 8},
    )  # fmt: skip


def certify(store, folder, *options, mapping=MAPPING):
    file = store.with_name("mapping.toml")
    file.write_text(mapping, encoding="utf-8")
    return CliRunner().invoke(
        main, ["certify", str(store), "-o", str(folder), "--mapping", str(file), *options]
    )


def parameters(path):
    rows = [line.split("\t") for line in path.read_text().splitlines() if not line.startswith("#")]
    return {row[2]: float(row[3]) for row in rows}


def test_a_granted_controller_comes_with_its_parameters_and_with_the_old_ones(flown, tmp_path):
    campaign, store = flown
    done = certify(store, tmp_path / "made" / "here")
    assert done.exit_code == 0 and done.stdout.startswith("Granted: "), done.output
    folder = tmp_path / "made" / "here"
    best, old = campaign.best_test.parameters, PENDULUM_GAINS
    for file, gains in (("gains.params", best), ("restore.params", old)):
        found = parameters(folder / file)
        expected = {
            "MC_PITCH_P": 0.1 * gains["angle.kp"],
            "MC_PITCH_I": gains["angle.ki"] + 0.5,
            "MC_PITCH_D": gains["angle.kd"],
        }
        assert found == {name: pytest.approx(value, rel=1e-6) for name, value in expected.items()}
    said = json.loads((folder / "certificate.json").read_text())
    assert said["granted"] and {row["name"]: row["value"] for row in said["gains"]} == best
    assert {row["name"]: row["old"] for row in said["gains"]} == old
    assert said["autopilot"]["files"] == {"restore": "restore.params", "gains": "gains.params"}
    margins = campaign.margins()
    assert said["margins"]["worst"][0]["phase"] == margins.worst[0].phase
    step = campaign.twin.simulate(campaign.best_test)
    np.testing.assert_array_equal(said["prediction"]["states"], step.states)
    assert [check["name"] for check in said["judged_on"]["checks"]] == [c.name for c in campaign.checks()]


def test_the_page_says_the_same_and_needs_no_network(flown, tmp_path):
    _, store = flown
    certify(store, tmp_path)
    html = (tmp_path / "certificate.html").read_text(encoding="utf-8")
    found, said = Page(html), json.loads((tmp_path / "certificate.json").read_text())
    assert (
        "script" not in found.tags
        and not found.outside
        and "http" not in html.replace("http-equiv", "").replace(NAMESPACE, "")
    )
    assert "Granted" in found.text and "MC_PITCH_P" in found.text
    for sentence in [*said["not_tested"], *(check["sentence"] for check in said["judged_on"]["checks"])]:
        assert " ".join(sentence.split()) in found.text
    assert found.tags.count("figure") == SIGNALS.n_x and "time (s)" in found.text


def test_a_controller_that_fails_a_check_is_refused_and_sets_nothing(flown, tmp_path):
    pytest.importorskip("sqlalchemy")
    _, good = flown
    certify(good, tmp_path / "made")
    assert (tmp_path / "made" / "gains.params").exists()
    campaign = rig_campaign()
    campaign.run(plant(), experiments=1)
    store = tmp_path / "young.db"
    campaign.save(store)
    done = certify(store, tmp_path / "made")
    assert done.exit_code == 1 and "Fly one more" in done.stdout
    assert not (tmp_path / "made" / "gains.params").exists()  # nor one of an earlier time
    said = json.loads((tmp_path / "made" / "certificate.json").read_text())
    assert not said["granted"] and said["autopilot"]["files"] == {}
    assert "Do not fly these gains" in Page((tmp_path / "made" / "certificate.html").read_text()).text


def test_what_has_to_be_learnt_to_look_is_said_not_to_be_kept_until_learn_has_kept_it(tmp_path):
    pytest.importorskip("sqlalchemy")
    campaign = rig_campaign()
    first = campaign.test(PENDULUM_GAINS)
    campaign.tell(first, plant().run(first))
    store = tmp_path / "young.db"
    campaign.save(store)
    said = (
        f"Not learnt yet: 1 experiment. What is learnt now is not kept; to keep it: twinloop learn {store}."
    )
    looks = [
        lambda: certify(store, tmp_path / "made"),
        lambda: invoke("export", str(store), "--to", "json", "--force"),
        lambda: invoke(
            "export", str(store), "controller", "--to", "c", "-o", str(tmp_path / "c.c"), "--force"
        ),
        lambda: invoke("report", str(store), "-o", str(tmp_path / "page.html")),
    ]
    assert [look().stderr.count(said) for look in looks] == [1, 1, 1, 1]
    assert invoke("learn", str(store), "--threads", "1").exit_code == 0
    assert [look().stderr.count("Not learnt yet") for look in looks] == [0, 0, 0, 0]


def test_earlier_gains_are_gone_though_the_page_cannot_be_made(flown, tmp_path, monkeypatch):
    (tmp_path / "gains.param").write_text("ATC_RAT_RLL_P,9.9\n", encoding="utf-8")
    monkeypatch.setattr("twinloop.faces.certifying.page", lambda *_: 1 / 0)
    certify(flown[1], tmp_path)
    assert not list(tmp_path.glob("gains.*"))


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        (MAPPING.replace("[0.0, 1.0]", "[0.0, 0.01]"), "nothing is written"),
        (MAPPING.replace('"angle.kd" = "MC_PITCH_D"', ""), "'angle.kd'"),
        (MAPPING.replace("MC_PITCH_D", "MC_PITCH_P"), "twice"),
        (MAPPING.replace("MC_PITCH_D", "a\\nparam set X 1"), "name of a parameter"),
        (MAPPING.replace('"px4"', '"px5"'), "autopilot"),
        ("[autopilot", "TOML"),
        ("[autopilots]", "autopilot"),
    ],
)
def test_a_mapping_that_cannot_be_used_writes_nothing(flown, tmp_path, mapping, said):
    done = certify(flown[1], tmp_path / "made", mapping=mapping)
    assert done.exit_code == 2 and said in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "made").exists()


def test_the_restore_file_is_written_first(flown, tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr("twinloop.faces.certifying.write_whole", lambda path, text: written.append(path.name))
    certify(flown[1], tmp_path, "--autopilot", "ros2", mapping=MAPPING.replace("MC_", "mc."))
    assert written[:2] == ["restore.yaml", "gains.yaml"]


def test_an_autopilot_without_a_mapping_is_refused_and_without_one_there_is_the_certificate_alone(
    flown, tmp_path
):
    store = flown[1]
    arguments = ["certify", str(store), "-o", str(tmp_path / "made")]
    done = CliRunner().invoke(main, [*arguments, "--autopilot", "px4"])
    assert done.exit_code == 2 and "autopilot.parameters" in done.stderr
    assert CliRunner().invoke(main, arguments).exit_code == 0
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == [
        "certificate.html",
        "certificate.json",
    ]


def test_hostile_texts_stay_texts_on_the_page(flown):
    campaign = flown[0]
    evil = '"><script>alert(1)</script>\n<img src=x onerror=alert(1)>'
    known = facts(campaign, certificate(campaign), evil, evil, None, {})
    known["gains"][0]["name"] = known["not_tested"][0] = evil
    found = Page(page(known, [evil, evil], [evil, evil]))
    assert "script" not in found.tags and "img" not in found.tags
    assert "<script>alert(1)</script>" in found.text


def test_margins_of_loops_that_are_unstable_or_around_a_twin_that_does_not_follow_are_not_shown(
    flown, monkeypatch
):
    campaign, _ = flown
    names, units = SIGNALS.state_names, [state.unit for state in SIGNALS.states]
    said = facts(campaign, campaign.certificate(), "rig.db", "rig", None, {})
    gain = f"{said['margins']['worst'][0]['phase'] * 180.0 / np.pi:.4g}"
    assert gain in Page(page(said, names, units)).text
    said["margins"]["worst"][0]["stable"] = False
    unstable = Page(page(said, names, units)).text
    assert gain not in unstable and "it has no margins" in unstable
    monkeypatch.setattr(
        tl.Twin, "follows", property(lambda twin: False, lambda twin, follows: None), raising=False
    )
    found = campaign.certificate()
    assert found.margins is None and any("does not follow" in each for each in found.not_tested)
    assert not found.granted


def test_figures_of_a_certificate_are_in_the_units_of_its_tables():
    prediction = {"t": [0.0, 3600.0], "states": [[0.0], [0.4]], "band": None, "target": [0.5]}
    (plot,) = _plots(prediction, ["roll"], ["rad"])
    assert plot["words"] == "from 0 to 0.4 rad in 3600 s" and "roll (rad)" in plot["svg"]
    assert _plots(prediction, ["share"], ["1"])[0]["words"] == "from 0 to 0.4 in 3600 s"


def test_an_old_gain_that_is_not_known_is_a_dash(flown):
    campaign, _ = flown
    names, units = SIGNALS.state_names, [state.unit for state in SIGNALS.states]
    found = dataclasses.replace(campaign.certificate(), old=None)
    said = facts(campaign, found, "rig.db", "rig", None, {})
    assert all(gain["old"] is None for gain in said["gains"])
    shown = Page(page(said, names, units)).text
    table = shown.partition("tuned between")[2].partition("Predicted flight")[0]
    assert "–" in table and "∞" not in table


def test_nothing_told_is_no_certificate():
    with pytest.raises(tl.NotAvailable, match="at least one recorded experiment"):
        rig_campaign().certificate()


def test_a_campaign_file_may_declare_an_autopilot(tmp_path):
    from twinloop.campaign.campaign_file import read_autopilot, read_file, template

    file = tmp_path / "rig.toml"
    file.write_text(template("rig.db").partition("[options]")[0] + MAPPING, encoding="utf-8")
    assert read_file(file).arguments["preset"] == "default"
    assert read_autopilot(file).kind == "px4"
    file.write_text(template("rig.db"), encoding="utf-8")
    assert read_autopilot(file) is None


def test_exact_readings_leave_rounding_and_that_speaks_against_nobody():
    def step(state, command):
        """One Runge-Kutta step of a linear pendulum, which a twin can follow to the last digits."""

        def slope(x):
            return np.array([x[1], 11.0 * command[0] - 0.8 * x[1] - 5.0 * x[0]])

        x, h = np.asarray(state), SIGNALS.dt
        a = slope(x)
        b = slope(x + 0.5 * h * a)
        c = slope(x + 0.5 * h * b)
        d = slope(x + h * c)
        return x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)

    campaign = rig_campaign()
    campaign.run(tl.systems.Simulated(SIGNALS, step, default_gains=PENDULUM_GAINS), experiments=3)
    assert campaign.twin.errors[0].closed_loop < 1e-20
    assert campaign.examine().innovations is None
    assert campaign.checks().twin_passed


# In a browser


@pytest.fixture(scope="module")
def pages(flown, tmp_path_factory):
    """The page of a controller that is granted, and of one that is refused."""
    pytest.importorskip("jinja2", reason="twinloop[report] is not installed")
    folder, (_, store) = tmp_path_factory.mktemp("pages"), flown
    certify(store, folder / "granted")
    campaign = rig_campaign()
    campaign.run(plant(), experiments=1)
    young = tmp_path_factory.mktemp("young") / "young.db"
    campaign.save(young)
    certify(young, folder / "refused")
    return folder


@pytest.mark.parametrize(("beyond", "left"), [(0.0, False), (2.9, False), (3.1, True)])
@pytest.mark.parametrize("low", [True, False])
def test_no_range_is_left_by_less_than_its_sensor_scatters(beyond, left, low):
    predicted = (-1.0 - 0.01 * beyond, 1.0) if low else (-1.0, 1.0 + 0.01 * beyond)
    assert Use("angle", "rad", None, predicted, (-1.0, 1.0), 0.01).beyond_flown == left
    assert Use("angle", "rad", None, predicted, (-1.0, 1.0)).beyond_flown == (beyond > 0.0)


def test_a_log_that_is_whole_turns_on_widens_no_flown_range():
    """An angle that goes round is the same two turns on: nothing was flown in between."""
    states = [dataclasses.replace(state, periodic=state.name == "angle") for state in SIGNALS.states]
    signals = dataclasses.replace(SIGNALS, states=states)
    system = tl.systems.Simulated(signals, swinging, default_gains=PENDULUM_GAINS, noise=[0.005, 0.02])
    campaign = tl.Campaign(
        signals, controller=CONTROLLER, initial_state=[0.0, 0.0], target_state=[1.0, 0.0], duration=1.0, threads=1,
        options={**SMALL, "draws": 8},
    )  # fmt: skip
    campaign.run(system, experiments=2)
    before, looked = campaign.certificate().uses[0], campaign.examine()
    first = campaign.experiments[0].trajectory
    on = np.array([4.0 * np.pi, 0.0])
    # A part of the flight: all of it would be a copy, which is refused.
    campaign.attach(tl.Trajectory(first.t[:-1], first.states[:-1] + on, first.commands[:-1]))
    campaign.interrupted = True  # what was learnt is enough
    after, found = campaign.certificate().uses[0], campaign.examine()
    assert after.flown == pytest.approx(before.flown, abs=1e-9) and after.name == "angle"
    assert ranges(found).rows == ranges(looked).rows
    assert found.beyond == looked.beyond


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["granted", "refused"])
def test_the_page_opens_without_a_complaint_and_keeps_nobody_out(pages, name, size):
    with browser() as chromium, opened(chromium, pages / name / "certificate.html", size) as (page, said):
        kept(page, f"certificate-{name}-{size}")
        assert said == [] and serious(page) == []
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]
        assert page.locator("figure > svg").count() == SIGNALS.n_x
        smallest = (
            "Math.min(...[...document.querySelectorAll('svg .tick')].map(t =>"
            " parseFloat(getComputedStyle(t).fontSize) * t.getScreenCTM().a))"
        )
        assert page.evaluate(smallest) >= 0.75 * 15.0  # of the page's text
        for drawn in page.locator("svg").all():
            box = drawn.bounding_box()
            assert box["width"] > 150 and box["height"] > 60

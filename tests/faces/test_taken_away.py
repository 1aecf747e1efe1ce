"""Whatever flew, all of it can be seen and taken away: the quadrotor, one of Gymnasium, one of RotorPy."""

import json
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

import twinloop as tl
from command import invoke
from conftest import PENDULUM_GAINS, pendulum_step
from lives import CONTROLLER, SIGNALS, SMALL, by_hand
from twinloop.faces.figures.catalogue import FIGURES
from twinloop.law.exports.export import SUFFIXES

pytest.importorskip("jinja2", reason="needs pip install 'twinloop[report,store]'")
pytest.importorskip("sqlalchemy", reason="needs pip install 'twinloop[report,store]'")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")


def quadrotor():
    return tl.systems.Quadrotor(noise=1e-3), {}


def gymnasium():
    pytest.importorskip("gymnasium", reason="needs pip install 'twinloop[gymnasium]'")
    system = tl.systems.Gymnasium(
        "Pendulum-v1", noise={"angle": 0.002, "rate": 0.01},
        default_gains={"angle.kp": 12.0, "angle.ki": 1.0, "angle.kd": 3.0},
    )  # fmt: skip
    controller = tl.controllers.PID(
        axes=[("angle", "rate")],
        gains={"angle.kp": (0.0, 60.0), "angle.ki": (0.0, 20.0), "angle.kd": (0.0, 10.0)},
    )
    return system, {
        "controller": controller, "initial_state": [0.3, 0.0], "target_state": [0.0, 0.0], "duration": 2.0,
    }  # fmt: skip


def rotorpy():
    pytest.importorskip("rotorpy", reason='needs pip install --no-deps "rotorpy>=3,<4"')
    return tl.systems.RotorPy("crazyflie", noise=1e-3), {"options": {**SMALL, "lags": True}}  # its motors lag


@pytest.fixture(scope="module", params=[quadrotor, gymnasium, rotorpy], ids=lambda made: made.__name__)
def flown(request, tmp_path_factory):
    """A campaign of two experiments, and the store that keeps it."""
    system, changes = request.param()
    task = ("controller", "initial_state", "target_state", "duration")
    arguments = {name: changes[name] if name in changes else getattr(system, name) for name in task}
    store = tmp_path_factory.mktemp(request.param.__name__) / "flown.db"
    campaign = tl.Campaign(
        system.signals, **arguments, options=changes.get("options", SMALL), threads=1, store=store
    )
    campaign.run(system, experiments=2)
    return campaign, store


class Tags(HTMLParser):
    """How often each tag stands on a page."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found.append(tag)


def test_a_report_with_its_figures(flown, tmp_path):
    campaign, store = flown
    page = tmp_path / "report.html"
    assert invoke("report", str(store), "-o", str(page)).exit_code == 0
    assert Tags(page.read_text()).found.count("svg") > campaign.signals.n_x
    assert page.stat().st_size < 6_000_000
    done = invoke("report", str(store), "-o", str(tmp_path / "figures"), "--format", "svg")
    assert done.exit_code == 0
    assert {file.stem for file in (tmp_path / "figures").iterdir()} <= set(FIGURES)
    assert len(list((tmp_path / "figures").iterdir())) > 5


def test_a_certificate_or_the_reason_why_there_is_none(flown, tmp_path):
    campaign, store = flown
    done = invoke("certify", str(store), "-o", str(tmp_path / "cert"))
    found = json.loads((tmp_path / "cert" / "certificate.json").read_text())
    assert done.exit_code == (0 if found["granted"] else 1)
    assert found["granted"] == (not campaign.certificate().refusals)
    assert "Gain certificate" in (tmp_path / "cert" / "certificate.html").read_text()


def test_settings_of_the_next_flight(flown, tmp_path):
    campaign, store = flown
    number = campaign.tests[-1].number
    assert invoke("settings", str(store), str(number), "-o", str(tmp_path / "sheet")).exit_code == 0
    rows = (tmp_path / "sheet" / f"test-{number}-commands.csv").read_text().splitlines()
    assert len(rows) >= campaign.tests[-1].steps


@pytest.mark.parametrize("kind", SUFFIXES)
def test_the_twin_in_every_kind_compared_with_its_flights(flown, kind, tmp_path):
    packages = {
        "fmu3": "fmpy",
        "fmu2": "fmpy",
        "casadi": "casadi",
        "control": "control",
        "gymnasium": "gymnasium",
    }
    pytest.importorskip(packages.get(kind, "math"))
    campaign, _ = flown
    path = tmp_path / f"taken{SUFFIXES[kind]}"
    made = campaign.twin.export(path, kind=kind)
    assert path in made and all(file.stat().st_size > 0 for file in made)
    if kind == "json":
        again = tl.load_twin(path)
        run = campaign.experiments[0].trajectory
        expected = campaign.twin.simulate_commands(run.states[0], run.commands).states
        assert again.simulate_commands(run.states[0], run.commands).states.tobytes() == expected.tobytes()
    if kind == "python":
        code = "import taken; print(len(taken.simulate([0.1] * len(taken.STATES), [[0.0] * len(taken.COMMANDS)] * 3)))"
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == "4"


@pytest.mark.parametrize("kind", ["python", "c"])
def test_the_controller_compared_on_its_flights(flown, kind, tmp_path):
    campaign, _ = flown
    assert campaign.export_controller(tmp_path / f"loop{SUFFIXES[kind]}", campaign.best_test.parameters)


def test_gains_that_have_not_flown_leave_only_certified_by_name_or_by_force(flown, tmp_path):
    campaign, _ = flown
    best, file = campaign.best_test, tmp_path / "loop.py"
    flew = any(
        run.test is not None and run.test.parameters == best.parameters for run in campaign.experiments
    )
    if flew or campaign.certificate().granted:
        assert campaign.export_controller(file)
        return
    with pytest.raises(tl.NotTrusted, match="would be certified"):
        campaign.export_controller(file)
    assert not file.exists()
    assert campaign.export_controller(file, best.parameters) and campaign.export_controller(file, force=True)


def test_no_controller_is_written_in_a_kind_that_only_a_twin_has(flown, tmp_path):
    file = tmp_path / "loop.py"
    done = invoke("export", str(flown[1]), "controller", "--to", "sympy", "-o", str(file))
    assert done.exit_code == 2 and "of a controller 'sympy': expected one of python, c" in done.stderr
    assert not file.exists()


@pytest.mark.parametrize("kind", ["python", "c"])
def test_a_controller_that_follows_a_reference_is_compared_along_it(kind, tmp_path):
    campaign = tl.Campaign(
        SIGNALS, controller=CONTROLLER, initial_state=[0.0, 0.0], duration=1.0, threads=1, options=SMALL,
        target_state=lambda t: [np.sin(2.0 * t), 2.0 * np.cos(2.0 * t)],
    )  # fmt: skip
    test = campaign.test(PENDULUM_GAINS)
    campaign.tell(test, tl.systems.Simulated(SIGNALS, pendulum_step).run(test))
    campaign.attach(by_hand(40))  # longer than the reference
    assert campaign.export_controller(tmp_path / f"loop{SUFFIXES[kind]}", PENDULUM_GAINS)
    names = {}
    exec(campaign.export_twin("gymnasium", force=True), names)
    assert names["TARGET_STATE"] == pytest.approx([np.sin(2.0), 2.0 * np.cos(2.0)])


def test_in_a_notebook_everything_shows_itself(flown):
    campaign, _ = flown
    run = campaign.experiments[0]
    for shown in (campaign, campaign.twin, run.trajectory, run.test):
        text = shown._repr_html_()
        assert "<" in text and "nan" not in text.lower().replace("nanometre", "")


def test_the_environment_of_the_file_is_that_of_the_campaign(flown):
    pytest.importorskip("gymnasium")
    campaign, names = flown[0], {}
    exec(campaign.export_twin("gymnasium", force=True), names)
    env = names["TwinEnv"]()
    first, known = env.reset()
    np.testing.assert_array_equal(known["state"], campaign.setup.initial_state)
    assert env.steps == campaign.setup.steps and first.shape == (campaign.signals.n_x,)

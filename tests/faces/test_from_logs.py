"""`twinloop identify`: a twin from logs alone, judged on a log that it has not learnt, with a page about it."""

import json

import numpy as np
import pytest

import twinloop as tl
from browser import SIZES, browser, kept, opened, serious
from command import invoke
from lives import RIG, SIGNALS, by_hand
from twinloop._ground.texts import two_digits
from twinloop.campaign.from_logs import learnt_from_logs
from twinloop.faces.figures.figure import Line
from twinloop.faces.figures.flights import flights, unseen
from twinloop.logs import write_columns


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three logs and the file that says what is in them."""
    room = tmp_path_factory.mktemp("logs")
    (room / "rig.toml").write_text(RIG)
    noise = np.random.default_rng(0)
    for number in range(3):
        run = by_hand(60, seed=number)
        read = run.states + noise.normal(size=run.states.shape) * [1e-2, 5e-2]
        names = dict(zip(("angle", "rate"), read.T, strict=True))
        write_columns(room / f"{number}.csv", {"t": run.t, **names, "torque": run.commands[:, 0]})
    return room


def identified(folder, *more, logs=("0.csv", "1.csv")):
    files = [str(folder / name) for name in logs]
    return invoke("identify", *files, "--config", str(folder / "rig.toml"), "--threads", "1", *more)


@pytest.fixture(scope="module")
def done(folder):
    pytest.importorskip("jinja2", reason="twinloop[report] is not installed")
    return identified(
        folder, "--held-out", str(folder / "2.csv"), "-o", str(folder / "twin.json"),
        "--report", str(folder / "logs.html"), "--json",
    )  # fmt: skip


def test_the_twin_is_that_of_the_package_and_is_judged_on_the_log_held_out(folder, done):
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    signals = tl.load_twin(folder / "twin.json").signals
    runs = [tl.load(folder / f"{number}.csv", signals) for number in range(3)]
    twin = tl.identify(runs[:2], signals, options={"committee_size": 4}, threads=1)
    again = tl.load_twin(folder / "twin.json")
    assert found["exact_equations"] == twin.equations(17).splitlines() == again.equations(17).splitlines()
    assert [log["learnt"] for log in found["logs"]] == [True, True, False]
    fits = {row.name: row.fit for row in twin.fit(runs[2])}
    assert found["logs"][2]["fit"] == pytest.approx(fits) and min(fits.values()) > 90.0


def test_a_log_held_out_that_the_twin_does_not_predict_is_said_and_the_twin_is_not_taken_away(folder):
    run = by_hand(60, seed=2)
    turned = dict(zip(("angle", "rate"), run.states.T, strict=True))
    write_columns(folder / "other.csv", {"t": run.t, **turned, "torque": -run.commands[:, 0]})
    doubted = str(folder / "doubted.json")
    found = identified(
        folder, "--held-out", str(folder / "2.csv"), "--held-out", str(folder / "other.csv"), "-o", doubted
    )
    assert found.exit_code == 0
    (said,) = [line for line in found.stdout.splitlines() if line.startswith("serious: ")]
    assert "does not predict other.csv, which was held out: error " in said
    refused = invoke("export", doubted, "--to", "c", "-o", str(folder / "doubted.c"))
    assert refused.exit_code == 1 and "does not predict other.csv" in refused.stderr
    assert not (folder / "doubted.c").exists()
    forced = invoke("export", doubted, "--to", "c", "-o", str(folder / "doubted.c"), "--force")
    assert forced.exit_code == 0 and (folder / "doubted.c").exists()


def test_as_text_it_is_equations_and_a_table(folder):
    said = identified(folder).stdout
    assert "d angle / dt = rate" in said and "FIT angle (%)" in said and "held out" not in said


def test_the_page_has_what_there_is_and_nothing_of_a_controller(folder, done):
    page = (folder / "logs.html").read_text()
    assert "Report of a twin from logs" in page and 'figure id="unseen"' in page
    assert (
        "Trust it" in page
        and "inside its 90 % band" in page
        and 'figure id="coverage"' in page
        and "under its recorded commands" in page
    )
    assert "of them held out" in page and "For 2.csv, which it had not learnt from" in page
    assert "The twin against 2.csv" in page and "did not predict" not in page and "predicted 2.csv" in page
    assert "learnt from these flights, but for 2.csv" in page
    for name in ("0.csv", "1.csv", "2.csv"):
        assert f">{name}<" in page and f">{name}: angle<" in page and f">{name}: rate<" in page
    assert ">log<" not in page and ">record<" not in page and "a record" not in page
    for absent in (
        "twinloop learn<",
        'id="controller"',
        'id="next"',
        "controller to fly",
        "Do not fly",
        'id="gains-table"',
    ):
        assert absent not in page, absent
    for target in ("checks", "twin", "campaign", "again", "crosscorrelation"):
        assert f'href="#{target}"' in page and f'id="{target}"' in page


@pytest.mark.parametrize("size", SIZES)
def test_the_page_opens_without_a_complaint_and_keeps_nobody_out(folder, done, size):
    with browser() as chromium, opened(chromium, folder / "logs.html", size) as (page, said):
        kept(page, f"logs-{size}")
        assert said == [] and serious(page) == []
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1]


def test_without_a_log_held_out_the_page_does_not_say_to_trust_it(folder):
    pytest.importorskip("jinja2", reason="twinloop[report] is not installed")
    page = folder / "all.html"
    assert identified(folder, "--report", str(page)).exit_code == 0
    assert "Do not trust it" in page.read_text()
    # Logs have no target: what is said of a point says which.
    assert "Poles of the twin in the middle of the envelope" in page.read_text()
    assert "at the target" not in page.read_text().partition("Poles of the twin")[2].partition("</table>")[0]


def test_a_log_that_cannot_be_learnt_names_itself_and_what_to_do(folder):
    lines = (folder / "0.csv").read_text().splitlines()
    (folder / "gap.csv").write_text("\n".join(lines[:20] + lines[24:]))
    refused = identified(folder, logs=("gap.csv",))
    assert refused.exit_code == 2 and "gap.csv" in refused.stderr and "twinloop check" in refused.stderr


def test_misuse_is_refused_before_any_work(folder):
    for more, logs, words in (
        ((), (), "at least one log"),
        (("-o", str(folder / "twin.txt")), ("0.csv",), ".json"),
        ((), ("none.csv",), "check its name"),
    ):
        refused = identified(folder, *more, logs=logs)
        assert refused.exit_code == 2 and words in refused.stderr
    missing = invoke("identify", str(folder / "0.csv"))
    assert missing.exit_code == 2 and "--config" in missing.stderr


def held_up(seed):
    """What a controller records that holds a pendulum up, while it is pushed."""
    stream, dt = np.random.default_rng(seed), 0.05
    pushes = np.repeat(stream.uniform(-0.3, 0.3, 60), 4)
    state, states, commands = np.array([0.1, 0.0]), [], []
    for push in pushes:
        states.append(state + stream.normal(size=2) * [1e-3, 5e-3])
        commands.append(np.clip(-4.0 * states[-1][0] - 1.2 * states[-1][1] + push, -2.0, 2.0))
        for _ in range(50):
            state = state + dt / 50 * np.array([state[1], 8.0 * np.sin(state[0]) + 4.0 * commands[-1]])
    return np.array([*states, state]), np.array(commands)


def test_logs_of_an_unstable_system_are_judged_in_pieces_and_its_twin_is_written(folder):
    for number in (3, 4):
        states, commands = held_up(number)
        names = dict(zip(("angle", "rate"), states.T, strict=True))
        t = 0.05 * np.arange(len(states))
        write_columns(
            folder / f"{number}.csv", {"t": t, **names, "torque": np.append(commands, commands[-1])}
        )
    done = identified(
        folder, "--held-out", str(folder / "4.csv"), "-o", str(folder / "up.json"), "--json", logs=("3.csv",)
    )
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["follows"] and all(0.5 <= log["piece"] < 0.5 * log["seconds"] for log in found["logs"])
    assert all(fit > 70.0 for log in found["logs"] for fit in log["fit"].values())
    assert "the free run begins again at a reading every" in identified(folder, logs=("3.csv",)).stdout


def test_a_page_of_logs_followed_in_pieces_says_so_and_its_lines_break_there():
    runs = [
        tl.Trajectory(0.05 * np.arange(len(states)), states, commands[:, np.newaxis])
        for states, commands in (held_up(3), held_up(4))
    ]
    _, campaign = learnt_from_logs(
        runs[:1], SIGNALS, runs[1:], logs=["a.csv", "b.csv"], options={"committee_size": 4}, threads=1
    )
    found = campaign.examine()
    (flight,), (_, held_out) = found.unseen, found.beside
    steps = flight.flown.steps
    assert flight.piece == held_out.piece < steps
    every = f"begins again at a reading every {two_digits(0.05 * flight.piece)} s"
    figure = unseen(found)
    assert every in figure.caption and "no later one was used" not in figure.caption
    assert "Where a line breaks, the free run begins again at a reading" in flights(found).caption
    for state, panel in enumerate(figure.panels):
        (line,) = (mark for mark in panel.marks if isinstance(mark, Line) and mark.role == "twin")
        (gaps,) = np.nonzero(np.isnan(line.y))
        begun = np.arange(flight.piece, steps, flight.piece)
        assert line.x[gaps] == pytest.approx(0.05 * begun)
        assert line.y[gaps + 1] == pytest.approx(runs[1].states[begun, state])  # from the reading
        assert line.y[gaps - 1] == pytest.approx(flight.predicted.states[begun, state])  # as far as it came


def test_a_log_of_an_unstable_system_that_was_held_out_is_foretold_in_pieces():
    learnt, apart = (
        tl.Trajectory(0.05 * np.arange(len(states)), states, commands[:, np.newaxis])
        for states, commands in (held_up(3), held_up(4))
    )
    _, campaign = learnt_from_logs([learnt], SIGNALS, [apart], options={"committee_size": 4}, threads=1)
    (flight,) = campaign.examine().unseen
    assert flight.error < 0.1 and all(flight.fit > 70.0) and flight.inside > 0.75

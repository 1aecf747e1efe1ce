"""Sweeps: all combinations, the same bits on any cluster, whatever dies meanwhile; what is kept is not flown again."""

import json
import math
import os
import re
import shutil
import signal
import sqlite3
import statistics
import subprocess
import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from command import hearing_ctrl_c, invoke
from lives import plain
from twinloop.sweep import crossed, sweep
from twinloop.sweep.jobs import Job, system_of
from twinloop.sweep.summary import _quartiles, summarised
from twinloop.sweep.workers import finished

SMALL = {"model_population": ["20"], "model_generations": ["5", "10"], "test_population": ["10"],
         "test_generations": ["3"], "committee_size": ["5"], "mutants": ["3"]}  # fmt: skip


def small(seeds=range(2), **changes):
    options = {**SMALL, **changes}
    return crossed(["quadrotor:noise=0.001"], seeds, presets=["paper"], options=options, experiments=2)


def records(outcomes):
    return {outcome.job.name: plain(outcome.campaign) for outcome in outcomes}


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweep") / "sweep.db"
    return path, list(sweep(small(), path))


def test_every_combination_is_a_job_of_its_own():
    jobs = crossed(
        ["quadrotor", "quadrotor:harsh"], [3, 4], options={"moves": ["100", "200"], "lags": ["false"]}
    )
    assert len(jobs) == 8 == len({job.name for job in jobs})
    assert [job.seed for job in jobs[:4]] == [3, 4, 3, 4]
    assert jobs[0].values() == {"moves": 100, "lags": False}


def test_a_job_is_the_campaign_that_one_would_make_by_hand(here):
    _, outcomes = here
    job, campaign = outcomes[0].job, outcomes[0].campaign
    rig = tl.systems.Quadrotor(noise=1e-3, seed=0)
    mine = tl.Campaign(
        rig.signals, controller=rig.controller, initial_state=rig.initial_state, target_state=rig.target_state,
        duration=rig.duration, preset="paper", seed=0, options=job.values(),
    ).run(rig, 2)  # fmt: skip
    mine.best_test  # noqa: B018 - learns the last flight, as a sweep does
    assert plain(mine) == plain(campaign)


def test_a_campaign_of_a_built_in_system_knows_it_and_goes_on_with_the_same_bits(here, tmp_path):
    path, outcomes = here
    job = outcomes[0].job
    shutil.copy(path, tmp_path / "own.db")
    store = str(tmp_path / "own.db")
    shown = json.loads(invoke("show", store, "--name", job.name, "--json").stdout)
    assert shown["result"]["system"]["name"] == "quadrotor" and shown["result"]["system"]["noise"] == 1e-3
    gone_on = invoke("resume", store, "--name", job.name, "--experiments", "3")
    assert gone_on.exit_code == 0, gone_on.output
    rig = tl.systems.Quadrotor(noise=1e-3, seed=0)
    mine = tl.Campaign(
        rig.signals, controller=rig.controller, initial_state=rig.initial_state, target_state=rig.target_state,
        duration=rig.duration, preset="paper", seed=0, options=job.values(),
    ).run(rig, 2).run(rig, 3)  # fmt: skip
    theirs = tl.Campaign.load(store, job.name, read_only=True)
    assert len(theirs.experiments) == 3
    for one, other in zip(mine.experiments, theirs.experiments, strict=True):
        assert one.trajectory.states.tobytes() == other.trajectory.states.tobytes()


def test_what_is_kept_is_not_flown_again(here, monkeypatch):
    path, outcomes = here
    monkeypatch.setattr("twinloop.sweep.campaigns.fly", lambda *_, **__: pytest.fail("flown again"))
    again = list(sweep(small(), path))
    assert records(again) == records(outcomes)
    assert all(outcome.seconds is None for outcome in again)


def test_a_sweep_that_was_interrupted_goes_on_where_it_was(here, tmp_path):
    _, outcomes = here
    running = sweep(small(), tmp_path / "half.db")
    for _ in range(2):
        next(running)
    running.close()
    rest = list(sweep(small(), tmp_path / "half.db"))
    assert [outcome.seconds is None for outcome in rest] == [True, True, False, False]
    assert records(rest) == records(outcomes)


def test_another_setup_in_the_store_is_refused(here):
    path, _ = here
    longer = [Job(job.system, job.preset, job.seed, job.options, 3) for job in small()]
    with pytest.raises(tl.InvalidInput, match="3 experiments, found 2"):
        list(sweep(longer, path))


def test_a_finished_campaign_of_an_earlier_version_is_not_flown_again(here, tmp_path, monkeypatch):
    """It had no option that was added since; the default of that is what it flew with."""
    path, outcomes = here
    earlier = shutil.copy(path, tmp_path)
    with closing(sqlite3.connect(earlier)) as base:
        for identity, text in base.execute("select id, setup from campaigns").fetchall():
            setup = json.loads(text)
            del setup["options"]["mutant_step"]
            base.execute("update campaigns set setup = ? where id = ?", (json.dumps(setup), identity))
        base.commit()
    monkeypatch.setattr("twinloop.sweep.campaigns.fly", lambda *_, **__: pytest.fail("flown again"))
    assert records(sweep(small(), earlier)) == records(outcomes)


def test_a_campaign_of_another_setup_under_the_name_of_a_job_is_refused(here, tmp_path):
    _, outcomes = here
    outcomes[0].campaign.save(tmp_path / "other.db", outcomes[1].job.name)
    with pytest.raises(tl.InvalidInput, match=r"of this sweep, found another: .* in the store, .* now"):
        list(sweep([outcomes[1].job], tmp_path / "other.db"))


def test_a_cluster_gives_the_same_bits_though_a_worker_is_killed(here, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the extra cluster")
    _, outcomes = here
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=50,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        killer = threading.Timer(0.3, os.kill, (pids[0], signal.SIGKILL))
        killer.start()
        assert records(sweep(small(), tmp_path / "cluster.db", client)) == records(outcomes)
        killer.join()
        # The one that died was replaced by another process, and so it was not there for nothing.
        client.wait_for_workers(2, timeout=30)
        assert set(client.run(os.getpid).values()) != set(pids)
        # By its address, as the verb names it, and in part done before.
        address, path = cluster.scheduler_address, tmp_path / "address.db"
        assert address.startswith("tcp://127.0.0.1:")
        list(sweep(small()[:1], path, address))
        assert records(sweep(small(), path, address)) == records(outcomes)


def test_a_job_that_fails_is_said_and_the_others_go_on(tmp_path, monkeypatch):
    def broken(job, threads=None):
        from twinloop.sweep.flying import Flown, fly

        return Flown(None, "the motor cut out", 0.1) if job.seed == 0 else fly(job, threads)

    monkeypatch.setattr("twinloop.sweep.campaigns.fly", broken)
    outcomes = list(sweep(small(model_generations=["5"]), tmp_path / "broken.db"))
    assert [outcome.failure for outcome in outcomes] == ["the motor cut out", None]
    (row,) = summarised(outcomes)
    assert (row["campaigns"], row["failed"]) == (1, 1)


FAILING = """
import twinloop as tl

class Rig(tl.systems.Quadrotor):
    def run(self, test):
        failure = {1: RuntimeError("the fuse blew"), 2: OSError("no answer from the port"), 9: KeyboardInterrupt()}
        if self.seed in failure:
            raise failure[self.seed]
        return super().run(test)

def rig(seed):
    if seed == 0:
        raise OSError("no such port")
    if seed == 4:
        raise ValueError("no such valve")
    made = Rig(noise=1e-3, seed=seed)
    made.seed = seed
    return made
"""


def flown_by_failing(tmp_path, monkeypatch, *words):
    (tmp_path / "failing.py").write_text(FAILING)
    monkeypatch.syspath_prepend(tmp_path)
    changed = [word for name, values in SMALL.items() for word in ("--vary", f"{name}={values[0]}")]
    store = str(tmp_path / "failing.db")
    words = (*words, "--experiments", "1", "--presets", "paper", *changed, "--store", store)
    return invoke("sweep", "failing:rig", *words)


@pytest.mark.parametrize("cluster", ["here", "local:1"])
def test_whatever_a_system_raises_is_said_of_its_seed_and_the_others_are_flown(
    tmp_path, monkeypatch, cluster
):
    if cluster != "here":
        pytest.importorskip("distributed", reason="needs the extra cluster")
    done = flown_by_failing(tmp_path, monkeypatch, "--seeds", "0:5", "--cluster", cluster)
    assert done.exit_code == 1 and isinstance(done.exception, SystemExit)
    failed = [line.rpartition("seed ")[2] for line in done.stderr.splitlines() if line.startswith("Failed: ")]
    assert sorted(failed) == [
        "0: OSError: no such port",
        "1: RuntimeError: the fuse blew",
        "2: OSError: no answer from the port",
        "4: ValueError: no such valve",
    ]
    row = next(line for line in done.stdout.splitlines() if line.startswith("failing:rig"))
    assert re.search(r" +1 +4 +\d", row), "one was flown, four failed"
    with closing(sqlite3.connect(tmp_path / "failing.db")) as base:
        ((name,),) = base.execute("select name from campaigns").fetchall()
    assert name.endswith("seed 3")


def test_ctrl_c_while_a_system_runs_stops_the_sweep(tmp_path, monkeypatch):
    done = flown_by_failing(tmp_path, monkeypatch, "--seeds", "9:12")
    assert done.exit_code == 130 and "10" not in done.stderr


def test_a_system_that_cannot_be_made_any_more_does_not_end_a_sweep_that_is_half_stored(
    tmp_path, monkeypatch
):
    assert flown_by_failing(tmp_path, monkeypatch, "--seeds", "3").exit_code == 0
    monkeypatch.setattr("failing.rig", lambda seed: 1 / 0 if seed == 3 else Rig(seed))
    from failing import Rig

    done = flown_by_failing(tmp_path, monkeypatch, "--seeds", "3:4")
    assert done.exit_code == 1 and "seed 3: ZeroDivisionError" in done.stderr


def test_quartiles_are_those_of_the_campaigns(here):
    _, outcomes = here
    rows = {row["group"]: row for row in summarised(outcomes)}
    assert len(rows) == 2
    for group, row in rows.items():
        best = sorted(
            min(run.quality for run in outcome.campaign.experiments if run.kept_envelope)
            for outcome in outcomes
            if outcome.job.group == group
        )
        assert row["best"] == pytest.approx(np.quantile(best, [0.25, 0.5, 0.75]))
        assert row["left"] == sum(
            run.left_envelope for o in outcomes if o.job.group == group for run in o.campaign.experiments
        )


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=9), st.integers(0, 9))
def test_quartiles_are_those_of_numpy_also_where_some_twins_diverged(values, diverged):
    assert _quartiles(values) == pytest.approx(np.quantile(values, [0.25, 0.5, 0.75]).tolist())
    found = sorted(values) + [math.inf] * diverged
    low, high = found[(len(found) - 1) // 2], found[len(found) // 2]
    assert _quartiles([None, *found])[1] == pytest.approx(statistics.median([low, high]))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("quadrotr", "did you mean 'quadrotor'"),
        ("quadrotor:noise=much", "expected a number"),
        ("quadrotor:drag=1", "noise=NUMBER or harsh"),
        ("no_such_module:rig", "No module"),
        ("twinloop:Signals", "function of seed"),
        ("json:dumps", "function of seed"),
        ("lives:PLANT", "found none of controller"),
    ],
)
def test_a_system_that_cannot_be_flown_is_refused(text, word):
    with pytest.raises(tl.InvalidInput, match=word):
        system_of(text, 0)


@pytest.mark.parametrize("cluster", ["local", "local:0", "local:many", "local:2000"])
def test_a_cluster_that_is_none_is_refused(cluster):
    with pytest.raises(tl.InvalidInput, match="local:N"):
        list(finished(len, ["a"], cluster))


def test_the_verb_prints_a_table_and_json(tmp_path):
    store = str(tmp_path / "verb.db")
    words = [
        "sweep",
        "quadrotor",
        "--presets",
        "paper",
        "--seeds",
        "0:2",
        "--experiments",
        "2",
        "--store",
        store,
    ]
    for name, values in SMALL.items():
        words += ["--vary", f"{name}={values[0]}"]
    first = invoke(*words)
    assert first.exit_code == 0 and "error before learning" in first.stdout
    (row,) = json.loads(invoke(*words, "--json").stdout)["groups"]
    assert row["campaigns"] == 2 and row["failed"] == 0 and row["seconds"] is None


@pytest.mark.parametrize(
    "words", [("--seeds", "a"), ("--seeds", "3:1"), ("--vary", "moves"), ("--vary", "mooves=1")]
)
def test_misuse_of_the_verb_is_one_sentence(words):
    answer = invoke("sweep", "quadrotor", *words)
    assert isinstance(answer.exception, tl.InvalidInput) or answer.exit_code == 2


WORKER = """
import os, time
from twinloop.sweep.workers import finished

def work(seconds):
    print(os.getpid(), flush=True)
    time.sleep(seconds)

if __name__ == "__main__":
    list(finished(work, [600.0], "local:1"))
"""


def test_a_worker_does_not_outlive_the_process_that_asked_for_it(tmp_path):
    script = tmp_path / "sweeping.py"
    script.write_text(WORKER)
    process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert int(process.stdout.readline()) != process.pid
    process.kill()
    # The worker has the same standard output: it is closed only once both are gone.
    assert process.communicate(timeout=60)[0] == b""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs masks of signals")
def test_ctrl_c_is_one_sentence_and_none_of_the_workers(tmp_path):
    """A terminal sends it to all processes, as here."""
    psutil = pytest.importorskip("psutil", reason="needs the extra cluster")  # distributed brings it
    words = ["sweep", "quadrotor", "--seeds", "0:3", "--experiments", "8", "--cluster", "local:2"]
    process = subprocess.Popen(
        [sys.executable, "-m", "twinloop", *words, "--store", str(tmp_path / "sweep.db")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=hearing_ctrl_c,
    )  # fmt: skip
    tracker_and_workers = 3
    for _ in range(600):
        children = psutil.Process(process.pid).children()
        if len(children) >= tracker_and_workers:
            break
        time.sleep(0.1)
    assert len(children) >= tracker_and_workers
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 130
    assert said.startswith("Interrupted: what was finished") and said.count("\n") == 1


@pytest.mark.parametrize("stopped", [False, True])
def test_no_password_is_printed(monkeypatch, stopped):
    def flown(jobs, store, cluster):
        if stopped:
            raise KeyboardInterrupt
        return iter(())

    monkeypatch.setattr("twinloop.sweep.command.fly_all", flown)
    done = invoke("sweep", "quadrotor", "--store", "postgresql://me:s3cret@h/db", "--json")
    assert done.exit_code == (130 if stopped else 0)
    assert "postgresql://me:***@h/db" in done.output and "s3cret" not in done.output

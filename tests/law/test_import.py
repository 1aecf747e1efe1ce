"""A twin that an earlier version saved loads in this one, in another process, and gives the same numbers to the bit.

For each version of the records a file is added, and never changed: `write(folder)` below, run at that version.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import twinloop as tl
from law_twins import SIGNALS, TWINS, stored_twin
from twinloop.law.accuracy import TestErrors
from twinloop.law.noise import CorrelatedDisturbance, Noise
from twinloop.remarks import note

FOLDER = Path(__file__).parent / "twins"
SAVED = sorted(FOLDER.glob("*.json"))
STEPS = 12
RUN = """
import json, sys, twinloop as tl
saved = json.load(open(sys.argv[1], encoding="utf-8"))
open(sys.argv[2], "w", encoding="utf-8").write(saved["twin"])
twin = tl.load_twin(sys.argv[2])
given = [[float.fromhex(v) for v in row] for row in [saved["start"], *saved["commands"]]]
run = twin.simulate_commands(given[0], given[1:])
found = {"states": run.true_states, "readings": run.states}
found = {name: [[v.hex() for v in row] for row in rows.tolist()] for name, rows in found.items()}
print(json.dumps({**found, "equations": twin.equations(17)}))
"""


def write(folder=FOLDER):
    """Saves twins of all kinds with the records at hand, and what they simulate."""
    hidden, body = TWINS["actuators and hidden states"], TWINS["kinematics"]
    for make, name in ((hidden, "hidden"), (body, "body"), (stored_twin, "stored")):
        bare = make()
        low, high = np.array([command.bounds for command in bare.signals.commands]).T
        shares = np.modf(0.3819660112501051 * np.arange(1, STEPS * len(low) + 1))[0].reshape(STEPS, -1)
        run = bare.simulate_commands(np.full(bare.signals.n_x, 0.125), low + (high - low) * shares)
        noise = Noise(
            np.full(bare.signals.n_x, 1e-3),
            np.zeros(bare.signals.n_x),
            (CorrelatedDisturbance((1, 0), "acceleration", 0.1, 0.3),) if bare.signals is SIGNALS else (),
            0.05,
        )
        twin = tl.Twin(
            bare.model, bare.signals, [TestErrors(0, 1e-5, 2e-5, 0.01, None, 2e-5)], members=[bare.model],
            noise=noise, seed=3, inflation=1.5, flights=[run], remarks=[note("form", "The form was searched.")],
        )  # fmt: skip
        rows = {"commands": run.commands, "states": run.true_states, "readings": run.states}
        saved = {
            "twin": twin.export("json"),
            "start": [value.hex() for value in run.true_states[0].tolist()],
            **{
                key: [[value.hex() for value in row] for row in table.tolist()] for key, table in rows.items()
            },
            "equations": twin.equations(17),
        }
        text = json.dumps(saved, indent=1) + "\n"
        (folder / f"version-{tl.Twin.VERSION}-{name}.json").write_text(text, encoding="utf-8")


def test_the_records_at_hand_are_kept_for_later_versions():
    assert {f"version-{tl.Twin.VERSION}-{name}" for name in ("hidden", "body", "stored")} <= {
        path.stem for path in SAVED
    }


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_a_twin_of_an_earlier_version_gives_the_same_numbers_in_another_process(path, tmp_path):
    saved = json.loads(path.read_text(encoding="utf-8"))
    done = subprocess.run(
        [sys.executable, "-c", RUN, path, tmp_path / "twin.json"], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    assert len(found["states"]) == STEPS + 1
    # The legend's words change from version to version; the equations do not.
    for each in (found, saved):
        each["equations"] = each.get("equations", "").partition("\n\n")[2]
    for name in found.keys() & saved.keys():
        assert found[name] == saved[name], name


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_all_of_it_comes_back(path, tmp_path):
    saved = json.loads(path.read_text(encoding="utf-8"))
    (tmp_path / "twin.json").write_text(saved["twin"], encoding="utf-8")
    twin = tl.load_twin(tmp_path / "twin.json")
    assert len(twin.members) == len(twin.flights) == 1 and twin.noise is not None
    assert (twin.seed, twin.inflation, twin.errors[0].closed_loop) == (3, 1.5, 2e-5)
    again = twin.export("json")
    if path.stem.startswith(f"version-{tl.Twin.VERSION}-"):
        assert again == saved["twin"]  # nothing was lost on the way
        assert [remark.code for remark in twin.remarks] == ["form"]
    (tmp_path / "again.json").write_text(again, encoding="utf-8")
    assert tl.load_twin(tmp_path / "again.json").export("json") == again


def test_a_newer_record_is_refused_with_a_sentence(tmp_path):
    record = json.loads(json.loads(SAVED[0].read_text(encoding="utf-8"))["twin"])
    (tmp_path / "twin.json").write_text(json.dumps({**record, "version": 99}), encoding="utf-8")
    with pytest.raises(tl.InvalidInput, match="99"):
        tl.load_twin(tmp_path / "twin.json")


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda record: record.update(inflation="inf"), "twin.inflation"),
        (lambda record: record["noise"]["sensors"].__setitem__(0, "nan"), "twin.noise.sensors"),
    ],
)
def test_a_band_that_cannot_be_drawn_is_refused_by_its_place(tmp_path, change, place):
    record = json.loads(json.loads(SAVED[0].read_text(encoding="utf-8"))["twin"])
    change(record)
    (tmp_path / "twin.json").write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(tl.InvalidInput, match=rf"Record {place}: expected"):
        tl.load_twin(tmp_path / "twin.json")


@pytest.mark.parametrize("path", SAVED, ids=lambda path: path.stem)
def test_a_record_has_the_factor_of_divergence_of_which_limits_are_made(path, tmp_path):
    record = json.loads(json.loads(path.read_text(encoding="utf-8"))["twin"])
    (tmp_path / "twin.json").write_text(json.dumps({**record, "divergence_factor": 3.5}), encoding="utf-8")
    twin = tl.load_twin(tmp_path / "twin.json")
    for i, state in enumerate(twin.signals.states):
        assert twin.limits.states[i] == (np.inf if state.periodic else 3.5 * state.scale)
    assert twin.to_record()["divergence_factor"] == 3.5


def test_limits_of_other_signals_are_refused(pendulum_signals, quadrotor):
    model = tl._core.Model(tl._core.Grammar(3, 1).random(0)[0], "acceleration", pendulum_signals.engine)
    with pytest.raises(tl.InvalidInput, match="limits"):
        tl.Twin(model, pendulum_signals, limits=tl.Limits(quadrotor.signals))

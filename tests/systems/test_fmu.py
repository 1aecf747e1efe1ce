"""An FMU as the plant: it moves as its source says, begins where it can, and is refused if it is something else."""

import copy
import gc
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import twinloop as tl
from conftest import PENDULUM_GAINS, pendulum_step
from oracles import same_bits
from twinloop.contracts import check_system
from twinloop.systems import fmu

pytest.importorskip("fmpy", reason="needs pip install 'twinloop[fmu]'")
pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or shutil.which("cc") is None, reason="needs Linux and a C compiler"
)

VARIABLES = (
    ("angle", "output", "continuous", "exact", "Real", 0),
    ("rate", "output", "continuous", "calculated", "Real", None),
    ("motor", "input", "continuous", None, "Real", 0),
    ("friction", "parameter", "fixed", "exact", "Real", 0.05),
    ("rate_0", "parameter", "fixed", "exact", "Real", 0),
    ("count", "output", "discrete", "exact", "Integer", 0),
)


def described(kind="CoSimulation"):
    rows = []
    for i, (name, causality, variability, initial, of, start) in enumerate(VARIABLES):
        optional = "" if initial is None else f' initial="{initial}"'
        value = "" if start is None else f' start="{start}"'
        rows.append(
            f'<ScalarVariable name="{name}" valueReference="{i}" causality="{causality}"'
            f' variability="{variability}"{optional}><{of}{value}/></ScalarVariable>'
        )
    outputs = "".join(f'<Unknown index="{i}"/>' for i in (1, 2, 6))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="rig" guid="1">'
        f'<{kind} modelIdentifier="rig"/><ModelVariables>{"".join(rows)}</ModelVariables>'
        f"<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmu")
    binary = folder / "rig.so"
    source = Path(__file__).with_name("rig.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", binary, source, "-lm"], check=True)
    assert platform.machine() == "x86_64", "another folder of binaries"
    with zipfile.ZipFile(folder / "rig.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", described())
        packed.write(binary, "binaries/linux64/rig.so")
    return folder / "rig.fmu"


@pytest.fixture
def make(path, pendulum_signals):
    def of(**changes):
        chosen = {"commands": {"torque": "motor"}, "default_gains": PENDULUM_GAINS, **changes}
        return tl.systems.FMU(path, pendulum_signals, **chosen)

    return of


@pytest.fixture
def test(pendulum_signals, pendulum_controller):
    family = pendulum_controller.bind(pendulum_signals)
    return tl.Test(family, family.genes(PENDULUM_GAINS), np.array([0.2, 0.5]), np.array([1.0, 0.0]), 30)


def test_it_flies_as_the_same_equations_in_python(make, test, pendulum_signals):
    run = make(start={"angle": "angle", "rate": "rate_0"}).run(test)
    plain = tl.systems.Simulated(pendulum_signals, pendulum_step).run(test)
    np.testing.assert_allclose(run.states, plain.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(run.commands, plain.commands, rtol=1e-12)


def test_a_state_that_cannot_be_set_begins_where_it_does(make, test):
    run = make().run(test)
    np.testing.assert_array_equal(run.states[0], [0.2, 0.0])
    slow = make(parameters={"friction": 2.0}).run(test)
    assert np.abs(slow.states[:, 1]).max() < 0.5 * np.abs(run.states[:, 1]).max()


def test_it_keeps_to_the_contract_with_a_fresh_instance_each_run(make, test, pendulum_controller):
    check_system(make(), pendulum_controller)
    system = make(noise=0.01)
    one, two = system.run(test), system.run(test)
    assert not same_bits(one.states, two.states)
    np.testing.assert_array_equal(one.true_states[0], two.true_states[0])


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_flies_on_when_the_first_is_gone(make, test, copied):
    system, expected = make(noise=0.01), make(noise=0.01)
    for each in (system, expected):
        each.run(test)
    other = copied(system)
    del system
    gc.collect()
    assert same_bits(other.run(test).states, expected.run(test).states)


def test_a_step_that_fails_is_said_and_the_next_run_is_well(
    make, test, pendulum_signals, pendulum_controller
):
    system = make(start={"angle": "angle", "rate": "rate_0"})
    family = pendulum_controller.bind(pendulum_signals)
    far = tl.Test(family, family.genes(PENDULUM_GAINS), np.array([2.4, 6.0]), np.zeros(2), 30)
    with pytest.raises(tl.SystemFailure, match=r"failed in step 1, 0\.05 s after the start"):
        system.run(far)
    assert system.run(test).ended == "completed" and system.runs == 1


def test_a_twin_that_was_exported_is_flown_like_the_twin(
    tmp_path, pendulum, pendulum_signals, pendulum_controller
):
    campaign = tl.Campaign(
        pendulum_signals,
        controller=pendulum_controller,
        initial_state=[0.0, 0.0],
        target_state=[1.0, 0.0],
        duration=1.0,
        threads=1,
        options={"offsets": False},  # a twin with a late sensor is read late, its FMU gives true states
    )
    campaign.run(pendulum, 1)
    campaign.twin.export(tmp_path / "twin.fmu")
    again = tl.systems.FMU(tmp_path / "twin.fmu", pendulum_signals).run(campaign.tests[0])
    np.testing.assert_allclose(again.states, campaign.twin.simulate(campaign.tests[0]).states, atol=1e-9)


def test_what_is_no_fmu_or_has_no_such_variable_is_refused(
    make, tmp_path, pendulum_signals, path, monkeypatch
):
    for changes, sentence in (
        ({"commands": {}}, "Unknown variable of the FMU for commands: 'torque'"),
        ({"commands": {"torqe": "motor"}}, "did you mean 'torque'"),
        ({"commands": {"torque": "angle"}}, "Unknown variable"),
        ({"states": {"rate": "rat"}}, "did you mean 'rate'"),
        ({"states": {"rate": "count"}}, "expected a real number"),
        ({"parameters": {"frictions": 1.0}}, "did you mean 'friction'"),
    ):
        with pytest.raises(tl.InvalidInput, match=sentence):
            make(**changes)
    for text, sentence in ((b"nothing", "expected an FMU"), (None, "expected a file")):
        other = tmp_path / "other.fmu"
        if text is not None:
            other.write_bytes(text)
        else:
            other.unlink()
        with pytest.raises(tl.InvalidInput, match=sentence):
            tl.systems.FMU(other, pendulum_signals)
    with monkeypatch.context() as small:
        small.setattr(fmu, "MOST_BYTES", 1000)
        with pytest.raises(tl.InvalidInput, match=r"expected at most 1000 bytes unpacked, found \d+"):
            make()
    bad = tmp_path / "bad.fmu"
    with zipfile.ZipFile(bad, "w") as packed:
        packed.writestr("modelDescription.xml", described())
        packed.writestr("../outside", "x")
    with pytest.raises(tl.InvalidInput, match="names of files inside"):
        tl.systems.FMU(bad, pendulum_signals)
    with zipfile.ZipFile(bad, "w") as packed:
        packed.writestr("modelDescription.xml", described("ModelExchange"))
    with pytest.raises(tl.InvalidInput, match="found model exchange"):
        tl.systems.FMU(bad, pendulum_signals)


def test_without_fmpy_it_says_what_to_install(monkeypatch, make):
    def absent(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr("importlib.import_module", absent)
    with pytest.raises(tl.NotAvailable, match=r"twinloop\[fmu\]"):
        make()

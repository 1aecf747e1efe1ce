"""An FMU gives the twin's numbers where others load it: FMPy reads its description and simulates with its binary."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest

import twinloop as tl
from law_twins import ALL, SIGNALS, TWINS, flown, twin_of
from twinloop.errors import NotAvailable

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
BOTH = pytest.mark.parametrize("kind", ["fmu3", "fmu2"])


def driven_by(signals, commands):
    """Commands as FMPy takes them."""
    names = signals.command_names
    rows = np.zeros(len(commands) + 1, dtype=[("time", float), *((name, float) for name in names)])
    rows["time"] = signals.dt * np.arange(len(commands) + 1)
    for i, name in enumerate(names):
        rows[name] = np.append(commands[:, i], commands[-1, i])
    return rows


@ALL
@BOTH
def test_fmpy_finds_no_fault_and_simulates_what_the_twin_does(which, kind, tmp_path):
    twin = TWINS[which]()
    (path,) = twin.export(tmp_path / "my rig.fmu", kind=kind)
    assert validation.validate_fmu(path) == []
    flight = flown(twin, seed=7)
    names, commands = twin.signals.state_names, 2.0 * flight.commands  # beyond the bounds as well
    expected = twin.simulate_commands(flight.states[0], commands).true_states
    run = fmpy.simulate_fmu(
        path,
        stop_time=twin.signals.dt * (len(expected) - 1),
        step_size=twin.signals.dt,
        output_interval=twin.signals.dt,
        input=driven_by(twin.signals, commands),
        start_values=dict(zip(names, flight.states[0].tolist(), strict=True)),
        output=list(names),
    )
    found = np.column_stack([run[name] for name in names])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


class Unit:
    """An FMU's instance, the same for both versions of FMI."""

    def __init__(self, path, folder):
        self.third = fmpy.read_model_description(path).fmiVersion.startswith("3")
        unzipped = fmpy.extract(path, folder)
        self.description = fmpy.read_model_description(unzipped)
        self.numbers = {v.name: v.valueReference for v in self.description.modelVariables}
        self.unit = fmpy.instantiate_fmu(unzipped, self.description, "CoSimulation")

    def begin(self, **start):
        if self.third:
            self.unit.enterInitializationMode(startTime=0.0)
        else:
            self.unit.setupExperiment(startTime=0.0)
            self.unit.enterInitializationMode()
        self.set(**start)
        self.unit.exitInitializationMode()

    def set(self, **values):
        write = self.unit.setFloat64 if self.third else self.unit.setReal
        write([self.numbers[name] for name in values], list(values.values()))

    def get(self, *names):
        read = self.unit.getFloat64 if self.third else self.unit.getReal
        return list(read([self.numbers[name] for name in names]))

    def run(self, commands, first=0):
        dt = SIGNALS.dt
        rows = []
        for k, (torque, fan) in enumerate(commands.tolist(), start=first):
            self.set(torque=torque, fan=fan)
            self.unit.doStep(currentCommunicationPoint=k * dt, communicationStepSize=dt)
            rows.append(self.get("angle", "rate", "hidden"))
        return np.array(rows)

    def state(self):
        return self.unit.getFMUState() if self.third else self.unit.getFMUstate()

    def restore(self, state):
        (self.unit.setFMUState if self.third else self.unit.setFMUstate)(state)

    def as_bytes(self, state):
        return self.unit.serializeFMUState(state) if self.third else self.unit.serializeFMUstate(state)

    def from_bytes(self, raw):
        return self.unit.deserializeFMUState(raw) if self.third else self.unit.deSerializeFMUstate(raw)


@pytest.fixture
def lagging(request, tmp_path):
    def made(kind):
        twin = TWINS["actuators and hidden states"]()
        (path,) = twin.export(tmp_path / "lagging.fmu", kind=kind)
        return twin, Unit(path, tmp_path / "unzipped")

    return made


@BOTH
def test_a_state_of_the_fmu_holds_lags_delays_and_hidden_states(kind, lagging):
    twin, unit = lagging(kind)
    commands = flown(twin, seed=3).commands
    unit.begin(angle=0.1, rate=-0.2)
    unit.run(commands[:20])
    kept = unit.state()
    raw = unit.as_bytes(kept)
    expected = unit.run(commands[20:], first=20)
    assert abs(expected[:, 2]).max() > 0.0  # the hidden state moves
    for state in (kept, unit.from_bytes(raw)):
        unit.restore(state)
        np.testing.assert_array_equal(unit.run(commands[20:], first=20), expected)
    whole = twin.simulate_commands([0.1, -0.2], commands).true_states
    np.testing.assert_allclose(expected[:, :2], whole[21:], rtol=1e-9, atol=1e-9)


@BOTH
def test_a_reset_forgets_the_run(kind, lagging):
    twin, unit = lagging(kind)
    commands = flown(twin, seed=3).commands
    unit.begin(angle=0.1, rate=-0.2)
    expected = unit.run(commands)
    unit.unit.reset()
    unit.begin(angle=0.1, rate=-0.2)
    np.testing.assert_array_equal(unit.run(commands), expected)


@BOTH
def test_several_periods_are_one_step_under_the_same_commands(kind, lagging):
    twin, unit = lagging(kind)
    unit.begin(angle=0.1, rate=-0.2)
    unit.set(torque=0.5, fan=1.0)
    unit.unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=5 * SIGNALS.dt)
    expected = twin.simulate_commands([0.1, -0.2], np.tile([0.5, 1.0], (5, 1))).true_states[-1]
    np.testing.assert_allclose(unit.get("angle", "rate"), expected, rtol=1e-9)
    assert unit.get(unit.description.modelVariables[0].name) == [5 * SIGNALS.dt]


@BOTH
def test_what_an_fmu_cannot_do_it_refuses(kind, lagging):
    _, unit = lagging(kind)
    with pytest.raises(Exception, match="status 3"):
        unit.set(angle=np.nan)
    unit.begin(angle=0.1)
    for values in ({"angle": 0.2}, {"hidden": 0.0}, {"torque": np.inf}):
        with pytest.raises(Exception, match="status 3"):
            unit.set(**values)
    for step in (0.5, 1.5, 0.0, -1.0, np.nan):
        with pytest.raises(Exception, match="status 3"):
            unit.unit.doStep(currentCommunicationPoint=0.0, communicationStepSize=step * SIGNALS.dt)
    raw = unit.as_bytes(unit.state())
    with pytest.raises(Exception, match="status 3"):
        unit.from_bytes(raw[:-1])


@BOTH
def test_the_same_twin_gives_the_same_file(kind, tmp_path):
    made = []
    for number in range(2):
        (tmp_path / f"{number}").mkdir()
        (path,) = TWINS["kinematics"]().export(tmp_path / f"{number}" / "body.fmu", kind=kind)
        made.append(path.read_bytes())
    assert made[0] == made[1]


def test_its_sources_compile_under_a_name_of_ones_own_into_one_program(tmp_path):
    for name in ("one", "two"):
        (path,) = TWINS["acceleration"]().export(tmp_path / f"{name}.fmu")
        with zipfile.ZipFile(path) as archive:
            archive.extractall(tmp_path / name)
    objects = []
    for name in ("one", "two"):
        room = tmp_path / name / "sources"
        for file in ("fmi3-functions.c", f"{name}.c"):
            subprocess.run(
                ["cc", "-std=c99", "-c", f"-DFMI3_FUNCTION_PREFIX={name}_", "-o", f"{file}.o", file],
                cwd=room, check=True,
            )  # fmt: skip
            objects.append(room / f"{file}.o")
    main = tmp_path / "main.c"
    main.write_text(
        "const char *one_fmi3GetVersion(void), *two_fmi3GetVersion(void);\n"
        "int main(void) { return one_fmi3GetVersion()[0] - two_fmi3GetVersion()[0]; }\n"
    )
    subprocess.run(["cc", "-o", tmp_path / "both", main, *objects, "-lm"], check=True)
    assert subprocess.run([tmp_path / "both"]).returncode == 0


def test_units_that_would_break_the_description_do_not(tmp_path):
    hostile = tl.Signals(
        states=[
            tl.State("angle", 'rad" causality="input', 3.0),
            tl.State("rate", "</Unit>\n*/ #error \\\x00", 8.0, derivative_of="angle"),
        ],
        commands=[tl.Command("torque", "N&m", (-2.0, 2.0)), tl.Command("fan", "<V>", (0.0, 5.0))],
        dt=0.05,
    )
    twin = twin_of(["r4 = r2 * 11.0"], signals=hostile)
    for kind in ("fmu2", "fmu3"):
        (path,) = twin.export(tmp_path / "hostile.fmu", kind=kind)
        assert validation.validate_fmu(path) == []
        units = {v.name: v.unit for v in fmpy.read_model_description(path).modelVariables}
        assert units["angle"] == 'rad" causality="input' and units["rate"] == "</Unit> */ #error \\"


def test_fmu_alone_is_the_newer_version(tmp_path):
    twin = twin_of(["r4 = r2 * 11.0"])
    (path,) = twin.export(tmp_path / "twin.fmu", kind="fmu")
    assert fmpy.read_model_description(path).fmiVersion == "3.0"
    with pytest.raises(tl.InvalidInput, match="name a file"):
        twin.export("fmu")


def test_an_fmu_needs_a_path_a_compiler_and_double_precision(tmp_path, monkeypatch):
    twin = twin_of(["r4 = r2 * 11.0"])
    with pytest.raises(tl.InvalidInput, match="name a file"):
        twin.export("fmu3")
    with pytest.raises(tl.InvalidInput, match="double"):
        twin.export(tmp_path / "single.fmu", precision="float")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(NotAvailable, match="C compiler"):
        twin.export(tmp_path / "twin.fmu")
    assert not (tmp_path / "twin.fmu").exists()
    (path,) = twin.export(tmp_path / "twin.fmu", force=True)
    with zipfile.ZipFile(path) as archive:
        assert not any(file.startswith("binaries/") for file in archive.namelist())
        assert b"flights. Exported by force: its checks" in archive.read("modelDescription.xml")

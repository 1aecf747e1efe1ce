"""Which campaign of a store a person goes on with: the only one, or the named one, and never a second one unasked."""

import csv
import re
import shlex
import shutil
from pathlib import Path

import pytest

import twinloop as tl
from command import invoke
from lives import PLANT, SMALL
from twinloop.campaign.campaign_file import _toml, read_file, template
from twinloop.logs import write_columns

pytest.importorskip("sqlalchemy")

OPTIONS = "[options]\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in SMALL.items())
PENDULUM = template("rig.db").partition("[options]")[0]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A store with the campaign 'tank' of the file beside it: its first flight is recorded."""
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(PENDULUM + OPTIONS, encoding="utf-8")
    begun("tank")
    return tmp_path


def begun(name):
    campaign = read_file("rig.toml").campaign(store="rig.db", name=name, threads=1)
    first = campaign.test(read_file("rig.toml").first)
    campaign.tell(first, PLANT.run(first))
    campaign.close()


def names():
    return [line.split()[0] for line in invoke("show", "rig.db").stdout.splitlines()[2:]]


def look(name=None):
    return tl.Campaign.load("rig.db", name, read_only=True)


def flight(test, file="flight.csv"):
    run = PLANT.run(test)
    columns = {"t": run.t, "angle": run.states[:, 0], "rate": run.states[:, 1], "torque": run.commands[:, 0]}
    write_columns(Path(file), columns)
    return file


def test_the_only_campaign_of_a_store_is_gone_on_with_whatever_its_name(folder):
    asked = invoke("ask", "rig.db")
    assert asked.exit_code == 0 and asked.stdout.startswith("TEST 1 of rig.db"), asked.output
    told = invoke("tell", "rig.db", "1", flight(look().tests[1]))
    assert told.exit_code == 0 and "2 experiments in rig.db" in told.stdout
    assert invoke("ask", "rig.db", "--name", "tank").stdout.startswith("TEST 2 of rig.db")
    assert invoke("abandon", "rig.db", "2").exit_code == 0
    assert len(look().experiments) == 2 and look().status(look().tests[2]) == "abandoned"


def test_a_changed_file_begins_no_second_campaign_beside_a_named_one(folder):
    text = Path("rig.toml").read_text(encoding="utf-8")
    Path("rig.toml").write_text(text.replace("seed = 0", "seed = 1"), encoding="utf-8")
    refused = invoke("ask", "rig.db")
    assert refused.exit_code == 2 and "the campaign 'tank' as it was begun" in refused.stderr
    assert look().setup.seed == 0


def test_of_several_campaigns_one_has_to_be_named(folder):
    begun("wing")
    flight(look("wing").tests[0], "old.csv")
    commands = {
        "ask": ["ask", "rig.db"],
        "batch": ["ask", "rig.db", "--batch", "2"],
        "tell": ["tell", "rig.db", "0", "--failed", "motor"],
        "attach": ["attach", "rig.db", "old.csv"],
        "abandon": ["abandon", "rig.db", "0"],
    }
    for beside in (True, False):
        if not beside:
            shutil.move("rig.toml", "aside.toml")
        for command in commands.values():
            refused = invoke(*command)
            assert refused.exit_code == 2, command
            assert "it holds tank, wing. Choose one with --name" in refused.stderr, command
            unknown = invoke(*command, "--name", "tanks")
            assert unknown.exit_code == 2 and "did you mean 'tank'" in unknown.stderr, command
    assert names() == ["tank", "wing"]


def test_names_with_commas_are_told_apart_where_one_has_to_be_chosen(folder):
    begun("rotor, seed 0")
    begun("rotor, seed 1")
    for refused in (invoke("learn", "rig.db"), invoke("learn", "rig.db", "--name", "zzz")):
        assert refused.exit_code == 2
        assert "'tank', 'rotor, seed 0', 'rotor, seed 1'." in refused.stderr


def test_what_is_named_is_written_and_the_sheet_names_it_in_the_next_command(folder):
    begun("wing")
    asked = invoke("ask", "rig.db", "--name", "wing")
    assert asked.stdout.endswith("twinloop tell rig.db 1 FLIGHT.csv --name wing\n"), asked.output
    log = flight(look("wing").tests[1])
    assert invoke("tell", "rig.db", "1", log, "--name", "wing").exit_code == 0
    flight(look("wing").tests[0], "old.csv")
    assert "recorded already" in invoke("attach", "rig.db", "old.csv", "--name", "wing").stderr
    assert invoke("ask", "rig.db", "--name", "tank").exit_code == 0
    assert invoke("abandon", "rig.db", "1", "--name", "tank").exit_code == 0
    assert [len(look(name).experiments) for name in ("tank", "wing")] == [1, 2]


def test_a_first_campaign_has_the_name_that_it_is_given(folder):
    shutil.copy("rig.toml", "other.toml")
    assert invoke("ask", "other.db", "--name", "kite").exit_code == 0
    assert "campaign 'kite'" in invoke("show", "other.db").stdout


def added(file):
    with open(file, encoding="utf-8") as rows:
        return [float(row["excitation_torque"] or "nan") for row in csv.DictReader(rows)]


def test_each_campaign_of_a_store_writes_a_file_of_its_own_beside_it(folder):
    begun("my wing")
    sheets = {name: invoke("ask", "rig.db", "--name", name).stdout for name in ("tank", "my wing")}
    files = [file.name for file in folder.glob("rig-test-*.csv")]
    assert len(files) == 2 and "rig-test-1-of-tank.csv" in files
    other = next(file for file in files if "tank" not in file)
    assert other.startswith("rig-test-1-of-my-wing-")
    for name, file in (("tank", "rig-test-1-of-tank.csv"), ("my wing", other)):
        assert f"a row a period in {file}," in sheets[name]
        test = look(name).tests[1]
        assert test.excitation is not None and added(file)[:-1] == test.excitation[:, 0].tolist()


def test_every_command_that_is_advised_is_one_for_the_named_campaign(folder):
    """Each is typed as it is printed: it is refused, or of the other campaign, unless it names this one."""
    begun("my wing")
    name = ["--name", "my wing"]
    flight(look("my wing").tests[0], "old.csv")

    def advised(*words):
        said = "".join([(done := invoke(*words)).stdout, done.stderr])
        (found,) = re.findall("twinloop [a-z]+ rig.db.*", said)
        return shlex.split(found.rstrip("."))[1:]

    assert advised("show", "rig.db", *name) == ["learn", "rig.db", *name]
    assert advised("learn", "rig.db", *name) == ["show", "rig.db", *name]
    assert invoke(*advised("learn", "rig.db", *name)).exit_code == 0
    assert advised("tell", "rig.db", "0", "--failed", "motor", *name) == [
        *("withdraw", "rig.db", "0", "--reason", "WHY"), *name,
    ]  # fmt: skip
    taken = advised("withdraw", "rig.db", "0", "--reason", "degrees", *name)
    assert taken == ["tell", "rig.db", "0", "FLIGHT.csv", *name]
    assert invoke(*["old.csv" if word == "FLIGHT.csv" else word for word in taken]).exit_code == 0
    assert [len(look(each).experiments) for each in ("tank", "my wing")] == [1, 1]


def test_the_only_campaign_of_a_store_needs_no_name_in_a_command(folder):
    for words in (["learn", "rig.db"], ["learn", "rig.db", "--name", "tank"]):
        assert invoke(*words).stdout.endswith(": twinloop show rig.db\n")

"""The file of a test: each campaign of a store has its own, under a name that any folder takes."""

import pytest

from conftest import PENDULUM_GAINS
from lives import new
from twinloop.errors import InvalidInput
from twinloop.faces.columns import columns, columns_file, refuse_other
from twinloop.logs import write_columns
from twinloop.store import StoredAs

NAMES = [
    "tank", "Tank", "tank 2", "tank_2", "tank-2", "tank.2", "tank/2", "tank\\2", "../tank", "..", ".", "-", " ", "é",
    "e", "e\u0301", "Ü" * 200, "a" * 200, "a" * 199 + "b", "con:1", 'x"y', "a\nb", "--name", "a\0b", "火星",
]  # fmt: skip


@pytest.fixture(scope="module")
def test():
    campaign = new("default")
    campaign.test(PENDULUM_GAINS)
    return campaign.test(PENDULUM_GAINS)


def named(name, test):
    return columns_file(StoredAs("runs/rig.db", name), test)


def test_the_file_of_the_only_campaign_of_a_store_stands_beside_it(test):
    assert columns_file(StoredAs("runs/rig.db"), test).as_posix() == "runs/rig-test-1.csv"
    assert named("tank", test).as_posix() == "runs/rig-test-1-of-tank.csv"


def test_where_the_store_is_a_server_it_is_here_and_has_the_name_of_the_database(test):
    """Campaigns of two databases of a server may be flown from one folder."""

    def file(address, name=None):
        return columns_file(StoredAs(address, name), test).as_posix()

    assert file("postgresql://host/lab") == "lab-test-1.csv"
    assert file("postgresql+psycopg://me@host:5432/lab?sslmode=require", "tank") == "lab-test-1-of-tank.csv"
    assert file("postgresql://host") == file("postgresql://host/") == "campaign-test-1.csv"
    others = {file(f"postgresql://host/{name}") for name in ("Lab", "lab/2", "lab.2", "a" * 200)}
    assert len(others | {"lab-test-1.csv"}) == 5
    assert all("/" not in other and len(other) < 100 for other in others)


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_any_name_of_a_campaign_gives_a_file_in_the_folder_of_the_store(test, name):
    file = named(name, test)
    assert file.parent.as_posix() == "runs" and len(file.name) < 150
    kept = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")
    assert set(file.name.removesuffix(".csv")) <= kept


def test_no_two_campaigns_have_one_file_in_a_folder_without_upper_case_either(test):
    files = {named(name, test).name.lower() for name in NAMES}
    assert len(files) == len(NAMES)
    assert columns_file(StoredAs("runs/rig.db"), test).name not in files


def test_a_flight_under_the_name_of_a_tests_file_stays_and_columns_are_replaced(test, tmp_path):
    path = tmp_path / "rig-test-1.csv"
    refuse_other(path)
    write_columns(path, columns(test, None))
    assert path.read_text().splitlines()[1] == "0.0,0.0"  # nothing is added, and the column is there
    refuse_other(path)
    path.write_text("t,angle,rate,torque\n0,0,0,0\n")
    with pytest.raises(InvalidInput, match="found t, angle, rate …; the test is planned"):
        refuse_other(path)

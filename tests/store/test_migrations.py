"""A store of an older version is brought up to date when it is opened, and nothing in it is lost."""

import sqlite3

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

import twinloop as tl
from lives import FULL_LIFE, LIFE, lived, plain, stored
from old_store import old_store
from sameness import same
from twinloop.store import approvals, opened
from twinloop.store.schema import REVISION, metadata


@pytest.fixture(params=["paper", "default"])
def stores(request, tmp_path):
    """A store of today with a campaign that was lived through, and one of the first version with the same rows."""
    new, old = tmp_path / "new.db", tmp_path / "old.db"
    life = LIFE if request.param == "paper" else FULL_LIFE
    lived(stored(new, request.param), life).close()
    old_store(f"sqlite:///{old}", new)
    return new, old


def rows(path):
    """All rows of all tables but those that say who opened it, read with nothing of ours."""
    with sqlite3.connect(path) as connection:
        names = [
            name for (name,) in connection.execute("select name from sqlite_master where type = 'table'")
        ]
        left_out = {"alembic_version", "sessions", "approvals", "checkpoints"}
        return {name: connection.execute(f"select * from {name}").fetchall() for name in {*names} - left_out}


def test_a_store_of_the_first_version_gives_the_same_campaign_and_goes_on_with_the_same_bits(stores):
    new, old = stores
    before = rows(old)
    assert sum(map(len, before.values())) > 10
    campaigns = [tl.Campaign.load(path, threads=1) for path in (old, new)]
    assert plain(campaigns[0]) == plain(campaigns[1])
    with sqlite3.connect(old) as connection:
        assert connection.execute("select version_num from alembic_version").fetchall() == [(REVISION,)]
    # The migrations have touched no row.
    after = rows(old)
    assert {table: after[table] for table in before} == before
    assert same(*(campaign.ask().genes for campaign in campaigns))
    assert plain(campaigns[0]) == plain(campaigns[1])


def test_what_is_new_since_works_in_it(stores):
    _, old = stores
    store = opened(old)
    approvals.approve(store, "campaign", 0)
    assert list(approvals.approved(store, "campaign")) == [0]
    store.close()


def test_an_older_store_is_not_changed_by_who_only_reads(stores):
    _, old = stores
    before = old.read_bytes()
    with pytest.raises(
        tl.InvalidInput, match=f"version {REVISION}, found 0001; open it once without read_only"
    ):
        tl.Campaign.load(old, read_only=True)
    assert old.read_bytes() == before


def test_migrations_make_the_tables_that_the_code_knows(stores):
    """As Alembic itself compares them."""
    for path in stores:
        store = opened(path)
        with store.engine.connect() as connection:
            assert compare_metadata(MigrationContext.configure(connection), metadata) == []
        store.close()

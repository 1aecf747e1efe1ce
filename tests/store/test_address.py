"""Whatever an address looks like, others read of it where the store is, and no password."""

import sys
from urllib.parse import quote_plus

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import make_url

import twinloop as tl
from twinloop.store import opened, shown_name

MARKS = st.text("/#?@:&=%+ ;", max_size=4)


@pytest.mark.parametrize(
    "where",
    [
        "hover.db",
        "rig: a/hover.db",
        "--name",
        "postgresql+psycopg://user@host:5432/database",
        "postgresql://host/database?sslmode=require&host=/run/postgresql",
        "tcp://127.0.0.1:8786",
    ],
)
def test_what_has_no_password_is_shown_as_it_is(where):
    assert shown_name(where) == where


@pytest.mark.parametrize(
    ("where", "shown"),
    [
        ("postgres://me:s3cret@h/db", "postgres://me:***@h/db"),
        ("postgresql://me:a/s3cret@h/db", "postgresql://me:***@h/db"),
        ("postgresql://me:a#s3cret@h/db", "postgresql://me:***@h/db"),
        ("postgresql://me:a?s3cret@h/db", "postgresql://me:***@h/db"),
        ("postgresql://me@h/db?password=s3cret&sslmode=require", "postgresql://me@h/db?password=***&sslmode=require"),
        ("postgresql://me:a@s3cret@h/db", "postgresql://***@h/db"),
        ("postgresql://me:s3cret", "postgresql://***"),
        ("postgresql://h/db?password=a@s3cret", "postgresql://***"),
        ("--store=postgresql://me:s3cret@h/db", "--store=postgresql://me:***@h/db"),
    ],
)  # fmt: skip
def test_a_password_is_masked_wherever_it_stands(where, shown):
    assert shown_name(where) == shown


@given(MARKS, MARKS, st.sampled_from(["h", "h:5432", "h:port", "[::1]", ""]))
def test_no_password_is_shown_whatever_marks_it_has(before, after, host):
    password = f"{before}s3cret{after}"
    for address in (
        f"postgresql://me:{password}@{host}/db",
        f"postgresql://me:{quote_plus(password)}@{host}/db",
        f"postgresql://me@{host}/db?password={quote_plus(password)}",
    ):
        assert "s3cret" not in shown_name(address)
        assert "s3cret" not in shown_name(f"--store={address}")


@given(MARKS.filter(bool))
def test_the_rest_of_an_address_is_still_the_same_place(password):
    address = make_url("postgresql://h/db").set(username="me", password=password)
    found = make_url(shown_name(address.render_as_string(hide_password=False)))
    assert (found.username, found.host, found.database) == ("me", "h", "db")


def test_without_its_packages_an_address_is_shown_without_what_may_be_a_password(monkeypatch):
    monkeypatch.setitem(sys.modules, "sqlalchemy", None)
    assert shown_name("postgresql://me:s3cret@h/db") == "postgresql://***@h/db"


@pytest.mark.parametrize(
    ("address", "word"),
    [
        ("postgres://me:s3cret@h/db", "an address such as"),
        ("postgresql+psycopg://me:s3cret", "an address such as"),
        ("postgresql+psycopg://me:a@s3cret@h/db", "as %40"),
    ],
)
def test_a_refused_address_is_said_without_its_password(address, word):
    with pytest.raises(tl.InvalidInput, match=word) as refused:
        opened(address)
    assert "s3cret" not in str(refused.value)

"""Under what a command finds a campaign again: its store, and its name where the store holds several."""

import shlex

from twinloop.store import StoredAs


def test_a_campaign_is_named_where_its_store_holds_several():
    alone, one_of_two = (
        StoredAs.among("my rig.db", "tank 2", names) for names in (["tank 2"], ["wing", "tank 2"])
    )
    assert shlex.split(alone.to_type("show")) == ["twinloop", "show", "my rig.db"]
    assert shlex.split(one_of_two.to_type("withdraw", 3, "--reason", "wrong unit")) == [
        *("twinloop", "withdraw", "my rig.db", "3", "--reason", "wrong unit", "--name", "tank 2"),
    ]  # fmt: skip


def test_a_command_shows_no_password():
    typed = StoredAs.among("postgresql+psycopg://me:hidden@host/db", "tank", ["tank", "wing"]).to_type(
        "learn"
    )
    assert "hidden" not in typed and "me:***@host/db" in typed and typed.endswith(" --name tank")

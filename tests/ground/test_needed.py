"""A test that cannot run here skips on a user's machine, and fails in CI."""

import pytest

from needed import lacking, needed


def test_what_is_lacking_skips_a_test_and_in_ci_fails_it(monkeypatch):
    monkeypatch.delenv("TWINLOOP_CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match="no server"):
        lacking("no server is installed")
    monkeypatch.setenv("TWINLOOP_CI", "1")
    for end in (lambda: lacking("no server is installed"), lambda: needed("no_such_module", "no server")):
        with pytest.raises(RuntimeError, match="no server"):
            end()
    assert needed("pytest", "no pytest") is pytest

"""What tests need besides Python packages of their own: on a user's machine they skip without it, in CI they fail."""

import importlib
import os

import pytest


def lacking(what):
    """Ends a test, or a file of tests, that cannot run here.

    Args:
        what: is not installed, and how to install it.
    """
    if os.environ.get("TWINLOOP_CI"):
        raise RuntimeError(f"{what}; `.ci/run` skips no test for the want of it")
    pytest.skip(what, allow_module_level=True)


def needed(module, what):
    """A module of a package that a test cannot do without.

    Args:
        module: its name.
        what: to say where there is none.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        return lacking(what)

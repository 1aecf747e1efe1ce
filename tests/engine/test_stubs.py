"""The types of the native engine name everything that it has, and nothing else."""

import ast
from pathlib import Path

import twinloop
from twinloop import _core

STUB = ast.parse(Path(twinloop.__file__).with_name("_core.pyi").read_text(encoding="utf-8"))


def test_the_stub_names_what_the_engine_has():
    described = {node.name for node in STUB.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert described == {name for name in dir(_core) if not name.startswith("_")}


def test_the_stub_names_the_members_of_every_class():
    for node in STUB.body:
        if isinstance(node, ast.ClassDef):
            described = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
            found = {name for name in dir(getattr(_core, node.name)) if not name.startswith("_")}
            assert {name for name in described if not name.startswith("_")} == found, node.name


def test_every_public_name_of_the_package_is_there():
    assert all(hasattr(twinloop, name) for name in twinloop.__all__)


def test_the_package_and_the_engine_have_one_version():
    assert twinloop.__version__ == _core.__version__

"""No file that decides multiplies by BLAS: of that the lint, which knows functions by name, sees nothing."""

import ast
import sys
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
BY_BLAS = {"dot", "matmul", "vdot", "inner", "tensordot", "einsum", "linalg", "convolve", "correlate", "cov"}


def decides_nothing():
    """The files that pyproject.toml excuses from the ban of other functions."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        excused = tomllib.load(file)["tool"]["ruff"]["lint"]["per-file-ignores"]
    patterns = [pattern for pattern, rules in excused.items() if "TID251" in rules]
    return {
        pattern: {file for path in ROOT.glob(pattern) for file in (path, *path.rglob("*.py"))}
        for pattern in patterns
    }


def multiplied_by_blas(source):
    """Lines of a source that multiply matrices by `@` or by a function that NumPy gives to BLAS."""
    return [
        node.lineno
        for node in ast.walk(ast.parse(source))
        if (isinstance(node, (ast.BinOp, ast.AugAssign)) and isinstance(node.op, ast.MatMult))
        or (isinstance(node, ast.Attribute) and node.attr in BY_BLAS)
    ]


def test_no_file_that_decides_multiplies_by_blas():
    excused = set().union(*decides_nothing().values())
    deciding = set((ROOT / "python/twinloop").rglob("*.py")) - excused
    assert len(deciding) > 200
    found = {
        str(file.relative_to(ROOT)): lines
        for file in sorted(deciding)
        if (lines := multiplied_by_blas(file.read_text(encoding="utf-8")))
    }
    assert found == {}


def test_files_are_excused_by_their_whole_path_and_each_is_there():
    for pattern, files in decides_nothing().items():
        assert not pattern.startswith("*"), f"{pattern} excuses files anywhere"
        assert any(file.suffix == ".py" for file in files), f"{pattern} excuses nothing"


@pytest.mark.parametrize("source", ["a @ b", "a @= b", "np.dot(a, b)", "a.dot(b)", "np.linalg.inv(a)"])
def test_a_product_by_blas_is_seen(source):
    assert multiplied_by_blas(source) == [1]

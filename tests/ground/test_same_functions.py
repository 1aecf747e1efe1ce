"""No file that decides uses an operator that rounds differently elsewhere: the lint knows functions, not operators."""

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
COMPLEX = {"complex64", "complex128", "cdouble", "complexfloating"}


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


def squared_by_the_c_library(source):
    """Lines of a source with a power of a fixed exponent, such as `x**2`, or of a fraction, such as `0.7**k`.

    Powers of whole numbers, such as `2.0**-47` and `10.0**k`, are exact where they decide.
    """
    powers = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.BinOp)]
    return [
        node.lineno
        for node in powers
        if isinstance(node.op, ast.Pow)
        and (
            (is_number(node.right) and not (is_number(node.left) and is_whole(node.right)))
            or (is_number(node.left) and not is_number(node.right) and not is_whole(node.left))
        )
    ]


def complex_numbers(source):
    """Lines of a source with complex numbers, whose products NumPy rounds by what the processor can do."""
    return [
        node.lineno
        for node in ast.walk(ast.parse(source))
        if (isinstance(node, ast.Name) and node.id == "complex")
        or (isinstance(node, ast.Attribute) and node.attr in COMPLEX)
        or (isinstance(node, ast.Constant) and isinstance(node.value, complex))
    ]


def is_number(node):
    """Whether it is written as a number, with a sign or without."""
    return isinstance(node.operand if isinstance(node, ast.UnaryOp) else node, ast.Constant)


def is_whole(number):
    """Whether a written number is a whole one."""
    return float(ast.unparse(number)).is_integer()


@pytest.mark.parametrize("lines_of", [multiplied_by_blas, squared_by_the_c_library, complex_numbers])
def test_no_file_that_decides_uses_an_operator_with_other_bits_elsewhere(lines_of):
    excused = set().union(*decides_nothing().values())
    deciding = set((ROOT / "python/twinloop").rglob("*.py")) - excused
    assert len(deciding) > 200
    found = {
        str(file.relative_to(ROOT)): lines
        for file in sorted(deciding)
        if (lines := lines_of(file.read_text(encoding="utf-8")))
    }
    assert found == {}


def test_files_are_excused_by_their_whole_path_and_each_is_there():
    for pattern, files in decides_nothing().items():
        assert not pattern.startswith("*"), f"{pattern} excuses files anywhere"
        assert any(file.suffix == ".py" for file in files), f"{pattern} excuses nothing"


@pytest.mark.parametrize("source", ["a @ b", "a @= b", "np.dot(a, b)", "a.dot(b)", "np.linalg.inv(a)"])
def test_a_product_by_blas_is_seen(source):
    assert multiplied_by_blas(source) == [1]


@pytest.mark.parametrize(
    "source, seen",
    [
        ("x**2", True),
        ("2.0**0.5", True),
        ("0.3 * 0.7**k", True),
        ("0.7 ** (k - 1)", True),
        ("2.0**-47", False),
        ("10.0**k", False),
        ("x**n", False),
    ],
)
def test_a_power_of_a_fixed_exponent_or_of_a_fraction_is_seen(source, seen):
    assert bool(squared_by_the_c_library(source)) == seen


@pytest.mark.parametrize(
    "source", ["complex(a, b)", "a * 1j", "np.zeros(3, complex)", "a.astype(np.complex128)"]
)
def test_a_complex_number_is_seen(source):
    assert complex_numbers(source) == [1]

"""Hypothesis strategies: programs over small shapes, and matrices of objectives full of ties."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from oracles import BINARY, EXACT, UNARY
from twinloop import _core

ALL = BINARY + UNARY


def program_text(inputs, outputs, registers, pages):
    """The text of a program from lines of instructions, one list a page."""
    lines = [f"program inputs={inputs} outputs={outputs} registers={registers}"]
    for number, page in enumerate(pages, start=1):
        lines += [f"page {number}", *page]
    return "\n".join(lines) + "\n"


@st.composite
def instructions(draw, registers, operations=ALL):
    """One instruction as text."""
    register = st.integers(0, registers - 1).map(lambda r: f"r{r}")
    constant = st.floats(-20.0, 20.0, allow_nan=False).map(repr)
    operation = draw(st.sampled_from(operations))
    destination, first = draw(register), draw(register)
    if operation in UNARY:
        return f"{destination} = {operation}({first})"
    second = draw(st.one_of(register, constant))
    if operation in ("min", "max"):
        return f"{destination} = {operation}({first}, {second})"
    return f"{destination} = {first} {operation} {second}"


@st.composite
def programs(draw, operations=ALL, inputs=None, outputs=None, pages=5, page_length=6):
    """A program of a few pages, some of them empty."""
    inputs = draw(st.integers(1, 4)) if inputs is None else inputs
    outputs = draw(st.integers(1, 3)) if outputs is None else outputs
    registers = inputs + outputs + draw(st.integers(0, 3))
    page = st.lists(instructions(registers, operations), max_size=page_length)
    text = program_text(inputs, outputs, registers, draw(st.lists(page, min_size=1, max_size=pages)))
    return _core.Program.parse(text)


def exact_programs(**shape):
    """Programs whose every operation is exact to the last bit."""
    return programs(operations=EXACT, **shape)


def rows(columns, least=1, most=20, size=1e3):
    """Matrices (rows, columns) of moderate numbers, small and zero ones among them."""
    numbers = st.one_of(st.floats(-size, size), st.sampled_from([0.0, 1e-6, -1e-6, 1e-7, 1.0]))
    return hnp.arrays(np.float64, st.tuples(st.integers(least, most), st.just(columns)), elements=numbers)


def objectives(least=1, most=60, columns=4):
    """Matrices of objectives on so coarse a grid that ties and equal rows are common."""
    shape = st.tuples(st.integers(least, most), st.integers(1, columns))
    coarse = st.integers(-2, 3).map(float)
    fine = st.floats(-1e3, 1e3, allow_nan=False)
    return shape.flatmap(
        lambda s: st.one_of(
            hnp.arrays(np.float64, s, elements=coarse), hnp.arrays(np.float64, s, elements=fine)
        )
    )


seeds = st.integers(0, 2**64 - 1)

"""Random programs without introns: made backwards, each destination one of the registers that are live."""

from dataclasses import dataclass

import numpy as np

from twinloop import _core

REGISTERS = 16
INSTRUCTIONS = 50
DIVISIONS = 0.25
SYMBOLS = "+-*/"
DIVISION = 3
SMALLEST_DIVISOR = 1e-6


@dataclass(frozen=True)
class Code:
    """Programs as arrays (programs, instructions): numbers of the operation and of three registers."""

    operations: np.ndarray
    destinations: np.ndarray
    firsts: np.ndarray
    seconds: np.ndarray

    @classmethod
    def of(cls, programs: list[np.ndarray]) -> "Code":
        columns = np.stack(programs).transpose(2, 0, 1).astype(np.uint64)
        return cls(*(np.ascontiguousarray(column) for column in columns))


@dataclass(frozen=True)
class Renamed:
    """The same programs over one register more, where no instruction writes what it reads.

    A loop that a compiler made vectors of runs as such only if what it writes is not what it reads.
    """

    code: Code
    finals: np.ndarray
    """Where each register ends up (programs, registers)."""

    @classmethod
    def of(cls, programs: list[np.ndarray]) -> "Renamed":
        renamed, finals = [], []
        for program in programs:
            place, free = list(range(REGISTERS)), REGISTERS
            rows = []
            for operation, destination, first, second in program:
                rows.append((operation, free, place[first], place[second]))
                free, place[destination] = place[destination], free
            renamed.append(np.array(rows))
            finals.append(place)
        return cls(Code.of(renamed), np.array(finals, dtype=np.uint64))


def random_program(rng: np.random.Generator, inputs: int, outputs: int) -> np.ndarray:
    """Instructions (operation, destination, first, second), each of which reaches an output."""
    shares = [(1 - DIVISIONS) / 3] * 3 + [DIVISIONS]
    live = set(range(inputs, inputs + outputs))
    backwards = []
    for _ in range(INSTRUCTIONS):
        destination = int(rng.choice(sorted(live)))
        first, second = (int(register) for register in rng.integers(0, REGISTERS, 2))
        live = (live - {destination}) | {first, second}
        backwards.append((int(rng.choice(4, p=shares)), destination, first, second))
    return np.array(backwards[::-1])


def native(program: np.ndarray, inputs: int, outputs: int) -> _core.Program:
    lines = [f"program inputs={inputs} outputs={outputs} registers={REGISTERS}", "page 1"]
    lines += [f"r{d} = r{a} {SYMBOLS[operation]} r{b}" for operation, d, a, b in program]
    parsed = _core.Program.parse("\n".join(lines))
    if len(parsed.effective()) != INSTRUCTIONS:
        raise ValueError("expected a program without introns; repair random_program")
    return parsed

"""Rows: one-step error of random programs over many transitions, beside numba and NumPy."""

import numpy as np

import loop
from measure import Line, Section, Spread, check_agreement, interleaved, optional, ratio
from programs import INSTRUCTIONS, REGISTERS, SMALLEST_DIVISOR, Code, Renamed, native, random_program
from twinloop import _core

INPUTS, OUTPUTS = 10, 6
BAR, BAR_ROWS = 1.5, 1000
GOOD_BASELINE = 3.5
WORST = 2e6
COLUMN_OPERATIONS = (np.add, np.subtract, np.multiply)
OURS, NUMPY = "twinloop", "NumPy, a column operation an instruction"
PLAIN, RENAMED = "numba, 64 lanes", "numba, 64 lanes, registers renamed"


def report(smoke: bool) -> Section:
    section = Section(f"Rows: one-step error, {INSTRUCTIONS} instructions, 25 % protected divisions")
    rng = np.random.default_rng(0)
    count, rounds = (5, 2) if smoke else (100, 41)
    numba = optional("numba_rows", section)
    for rows in (100, 1000) if smoke else (100, 1000, 10_000):
        states, commands = rng.normal(size=(rows + 1, loop.STATES)), rng.normal(size=(rows, loop.COMMANDS))
        tests = _core.SelectedTests(loop.SETTING)
        # The commands as the program sees them are of the size of the states.
        tests = tests.with_test(np.zeros(9), np.zeros(loop.STATES), states, commands * loop.HOVER)
        programs, models = _programs(rng, count, tests)
        # What the engine does to a command, to the last bit: times the inverse of its scale.
        inputs = np.hstack([states[:-1], (commands * loop.HOVER) * (1.0 / loop.HOVER)])
        nexts = states[1:]
        workers = _core.Workers(1)
        contestants = {
            OURS: lambda models=models, tests=tests, workers=workers: _core.open_loop(models, tests, workers),
            NUMPY: lambda programs=programs, x=inputs, y=nexts: _with_numpy(programs, x, y),
        }
        if numba:
            contestants |= _with_numba(numba, programs, inputs, nexts)
        expected = contestants[OURS]()[:, 0]
        for name in list(contestants)[1:]:
            check_agreement(f"{rows} rows, {name}", expected, contestants[name]())
        times = interleaved(contestants, rounds, at_least=0.0 if smoke else 0.01)
        # The bar is for the interpreter as one writes it; renaming shows what a further pass would gain it.
        for name in contestants:
            speed = count * INSTRUCTIONS * rows / float(np.median(times[name])) / 1e9
            bar = BAR if name == PLAIN and rows == BAR_ROWS else None
            against = None if name == OURS else ratio(times, name, OURS)
            section.lines.append(Line(f"{rows} rows", name, speed, "10⁹ instructions/s", against, bar))
        if numba and rows == BAR_ROWS:
            section.notes += [_baseline(name, ratio(times, NUMPY, name)) for name in (PLAIN, RENAMED)]
    return section


def _baseline(name: str, over_numpy: Spread) -> str:
    verdict = "a good baseline" if over_numpy.median >= GOOD_BASELINE else "not a good baseline"
    return (
        f"{name}: {over_numpy.median:.2f} × NumPy at {BAR_ROWS} rows ({over_numpy.low:.2f} to "
        f"{over_numpy.high:.2f}); {verdict}, which begins at {GOOD_BASELINE:g}."
    )


def _programs(rng: np.random.Generator, count: int, tests: _core.SelectedTests):
    """Programs and models; one at the cap of the error is drawn again, for at the cap all agree."""
    programs: list[np.ndarray] = []
    models: list[_core.Model] = []
    while len(programs) < count:
        program = random_program(rng, INPUTS, OUTPUTS)
        model = _core.Model(native(program, INPUTS, OUTPUTS), "absolute", loop.SIGNALS)
        if _core.open_loop([model], tests, _core.Workers(1))[0, 0] < WORST:
            programs.append(program)
            models.append(model)
    return programs, models


def _with_numba(numba, programs: list[np.ndarray], inputs: np.ndarray, nexts: np.ndarray):
    plain, renamed = Code.of(programs), Renamed.of(programs)
    in_place = np.tile(np.arange(REGISTERS, dtype=np.uint64), (len(programs), 1))
    x, y, rows = numba.blocks(inputs), numba.blocks(nexts), len(inputs)

    def run(code: Code, finals: np.ndarray) -> np.ndarray:
        columns = code.operations, code.destinations, code.firsts, code.seconds
        return numba.one_step_errors(*columns, finals, x, y, rows)

    return {PLAIN: lambda: run(plain, in_place), RENAMED: lambda: run(renamed.code, renamed.finals)}


def _with_numpy(programs: list[np.ndarray], inputs: np.ndarray, nexts: np.ndarray) -> np.ndarray:
    rows, states = nexts.shape
    bank = np.empty((REGISTERS, rows))
    registers = list(bank)
    magnitude, tiny = np.empty(rows), np.empty(rows, dtype=bool)
    columns, targets = np.ascontiguousarray(inputs.T), np.ascontiguousarray(nexts.T)
    errors = np.empty(len(programs))
    with np.errstate(all="ignore"):
        for i, program in enumerate(programs):
            bank[:INPUTS] = columns
            bank[INPUTS:] = 0.0
            for operation, d, a, b in program.tolist():
                if operation < 3:
                    COLUMN_OPERATIONS[operation](registers[a], registers[b], registers[d])
                    continue
                np.abs(registers[b], magnitude)
                np.less_equal(magnitude, SMALLEST_DIVISOR, tiny)
                if tiny.any():  # rare, and what it guards is slow
                    divisor = np.where(tiny, 1.0, registers[b])
                    np.divide(registers[a], divisor, registers[d])
                else:
                    np.divide(registers[a], registers[b], registers[d])
            difference = bank[INPUTS : INPUTS + OUTPUTS] - targets
            mean = np.vdot(difference, difference) / (rows * states)
            errors[i] = mean if mean < WORST else WORST
    return errors

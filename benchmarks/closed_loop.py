"""Closed loop: PID, learnt accelerations under RK4, and the error against recorded flights, beside numba."""

import numpy as np

import loop
from measure import Line, Section, check_agreement, fastest, interleaved, optional, ratio
from programs import REGISTERS, Code, Renamed, native, random_program
from twinloop import _core

INPUTS, OUTPUTS = 10, 3
BAR, BAR_TESTS = 2.0, 8
OURS = "twinloop"


def report(smoke: bool) -> Section:
    section = Section(f"Closed loop: PID + model + RK4 + squared error, {loop.STEPS} steps, 50 instructions")
    count, rounds = (3, 2) if smoke else (40, 41)
    numba = optional("numba_loop", section)
    programs, models = _programs(count, loop.fly(BAR_TESTS).selected())
    workers = _core.Workers(1)
    for tests in (BAR_TESTS,) if smoke else (BAR_TESTS, 1):
        flights = loop.fly(tests)
        selected = flights.selected()
        contestants = {OURS: lambda selected=selected: _core.closed_loop(models, selected, workers)[0]}
        if numba:
            contestants |= _with_numba(numba.compiled(tests), tests, programs, flights)
        expected = contestants[OURS]()
        for name in list(contestants)[1:]:
            check_agreement(f"{tests} tests, {name}", expected, contestants[name]())
        times = interleaved(contestants, rounds, at_least=0.0 if smoke else 0.01)
        best = fastest(times, list(contestants)[1:]) if numba else None
        for name in contestants:
            figure = float(np.median(times[name])) * 1e9 / (count * loop.STEPS * tests)
            bar = BAR if name == best and tests == BAR_TESTS else None
            against = None if name == OURS else ratio(times, name, OURS)
            case = f"{tests} test" + ("s" if tests > 1 else "")
            section.lines.append(Line(case, name, figure, "ns per step and test", against, bar))
    return section


def _programs(count: int, selected: _core.SelectedTests):
    """Programs and models; one that diverges on a test is drawn again, for its run would end early."""
    rng = np.random.default_rng(1)
    programs: list[np.ndarray] = []
    models: list[_core.Model] = []
    while len(programs) < count:
        program = random_program(rng, INPUTS, OUTPUTS)
        model = _core.Model(native(program, INPUTS, OUTPUTS), "acceleration", loop.SIGNALS)
        if np.isfinite(_core.closed_loop([model], selected, _core.Workers(1))[0]).all():
            programs.append(program)
            models.append(model)
    return programs, models


def _with_numba(errors, lanes: int, programs: list[np.ndarray], flights: loop.Flights):
    gains = np.ascontiguousarray(flights.gains.T)
    recorded = np.ascontiguousarray(flights.states.transpose(1, 2, 0))
    plain, renamed = Code.of(programs), Renamed.of(programs)
    in_place = np.tile(np.arange(REGISTERS, dtype=np.uint64), (len(programs), 1))
    mixer = loop.MATRIX, loop.OFFSET, np.array(loop.BOUNDS)

    def run(code: Code, finals: np.ndarray) -> np.ndarray:
        columns = code.operations, code.destinations, code.firsts, code.seconds
        flight = gains, flights.target, recorded
        return errors(*columns, finals, *flight, *mixer, loop.HOVER, loop.DT)

    name = f"numba, {lanes} lanes" if lanes > 1 else "numba, scalar"
    return {
        name: lambda: run(plain, in_place),
        f"{name}, registers renamed": lambda: run(renamed.code, renamed.finals),
    }

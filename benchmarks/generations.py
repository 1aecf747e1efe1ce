"""Generations: how fast the whole model loop turns, and the share of offspring that need not be run."""

import time

import numpy as np

import loop
from measure import Line, Section
from twinloop import _core

POPULATION = 250


def report(smoke: bool) -> Section:
    section = Section(
        f"Generations: the whole model loop, population {POPULATION}, {loop.STEPS} steps a test"
    )
    tests, chunks, generations = (1, 2, 3) if smoke else (8, 9, 100)
    selected = loop.fly(tests).selected(loop.SETTING)
    workers = _core.Workers(1)
    variation = _core.Variation(POPULATION)
    for form in ("absolute", "acceleration"):
        grammar = _core.Grammar(*_core.Model.shape(form, loop.SIGNALS))
        search = _core.ModelSearch.start(grammar, form, variation, 0, selected, workers)
        speeds, run, spared = [], search.evaluations, search.spared
        for _ in range(chunks):
            start = time.process_time()
            search = search.advance(selected, generations, workers)
            speeds.append(generations * POPULATION / (time.process_time() - start))
        run, spared = search.evaluations - run, search.spared - spared
        case = f"{form}, {tests} tests"
        section.lines.append(Line(case, "twinloop", float(np.median(speeds)), "models/s"))
        section.lines.append(Line(case, "spared", 100 * spared / (run + spared), "% of offspring"))
    return section

"""The preset `default` gives the same bits whatever processor the libraries around it believe that they run on.

BLAS, NumPy and the C library each choose among kernels by what the processor can do, and their last digits differ. A
campaign in a process of its own, under another choice, must not see it.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import twinloop

CAMPAIGN = """
import dataclasses, json, sys
import twinloop as tl

system = tl.systems.Quadrotor.harsh(noise=1e-3, seed=3)
gains = {name: (1e-3 * bounds[1], bounds[1], "log") for name, bounds in system.controller.gains.items()}
campaign = tl.Campaign(
    system.signals,
    controller=dataclasses.replace(system.controller, gains=gains),
    initial_state=system.initial_state,
    target_state=system.target_state,
    duration=1.0,
    seed=1,
    threads=int(sys.argv[1]),
    options={
        "moves": 600, "starts": 1, "generations": 2, "population": 40, "passes": 1, "committee_size": 6, "draws": 4,
        "candidates": 64, "evaluations": 1200, "target_range": (0.05,) * 6,
    },
)
campaign.run(system, experiments=2)
best = campaign.best_test
tests = [run.test for run in campaign.experiments]
flight = campaign.twin.simulate(best)
print(json.dumps({
    "genes": [[gene.hex() for gene in run.test.genes.tolist()] for run in campaign.experiments],
    "best": [gene.hex() for gene in best.genes.tolist()],
    "excitation": [None if test.excitation is None else test.excitation.tobytes().hex() for test in tests],
    "equations": campaign.twin.equations(digits=17),
    "predicted": [test.predicted and test.predicted.hex() for test in (*tests, best)],
    "reasons": [test.reason for test in tests],
    "band": flight.band.tobytes().hex(),
    "errors": str(campaign.twin.errors),
}))
"""


def dispatched(wanted):
    """What NumPy calls those of its dispatched features that this processor has."""
    from numpy._core import _multiarray_umath as engine

    return " ".join(
        name for name in engine.__cpu_dispatch__ if engine.__cpu_features__[name] and wanted(name)
    )


OTHERS = {
    "a processor with AVX2": (
        {
            "OPENBLAS_CORETYPE": "Haswell",
            "NPY_DISABLE_CPU_FEATURES": dispatched(lambda f: "AVX512" in f or f == "X86_V4"),
        },
        1,
    ),
    "an older processor, and two threads": (
        {
            "OPENBLAS_CORETYPE": "Prescott",
            "NPY_DISABLE_CPU_FEATURES": dispatched(lambda f: True),
            "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
        },
        2,
    ),
}
"""All libraries are told of the same processor: to the bit, the choice of none may be seen."""


def found(environment, threads):
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CAMPAIGN, str(threads)],
        env={**os.environ, "PYTHONPATH": str(Path(twinloop.__file__).parents[1]), **environment},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def here():
    return found({}, 1)


@pytest.mark.parametrize("name", OTHERS)
def test_another_processor_gives_the_same_bits(here, name):
    there = found(*OTHERS[name])
    for what, bits in here.items():
        assert there[what] == bits, what


def test_the_libraries_do_differ_where_they_are_told_to():
    """Else the test above says nothing: NumPy's functions differ from kernel to kernel where there are several."""
    if not dispatched(lambda f: True):
        pytest.skip("NumPy has one kernel on this processor")
    code = (
        "import numpy as np; x = np.linspace(0.1, 9.0, 4001);"
        " print(''.join(f(x).tobytes().hex() for f in (np.log, np.exp, np.sin, np.tanh)))"
    )
    without = {"NPY_DISABLE_CPU_FEATURES": dispatched(lambda f: True)}
    here, there = (
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", code],
            env={**os.environ, **more},
            capture_output=True,
            check=True,
        ).stdout
        for more in ({}, without)
    )
    assert here != there
    assert np.isfinite(np.frombuffer(bytes.fromhex(here.decode()))).all()

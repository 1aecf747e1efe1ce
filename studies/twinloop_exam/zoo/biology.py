"""Two biological systems with rational laws: a chemostat (Monod) and a gene that represses itself (Hill)."""

from __future__ import annotations

from twinloop.controllers import PID
from twinloop.signals import Command, Signals, State
from twinloop_exam.zoo.machine import Machine, Mechanism, Row, runge_kutta
from twinloop_exam.zoo.plant import Plant, Task, about_rest

GROWTH, HALF, YIELD, FEED = 0.5, 0.8, 0.5, 10.0
"""1/h, g/L, g/g, g/L."""


def chemostat(z: Row, u: Row) -> Row:
    """Biomass and substrate, g/L, under the dilution rate; time in hours."""
    biomass, substrate = z
    growth = GROWTH * substrate / (HALF + substrate)
    return [(growth - u[0]) * biomass, u[0] * (FEED - substrate) - growth * biomass / YIELD]


TRANSCRIPTION, THRESHOLD, MESSAGE_DECAY, TRANSLATION, PROTEIN_DECAY = 4.0, 1.5, 1.0, 1.2, 0.6
"""Of the promoter (nM/min), nM, 1/min, 1/min, 1/min."""


def gene(z: Row, u: Row) -> Row:
    """Messenger and protein, nM, under the inducer; the protein represses its own gene as a dimer (Hill, n = 2)."""
    messenger, protein = z
    share = protein / THRESHOLD
    made = TRANSCRIPTION * u[0] / (1.0 + share * share)
    return [made - MESSAGE_DECAY * messenger, TRANSLATION * messenger - PROTEIN_DECAY * protein]


CHEMOSTAT = Signals(
    [
        State("biomass", "g/L", 5.0, envelope=(0.0, 6.0)),
        State("substrate", "g/L", 5.0, envelope=(-0.05, 9.0)),
    ],
    [Command("dilution", "1/h", (0.0, 0.45))],
    0.1,
)
GENE = Signals(
    [
        State("messenger", "nM", 3.0, envelope=(-0.1, 6.0)),
        State("protein", "nM", 4.0, envelope=(-0.1, 6.0)),
    ],
    [Command("inducer", "", (0.0, 3.0))],
    0.2,
)


def _rest_of_chemostat(substrate: float) -> tuple[float, float]:
    """Biomass and dilution at which a substrate stays."""
    return YIELD * (FEED - substrate), GROWTH * substrate / (HALF + substrate)


def _rest_of_gene(protein: float) -> tuple[float, float]:
    """Messenger and inducer at which a protein stays."""
    messenger = PROTEIN_DECAY * protein / TRANSLATION
    share = protein / THRESHOLD
    return messenger, MESSAGE_DECAY * messenger * (1.0 + share * share) / TRANSCRIPTION


def _chemostat_task(_: Machine) -> Task:
    biomass, dilution = _rest_of_chemostat(0.5)
    wanted, _more = _rest_of_chemostat(2.5)
    family = PID(
        axes=[("substrate", None)],
        gains={"substrate.kp": (0.0, 1.0), "substrate.ki": (0.0, 0.5), "substrate.kd": 0.0},
        output=about_rest(dilution),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[biomass, 0.5],
        target=[wanted, 2.5],
        duration=10.0,
        first={"substrate.kp": 0.1, "substrate.ki": 0.03},
        weights={"biomass": 0.0},
    )


def _gene_task(_: Machine) -> Task:
    messenger, inducer = _rest_of_gene(0.8)
    wanted, _more = _rest_of_gene(3.0)
    family = PID(
        axes=[("protein", None)],
        gains={"protein.kp": (0.0, 5.0), "protein.ki": (0.0, 3.0), "protein.kd": (0.0, 3.0)},
        output=about_rest(inducer),
        anti_windup="clamping",
    )
    return Task(
        family,
        start=[messenger, 0.8],
        target=[wanted, 3.0],
        duration=16.0,
        first={"protein.kp": 1.1, "protein.ki": 0.3, "protein.kd": 0.2},
        weights={"messenger": 0.0},
    )


MONOD = Plant(
    "chemostat",
    "chemostat, growth by Monod",
    lambda seed: Machine(CHEMOSTAT, Mechanism(runge_kutta(chemostat)), [1e-2, 1e-2], seed),
    _chemostat_task,
)
HILL = Plant(
    "gene",
    "gene that represses itself, by Hill",
    lambda seed: Machine(GENE, Mechanism(runge_kutta(gene)), [1e-2, 1e-2], seed),
    _gene_task,
)

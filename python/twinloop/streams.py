"""Streams of random numbers: one for each unit of work, named by what it is for; none is global."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What random numbers of a campaign are for, beside those that the engine draws."""

    EVOLUTION = 77
    COMMITTEE = 78
    PLANNING = 79
    BAND = 80
    REPEATS = 81


def stream(*key: int, purpose: int | None = None) -> np.random.Generator:
    """The random numbers of one unit of work.

    Args:
        key: a seed, and whatever numbers tell this unit from others.
        purpose: names streams that are drawn beside that of the same key; None for that one.

    Returns:
        A counter-based generator that depends on these and on nothing else.
    """
    sequence = np.random.SeedSequence(list(key), spawn_key=() if purpose is None else (purpose,))
    return np.random.Generator(np.random.Philox(sequence))

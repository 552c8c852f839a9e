"""The test cases: a fraction of all combinations of plants, excitations, lengths and noise."""

from __future__ import annotations

from dataclasses import dataclass

from .plants import PLANTS, Plant
from .records import EXCITATIONS

DECIBELS = (20.0, 30.0, 40.0, 60.0)
"""Ratios of output to noise [dB]."""
COLOURS = (0.0, 0.8)
"""Correlation of the noise from sample to sample: white, and slow."""
CASES_OF_A_PLANT = 4
"""Cases of each plant: this many excitations, each length twice, each size of noise once."""


@dataclass(frozen=True)
class Case:
    """One plant, with an excitation, a length [samples], a size and a colour of the noise."""

    name: str
    plant: Plant
    excitation: str
    samples: int
    decibels: float
    colour: float


def cases() -> list[Case]:
    """All cases of the design, in order."""
    excitations = list(EXCITATIONS)
    found = []
    for i, (name, plant) in enumerate(PLANTS.items()):
        for j in range(CASES_OF_A_PLANT):
            excitation = excitations[(4 * i + j + i // 3) % len(excitations)]
            long = (i + j) % 2 == 1
            decibels = DECIBELS[(j + i // 2) % len(DECIBELS)]
            colour = COLOURS[(i + j // 2) % 5 == 0]
            samples = plant.long if long else plant.short
            said = f"{name}, {excitation}, {'long' if long else 'short'}, {decibels:g} dB"
            found.append(Case(said, plant, excitation, samples, decibels, colour))
    return found

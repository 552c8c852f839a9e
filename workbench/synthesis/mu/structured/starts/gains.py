"""Starts for a constant gain: gains of each range of stabilising gains, computed exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.proofs.static_gains import GainRange, gain_ranges
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.systems.realisation import realisation

MOST_STATES = 30
"""Largest number of states of a plant for exact fractions, whose size grows with the states."""


def one_gain(search: Search) -> bool:
    """Whether the family is a single constant gain, for which all stabilising gains can be
    computed.
    """
    G, members = search.controlled, search.family.examples(search.speed, search.gain)
    alone = (G.ninputs, G.noutputs) == (1, 1) and G.nstates <= MOST_STATES
    return alone and bool(members) and all(K.nstates == 0 for K in members)


def gain_starts(search: Search) -> Iterator[StateSpace]:
    """Gains of each stabilising range: its middle, and gains of the plant's own scale.

    A range may end where direct terms that are only rounding cancel. Its middle is then too far
    away.
    """
    nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    near = (-search.gain, 0.0, search.gain)
    for one in gain_ranges(search.controlled):
        if one.stabilises:
            gains = [float(one.middle), *(gain for gain in near if _is_inside(one, gain))]
            targets = [realisation((*nothing, np.array([[gain]])), 0.0) for gain in gains]
            yield from search.members(targets)


def none_stabilises(search: Search) -> bool:
    """Whether no gain stabilises the plant, by exact arithmetic with fractions."""
    return not any(one.stabilises for one in gain_ranges(search.controlled))


def _is_inside(one: GainRange, gain: float) -> bool:
    """Whether a gain lies in a range."""
    low, high = (None if end is None else float(end) for end in (one.low, one.high))
    return (low is None or low < gain) and (high is None or gain < high)

"""Starts of a constant gain: one of each range of gains that stabilise, exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.proofs.static_gains import GainRange, gain_ranges
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.systems.realisation import realisation

MOST_STATES = 30
"""Most states of a plant for which fractions are asked, which grow with them."""


def one_gain(search: Search) -> bool:
    """Whether the family is one constant gain, of which all stabilising ones are known."""
    G, members = search.controlled, search.family.examples(search.speed, search.gain)
    alone = (G.ninputs, G.noutputs) == (1, 1) and G.nstates <= MOST_STATES
    return alone and bool(members) and all(K.nstates == 0 for K in members)


def gain_starts(search: Search) -> Iterator[StateSpace]:
    """Gains of each range that stabilises: its middle, and those of the plant's own size.

    A range may end where direct terms that are rounding cancel, and its middle is then far away.
    """
    nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    near = (-search.gain, 0.0, search.gain)
    for one in gain_ranges(search.controlled):
        if one.stabilises:
            gains = [float(one.middle), *(gain for gain in near if _inside(one, gain))]
            targets = [realisation((*nothing, np.array([[gain]])), 0.0) for gain in gains]
            yield from search.members(targets)


def none_stabilises(search: Search) -> bool:
    """Whether no gain stabilises the plant, which fractions tell."""
    return not any(one.stabilises for one in gain_ranges(search.controlled))


def _inside(one: GainRange, gain: float) -> bool:
    """Whether a gain lies in a range."""
    low, high = (None if end is None else float(end) for end in (one.low, one.high))
    return (low is None or low < gain) and (high is None or gain < high)

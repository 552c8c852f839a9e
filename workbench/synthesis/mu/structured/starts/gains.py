"""Starts of a constant gain: one of each range of gains that stabilise, exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench.certify.proofs.static_gains import gain_ranges
from workbench.heavy_types import StateSpace
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
    """A gain of each range that stabilises."""
    ranges = [one for one in gain_ranges(search.controlled) if one.stabilises]
    nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    targets = [realisation((*nothing, np.array([[float(one.middle)]])), 0.0) for one in ranges]
    yield from search.members(targets)

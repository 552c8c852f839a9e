"""Starts of a constant gain: one of each range of gains that stabilise, exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench.certify.proofs.static_gains import gain_ranges
from workbench.heavy_types import StateSpace
from workbench.synthesis.mu.families.modal import Modal
from workbench.synthesis.mu.structured.starts.search import Search

MOST_STATES = 30
"""Most states of a plant for which fractions are asked, which grow with them."""


def one_gain(search: Search) -> bool:
    """Whether the family is one constant gain, of which all stabilising ones are known."""
    G = search.controlled
    alone = isinstance(search.family, Modal) and search.family.order == 0
    return alone and (G.ninputs, G.noutputs) == (1, 1) and G.nstates <= MOST_STATES


def gains(search: Search) -> Iterator[StateSpace]:
    """A gain of each range that stabilises."""
    for one in gain_ranges(search.controlled):
        if one.stabilises:
            yield search.family.system(np.array([float(one.middle)]))

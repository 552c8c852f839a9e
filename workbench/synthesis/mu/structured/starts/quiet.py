"""Starts with almost no effect, which stabilise a stable plant: zero gain, or weak integral
action.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.systems.generalised_plant import response

SHARES = (0.3, 0.03, 0.003)
"""Crossover of the integral action, relative to the plant's slowest pole."""
OTHER_SIGN = 0.3
"""Factor on the integral gain of channels whose sign differs from that of G(0): they must not
dominate.
"""
MOST_SIGNS = 16
"""Largest number of tried combinations of signs of the channels' integral gains."""


def quiet(search: Search) -> Iterator[StateSpace]:
    """Members with almost no gain; then integral gains with the signs of G(0), small ones last."""
    for corner in search.corners:
        yield from search.family.examples(corner, search.gain)
    yield from search.members(_little_integration(search))


def _little_integration(search: Search) -> Iterator[StateSpace]:
    """Controllers k / s whose loops cross over far below the plant's speed."""
    import control

    found = search.loops()
    if found is None:
        return
    plants, whole = found
    slowest = [np.abs(H.poles()).min(initial=np.inf) for H in plants]
    if not all(0 < each < np.inf for each in slowest):
        return  # a plant with integrators, or a pure gain
    still = [complex(response(H, [1e-3 * each])[0, 0, 0]).real for H, each in
             zip(plants, slowest, strict=True)]  # fmt: skip
    if not all(still):
        return
    signs = islice(product((1.0, -1.0), repeat=len(plants)), MOST_SIGNS)
    for turned in signs:
        for share in SHARES:
            gains = [
                (sign if sign > 0 else -OTHER_SIGN) * share * rate / gain
                for sign, rate, gain in zip(turned, slowest, still, strict=True)
            ]
            yield whole([control.ss([[0.0]], [[1.0]], [[gain]], [[0.0]]) for gain in gains])

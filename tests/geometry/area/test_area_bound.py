"""The bound of the area does not lean on the answer: one that is not the best gets no more."""

import numpy as np
import pytest

from workbench.geometry import smallest_area_stadium
from workbench.geometry.area.bound import least_area

NUMBERS = np.random.default_rng(5).standard_normal((2, 6, 7))
POINTS = (NUMBERS[0] + 0.4j * NUMBERS[1]) * np.exp(1j * np.arange(6))[:, None]
"""Six sets of seven points, in six directions."""


@pytest.mark.parametrize("given", [{}, {"center": np.zeros(6)}, {"angle": np.arange(6) / 6}])
@pytest.mark.parametrize("more", [1.0, 1.3, 3.0])
def test_the_bound_is_the_least_area_whatever_the_answer(given, more):
    best = smallest_area_stadium(POINTS, **given).area
    away = POINTS if given.get("center") is not None else POINTS - POINTS.mean(1, keepdims=True)
    found = least_area(away, "center" in given, given.get("angle"), more * best, 1e-5 * best)
    assert (found <= best * (1 + 1e-9)).all()
    assert (found >= best * (1 - 2e-5)).all()

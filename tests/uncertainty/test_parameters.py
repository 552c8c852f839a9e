"""Uncertain parameters, and the sets of deltas that models are evaluated at."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.uncertainty.parametric_models.parameters import (
    Parameter,
    level_deltas,
    random_deltas,
    vertex_deltas,
)


def test_full_factorials():
    nine = [Parameter(name, 2.0, 0.1) for name in "abcdefghi"]
    assert level_deltas(nine, 3).shape == (3**9, 9)
    assert vertex_deltas(nine).shape == (2**9, 9)
    assert set(np.unique(level_deltas(nine, 3))) == {-1.0, 0.0, 1.0}
    assert len(np.unique(level_deltas(nine[:4], 3), axis=0)) == 81
    inside = random_deltas(nine, 50, np.random.default_rng(0))
    assert inside.shape == (50, 9) and abs(inside).max() <= 1
    with pytest.raises(InputError, match="at least 2"):
        level_deltas(nine, 1)
    with pytest.raises(InputError, match="samples"):
        level_deltas(nine, 10)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (("a b", 1.0, 0.1), "argument"),
        (("a", 0.0, 0.1), "nominal"),
        (("a", np.nan, 0.1), "nominal"),
        (("a", 1.0, 0.0), "positive"),
        (("a", 1.0, np.inf), "finite"),
    ],
)
def test_parameters_that_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Parameter(*arguments)

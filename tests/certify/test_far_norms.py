"""Norms of systems whose inputs, outputs or states are measured in very far units."""

import numpy as np
import pytest

from workbench.certify.norms import certified_norm
from workbench.certify.realisations.parts import difference_of
from workbench.systems.realisation import realisation

A = np.array([[-1.0, 0.5], [0.0, -3.0]])
NORM = 1.25
"""Of the system with ones in C, and with 1 and a half in B."""


def in_units(into, out):
    return A, into * np.array([[1.0], [0.5]]), out * np.ones((1, 2)), np.zeros((1, 1))


@pytest.mark.parametrize(
    ("into", "out"), [(1e-200, 1e200), (1e250, 1e-250), (1e75, 1e75), (1e250, 1e-100)]
)
def test_norms_scale_with_inputs_and_outputs(into, out):
    """Squares of responses overflowed."""
    found = certified_norm(realisation(in_units(into, out), 0.0)) / (into * out)
    assert NORM <= found * (1 + 1e-12) <= NORM * (1 + 2e-4)


def test_a_difference_of_systems_in_far_units_of_states():
    """Its balancing did not find that the states of one are 1e200 times larger."""
    between = difference_of(in_units(1e-200, 1e200), in_units(0.5, 1.0))
    found = certified_norm(realisation(between, 0.0))
    assert NORM / 2 <= found * (1 + 1e-12) <= NORM / 2 * (1 + 2e-4)

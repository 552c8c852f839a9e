"""Parts of a generalised plant: nominal, unstructured, weighted, its performance structure."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.structure import Complex, Full, Real, Structure
from workbench.systems.generalised_plant import GeneralisedPlant

OMEGA = np.geomspace(0.01, 100, 30)
STRUCTURE = Structure([Real(2), Complex(1)])


@pytest.fixture
def plant():
    """Three perturbation channels, two exogenous, three performance, one control, two measured."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(4, 4)) - 4 * np.eye(4)
    B, C, D = (rng.normal(size=shape) for shape in ((4, 6), (8, 4), (8, 6)))
    inputs = ["d1", "d2", "d3", "w1", "w2", "u"]
    outputs = ["e1", "e2", "e3", "z1", "z2", "z3", "y1", "y2"]
    return GeneralisedPlant(control.ss(A, B, C, D, inputs=inputs, outputs=outputs), STRUCTURE, 1, 2)


def test_the_nominal_plant_is_what_the_perturbation_leaves(plant):
    nominal = plant.nominal()
    assert (nominal.structure, nominal.controls, nominal.measurements) == (None, 1, 2)
    assert (nominal.performance, nominal.exogenous) == (3, 2)
    assert nominal.system.output_labels == ["z1", "z2", "z3", "y1", "y2"]
    assert nominal.system.input_labels == ["w1", "w2", "u"]
    whole = plant.response(OMEGA)[:, 3:, 3:]  # BLAS sums other shapes in another order
    np.testing.assert_allclose(nominal.response(OMEGA), whole, rtol=1e-13, atol=1e-14)
    assert nominal.system.nstates == 4


def test_states_that_only_the_perturbation_reaches_stay():
    system = control.ss(np.diag([-1.0, -2.0]), np.eye(2), np.eye(2), np.zeros((2, 2)))
    plant = GeneralisedPlant(system, Structure([Complex(1)]), 0, 0)
    assert plant.nominal().system.nstates == 2


def test_unstructured_channels_count_as_performance(plant):
    whole = plant.unstructured()
    assert whole.structure is None
    assert (whole.performance, whole.exogenous) == (6, 5)
    assert whole.system is plant.system


def test_weights_act_on_their_own_channels(plant):
    weight = control.ss(-3.0, 2.0, 1.0, 0.5)
    changed = plant.weighted(performance=[2.0], exogenous=[1.0, weight])
    assert changed.system.output_labels == plant.system.output_labels
    assert changed.structure is plant.structure
    expected = plant.response(OMEGA)
    expected[:, 3] *= 2
    expected[:, :, 4] *= (2 / (1j * OMEGA + 3) + 0.5)[:, None]
    np.testing.assert_allclose(changed.response(OMEGA), expected, rtol=1e-9)


def test_more_weights_than_channels_are_refused(plant):
    with pytest.raises(InputError, match="3 exogenous weights for a plant with 2"):
        plant.weighted(exogenous=[1.0, 1.0, 1.0])


def test_performance_adds_a_full_block(plant):
    assert plant.performance_structure == STRUCTURE.with_performance(3, 2)
    assert plant.nominal().performance_structure == Structure([Full(2, 3, name="performance")])
    no_performance = GeneralisedPlant(
        control.ss(-1.0, 1.0, 1.0, 0.0), Structure([Complex(1)]), 0, 0
    )
    with pytest.raises(InputError):
        no_performance.performance_structure  # noqa: B018

"""Systems put together by blocks, as arrays are, and what they are good for."""

import control
import numpy as np
import pytest

from workbench import solve
from workbench.errors import InputError
from workbench.synthesis import MuSynthesis
from workbench.uncertainty import block, block_matrix, dynamics, real, ss, tf

OMEGA = np.geomspace(0.05, 50.0, 9)
LAG = control.tf([3.0], [1.0, 2.0])


def response(system):
    return np.moveaxis(np.asarray(control.ss(system)(1j * OMEGA, squeeze=False)), -1, 0)


def test_members_are_those_of_the_blocks():
    a = real("a", 1.0, percent=30)
    uncertain, numbers = tf([a], [1.0, a]), np.array([[1.0, 2.0]])
    whole = block([[uncertain, numbers], [LAG, np.zeros((1, 2))]])
    assert (whole.noutputs, whole.ninputs) == (2, 3)
    for value in (0.7, 1.0, 1.3):
        expected = np.zeros((len(OMEGA), 2, 3), complex)
        expected[:, :1, :1] = response(uncertain.at(a=value))
        expected[:, :1, 1:] = numbers
        expected[:, 1:, :1] = response(LAG)
        np.testing.assert_allclose(response(whole.at(a=value)), expected, atol=1e-12)


def test_an_element_occurs_as_often_as_in_the_blocks():
    a = real("a", 1.0, percent=30)
    assert block([[ss([[a]], [[1]], [[1]], 0), 1.0]]).structure.rows == 1
    assert block([[a], [a]]).reduced().structure.rows == 1


@pytest.mark.cases(0)
def test_mu_synthesis_of_the_documented_unstable_plant():
    """The example of MATLAB's dksyn, written as there; its page prints a bound of about 0.68."""
    plant, error = control.tf([1.0], [1.0, -1.0]), control.tf([0.25, 0.6], [1.0, 0.006])
    size = control.tf([0.125, 0.25], [1 / 32, 1.0])
    perturbed = control.ss(plant) * (1 + dynamics("InputUnc", 1, 1) * control.ss(size))
    whole = block([[error], [1]]) * block([[1, perturbed]])
    assert whole.nstates == 3
    assert whole.structure.rows == 1
    solution = solve(MuSynthesis(whole.plant(1, 1)), method="dk")
    assert solution.certificate.valid, solution.certificate.failures
    assert solution.answer.upper <= 0.685


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([], "same"),
        ([[]], "same"),
        ([[LAG, LAG], [LAG]], r"\[2, 1\]"),
        (LAG, "rows must be a list"),
        ([LAG], "row 1 must be a list"),
        ([[LAG, "G"]], "block 1, 2"),
        ([[np.ones((2, 1)), LAG]], "block 1, 2 has 1 outputs"),
        ([[np.ones((1, 2))], [LAG]], "its column 2 inputs"),
        ([[LAG, control.tf([1.0], [1.0, 0.5], 0.1)]], "sampl|dt"),
    ],
)
def test_bad_input_is_named(rows, words):
    with pytest.raises(InputError, match=words):
        block(rows)


def test_a_matrix_of_systems_leads_to_block():
    with pytest.raises(InputError, match="`block`"):
        block_matrix([[LAG], [1.0]])

"""What mu is given: odd but meaningful things have answers, wrong ones errors that say why."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import branch_and_bound, frequency_sweep, lower_bound, peak, upper_bound
from workbench.structure import Complex, Full, Real, Structure

MIXED = Structure([Real(1), Complex(1), Full(2, 2)])
BOTH = [upper_bound, lower_bound]


@pytest.mark.parametrize("bound", BOTH)
def test_an_empty_batch(bound):
    assert bound(np.zeros((0, 4, 4)), MIXED).value.shape == (0,)
    assert bound(np.zeros((3, 0, 4, 4)), MIXED).value.shape == (3, 0)


@pytest.mark.parametrize("bound", BOTH)
def test_batches_keep_their_axes(bound):
    M = np.random.default_rng(0).normal(size=(2, 3, 4, 4))
    value = bound(M, MIXED).value
    assert value.shape == (2, 3)
    assert value[1, 2] == pytest.approx(float(bound(M[1, 2], MIXED).value), rel=1e-3)


@pytest.mark.parametrize("bound", BOTH)
def test_lists_and_integers(bound):
    lists = [[1, 2], [3, 4]]
    structure = Structure([Full(2, 2)])
    expected = np.linalg.norm(lists, 2)
    assert bound(lists, structure).value == pytest.approx(expected, rel=1e-6)
    assert bound(np.array(lists), structure).value == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("bound", BOTH)
def test_measured_responses_are_matrices_at_their_frequencies(bound):
    values = np.random.default_rng(1).normal(size=(3, 2, 2)) + 1j
    data = control.frd(np.moveaxis(values, 0, -1), [1.0, 2.0, 3.0])
    structure = Structure([Complex(1), Complex(1)])
    assert np.array_equal(bound(data, structure).value, bound(values, structure).value)
    with pytest.raises(InputError, match=r"not StateSpace; .* peak\(system, structure\)"):
        bound(control.ss(-1, 1, 1, 0), structure)


@pytest.mark.parametrize("ask", [*BOTH, branch_and_bound, peak, frequency_sweep])
def test_pairs_in_place_of_a_structure(ask):
    given = control.tf(1, [1, 1]) if ask in (peak, frequency_sweep) else np.eye(1)
    with pytest.raises(InputError, match=r"must be a Structure, not list.*from_pairs"):
        ask(given, [[1, 1]])
    ask(given, Structure.from_pairs([[1, 1]]))


@pytest.mark.parametrize("ask", [peak, frequency_sweep])
@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.tf(1, [1, -1]), "unstable"),
        (control.tf(1, [1, 0]), "imaginary axis"),
        (control.tf(1, [1, 0, 4]), "imaginary axis"),
        (control.tf([1, 0, 0], [1, 1]), "improper"),
        (control.tf(1, [1, 1.5], 0.1), "unstable: it has the pole z = -1.5"),
        (control.ss(-1, 1, [[1], [1]], [[0], [0]]), "structure"),
        (np.eye(1), "StateSpace"),
    ],
)
def test_systems_that_will_not_do(ask, system, words):
    with pytest.raises(InputError, match=words):
        ask(system, Structure([Full(1, 1)]))


def test_a_system_without_states():
    found = peak(control.ss([], [], [], [[1.0, 2.0], [3.0, 4.0]]), Structure([Full(2, 2)]))
    assert found.lower == pytest.approx(np.linalg.norm([[1, 2], [3, 4]], 2))
    assert found.lower <= found.upper <= 1.002 * found.lower


def test_a_transfer_function_of_many_inputs_and_outputs():
    lag, fast = [[1.0], [2.0]], [[1.0, 1.0], [0.1, 1.0]]
    system = control.tf([lag, lag[::-1]], [fast, fast])
    norm = control.norm(control.ss(system), "inf", tol=1e-8)
    found = peak(system, Structure([Full(2, 2)]))
    assert found.lower <= norm * (1 + 1e-6)
    assert norm <= found.upper <= 1.002 * norm


def test_real_scalars_alone_are_explained():
    with pytest.raises(InputError, match=r"not continuous.*complex_part"):
        peak(control.tf(1, [1, 1]), Structure([Real(1)]))
    found = peak(control.tf(1, [1, 1]), Structure([Real(1)]), complex_part=0.02)
    assert found.complex_part == 0.02
    assert found.lower == pytest.approx(1.02, rel=2e-3)


@pytest.mark.parametrize("scale", [1e-150, 1e-75, 1.0, 1e75, 1e150])
def test_scales(scale):
    M = np.random.default_rng(1).normal(size=(4, 4)) + 0.5j
    for bound in BOTH:
        assert bound(scale * M, MIXED).value == pytest.approx(
            scale * float(bound(M, MIXED).value), rel=1e-3
        )
    found = peak(scale * control.tf(1, [1, 1]), Structure([Full(1, 1)]))
    assert found.lower <= scale * (1 + 1e-9)
    assert scale <= found.upper or found.upper <= 1e-8


@pytest.mark.parametrize("bound", BOTH)
def test_entries_of_all_sizes_in_one_matrix(bound):
    M = np.array([[1.0, 1e12], [1e-12, 1.0]])
    assert bound(M, Structure([Complex(1)] * 2)).value == pytest.approx(2, rel=1e-6)

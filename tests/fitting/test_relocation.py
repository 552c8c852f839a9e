"""Compiled least squares of the relocations, against LAPACK."""

import numpy as np
import pytest

from workbench.fitting.response.relocation import denominator_matrix, nearest_coefficients
from workbench.fitting.response.vector_fitting import partial_fractions, real_groups


@pytest.mark.cases(1)
@pytest.mark.parametrize("grade", [0.0, 100.0, 250.0])
def test_graded_columns(grade):
    rng = np.random.default_rng(0)
    size = 10.0 ** rng.uniform(-grade, grade, 6) if grade < 200 else np.full(6, 1e-140)
    columns, target = rng.normal(size=(200, 6)), rng.normal(size=200)
    expected = np.linalg.lstsq(columns, target)[0]
    found = nearest_coefficients(np.vstack([(columns * size).T, target]))
    assert found * size == pytest.approx(expected, rel=1e-10)


def test_ill_conditioned_columns_fit_as_well():
    columns = np.vander(np.linspace(1, 2, 300), 12)
    target = np.sin(np.linspace(0, 9, 300))
    best = columns @ np.linalg.lstsq(columns, target)[0] - target
    left = columns @ nearest_coefficients(np.vstack([columns.T, target])) - target
    assert np.linalg.norm(left) <= np.linalg.norm(best) * (1 + 1e-6)


def test_columns_that_depend_on_others_or_vanish_get_nothing():
    rng = np.random.default_rng(1)
    a, b, target = rng.normal(size=(3, 50))
    found = nearest_coefficients(np.vstack([a, 2 * a, np.zeros(50), b, target]))
    expected = np.linalg.lstsq(np.column_stack([a, b]), target)[0]
    assert found[[0, 3]] == pytest.approx(expected, rel=1e-10)
    assert found[[1, 2]].tolist() == [0.0, 0.0]


def test_zeros_of_a_known_denominator():
    """Errors that vanish for one denominator: its zeros are the eigenvalues."""
    x = np.linspace(0.5, 5, 80)
    poles, zeros = np.array([-1.0, -0.2 + 2j, -0.2 - 2j]), np.array([-0.7, -0.1 + 3j, -0.1 - 3j])
    groups = real_groups(poles.astype(complex))
    fractions = np.hstack([*(partial_fractions(each, x) for each in groups), np.ones((80, 1))])
    s = 1j * x[:, None]
    wanted = np.prod(s - zeros, axis=1) / np.prod(s - poles, axis=1) - 1
    share = np.linalg.lstsq(
        np.vstack([fractions[:, :-1].real, fractions[:, :-1].imag]),
        np.concatenate([wanted.real, wanted.imag]),
    )[0]
    away = np.linalg.svd(np.append(share, 1.0)[None])[2][1:]  # orthogonal to the denominator
    sums = fractions.real.sum(axis=0)
    total = float(sums @ np.append(share, 1.0))
    upper = np.array([group[0] for group in groups])
    matrix = denominator_matrix(np.ascontiguousarray(away), sums, 1.0, total, upper)
    assert np.sort_complex(np.linalg.eigvals(matrix)) == pytest.approx(
        np.sort_complex(zeros), rel=1e-9
    )

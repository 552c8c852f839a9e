"""Systems of given orders fitted to matrix responses."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.fitting import fit_matrix_response

OMEGA = np.geomspace(0.01, 100.0, 100)


def response(system, omega=OMEGA):
    return np.moveaxis(np.asarray(system(1j * omega, squeeze=False)), -1, 0)


def drawn(order, p, m, seed):
    rng = np.random.default_rng(seed)
    blocks = [np.diag([-a]) for a in rng.uniform(0.3, 3, order % 2)]
    for w in np.geomspace(0.5, 20, order // 2):
        z = rng.uniform(0.02, 0.5)
        blocks.append(np.array([[-z * w, w], [-w, -z * w]]))
    A = np.zeros((order, order))
    place = 0
    for block in blocks:
        A[place : place + len(block), place : place + len(block)] = block
        place += len(block)
    return control.ss(
        A, rng.normal(size=(order, m)), rng.normal(size=(p, order)), rng.normal(size=(p, m))
    )


@pytest.mark.parametrize(
    ("order", "p", "m"), [(1, 1, 1), (4, 2, 2), (5, 1, 3), (6, 3, 2), (9, 2, 2)]
)
@pytest.mark.parametrize("seed", range(3))
def test_a_system_of_the_order_is_found_again(order, p, m, seed):
    given = response(drawn(order, p, m, seed))
    found = fit_matrix_response(OMEGA, given, order)
    assert found.nstates == order
    assert found.poles().real.max() < 0
    np.testing.assert_allclose(response(found), given, atol=1e-7 * np.abs(given).max())


def test_a_lower_order_is_nearly_as_good_as_balanced_truncation():
    system = drawn(8, 2, 2, 1)
    given = response(system)
    reduced = control.balred(system, 4)
    weight = np.ones_like(given.real)
    errors = [
        np.linalg.norm(response(each) - given)
        for each in (fit_matrix_response(OMEGA, given, 4, weight=weight), reduced)
    ]
    assert errors[0] <= 1.05 * errors[1]


def test_noise_is_averaged():
    rng = np.random.default_rng(0)
    given = response(drawn(4, 2, 2, 5))
    size = 0.01 * np.abs(given).max()
    noise = size * (rng.normal(size=given.shape) + 1j * rng.normal(size=given.shape))
    found = fit_matrix_response(OMEGA, given + noise, 4, weight=np.ones(given.shape))
    assert np.sqrt(np.mean(np.abs(response(found) - given) ** 2)) <= 0.6 * size


def test_order_zero_is_the_mean():
    given = np.ones((100, 2, 1)) * (3.0 + 0j)
    found = fit_matrix_response(OMEGA, given, 0)
    np.testing.assert_allclose(found.D, 3.0)


GIVEN = np.ones((100, 2, 2), complex)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"omega": OMEGA[::-1]}, "rise"),
        ({"values": GIVEN[:, 0]}, r"\(100, p, m\)"),
        ({"values": GIVEN * np.nan}, "finite"),
        ({"order": -1}, "order"),
        ({"order": 100}, "order 100 needs"),
        ({"order": 2.5}, "order"),
        ({"weight": np.ones(3)}, "weight"),
        ({"weight": -np.ones(GIVEN.shape)}, "positive"),
    ],
)
def test_bad_input_is_named(changes, words):
    with pytest.raises(InputError, match=words):
        fit_matrix_response(**({"omega": OMEGA, "values": GIVEN, "order": 2} | changes))

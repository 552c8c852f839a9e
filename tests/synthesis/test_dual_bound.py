"""Sets of T that a level allows, and levels that no controller reaches."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.executor import Context
from workbench.solvers import Options
from workbench.synthesis import (
    AnalyticBasis,
    DualCertificate,
    LoopWeights,
    allowed_discs,
    allowed_polygons,
    highest_proven,
    hinf,
    least_mu,
    regularised,
)
from workbench.uncertainty import GeneralisedPlant

COUNT = 60
BASIS = AnalyticBasis(2 * np.pi * np.geomspace(30.0, 3e5, 24), (1e-3, 1e7))


@pytest.fixture(scope="module")
def weights():
    rng = np.random.default_rng(8)
    sizes = 10 ** rng.uniform(-1.5, 1.0, (4, COUNT))
    return LoopWeights(*sizes[:3], sizes[3] * np.exp(2j * np.pi * rng.uniform(size=COUNT)))


@pytest.fixture(scope="module")
def plane():
    """T (N, 1) all over the plane, dense about 0 and 1."""
    rng = np.random.default_rng(9)
    away = 10 ** rng.uniform(-3, 0.5, 20_000) * np.exp(2j * np.pi * rng.uniform(size=20_000))
    return np.concatenate([away, 1 + away])[:, None]


DIRECTIONS = np.exp(2j * np.pi * np.arange(8) / 8)


def reached(weights, level, T, direction):
    """Largest Re(T direction) of the T within the level (F,), -inf where there is none."""
    along = (T * direction).real
    return np.where(weights.mu(T) <= level, along, -np.inf).max(axis=0)


@pytest.mark.parametrize("factor", [1.05, 1.5, 4.0])
def test_polygons_hold_every_allowed_T_and_little_more(weights, plane, factor):
    """Each weight's own level: frequencies one by one, with its T among those searched."""
    least = least_mu(weights)
    for i in range(0, COUNT, 6):
        one, level = weights.at(np.array([i])), factor * least.upper[i]
        sets = allowed_polygons(one, level)
        assert not sets.empty
        T = np.concatenate([plane, [[least.T[i]]], least.T[i] + 0.1 * plane])
        for direction in DIRECTIONS:
            inner = reached(one, level, T, direction)[0]
            outer = sets.support(np.array([direction]))[0]
            assert inner <= outer + 1e-12
            # Beside the nearest samples: parts of an angle, and as much of the level.
            more = reached(one, 1.08 * level, T, direction)[0]
            assert outer <= more + 0.1 * abs(more) + 0.02


def test_polygons_below_the_least_mu_are_empty(weights):
    least = least_mu(weights)
    for i in range(0, COUNT, 6):
        one = weights.at(np.array([i]))
        assert allowed_polygons(one, 0.9 * least.lower[i]).empty


def test_without_uncertainty_polygons_surround_discs(weights):
    nominal = replace(weights, circular=np.zeros(COUNT), real=np.zeros(COUNT))
    level = 1.3 * least_mu(nominal).upper.max()
    inner, outer = allowed_discs(nominal, level), allowed_polygons(nominal, level)
    for direction in DIRECTIONS:
        h = np.full(COUNT, direction)
        assert (inner.support(h) <= outer.support(h) + 1e-12).all()
    assert allowed_discs(nominal, 0.99 * least_mu(nominal).upper.max()).empty


def test_circles_hold_the_corners(weights):
    sets = allowed_polygons(weights, 2.0 * least_mu(weights).upper.max())
    circle = sets.circle
    for direction in DIRECTIONS:
        h = np.full(COUNT, direction)
        held = (circle.center * h).real + circle.radius
        assert (sets.support(h) <= held + 1e-12).all()


def test_stable_T_integrates_to_nothing_with_h():
    x = np.random.default_rng(10).normal(size=len(BASIS.corners))
    omega, width = BASIS.midpoints(40_000)
    T = 1 / (1 + 1j * omega / 2e4) ** 2
    product = T * DualCertificate(1.0, x, BASIS).h(omega)
    assert abs(width @ product.real) < 1e-5 * (width @ np.abs(product))
    unstable = np.conj(T) * DualCertificate(1.0, x, BASIS).h(omega)  # poles in the right half-plane
    assert abs(width @ unstable.real) > 1e-3 * (width @ np.abs(unstable))


CORNER, LEAK = 2 * np.pi * 1000.0, 1e-3


def low_pass(omega, leak=0.0):
    """W_p of one integrator and an actuator of two, all moved left by ``leak``, in CORNERs."""
    s = 1j * omega / CORNER + leak
    return LoopWeights(np.abs(1 / s), np.abs(s**2), 0.0, 0.0)


def sets(omega, level):
    return allowed_discs(low_pass(omega, LEAK), level)


def test_the_level_of_a_plant_of_two_integrators_is_that_of_its_riccati_equations():
    import control

    actuator = control.ss([[-LEAK, 1], [0, -LEAK]], [[0], [1]], [[1, 0]], 0)
    plant = control.append(actuator, control.ss(-LEAK, 1, 1, 0))
    # (w, u) -> (z_p, z_u, y): e = w - x drives the weight, and is y.
    A = plant.A.copy()
    A[2, :2] -= actuator.C[0]
    B = np.array([[0, 0], [0, 1], [1, 0.0]])
    C = np.array([[0, 0, 1], [0, 0, 0], [-1, 0, 0.0]])
    D = np.array([[0, 0], [0, 1], [1, 0.0]])
    norm = hinf(regularised(GeneralisedPlant(control.ss(A, B, C, D), None, 1, 1), 1e-3)).norm
    omega, _ = BASIS.midpoints(300)
    low = least_mu(low_pass(omega, LEAK)).upper.max()
    proof = highest_proven(sets, BASIS, 1.01 * low, norm, Context(Options()))
    assert proof is not None
    assert 0.97 * norm < proof.level <= norm
    assert proof.integral(sets, 2500) < 0.0


def test_a_level_that_a_controller_has_is_not_proven():
    """T = 1 / (s + 1)^2 lies in the sets: no h is negative over them."""
    omega, _ = BASIS.midpoints(300)
    T = 1 / (1 + 1j * omega / CORNER) ** 2
    level = 1.02 * low_pass(omega, LEAK).mu(T).max()
    assert highest_proven(sets, BASIS, level, 1.5 * level, Context(Options())) is None


@pytest.mark.parametrize(
    ("corners", "band"),
    [([], (1.0, 2.0)), ([-1.0], (1.0, 2.0)), ([1.0], (2.0, 1.0)), ([1.0], (0.0, 1.0))],
)
def test_a_basis_that_is_none_is_refused(corners, band):
    with pytest.raises(InputError, match=r"corners|band"):
        AnalyticBasis(np.array(corners), band)


def test_the_functions_of_a_basis_are_orthogonal():
    """Against each other in the integral over all frequencies; each has the square 4 pi corner."""
    basis = AnalyticBasis(np.array([1.0, 3.0, 20.0]), (1e-5, 1e5))
    omega, width = basis.midpoints(20_000)
    h = basis.response(omega)
    products = 2 * np.einsum("f,fi,fj->ij", width, h, h.conj()).real
    np.testing.assert_allclose(products, np.diag(4 * np.pi * basis.corners), atol=2e-2)

"""Levels that no controller reaches: known truths, attacks, and a second opinion by quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.solvers import Options
from workbench.synthesis import (
    AnalyticBasis,
    DualCertificate,
    LoopFunctions,
    highest_certificate,
    hinf,
    least_mu,
    regularise,
)
from workbench.synthesis.limits.dual_search import dual_candidate
from workbench.uncertainty import GeneralisedPlant

NONE = np.empty(0)
ONE = Rational(NONE, NONE, 1.0)
BASIS = AnalyticBasis(2 * np.pi * np.geomspace(30.0, 3e5, 24), (1e-3, 1e7))
UNIT = AnalyticBasis(np.geomspace(0.02, 300.0, 20), (1e-4, 1e4))
CORNER, LEAK = 2 * np.pi * 1000.0, 1e-3


def constant(gain):
    return Rational(NONE, NONE, gain)


def proven(loop, basis, low, high):
    return highest_certificate(loop, basis, low, high, Context(options=Options()))


def low_pass(leak=LEAK * CORNER):
    """W_p of one integrator and an actuator of two, all moved left by ``leak``."""
    return LoopFunctions(
        Rational(NONE, [-leak], CORNER), ONE, Rational(NONE, [-leak, -leak], CORNER**2)
    )


# --- known truths -----------------------------------------------------------------------------


@pytest.mark.slow
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
    norm = hinf(regularise(GeneralisedPlant(control.ss(A, B, C, D), None, 1, 1), 1e-3)).norm
    found = proven(low_pass(), BASIS, 0.5 * norm, 1.1 * norm)
    assert found is not None
    assert 0.99 * norm < found.level <= norm


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    "p", [1.0, *(pytest.param(p, marks=pytest.mark.slow) for p in (0.1, 30.0))]
)
def test_an_unstable_pole_costs_twice_its_gain(p):
    """G = 1 / (s - p), W_u = 1: |K S| is 2 p at least, by Nehari; K = 2 p has it, and |S| = 1."""
    loop = LoopFunctions(constant(0.1 * p), ONE, Rational(NONE, [p], 1.0))
    basis = AnalyticBasis(p * UNIT.corners, UNIT.band_hz, poles=[p])
    found = proven(loop, basis, p, 3 * p)
    assert found is not None
    assert 1.98 * p < found.level <= np.hypot(2.0, 0.1) * p
    without = AnalyticBasis(p * UNIT.corners, UNIT.band_hz)
    assert proven(loop, without, 1.5 * p, 3 * p) is None


@pytest.mark.cases(0)
def test_a_zero_in_the_right_half_plane_costs_the_weight_there():
    """|W_p S| is |W_p(z)| at least; T = (1 - W_p(z) / W_p) / (1 + s / 100)^2 is not far off."""
    z, W_p = 3.0, Rational([-8.0], [-0.01], 0.5)
    plant, control = Rational([z], [-1.0, -1.0], 1.0), constant(1e-2)
    loop = LoopFunctions(W_p, control, plant)
    truth = abs(W_p(z))
    omega = np.geomspace(1e-4, 1e6, 20_000)
    T = (1 - W_p(z) / W_p(1j * omega)) / (1 + 1j * omega / 100.0) ** 2
    reached = loop.at(omega).mu(T).max()
    basis = AnalyticBasis(np.geomspace(0.1, 3e3, 24), (1e-4, 1e5), zeros=[z])
    found = proven(loop, basis, 0.6 * truth, 1.5 * truth)
    assert found is not None
    assert 0.95 * truth < found.level <= reached


@pytest.mark.cases(0)
def test_complex_zeros_and_poles_of_the_plant_are_used():
    """A pole pair p: W_u = 1, G = 1 / ((s - p)(s - p*)) has the known |K S| of Nehari's theorem."""
    p = 1.0 + 2.0j
    loop = LoopFunctions(constant(1e-3), ONE, Rational(NONE, [p, p.conjugate()], 1.0))
    # inf |K S| = 1 / smallest Hankel singular value of the mirrored stable part of G*.
    import control

    G = control.ss([[-2.0, -5.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, 1.0]], 0)  # G(-s)
    least = 1 / np.sqrt(np.linalg.eigvals(control.gram(G, "c") @ control.gram(G, "o")).real.min())
    found = proven(
        loop, AnalyticBasis(UNIT.corners, UNIT.band_hz, poles=[p]), 0.5 * least, 2 * least
    )
    assert found is not None
    assert 0.97 * least < found.level <= least * (1 + 1e-2)


# --- attacks: a level that a controller has is not proven, whatever the h -----------------------

RESONANT = Rational(NONE, [-1e-4 + 100j, -1e-4 - 100j], 1e4)
ATTACKS = {
    "two integrators": (low_pass(), Rational(NONE, [-CORNER, -CORNER], CORNER**2), BASIS),
    "pure integrators": (low_pass(0.0), Rational(NONE, [-CORNER, -CORNER], CORNER**2), BASIS),
    "damping 1e-6": (
        LoopFunctions(
            Rational([-5.0], [-1e-3], 1.0),
            constant(1e-2),
            RESONANT,
            circular=Rational([-9.0], [-90.0], 0.5),
        ),
        Rational(NONE, [-20.0, -20.0], 400.0),
        AnalyticBasis(np.geomspace(0.1, 1e4, 20), (1e-4, 1e5)),
    ),
    "resonant weights": (
        LoopFunctions(
            Rational([-1e-4 + 7j, -1e-4 - 7j], [-1e-5 + 7j, -1e-5 - 7j], 1.0),
            ONE,
            Rational(NONE, [-1.0, -2.0], 2.0),
            circular=Rational([-3.0], [-1e-6 + 9j, -1e-6 - 9j], 1e-5),
            real=Rational([2.0], [-4.0], 0.4),
        ),
        Rational(NONE, [-3.0, -3.0], 9.0),
        UNIT,
    ),
    "steep": (
        LoopFunctions(Rational(4 * [-1.0], 4 * [-0.05], 1.0), ONE, Rational(NONE, 5 * [-1.0], 1.0)),
        Rational(NONE, 6 * [-8.0], 8.0**6),
        UNIT,
    ),
    "graded": (
        LoopFunctions(
            Rational([-1e3], [-1e-3], 1e-6), constant(1e-9), Rational([-1e5], [-1e-2, -10.0], 1e3)
        ),
        Rational(NONE, [-5.0, -7e3], 3.5e4),
        AnalyticBasis(np.geomspace(1e-2, 1e6, 20), (1e-4, 1e6)),
    ),
    "tails that vary": (
        LoopFunctions(
            Rational([-1e6], [-1e-6], 1e-2), ONE, Rational([-1e7], [-1.0, -1e5], 10.0), circular=ONE
        ),
        Rational(NONE, [-50.0, -60.0], 3000.0),
        UNIT,
    ),
}
LONG = {"graded", "steep", "tails that vary"}


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in ATTACKS],
)
def test_a_level_that_a_stable_T_has_is_never_proven(name):
    loop, T, basis = ATTACKS[name]
    roots = [
        root
        for each in (loop.plant, loop.performance, loop.circular)
        if each is not None
        for root in np.concatenate([each.poles, each.zeros])
    ]
    about = [abs(root) * (1 + np.linspace(-1e-5, 1e-5, 2001)) for root in roots if root != 0]
    omega = np.unique(np.concatenate([np.geomspace(1e-7, 1e9, 20_000), *about]))
    weights = loop.at(omega)
    level = float(weights.mu(T.response(omega)).max()) * (1 + 1e-6)
    best = dual_candidate(loop, basis, level, Context(options=Options()))
    for factor in (1.0, 1.001, 1.5):
        assert DualCertificate(factor * level, best.coefficients, basis).excess(loop) >= 0.0
    rng = np.random.default_rng(3)
    for _ in range(3):
        x = rng.normal(size=basis.size) * 10 ** rng.uniform(-3, 3, basis.size)
        assert DualCertificate(level, x, basis).excess(loop) >= 0.0


def test_a_level_that_one_frequency_forbids_is_proven_by_any_h():
    loop, _, basis = ATTACKS["resonant weights"]
    pointwise = least_mu(loop.at(2 * np.pi * np.geomspace(*basis.band_hz, 5000))).lower.max()
    x = np.ones(basis.size)
    assert DualCertificate(0.99 * pointwise, x, basis).excess(loop) == -np.inf


# --- second opinion ---------------------------------------------------------------------------


@pytest.mark.slow
def test_quadrature_of_the_closed_form_agrees_with_the_bound_from_below():
    loop = low_pass()
    for factor in (0.9, 0.97):
        found = proven(loop, BASIS, 0.5 * factor, 1.6 * factor)
        assert found is not None

        def along(logarithm, found=found):
            omega = np.exp(np.atleast_1d(logarithm))
            s = 1j * omega + LEAK * CORNER
            W_p, W_u = np.abs(CORNER / s) ** 2, np.abs(s / CORNER) ** 4
            disc = np.sqrt(found.level**2 / (W_p + W_u) - W_p * W_u / (W_p + W_u) ** 2)
            h = found.h(omega)
            return float(((W_p / (W_p + W_u) * h.real + disc * np.abs(h)) * omega)[0])

        ends = np.log(2 * np.pi * np.geomspace(1e-3, 1e7, 60))
        parts = [quad(along, *pair, epsabs=1e-9)[0] for pair in pairwise(ends)]
        tail = 1e-4
        assert sum(parts) - tail <= found.excess(loop) < 0.0


def test_stable_T_integrates_to_nothing_with_h():
    x = np.random.default_rng(10).normal(size=len(BASIS.corners))
    omega, width = BASIS.midpoints(40_000)
    T = 1 / (1 + 1j * omega / 2e4) ** 2
    product = T * DualCertificate(1.0, x, BASIS).h(omega)
    assert abs(width @ product.real) < 1e-5 * (width @ np.abs(product))
    unstable = np.conj(T) * DualCertificate(1.0, x, BASIS).h(omega)  # poles in the right half-plane
    assert abs(width @ unstable.real) > 1e-3 * (width @ np.abs(unstable))


def test_an_unstable_plant_gives_the_integral_that_is_known():
    """T = 1 at the plant's poles, 0 at its zeros."""
    p, z = 1.0 + 2.0j, 0.5
    basis = AnalyticBasis([1.0, 20.0], (1e-6, 1e6), zeros=[z], poles=[p])
    a = np.linalg.solve(
        np.array([[1, z, z**2], [1, p.real, (p**2).real], [0, p.imag, (p**2).imag]]),
        np.array([0.0, ((p + 3) ** 5).real, ((p + 3) ** 5).imag]),
    )
    omega, width = basis.midpoints(40_000)
    s = 1j * omega
    T = (a[0] + a[1] * s + a[2] * s**2) / (s + 3) ** 5
    found = width @ (T[:, None] * basis.response(omega)).real
    np.testing.assert_allclose(found, np.pi * basis.known, atol=1e-4 * np.pi)


@pytest.mark.cases(0)
def test_changed_proofs_prove_nothing():
    found = proven(low_pass(), BASIS, 0.5, 1.6)
    assert found.excess(low_pass()) < 0.0
    for factor in (-1.0, 0.0):
        assert (
            DualCertificate(found.level, factor * found.coefficients, BASIS).excess(low_pass()) >= 0
        )
    assert DualCertificate(1.1 * found.level, found.coefficients, BASIS).excess(low_pass()) > 0
    lost = np.full(BASIS.size, np.nan)
    assert not DualCertificate(found.level, lost, BASIS).excess(low_pass()) < 0.0


# --- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("corners", "band"),
    [([], (1.0, 2.0)), ([-1.0], (1.0, 2.0)), ([1.0], (2.0, 1.0)), ([1.0], (0.0, 1.0))],
)
def test_a_basis_that_is_none_is_refused(corners, band):
    with pytest.raises(InputError, match=r"corners|band"):
        AnalyticBasis(np.array(corners), band)


@pytest.mark.parametrize(("zeros", "poles"), [([-1.0], []), ([], [1 - 2j]), ([1.0], [1.0])])
def test_poles_of_h_are_points_of_the_right_half_plane(zeros, poles):
    with pytest.raises(InputError, match=r"zeros|poles"):
        AnalyticBasis([1.0], (1.0, 2.0), zeros=zeros, poles=poles)


def test_poles_of_h_that_the_plant_does_not_have_are_refused():
    wrong = DualCertificate(1.0, np.ones(2), AnalyticBasis([1.0], (1.0, 2.0), zeros=[3.0]))
    with pytest.raises(InputError, match="zeros"):
        wrong.excess(low_pass())


def test_a_T_that_need_not_fall_is_refused():
    with pytest.raises(InputError, match="grow"):
        LoopFunctions(ONE, ONE, Rational([-2.0], [-1.0], 1.0))


def test_the_functions_of_a_basis_are_orthogonal():
    """Against each other in the integral over all frequencies; each has the square 4 pi corner."""
    basis = AnalyticBasis(np.array([1.0, 3.0, 20.0]), (1e-5, 1e5))
    omega, width = basis.midpoints(20_000)
    h = basis.response(omega)
    products = 2 * np.einsum("f,fi,fj->ij", width, h, h.conj()).real
    np.testing.assert_allclose(products, np.diag(4 * np.pi * basis.corners), atol=2e-2)

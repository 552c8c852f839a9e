"""The search for the least worst error: derivatives, known optima, a peer, and hostile starts."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import workbench.fitting  # noqa: F401  registers the methods
from workbench.fitting.rational import Rational
from workbench.fitting.response.fit_state import FitState
from workbench.fitting.response.interior_point import least_peak
from workbench.fitting.response.least_peak import factored, polished
from workbench.fitting.response.program import ResponseFit
from workbench.solution import solve

OMEGA = np.geomspace(0.1, 1e3, 60)
TRUTH = Rational([-40.0, 3.0], [-2 + 30j, -2 - 30j, -5.0], 7.0)


def noisy(seed, level=0.2, omega=OMEGA):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size)
    return TRUTH.response(omega) * (1 + level * noise)


def started(program, start=TRUTH, off=0.0, seed=0):
    form = factored(program, start)
    rng = np.random.default_rng(seed)
    return FitState(program, form, form.start * (1 + off * rng.normal(size=form.start.size)))


@pytest.mark.parametrize("minimum_phase", [False, True])
@pytest.mark.parametrize("unstable", [0, 1])
def test_curvature_is_the_derivative_of_the_slopes(minimum_phase, unstable):
    start = Rational([-40.0, -3.0], [-2 + 30j, -2 - 30j, 5.0 if unstable else -5.0], 7.0)
    program = ResponseFit(OMEGA, noisy(0), 3, minimum_phase=minimum_phase, unstable_poles=unstable)
    here = started(program, start, off=0.05)
    rng = np.random.default_rng(1)
    factor = rng.normal(size=OMEGA.size) + 1j * rng.normal(size=OMEGA.size)

    def gradient(step):
        return (factor @ here.moved(step).slopes).real

    found = here.curvature(factor)
    for k, size in enumerate(1e-5 * here.natural_units):
        step = size * np.eye(len(found))[k]
        expected = (gradient(step) - gradient(-step)) / (2 * size)
        assert found[k] == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max())


def test_best_constant():
    response = np.array([1.0 + 2j, -0.5 + 0.1j, 3.0 - 1j, 0.4 + 0.4j])
    program = ResponseFit(np.arange(1.0, 5.0), response, 0, weight=np.ones(4))
    best = minimize_scalar(lambda c: np.abs(c - response).max(), bounds=(-3, 3), method="bounded")
    found = least_peak(started(program, Rational([], [], -2.0)))
    assert found.peak == pytest.approx(best.fun, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("order", [2, 3, 5])
def test_ipopt_goes_on_to_nothing_better(seed, order):
    program = ResponseFit(OMEGA, noisy(seed), order, minimum_phase=bool(seed % 2))
    own, peer = (
        program.metrics(solve(program, method=name).answer)["error_worst"]
        for name in ("vector-fitting", "ipopt")
    )
    assert own * (1 - 1e-2) <= peer <= own


WIDE, NARROW = np.geomspace(1e-6, 1e6, 60), 1 + 1e-9 * np.arange(60)
HOSTILE = {
    "graded weights": (OMEGA, noisy(1), np.geomspace(1e-12, 1e12, OMEGA.size)),
    "one weight counts": (OMEGA, noisy(2), np.where(np.arange(60) == 30, 1e9, 1e-9)),
    "huge": (OMEGA, 1e120 * noisy(3), None),
    "tiny": (OMEGA, 1e-120 * noisy(4), None),
    "twelve decades": (WIDE, noisy(5, omega=WIDE), None),
    "close frequencies": (NARROW, noisy(6, omega=NARROW), None),
    "few data": (OMEGA[::15], noisy(7)[::15], None),
    "noise alone": (OMEGA, noisy(8, level=1e6), None),
    "one outlier": (OMEGA, np.where(np.arange(60) == 20, 1e6, 1.0) * noisy(9), np.ones(60)),
    "zeros": (OMEGA, np.where(np.arange(60) % 2, 0.0, noisy(10)), np.ones(60)),
}


@pytest.mark.parametrize("off", [0.0, 0.3, 3.0])
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_data_make_nothing_worse(case, off):
    omega, response, weight = HOSTILE[case]
    program = ResponseFit(omega, response, 3, weight=weight)
    start = started(program, off=off)
    found = least_peak(start)
    assert np.isfinite(found.vector).all()
    assert found.peak <= start.peak < np.inf


def test_data_that_the_order_matches_stay_matched():
    program = ResponseFit(OMEGA, TRUTH.response(OMEGA), 3)
    start = Rational([-39.0, 3.1], [-2 + 29j, -2 - 29j, -6.0], 7.0)
    assert polished(program, start)[0] < 1e-12


def test_an_extreme_optimum_gives_way_to_one_that_doubles_realise():
    """Seed 1016: a pair of poles with the damping 1e-18 at a datum."""
    rng = np.random.default_rng(1016)
    omega = np.unique(10 ** rng.uniform(-2, 3, 40))
    response = rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size)
    program = ResponseFit(omega, response, 3, minimum_phase=True)
    assert solve(program, method="vector-fitting").certificate.valid

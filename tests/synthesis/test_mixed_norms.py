"""Mixed H2/H-infinity controllers against scans, other solvers and norms by python-control."""

import math

import control
import numpy as np
import pytest
from perturbed_control import perturbed

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import H2HinfSynthesis, H2Synthesis, Static

SECOND = control.ss([[0.0, 1.0], [1.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
PLANT = perturbed(SECOND)
SAMPLED = perturbed(control.sample_system(SECOND, 0.1))


def norms(plant, K):
    """H2 norm of the performance and H-infinity norm of the perturbation, by python-control."""
    loop = plant.nominal().close(K)
    limited = plant.perturbation().close(K)
    if loop.dt:
        P = control.dlyap(loop.A, loop.B @ loop.B.T)
        energy = math.sqrt(np.trace(loop.C @ P @ loop.C.T + loop.D @ loop.D.T))
        omega = np.geomspace(1e-4, np.pi / loop.dt, 4000)
        return energy, np.abs(limited.frequency_response(omega).complex).max()
    return control.norm(loop, 2), control.linfnorm(limited)[0]


@pytest.mark.cases(1)
@pytest.mark.parametrize("plant", [PLANT, SAMPLED], ids=["continuous", "sampled"])
def test_norms_are_those_of_other_code_and_keep_limit_and_bound(plant):
    solution = wb.solve(H2HinfSynthesis(plant, 2.8))
    answer = solution.answer
    assert solution.holds
    energy, size = norms(plant, answer.K)
    assert answer.norm == pytest.approx(energy, rel=1e-6)
    assert size <= answer.hinf_norm * (1 + 1e-9) and answer.hinf_norm <= 2.8
    assert answer.least <= answer.norm <= answer.bound
    assert any("common" in said for said in solution.certificate.facts)


def test_solvers_agree_on_the_bound():
    bounds = [wb.solve(H2HinfSynthesis(PLANT, 3.5), method=name).answer.bound for name in SOLVERS]
    np.testing.assert_allclose(bounds, bounds[0], rtol=1e-2)


SOLVERS = ("clarabel", "cvxopt")


@pytest.mark.cases(0)
def test_a_limit_that_does_not_bind_leaves_the_best_of_all():
    free = wb.solve(H2Synthesis(PLANT.nominal())).answer
    size = norms(PLANT, free.K)[1]
    for limit, most in ((20.0 * size, 1.05), (1.2 * size, 1.3)):
        answer = wb.solve(H2HinfSynthesis(PLANT, limit)).answer
        assert free.norm * (1 - 1e-6) <= answer.norm <= most * free.norm
    least = wb.solve(H2HinfSynthesis(PLANT, 1.2 * size), method="fixed").answer
    assert least.norm == pytest.approx(free.norm, rel=1e-3)


@pytest.mark.cases(1)
@pytest.mark.parametrize("limit", [1.3, 1.6, 4.0])
def test_a_gain_is_that_of_a_scan(limit):
    a = 1.0
    plant = perturbed(control.ss([[a]], [[1.0]], [[1.0]], [[0.0]]))
    # without noise, which a gain would pass on to u: x' = (a + k) x + d
    quiet = plant.channel(exogenous="d")
    k = -np.linspace(1.001, 40.0, 400001)
    rate = -a - k
    sizes = np.where(np.abs(k) / rate <= limit, np.sqrt((1 + k**2) / (2 * rate)), np.inf)
    solution = wb.solve(H2HinfSynthesis(quiet, limit, family=Static()))
    assert solution.holds
    assert solution.answer.norm == pytest.approx(sizes.min(), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("plant", [PLANT, SAMPLED], ids=["continuous", "sampled"])
def test_descent_of_the_norm_itself_is_no_worse_than_a_common_lyapunov_matrix(plant):
    common = wb.solve(H2HinfSynthesis(plant, 2.8)).answer
    solution = wb.solve(H2HinfSynthesis(plant, 2.8), method="fixed")
    assert solution.holds and solution.answer.norm <= common.norm * (1 + 1e-6)
    energy, size = norms(plant, solution.answer.K)
    assert energy == pytest.approx(solution.answer.norm, rel=1e-6) and size <= 2.8 * (1 + 1e-6)


@pytest.mark.cases(0)
def test_a_limit_below_the_least_one_has_no_controller():
    solution = wb.solve(H2HinfSynthesis(PLANT, 0.9))
    assert solution.answer is None and "gamma may be too small" in solution.message
    # an unstable pole needs |T| of 1 at least: no controller is within the limit
    lag = perturbed(control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])).channel(exogenous="d")
    solution = wb.solve(H2HinfSynthesis(lag, 0.9, family=Static()))
    assert solution.answer is None and "within the limits" in solution.message


@pytest.mark.parametrize(
    ("plant", "gamma", "asked", "said"),
    [
        (PLANT.nominal(), 1.0, {}, "no perturbation"),
        (PLANT, -1.0, {}, "gamma"),
        (PLANT, math.nan, {}, "gamma"),
        (PLANT, 0.0, {}, "gamma"),
        (SECOND, 1.0, {}, "GeneralisedPlant"),
        (PLANT, 1.0, {"further_plants": (PLANT,)}, "need order"),
        (PLANT, 1.0, {"order": 1, "further_plants": (PLANT.nominal(),)}, "further plant 1 has no"),
        (PLANT, 1.0, {"order": -1}, "order is -1"),
        (PLANT, 1.0, {"family": "pid"}, "Family"),
        (PLANT, 1.0, {"largest_gain": 0.0}, "largest_gain"),
        (SAMPLED, 1.0, {"order": 1, "fastest_pole": 1.0}, "continuous"),
    ],
)
def test_what_cannot_be_asked(plant, gamma, asked, said):
    with pytest.raises(InputError, match=said):
        H2HinfSynthesis(plant, gamma, **asked)

"""Worst signals at the least level, its gradient by scalings, and the descent of the level."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.textbook.controller import PLANTS

import workbench as wb
from workbench.errors import SolverError
from workbench.synthesis import MuSynthesis
from workbench.synthesis.h_infinity.levels import least_level, level_at, level_from
from workbench.synthesis.h_infinity.normalised import normalised_plant
from workbench.synthesis.h_infinity.worst_signals import worst_densities
from workbench.synthesis.mu import scaled_plant
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.synthesis.mu.scaled_plant import Round, level_descent
from workbench.systems.standard_plant import standard_plant

OMEGA = np.geomspace(1e-5, 1e5, 600)


def start(plant, biquads, seed):
    rng = np.random.default_rng(seed)
    scalings = Biquads(len(plant.structure), biquads)
    x = scalings.guess(rng.normal(size=scalings.rows), 0.0, 0.6)
    x += 0.2 * rng.normal(size=x.shape)
    at = np.log(OMEGA)
    return Round((scalings, x), np.zeros((1, 9)), at, np.zeros_like(at), np.nan, np.eye(x.size))


def normal_of(plant, used):
    return normalised_plant(standard_plant(scaled_plant.scaled_plant(plant, used.parameters)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["distillation", "mass-spring", "unstable-first-order"])
def test_the_gradient_is_that_of_differences(name):
    """The level by scalings: its slope by Riccati solutions, and by two levels apart."""
    plant = PLANTS[name]()
    used = start(plant, 1, 3)
    scalings, x = used.D
    _, gradient, _ = scaled_plant._slope(plant, used, x.ravel(), np.nan)
    step = 1e-4
    for k, along in enumerate(step * np.eye(x.size)):
        ends = []
        for sign in (1, -1):
            flat = (x.ravel() + sign * along).reshape(x.shape)
            moved = replace(used, D=(scalings, flat))
            _, level = least_level(normal_of(plant, moved).plant, 1e-9)
            ends.append(np.log(level.gamma))
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(gradient[k], abs=2e-3)


@pytest.mark.parametrize("name", ["distillation", "mass-spring"])
def test_worst_signals_reach_the_level(name):
    """||z|| is gamma ||w||: by Plancherel both come from the same trajectories."""
    normal = normal_of(PLANTS[name](), start(PLANTS[name](), 1, 5))
    level, _ = level_from(normal.plant, least_level(normal.plant, 1e-3)[1].gamma, 1e-9)
    densities = worst_densities(normal, level, OMEGA)
    for each in densities:
        assert np.trapezoid(each.sum(axis=1), OMEGA) == pytest.approx(1.0)
    w, z = (energy(normal, level, part) for part in ("w", "z"))
    assert z == pytest.approx(level.gamma**2 * w, rel=1e-5)


def energy(normal, level, part):
    """Energy of a worst signal by Gramians: of the past and of the future."""
    from scipy.linalg import solve_continuous_lyapunov

    plant, gamma = normal.plant, level.gamma
    values, vectors = np.linalg.eig(level.Y @ level.X)
    v = vectors[:, np.argmax(values.real)].real
    inputs, outputs = plant.D11.shape[1], len(plant.D11)
    after = {"w": level.F[:inputs], "z": plant.C1 + plant.D[:outputs] @ level.F}[part]
    before = {
        "w": (plant.B1 + level.L @ plant.D[:, :inputs]).T,
        "z": gamma**2 * level.L[:, :outputs].T,
    }[part]
    total = 0.0
    for A, C, x in (
        (plant.A + plant.B @ level.F, after, v),
        ((plant.A + level.L @ plant.C).T, before, level.X @ v / gamma**2),
    ):
        total += x @ solve_continuous_lyapunov(A.T, -C.T @ C) @ x
    return total


def test_a_level_is_found_from_a_guess_on_either_side():
    normal = normal_of(PLANTS["distillation"](), start(PLANTS["distillation"](), 1, 1))
    low, best = least_level(normal.plant, 1e-8)
    for share in (0.97, 0.999, 1.001, 1.1, 1.5):
        found, steepness = level_from(normal.plant, share * best.gamma, 1e-6)
        again, _ = level_from(normal.plant, share * best.gamma, 1e-6, steepness)
        assert again.gamma == pytest.approx(best.gamma, rel=1e-5)
        assert found.gamma == pytest.approx(best.gamma, rel=1e-5)
        assert found.coupling == pytest.approx(1.0, rel=1e-4)
    assert low < best.gamma
    assert not level_at(normal.plant, 0.999 * low).feasible


@pytest.mark.cases(0)
def test_the_descent_lowers_the_level_and_keeps_its_bounds():
    plant = PLANTS["distillation"]()
    used = start(plant, 1, 0)
    lower = level_descent(plant, used)
    first, last = (least_level(normal_of(plant, one).plant, 1e-5)[1].gamma for one in (used, lower))
    assert last < 0.8 * first
    low, high = used.D[0].limits(OMEGA)
    assert (low <= lower.D[1].ravel()).all()
    assert (lower.D[1].ravel() <= high).all()
    begun = level_descent(plant, used, enough=0.9 * first)
    reached = least_level(normal_of(plant, begun).plant, 1e-5)[1].gamma
    assert last < reached < 0.9 * first
    again = level_descent(plant, used)
    np.testing.assert_array_equal(again.D[1], lower.D[1])


def test_without_a_level_the_scalings_stay(monkeypatch):
    def none(*_):
        raise SolverError("no level")

    plant = PLANTS["distillation"]()
    used = start(plant, 1, 0)
    monkeypatch.setattr(scaled_plant, "least_level", none)
    np.testing.assert_array_equal(level_descent(plant, used).D[1], used.D[1])


def test_updates_keep_a_hessian_positive():
    rng = np.random.default_rng(0)
    hessian = np.eye(4)
    for _ in range(50):
        hessian = updated_hessian(hessian, rng.normal(size=4), rng.normal(size=4))
        values = np.linalg.eigvalsh(hessian)
        assert values[0] > -1e-12 * values[-1]
    quadratic = np.diag([1.0, 2.0, 3.0, 4.0])
    hessian = np.eye(4)
    for step in np.eye(4):
        hessian = updated_hessian(hessian, step, quadratic @ step)
    np.testing.assert_allclose(hessian, quadratic)


def test_the_column_in_two_rounds():
    """Alternation alone stops between 0.97 and 1.02, and needs ten rounds or more."""
    solution = wb.solve(MuSynthesis(PLANTS["distillation"](), target=0.975), method="dk")
    assert solution.certificate.holds, solution.certificate
    answer = solution.answer
    assert answer.upper <= 0.975
    assert len(answer.history) <= 3
    # Few biquads are enough, and their scalings prove the bound that is hardly above the peak.
    assert answer.K.nstates <= 22
    assert answer.peak.scalings is not None
    assert answer.upper <= 1.01 * answer.lower


def test_a_proof_by_scalings_is_stored_with_its_answer():
    program = MuSynthesis(PLANTS["distillation"](), target=1.036)
    answer = wb.solve(program, method="dk").answer
    back = program.from_dataset(program.to_dataset(answer))
    assert program.certify(back, 1e-6).valid
    other = replace(back, K=1.02 * back.K)
    assert not program.certify(other, 1e-6).valid
    scalings = replace(back.peak.scalings, gain=1.2 * back.peak.scalings.gain)
    assert not program.certify(
        replace(back, peak=replace(back.peak, scalings=scalings)), 1e-6
    ).valid


def test_a_level_beyond_what_is_asked_is_not_searched():
    normal = normal_of(PLANTS["distillation"](), start(PLANTS["distillation"](), 1, 1))
    low, best = least_level(normal.plant, 1e-8)
    assert level_from(normal.plant, 0.99 * low, 1e-6, most=0.99 * low) is None
    found, _ = level_from(normal.plant, 1.01 * low, 1e-6, most=1.01 * low)
    assert found.gamma == pytest.approx(best.gamma, rel=1e-5)

"""PO-MOESP on simulated records whose truth is known, beside the two other methods."""

from dataclasses import replace

import numpy as np
import pytest
from test_state_space import FREQUENCY, TRUTH, distance, simulated

from workbench import solve
from workbench.errors import InputError
from workbench.identification import StateSpaceFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.state_space.moesp import best_projection, projection_model
from workbench.identification.state_space.subspace import best_subspace
from workbench.program import methods


def test_without_noise_it_is_exact():
    model = projection_model(Experiments(*simulated(300, noise=1e-7)), 3, 10)
    assert distance(model) < 1e-6
    assert distance(projection_model(Experiments(*simulated(3000, noise=1e-7)), 3, 10)) < 1e-6
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(model.A)),
        np.sort_complex(np.linalg.eigvals(TRUTH.A)),
        atol=1e-6,
    )


@pytest.mark.parametrize("seed", range(3))
def test_it_finds_the_noise_model_too(seed):
    model = projection_model(Experiments(*simulated(5000, seed=seed)), 3, 10)
    assert distance(model) < 0.01
    found, true = (np.linalg.eigvals(m.A - m.K @ m.C) for m in (model, TRUTH))
    np.testing.assert_allclose(np.sort(abs(found)), np.sort(abs(true)), atol=0.1)


def test_offsets_and_initial_state_do_not_matter():
    u, y = simulated(600, noise=0.01)
    model = projection_model(Experiments(u, y), 3, 8)
    late, moved = (
        projection_model(Experiments(*record), 3, 8)
        for record in ((u[5:], y[5:]), (u + 7.0, y - 3.0))
    )
    np.testing.assert_allclose(moved.response(FREQUENCY), model.response(FREQUENCY), rtol=1e-8)
    np.testing.assert_allclose(moved.u_offset, model.u_offset + 7.0)
    assert distance(late) < 0.01


def test_units_do_not_matter():
    plain = best_projection(Experiments(*simulated(400)), 3)
    other = best_projection(Experiments(*simulated(400, units=(1e3, 1e-6))), 3)
    np.testing.assert_allclose(
        other.response(FREQUENCY) * 1e9, plain.response(FREQUENCY), rtol=1e-6, atol=1e-8
    )


def test_a_coloured_input_does_not_bias_it():
    """Neighbouring samples of this input are nearly equal, its spectrum falls by 40 dB."""
    rng = np.random.default_rng(6)
    u, x, noise = np.zeros((6000, 2)), np.zeros(3), 0.05 * rng.normal(size=(6000, 2))
    y = np.empty_like(u)
    for t in range(len(u)):
        u[t] = 0.98 * u[t - 1] + 0.2 * rng.normal(size=2)
        y[t] = TRUTH.C @ x + TRUTH.D @ u[t] + noise[t]
        x = TRUTH.A @ x + TRUTH.B @ u[t] + TRUTH.K @ noise[t]
    model = best_projection(Experiments(u, y), 3)
    low = FREQUENCY[:8]
    off = np.linalg.norm(model.response(low) - TRUTH.response(low), axis=(1, 2))
    assert np.max(off / np.linalg.norm(TRUTH.response(low), axis=(1, 2))) < 0.02


@pytest.mark.cases(0)
def test_the_methods_agree_on_the_plant_and_the_order():
    program = StateSpaceFit(*simulated(700), estimation=400, orders=(1, 3), washout=20)
    names = ("subspace", "moesp", "n4sid", "cva", "prediction-error")
    assert set(names) < set(methods(program))
    fits = {}
    for name in names:
        solution = solve(program, method=name)
        assert solution.certificate.valid, (name, solution.certificate.failures)
        fits[name] = program.metrics(solution.answer)
        assert fits[name]["order"] == fits[name]["order_free_run"] == 3
    for key in ("fit_free_run_y1", "fit_free_run_y2", "fit_one_step_y1", "fit_one_step_y2"):
        assert max(fit[key] for fit in fits.values()) - min(fit[key] for fit in fits.values()) < 1.5


def test_an_unstable_plant_is_found_only_where_it_may_be():
    rng = np.random.default_rng(2)
    u, y = rng.normal(size=(300, 1)), np.zeros((300, 1))
    for t in range(1, 300):
        y[t] = 1.05 * y[t - 1] + u[t - 1]
    model = projection_model(Experiments(u, y), 1, 5)
    np.testing.assert_allclose(model.A, [[1.05]], rtol=1e-9)
    for method in ("subspace", "moesp", "prediction-error"):
        stated = solve(
            StateSpaceFit(u, y, estimation=200, orders=(1,), washout=20, poles="any"), method=method
        )
        assert stated.certificate.valid, stated.certificate.failures
        np.testing.assert_allclose(stated.answer.predictor.radius, 1.05, rtol=1e-6)
    refused = solve(StateSpaceFit(u, y, estimation=200, orders=(1,), washout=20), method="moesp")
    assert not refused.certificate.valid


def test_orders_that_no_window_shows_give_none():
    assert best_projection(Experiments(*simulated(400)), 49) is None
    with pytest.raises(InputError, match="order 60"):
        StateSpaceFit(*simulated(400), estimation=300, orders=(60,), washout=20)


def test_it_is_another_computation_than_the_predictor_based_method():
    u, y = simulated(400, noise=0.5)
    one, other = best_subspace(u, y, 3), best_projection(Experiments(u, y), 3)
    assert np.abs(one.response(FREQUENCY) - other.response(FREQUENCY)).max() > 1e-3
    assert replace(other, K=0 * other.K).radius == other.radius < 1.0

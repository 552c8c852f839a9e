"""ARX models of few terms."""

import numpy as np
import pytest

from workbench.identification import Experiments, arx
from workbench.identification.polynomials.sparse_arx import MOST_TERMS, sparse_arx


def record(samples, seed, noise=0.3):
    """Two outputs of three inputs and few terms, far apart, about levels of their own."""
    rng = np.random.default_rng(seed)
    u, e = 5 + rng.standard_normal((samples, 3)), noise * rng.standard_normal((samples, 2))
    y = np.zeros((samples, 2))
    for t in range(15, samples):
        y[t, 0] = 2 + 0.8 * y[t - 1, 0] + u[t, 1] - 0.5 * u[t - 15, 2] + e[t, 0]
        y[t, 1] = 1 + 0.5 * y[t - 2, 1] + 0.4 * y[t - 7, 0] + u[t - 3, 0] + e[t, 1]
    return Experiments(u[15:], y[15:])


def error(model, judged):
    return (judged.y - model.one_step(judged.u, judged.y, 100))[100:].std(axis=0)


def test_it_finds_the_terms_and_predicts_better_than_all_lags():
    judged = record(3000, 9)
    for seed in range(2):
        used = record(400, seed)
        few, all_lags = error(sparse_arx(used, 15), judged), error(arx(used, 15), judged)
        assert (few < 0.3 * 1.05).all()
        assert (few - 0.3 < 0.5 * (all_lags - 0.3)).all()


def test_without_noise_it_is_exact():
    judged = record(600, 4, noise=0.0)
    model = sparse_arx(record(600, 3, noise=0.0), 15)
    assert (error(model, judged) < 1e-6).all()
    assert np.isfinite(judged.y - model.free_run(judged.u, judged.y, 100)).all()


def test_outputs_apart_do_not_see_each_other():
    model = sparse_arx(record(500, 1), 8, apart=True)
    lags = model.K.reshape(8, 2, 2)  # the coefficients of past outputs
    assert not lags[:, 0, 1].any() and not lags[:, 1, 0].any()
    assert np.count_nonzero(model.K) <= MOST_TERMS


def test_an_input_need_not_act_at_once_and_may_be_late():
    used = record(500, 2)
    assert not sparse_arx(used, 8, direct=False).D.any()
    assert sparse_arx(used, 8).D[0, 1] == pytest.approx(1.0, abs=0.1)
    late = sparse_arx(used, 12, delay=(3, 0, 0))
    assert late.delay_samples == (3, 0, 0)
    assert error(late, used)[1] == pytest.approx(0.3, rel=0.1)


def test_a_record_that_is_too_short_gives_none():
    assert sparse_arx(record(40, 0).part(0, 10), 8) is None

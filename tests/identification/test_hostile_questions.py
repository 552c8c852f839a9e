"""Questions that a new user gets wrong: refused with what to do, or answered all the same."""

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import workbench as wb
from workbench.errors import InputError
from workbench.identification import (
    ClosedLoopFit,
    IdentificationWarning,
    ResponseEstimate,
    fit_rational_model,
    local_polynomial,
    local_rational,
    periodic_local_polynomial,
    random_multisine,
)

LINES = np.arange(1, 60, 2)


def loop(**changes):
    rng = np.random.default_rng(0)
    r = rng.standard_normal(400)
    plant = control.tf([0.2], [1, -0.8], 1.0)
    u = control.forced_response(control.feedback(1, plant), inputs=r).outputs
    y = control.forced_response(plant, inputs=u).outputs
    return ClosedLoopFit(u, y, orders=[1], direct=False, **{"excitation": r} | changes)


def test_a_controller_may_be_a_transfer_function():
    found = wb.solve(loop(controller=control.tf([1.0], [1.0], 1.0)), method="indirect")
    assert found.answer.simulator.A[0, 0] == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"controller": 1.0}, "controller is a float"),
        ({"controller": control.ss([], [], [], [[1.0]], 0.5), "dt": 0.1}, "every 0.5 s"),
        ({"excitation": np.ones(400)}, "channel 0 never changes"),
    ],
)
def test_loops_with_another_controller_or_no_excitation(changes, words):
    with pytest.raises(InputError, match=words):
        loop(**changes)


def periodic(period=128, periods=5):
    rng = np.random.default_rng(1)
    u = np.tile(random_multisine(LINES, 1.0, period, rng).period(), periods)
    return u[:, None], (lfilter([0, 0.5], [1, -0.5], u) + 0.01 * rng.standard_normal(u.size))[
        :, None
    ]


def test_another_period_and_silent_harmonics_are_refused():
    u, y = periodic()
    with pytest.raises(InputError, match="is the period 125 samples"):
        periodic_local_polynomial(u, y, 125, lines=LINES)
    with pytest.raises(InputError, match="do not excite harmonic 2"):
        periodic_local_polynomial(u, y, 128, lines=[2, 4])


@pytest.mark.parametrize("method", [local_polynomial, local_rational])
def test_periodic_records_are_sent_to_their_methods(method):
    with pytest.warns(IdentificationWarning, match="periodic_local"):
        found = method(*periodic())
    assert np.isnan(found.response).any()


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", ["levenberg-marquardt", "ipopt"])
def test_a_delay_beside_an_order_that_is_too_low(method):
    """At order 2 the best zero lies at infinity, where it acts as a delay does."""
    rng, frequency = np.random.default_rng(31), np.geomspace(0.05, 50, 120)
    s = 2j * np.pi * frequency
    exact = (4 * s + 200) / (s**2 + 0.6 * s + 90) * 30 / (s + 30) * np.exp(-0.013 * s)
    variance = np.full((120, 1, 1), 1e-5)
    noise = np.sqrt(variance / 2) * (rng.standard_normal((120, 2)) @ [1, 1j])[:, None, None]
    measured = ResponseEstimate(frequency, exact[:, None, None] + noise, variance, np.inf)
    found = fit_rational_model(
        measured, orders=[2, 3], excess=1, delay_bounds=(0, 0.05), method=method
    )
    assert found.model.order == 3
    assert np.abs(found.response(2 * np.pi * frequency)[:, 0, 0] - exact).max() < 0.02
    assert 0 < found.uncertainty.delay_deviation() < 0.01

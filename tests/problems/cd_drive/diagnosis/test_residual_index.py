"""Disturbances over faults in a residual, and the bound that no filter gets below."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from workbench.plants.cd_drive.diagnosis.residual_index import (
    ratios_of_norms,
    residual_index,
    residual_of,
    weighted_model,
    weights,
)

import workbench as wb
from workbench.diagnosis import residual_response
from workbench.errors import InputError


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    task = residual_index(request.param)
    return task, wb.solve(task)


@pytest.mark.cases(1)
def test_the_certificate_holds_and_there_is_a_figure(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"index"}


def test_the_weights_are_those_printed():
    """Equations 6.11 and 7.32 by hand, in focus."""
    frequency = np.array([1.0, 30.0, 700.0, 9e3])
    s = 2j * np.pi * frequency
    w_B, w_I = 2 * np.pi * 230.0, 2 * np.pi * 10.0
    W_p = (s / 2 ** (1 / 3) + w_B) ** 3 / (s + w_B * 0.004 ** (1 / 3)) ** 3
    W_p *= (s + w_I) / (s + 0.001)
    W_sd = (s + 3 * w_B * 0.001 ** (1 / 3)) ** 3 / (s / 250 ** (1 / 3) + 3 * w_B) ** 3
    found = weights("focus", frequency)
    assert found[0] == pytest.approx(abs(W_p), rel=1e-9)
    assert found[1] == pytest.approx(abs(W_sd), rel=1e-9)


@pytest.mark.cases(1)
def test_the_control_does_not_reach_the_residual_and_the_ratio_is_that_of_the_weights(solved):
    task, solution = solved
    omega = 2 * np.pi * np.geomspace(20.0, 9e3, 7)
    model = weighted_model(task.axis)
    disturbance, defect = weights(task.axis, omega / (2 * np.pi))
    for H in task.filters(solution.answer).values():
        u, w_p, w_sd = (
            abs(residual_response(residual_of(H, task.axis), model, [name], omega)[:, 0, 0])
            for name in ("u", "w_p", "w_sd")
        )
        assert u.max() < 1e-6 * abs(model.response(["u"], omega)).max()
        assert w_p / w_sd == pytest.approx(disturbance / defect, rel=1e-9)


@pytest.mark.cases(1)
def test_norms_by_adaptive_quadrature(solved):
    task, solution = solved
    H = task.filters(solution.answer)["high-pass"]

    def energy(k):
        def density(f):
            s = 2j * np.pi * f
            gain = abs((H.C @ np.linalg.solve(s * np.eye(H.nstates) - H.A, H.B) + H.D)[0, 0])
            return float((gain * weights(task.axis, np.array([f]))[k][0]) ** 2)

        return quad(density, task.low_hz, task.high_hz, limit=500, epsrel=1e-7)[0]

    expected = (energy(0) / energy(1)) ** 0.5
    found = ratios_of_norms(task.axis, H, task.grid(float(solution.answer["least_hz"])))
    assert found[0] == pytest.approx(expected, rel=1e-4)


@settings(max_examples=20, deadline=None)
@given(
    zero=st.floats(10.0, 1e5),
    pole=st.floats(10.0, 1e5),
    low=st.floats(10.0, 300.0),
)
def test_no_filter_gets_below_the_bound(zero, pole, low):
    import control

    task = residual_index("focus", low_hz=low)
    H = control.ss(control.tf([1.0, zero], [1.0, pole]))
    disturbance, defect = weights("focus", np.geomspace(low, task.high_hz, 2000))
    ratios = ratios_of_norms("focus", H, task.grid(task.high_hz))
    assert min(ratios) >= (disturbance / defect).min() * (1 - 1e-6)


@pytest.mark.parametrize(
    ("name", "factor"), [("least_bound", 1.1), ("ratio", 0.5), ("ratio", 1.1), ("pointwise", 0.9)]
)
def test_a_wrong_answer_is_rejected(solved, name, factor):
    task, solution = solved
    answer = solution.answer.copy(deep=True)
    answer[name].values *= factor
    assert not task.certify(answer, 1e-6).holds


def test_a_range_upside_down_is_refused():
    with pytest.raises(InputError, match="must be below"):
        wb.load("cd/focus/residual-index", low_hz=100.0, high_hz=50.0)

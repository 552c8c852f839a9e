"""Norms of systems, against closed forms and python-control."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.mu import h2_norm, h_infinity_norm

LAG, SPRING = control.tf([3.0], [1.0, 2.0]), control.tf([1.0], [1.0, 2e-4, 1.0])


@pytest.mark.parametrize(
    ("system", "h_infinity", "h2"),
    [
        (LAG, 1.5, 1.5),  # 3 / 2 and 3 / sqrt(4)
        (SPRING, 1 / (2e-4 * math.sqrt(1 - 1e-8)), math.sqrt(1 / (2 * 2e-4))),
        (control.tf([1.0, 0.0], [1.0, 2.0]), 1.0, math.inf),
        (control.ss([], [], [], [[3.0, 4.0]]), 5.0, math.inf),
        (control.ss([], [], [], [[3.0, 4.0]], 0.1), 5.0, 5.0),
        (control.tf([1.0], [1.0, -0.5], 0.1), 2.0, 1 / math.sqrt(1 - 0.25)),
        (control.tf([1.0], [1.0, 0.0]), math.inf, math.inf),
        (control.tf([1.0], [1.0, -1.0], 0.1), math.inf, math.inf),
        (control.tf([1.0], [1.0, -1.0]), math.inf, math.inf),
        (control.tf([0.0], [1.0, 1.0]), 0.0, 0.0),
    ],
)
def test_closed_forms(system, h_infinity, h2):
    for norm, truth in ((h_infinity_norm(system), h_infinity), (h2_norm(system), h2)):
        assert norm.lower <= truth * (1 + 1e-12) and truth * (1 - 1e-12) <= norm.upper
        assert math.isinf(truth) or norm.upper - norm.lower <= 2e-3 * truth
        assert norm.holds, norm.certificate.failures
        assert f"{norm.upper:.8g}" in repr(norm) and float(norm) == norm.upper


@pytest.mark.cases(0)
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1]))
def test_random_systems_agree_with_python_control(seed, dt):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4))
    A = A / (1.05 * np.abs(np.linalg.eigvals(A)).max()) if dt else A - 3 * np.eye(4)
    if not dt and np.linalg.eigvals(A).real.max() > -0.05:
        return
    system = control.ss(A, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), np.zeros((3, 2)), dt)
    found = h2_norm(system)
    assert found.lower <= found.upper <= found.lower * (1 + 1e-9)
    assert found.upper == pytest.approx(control.norm(system, 2), rel=1e-8)
    gain = h_infinity_norm(system)
    assert gain.upper == pytest.approx(control.norm(system, "inf", tol=1e-8), rel=2e-3)
    assert found.holds and gain.holds


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_time(unit):
    system = control.tf([unit], [1.0, 2.0 * unit])
    assert h2_norm(system).upper == pytest.approx(0.5 * math.sqrt(unit), rel=1e-9)
    assert h_infinity_norm(system).upper == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize("name", ["lower", "upper"])
@pytest.mark.parametrize("norm", [h2_norm, h_infinity_norm])
def test_a_claim_that_is_too_good_fails(norm, name):
    from dataclasses import replace

    found = norm(SPRING)
    better = replace(found, **{name: getattr(found, name) * (1.01 if name == "lower" else 0.99)})
    assert not better.with_checker(found._checked_by[0]).holds
    unstable = norm(control.tf([1.0], [1.0, -1.0]))
    assert not replace(unstable, lower=1.0, upper=2.0).with_checker(unstable._checked_by[0]).holds


def test_what_has_no_norm_is_named():
    with pytest.raises(InputError, match="improper"):
        h2_norm(control.tf([1.0, 0.0, 0.0], [1.0, 1.0]))
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    A = turned @ np.diag([-1e-18, -1.0, -2.0]) @ turned.T  # its first pole is lost in rounding
    almost = control.ss(A, turned[:, :1], turned[:1], 0)
    try:
        assert h2_norm(almost).upper > 1e6  # that of the pole that rounding left
    except InputError as error:
        assert "within rounding of the boundary" in str(error)


@pytest.mark.parametrize("unit", [1e-150, 1e-75, 1e75, 1e150])
def test_far_units_of_time(unit):
    """As a transfer function 1 / (s / 1e150 + 1) had an H2 norm from 0 to infinity."""
    for lag in (control.tf([unit], [1.0, unit]), control.ss([[-unit]], [[unit]], [[1.0]], 0.0)):
        found = h2_norm(lag)
        assert found.lower == pytest.approx((unit / 2) ** 0.5, rel=1e-9)
        assert found.upper == pytest.approx((unit / 2) ** 0.5, rel=1e-9) and found.holds
        assert h_infinity_norm(lag).upper == pytest.approx(1.0, rel=1e-5)

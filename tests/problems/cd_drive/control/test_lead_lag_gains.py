"""Numbers that tell a lead-lag controller: right, and as exact as the controller is given."""

from dataclasses import asdict

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.cd_drive.control.lead_lag_gains import (
    UNITS,
    LeadLagGains,
    transfer_polynomials,
)
from workbench.plants.cd_drive.drive.plants import controller

from workbench.errors import InputError
from workbench.synthesis import LeadLag

FAMILY = LeadLag(leak=1e-3)
"""Form of the controllers here: two zeros and two poles beside the one of the integrator."""


def made(gain, zeros, poles):
    """Controller of the family with these corners [Hz]."""
    corners = 2 * np.pi * np.array([*zeros, *poles])
    return FAMILY.system(np.log([gain, *corners]))


@settings(max_examples=30, deadline=None)
@given(
    gap=st.one_of(st.just(0.0), st.floats(1e-12, 3.0)),
    zero=st.floats(1.0, 1000.0),
)
def test_nearly_equal_zeros_are_told_to_ten_digits(gap, zero):
    """Eigenvalues are off by 1e-7 here, in another direction on every processor."""
    zeros = np.array([zero, zero * (1 + gap)])
    found = LeadLagGains.of(made(5e6, zeros, (2.4e4, 3.1e5)))
    assert found.zero_frequency == pytest.approx(np.sqrt(zeros.prod()), rel=1e-10)
    assert found.zero_damping == pytest.approx(zeros.mean() / np.sqrt(zeros.prod()), rel=1e-10)
    assert found.proportional_gain == pytest.approx(
        5e6 * 2 * np.pi * zeros.sum() / (4 * np.pi**2 * 2.4e4 * 3.1e5), rel=1e-10
    )
    assert found.lead_pole == pytest.approx(2.4e4, rel=1e-13)
    assert found.roll_off == pytest.approx(3.1e5, rel=1e-13)


def test_coordinates_do_not_matter():
    """States scaled by powers of 2, which rounds nothing, and in reverse order."""
    K = made(5e6, (150.0, 150.0 * (1 + 1e-9)), (2.4e4, 3.1e5))
    scale = np.diag([4.0, 1.0, 0.5])[::-1]
    back = np.linalg.inv(scale)
    other = control.ss(scale @ K.A @ back, scale @ K.B, K.C @ back, 0.0)
    assert asdict(LeadLagGains.of(other)) == asdict(LeadLagGains.of(K))


def test_the_thesis_controller_has_its_printed_corners():
    found = LeadLagGains.of(control.ss(controller("focus")))
    assert found.zeros() == "31, 230"
    assert found.zero_frequency == pytest.approx(np.sqrt(31 * 230), rel=1e-12)
    assert (found.lead_pole, found.roll_off) == pytest.approx((9820, 14130), rel=1e-12)
    # 12.9e6 (31 + 230) / (2 pi 9820 14130): sum of the zeros over the product of the poles
    assert found.proportional_gain == pytest.approx(3.8618615467, rel=1e-9)
    assert set(asdict(found)) == set(UNITS)


def test_complex_zeros_are_told_as_a_pair():
    K = control.tf([1.0, 2 * np.pi * 160, (2 * np.pi * 100) ** 2], [1.0, 6.0, 11.0, 6.0]).to_ss()
    found = LeadLagGains.of(K)
    assert found.zero_damping == pytest.approx(0.8, rel=1e-9)
    assert found.zeros() == "80 +- 60j"


def test_polynomials_are_exact():
    K = control.ss([[-0.5, 2.0], [0.0, -4.0]], [[0.0], [1.0]], [[3.0, 0.25]], [[8.0]])
    numerator, denominator = transfer_polynomials(K)
    assert denominator == fmpq_poly([2, fmpq(9, 2), 1])
    # 3 * 2 of the coupling, (s + 1/2) / 4 + 8 (s + 1/2) (s + 4)
    assert numerator == fmpq_poly([6]) + fmpq_poly([fmpq(1, 8), fmpq(1, 4)]) + 8 * denominator


@pytest.mark.parametrize(
    ("K", "words"),
    [
        (control.tf([1.0, 1.0], [1.0, 2.0, 0.0]), "1 zeros and 2 poles"),
        (control.tf([1.0, 1.0, -1.0], [1.0, 6.0, 11.0, 6.0]), "left of the imaginary axis"),
        (control.tf([1.0, -2.0, 1.0], [1.0, 6.0, 11.0, 6.0]), "left of the imaginary axis"),
        (control.tf([1.0, 5.0, 6.0], [1.0, 1.0, 1.0, 1.0]), "must be real"),
        (control.ss([], [], [], np.eye(2)), "2 outputs and 2 inputs"),
    ],
)
def test_controllers_of_another_form_are_named(K, words):
    with pytest.raises(InputError, match=words):
        LeadLagGains.of(control.ss(K))

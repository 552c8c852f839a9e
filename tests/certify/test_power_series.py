"""Polynomials on intervals are as near the response as they say, at all frequencies."""

import numpy as np
import pytest
from flint import acb, acb_mat, arb, ctx

from workbench.certify.modes.partial_fractions import enclosed_fractions
from workbench.certify.modes.power_series import polynomials
from workbench.certify.rounding import exact

BITS = 200
"""Bits of what polynomials are compared with."""
T = np.array([-1.0, -0.97, -0.5, 0.0, 0.4, 0.99, 1.0])
"""Places on an interval."""


def modal(*modes, D=0.3):
    """A system of modes (gain, omega, damping), side by side; damping 1: a lag."""
    A, B, C = np.zeros((2 * len(modes), 2 * len(modes))), [], []
    for k, (gain, omega, damping) in enumerate(modes):
        rest = omega * np.sqrt(1 - damping**2) if damping < 1 else omega / 3
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [
            [-omega * damping, rest],
            [-rest, -omega * damping],
        ]
        B += [0.0, 1.0]
        C += [gain, 0.2 * gain]
    return A, np.array(B)[:, None], np.array(C)[None], np.array([[D]])


def pair(number):
    return number.real, number.imag


def exact_response(system, omega):
    """C (j omega - A)^-1 B + D of one input and output, in balls."""
    A, B, C, D = (acb_mat(part.tolist()) for part in system)
    s = acb_mat(np.eye(A.nrows()).tolist()) * acb(0, omega)
    return (C * (s - A).solve(B) + D)[0, 0]


@pytest.mark.parametrize(
    "modes",
    [
        [(1.0, 1.0, 1.0)],
        [(1.0, 3.0, 1e-4)],
        [(1.0, 1.0, 1.0), (1e-7, 1e3, 1e-3), (1e-9, 30.0, 0.01)],  # two that are left out
        [(1.0, 0.1, 1e-3), (5.0, 2.0, 0.02), (0.3, 40.0, 1e-5)],
    ],
    ids=["a lag", "a light mode", "modes that hardly matter", "three modes"],
)
def test_the_error_is_no_smaller_than_the_distance_from_the_response(modes):
    A, B, C, D = modal(*modes)
    found = polynomials(enclosed_fractions(*map(exact, (A, B, C, D))))
    for k, (middle, half, terms) in enumerate(
        zip(found.middle, found.half, found.terms[:, :, 0, 0], strict=True)
    ):
        for t in T[T > 0] if k == 0 else T:
            with ctx.workprec(BITS):
                place, unit, at = (arb(float(x)) for x in (middle, half, t))
                omega = unit / at if k == 0 else place + unit * at
                polynomial = sum(acb(*pair(c)) * at**m for m, c in enumerate(terms.tolist()))
                apart = abs(polynomial - exact_response((A, B, C, D), omega))
            assert float(apart) <= found.error[k], (k, t)
    assert found.error.max() < 1e-3 * np.abs(found.terms[:, 0]).max()


def test_the_intervals_leave_no_frequency_out():
    found = polynomials(enclosed_fractions(*map(exact, modal((1.0, 0.1, 1e-3), (5.0, 2.0, 0.02)))))
    low, high = found.middle[1:] - found.half[1:], found.middle[1:] + found.half[1:]
    order = np.argsort(low)
    assert low.min() <= 0.0 and high.max() >= found.half[0]
    assert (low[order][1:] <= np.maximum.accumulate(high[order])[:-1]).all()

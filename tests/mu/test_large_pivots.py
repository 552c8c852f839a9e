"""Loops in far units of time, where libraries of linear algebra lose large complex numbers."""

import control
import numpy as np
import pytest

from workbench.certify.norms import certified_norm
from workbench.mu import loop_margins, peak, robust_stability
from workbench.mu.margins.classical import classical_margins
from workbench.structure import Complex, Real, Structure
from workbench.uncertainty import dynamics, feedback

SINGLE = float(np.finfo(np.float32).max)
"""A complex number beyond this is lost by OpenBLAS 0.3.27 where it is an imaginary pivot."""


@pytest.fixture
def old_library(monkeypatch):
    """Eliminations and eigenvalues of large complex matrices are NaN, or do not converge."""

    def fails(name, raises):
        given = getattr(np.linalg, name)

        def lost(matrix, *others):
            found = given(matrix, *others)
            if np.iscomplexobj(matrix) and np.abs(matrix).max(initial=0.0) > SINGLE:
                if raises:
                    raise np.linalg.LinAlgError("Eigenvalues did not converge")
                found = np.full_like(found, np.nan)
            return found

        monkeypatch.setattr(np.linalg, name, lost)

    for name in ("solve", "inv"):
        fails(name, raises=False)
    for name in ("eig", "eigvals"):
        fails(name, raises=True)


def loop(time):
    """2 / (s (s + 1)), in a unit of time."""
    A, B = np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([[0.0], [2.0]])
    return control.ss(A * time, B * time, [[1.0, 0.0]], 0.0)


UNITS = [2.0**300, 2.0**-300]


@pytest.mark.parametrize("time", UNITS)
def test_margins_of_a_loop(time, old_library):
    plain, found = (loop_margins(loop(unit)) for unit in (1.0, time))
    disk, other = (next(iter(one.disks.values())) for one in (plain, found))
    assert other.lower == pytest.approx(disk.lower, rel=1e-9)
    assert other.upper == pytest.approx(disk.upper, rel=1e-9)
    assert classical_margins(loop(time)).phase_deg == pytest.approx(
        classical_margins(loop(1.0)).phase_deg
    )
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("time", UNITS)
@pytest.mark.parametrize("structure", [Structure([Complex(1)]), Structure([Real(1), Complex(1)])])
def test_peaks(time, structure, old_library):
    n = structure.rows
    A = np.array([[-0.1, 1.0], [-1.0, -0.1]])
    B, C = np.array([[1.0, 0.3], [0.0, 1.0]])[:, :n], np.array([[1.0, 0.0], [0.2, 1.0]])[:n]
    plain, found = (peak(control.ss(A * t, B * t, C, 0.0), structure) for t in (1.0, time))
    assert (found.lower, found.upper) == pytest.approx((plain.lower, plain.upper), rel=1e-6)
    assert found.omega == pytest.approx(plain.omega * time)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("time", UNITS)
def test_norms_and_robust_stability(time, old_library):
    chain = control.ss(-np.eye(3) + np.diag([5.0, 5.0], -1), np.eye(3, 1), np.eye(1, 3, 2), 0.0)
    far = control.ss(chain.A * time, chain.B * time, chain.C, 0.0)
    assert certified_norm(far) == pytest.approx(certified_norm(chain))
    ours, others = (
        robust_stability(feedback(loop(t), 1.0 + 0.3 * dynamics("d", 1, 1))) for t in (1.0, time)
    )
    assert (others.lower, others.upper) == pytest.approx((ours.lower, ours.upper), rel=1e-6)
    assert others.holds, others.certificate.failures

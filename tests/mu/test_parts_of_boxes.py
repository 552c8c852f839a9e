"""Parts of a box of parameters: what is proven of one pole, -1 + delta, and of its pieces."""

import math

import control
import numpy as np
import pytest

from workbench.certify.stable_system import stable_system
from workbench.mu.boxes.bands import WHOLE, open_bands
from workbench.mu.boxes.partition import BoxPart, Partition
from workbench.mu.boxes.recentred import RealParameters
from workbench.structure import Complex, Full, Real, Structure

ONE = Structure([Real(1)])


def parameters(A, B, C, D, structure=ONE):
    return RealParameters(stable_system(control.ss(A, B, C, D)), structure)


def part(low, high):
    return BoxPart(np.atleast_1d(float(low)), np.atleast_1d(float(high)))


POLE = parameters([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
"""1 / (s + 1), closed by delta: the pole is -1 + delta."""


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [(-1.2, 1.2, None), (-0.9, 0.9, True), (1.5, 2.5, False), (0.9, 1.05, None)],
)
def test_a_part_is_stable_where_all_of_its_members_are(low, high, verdict):
    assert POLE.all_stable(part(low, high)) is verdict


@pytest.mark.parametrize(("low", "high", "stable"), [(-0.5, 0.5, True), (1.5, 2.5, False)])
def test_a_centre_tells_its_own_stability(low, high, stable):
    found = POLE.recentred(part(low, high))
    assert found.stable is stable
    assert found.system.A[0, 0] == pytest.approx(-1 + (low + high) / 2)


def test_no_centre_on_the_axis():
    assert POLE.recentred(part(0.5, 1.5)) is None


def test_what_went_through_infinity_is_unstable():
    """det(I - D delta) = 1 - delta: beyond 1 a pole came back from infinity."""
    through = parameters([[-1.0]], [[1.0]], [[0.1]], [[1.0]])
    assert through.unstable(np.array([[0.5], [2.0], [1.0]])).tolist() == [False, True, True]


@pytest.mark.parametrize("others", [1.0, 0.25])
def test_inputs_of_a_part_have_its_half_widths_and_others_theirs(others):
    structure = Structure([Real(1), Full(2, 1)])
    given = parameters(-np.eye(2), np.eye(2, 3), np.ones((2, 2)), np.zeros((2, 3)), structure)
    found = given.recentred(part(-0.3, 0.3), others)
    factors = np.array([0.3, others, others])
    assert np.abs(found.system.B - np.eye(2, 3) * factors).max() < 1e-12


@pytest.mark.parametrize(("peak", "closed"), [(1.1, False), (1.01, False), (0.9, True)])
def test_a_band_stays_open_where_a_perturbation_of_size_1_is_not_excluded(peak, closed):
    """A light mode at 1 rad/s of that peak seen by a complex scalar, beside a parameter."""
    mode = control.ss(control.tf([0.02 * peak, 0.0], [1.0, 0.02, 1.0]))
    both = control.append(control.ss(control.tf([0.1], [1.0, 1.0])), mode)
    bands, _ = open_bands(stable_system(both), Structure([Real(1), Complex(1)]), WHOLE)
    assert (not bands) is closed
    assert closed or any(low <= 1.0 <= high for low, high in bands)


def test_pieces_leave_nothing_of_a_part_out():
    whole = BoxPart(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    pieces = Partition(whole)
    for effects in ([1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [1.0, 0.0]):
        assert pieces.cut(pieces.pop(), np.array(effects))
    found = []
    while pieces:
        found.append(pieces.pop())
    assert len(found) == 5
    assert sum(np.prod(one.high - one.low) for one in found) == pytest.approx(4.0)
    rng = np.random.default_rng(0)
    for point in rng.uniform(-1, 1, (500, 2)):
        inside = [bool((one.low <= point).all() and (point <= one.high).all()) for one in found]
        assert sum(inside) >= 1
    assert math.isclose(sum(pieces.weight(one.low, one.high) for one in found), 1.0)

"""Systems whose time and signals are measured in units at the ends of doubles."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import coprime_margin, loop_margins, nu_gap, robust_stability, worst_case_gain
from workbench.systems.balancing import balancing
from workbench.systems.equations.riccati import right_factors
from workbench.systems.realisation import realisation
from workbench.uncertainty import real, tf


@pytest.mark.parametrize("exponent", [-1000, -600, 600, 1000])
def test_balancing_evens_entries_of_any_size(exponent):
    far = 2.0**exponent
    M = np.array([[1.0, far], [1 / far, 1.0]])
    rows, columns = balancing(M, 2)
    assert (rows * columns == 1.0).all()
    even = np.abs(M) * rows[:, None] / rows
    assert even.min() >= 0.25 and even.max() <= 4.0


@pytest.mark.parametrize("time", [2.0**-300, 2.0**300])
def test_margins_and_gaps_are_the_same_in_any_unit_of_time(time):
    loop = control.ss([[0.0, 1.0], [0.0, -0.25]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    far = control.ss(loop.A * time, loop.B * time, loop.C, 0.0)
    one, other = loop_margins(loop), loop_margins(far)
    assert other.holds and other.least_disk.lower == pytest.approx(one.least_disk.lower, rel=1e-9)
    lags = [control.ss([[-x]], [[1.0]], [[1.0]], 0.0) for x in (1.0, 2.0)]
    late = [control.ss(lag.A * time, lag.B * time, lag.C, 0.0) for lag in lags]
    gap = nu_gap(*late)
    assert gap.holds and gap.lower <= 1 / np.sqrt(10) <= gap.upper
    assert right_factors(late[0], "late").poles() == pytest.approx(-time * np.sqrt(2), rel=1e-9)


@pytest.mark.parametrize("nominal", [1e-200, 1e200])
def test_a_parameter_of_any_size_has_its_range(nominal):
    """The product of its two half-ranges under- or overflows."""
    k = real("k", nominal, plus_minus=nominal / 2)
    found = worst_case_gain((1 / nominal) * k)
    assert found.lower <= 1.5 <= found.upper < 1.6


def test_what_overflows_is_named():
    with pytest.raises(InputError, match="measure its time or its signals in other units"):
        realisation((np.array([[-np.inf]]), np.eye(1), np.eye(1), np.zeros((1, 1))), 0.0)
    huge = real("k", 1.7e308, percent=1)
    with np.errstate(all="ignore"), pytest.raises(InputError):
        robust_stability(tf([1], [1, 1e300 * huge]))


@pytest.mark.parametrize("b", [0.5, -3.0])
def test_two_gains_have_a_gap_and_a_margin(b):
    first, second = (control.ss([], [], [], [[x]]) for x in (2.0, b))
    length = np.sqrt(5 * (1 + b * b))
    gap = nu_gap(first, second)
    assert gap.holds and gap.lower <= abs(2 - b) / length * (1 + 1e-12)
    assert gap.upper >= abs(2 - b) / length * (1 - 1e-12)
    margin = coprime_margin(first, b)
    assert margin.holds and margin.lower <= abs(1 + 2 * b) / length * (1 + 1e-12)

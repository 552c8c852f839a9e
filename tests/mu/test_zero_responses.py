"""A response that doubles see as zero: it is proven to be, or bounded by what rounding hides."""

import control
import numpy as np
import pytest

from workbench.certify.norms import certified_norm
from workbench.certify.skewed import without_effect
from workbench.certify.stable_system import stable_system
from workbench.mu import nu_gap, peak, skewed_peak, worst_case_gain
from workbench.structure import Complex, Full, Structure
from workbench.uncertainty import dynamics

LAG = control.tf([1.0], [1.0, 1.0])
ONE = Structure([Full(1, 1)])


def hidden(gain, poles=(1.0, 2.0, 1.0)):
    """gain / (s + second pole), beside two equal lags of which one is subtracted."""
    parts = -np.diag(poles), [[1.0], [gain], [1.0]], [[1.0, 1.0, -1.0]], [[0.0]]
    return control.StateSpace(*parts, remove_useless_states=False)


@pytest.mark.cases(0)
@pytest.mark.parametrize("gain", [1e-17, 1e-30, 1e-300])
def test_what_rounding_hides_is_not_said_to_be_zero(gain):
    system, truth = hidden(gain), gain / 2
    assert certified_norm(system) >= truth
    found = peak(system, ONE)
    assert found.lower <= truth <= found.upper and found.holds
    zeros = np.zeros((3, 1))
    N = control.StateSpace(
        system.A,
        np.hstack([zeros, system.B]),
        np.vstack([zeros.T, system.C]),
        np.zeros((2, 2)),
        remove_useless_states=False,
    )
    gained = worst_case_gain(N, Structure([Complex(1)]))
    assert gained.lower <= truth <= gained.upper and gained.holds


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_what_cancels_is_zero_and_proven_so(dt):
    system = hidden(0.0)
    if dt:
        system = control.StateSpace(
            np.diag([0.3, 0.5, 0.3]), system.B, system.C, system.D, dt, remove_useless_states=False
        )
    found = peak(system, ONE)
    assert (found.lower, found.upper) == (0.0, 0.0) and found.holds
    checker = found._checked_by[0]
    for C, D in (([[1.0, 1e-30, -1.0]], 0.0), (system.C, 1e-30)):
        B = [[1.0], [1.0], [1.0]] if D == 0.0 else system.B
        other = control.StateSpace(system.A, B, C, D, dt, remove_useless_states=False)
        assert not stable_system(other, sampled=True).vanishes()
        assert not type(checker)(other, ONE).certify(found, 1e-6).valid


def test_the_gap_of_equal_plants_is_zero_and_holds():
    found = nu_gap(LAG, LAG)
    assert (found.lower, found.upper) == (0.0, 0.0) and found.holds


def series():
    """Outputs and inputs of two elements and the performance: each element leads to the next."""
    C = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    return control.ss(-np.eye(3), np.eye(3), C, np.zeros((3, 3)))


def test_elements_in_series_without_another_way_have_a_gain():
    found = worst_case_gain(series(), Structure([Complex(1), Complex(1)]))
    assert found.lower <= 1.0 <= found.upper <= 1.01 and found.holds
    one, other = dynamics("one", 1, 1), dynamics("other", 1, 1)
    assert worst_case_gain(LAG * one * LAG * other * LAG).lower == pytest.approx(1.0)
    skewed = skewed_peak(series(), Structure([Complex(1), Complex(1), Full(1, 1)]), fixed=[0, 1])
    assert skewed.lower <= 1.0 <= skewed.upper <= 1.01 and skewed.holds


def test_what_comes_back_through_two_blocks_has_an_effect():
    structure = Structure([Complex(1), Complex(1), Full(1, 1)])
    stable, varies = stable_system(series()), np.array([False, False, True])
    assert not without_effect(stable, structure, varies)
    assert without_effect(stable.channels([0, 1, 2], [0, 1, 2], [1, 0, 1]), structure, varies)
    assert without_effect(stable.channels([0, 1, 2], [0, 1, 2], [0, 1, 1]), structure, varies)


def test_an_element_that_is_not_seen_leaves_no_gain():
    """Neither the element reaches the performance, nor the input the element."""
    N = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.0], [0.0, 0.0]], np.zeros((2, 2)))
    found = worst_case_gain(N, Structure([Complex(1)]))
    assert (found.lower, found.upper) == (0.0, 0.0) and found.holds
    checker = found._checked_by[0]
    N = control.ss(-np.eye(2), np.eye(2), [[0.5, 1e-9], [1e-9, 0.0]], np.zeros((2, 2)))
    assert not type(checker)(N, Structure([Complex(1)])).certify(found, 1e-6).valid

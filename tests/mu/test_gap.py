"""The nu-gap and the coprime margin: the chordal distance, the winding number, and the guarantee.

Source of numbers: MathWorks, Robust Control Toolbox, reference page of gapmetric.
"""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import coprime_margin, nu_gap
from workbench.systems.bilinear import bilinear_sampled

tf = control.tf


def chordal(P1, P2):
    """Largest chordal distance of scalar plants on a grid."""
    w = np.geomspace(1e-6, 1e6, 40_001)
    a, b = P1(1j * w), P2(1j * w)
    return float((np.abs(a - b) / np.sqrt((1 + abs(a) ** 2) * (1 + abs(b) ** 2))).max())


@pytest.mark.parametrize(
    ("first", "second", "documented"),
    [
        (tf([1], [1, -0.001]), tf([1], [1, 0.001]), 0.0020),
        (tf([100], [2, 1]), tf([100], [2, -1]), 0.0200),
        (tf([100], [2, 1]), tf([100], [1, 2, 1]), 0.8988),
    ],
)
def test_gaps_as_documented(first, second, documented):
    found = nu_gap(first, second)
    assert found.winding is True
    assert found.lower - 5e-5 <= documented <= found.upper + 5e-5
    assert found.lower <= chordal(first, second) * (1 + 1e-6) + 1e-12
    assert found.upper >= chordal(first, second) * (1 - 1e-9)
    assert nu_gap(second, first).upper == pytest.approx(found.upper, rel=1e-6)


def test_plants_that_no_feedback_holds_alike():
    """1 / (s + 1) and -1 / (s + 1) are far apart; so are a stable and an unstable fast plant."""
    far = nu_gap(tf([1], [1, 1]), tf([1], [1, -1]))
    assert far.winding is False or far.upper == 1.0
    wound = nu_gap(tf([0.1], [1, 1]), tf([0.1], [1, -1]))
    assert wound.winding is False and wound.lower == wound.upper == 1.0
    assert chordal(tf([0.1], [1, 1]), tf([0.1], [1, -1])) < 0.3  # the distance alone says little


def test_a_plant_is_at_no_distance_from_itself():
    plant = control.ss(tf([1, 2], [1, 0.3, 4]))
    found = nu_gap(plant, plant)
    assert found.upper < 1e-6 and found.winding is True


def random_plant(rng, n, p, m):
    A = rng.normal(size=(n, n))
    return control.ss(A, rng.normal(size=(n, m)), rng.normal(size=(p, n)), 0.0)


@pytest.mark.parametrize("seed", range(12))
def test_what_the_margin_promises_of_every_plant_in_the_gap(seed):
    rng = np.random.default_rng(seed)
    p, m = int(rng.integers(1, 3)), int(rng.integers(1, 3))
    P1 = random_plant(rng, 3, p, m)
    K, _, _ = control.lqr(P1, np.eye(3), np.eye(m))
    L, _, _ = control.lqe(P1.A, np.eye(3), P1.C, np.eye(3), np.eye(p))
    C = control.ss(P1.A - P1.B @ K - L @ P1.C, L, K, 0.0)
    margin = coprime_margin(P1, C)
    assert 0 < margin.lower <= margin.upper <= 1
    for size in (0.01, 0.1, 0.5):
        P2 = control.ss(
            P1.A + size * rng.normal(size=(3, 3)), P1.B, P1.C + size * rng.normal(size=(p, 3)), 0.0
        )
        gap = nu_gap(P1, P2)
        assert 0 <= gap.lower <= gap.upper <= 1
        if gap.upper >= margin.lower:
            continue
        kept = coprime_margin(P2, C)  # raises where the loop is unstable
        room = np.arcsin(margin.lower) - np.arcsin(gap.upper)
        assert np.arcsin(min(kept.upper, 1.0)) >= room - 1e-9


@pytest.mark.parametrize("period", [1e-3, 0.2])
def test_sampled_plants_have_the_gap_of_what_they_are_sampled_of(period):
    P1, P2 = control.ss(tf([1], [1, 1])), control.ss(tf([2], [1, 3, 1]))
    one = nu_gap(P1, P2)
    other = nu_gap(bilinear_sampled(P1, period), bilinear_sampled(P2, period))
    assert other.upper == pytest.approx(one.upper, rel=1e-6)
    assert other.omega == pytest.approx(2 / period * np.arctan(one.omega * period / 2), rel=1e-2)


def test_the_margin_of_a_known_loop():
    """Of 1 / s and 1 the four entries have the gains 1 / (s + 1) and s / (s + 1): b is 1/sqrt 2."""
    found = coprime_margin(tf([1], [1, 0]), 1.0)
    assert found.lower <= 1 / np.sqrt(2) <= found.upper * (1 + 1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: nu_gap("P", tf([1], [1, 1])), "first must be"),
        (lambda: nu_gap(tf([1], [1, 1]), None), "second must be"),
        (lambda: nu_gap(tf([1], [1, 1]), np.eye(2)), "they must be the same"),
        (lambda: nu_gap(tf([1], [1, 1]), control.ss(0.5, 1, 1, 0, 0.1)), "dt"),
        (lambda: nu_gap(tf([1], [1, 1]), tf([1], [1, 1]), tolerance=0.0), "tolerance"),
        (lambda: coprime_margin(tf([1], [1, 1]), np.eye(2)), "must fit each other"),
        (lambda: coprime_margin(tf([1], [1, -1]), 0.5), "unstable at the nominal"),
        (lambda: coprime_margin(None, 0.5), "plant must be"),
        (lambda: coprime_margin(tf([1], [1, 1]), "K"), "controller must be"),
    ],
)
def test_bad_input_of_gaps(call, words):
    with pytest.raises(InputError, match=words):
        call()

"""Systems without states, elements without effect, and sizes at the ends of doubles."""

import control
import numpy as np
import pytest

from workbench._core.arrays import EPS
from workbench.certify.norms import certified_norm
from workbench.mu import robust_stability, upper_bound, worst_case_gain
from workbench.structure import Real, Structure
from workbench.uncertainty import dynamics, feedback, real, ss, tf

K = real("k", 2, percent=40)


@pytest.mark.parametrize(
    ("system", "gain"),
    [
        (K * 1.0, 2.8),
        (ss([], [], [], [[K]]), 2.8),
        (2.0 * (1 + 0.3 * dynamics("d", 1, 1)), 2.6),
        (feedback(K * 1.0, 0.5), 2.8 / 2.4),
    ],
)
def test_the_worst_gain_of_a_static_system(system, gain):
    found = worst_case_gain(system)
    assert found.lower <= gain * (1 + 1e-9) and gain <= found.upper <= 1.02 * gain
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("loop", [K - K, tf([1], [1, 1]) * (K - K)])
def test_an_element_without_effect_limits_nothing(loop):
    found = robust_stability(feedback(loop, 1))
    assert found.lower == found.upper == np.inf and found.holds
    assert "nan" not in repr(found)


def test_an_element_without_effect_beside_one_with(loop=None):
    other = real("c", 1, percent=50)
    system = feedback(tf([1], [1, other]) + 0.0 * (K - K), 1)
    alone = feedback(tf([1], [1, other]), 1)
    assert robust_stability(system).lower == pytest.approx(robust_stability(alone).lower, rel=1e-3)


@pytest.mark.parametrize("gain", [1e300, 1e-300, 5e-324, 1.7e308, 1.0])
def test_the_norm_of_a_static_gain_of_any_size(gain):
    found = certified_norm(control.ss([], [], [], [[gain]]))
    assert gain <= found <= max(gain * 1.001, 1e-322) or found == np.inf > gain > 1e308


def test_neighbours_of_nilpotent_matrices():
    """Each starts where the path of the one before ended: at t = 0.

    D of condition k makes 2 |size| / sqrt(k) of the bound. Normal equations square k, so that the
    path is followed at least to k = 1 / sqrt(EPS), and how much farther the last bits decide.
    """
    size = np.array([102338.4 - 4315.6j, 102197.2 - 5747.0j, 101947.1 - 7645.0j, 101505.3 - 1e4j])
    M = size[:, None, None] * np.array([[-1.0, 1.0], [-1.0, 1.0]])
    M[:, 0] += 1.5e-11
    found = upper_bound(M, Structure([Real(2)])).value
    assert (found < 2 * EPS**0.25 * np.abs(size)).all()

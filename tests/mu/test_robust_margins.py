"""Margins of uncertain systems against numbers that the toolbox's documentation prints.

Sources: MathWorks, Robust Control Toolbox, reference pages of robstab, robgain and wcgain, and
"Robust Stability and Worst-Case Gain of Uncertain System" (the two carts).
"""

import control
import numpy as np
import pytest

from workbench.certify.norms import certified_norm
from workbench.errors import InputError
from workbench.mu import margin_sensitivity, robust_performance, robust_stability, worst_case_gain
from workbench.uncertainty import dynamics, feedback, interconnect, real, ss, tf


@pytest.fixture(scope="module")
def plant():
    k = real("k", 10, percent=40)
    return tf([18], [1, 1.8, k]) * (1 + 0.5 * dynamics("delta", 1, 1))


PID = control.ss(control.tf([0.3823, 2.303, 3], [1e-3, 1, 0]))


def test_robust_stability_as_documented(plant):
    """robstab: 1.5960 to 1.5993."""
    loop = feedback(plant * PID, 1)
    margin = robust_stability(loop)
    assert 1.5960 <= margin.lower <= margin.upper <= 1.5993
    poles = loop.at(**margin.worst).poles()
    assert np.abs(poles - 1j * margin.omega).min() < 1e-6 * margin.omega
    k, delta = margin.worst["k"], margin.worst["delta"]
    size = max(abs(k - 10) / 4, certified_norm(delta))
    assert size == pytest.approx(margin.upper, rel=1e-4)
    assert "stable for all of its uncertainty" in repr(margin)


def test_margins_of_performance_are_as_narrow_as_the_tolerance():
    """The gain grows slowly with the uncertainty, so 1 lies between the bounds of mu for many
    sizes; the plants at the ends of the interval, on a grid of frequencies, are the truth.
    """
    k, C = real("k", 10, percent=40), control.tf([0.4, 1.0], [0.02, 1.0])
    margin = robust_performance(feedback(tf([18], [1, 1.8, k]) * C, 1))
    s = 1j * np.geomspace(0.5, 20.0, 4000)

    def largest_gain(size):
        loops = (18 / (s * s + 1.8 * s + 10 * (1 + d * size)) * C(s) for d in (-0.4, 0.4))
        return max(np.abs(L / (1 + L)).max() for L in loops)

    assert largest_gain(margin.lower) < 1.0 <= largest_gain(1.0001 * margin.upper)
    assert margin.upper < 1.005 * margin.lower


@pytest.mark.cases(0)
def test_robust_performance_as_documented(plant):
    """robgain(S, 1.5): 0.7821 to 0.7837."""
    margin = robust_performance(feedback(1, plant * PID), gain=1.5)
    assert 0.7821 <= margin.lower <= margin.upper <= 0.7838
    # The same by the worst-case gain of smaller and of larger uncertainty.
    for factor, below in ((margin.lower * 0.999, True), (margin.upper * 1.001, False)):
        k = real("k", 10, percent=40 * factor)
        G = tf([18], [1, 1.8, k]) * (1 + 0.5 * factor * dynamics("delta", 1, 1))
        found = worst_case_gain(feedback(1, G * PID), tolerance=1e-4)
        assert (found.upper < 1.5) if below else (found.lower > 1.5)


def test_worst_case_gain_as_documented():
    """wcgain: 5.1036 to 5.1140."""
    G = control.tf([1], [1, 0]) + dynamics("delta", 1, 1, bound=0.4)
    C = control.ss(2 - 0.04 * control.tf([1, 0], [0.02, 1]))
    found = worst_case_gain(feedback(1, G * C), tolerance=1e-3)
    assert 5.1036 <= found.lower <= found.upper <= 5.1140


@pytest.mark.cases(0)
def test_two_carts_as_documented():
    """robstab: 2.8826 to 2.8864 at 575.03 rad/s, worst k = 1.5773; all parameters are real.

    The lower bound is proven with a complex part of 0.1 %, which costs 0.3 %. wcgain: 1.0475 to
    1.0732, the upper bound between frequencies not proven.
    """
    m1, m2, k = (real(name, 1, percent=20) for name in ("m1", "m2", "k"))
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k / m1, k / m1, 0, 0], [k / m2, -k / m2, 0, 0]]
    carts = ss(A, [[0], [0], [1 / m1], [0]], [[0, 1, 0, 0]], [[0]])
    lead = control.ss(control.tf([1, 1], [0.001, 1]))
    loop = feedback(carts * (100 * lead * lead * lead), 1)
    margin = robust_stability(loop)
    assert 0.997 * 2.8826 <= margin.lower <= 2.8864
    assert margin.upper == pytest.approx(2.8864, abs=2e-4)
    assert margin.omega == pytest.approx(575.03, abs=0.1)
    assert margin.worst["k"] == pytest.approx(1.5773, abs=2e-4)
    assert loop.at(**margin.worst).poles().real.max() > -1e-6 * margin.omega


@pytest.mark.cases(0)
def test_the_sensitivity_of_a_margin_as_documented():
    """robgain, Sensitivity: delta 75 %, k 28 %, for k within 50 % and delta within 0.15."""
    k = real("k", 10, percent=50)
    P = tf([18], [1, 1.8, k]) * (1 + 0.15 * dynamics("delta", 1, 1))
    found = margin_sensitivity(feedback(1, P * PID), gain=1.5)
    for name, documented in (("delta", 0.75), ("k", 0.28)):
        low, high = found[name]
        assert low - 0.005 <= documented <= high + 0.005
        assert high - low < 0.01


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("decay", [0.2, 0.6])
def test_a_rate_of_decay(dt, decay):
    """Poles at -1 - k, sampled at exp(-(1 + k) T): within the rate until k = decay - 1."""
    k = real("k", 0.0, plus_minus=0.5)
    pole = -1 - k if not dt else 0.9 - 0.09 * k
    system = ss([[pole]], [[1]], [[1]], [[0]], dt)
    margin = robust_stability(system, decay=decay)
    limit = decay - 1 if not dt else (0.9 - np.exp(-decay * dt)) / 0.09
    assert margin.worst["k"] == pytest.approx(limit, rel=1e-3)
    assert margin.lower <= abs(limit) / 0.5 <= margin.upper * (1 + 1e-3)
    assert margin.lower > 0.98 * margin.upper
    assert robust_stability(system).lower > margin.upper
    moved = system.at(**margin.worst).poles()
    assert (np.log(moved) / dt if dt else moved).real.max() == pytest.approx(-decay, rel=1e-3)


def test_decay_is_not_for_dynamics():
    system = feedback(tf([1], [1, 1]) * (1 + dynamics("d", 1, 1, bound=0.1)), 1)
    with pytest.raises(InputError, match="d is dynamics"):
        robust_stability(system, decay=0.5)
    with pytest.raises(InputError, match="decay is -1"):
        robust_stability(system, decay=-1)
    with pytest.raises(InputError, match="decays at 1 1/s, and 2 1/s is asked for"):
        robust_stability(tf([1], [1, real("a", 1, percent=10)]), decay=2.0)


def test_a_margin_at_a_single_frequency():
    """A damper c from 0 to 2: the only frequency at which it can become unstable is 1 rad/s.

    An example of the toolbox's documentation, in which grids of frequencies see nothing.
    """
    c = real("c", 1, plus_minus=1)
    margin = robust_stability(tf([1], [1, c, 1]))
    assert 0.99 < margin.lower <= 1.0 <= margin.upper * (1 + 1e-9) and margin.upper < 1.0001
    assert margin.omega == pytest.approx(1.0, abs=1e-6)
    assert margin.worst["c"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_the_worst_gain_of_two_carts_as_documented():
    """wcgain: 1.0475 to 1.0732. |T| is near 1 over a decade, where a proof takes many intervals."""
    m1, m2, k = (real(name, 1, percent=20) for name in ("m1", "m2", "k"))
    double = control.ss(control.tf([1], [1, 0, 0]))
    carts = interconnect(
        [(double / m1, "f1", "x1"), (double / m2, "f", "x2"), (k, "d", "f")],
        {"d": "x1 - x2", "f1": "u - f"},
        inputs="u",
        outputs="x2",
    )
    lead = control.ss(control.tf([1, 1], [0.001, 1]))
    found = worst_case_gain(feedback(carts * (100 * lead * lead * lead), 1))
    assert found.lower == pytest.approx(1.0475, abs=1e-4)
    assert found.upper <= 1.2


@pytest.mark.cases(2)
@pytest.mark.parametrize("seed", range(6))
def test_margins_of_one_parameter_are_those_of_its_roots(seed):
    """s^2 + 2 d s + (1 + k) with |k| <= r: unstable from k = -1 on."""
    rng = np.random.default_rng(seed)
    d, r = rng.uniform(0.2, 1.0), rng.uniform(0.1, 3.0)
    k = real("k", 0.0, plus_minus=r)
    margin = robust_stability(tf([1], [1, 2 * d, 1 + k]))
    assert margin.lower <= 1 / r <= margin.upper * (1 + 1e-9)
    assert margin.upper == pytest.approx(1 / r, rel=1e-4)
    assert margin.lower > 0.97 / r
    assert margin.worst["k"] == pytest.approx(-1.0, rel=1e-4)


def test_what_no_perturbation_destabilises():
    delta = dynamics("delta", 1, 1)
    G = control.ss(control.tf([1], [1, 1]))
    margin = robust_stability(G * delta * 0.5)  # in series, no loop
    assert margin.lower == np.inf or margin.lower > 1e3


def test_a_nominal_gain_above_the_level_leaves_no_margin():
    G = control.ss(control.tf([3], [1, 1])) * (1 + 0.1 * dynamics("delta", 1, 1))
    margin = robust_performance(G, gain=2.0)
    assert margin.lower == margin.upper == 0.0


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.ss(control.tf([1], [1, 1])), "no uncertain element"),
        (tf([1], [1, -1]) * real("k", 1, percent=5), "unstable at its nominal: it has a pole at 1"),
        (ss([[1.5]], [[1]], [[real("k", 1, percent=5)]], [[0]], 0.1), "has a pole at 1.5"),
        ("loop", "system must be"),
    ],
)
def test_bad_systems(system, words):
    for function in (robust_stability, robust_performance):
        with pytest.raises(InputError, match=words):
            function(system)


def test_a_level_is_positive(plant):
    with pytest.raises(InputError, match="gain is 0"):
        robust_performance(feedback(1, plant * PID), gain=0)

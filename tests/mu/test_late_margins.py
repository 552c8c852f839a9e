"""Robust stability with known dead time, against closed forms, grids and exact counts."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from delayed_loops import DelayedLoop, is_stable

from workbench.errors import ContradictionError, InputError
from workbench.mu import robust_stability
from workbench.mu.robust import late_margin
from workbench.uncertainty import append, delay, dynamics, feedback, real, tf

CONTROLLER = control.tf([1, 0.5], [1, 0])
OMEGA = np.geomspace(1e-3, 1e3, 200_001)


def late(T, name="tau"):
    return delay(name, T, T)


def lag(T, unit=1.0):
    """5 (1 + 0.2 delta) exp(-s T) / (s + 1) in a loop."""
    return feedback(tf([5], [unit, 1]) * (1 + 0.2 * dynamics("d", 1, 1)) * late(T * unit), 1)


@pytest.mark.cases(1)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_dynamics_of_a_lag_with_dead_time(unit):
    """|1 + L| is 0.2 |L| times the margin where it is lost."""
    found = robust_stability(lag(0.3, unit), tolerance=1e-3)
    L = 5 / (1 + 1j * OMEGA) * np.exp(-0.3j * OMEGA)
    truth = (np.abs(1 + L) / (0.2 * np.abs(L))).min()
    assert (1 - 2e-3) * truth < found.lower < truth < found.upper * (1 + 1e-6)
    assert found.upper < (1 + 1e-4) * truth
    assert found.holds, found.certificate.failures
    assert "with the dead time itself" in repr(found)


def test_the_worst_dynamics_put_a_pole_on_the_axis():
    found = robust_stability(lag(0.3), tolerance=1e-3)
    s = 1j * found.omega
    delta = complex(found.worst["d"](s))
    assert abs(1 + 5 * (1 + 0.2 * delta) * np.exp(-0.3 * s) / (s + 1)) < 1e-9
    assert abs(delta) == pytest.approx(found.upper, rel=1e-9)
    sizes = np.abs(found.worst["d"](1j * OMEGA))
    assert sizes.max() < found.upper * (1 + 1e-9)


def test_a_gain_with_dead_time_is_lost_at_its_phase_crossover():
    k = real("k", 2, percent=20)
    found = robust_stability(feedback(tf([5 * k], [1, 1]) * late(0.1), 1), tolerance=1e-3)
    omega = 16.3  # atan(omega) + 0.1 omega = pi, by Newton's method
    for _ in range(50):
        omega -= (math.atan(omega) + 0.1 * omega - math.pi) / (1 / (1 + omega**2) + 0.1)
    truth = (math.hypot(1, omega) / 10 - 1) / 0.2
    assert (1 - 2e-3) * truth < found.lower < truth < found.upper < (1 + 2e-5) * truth
    assert found.omega == pytest.approx(omega, rel=1e-4)
    assert found.holds, found.certificate.failures


def test_two_channels_and_a_full_block():
    """The margin of one full block is 1 / max |M|, M = -0.3 T with the dead time in T."""
    G = np.eye(2) * (tf([1], [1, 1]) * late(0.3))
    K = np.array([[1.0, 0.5], [0.0, 1.0]])
    block = np.eye(2) + 0.3 * dynamics("D", 2, 2)
    found = robust_stability(feedback(G @ block, K), tolerance=1e-3)
    g = np.exp(-0.3j * OMEGA) / (1 + 1j * OMEGA)
    loop = K * g[:, None, None]
    T = np.linalg.solve((np.eye(2) + loop).transpose(0, 2, 1), loop.transpose(0, 2, 1))
    truth = 1 / (0.3 * np.linalg.norm(T, 2, axis=(1, 2)).max())
    assert (1 - 2e-3) * truth < found.lower < truth * (1 + 1e-6)
    assert found.upper == pytest.approx(truth, rel=1e-4)
    assert found.holds, found.certificate.failures


@pytest.mark.slow
def test_dead_time_inside_the_controller_too():
    """A Smith predictor: with the dead time itself T = G C / (1 + G C) exp(-s T) is no loop's."""
    G = tf([2], [3, 1])
    predictor = feedback(CONTROLLER, G * (1 - late(4.0)))
    plant = G * (1 + 0.3 * dynamics("d", 1, 1)) * late(4.0)
    found = robust_stability(feedback(plant, predictor), tolerance=1e-2)
    s = 1j * OMEGA
    loop = 2 / (3 * s + 1) * (s + 0.5) / s
    truth = (np.abs(1 + loop) / (0.3 * np.abs(loop))).min()
    assert (1 - 2e-2) * truth < found.lower < truth * (1 + 1e-6)
    assert found.upper == pytest.approx(truth, rel=1e-3)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(12))
def test_random_sets_of_parameters_by_exact_counts(seed):
    """Members within the proven size are stable in 50 digits, and the worst one is not."""
    rng = np.random.default_rng(seed)
    k0, a0, T = 10 ** rng.uniform(-0.3, 0.5), 10 ** rng.uniform(-0.5, 0.5), 10 ** rng.uniform(-1, 0)
    k, a = real("k", k0, percent=30), real("a", a0, percent=40)
    closed = feedback(tf([k], [1, a, 1]) * late(T), 1)
    try:
        found = robust_stability(closed, tolerance=1e-2)
    except InputError as refused:
        assert "unstable at its nominal" in str(refused)
        assert not is_stable(DelayedLoop((k0,), (1.0, a0, 1.0), T))
        return
    assert found.lower <= found.upper
    for signs in rng.uniform(-1, 1, (6, 2)):
        x, y = (0.999 * found.lower * signs / np.abs(signs).max()).tolist()
        member = (k0 * (1 + 0.3 * x),), (1.0, a0 * (1 + 0.4 * y), 1.0)
        assert is_stable(DelayedLoop(*member, T))
    if found.worst is not None and found.omega > 1e-6:
        beyond = 1.0 + 0.05 / found.upper  # which the count of turns tells clearly
        x, y = (beyond * (found.worst[n] - one) for n, one in (("k", k0), ("a", a0)))
        assert not is_stable(DelayedLoop((k0 + x,), (1.0, a0 + y, 1.0), T))
    assert found.holds, found.certificate.failures


def test_a_loop_that_keeps_a_size_at_infinity_is_not_decided():
    closed = feedback(tf([1, 3], [2, 5]) * (1 + 0.2 * dynamics("d", 1, 1)) * late(1.0), 1)
    found = robust_stability(closed, tolerance=1e-2)
    assert found.lower == 0.0 < found.upper < math.inf
    assert "not decided" in repr(found)


@pytest.mark.cases(1)
@pytest.mark.parametrize("field", ["lower", "upper"])
@pytest.mark.parametrize("kind", ["dynamics", "parameter"])
def test_a_claim_that_is_too_good_fails(kind, field):
    k = real("k", 5, percent=20)
    parametric = feedback(tf([k], [1, 1]) * late(0.1), 1)
    found = robust_stability(lag(0.3) if kind == "dynamics" else parametric, tolerance=1e-2)
    factor = 1.02 if field == "lower" else 0.98
    wrong = replace(found, **{field: factor * getattr(found, field)})
    assert not wrong.with_checker(found._checked_by[0]).holds


def test_bounds_that_cross_are_a_contradiction(monkeypatch):
    monkeypatch.setattr(late_margin, "_lower_bounds", lambda found, corner: (1e3, 0.0))
    with pytest.raises(ContradictionError, match="mu with dead time"):
        robust_stability(lag(0.3), tolerance=1e-2)


@pytest.mark.parametrize(
    ("system", "settings", "words"),
    [
        (feedback(tf([5], [1, 1]) * late(0.3), 1), {}, "dead time tau and no uncertain element"),
        (lag(0.4), {}, "unstable at its nominal"),
        (lag(0.3), {"decay": 0.1}, "move the axis"),
    ],
)
def test_what_has_no_margin_is_refused(system, settings, words):
    with pytest.raises(InputError, match=words):
        robust_stability(system, **settings)


def test_one_of_several_channels_is_lost_at_rest():
    """The set's bound has several peaks; the member k = -1, lost at 0 rad/s, is found."""
    k = real("k", 2, percent=20)
    plant = append(tf([1], [1, 1]), tf([k], [1, 1])) * late(0.1)
    found = robust_stability(feedback(plant, np.eye(2)))
    assert 7.49 < found.lower <= 7.5 * (1 + 1e-6)
    assert found.upper == pytest.approx(7.5, rel=1e-4) and found.omega == 0.0
    assert found.holds, found.certificate.failures

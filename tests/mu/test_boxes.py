"""Branch and bound over parameters and frequency, against Kharitonov's theorem and samples."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import robust_stability
from workbench.mu.boxes import recentred
from workbench.uncertainty import dynamics, feedback, real, ss, tf


def interval_polynomial(order, seed):
    """Coefficients of a stable polynomial, the highest one 1, and their half-widths in percent."""
    rng = np.random.default_rng(seed)
    roots = -rng.uniform(0.3, 3, order // 2) + 1j * rng.uniform(0.2, 3, order // 2)
    roots = np.concatenate([roots, roots.conj(), -rng.uniform(0.3, 3, order % 2)])
    return np.real(np.poly(roots)), rng.uniform(5, 20, order)


def kharitonov(c, percent):
    """The exact factor: four polynomials decide whether all are stable (Kharitonov 1978)."""

    def stable(t):
        low, high = (np.append((c[1:] * (1 + s * t * percent / 100))[::-1], 1) for s in (-1, 1))
        for pattern in ("llhh", "hhll", "lhhl", "hllh"):
            one = [(low if pattern[i % 4] == "l" else high)[i] for i in range(len(c))]
            if np.roots(one[::-1]).real.max() >= 0:
                return False
        return True

    a, b = 0.0, 1e3
    for _ in range(80):
        a, b = ((a + b) / 2, b) if stable((a + b) / 2) else (a, (a + b) / 2)
    return a


def family(c, percent, scale=1.0):
    """1 / p(s / scale) with uncertain coefficients."""
    names = [f"a{i}" for i in range(len(percent))]
    powers = scale ** np.arange(1, len(c))
    uncertain = [
        real(name, value * power, percent=float(share))
        for name, value, power, share in zip(names, c[1:], powers, percent, strict=True)
    ]
    return tf([1], [1, *uncertain])


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    ("order", "seed"), [(3, 1), (4, 2), pytest.param(6, 4, marks=pytest.mark.slow)]
)
def test_margins_of_interval_polynomials_are_exact(order, seed):
    """Up to six real parameters, to 1 %."""
    c, percent = interval_polynomial(order, seed)
    exact = kharitonov(c, percent)
    found = robust_stability(family(c, percent), tolerance=1e-2)
    assert 0.99 * exact <= found.lower <= exact * (1 + 1e-9)
    assert found.upper == pytest.approx(exact, rel=1e-5)
    poles = family(c, percent).at(**found.worst).poles()
    assert abs(poles.real).min() < 1e-5 * abs(poles).max()


@pytest.mark.cases(0)
@pytest.mark.parametrize("scale", [1e-6, 1e7])
def test_the_unit_of_time_does_not_matter(scale):
    c, percent = interval_polynomial(4, 5)
    found = robust_stability(family(c, percent, scale), tolerance=1e-2)
    assert 0.99 * (exact := kharitonov(c, percent)) <= found.lower <= exact * (1 + 1e-9)


@pytest.mark.cases(0)
@pytest.mark.parametrize("seed", range(6))
def test_no_member_within_the_margin_is_unstable(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(4)
    parameters = [real(f"k{i}", 0, plus_minus=1) for i in range(3)]
    terms = sum(k * rng.normal(size=(4, 1)) @ rng.normal(size=(1, 4)) for k in parameters)
    system = ss(A + terms, np.ones((4, 1)), np.ones((1, 4)), 0)
    found = robust_stability(system, tolerance=1e-2)
    assert found.lower <= found.upper * (1 + 1e-9)
    assert found.upper <= 1.011 * found.lower
    inside = found.lower * rng.uniform(-1, 1, (2000, 3))
    inside[:1000] = found.lower * np.sign(inside[:1000])
    for values in inside[:: 10 if seed else 1]:
        poles = system.at(**dict(zip(system.elements, values, strict=True))).poles()
        assert poles.real.max() < 0
    assert system.at(**found.worst).poles().real.max() > -1e-6


def test_a_set_that_is_stable_without_limit():
    k = real("k", 1, plus_minus=1)
    found = robust_stability(ss([[-1, 0], [k, -2]], [[1], [0]], [[0, 1]], 0))
    assert found.upper == np.inf
    assert found.worst is None
    assert found.lower > 1e5


@pytest.mark.cases(0)
def test_too_few_parts_are_said():
    c, percent = interval_polynomial(6, 4)
    found = robust_stability(family(c, percent), tolerance=1e-2, parts=3)
    assert found.lower < 0.99 * found.upper
    assert found.parts <= 8


def test_sampled_systems():
    a = real("a", 1.2, plus_minus=0.1)
    b = real("b", -0.5, plus_minus=0.1)
    found = robust_stability(ss([[a, b], [1, 0]], [[1], [0]], [[0, 1]], 0, 0.1), tolerance=1e-3)
    # z^2 - a z - b is stable where |b| < 1 and |a| < 1 - b: 0.3 = 0.1 t + 0.1 t.
    assert found.lower <= 1.5 * (1 + 1e-9)
    assert found.lower >= 1.5 * 0.998
    assert found.upper == pytest.approx(1.5, rel=1e-6)


def test_a_damping_ratio():
    """s^2 + c s + 1 has the damping c / 2; at a rate too, the lesser margin counts."""
    c = real("c", 1, plus_minus=1)
    plant = tf([1], [1, c, 1])
    found = robust_stability(plant, damping=0.2)
    assert found.lower == pytest.approx(0.6, rel=1e-3)
    assert found.upper == pytest.approx(0.6, rel=1e-6)
    assert found.worst["c"] == pytest.approx(0.4, abs=1e-6)
    assert robust_stability(plant, damping=0.2, decay=0.4).upper == pytest.approx(0.2, rel=1e-6)


def test_a_damping_ratio_of_a_loop_with_several_modes():
    rng = np.random.default_rng(0)
    k1, k2 = real("k1", 4, percent=30), real("k2", 9, percent=30)
    plant = tf([1], [1, 0.8, k1]) * tf([1], [1, 1.4, k2])
    found = robust_stability(feedback(plant, 0.8), tolerance=1e-2, damping=0.1)
    for _ in range(300):
        values = {
            name: one.nominal + found.lower * (one.high - one.nominal) * rng.choice([-1, 1, 0.5])
            for name, one in plant.elements.items()
        }
        poles = feedback(plant, 0.8).at(**values).poles()
        assert (-poles.real / abs(poles)).min() > 0.1
    poles = feedback(plant, 0.8).at(**found.worst).poles()
    assert (-poles.real / abs(poles)).min() == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"damping": 1.0}, "damping is 1.0"),
        ({"damping": "much"}, "damping is 'much'"),
        ({"damping": 0.9}, r"nominal pole at .* has a damping of 0.5, and 0.9 is asked"),
        ({"decay": 0.5}, r"nominal pole at .* decays at 0.5 1/s, and 0.5 1/s is asked"),
        ({"parts": 0}, "parts is 0"),
        ({"tolerance": -1.0}, "tolerance"),
    ],
)
def test_wrong_regions_are_refused(asked, words):
    with pytest.raises(InputError, match=words):
        robust_stability(tf([1], [1, real("c", 1, plus_minus=1), 1]), **asked)


def test_corners_of_parts_contradict_a_false_proof(monkeypatch):
    """Where every frequency is called excluded, unstable corners still bound the margin."""
    monkeypatch.setattr(recentred, "open_bands", lambda system, *_: ((), system.D))
    c, percent = interval_polynomial(4, 2)
    found = robust_stability(family(c, percent), tolerance=1e-2)
    assert found.lower <= kharitonov(c, percent) * (1 + 1e-9)


def test_damping_needs_numbers_in_continuous_time():
    plant = tf([1], [1, 1, 1])
    with pytest.raises(InputError, match="d is dynamics"):
        robust_stability(feedback(plant * (1 + 0.5 * dynamics("d", 1, 1)), 1), damping=0.1)
    a = real("a", 0.5, plus_minus=0.1)
    with pytest.raises(InputError, match=r"dt = 0.1 s"):
        robust_stability(ss([[a]], [[1]], [[1]], 0, 0.1), damping=0.1)


def light(w):
    return feedback(tf([1], [1, 1e-4, 1e-4 * w]), 1e-5)


def stiff(a, b):
    return feedback(tf([1], [1e-6, 1]) * tf([a], [1e6, 1]) * tf([b], [1, 1]), 2.0)


def chain(a):
    plant = control.tf([1], [1])
    for _ in range(10):
        plant = plant * control.tf([1], [1, 1])
    return feedback(control.ss(plant) * a, 0.5)


A, B, X = real("a", 1, percent=50), real("b", 1, percent=50), real("x", 0, plus_minus=1)


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("system", "exact"),
    [
        (light(real("w", 1e4, percent=1)), 100.001),  # poles at a damping of 5e-5
        (tf([1], [1, real("c", 1e-9, plus_minus=1), 1]), 1e-9),
        (1 / (1 + X) * tf([1], [1, 1]), 1.0),  # divides by zero
        (1 / (2 + X), 2.0),  # has no states
        (tf([1], [1 + 0.5 * X, 1, 1]), 2.0),  # a pole goes through infinity
        (tf([1], [real("e", 0.1, plus_minus=0.1), 1, 1]), 1.0),
        (tf([1], [1, 1.0001 - X * X, 1]), 1.0001**0.5),  # touches its border on both sides
        (chain(A), 2 * (2 * (1 / np.cos(np.pi / 10)) ** 10 - 1)),  # ten equal poles
    ],
)
def test_what_is_hard(system, exact):
    found = robust_stability(system)
    assert exact * (1 - 2e-4) <= found.lower <= exact * (1 + 1e-9)
    assert found.upper == pytest.approx(exact, rel=1e-4)
    assert found.parts < 200


@pytest.mark.cases(0)
def test_poles_twelve_decades_apart():
    found = robust_stability(stiff(A, B))
    assert found.lower > found.upper * (1 - 2e-4)
    poles = stiff(A, B).at(**found.worst).poles()
    assert abs(poles.real).min() < 1e-9

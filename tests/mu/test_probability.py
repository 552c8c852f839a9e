"""Guaranteed probabilities, against areas known in closed form and against samples."""

from dataclasses import replace

import numpy as np
import pytest
from lanes import thinned
from scipy import stats

from workbench.errors import InputError, UnknownNameError
from workbench.mu import guaranteed_probability
from workbench.uncertainty import complex_scalar, dynamics, real, ss, tf

RNG = np.random.default_rng(0)


def holds(found, exact, tolerance):
    assert found.lower <= exact <= found.upper
    assert found.upper - found.lower <= tolerance


def test_a_probability_known_in_closed_form():
    """s^2 + a s + b is stable where both are positive."""
    a, b = (real(name, 0.5, plus_minus=1) for name in "ab")
    found = guaranteed_probability(tf([1], [1, a, b]), width=0.03)
    holds(found, 0.75**2, 0.03)
    assert "stable; " in repr(found)


@pytest.mark.slow
def test_a_curved_boundary():
    """s^3 + x s^2 + y s + z of positive coefficients is stable where x y > z: an integral."""
    x, y = real("x", 1, plus_minus=1), real("y", 1, plus_minus=1)
    found = guaranteed_probability(tf([1], [1, x, y, 0.5]), width=0.05)
    holds(found, 1 - (0.5 + 0.5 * np.log(8)) / 4, 0.05)


def gains(x, y):
    """Largest gains of 1 / (s^2 + x s + y)."""
    inner = np.maximum(y - x * x / 4, 1e-9)
    return np.where(x * x < 2 * y, 1 / (x * np.sqrt(inner)), 1 / y)


@pytest.mark.cases(0)
@pytest.mark.parametrize("named", thinned([{}, {"x": stats.norm(0.5, 0.2)}], 2))
def test_the_probability_of_a_gain(named):
    x, y = real("x", 0.6, plus_minus=0.4), real("y", 1, plus_minus=0.5)
    found = guaranteed_probability(tf([1], [1, x, y]), gain=2.0, distributions=named, width=0.08)
    draws = named["x"].rvs(10**6, random_state=1) if named else RNG.uniform(0.2, 1, 10**6)
    draws = draws[(draws > 0.2) & (draws < 1)]
    share = (gains(draws, RNG.uniform(0.5, 1.5, len(draws))) < 2).mean()
    assert found.lower - 0.002 <= share <= found.upper + 0.002
    assert found.upper - found.lower <= 0.08


def test_all_and_none():
    c = real("c", 1, plus_minus=0.5)
    sure = guaranteed_probability(tf([1], [1, c, 1]))
    assert sure.lower == pytest.approx(1.0, abs=1e-9)
    assert sure.parts == 1
    never = guaranteed_probability(tf([5], [1, c, 1]), gain=1.0, width=1e-3)
    assert never.upper == pytest.approx(0.0, abs=1e-3)


def test_an_uneven_range_counts_values_and_not_perturbations():
    c = real("c", 1, low=-1, high=9)
    found = guaranteed_probability(tf([1], [1, c, 1]), width=1e-3)
    holds(found, 0.9, 1e-3)


def test_sampled_systems_too():
    a = real("a", 0.5, plus_minus=1)
    holds(guaranteed_probability(ss([[a]], [[1]], [[1]], 0, 0.1), width=1e-3), 0.75, 1e-3)


PLANT = tf([1], [1, real("c", 1, plus_minus=0.5), 1])


@pytest.mark.parametrize(
    ("given", "asked", "words"),
    [
        (PLANT + complex_scalar("d", 0, 0.1), {}, "d is no real parameter"),
        (PLANT * (1 + dynamics("w", 1, 1)), {}, "w is no real parameter"),
        (PLANT, {"gain": -1.0}, "gain is -1.0"),
        (PLANT, {"width": 0}, "width is 0"),
        (PLANT, {"parts": 0.5}, "parts is 0.5"),
        (PLANT, {"distributions": {"c": 3}}, "one with a cdf"),
        (PLANT, {"distributions": {"c": stats.uniform(5, 6)}}, "no probability between"),
        (tf([1], [1, 1]), {}, "no uncertain element"),
        (tf([1], [1, real("c", -1, plus_minus=0.5), 1]), {}, "unstable at its nominal"),
    ],
)
def test_wrong_questions_are_refused(given, asked, words):
    with pytest.raises(InputError, match=words):
        guaranteed_probability(given, **asked)


def test_an_unknown_parameter_is_named():
    with pytest.raises(UnknownNameError, match="k"):
        guaranteed_probability(PLANT, distributions={"k": stats.norm(0, 1)})


class Atoms:
    """Probabilities of single values, and what is left uniform between -1 and 1."""

    def __init__(self, weights):
        self.weights, self.rest = weights, 1.0 - sum(weights.values())

    def cdf(self, value):
        spread = self.rest * min(max((value + 1) / 2, 0.0), 1.0)
        return spread + sum(w for place, w in self.weights.items() if place <= value)

    def rvs(self, size, random_state):
        drawn = random_state.uniform(-1, 1, size)
        choice = random_state.uniform(size=size)
        for place, weight in self.weights.items():
            choice = choice - weight
            drawn = np.where((choice < 0) & (choice >= -weight), place, drawn)
        return drawn


@pytest.mark.parametrize(
    ("law", "truth"),
    [
        (stats.randint(-1, 2), 2 / 3),  # -1, 0 and 1
        (stats.randint(-3, 4), 2 / 3),  # the same, restricted to the range
        (Atoms({-1.0: 0.95}), 0.05 * 0.75),
        (Atoms({-1.0: 0.2, -0.6: 0.3, 1.0: 0.1}), 0.1 + 0.4 * 0.75),
        (Atoms({0.0: 0.4}), 0.4 + 0.6 * 0.75),
        (stats.uniform(-1, 2), 0.75),
    ],
)
def test_values_that_have_a_probability_of_their_own(law, truth):
    """p + 0.5 is stable from p = -0.5 on; the ends of the range belong to it."""
    p = real("p", 0, plus_minus=1)
    found = guaranteed_probability(tf([1], [1, p + 0.5]), distributions={"p": law}, width=1e-3)
    holds(found, truth, 1e-3)
    assert found.holds, found.certificate.failures


@pytest.mark.cases(1)
@pytest.mark.parametrize("weights", [{-1.0: 0.95}, {-0.6: 0.3, 1.0: 0.5}, {}])
def test_a_law_that_cannot_draw_is_inverted(weights):
    class Undrawn:
        cdf = staticmethod(Atoms(weights).cdf)

    p = real("p", 0, plus_minus=1)
    found = guaranteed_probability(tf([1], [1, p + 0.5]), distributions={"p": Undrawn()})
    assert found.holds, found.certificate.failures
    far = (found.lower + 0.5) % 1.0
    wrong = replace(found, lower=far, upper=far)
    assert not found._checked_by[0].second_opinion(wrong)[0].holds


def test_a_wrong_probability_is_refuted_by_members_that_are_drawn():
    p = real("p", 0, plus_minus=1)
    found = guaranteed_probability(tf([1], [1, p + 0.5]), width=1e-3)
    wrong = replace(found, lower=0.9, upper=0.95)
    checker = found._checked_by[0]
    assert not checker.second_opinion(wrong)[0].holds
    assert checker.second_opinion(replace(found, lower=0.7, upper=0.8))[0].holds


def test_a_distribution_that_falls_is_refused():
    class Falling:
        def cdf(self, value):
            return 0.5 + 0.4 * np.sin(3 * value)

    p = real("p", 0, plus_minus=1)
    with pytest.raises(InputError, match=r"cdf of p decreases|no probability between"):
        guaranteed_probability(tf([1], [1, p + 0.5]), distributions={"p": Falling()})


def test_an_island_of_stable_members_between_unstable_ones_counts():
    """s + c is stable for |d| < 0.1 and for d from 0.6 to 0.7: ends and middles of parts with the
    second range in them are unstable."""
    d = real("d", 0, plus_minus=1)
    c = -1.0 * (d * d - 0.01) * (d - 0.6) * (d - 0.7)
    found = guaranteed_probability(tf([1], [1, c]), width=0.02)
    holds(found, 0.15, 0.02)

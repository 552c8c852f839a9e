"""Random members beside what is proven of all of them."""

from concurrent.futures import ThreadPoolExecutor

import control
import numpy as np
import pytest
from scipy import stats

from workbench.errors import InputError
from workbench.mu import MonteCarlo, bundle_plot, monte_carlo
from workbench.uncertainty import dynamics, feedback, real, ss, tf


def loop():
    k = real("k", 10, percent=40)
    P = tf([18], [1, 1.8, k]) * (1 + 0.5 * dynamics("delta", 1, 1))
    return feedback(P * control.ss(control.tf([0.3823, 2.303, 3], [1e-3, 1, 0])), 1)


def test_no_member_exceeds_what_is_proven():
    found = monte_carlo(loop(), count=60, seed=2)
    assert found.values.max() <= found.bound < 2.2
    assert found.values.std() > 0.05
    text = repr(found)
    assert "proven for every member: at most" in text and "90% of them up to" in text
    assert len(found.plot().axes) == 1


def test_members_are_the_same_wherever_they_are_computed():
    system = loop()
    with ThreadPoolExecutor(2) as pool:
        spread = monte_carlo(system, quantity=stiffest, count=40, seed=5, executor=pool)
    assert (spread.values == monte_carlo(system, quantity=stiffest, count=40, seed=5).values).all()
    assert (
        spread.values[:10] == monte_carlo(system, quantity=stiffest, count=10, seed=5).values
    ).all()
    assert (spread.values != monte_carlo(system, quantity=stiffest, count=40, seed=6).values).any()
    assert np.isnan(spread.bound) and "stiffest" in repr(spread)


def stiffest(member):
    return float(np.abs(member.poles()).max())


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_quantiles_hold_with_their_confidence(share):
    rng = np.random.default_rng(0)
    true = stats.expon.ppf(share)
    held = 0
    for _ in range(400):
        found = MonteCarlo(rng.exponential(size=200), "x", 0.9, np.nan)
        middle, low, high = found.quantile(share)
        assert low <= middle <= high
        held += low <= true <= high
    assert 0.87 <= held / 400 <= 0.97


def test_shares_hold_with_their_confidence():
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        found = MonteCarlo(rng.uniform(size=100), "x", 0.9, np.nan)
        share, low, high = found.probability(0.3)
        assert low <= share <= high
        held += low <= 0.3 <= high
    assert held / 400 >= 0.88


def test_few_members_have_open_ends():
    found = MonteCarlo(np.arange(10.0), "x", 0.95, np.nan)
    assert found.quantile(0.99)[2] == np.inf
    assert found.quantile(0.01)[1] == -np.inf
    assert found.probability(100.0)[:1] == (1.0,)


def test_unstable_members_are_infinite():
    k = real("k", 1, plus_minus=2)
    found = monte_carlo(tf([1], [1, 2, k]), count=40)
    assert np.isinf(found.values).any() and np.isfinite(found.values).any()
    assert np.isinf(found.bound)


@pytest.mark.cases(1)
@pytest.mark.parametrize("kinds", [("bode", "nyquist", "step", "poles"), "bode", ["poles", "step"]])
def test_bundles(kinds):
    figure = bundle_plot(loop(), kinds=kinds, samples=5)
    shown = [panel for panel in figure.axes if panel.get_visible()]
    assert len(shown) == (1 if isinstance(kinds, str) else len(kinds))
    assert all(panel.get_xlabel() and panel.get_ylabel() for panel in shown)


def test_bundles_of_sampled_and_of_unstable_systems():
    k = real("k", 10, percent=40)
    sampled = ss([[1, 0.05], [-0.005 * k, 0.7]], [[0], [0.05]], [[1, 0]], [[0]], 0.05)
    titles = [panel.get_title() for panel in bundle_plot(sampled, samples=3).axes]
    assert any("proven stable to" in title for title in titles)
    unstable = tf([1], [1, -1]) * real("g", 1, percent=10)
    titles = [panel.get_title() for panel in bundle_plot(unstable, samples=3).axes]
    assert "nominal unstable" in titles


LOOP = tf([1], [1, real("a", 1, percent=10)])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: monte_carlo("loop"), "system must be"),
        (lambda: monte_carlo(control.tf([1], [1, 1])), "no uncertain element"),
        (lambda: monte_carlo(LOOP, count=0), "count is 0"),
        (lambda: monte_carlo(LOOP, count=2.5), "count"),
        (lambda: monte_carlo(LOOP, count=10**199), "from 1 to 1000000"),
        (lambda: LOOP.sample(10**9), "count is 1000000000; it must be .* from 1 to 1000000"),
        (lambda: bundle_plot(LOOP, samples=10**9), "samples is 1000000000; .* from 1 to 1000000"),
        (lambda: monte_carlo(LOOP, seed="1"), "seed"),
        (lambda: monte_carlo(LOOP, confidence=1.0), "confidence is 1.0"),
        (lambda: monte_carlo(LOOP, confidence=None), "confidence is None"),
        (lambda: monte_carlo(LOOP, quantity="norm"), "quantity is 'norm'"),
        (lambda: monte_carlo(LOOP, quantity=lambda _: None, count=3), "of member 0 is None"),
        (lambda: monte_carlo(LOOP, quantity=lambda _: np.nan, count=3), "of member 0 is nan"),
        (lambda: monte_carlo(LOOP, count=3).quantile(1.5), "share is 1.5"),
        (lambda: monte_carlo(LOOP, count=3).quantile("0.5"), "share is '0.5'"),
        (lambda: monte_carlo(LOOP, count=3).probability("a"), "level is 'a'"),
        (lambda: bundle_plot("loop"), "system must be"),
        (lambda: bundle_plot(control.tf([1], [1, 1])), "no uncertain element"),
        (lambda: bundle_plot(LOOP, kinds="bodes"), "kinds are 'bodes'"),
        (lambda: bundle_plot(LOOP, kinds=[]), "kinds are"),
        (lambda: bundle_plot(LOOP, kinds=3), "kinds"),
        (lambda: bundle_plot(LOOP, samples=0), "samples is 0"),
    ],
)  # fmt: skip
def test_bad_input_of_members(call, words):
    with pytest.raises(InputError, match=words):
        call()

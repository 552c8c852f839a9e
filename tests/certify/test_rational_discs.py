"""The kernel that proves that no rational function passes through discs."""

from fractions import Fraction

import numpy as np
import pytest

from workbench.certify.proofs.rational_discs import none_within

OMEGA = np.geomspace(0.01, 100, 12)


def form_of(centers, sizes, ratio, weights, degrees):
    """The quadratic form in exact fractions, written entry by entry for powers of j omega."""
    count = sum(degrees) + 2
    form = [[Fraction(0)] * count for _ in range(count)]
    for omega, center, size, weight in zip(OMEGA, centers, sizes, weights, strict=True):
        c, w = (Fraction(center.real), Fraction(center.imag)), Fraction(float(weight))
        radius = Fraction(float(size)) * Fraction(ratio)
        power = [(Fraction(1), Fraction(0))]
        for _ in range(max(degrees)):  # times j omega
            real, imaginary = power[-1]
            power.append((-Fraction(omega) * imaginary, Fraction(omega) * real))
        top, bottom = power[: degrees[0] + 1], power[: degrees[1] + 1]
        beside = [(-c[0] * a + c[1] * b, -c[0] * b - c[1] * a) for a, b in bottom]
        row = top + beside
        below = [(Fraction(0),) * 2] * len(top) + bottom
        for i in range(count):
            for j in range(count):
                away = row[i][0] * row[j][0] + row[i][1] * row[j][1]
                near = below[i][0] * below[j][0] + below[i][1] * below[j][1]
                form[i][j] += w * (away - radius**2 * near)
    return form


def minors_positive(form):
    """Sylvester's criterion by fraction-free elimination."""
    form = [row[:] for row in form]
    for k in range(len(form)):
        if form[k][k] <= 0:
            return False
        for i in range(k + 1, len(form)):
            share = form[i][k] / form[k][k]
            form[i] = [a - share * b for a, b in zip(form[i], form[k], strict=True)]
    return True


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("degrees", [(0, 1), (1, 2), (2, 2)])
def test_it_agrees_with_exact_fractions(degrees, seed):
    rng = np.random.default_rng(seed)
    centers = rng.normal(size=12) + 1j * rng.normal(size=12)
    sizes, weights = rng.uniform(0.5, 2, 12), rng.uniform(0, 1, 12)
    verdicts = []
    for ratio in (0.02, 0.1, 0.3, 1.0, 3.0):
        exact = minors_positive(form_of(centers, sizes, ratio, weights, degrees))
        verdicts.append(exact)
        assert none_within(OMEGA, centers, sizes, ratio, weights, degrees) == exact
    assert not verdicts[-1]


@pytest.mark.parametrize("seed", range(20))
def test_no_weights_prove_against_a_planted_function(seed):
    """P / Q lies within the discs by construction, so no weights may prove that none does."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 5))
    s = 1j * OMEGA
    planted = np.polyval(rng.normal(size=order), s) / np.polyval(rng.uniform(0.1, 1, order + 1), s)
    turn = np.exp(2j * np.pi * rng.uniform(size=12))
    sizes = np.abs(planted) * rng.uniform(0.1, 1, 12)
    centers = planted + 0.999 * sizes * turn
    for _ in range(5):
        weights = rng.exponential(size=12) / sizes**2
        assert not none_within(OMEGA, centers, sizes, 1.0, weights, (order - 1, order))


@pytest.mark.parametrize(
    "change",
    [
        {"weights": -np.ones(12)},
        {"weights": np.full(12, np.nan)},
        {"weights": np.zeros(12)},
        {"ratio": np.inf},
        {"centers": np.full(12, np.nan + 0j)},
    ],
)
def test_bad_numbers_prove_nothing(change):
    data = {"centers": (-1.0) ** np.arange(12) + 0j, "sizes": np.ones(12), "ratio": 1e-3,
            "weights": np.ones(12)}  # fmt: skip
    assert none_within(OMEGA, **data, degrees=(0, 1))
    assert not none_within(OMEGA, **(data | change), degrees=(0, 1))

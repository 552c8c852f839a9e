"""Uncertain delays: the cover is proven for every delay, and samples are the delays themselves."""

from itertools import pairwise

import numpy as np
import pytest
from flint import arb, ctx, fmpq_poly
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.mu import robust_stability
from workbench.uncertainty import delay, feedback, tf
from workbench.uncertainty.algebra.delays import _polynomials


def squared(part):
    """|p(j x)|^2 in u = x^2, exactly."""
    exact = [fmpq_poly([int(c * 2**60)]) / 2**60 for c in part]
    even = sum(
        (
            exact[k] * (-1) ** (k // 2) * fmpq_poly([0, 1]) ** (k // 2)
            for k in range(0, len(exact), 2)
        ),
        fmpq_poly([0]),
    )
    odd = sum(
        (
            exact[k] * (-1) ** ((k - 1) // 2) * fmpq_poly([0, 1]) ** ((k - 1) // 2)
            for k in range(1, len(exact), 2)
        ),
        fmpq_poly([0]),
    )
    return even**2 + fmpq_poly([0, 1]) * odd**2


def test_the_cover_contains_every_delay():
    """|W|^2 >= 4 sin^2(x / 2) up to x = pi, and 4 beyond, proven in intervals."""
    above, below = map(squared, _polynomials())
    # Beyond: |W|^2 - 4 has the sign of a polynomial without a root there.
    rest = above - 4 * below
    roots = [complex(root) for root, _ in rest.complex_roots()]
    real = [root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0]
    assert all(root < np.pi**2 for root in real) and rest.coeffs()[-1] >= 0
    # Near 0: 4 sin^2(x / 2) <= u - u^2 / 12 + u^3 / 360.
    u = fmpq_poly([0, 1])
    series = above - below * (u - u**2 / 12 + u**3 / 360)
    roots = [complex(root) for root, _ in series.complex_roots()]
    assert not [r for r in roots if abs(r.imag) < 1e-9 and 1e-12 < r.real <= 1.0]
    assert series(1) > 0
    with ctx.workprec(128):
        edges = np.linspace(1.0, np.pi + 1e-9, 40_001)
        for low, high in pairwise(edges):
            x = arb((low + high) / 2, (high - low) / 2)
            assert value(above, x * x) > 4 * (x / 2).sin() ** 2 * value(below, x * x)


def value(p, x):
    found = arb(0)
    for c in reversed(p.coeffs()):
        found = found * x + arb(c)
    return found


@given(st.floats(0.0, 1.0), st.floats(1e-6, 10.0))
def test_a_sample_is_the_delay(share, high):
    tau = share * high
    member = delay("tau", 0.0, high).at(tau=tau)
    omega = np.array([0.01, 0.3, 1.0, 3.0, 6.0]) / high
    np.testing.assert_allclose(member(1j * omega), np.exp(-1j * omega * tau), atol=2e-3)


def test_a_loop_bears_less_than_its_delay_margin():
    """1 / s bears delays up to pi / 2; the disk that covers them has more than delays."""
    loop = feedback(tf([1], [1, 0]) * delay("tau", 0, 1.0), 1)
    margin = robust_stability(loop)
    assert 1.2 < margin.lower <= margin.upper < np.pi / 2
    assert loop.at(tau=1.55).poles().real.max() < 0 < loop.at(tau=1.6).poles().real.max()
    assert all(member.poles().real.max() < 0 for member in loop.sample(20))
    assert "tau" in repr(loop)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0, 0, "0 <= low <= high"),
        (-1, 1, "delays from -1 to 1"),
        (2, 1, "0 <= low <= high"),
        (0, np.inf, "0 <= low <= high"),
        ("0", 1, "low"),
        (0, None, "high"),
        (0, 5e-324, "5e-324 s, .*beyond doubles"),
        (1.0, 1e200, "another unit of time"),
    ],
)
def test_bad_delays(low, high, words):
    with pytest.raises(InputError, match=words):
        delay("tau", low, high)


@pytest.mark.parametrize("value", [-0.1, np.inf, "1", None])
def test_bad_values_of_a_delay(value):
    with pytest.raises(InputError, match="tau"):
        delay("tau", 0, 1).at(tau=value)

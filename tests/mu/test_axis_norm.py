"""The largest gain of systems that need not be stable, against 50 digits and SLICOT."""

import math
from dataclasses import replace

import control
import mpmath
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import h_infinity_norm, linf_norm
from workbench.realisations import minimal_realisation

LAG = control.tf([3.0], [1.0, 2.0])


def gain_in_digits(system):
    """The largest gain of a transfer function, at the roots of its derivative, in 50 digits."""
    with mpmath.workdps(50):
        num, den = (
            [mpmath.mpf(float(one)) for one in part[0][0]] for part in (system.num, system.den)
        )

        def square(coefficients):  # |p(j omega)|^2 in powers of x = omega^2, highest first
            up = coefficients[::-1]
            found = [mpmath.mpf(0)] * len(up)
            for i, a in enumerate(up):
                for k, b in enumerate(up):
                    if (i + k) % 2 == 0:
                        found[(i + k) // 2] += (-1) ** ((i - k) // 2) * a * b
            return found[::-1]

        def times(one, other):
            found = [mpmath.mpf(0)] * (len(one) + len(other) - 1)
            for i, a in enumerate(one):
                for k, b in enumerate(other):
                    found[i + k] += a * b
            return found

        def slope(p):
            return [a * (len(p) - 1 - i) for i, a in enumerate(p[:-1])] or [mpmath.mpf(0)]

        top, bottom = square(num), square(den)
        first, second = times(slope(top), bottom), times(top, slope(bottom))
        size = max(len(first), len(second))
        first, second = ([mpmath.mpf(0)] * (size - len(p)) + p for p in (first, second))
        turning = [a - b for a, b in zip(first, second, strict=True)]
        while turning and abs(turning[0]) < mpmath.mpf(10) ** -40:
            turning = turning[1:]
        roots = mpmath.polyroots(turning, maxsteps=500, extraprec=500) if len(turning) > 1 else []
        places = [mpmath.mpf(0), *(r.real for r in roots if abs(r.imag) < 1e-20 and r.real > 0)]
        values = [mpmath.polyval(top, x) / mpmath.polyval(bottom, x) for x in places]
        if len(num) == len(den):
            values.append((num[0] / den[0]) ** 2)
        return mpmath.sqrt(max(values))


@pytest.mark.parametrize("seed", range(20))
def test_unstable_systems_agree_with_50_digits(seed):
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 6))
    system = control.tf(rng.normal(size=order), [1.0, *rng.normal(size=order)])
    found, truth = linf_norm(system), gain_in_digits(system)
    assert found.lower <= truth <= found.upper <= found.lower * (1 + 1e-5)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("order", [1, 3, 8])
def test_many_channels_agree_with_slicot(order, dt):
    rng = np.random.default_rng(order)
    A, B, C, D = (
        rng.normal(size=shape) for shape in ((order, order), (order, 2), (3, order), (3, 2))
    )
    system = control.ss(A, B, C, D, dt)
    found, other = linf_norm(system), control.linfnorm(system, tol=1e-10)[0]
    assert found.lower * (1 - 1e-8) <= other <= found.upper * (1 + 1e-8)
    assert found.upper <= found.lower * (1 + 1e-4) and found.holds


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize("gain", [1e-150, 1e150])
def test_units_of_time_and_of_signals(unit, gain):
    found = linf_norm(control.tf([gain * unit], [1.0, -2.0 * unit]))
    assert found.lower <= 0.5 * gain * (1 + 1e-15) and 0.5 * gain <= found.upper * (1 + 1e-15)
    assert found.upper <= 0.500001 * gain and found.holds


@pytest.mark.parametrize(
    "system",
    [
        control.tf([1.0], [1.0, 0.0]),
        control.tf([1.0], [1.0, 0.0, 1.0]),
        control.tf([1.0], [1.0, -1.0], 0.1),
        control.tf([1.0], [1.0, -2.0 * math.cos(0.3), 1.0], 0.1),
        control.tf([1.0], [1.0, 0.0]) * control.tf([1.0], [1.0, -3.0]),
    ],
)
def test_a_pole_on_the_boundary_makes_it_infinite(system):
    found = linf_norm(system)
    assert found.lower == found.upper == math.inf and found.holds
    checker = found._checked_by[0]
    assert not replace(found, lower=1.0, upper=2.0).with_checker(checker).holds


def test_of_a_stable_system_it_is_the_h_infinity_norm():
    found, other = linf_norm(LAG), h_infinity_norm(LAG)
    assert (found.lower, found.upper) == (other.lower, other.upper)
    assert found.upper <= found.lower * (1 + 2e-6)
    assert linf_norm(np.array([[3.0, 4.0]])).upper == pytest.approx(5.0, rel=1e-5)


@pytest.mark.parametrize("name", ["lower", "upper"])
def test_a_claim_that_is_too_good_fails(name):
    found = linf_norm(control.tf([1.0, 3.0], [1.0, -2.0, 5.0]))
    better = replace(found, **{name: getattr(found, name) * (1.01 if name == "lower" else 0.99)})
    checker = found._checked_by[0]
    assert not better.with_checker(checker).holds
    assert not any(check.holds for check in checker.second_opinion(better))


def test_what_has_no_such_norm_is_named():
    hidden = control.ss([[1.0, 0.0], [0.0, -1.0]], [[1.0], [1.0]], [[0.0, 1.0]], 0)
    with pytest.raises(InputError, match=r"shows so little.*minimal_realisation"):
        linf_norm(hidden)
    common = control.tf([1.0, -1.0], [1.0, 1.0, -2.0])  # (s - 1) / (s - 1) / (s + 2)
    with pytest.raises(InputError, match="hidden states out first"):
        linf_norm(common)
    shown = linf_norm(minimal_realisation(common).system)
    assert shown.lower <= 0.5 * (1 + 1e-6) and 0.5 * (1 - 1e-6) <= shown.upper < 0.50001
    with pytest.raises(InputError, match=r"system has no realisation.*improper"):
        linf_norm(control.tf([1.0, 0.0, 0.0], [1.0, 1.0]))

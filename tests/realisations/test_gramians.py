"""Gramians and Hankel values of systems of other people, against 50 digits and exact fractions."""

import dataclasses
import math
from fractions import Fraction

import control
import numpy as np
import pytest
from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from workbench.errors import InputError
from workbench.realisations import gramians, hankel_values
from workbench.systems.conversion import as_system

RNG = np.random.default_rng(7)


def stable(n, m, p, dt=0.0):
    A = RNG.standard_normal((n, n))
    poles = np.linalg.eigvals(A)
    A = 0.95 * A / abs(poles).max() if dt else A - (poles.real.max() + 0.2) * np.eye(n)
    B, C = RNG.standard_normal((n, m)), RNG.standard_normal((p, n))
    return control.ss(A, B, C, RNG.standard_normal((p, m)) if dt else np.zeros((p, m)), dt)


SYSTEMS = {
    "lag": control.tf([3.0], [1.0, 2.0]),
    "PID with a filter": control.tf([2.0, 1.0], [0.1, 1.0]) + control.tf([1.0], [1.0, 1e-3]),
    "lightly damped": control.tf([1.0], [1.0, 1e-9, 1.0]) + control.tf([0.1], [1.0, 1e-4, 9.0]),
    "equal lags": control.tf([1.0], np.poly([-1.0] * 8)),
    "slow unit": control.tf([1e-6], [1.0, 3e-6, 2e-12]),
    "fast unit": control.tf([1e6], [1.0, 3e6, 2e12]),
    "slow and fast": control.tf([1.0], np.poly([-1e-6, -1.0, -1e6])),
    "two inputs": stable(5, 2, 3),
    "sampled": stable(4, 1, 2, 0.1),
    "sampled, slow": control.tf([1e-3], [1.0, -1.9999, 0.99990001], 1e-6),
    "hidden states": control.ss(np.diag([-1.0, -2.0, -3.0]), [[1], [0], [1]], [[1, 1, 0]], 0.0),
    "copies": control.append(control.tf([1.0], [1.0, 1.0]), control.tf([1.0], [1.0, 1.0])),
    "dead beat": control.tf([1.0], [1.0, 0.0, 0.0], 1.0),
    "static": control.tf([2.0], [1.0]),
    "nothing": control.ss(-np.eye(2), np.zeros((2, 1)), [[1.0, 2.0]], 0.0),
}


def rational(matrix):
    entries = [Fraction(float(x)) for x in np.asarray(matrix).ravel()]
    return fmpq_mat(*np.shape(matrix), [fmpq(x.numerator, x.denominator) for x in entries])


def exact_gramian(A, B, dt):
    """The Gramian in fractions, from linear equations in all of its entries."""
    n, a, b = len(A), rational(A), rational(B)
    right, unit = b * b.transpose(), np.eye(n)
    matrix = fmpq_mat(n * n, n * n)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                for m in range(n):
                    term = a[i, k] * a[j, m] if dt else a[i, k] * int(unit[j, m])
                    matrix[n * i + j, n * k + m] += term + (0 if dt else a[j, m] * int(unit[i, k]))
            matrix[n * i + j, n * i + j] -= 1 if dt else 0
    found = matrix.solve(fmpq_mat(n * n, 1, [-x for x in right.entries()])) if n else right
    return fmpq_mat(n, n, found.entries())


def both(system):
    one = as_system(system, "system")
    dt = float(one.dt or 0.0)
    return exact_gramian(one.A, one.B, dt), exact_gramian(one.A.T, one.C.T, dt)


def apart(number, near):
    one = Fraction(float(near))
    return abs(Fraction(int(number.p), int(number.q)) - one)


@pytest.mark.parametrize("name", SYSTEMS)
def test_gramians_lie_within_their_errors(name):
    found = gramians(SYSTEMS[name])
    for which, truth in zip(("controllability", "observability"), both(SYSTEMS[name]), strict=True):
        near, error = getattr(found, which), getattr(found, f"{which}_error")
        n = len(near)
        root = np.sqrt(np.diagonal(near))
        assert (error <= 4e-16 * np.outer(root, root) + 1e-300).all(), name
        for i in range(n):
            for j in range(n):
                assert apart(truth[i, j], near[i, j]) <= Fraction(float(error[i, j]))
    assert found.holds, found.certificate


@pytest.mark.parametrize("name", SYSTEMS)
def test_hankel_values_lie_within_their_bounds(name):
    """The eigenvalues of P Q, by the roots of its polynomial in many digits."""
    found = hankel_values(SYSTEMS[name])
    P, Q = both(SYSTEMS[name])
    polynomial = (P * Q).charpoly() if P.nrows() else None
    assert len(found.upper) == P.nrows()
    largest = found.upper.max(initial=0.0)
    assert (found.upper - found.lower <= 4e-9 * found.upper + 1e-15 * largest).all()
    with ctx.workprec(400):
        truth = []
        for factor, times in polynomial.factor()[1] if polynomial is not None else ():
            integral = factor.numer() if hasattr(factor, "numer") else factor
            truth += [float(root.real.sqrt()) for root, _ in integral.complex_roots()] * times
    for low, high, true in zip(found.lower, found.upper, sorted(truth)[::-1], strict=True):
        assert low * (1 - 1e-15) <= true <= high * (1 + 1e-15)
    assert found.holds, found.certificate


def test_a_change_of_states_or_of_the_unit_of_time_changes_no_value():
    system = stable(6, 2, 2)
    values = hankel_values(system)
    T = RNG.standard_normal((6, 6))
    for unit in (1e-6, 1e6):
        A, B = unit * T @ system.A @ np.linalg.inv(T), unit * T @ system.B
        other = hankel_values(control.ss(A, B, system.C @ np.linalg.inv(T), system.D))
        assert other.upper == pytest.approx(values.upper, rel=1e-8)


@pytest.mark.cases(0)
def test_lags_of_order_n_that_doubles_alone_cannot_do():
    """24 equal lags: python-control's least value has no digit right."""
    values = hankel_values(control.tf([1.0], np.poly([-1.0] * 20)))
    assert values.lower[0] <= 0.87773094 * (1 + 1e-8) and values.upper[0] >= 0.87773094 * (1 - 1e-8)
    assert (np.diff(values.upper) < 0).all() and values.upper[-1] < 1e-15 and values.holds


def test_the_error_of_a_truncation_is_bounded():
    system = stable(6, 2, 2)
    bounds = hankel_values(system).error_bounds
    assert bounds[-1] == 0.0 and bounds.shape == (7,)
    for order in (1, 3, 5):
        small = control.balred(system, order, method="truncate")
        assert control.linfnorm(system - small)[0] <= bounds[order] * (1 + 1e-9)


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (control.tf([1.0], [1.0, -2.0]), r"unstable: it has the pole 2\+0j rad/s; .*stable_part"),
        (control.tf([1.0], [1.0, 0.0]), r"on the imaginary axis.*stable_part\(system\)\.stable"),
        (control.tf([1.0], [1.0, -1.0], 0.1), r"z = 1\+0j on the unit circle"),
        (control.tf([1.0], [1.0, -2.0], 0.1), r"unstable: it has the pole z = 2"),
        (control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "improper"),
        (control.ss([], [], [], np.zeros((0, 0))), "0 inputs and 0 outputs"),
        ("plant", "must be a StateSpace"),
        (control.ss(-1.0, 1e200, 1.0, 0.0), "overflow doubles"),
    ],
)
def test_what_has_no_gramians_is_named(system, message):
    with pytest.raises(InputError, match=message):
        gramians(system)


def test_what_has_no_hankel_values_is_named():
    with pytest.raises(InputError, match="Hankel singular values belong to stable systems"):
        hankel_values(control.tf([1.0], [1.0, 0.0]))


def test_wrong_claims_fail():
    found = gramians(SYSTEMS["two inputs"])
    checker = found._checked_by[0]
    for name in ("controllability", "observability"):
        moved = dataclasses.replace(found, **{name: getattr(found, name) * (1 + 1e-14)})
        assert not moved.with_checker(checker).holds
        error = f"{name}_error"
        sharp = dataclasses.replace(found, **{error: getattr(found, error) * 1e-3})
        assert not sharp.with_checker(checker).holds
    values = hankel_values(SYSTEMS["two inputs"])
    checker = values._checked_by[0]
    for name, factor in (("lower", 1 + 1e-7), ("upper", 1 - 1e-7)):
        better = dataclasses.replace(values, **{name: getattr(values, name) * factor})
        assert not better.with_checker(checker).holds
    assert math.isfinite(values.upper[0])


def test_balls_hold_the_numbers_of_the_residual():
    """The proof knows only the residual: spoilt corrections widen it and move nothing outside."""
    from workbench.certify.realisations import lyapunov

    system = as_system(SYSTEMS["equal lags"], "system")
    found = lyapunov.enclosed_gramian(system.A, system.B, 0.0, 64)
    truth = exact_gramian(system.A, system.B, 0.0)
    with ctx.workprec(300):
        for k in range(8):
            assert abs(found.middle[k, k] - arb(truth[k, k])) <= found.lacks(k, k)
    assert isinstance(found.middle, arb_mat)

"""What multipliers are said to prove below a level holds in exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

from workbench.certify.mu_bound import structured
from workbench.mu import Complex, Full, Real, Structure, upper_bound
from workbench.mu.upper.below import bounds_below, hold_below

STRUCTURES = {
    "complex scalars": Structure([Complex(1)] * 3),
    "real scalars": Structure([Real(1)] * 3),
    "full": Structure([Full(2, 2), Full(1, 1)]),
    "not square": Structure([Full(1, 3), Real(1)]),
    "repeated real": Structure([Real(2), Full(1, 1)]),
    "repeated complex": Structure([Complex(2), Full(2, 1)]),
}
KINDS = ("random", "graded", "of rank one", "nearly singular", "a column of zeros", "tiny")


def exactly(matrix):
    """Real and imaginary parts as fractions."""
    return [[(Fraction(z.real), Fraction(z.imag)) for z in row] for row in matrix.tolist()]


def product(A, B):
    rows = []
    for row in A:
        sums = []
        for column in zip(*B, strict=True):
            pairs = list(zip(row, column, strict=True))
            real = sum((a[0] * b[0] - a[1] * b[1] for a, b in pairs), Fraction(0))
            sums.append((real, sum((a[0] * b[1] + a[1] * b[0] for a, b in pairs), Fraction(0))))
        rows.append(sums)
    return rows


def slack(M, D_left, D_right, G, beta):
    """beta^2 D_r - M^H D_l M - j (G M - M^H G^H), exact, as a real symmetric matrix of 2 r rows."""
    adjoint = exactly(M.conj().T)
    middle = product(product(adjoint, exactly(D_left)), exactly(M))
    twisted, right = product(exactly(G), exactly(M)), exactly(D_right)
    square, r = Fraction(beta) ** 2, len(right)
    S = [[Fraction(0)] * (2 * r) for _ in range(2 * r)]
    for i in range(r):
        for j in range(r):
            # -j (T - T^H) has the entries -j (T_ij - conj(T_ji))
            real = twisted[i][j][0] - twisted[j][i][0], twisted[i][j][1] + twisted[j][i][1]
            x = square * right[i][j][0] - middle[i][j][0] + real[1]
            y = square * right[i][j][1] - middle[i][j][1] - real[0]
            S[i][j] = S[r + i][r + j] = x
            S[r + i][j], S[i][r + j] = y, -y
    return S


def positive(S):
    """Whether a symmetric matrix of fractions is positive definite, by exact elimination."""
    S = [list(row) for row in S]
    for k in range(len(S)):
        if S[k][k] <= 0:
            return False
        for i in range(k + 1, len(S)):
            share = S[i][k] / S[k][k]
            for j in range(k, len(S)):
                S[i][j] -= share * S[k][j]
    return True


def drawn(structure, kind, count):
    """Matrices (count, c, r) that are alike."""
    rng = np.random.default_rng([count, *kind.encode()])
    c, r = structure.columns, structure.rows
    one, other = rng.normal(size=(2, c, r)) + 1j * rng.normal(size=(2, c, r))
    if kind == "of rank one":
        one, other = one[:, :1] @ one[:1], 1e-3 * one[:, :1] @ one[:1]
    if kind == "nearly singular":
        one, other = one[:, :1] @ one[:1] + 1e-8 * other, 1e-8 * one
    M = one + 1e-2 * np.linspace(0, 1, count)[:, None, None] * other
    if kind == "graded":
        M = M * 10.0 ** rng.uniform(-6, 6, (c, 1)) * 10.0 ** rng.uniform(-6, 6, (1, r))
    if kind == "a column of zeros":
        M[:, :, 0] = 0.0
    return 1e-120 * M if kind == "tiny" else M


def proven_exactly(M, structure, bound, source, beta):
    """Whether multipliers of another matrix prove a bound beta of M (c, r)."""
    parts = (part[source] for part in (bound.D_left, bound.D_right, bound.G))
    D_left, D_right, G = structured(structure, *parts)
    return positive(slack(M, D_left, D_right, G, beta))


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_least_level_that_is_said_to_hold_does(name, kind):
    """Levels are halved down to neighbouring numbers, where rounding decides."""
    structure = STRUCTURES[name]
    M = drawn(structure, kind, 6)
    bound = upper_bound(M, structure)
    for k, source in enumerate([1, 2, 3, 4, 5, 0]):
        one, by = M[k : k + 1], np.array([source])

        def said(level, one=one, by=by):
            return hold_below(one, structure, level, bound.D_right, bound.G, by)[0]

        low, high = 0.0, 4.0 * float(np.linalg.norm(M[k]))
        while not said(high):
            high *= 16.0
            if high > 1e6 * np.linalg.norm(M[k]):
                break
        else:
            while (middle := 0.5 * (low + high)) not in (low, high) and high > 1e-150:
                low, high = (low, middle) if said(middle) else (middle, high)
            assert proven_exactly(M[k], structure, bound, source, high)


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("kind", KINDS)
def test_bounds_below_a_level_hold(name, kind):
    structure = STRUCTURES[name]
    M = drawn(structure, kind, 24)
    value = upper_bound(M, structure).value
    for level in (1.001 * value.max(), 2.0 * value.max()):
        if level > 0:
            found = bounds_below(M, structure, level)
            for k in range(0, len(M), 3):
                beta = found.value[k] or np.finfo(float).tiny
                assert proven_exactly(M[k], structure, found, k, beta)

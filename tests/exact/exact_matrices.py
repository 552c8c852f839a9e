"""Matrices of known mu: of rank one, diagonal, nilpotent, in any unit."""

import math

import numpy as np
from exact_cases import Case, Claim, ball, dyadic, larger, power, precise, root, smaller
from flint import arb

from workbench.mu import lower_bound, upper_bound
from workbench.structure import Complex, Full, Real, Structure


def rank_one(rng):
    """u v' with complex blocks: the sum of what they see."""
    u, v = (rng.integers(-6, 7, 5).astype(float) for _ in "uv")
    blocks, places = [
        ([Complex(1)] * 5, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)]),
        ([Complex(3), Full(2, 2)], [(0, 3), (3, 5)]),
        ([Full(2, 2), Full(3, 3)], [(0, 2), (2, 5)]),
        ([Complex(2), Complex(2), Complex(1)], [(0, 2), (2, 4), (4, 5)]),
    ][int(rng.integers(4))]
    truth = arb(0)
    for block, (i, j) in zip(blocks, places, strict=True):
        if isinstance(block, Complex):
            truth += abs(ball(float(v[i:j] @ u[i:j])))
        else:
            truth += root(float(u[i:j] @ u[i:j])) * root(float(v[i:j] @ v[i:j]))
    return np.outer(u, v), blocks, truth


def real_rank_one(rng):
    """u v' of real numbers with real and complex blocks, a repeated one among them: their sum."""
    u, v = (rng.integers(-6, 7, 4).astype(float) for _ in "uv")
    blocks = [Real(2), Real(1), Complex(1)] if rng.integers(2) else [Real(2), Real(2)]
    places = [(0, 2), (2, 3), (3, 4)] if len(blocks) == 3 else [(0, 2), (2, 4)]
    truth = sum((abs(ball(float(v[i:j] @ u[i:j]))) for i, j in places), arb(0))
    return np.outer(u, v), blocks, truth


def one_real_one_complex(rng):
    """u v' with w = v1 u1 complex of a real block and g = |v2 u2|: 1 within g t of [-w t, w t]."""
    x, y, g = (float(rng.integers(-8, 9)) for _ in "xyg")
    x, g = x or 1.0, abs(g) or 1.0
    x_, y_, g_ = ball(abs(x)), ball(y), ball(g)
    square = x_**2 + y_**2
    # Beside the segment 1 is |y| / |w| away; its foot lies within it where |x| / |w|^2 < t.
    beside = abs(y_) / (root(square) * g_)
    found = []
    if y and beside * square > x_:
        found.append(beside)
    # At its end: (1 - x t)^2 + y^2 t^2 = g^2 t^2.
    a, b = square - g_**2, -2 * x_
    if a == 0:
        found.append(-1 / b)
    elif b * b - 4 * a >= 0:
        spread = root(b * b - 4 * a)
        found += [t for t in ((-b + spread) / (2 * a), (-b - spread) / (2 * a)) if t > 0]
    M = np.outer([1.0, 1.0], [complex(x, y), g])
    return M, [Real(1), Complex(1)], 1 / smaller(*found)


def diagonal(rng):
    """diag of complex numbers: the largest that its block sees; a real one sees real ones only."""
    blocks, entries, seen = [], [], [arb(0)]
    for _ in range(int(rng.integers(1, 5))):
        x, y = float(rng.integers(-9, 10)), float(rng.choice([0.0, 1.0, -3.0]))
        block = (Real, Complex)[int(rng.integers(2))](int(rng.integers(1, 3)))
        blocks.append(block)
        entries += [complex(x, y)] * block.rows
        size = root(x * x + y * y)
        seen.append(size if isinstance(block, Complex) or y == 0 else arb(0))
    return np.diag(entries), blocks, larger(*seen)


def nilpotent(rng):
    """A strictly triangular matrix, each block a scalar of its own or one for all: 0."""
    M = np.triu(rng.integers(-9, 10, (4, 4)).astype(float), 1)
    kinds = [[Complex(4)], [Real(4)], [Complex(1)] * 4, [Real(1), Complex(2), Real(1)]]
    return M, kinds[int(rng.integers(4))], arb(0)


def defective(rng):
    """A Jordan block and one repeated scalar: its eigenvalue, whatever the norm."""
    n, x = int(rng.integers(2, 5)), dyadic(rng)
    kind = (Real, Complex)[int(rng.integers(2))]
    return x * np.eye(n) + np.eye(n, k=1), [kind(n)], ball(x)


def rotation(rng):
    """A turn by a right angle times x: a real repeated scalar sees nothing, a complex one x."""
    x = dyadic(rng)
    real = bool(rng.integers(2))
    M = x * np.array([[0.0, -1.0], [1.0, 0.0]])
    return M, [Real(2) if real else Complex(2)], arb(0) if real else ball(x)


def one_full(rng):
    """H diag(d) H of a full block: twice the larger entry."""
    d = [float(x) for x in rng.integers(0, 50, 2)]
    H = np.array([[1.0, 1.0], [1.0, -1.0]])
    return H @ np.diag(d) @ H, [Full(2, 2)], 2 * ball(max(d))


KINDS = {
    "rank one": rank_one,
    "rank one, real": real_rank_one,
    "rank one, mixed": one_real_one_complex,
    "diagonal": diagonal,
    "nilpotent": nilpotent,
    "defective": defective,
    "rotation": rotation,
    "full": one_full,
}


@precise
def matrix_case(rng):
    """An upper or a lower bound of mu, in any unit and with inputs scaled by powers of two."""
    name = str(rng.choice(list(KINDS)))
    M, blocks, truth = KINDS[name](rng)
    structure = Structure(blocks)
    unit = power(rng) if rng.integers(3) == 0 else 1.0
    M, truth = M * unit, truth * ball(unit)
    steps = [int(rng.integers(-20, 21)) for _ in blocks]
    scales = np.repeat(np.ldexp(1.0, steps), [block.rows for block in blocks])
    M = M * scales / scales[:, None]
    function = str(rng.choice(["upper_bound", "lower_bound"]))

    def ask():
        if function == "upper_bound":
            found = upper_bound(M, structure)
            return found, [Claim("mu", 0.0, float(found.value), truth)]
        found = lower_bound(M, structure)
        return found, [Claim("mu", float(found.value), math.inf, truth)]

    return Case(f"{name}{', units' * (unit != 1.0)}", function, ask)

"""A system as a sum of parts with poles inside, on and beyond the boundary of stability, proven.

Poles on the boundary are roots of the common divisor of the characteristic polynomial p(s) and
p(-s), or p(z) and z^n p(1 / z), in fractions. The projector on their states is exact: with p = q r,
where q has the roots on the boundary, and u q + v r = 1, it is (v r)(A). So the part on the
boundary is known exactly, by its Markov parameters, and so is the rest, whose poles lie off the
boundary. With (s - A~)^-1 = F~ and (s - A)^-1 = F, the difference between the exact rest C~ F~ B~
and a stored C F B is

    dC F~ B~ + C F dA F~ B~ + C F dB,    |F~ B~| <= (|F B| + |F| |dB|) / (1 - |F| |dA|).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx, fmpq, fmpq_mat, fmpq_poly

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.balls import above
from workbench.certify.modes.modal_form import real_balls
from workbench.certify.norms import certified_norm
from workbench.certify.proofs.numerator import stable_numerator
from workbench.certify.realisations.lyapunov import frobenius, rounded
from workbench.certify.rounding import BALL_BITS, nearest_power_of_two
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.systems.balancing import FAR, speed
from workbench.systems.realisation import Matrices, in_parallel, matrices_of, realisation


def in_fractions(matrix: RealArray) -> fmpq_mat:
    """The matrix of doubles, exactly."""
    pairs = [float(entry).as_integer_ratio() for entry in np.asarray(matrix).ravel()]
    rows, columns = np.shape(matrix)
    return fmpq_mat(rows, columns, [fmpq(*pair) for pair in pairs])


def nearest_doubles(matrix: fmpq_mat) -> RealArray:
    """The fractions, rounded."""
    entries = [float(arb(entry).mid()) for entry in matrix.entries()]
    return np.array(entries).reshape(matrix.nrows(), matrix.ncols())


def boundary_projector(A: RealArray, sampled: bool) -> fmpq_mat | None:
    """The projector on the states of poles exactly on the boundary; None if there are none."""
    n, a = len(A), in_fractions(A)
    if not n:
        return None
    p = fmpq_poly(a.charpoly())
    common = _boundary_factor(p.gcd(_mirrored_polynomial(p, sampled)), sampled)
    if common.degree() < 1:
        return None
    rest = p
    while True:
        shared = rest.gcd(common)
        if shared.degree() < 1:
            break
        rest = rest // shared
    own = p // rest
    if rest.degree() < 1:
        return in_fractions(np.eye(n))
    _, _, v = own.xgcd(rest)
    polynomial = (v * rest) % p
    found, one = fmpq_mat(n, n), in_fractions(np.eye(n))
    for c in reversed(polynomial.coeffs()):
        found = found * a + one * c
    return found


def _mirrored_polynomial(p: fmpq_poly, sampled: bool) -> fmpq_poly:
    """p(-s), or z^n p(1 / z)."""
    coefficients = p.coeffs()
    if sampled:
        return fmpq_poly(coefficients[::-1])
    return fmpq_poly([c * (-1) ** k for k, c in enumerate(coefficients)])


def _boundary_factor(common: fmpq_poly, sampled: bool) -> fmpq_poly:
    """The product of those factors of a polynomial whose roots are all on the boundary.

    Roots come with their mirror images about the boundary, such as 1 and -1. Either one factor has
    both, as s^2 - 2 does, or there are two factors. So a root whose ball meets the boundary lies on
    it, if no other root of its factor is in the ball.
    """
    found = fmpq_poly([1])
    for factor, _ in common.factor()[1] if common.degree() > 0 else ():
        mirrored = _mirrored_polynomial(factor, sampled)
        if mirrored * factor[factor.degree()] != factor * mirrored[mirrored.degree()]:
            continue
        with ctx.workprec(BALL_BITS):
            found_roots: Any = factor.numer().complex_roots()
            roots = [root for root, _ in found_roots]
            away = [abs(root) - 1 if sampled else root.real for root in roots]
        if all(each.contains(0) for each in away):
            found *= factor
    return found


def split_in_balls(
    parts: Sequence[RealArray], coordinates: RealArray, k: int, projector: fmpq_mat | None
) -> tuple[list[Any], list[Any]] | None:
    """A, B and C of the exact part on the boundary, with k states, and of the exact rest, in balls.

    The coordinates are near the given ones; the projector makes them exact. None if these are not
    regular.
    """
    n = len(coordinates)
    first, last = (real_balls(part) for part in (coordinates[:, :k], coordinates[:, k:]))
    if projector is not None:
        exact = arb_mat(projector)
        first, last = exact * first, last - exact * last
    whole = arb_mat(n, n)
    for i in range(n):
        for j in range(n):
            whole[i, j] = first[i, j] if j < k else last[i, j - k]
    try:
        back = whole.inv().entries()
    except ZeroDivisionError:
        return None
    A, B, C = (real_balls(part) for part in parts)
    upper, lower = arb_mat(k, n, back[: k * n]), arb_mat(n - k, n, back[k * n :])
    own = [upper * A * first, upper * B, C * first]
    return own, [lower * A * last, lower * B, C * last]


def unit_of_time(A: RealArray, B: RealArray, C: RealArray) -> float:
    """A power of two near the median size of the nonzero poles, or the `speed` of integrators.

    In units of the fastest of very different poles, integrators and slow poles would be lost in
    rounding.
    """
    sizes = np.abs(np.linalg.eigvals(A))
    used = sizes[sizes > 1e-8 * sizes.max(initial=0.0)]
    return float(nearest_power_of_two(float(np.median(used)))) if used.size else speed(A, B, C)


def sum_errors(
    system: StateSpace, boundary: Matrices, rest: Matrices, coordinates: RealArray
) -> tuple[float, float]:
    """Bounds of the error of the sum of a part on the boundary and the rest, compared with a
    system.

    The first bound is the largest gain, on the boundary, of the difference to the exact rest. The
    second one is the relative error of the first 2 k Markov parameters of the k states on the
    boundary. Both are infinite if nothing is proven.

    Parameters
    ----------
    boundary, rest
        A, B, C and D of the parts.
    coordinates
        (n, n): the states of the system are this times those of the parts, nearly.
    """
    A, B, C, D = matrices_of(system)
    k = len(boundary[0])
    if not np.array_equal(D, boundary[3] + rest[3]):
        return math.inf, math.inf
    if not system.dt:  # gains are the same in another unit of time, a power of two
        rate = unit_of_time(A, B, C)
        A, B = A / rate, B / rate
        boundary, rest = ((a / rate, b / rate, c, d) for a, b, c, d in (boundary, rest))
    projector = boundary_projector(A, bool(system.dt)) if k else None
    if k and (projector is None or states_of(projector) != k):
        return math.inf, math.inf
    relative = markov_error((A, B, C, D), boundary, projector) if projector is not None else 0.0
    with ctx.workprec(BALL_BITS):
        found = split_in_balls((A, B, C), coordinates, k, projector)
        if found is None:
            return math.inf, relative
        differences = [
            above(frobenius(part - real_balls(stored)))
            for part, stored in zip(found[1], rest[:3], strict=True)
        ]
    return _gain_error(rest, differences, float(system.dt or 0.0)), relative


def boundary_part_error(system: StateSpace, boundary: Matrices) -> float:
    """The largest relative error of a Markov parameter of a stored part on the boundary."""
    A, B, C, D = matrices_of(system)
    projector = boundary_projector(A, bool(system.dt))
    if projector is None:
        return math.inf if len(boundary[0]) else 0.0
    return markov_error((A, B, C, D), boundary, projector)


def gain_apart(one: Matrices, other: Matrices, dt: float, antistable: bool) -> float:
    """A bound of the largest gain of the difference of two stable parts, or of two antistable ones.

    Infinite if no bound is proven.
    """
    if all(np.array_equal(part, its) for part, its in zip(one, other, strict=True)):
        return 0.0
    slack = 0.0
    if antistable:
        (one, more), (other, still) = (_stable_mirror(part, dt) for part in (one, other))
        slack = more + still
    rounding = float(np.linalg.norm(one[3])) * EPS if (one[3] != other[3]).any() else 0.0
    try:
        apart = certified_norm(realisation(difference_of(one, other), dt))
    except InputError:
        return math.inf
    return (apart + 2.0 * rounding + slack) * (1.0 + 4.0 * EPS)


def _stable_mirror(part: Matrices, dt: float) -> tuple[Matrices, float]:
    """G(-s), or G(1 / z), for an antistable part, rounded, and a bound of its error.

    G(1 / z) is D - C M B - C M (z - M)^-1 M B with M = A^-1.
    """
    A, B, C, D = part
    if not dt or not len(A):
        return (-A, -B, C, D), 0.0
    with ctx.workprec(BALL_BITS):
        a, b, c, d = (real_balls(matrix) for matrix in part)
        try:
            back = a.inv()
        except ZeroDivisionError:
            return part, math.inf
        exact = back, back * b, -c * back, d - c * back * b
        near = tuple(rounded(matrix) for matrix in exact)
        errors = [
            above(frobenius(true - real_balls(stored)))
            for true, stored in zip(exact, near, strict=True)
        ]
    mirror = near[0], near[1], near[2], near[3]
    return mirror, _gain_error(mirror, errors[:3], dt) + errors[3]


def difference_of(one: Matrices, other: Matrices) -> Matrices:
    """The difference of two systems, with their states side by side."""
    A, B, C, D = _in_moderate_units(other)
    return in_parallel(_in_moderate_units(one), (A, B, -C, -D))


def _in_moderate_units(K: Matrices) -> Matrices:
    """A realisation with its states in another unit, a power of two, where B and C are of very
    different size.

    Two systems whose states differ by 1e200 in size hardly depend on each other in a difference,
    and its balancing would take very many steps to find that out.
    """
    A, B, C, D = K
    into, out = (int(np.frexp(np.abs(part).max(initial=0.0))[1]) for part in (B, C))
    if not B.any() or not C.any() or abs(out - into) < np.log2(FAR):
        return K
    unit = (out - into) // 2
    scaled = np.ldexp(B, unit), np.ldexp(C, -unit)
    back = np.ldexp(scaled[0], -unit), np.ldexp(scaled[1], unit)
    return (A, *scaled, D) if all(map(np.array_equal, back, (B, C))) else K


def states_of(matrix: fmpq_mat) -> int:
    """The number of states of a part: the trace of its projector."""
    return int(sum((matrix[i, i] for i in range(matrix.nrows())), fmpq(0)).p)


def markov_error(given: Matrices, stored: Matrices, projector: fmpq_mat) -> float:
    """The largest relative error of a Markov parameter of the part on the boundary."""
    A, B, C = (in_fractions(part) for part in given[:3])
    own = [in_fractions(part) for part in stored[:3]]
    sizes = [in_fractions(np.abs(part)) for part in stored[:3]]
    state, stored_state, size = projector * B, own[1], sizes[1]
    worst = arb(0)
    for _ in range(2 * states_of(projector)):
        triples = zip(
            (C * state).entries(),
            (own[2] * stored_state).entries(),
            (sizes[2] * size).entries(),
            strict=True,
        )
        for true, near, scale in triples:
            if true != near:
                worst = worst.max(abs(arb(true - near)) / arb(scale) if scale != 0 else arb("inf"))
        state, stored_state, size = A * state, own[0] * stored_state, sizes[0] * size
    return above(worst)


def _gain_error(rest: Matrices, differences: Sequence[float], dt: float) -> float:
    """The bound of the gain from bounds of the differences of A, B and C."""
    A, B, C, _ = rest
    n = len(A)
    if not n or not any(differences):
        return 0.0
    dA, dB, dC = (arb(size) for size in differences)
    unit = np.eye(n)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # for poles within rounding of the axis
            outer, inner, middle = (
                arb(boundary_gain(realisation((matrix, gains, unit, np.zeros(gains.shape)), dt)))
                for matrix, gains in ((A.T, C.T), (A, B), (A, unit))
            )
    except (InputError, RuntimeWarning):
        return math.inf
    left = 1 - middle * dA
    if not left > 0:
        return math.inf
    entering = (inner + middle * dB) / left
    return above(dC * entering + outer * dA * entering + outer * dB)


def boundary_gain(system: StateSpace) -> float:
    """An upper bound of the largest gain on the boundary of stability, for any system.

    Raises InputError as `stable_numerator` does.
    """
    if not system.nstates or stability_check(system).holds:
        return certified_norm(system)
    numerator = stable_numerator(system)
    return numerator.enclosed(0.0, certified_norm(numerator.system))[1]

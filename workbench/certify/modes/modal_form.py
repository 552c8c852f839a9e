"""Modal coordinates of a realisation, enclosed by ball arithmetic of many digits.

A similarity changes no response, so a realisation whose states are nearly dependent may be replaced
by a better one, if the change of coordinates is enclosed. Here T holds approximate eigenvectors of
A, real and imaginary parts of a pair side by side, and T^-1 A T, T^-1 B and C T are computed in
balls (Johansson, Arb: efficient arbitrary-precision midpoint-radius interval arithmetic, IEEE
Trans. Computers 66 (2017) 1281-1292), then rounded outward to doubles.

Eigenvectors in doubles suffice where they are far from dependent: T^-1 A T is exact for any T, and
with the block diagonal Lambda of the modes it is Lambda + T^-1 (A T - T Lambda), whose second term
is small. Only A T - T Lambda is then computed to high precision, and likewise the error of T^-1 B.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, Array, RealArray
from workbench.certify.modes.eigenpairs import CLUSTER, eigenpairs
from workbench.certify.modes.modal_response import real_eigenvectors
from workbench.certify.rounding import (
    TINY,
    UPWARD,
    Enclosure,
    exact,
    nearest_power_of_two,
    sharp_product,
    solution,
    stacked_enclosures,
)

PRECISIONS = (128, 256, 512)
"""Bits of the balls, tried in turn until a proof succeeds. Each doubling squares what may cancel.
With half of them more plants of clustered poles are left without a proof; with double of them all
take longer. None of the nearest tests feels either.
"""

FEWEST_QUICK = 30
"""Least number of states for which modes are taken from doubles; for fewer states balls take no
time. Half or double changes the time, and the last bits of modes.
"""
LARGEST_CONDITION = 1e7
"""Largest condition number of eigenvectors that are used in doubles: the modes are then known to
about 1e-9, and a bound 0.1 % above a peak can still be proven. At 1e9 it could not. With half of it
more plants take balls, which are slower; with double of it bounds of some lightly damped plants
take more intervals.
"""

LOST_IN_DOUBLES = 8
"""Largest error of modal coordinates by an inverse in doubles, in units of the last bit of the
largest entry of a row; in balls it is 1. With half of it more rows are computed again in balls,
which is slower; with double of it coordinates may lose another bit. None of the nearest tests
feels either.
"""
REFINEMENTS = 4
"""Largest number of corrections of modal coordinates in doubles. Each gains nine digits at least,
by `LARGEST_CONDITION`, so half still suffices; more are not made once rows are sharp.
"""
LARGEST_SCALE = 2.0**200
"""Largest scaling factor of a state. Squares of scaled entries are then far inside the range of
doubles. Half or double changes nothing for modes that are seen.
"""
LARGEST_ENTRY = 1e150
"""Largest entry of modal coordinates, so that its square is a double. Those of long chains may
overflow. The square is 1e300, with room for sums of 1e8 terms. Half or double moves that room by a
factor of four.
"""

Enclosures = tuple[Enclosure, Enclosure, Enclosure]
"""A, B and C of a realisation."""


def real_balls(matrix: RealArray) -> Any:
    """The matrix of real numbers as balls of radius 0."""
    import flint

    return flint.arb_mat(matrix.shape[0], matrix.shape[1], matrix.ravel().tolist())


def modal_form_of(realised: Sequence[Any], bits: int) -> Enclosures | None:
    """Enclosures of A, B and C in modal coordinates; None if `bits` do not separate the modes.

    A, B and C are given in balls of at least as many bits. The midpoint of A is diagonal up to
    blocks of two real numbers for a pair of complex poles.
    """
    import flint

    A, B, C = realised
    with flint.ctx.workprec(bits):
        found = _modes(A, bits)
        if found is None:
            return None
        T, mode = found
        inner = _in_doubles(T, A, B, mode) or _in_balls(T, A, B)
        if inner is None:
            return None
        enclosures = [*inner, real_doubles(C * T)]
    if not _moderate(enclosures):
        return None
    A, B, C = enclosures
    # The entries of T^-1 A T between modes are moved from the midpoint to the radius.
    between = mode[:, None] != mode
    A = Enclosure(np.where(between, 0.0, A.mid), A.rad + np.where(between, np.abs(A.mid), 0.0))
    return _normalised(A, B, C, mode)


def form_in_basis(realised: Sequence[Any], basis: RealArray, bits: int) -> Enclosures | None:
    """Enclosures of A, B and C with the columns of a basis (n, n) as states; None: the basis is
    singular.

    A, B and C are given in balls of at least as many bits, or as arrays.
    """
    import flint

    if len(basis) >= FEWEST_QUICK:
        parts = [_in_two_parts(part) for part in realised]
        try:
            near: RealArray = np.asarray(np.linalg.solve(basis, parts[0][0] @ basis), dtype=float)
        except np.linalg.LinAlgError:
            return None
        quick = _quick_coordinates(parts, basis, near)
        if quick and _moderate(quick):
            return quick
    A, B, C = (real_balls(part) if isinstance(part, np.ndarray) else part for part in realised)
    T = real_balls(basis)
    with flint.ctx.workprec(bits):
        inner = _in_balls(T, A, B)
        found = inner and (*inner, real_doubles(C * T))
    return found if found and _moderate(found) else None


def quick_modal_form_of(realised: Sequence[Any], bits: int) -> Enclosures | None:
    """As `modal_form_of`, with eigenvectors in doubles and small entries between the modes.

    Matrices may also be given as arrays. `bits` is not needed: products of doubles are accurate
    enough. None for few states, for entries that are not finite, and if the eigenvectors are nearly
    dependent.
    """
    if len(_first_parts(realised[0])) < FEWEST_QUICK:
        return None
    parts = [_in_two_parts(part) for part in realised]
    near = parts[0][0]
    n = len(near)
    if not np.isfinite(near).all():
        return None
    values, vectors = real_eigenvectors(near)
    vectors = vectors / np.take_along_axis(vectors, np.abs(vectors).argmax(axis=0)[None], axis=0)
    T, modes, mode = np.empty((n, n)), np.zeros((n, n)), np.empty(n, int)
    place = 0
    for k in np.flatnonzero(values.imag >= 0):
        pole, pair = values[k], values[k].imag > 0
        at = slice(place, place + 1 + pair)
        T[:, at] = np.stack([vectors[:, k].real, vectors[:, k].imag][: 1 + pair], axis=1)
        turn = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
        modes[at, at], mode[at], place = turn[: 1 + pair, : 1 + pair], k, at.stop
    if not np.linalg.cond(T / np.linalg.norm(T, axis=0), 1) <= LARGEST_CONDITION:
        return None
    found = _quick_coordinates(parts, T, modes)
    return _normalised(*found, mode) if found and _moderate(found) else None


def _quick_coordinates(
    parts: Sequence[tuple[RealArray, RealArray, RealArray]], T: RealArray, inner: RealArray
) -> Enclosures | None:
    """T^-1 A T (which is near `inner`, (n, n)), T^-1 B and C T; None if T may be singular.

    Only the small errors of `inner`, and of T^-1 B in doubles, are computed to high precision. A, B
    and C are given as `_in_two_parts` gives them.
    """
    (near, *A_rest), (enter, *B_rest), (out, *C_rest) = parts
    n = len(near)
    one: RealArray = np.eye(n)
    into: RealArray = np.asarray(np.linalg.solve(T, enter), dtype=float)
    rest = [
        _sum_of_products([(near, T), (A_rest[0], T), (T, -inner)], A_rest[1] @ np.abs(T)),
        _sum_of_products([(one, enter), (one, B_rest[0]), (T, -into)], B_rest[1]),
    ]
    small = solution(exact(T), stacked_enclosures([rest]))
    leaving = _sum_of_products([(out, T), (C_rest[0], T)], C_rest[1] @ np.abs(T))
    if small is None:
        return None
    found = exact(np.hstack([inner, into])) + small
    return found[:, :n], found[:, n:], leaving


def _first_parts(matrix: Any) -> Any:
    """A matrix of floating-point numbers, or the first part of one of balls."""
    return matrix if isinstance(matrix, np.ndarray) else range(matrix.nrows())


def _in_two_parts(matrix: Any) -> tuple[RealArray, RealArray, RealArray]:
    """Two floating-point numbers for each entry, whose sum is the entry up to a radius."""
    if isinstance(matrix, np.ndarray):
        return matrix, np.zeros_like(matrix), np.zeros_like(matrix)
    first = real_doubles(matrix).mid
    if not np.isfinite(first).all():
        return first, first, first
    second = real_doubles(matrix - real_balls(first))
    return first, second.mid, second.rad


def _sum_of_products(pairs: Sequence[tuple[RealArray, RealArray]], radius: RealArray) -> Enclosure:
    """Enclosure of a sum of products, whose terms may cancel, with a radius added."""
    pairs = [pair for pair in pairs if pair[0].any() and pair[1].any()] or pairs[:1]
    found = sharp_product(np.hstack([X for X, _ in pairs]), np.vstack([Y for _, Y in pairs]))
    return Enclosure(found.mid, (found.rad + radius) * UPWARD)


def _moderate(parts: Sequence[Enclosure]) -> bool:
    """Whether the squares of all entries are finite doubles."""
    return all((np.abs(part.mid) + part.rad <= LARGEST_ENTRY).all() for part in parts)


FormOf = Callable[[Sequence[Any], int], Enclosures | None]
"""Function that gives modal coordinates of A, B and C in balls with that many bits."""
MODAL_FORMS: tuple[tuple[FormOf, int], ...] = (
    (quick_modal_form_of, PRECISIONS[0]),
    *((modal_form_of, bits) for bits in PRECISIONS),
)
"""Ways to modal coordinates with their bits, tried in turn until a proof succeeds."""


def _in_doubles(T: Any, A: Any, B: Any, mode: Array) -> tuple[Enclosure, Enclosure] | None:
    """T^-1 A T and T^-1 B by the inverse of T in doubles; None if that is not accurate.

    The residuals of the results in doubles are small, so that only a few of their digits matter.
    """
    basis, n = real_doubles(T), T.nrows()
    goal = A * T, B
    between = mode[:, None] != mode, np.zeros((n, B.ncols()), bool)
    near = [real_balls(np.zeros(part.shape)) for part in between]
    for _ in range(REFINEMENTS):
        left = [real_doubles(part - T * its) for part, its in zip(goal, near, strict=True)]
        rest = solution(basis, stacked_enclosures([left]))
        if rest is None:
            return None
        mids, rads = (np.split(part, [n], axis=1) for part in (rest.mid, rest.rad))
        sums = [its + real_balls(mid) for its, mid in zip(near, mids, strict=True)]
        rounded = zip(map(real_doubles, sums), rads, strict=True)
        A_in, B_in = (Enclosure(part.mid, (part.rad + rad) * UPWARD) for part, rad in rounded)
        if _sharp_rows(A_in) and _sharp_rows(B_in):
            return A_in, B_in
        near = [
            (its + real_balls(np.where(apart, 0.0, mid))).mid()
            for its, apart, mid in zip(near, between, mids, strict=True)
        ]
    return None


def _sharp_rows(matrix: Enclosure) -> bool:
    """Whether each error is below a few units in the last place of its row's largest entry."""
    largest = np.abs(matrix.mid).max(axis=1, initial=0.0, keepdims=True)
    return bool((matrix.rad <= LOST_IN_DOUBLES * EPS * largest + TINY).all())


def _in_balls(T: Any, A: Any, B: Any) -> tuple[Enclosure, Enclosure] | None:
    """As `_in_doubles`, by a solution in balls, which takes longer."""
    try:
        return real_doubles(T.solve(A * T)), real_doubles(T.solve(B))
    except ZeroDivisionError:  # T may be singular
        return None


def _normalised(A: Enclosure, B: Enclosure, C: Enclosure, mode: Array) -> Enclosures:
    """The realisation with B and C of similar size in every mode."""
    same = (mode[:, None] == mode).astype(float)
    into, out = np.linalg.norm(B.mid, axis=1), np.linalg.norm(C.mid, axis=0)
    into, out = (np.sqrt(same @ part**2) for part in (into, out))
    seen = (into > 0) & (out > 0)
    scale = nearest_power_of_two(
        np.sqrt(np.where(seen, out, 1.0)) / np.sqrt(np.where(seen, into, 1.0))
    )
    # A mode that is neither driven nor observed needs no scale, and no scale may overflow.
    scale = np.clip(scale, 1 / LARGEST_SCALE, LARGEST_SCALE)
    rows, columns = np.ones(len(C.mid)), np.ones(B.mid.shape[1])
    return A.scaled(scale, 1 / scale), B.scaled(scale, columns), C.scaled(rows, 1 / scale)


def _modes(A: Any, bits: int) -> tuple[Any, Array] | None:
    """An approximate real basis (n, n) of the modes, and the mode's index for each column (n,).

    Pairs of complex poles have two columns. Poles so close that their eigenvectors may be nearly
    parallel share a mode, with an orthonormal basis of all of them. None if the columns do not add
    up to n, or if a pole is beyond the range of doubles.
    """
    import flint

    n = A.nrows()
    values, vectors = eigenpairs(A, bits)
    with np.errstate(over="ignore"):
        # beyond doubles, for which only some of these functions report an error
        if not np.isfinite(np.abs(values)).all():
            return None
    columns: list[list[Any]] = []
    poles: list[complex] = []
    mode: list[int] = []
    for k in sorted(range(n), key=lambda k: abs(values[k])):
        pole = values[k]
        column = [vectors[i, k].mid() for i in range(n)]
        largest = max(column, key=lambda entry: float(abs(entry)))
        if not float(abs(largest)) > 0.0:  # also refuses NaN
            return None
        column = [(entry / largest).mid() for entry in column]
        near = [j for j, other in enumerate(poles) if abs(other - pole) < CLUSTER * abs(pole)]
        if abs(pole.imag) < CLUSTER * abs(pole):  # real, or rounded from a multiple real pole
            split = pole.imag < 0 and abs(pole.imag) > 2.0 ** (-0.7 * bits) * abs(pole)
            new = [[entry.imag if split else entry.real for entry in column]]
        elif pole.imag > 0:
            new = [[entry.real for entry in column], [entry.imag for entry in column]]
        else:
            continue
        number = mode[near[0]] if near else k
        for part in new:
            beside = [other for other, its in zip(columns, mode, strict=True) if its == number]
            columns.append(_orthogonal(part, beside) if near else part)
            poles.append(pole)
            mode.append(number)
    if len(columns) != n:
        return None
    return flint.arb_mat(n, n, [part[i] for i in range(n) for part in columns]), np.array(mode)


def _orthogonal(column: list[Any], beside: list[list[Any]]) -> list[Any]:
    """The column minus its parts along other, orthogonal columns, with a largest entry of 1."""
    for other in 2 * beside:  # a second time, because the first one cancels
        share = _inner(column, other) / _inner(other, other)
        column = [(one - share * two).mid() for one, two in zip(column, other, strict=True)]
    largest = max(column, key=lambda entry: float(abs(entry)))
    return [(entry / largest).mid() for entry in column] if largest != 0 else column


def _inner(one: list[Any], two: list[Any]) -> Any:
    """Inner product, approximately."""
    return sum(a * b for a, b in zip(one, two, strict=True)).mid()


def real_doubles(matrix: Any) -> Enclosure:
    """The matrix of balls, rounded outward to doubles."""
    shape = matrix.nrows(), matrix.ncols()
    balls = matrix.entries()
    mid = np.array([float(ball.mid()) for ball in balls])
    # The midpoint rounded to doubles errs by its last bit, and the ball by its radius.
    rad = np.array([float(ball.rad()) for ball in balls]) + EPS * np.abs(mid) + TINY
    return Enclosure(mid.reshape(shape), rad.reshape(shape) * UPWARD)

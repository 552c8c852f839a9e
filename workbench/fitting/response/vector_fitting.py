"""Vector fitting: poles are relocated by linear least squares, then refined for the least peak.

Gustavsen and Semlyen, IEEE Trans. Power Delivery 14(3), 1999; the relaxed form is from Gustavsen,
IEEE Trans. Power Delivery 21(3), 2006.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.fitting.response.least_peak import EXACT_ERROR, polished
from workbench.fitting.response.numerator import NumeratorBasis, numerator_for, real_over_imaginary
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.relocation import denominator_matrix, nearest_coefficients
from workbench.program import Claim, method
from workbench.solvers import Outcome

STARTING_DAMPING = 0.01
"""Damping ratio of the starting poles."""
MAX_RELOCATIONS = 30
"""Largest number of relocations of the poles from one start."""
POLE_MOVEMENT = 1e-9
"""A relocation has converged if no pole moves by more than this, relatively."""
LEAST_FALL, MAX_IDLE = 0.01, 8
"""The relocations end if the worst error has not decreased by this share in so many relocations in
a row.
"""
EXTRA_POLES = 4
"""Number of additional poles in one of the starts; the most important poles are then kept."""
UNSTABLE_STARTS = 4
"""Number of places over the band at which poles right of the axis start."""


@method(ResponseFit, "vector-fitting", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _vector_fitting(program: ResponseFit, context: Context) -> Claim:
    """Relaxed vector fitting from several starts, polished by reweighted Gauss-Newton steps."""
    return vector_fits(program, context)[0], Outcome.SOLVED, ""


def vector_fits(program: ResponseFit, context: Context) -> list[Rational]:
    """Fits by relocation and refinement from each start, sorted by rising worst error.

    A fit that is exact to rounding is returned alone.
    """
    found: list[tuple[float, Rational]] = []
    for fit in relocated_fits(program, context):
        found.append(polished(program, fit))
        if found[-1][0] <= EXACT_ERROR * program.size:
            return [found[-1][1]]
    return [fit for _, fit in sorted(found, key=lambda pair: pair[0])]


def relocated_fits(program: ResponseFit, context: Context) -> Iterator[Rational]:
    """Fits by relocation from each start, not yet refined."""
    for poles in context.track(starting_poles(program), "starts"):
        yield from _ways_in(program, relocated(program, poles))


def starting_poles(program: ResponseFit) -> Iterator[ComplexArray]:
    """Sets of starting poles [rad/s]: lightly damped pairs, and the best poles of a larger fit.

    A fit with more poles than wanted finds resonances that a smaller one misses; its least
    important poles are then left out. That fit is made when the second set is asked for.
    """
    omega, order = program.active.omega, program.order
    if program.unstable_poles:
        yield from _unstable_starts(omega, order, program.unstable_poles)
        return
    yield spread_poles(omega, order)
    extra = min(EXTRA_POLES, 2 * omega.size - program.coefficients - 1)
    if order and extra > 0:
        yield _foremost(program, relocated(program, spread_poles(omega, order + extra)))


def _unstable_starts(omega: RealArray, order: int, count: int) -> list[ComplexArray]:
    """Real poles right of the axis at places over the band; the other poles are spread over the
    band.
    """
    others = spread_poles(omega, order - count)
    places = np.geomspace(omega[0], omega[-1], UNSTABLE_STARTS + 2)[1:-1]
    return [
        np.concatenate([others, place * (1 + 0.1 * np.arange(count))]).astype(complex)
        for place in places
    ]


def _ways_in(program: ResponseFit, poles: ComplexArray) -> list[Rational]:
    """Fits with these poles from which a refinement starts.

    The first has all zeros. Where minimum phase is required, the refinement mirrors its zeros from
    the right half plane, which spoils the phase. So a second fit has the largest number of zeros
    for which it is minimum phase without mirroring.
    """
    fit = numerator_for(program, poles, program.zeros)
    if not program.minimum_phase or fit.is_minimum_phase:
        return [fit]
    fewer = (numerator_for(program, poles, zeros) for zeros in range(program.zeros - 1, -1, -1))
    return [fit, next(other for other in fewer if other.is_minimum_phase)]


def spread_poles(omega: RealArray, order: int) -> ComplexArray:
    """Poles spread over the logarithm of the frequencies, in lightly damped pairs."""
    low, high = np.log(omega[0]), np.log(omega[-1])
    pairs = np.exp(np.linspace(low, high, order // 2 + 2)[1:-1])
    upper = pairs * complex(-STARTING_DAMPING, 1)
    middle = [-np.exp((low + high) / 2)] if order % 2 else []
    return np.concatenate([upper, upper.conj(), middle])


def _foremost(program: ResponseFit, poles: ComplexArray) -> ComplexArray:
    """The most important poles, by the size of their partial fractions, as many as the order
    allows.
    """
    data = program.active
    groups = real_groups(poles)
    columns = [partial_fractions(group, data.omega) for group in groups]
    basis = data.weight[:, None] * np.hstack([*columns, np.ones((data.omega.size, 1))])
    target = data.weight * data.response
    solution = nearest_coefficients(real_over_imaginary(np.column_stack([basis, target])).T.copy())
    ends = np.cumsum([0, *(len(group) for group in groups)])
    parts = [basis[:, a:b] @ solution[a:b] for a, b in pairwise(ends)]
    kept: list[complex] = []
    for i in sorted(range(len(groups)), key=lambda i: -float(np.abs(parts[i]).max())):
        if len(kept) + len(groups[i]) <= program.order:
            kept += list(groups[i])
        # one place is left but a pair is next: a real pole takes the place
        elif len(kept) < program.order:
            kept.append(-abs(groups[i][0]))
    return np.array(kept)


# --- relocation ---------------------------------------------------------------------------------


def relocated(program: ResponseFit, poles: ComplexArray) -> ComplexArray:
    """Poles [rad/s] with the smallest worst error found by vector fitting from given poles."""
    if not poles.size:
        return poles
    data = program.active
    target = data.weight * data.response
    scale = np.sqrt(data.omega[0] * data.omega[-1])
    x = data.omega / scale
    poles = best = poles / scale
    zeros = poles.size - (program.order - program.zeros)  # keep the relative degree
    lowest, idle = np.inf, 0
    for _ in range(MAX_RELOCATIONS):
        basis = NumeratorBasis.over(x, data.weight, poles, zeros).columns
        known = real_over_imaginary(target)
        left = known - basis @ (basis.T @ known)
        peak = float(np.abs(left[: x.size] + 1j * left[x.size :]).max())
        idle = 0 if peak < (1 - LEAST_FALL) * lowest else idle + 1
        if peak < lowest:
            lowest, best = peak, poles
        if idle == MAX_IDLE:
            break
        moved = _relocate(x, target, basis, poles)
        if program.unstable_poles:
            moved = _sided(moved, program.unstable_poles)
        elif program.stable:
            moved = -np.abs(moved.real) + 1j * moved.imag
        moved = off_the_axis(moved, x)
        change = np.abs(np.sort_complex(moved) - np.sort_complex(poles)) / np.abs(moved)
        poles = moved
        if change.max(initial=0.0) < POLE_MOVEMENT:
            break
    return best * scale


def _relocate(
    x: RealArray, target: ComplexArray, basis: RealArray, poles: ComplexArray
) -> ComplexArray:
    """New poles: the zeros of the denominator found by one linear least-squares problem.

    The equation numerator / present = target * denominator / present is linear in the numerator
    and the new denominator. The numerator is projected out, and the sum of the values of
    denominator / present is fixed instead of its leading coefficient (relaxation).
    """
    groups = real_groups(poles)
    fractions = np.hstack(
        [*(partial_fractions(group, x) for group in groups), np.ones((x.size, 1))]
    )
    columns = real_over_imaginary(target[:, None] * fractions)
    columns -= basis @ (basis.T @ columns)
    return relocated_poles(columns, np.linalg.norm(target) / x.size, fractions, groups)


def relocated_poles(
    columns: RealArray, weight: Any, fractions: ComplexArray, groups: list[ComplexArray]
) -> ComplexArray:
    """The zeros of the denominator with the least error ``columns`` times its coefficients.

    ``fractions`` (F, k + 1) are the partial fractions of the present poles and the constant 1; the
    sum of the values of their combination is fixed (relaxation).
    """
    upper = np.array([group[0] for group in groups])
    matrix = denominator_matrix(
        columns, fractions.real.sum(axis=0), weight, float(len(fractions)), upper
    )
    return conjugate_pairs(np.linalg.eigvals(matrix))


def _sided(poles: ComplexArray, count: int) -> ComplexArray:
    """The poles, with exactly ``count`` of them right of the axis; the others are mirrored to its
    left.

    The rightmost poles are put on the right. If only one place is left for a pair, it becomes two
    real poles.
    """
    poles = poles[np.argsort(-poles.real / np.maximum(np.abs(poles), EPS), kind="stable")]
    if 0 < count < poles.size and poles[count - 1].imag and poles[count] == poles[count - 1].conj():
        poles = poles.copy()
        poles[count - 1 : count + 1] = np.abs(poles[count])
    side = np.where(np.arange(poles.size) < count, 1.0, -1.0)
    return conjugate_pairs(side * np.abs(poles.real) + 1j * poles.imag)


def off_the_axis(poles: ComplexArray, x: RealArray) -> ComplexArray:
    """Poles moved off the axis, where their fractions would be infinite."""
    tiny = 1e-12 * np.maximum(np.abs(poles), x[0])
    near = np.abs(poles.real) < tiny
    away = np.where(poles.real > 0, tiny, -tiny) + 1j * poles.imag
    return np.where(near, away, poles)


def real_groups(poles: ComplexArray) -> list[ComplexArray]:
    """Groups of poles with real partial fractions: single real poles and conjugate pairs."""
    groups = [np.array([p]) for p in poles[poles.imag == 0]]
    return groups + [np.array([p, p.conjugate()]) for p in poles[poles.imag > 0]]


def partial_fractions(group: ComplexArray, x: RealArray) -> ComplexArray:
    """Partial fractions with real coefficients of a real pole or a conjugate pair, (F, 1 or 2)."""
    if group.size == 1:
        return 1 / (1j * x - group[0])[:, None]
    one, other = 1 / (1j * x - group[0]), 1 / (1j * x - group[1])
    return np.column_stack([one + other, 1j * (one - other)])

"""Claimed bounds of a peak of mu, tried by random perturbations and by plain responses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import Array, ComplexArray
from workbench.certificate import THIS_SYSTEM, Check, counted_quantifier, relative_excess
from workbench.executor.effort import tries
from workbench.second_opinion.loops import BALL_SHARE, SAMPLED_ROUNDING
from workbench.second_opinion.perturbations import (
    constant_perturbations,
    loop_eigenvalues,
    turned_perturbations,
    vertex_perturbations,
    windings,
)
from workbench.second_opinion.powers import closed_growth, growth, slowness
from workbench.second_opinion.responses import (
    plain_response,
    precise_response,
    tried_frequencies,
    upper_closed,
)
from workbench.structure import Real, Structure

DRAWN, LOOPS = 16, 6
"""Number of random perturbations for responses, and for loops."""
CURVES, CURVE_POINTS, MATRICES = 32, 128, 8
"""Number of closed curves of perturbations, of points on each, and of matrices of a batch that are
tried.
"""
NEARLY_SINGULAR = 1e-6
"""Largest distance of I - M Delta from a singular matrix, relative to M Delta."""
FREQUENCY_ROUNDING = 4 * float(np.finfo(float).eps)
"""Relative rounding of a frequency that was mapped to the bilinear plane and back."""
ENLARGED, BORDER = 1.0 + 1e-4, 1e-12
"""Factor that moves a destabilising perturbation beyond the stability border, and the growth per
sample that counts as being on it.
"""
BORDER_DECAY = 1e-5
"""A system whose decay per sample is below this counts as being on the border of stability."""


def upper_tried(system: Any, structure: Structure, claimed: float) -> list[Check]:
    """Checks of a claimed peak of mu of a stable StateSpace by random perturbations."""
    found = [sampled_loops(system, structure, claimed)]
    if not any(isinstance(block, Real) for block in structure):
        found.append(sampled_gain(system, structure, claimed))
    return found


def sampled_gain(system: Any, structure: Structure, claimed: float) -> Check:
    """Check that no eigenvalue of M(j omega) Delta exceeds the claimed peak, for |Delta| at most 1.

    A common phase of all blocks makes any eigenvalue real, so no block may be real.
    """
    omega = tried_frequencies(np.linalg.eigvals(system.A), dt=system.dt)
    drawn = vertex_perturbations(structure, tries(DRAWN))
    size = np.abs(loop_eigenvalues(plain_response(system, omega)[:, None], drawn))
    for k in np.argsort(-size.max(axis=(1, 2))):  # rounding may have lifted these above the claim
        if size[k].max() <= claimed * (1 + SAMPLED_ROUNDING) or not math.isfinite(omega[k]):
            break
        size[k] = np.abs(loop_eigenvalues(precise_response(system, omega[k])[None, None], drawn))[0]
    where = omega[int(np.argmax(size.max(axis=(1, 2))))]
    return Check(
        "sampled perturbations",
        "largest eigenvalue of M Delta over the claimed peak, less 1",
        relative_excess(float(size.max()), claimed),
        SAMPLED_ROUNDING,
        where=f"at {where:.6g} rad/s",
        over=f"for {len(drawn)} perturbations at {omega.size} frequencies",
    )


def sampled_loops(system: Any, structure: Structure, claimed: float) -> Check:
    """Check that loops of constant perturbations smaller than 1 / claimed are stable."""
    radius = BALL_SHARE / claimed if claimed > 0 else 1.0
    fastest = -math.inf
    drawn = radius * constant_perturbations(structure, tries(LOOPS))
    for Delta in drawn:
        rate, rounding = closed_growth(system, Delta)
        fastest = max(fastest, rate - rounding)
    return Check(
        "sampled loops are stable",
        "logarithmic growth of a loop per sample, less its rounding",
        fastest,
        0.0,
        over=f"for {len(drawn)} loops",
    )


def not_encircled(matrices: Array, structure: Structure) -> Check:
    """Check that det(I - M Delta) does not wind around 0 on closed curves of perturbations smaller
    than 1.

    If mu of the matrices M (k, c, r) is at most 1, as an upper bound claims, it does so on no such
    curve.
    """
    curves = BALL_SHARE * turned_perturbations(structure, tries(CURVES), CURVE_POINTS)
    turns = [windings(M, curves) for M in matrices[: tries(MATRICES)]]
    told = [one[~np.isnan(one)].max(initial=0.0) for one in turns]
    return Check(
        "no determinant goes round 0",
        "largest number of turns of det(I - M Delta) as Delta goes along a closed curve",
        max(told, default=0.0),
        0.0,
        over=f"for {len(curves)} curves within the perturbations that the upper bound excludes",
    )


def nearly_singular(system: Any, Delta: ComplexArray, omega: float) -> Check:
    """Check that Delta makes I - M(j omega) Delta singular, or the loop unstable if slightly
    enlarged.
    """
    M = plain_response(system, np.array([omega]))[0]
    distance = regularity(M @ Delta)
    if distance > NEARLY_SINGULAR and math.isfinite(omega):
        distance = precise_distance(system, Delta, omega)
    if distance > NEARLY_SINGULAR and not Delta.imag.any():
        rate, rounding = closed_growth(system, ENLARGED * Delta.real)
        distance = 0.0 if rate + rounding > -BORDER else distance
    return Check(
        "nearly singular",
        "smallest singular value of I - M Delta, balanced, relative to M Delta; 0 where the loop "
        "of Delta is unstable",
        distance,
        NEARLY_SINGULAR,
        where=f"at {omega:.6g} rad/s",
    )


def precise_distance(system: Any, Delta: ComplexArray, omega: float) -> float:
    """The distance of I - M Delta from a singular matrix, by exact responses of M.

    The effect of rounding the frequency itself is subtracted.
    """
    loop = precise_response(system, omega) @ Delta
    step = FREQUENCY_ROUNDING * omega
    moved = [
        float(np.linalg.norm(precise_response(system, omega + sign * step) @ Delta - loop, 2))
        for sign in (1, -1)
    ]
    size = max(float(np.linalg.norm(loop, 2)), 1.0)
    return max(regularity(loop) - max(moved) / size, 0.0)


def attains(system: Any, Delta: ComplexArray, omega: float, claimed: float) -> Check:
    """Check that the system closed by Delta has at least the claimed gain at `omega` [rad/s]."""

    def short(M: ComplexArray) -> float:
        return relative_excess(claimed, float(np.linalg.norm(upper_closed(M, Delta), 2)))

    missed = short(plain_response(system, np.array([omega]))[0])
    if not missed <= SAMPLED_ROUNDING and math.isfinite(omega):  # doubles may lose a small gain
        missed = short(precise_response(system, omega))
    return Check(
        "attained gain",
        "claimed gain over that with the perturbation, less 1",
        missed,
        SAMPLED_ROUNDING,
        where=f"at {omega:.6g} rad/s",
    )


def axis_gain(system: Any, lower: float, upper: float, omega: float) -> Check:
    """Check bounds of the largest gain of a StateSpace, claimed at `omega` [rad/s], by responses.

    No response at a frequency that is tried may exceed the upper bound, and the response at `omega`
    must reach the lower one. The system need not be stable.
    """
    tried = tried_frequencies(np.linalg.eigvals(system.A), omega, dt=system.dt)
    gain = np.linalg.norm(plain_response(system, tried), 2, axis=(-2, -1))
    worst = relative_excess(float(gain.max()), upper)
    if worst > SAMPLED_ROUNDING and math.isfinite(tried[int(gain.argmax())]):
        precise = precise_response(system, float(tried[int(gain.argmax())]))
        worst = relative_excess(float(np.linalg.norm(precise, 2)), upper)
    missed = relative_excess(
        lower, float(np.linalg.norm(plain_response(system, np.array([omega]))[0], 2))
    )
    if missed > SAMPLED_ROUNDING and math.isfinite(omega):
        missed = relative_excess(lower, float(np.linalg.norm(precise_response(system, omega), 2)))
    return Check(
        "responses",
        "largest share by which responses exceed the upper bound, or miss the lower one",
        max(worst, missed),
        SAMPLED_ROUNDING,
        over=f"at {tried.size} frequencies",
    )


def one_unstable(members: Sequence[Any], nominal: Sequence[Any] | None = None) -> Check:
    """Check that at least one of the systems is unstable, or on the border of stability.

    Decay is measured at the speed of the nominal, since a system may have only the slow poles of
    its nominal.
    """
    decay = math.inf
    for one, other in zip(members, nominal or members, strict=True):
        rate, rounding = growth(one.A, one.dt)
        share = 1.0 if one.dt else slowness(one.A, other.A)
        decay = min(decay, -(rate + rounding) * share if one.nstates else math.inf)
    statement = "logarithmic decay per sample of the system with the worst perturbation"
    return Check("destabilised", statement, decay, BORDER_DECAY, over=THIS_SYSTEM)


def all_decay(members: Sequence[Any], name: str) -> Check:
    """Check that powers of the transition matrices of all systems decay."""
    rates = [sum(growth(one.A, one.dt)) for one in members]
    statement = "largest logarithmic growth per sample of systems that must be stable, and rounding"
    return Check(
        name, statement, max(rates), 0.0, over=counted_quantifier(len(rates), "system", "systems")
    )


def regularity(loop: ComplexArray) -> float:
    """Smallest singular value of I - loop in balanced coordinates, relative to the loop.

    Infinite for a loop that is not finite.
    """
    from scipy.linalg import matrix_balance

    if not np.isfinite(loop).all():
        return math.inf
    balanced = matrix_balance(loop, permute=False)[0]
    size = max(float(np.linalg.norm(balanced, 2)), 1.0)
    return float(np.linalg.norm(np.eye(len(loop)) - balanced, -2)) / size

"""A claimed peak of a loop, tried on plants of its set at single frequencies and in time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certificate import THIS_SYSTEM, Check, relative_excess
from workbench.executor.effort import tries
from workbench.second_opinion.perturbations import constant_perturbations, vertex_perturbations
from workbench.second_opinion.powers import closed_growth, growth
from workbench.second_opinion.responses import (
    closing_error,
    lower_closed,
    plain_response,
    tried_frequencies,
    upper_closed,
)
from workbench.second_opinion.simulation import energy_ratio
from workbench.structure import Structure

PERTURBATIONS = 12
"""Number of perturbations tried at every frequency, in addition to the nominal."""
REFINEMENTS, REFINED = 3, 17
"""Number of refinements around the frequency of the largest gain found, and of frequencies in
each.
"""
LOOPS_IN_TIME = 4
"""Number of perturbed loops, in addition to the nominal one, whose poles are computed and which are
simulated.
"""
SAMPLED_ROUNDING = 1e-6
"""Relative error by which rounding may lift a gain above the claimed peak. Responses computed in
two ways differ by less, unless the loop is too badly conditioned for either.
"""
SINGULAR = 1e14
"""Condition number above which a matrix counts as singular."""
BALL_SHARE = 1.0 - 1e-9
"""Size of perturbations relative to the radius of the ball: rounding must not push them out of
it.
"""


def powers_fall(A: Any, dt: float | None) -> Check:
    """Check that powers of the loop's transition matrix do not grow."""
    rate, rounding = growth(A, dt)
    statement = "logarithmic growth of the loop per sample by a power of its transition matrix"
    return Check("powers fall", statement, rate, rounding, over=THIS_SYSTEM)


def gain(
    plant: Any,
    K: Any,
    structure: Structure | None,
    claimed: float,
    omega: float = math.nan,
    band: tuple[float, float] = (0.0, math.inf),
    poles: ComplexArray | None = None,
) -> Check:
    """Check that no plant drawn from the set has a performance gain above the claimed peak.

    Every perturbation smaller than 1 / claimed leaves the gain from exogenous inputs to performance
    outputs at most `claimed`; that is what a bound of mu over frequency says (main loop theorem).

    Parameters
    ----------
    plant
        StateSpace with inputs (perturbation, exogenous, controls) and outputs (perturbation,
        performance, measurements).
    K
        StateSpace of the controller; None: the plant is closed already.
    structure
        Blocks of the perturbation; None: the plant has none.
    claimed
        The claimed bound of the peak.
    omega
        Frequency of the peak [rad/s]; NaN if it is not known.
    band
        Lowest and highest frequency [rad/s] of the claim.
    poles
        Poles near which frequencies are dense; None: those of the plant and of K.
    """
    if poles is None:
        poles = np.concatenate([np.linalg.eigvals(one.A) for one in (plant, K) if one is not None])
    grid = tried_frequencies(poles, omega, plant.dt)
    ends = np.array([end for end in band if end < math.inf or not plant.dt])
    grid = np.unique(np.concatenate([grid[(grid >= band[0]) & (grid <= band[1])], ends]))
    if K is not None and (_integrates(plant) or _integrates(K)):
        grid = grid[grid > 0.0]  # an open loop with an integrator has no response at frequency 0
    worst, where = worst_gain(plant, K, structure, claimed, grid)
    for _ in range(REFINEMENTS):
        place = int(np.searchsorted(grid, where))
        low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
        if not (0.0 < high - low < math.inf):
            break
        grid = np.unique(np.append(np.linspace(low, high, REFINED), where))
        worst, where = max((worst, where), worst_gain(plant, K, structure, claimed, grid))
    return Check(
        "sampled plants",
        "largest gain over the claimed peak, less 1",
        relative_excess(worst, claimed),
        SAMPLED_ROUNDING,
        where=f"at {where:.6g} rad/s",
        over=f"for {tries(PERTURBATIONS) + 1} plants at {len(grid)} frequencies",
    )


def worst_gain(
    plant: Any, K: Any, structure: Structure | None, claimed: float, omega: RealArray
) -> tuple[float, float]:
    """The largest gain over the drawn plants at `omega` [rad/s] (F,), and its frequency."""
    M = plain_response(plant, omega)
    error = np.zeros(len(omega))
    if K is not None:
        controller = plain_response(K, omega)
        error = closing_error(plant, M, K, controller, omega)
        M = lower_closed(M, controller)
    if structure is None:
        sizes = _sizes(M)
    else:
        drawn = _radius(claimed) * vertex_perturbations(structure, tries(PERTURBATIONS))
        every = np.concatenate([np.zeros_like(drawn[:1]), drawn])
        sizes = np.max([_sizes(upper_closed(M, Delta)) for Delta in every], axis=0)
    sizes = np.where(np.isfinite(error), np.maximum(sizes - error, 0.0), 0.0)
    place = int(np.argmax(sizes))
    return float(sizes[place]), float(omega[place])


def in_time(
    loop: Any, structure: Structure | None, claimed: float, omega: float = math.nan
) -> list[Check]:
    """Checks that perturbed loops are stable and keep the claimed ratio of energies in time.

    Constant real perturbations are members of the set. The energy of the performance outputs over
    any finite time is at most `claimed`^2 times that of the exogenous inputs (causality).

    Parameters
    ----------
    loop
        StateSpace of the closed loop with inputs (perturbation, exogenous), outputs (perturbation,
        performance).
    structure, claimed, omega
        As of `gain`.
    """
    drawn = [np.zeros((0, 0))]
    if structure is not None:
        members = _radius(claimed) * constant_perturbations(structure, tries(LOOPS_IN_TIME))
        drawn = [np.zeros_like(members[0]), *members]
    fastest, largest = -math.inf, 0.0
    for Delta in drawn:
        rate, rounding = closed_growth(loop, Delta)
        fastest = max(fastest, rate - rounding)
        if rate <= rounding:
            closed = perturbed(loop, Delta)
            largest = max(largest, energy_ratio(closed, loop.dt, omega, claimed))
    return [
        Check(
            "sampled loops are stable",
            "logarithmic growth of a loop per sample, less its rounding",
            fastest,
            0.0,
            over=f"for {len(drawn)} loops",
        ),
        Check(
            "simulated energy",
            "root of the energy ratio of a simulated loop over the claimed peak, less 1",
            relative_excess(largest, claimed),
            SAMPLED_ROUNDING,
            over=f"for {len(drawn)} loops",
        ),
    ]


def perturbed(loop: Any, Delta: RealArray) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Realisation of a loop closed by a constant perturbation."""
    rows, columns = Delta.shape
    B1, B2 = loop.B[:, :rows], loop.B[:, rows:]
    C1, C2 = loop.C[:columns], loop.C[columns:]
    D11, D12 = loop.D[:columns, :rows], loop.D[:columns, rows:]
    D21, D22 = loop.D[columns:, :rows], loop.D[columns:, rows:]
    R = Delta @ np.linalg.inv(np.eye(columns) - D11 @ Delta)
    return loop.A + B1 @ R @ C1, B2 + B1 @ R @ D12, C2 + D21 @ R @ C1, D22 + D21 @ R @ D12


def _radius(claimed: float) -> float:
    """Size of perturbations smaller than 1 / claimed; any size is allowed for a claim of 0."""
    return BALL_SHARE / claimed if claimed > 0.0 else 1.0


def _integrates(system: Any) -> bool:
    """Whether the system has a pole at frequency 0, or one that is 0 up to rounding."""
    at_zero = system.A - np.eye(len(system.A)) if system.dt else system.A
    return bool(len(at_zero) and np.linalg.cond(at_zero) > SINGULAR)


def _sizes(M: ComplexArray) -> RealArray:
    """Largest singular value of each matrix; 0 for matrices without entries."""
    if 0 in M.shape[-2:]:
        return np.zeros(len(M))
    return np.linalg.norm(M, 2, axis=(-2, -1))

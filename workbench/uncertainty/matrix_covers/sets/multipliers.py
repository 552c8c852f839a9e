"""Multipliers of a minimum, corrected until they satisfy its equations up to rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.loop import loop_directions
from workbench.uncertainty.matrix_covers.sets.optimality import InUnits
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import (
    ctranspose,
    directions,
    entry_directions,
)
from workbench.uncertainty.matrix_covers.sets.size import size_derivatives

CORRECTIONS = 10
"""Number of corrections of the multipliers. Each is Newton's step in equations that are nearly
linear. Half leaves a larger gap to the optimum where they are not; double changes nothing once they
are met.
"""
TOUCHING = 1e-5
"""A set touches a matrix whose norm is within this relative distance of the largest one. The last
barrier leaves norms that near. With half of it a plant that holds the set may be left out, and the
gap is larger; with double of it one more takes part.
"""


def with_balanced_multipliers(program: MatrixSets, found: FoundSets) -> FoundSets:
    """The sets with the smallest change of the multipliers that satisfies the equations of a
    minimum.

    A solver leaves an error in the multipliers. It is the larger, the closer the sets come to the
    matrices. The change is the smallest one relative to the multipliers.
    """
    within = program.in_units(found)
    equations, wanted, _ = _equations(program, within)
    steps = _steps_of(found.weights).reshape(len(wanted), -1)
    count = steps.shape[1]
    if found.of_loop is not None:
        steps = np.concatenate([steps, _steps_of(found.of_loop[:, 2:])], axis=1)
    reached = np.einsum("fdk,fk->fd", equations, steps)
    steps = steps * (np.abs(wanted).max(axis=1) / np.abs(reached).max(axis=1))[:, None]
    for _ in range(CORRECTIONS):
        reached = np.einsum("fdk,fk->fd", equations, steps)
        change = np.linalg.pinv(equations * steps[:, None]) @ (wanted - reached)[..., None]
        steps = steps * np.maximum(1 + change[..., 0], 0.0)
    found = replace(found, weights=_multipliers_of(steps[:, :count].reshape(found.weights.shape)))
    if found.of_loop is None:
        return found
    of_loop = np.concatenate([found.of_loop[:, :2], _multipliers_of(steps[:, count:])], axis=1)
    return replace(found, of_loop=of_loop)


def _with_loop(
    program: MatrixSets, equations: RealArray, wanted: RealArray, K: Array
) -> tuple[RealArray, RealArray]:
    """Equations and right sides, extended by those of the loop's level and scaling, and by its
    unknowns.
    """
    p, m = program.deviations.shape[2:]
    A, B = directions(program.left, p), directions(program.right, m)
    left, right = loop_directions(K.shape[1:], A, B)
    u, _, vh = np.linalg.svd(K, full_matrices=False)
    v = ctranspose(vh)
    columns = np.einsum("fir,dij,fjr->fdr", u.conj(), left, u).real
    columns += np.einsum("fir,dij,fjr->fdr", v.conj(), right, v).real
    more = len(left) - equations.shape[1]
    padding = ((0, 0), (0, more), (0, 0))
    found = np.concatenate([np.pad(equations, padding), columns.cumsum(axis=-1)], axis=2)
    wanted = np.pad(wanted, padding[:2])
    wanted[:, equations.shape[1]] = -2.0 * p * m
    return found, wanted


def _steps_of(weights: RealArray) -> RealArray:
    """Decreases of the multipliers from one singular value to the next smaller one."""
    return -np.diff(weights, axis=-1, append=0.0)


def with_touching_multipliers(program: MatrixSets, found: FoundSets) -> FoundSets:
    """The sets with the multipliers of touched matrices that best satisfy the equations."""
    equations, wanted, slack = _equations(program, program.in_units(found))
    steps = np.zeros(slack.shape)
    for f, (columns, target) in enumerate(zip(equations, wanted, strict=True)):
        active = slack[f] <= TOUCHING
        steps[f, active] = nnls(columns[:, active], target)[0]
    return replace(found, weights=_multipliers_of(steps.reshape(found.weights.shape)))


def _equations(program: MatrixSets, within: InUnits) -> tuple[RealArray, RealArray, RealArray]:
    """Equations (F, d, N r) and right sides (F, d) for multipliers, and distances (F, N r) from
    touching.

    The unknowns are the decreases of the multipliers from one singular value to the next smaller
    one, which must not be negative. The distances say how far their singular values are from the
    largest of all.
    """
    F, moving, p, m = program.deviations.shape
    A, B = directions(program.left, p), directions(program.right, m)
    u, s, vh = np.linalg.svd(within.M, full_matrices=False)
    v = ctranspose(vh)
    values = [
        np.einsum("fkir,dij,fkjr->fdkr", u.conj(), A, u).real,
        np.einsum("fkir,dij,fkjr->fdkr", v.conj(), B, v).real,
    ]
    if program.centre == "free":
        across = np.einsum("fkir,dij,fkjr->fdkr", u.conj(), entry_directions(p, m), v).real
        across[:, :, moving:] = 0.0  # the floor moves together with the centre
        values.append(across)
    equations = np.concatenate(values, axis=1).cumsum(axis=-1).reshape(F, -1, s[0].size)
    slope, _ = size_derivatives(program, within.P, within.S, A, B)
    wanted = np.zeros(equations.shape[:2])
    wanted[:, : slope.shape[1]] = -slope
    slack = 1 - s / s.max(axis=(1, 2), keepdims=True)
    if within.K is not None:
        equations, wanted = _with_loop(program, equations, wanted, within.K)
    return equations, wanted, slack.reshape(F, -1)


def _multipliers_of(steps: RealArray) -> RealArray:
    """Multipliers from their decreases from one singular value to the next smaller one."""
    found: RealArray = steps[..., ::-1].cumsum(axis=-1)[..., ::-1]
    return found

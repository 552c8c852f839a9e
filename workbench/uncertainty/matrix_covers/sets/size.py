"""Derivatives of the size of sets when their weights move along geodesics."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.uncertainty.matrix_covers.sets.loop import VOLUME_SHARE
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets
from workbench.uncertainty.matrix_covers.sets.shapes import ctranspose


def size_derivatives(
    program: MatrixSets, P: Array, S: Array, A: Array, B: Array
) -> tuple[RealArray, RealArray]:
    """Slope (f, a + b) and curvature (f, a + b, a + b) of `MatrixSets.size_of` for fixed mu.

    P (f, p, p) and S (f, m, m) move to exp(t A) P and S exp(t B), along the directions A (a, p, p)
    and B (b, m, m).
    """
    p, m = P.shape[-1], S.shape[-1]
    n = len(A) + len(B)
    if program.size != "trace":
        traces = [m * np.einsum("dii->d", A).real, p * np.einsum("dii->d", B).real]
        share = VOLUME_SHARE if program.size == "mu" else 1.0
        slope = np.tile(-2 * share * np.concatenate(traces), (len(P), 1))
        return slope, np.zeros((len(P), n, n))
    slopes, curvature = [], np.zeros((len(P), n, n))
    place = 0
    for inverse, basis, outer in ((P, A, False), (S, B, True)):
        weight = np.linalg.inv(inverse)
        other = ctranspose(weight)
        gram = weight @ other if outer else other @ weight
        gram = gram / np.einsum("fii->f", gram).real[:, None, None]
        down = -2 * np.einsum("dij,fji->fd", basis, gram).real
        bent = np.einsum("dij,ejk,fki->fde", basis, basis, gram).real
        part = slice(place, place + len(basis))
        curvature[:, part, part] = (
            2 * (bent + bent.swapaxes(1, 2)) - down[:, :, None] * down[:, None]
        )
        slopes.append(down)
        place += len(basis)
    return p * m * np.concatenate(slopes, axis=1), p * m * curvature

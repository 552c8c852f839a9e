"""Discs for the eigenvalues of real matrices, computed with real products only.

The eigenvectors of a complex pair stand as real and imaginary part in a real matrix V, and W is an
approximate inverse. With K made of blocks [1 1; j -j] for the pairs, V K are the eigenvectors and
K^-1 W their inverse; each entry of these last two products is a sum of two numbers. So enclosures
of W A V and W V take a quarter of the time of complex ones.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import EPS, Array, RealArray
from workbench.certify.modes.modal_response import real_modes
from workbench.certify.rounding import UPWARD, Enclosure, enclosed_inverse, exact

FEWEST_REAL = 40
"""Least number of rows for which real products are worthwhile. Half or double changes the time, and
the last bits of discs.
"""
Pencil = tuple[Enclosure, Enclosure]
"""P and E of P - s E, both nearly diagonal."""


def real_pencil(
    A: Enclosure, B: Enclosure, C: Enclosure, D: Enclosure, omega: float = 0.0
) -> Pencil | None:
    """A nearly diagonal pencil, singular at the t at which [-j A - omega - t, -j B; C, D] is.

    All matrices are real; D is proven to be regular. None for few rows, if D is not proven regular,
    or if no full set of eigenvectors of A - B D^-1 C is found.
    """
    if len(A.mid) < FEWEST_REAL or any(np.iscomplexobj(part.mid) for part in (A, B, C, D)):
        return None
    back = enclosed_inverse(D)
    if back is None:
        return None
    try:
        _, first, V, W = real_modes(A.mid - B.mid @ back.mid @ C.mid)
    except (np.linalg.LinAlgError, ValueError):
        return None
    below, beside = -back.mid @ (C.mid @ V), -(W @ B.mid) @ back.mid
    V1, V2, W1, W2 = (exact(part) for part in (V, below, W, beside))
    upper = A @ V1
    if len(D.mid):
        upper, G, F = upper + B @ V2, C @ V1 + D @ V2, W1 @ B + W2 @ D
        P = W1 @ upper + W2 @ G - F @ (back @ G)
    else:
        P = W1 @ upper
    P, E = _in_pairs(P, first), _in_pairs(W1 @ V1, first)
    turned = Enclosure(-1j * P.mid, P.rad)
    return (turned - E.times(omega) if omega else turned), E


def _in_pairs(matrix: Enclosure, first: Array) -> Enclosure:
    """K^-1 M K for a real M; the pairs of K begin at the rows `first`."""
    second = first + 1
    mid, rad = matrix.mid.astype(complex), matrix.rad.copy()
    mid[:, first], mid[:, second] = _sums(mid[:, first], 1j * mid[:, second])
    rad[:, first] = rad[:, second] = (rad[:, first] + rad[:, second]) * UPWARD
    mid[first], mid[second] = _sums(mid[first] / 2, -0.5j * mid[second])
    both = (rad[first] + rad[second]) / 2
    rad[first] = (both + EPS * np.abs(mid[first])) * UPWARD
    rad[second] = (both + EPS * np.abs(mid[second])) * UPWARD
    return Enclosure(mid, rad)


def _sums(one: Array, two: Array) -> tuple[Array, Array]:
    """The sum and the difference."""
    return one + two, one - two


def real_part(matrix: Enclosure) -> Enclosure:
    """The enclosure with real midpoints, if they have no imaginary part; else the enclosure
    itself.
    """
    mid: RealArray | Array = matrix.mid
    return matrix if np.iscomplexobj(mid) and mid.imag.any() else Enclosure(mid.real, matrix.rad)

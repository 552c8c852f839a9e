"""Discs that contain the eigenvalues of every matrix of an enclosure.

Let V be a matrix of approximate eigenvectors of A, and W an approximate inverse. Where
W (A - s) V = P - s E is strictly diagonally dominant, it is regular, and s is no eigenvalue. So
every eigenvalue lies in one of the discs

    |e_i s - p_i| <= a_i + |s| b_i

of the diagonals p, e and the sums a, b of the other entries of their rows (Gershgorin; Stewart,
Gershgorin theory for the generalized eigenvalue problem, Math. Comp. 29 (1975) 600-606). P and E
are enclosed, so that V and W need not be accurate; accuracy only makes the discs small.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse.csgraph import connected_components

from workbench._core.arrays import EPS, Array, BoolArray, RealArray
from workbench.certify.modes.real_eigenvalues import real_pencil
from workbench.certify.rounding import (
    UPWARD,
    Enclosure,
    enclosed_inverse,
    exact,
    in_its_unit,
)

ATTEMPTS = 3
"""Number of times that eigenvectors are computed, each time in the coordinates of those before.
This helps if entries differ widely. With half of them, discs of graded matrices may stay wide, and
proofs take more intervals; double costs time only. Every attempt gives valid discs.
"""
FEWEST_KEPT = 40
"""Least number of states of a matrix whose discs are kept for later calls. Discs of smaller ones
are found again in little time. Half or double changes the time only.
"""
SHARP = 1e-7
"""Attempts end once each disc on the axis has a radius below this share of its centre. A disc a
thousand times smaller than `NORM_TOLERANCE` hides no peak. With half or double of it, an attempt
more or less is made.
"""
SHARP_ENOUGH = 1e-4
"""The same for a disc that only ends an interval. An end may give up as much as `END_MARGIN`
anyway. Half or double: an attempt more or less.
"""
SCALINGS = 8
"""Number of steps of the search for the scaling of the rows. Each step passes the scaling on by one
coupling of rows. None of the nearest tests feels half or double; every scaling gives valid discs.
"""
WANTED_SHARE = 1e-3
"""A row needs no further scaling once its disc has a radius below this share of its distance from
the real axis. Half or double: other rows keep more or less of their sharpness; every scaling gives
valid discs.
"""
LARGEST_SCALE = 1e9
"""Largest scaling factor of a row, and largest ratio of an eigenvalue's size to the distance from
the axis for which its row is scaled. Rounding leaves discs nearer to the axis than that on it, with
any factor. Half or double move that border a little; each factor gives valid discs.
"""


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs |s - centre| <= radius, both (n,); the radius is infinite where nothing is proven."""

    centre: Array
    radius: RealArray

    @property
    def rightmost(self) -> float:
        """Upper bound of the real parts; -inf if there are no discs."""
        return float((self.centre.real + self.radius).max(initial=-np.inf))

    def proves_some(self, among: BoolArray) -> bool:
        """Whether some eigenvalue is in these discs (n,).

        A group of discs that touches no other disc contains as many eigenvalues as it has discs
        (Gershgorin); a disc that touches others may contain none.
        """
        if not among.any():
            return False
        with np.errstate(all="ignore"):
            apart = np.abs(self.centre[:, None] - self.centre) * (1 - 4 * EPS)
            touching = ~(apart > (self.radius[:, None] + self.radius) * (1 + 4 * EPS))
        count, group = connected_components(touching, directed=False)
        return any(among[group == k].all() for k in range(count))

    def doubtful(self, sharp: float = SHARP_ENOUGH) -> int:
        """Number of discs that meet the real axis and are not small."""
        meets = np.abs(self.centre.imag) <= self.radius
        return int((meets & (self.radius > sharp * np.abs(self.centre))).sum())


def real_discs(
    A: Enclosure,
    B: Enclosure,
    C: Enclosure,
    D: Enclosure,
    omega: float = 0.0,
    sharp: float = SHARP_ENOUGH,
) -> Discs:
    """Discs that contain all t at which [-j A - omega - t, -j B; C, D] is singular.

    In real arithmetic if all matrices are real and the discs are small; otherwise as
    `static_discs`.
    """
    pencil = real_pencil(A, B, C, D, omega)
    found = None if pencil is None else pencil_discs(*pencil)
    if found is not None and not found.doubtful(sharp):
        return found
    shifted = A - exact(1j * omega * np.eye(len(A.mid))) if omega else A
    A, B = (Enclosure(-1j * part.mid, part.rad) for part in (shifted, B))
    other = static_discs(A, B, C, D, sharp)
    # One disc that contains everything counts as one doubtful disc, and says less than several.
    if found is None or not np.isfinite(found.radius).all():
        return other
    return min(other, found, key=lambda discs: discs.doubtful(sharp))


def static_discs(
    A: Enclosure, B: Enclosure, C: Enclosure, D: Enclosure, sharp: float = SHARP_ENOUGH
) -> Discs:
    """Discs that contain all s at which [A - s, B; C, D] is singular, D proven regular.

    The s are the eigenvalues of A - B D^-1 C. This matrix is only computed to find eigenvectors V1
    and their inverse W1. With approximate V2 = -D^-1 C V1 and W2 = -W1 B D^-1, the matrix

        [W1 W2] [A B] [V1 0]   [P F]
        [ 0  1] [C D] [V2 1] = [G D]

    has small F and G. Errors of D^-1 then enter in second order only, and no difference of large
    entries of A - B D^-1 C is rounded.
    """
    nothing = Discs(np.zeros(1), np.full(1, np.inf))
    back = enclosed_inverse(D)
    if back is None:
        return nothing
    discs = nothing
    try:
        V = np.linalg.eig(in_its_unit(A.mid - B.mid @ back.mid @ C.mid)[0])[1]
        for _ in range(ATTEMPTS):
            W = np.linalg.inv(V)
            below, beside = -back.mid @ (C.mid @ V), -(W @ B.mid) @ back.mid
            V1, V2, W1, W2 = (exact(part) for part in (V, below, W, beside))
            upper, G = A @ V1 + B @ V2, C @ V1 + D @ V2
            F = W1 @ B + W2 @ D
            P = W1 @ upper + W2 @ G - F @ (back @ G)
            found = pencil_discs(P, W1 @ V1)
            better = discs is nothing or found.doubtful(sharp) < discs.doubtful(sharp)
            discs = found if better else discs
            if not (better and discs.doubtful(sharp)):
                break
            V = V @ np.linalg.eig(in_its_unit(P.mid)[0])[1]
            length = np.linalg.norm(V, axis=0)
            if not (np.isfinite(length) & (length > 0)).all():
                break
            V = V / length
    except (np.linalg.LinAlgError, ValueError):
        pass
    return discs


def linear_discs(L: Enclosure, L_1: Enclosure, within: float) -> Discs:
    """Discs that contain all t, |t| <= `within`, at which some L - t L_1 is singular."""
    discs = Discs(np.zeros(1), np.full(1, np.inf))
    try:
        near, unit = in_its_unit(L.mid)
        back = np.linalg.inv(near) / unit
        V = np.linalg.eig(in_its_unit(back @ L_1.mid)[0])[1]
        for attempt in range(ATTEMPTS):
            W = exact(np.linalg.solve(V, back))
            P, E = W @ (L @ exact(V)), W @ (L_1 @ exact(V))
            found = pencil_discs(P, E, within)
            if not attempt or len(touched(found)[0]) < len(touched(discs)[0]):
                discs = found
            if not discs.doubtful():
                break
            near, unit = in_its_unit(P.mid)
            V = V @ np.linalg.eig(in_its_unit(np.linalg.solve(near, E.mid / unit))[0])[1]
            V = V / np.linalg.norm(V, axis=0)
    except (np.linalg.LinAlgError, ValueError):
        pass
    return discs


def pencil_discs(P: Enclosure, E: Enclosure, within: float = np.inf) -> Discs:
    """Discs that contain all s, |s| <= `within`, at which P - s E is singular for some entries."""
    if not (P.finite and E.finite):
        return Discs(np.zeros(1), np.full(1, np.inf))
    found = _discs(P, E, np.ones(len(P.mid)), within)
    if not len(touched(found)[0]):
        return found
    scaled = _discs(P, E, _row_scaling(P, E, within), within)
    return min(found, scaled, key=lambda discs: len(touched(discs)[0]))


def _discs(P: Enclosure, E: Enclosure, scale: RealArray, within: float) -> Discs:
    """As `pencil_discs`, with the columns multiplied by factors (n,) and the rows divided by
    them.
    """
    (p, a), (e, b) = _rows(P, scale), _rows(E, scale)
    with np.errstate(all="ignore"):
        size = np.abs(e)
        reach = np.minimum((np.abs(p) + a) / (size - b) * UPWARD, within)
        reach = np.where(size > b * UPWARD, reach, within)
        centre = p / e
        radius = ((a + b * reach) / size + 8 * EPS * np.abs(centre)) * UPWARD
        known = np.isfinite(centre) & np.isfinite(radius)
        # A row with a small e may have no s within reach at all.
        away = np.abs(p) > (a + within * (size + b)) * UPWARD
    if np.isfinite(within):
        centre, radius, known = centre[~away], radius[~away], known[~away]
    return Discs(np.where(known, centre, 0.0), np.where(known, radius, np.inf))


def _rows(matrix: Enclosure, scale: RealArray) -> tuple[Array, RealArray]:
    """The diagonal, and for each row the sum of the other entries and of all radii.

    Column j is multiplied by `scale` j and row j divided by it: a similarity.
    """
    beside = np.abs(matrix.mid)
    np.fill_diagonal(beside, 0.0)
    return np.diagonal(matrix.mid), (beside + matrix.rad) @ scale / scale * UPWARD


def _row_scaling(P: Enclosure, E: Enclosure, within: float) -> RealArray:
    """Factors (n,) that make discs small where they are near the real axis.

    Any factors are allowed. A row whose disc is too large for its distance gains at the cost of the
    other rows.
    """
    p, e = np.diagonal(P.mid), np.diagonal(E.mid)
    with np.errstate(all="ignore"):
        reach = np.minimum(np.abs(p / e), within)[:, None]
        beside = np.abs(P.mid) + P.rad + reach * (np.abs(E.mid) + E.rad)
        distance = np.abs((p * e.conj()).imag) / np.abs(e)
    np.fill_diagonal(beside, 0.0)
    # Where e is 0, use the distance from all s within reach.
    distance = np.where(np.isfinite(distance), distance, np.abs(p)) + np.abs(p) / LARGEST_SCALE
    if not (np.isfinite(beside).all() and (distance > 0).all()):
        return np.ones(len(p))
    ratio = beside / distance[:, None]
    scale = np.ones(len(p))
    for _ in range(SCALINGS):
        scale = np.clip(ratio @ scale / WANTED_SHARE, 1.0, LARGEST_SCALE)
    return scale


def pole_discs(A: Enclosure) -> Discs:
    """Discs that contain all eigenvalues of the matrices A, small near the imaginary axis."""
    if len(A.mid) >= FEWEST_KEPT and not A.rad.any() and np.isrealobj(A.mid):
        return _kept_pole_discs(np.ascontiguousarray(A.mid).tobytes(), len(A.mid))
    return _pole_discs(A)


@lru_cache(maxsize=4)  # a check of stability and a norm both ask for the discs of the same matrix
def _kept_pole_discs(entries: bytes, n: int) -> Discs:
    return _pole_discs(exact(np.frombuffer(entries).reshape(n, n)))


def _pole_discs(A: Enclosure) -> Discs:
    n = len(A.mid)
    B, C, D = (exact(np.zeros(shape)) for shape in ((n, 0), (0, n), (0, 0)))
    discs = real_discs(A, B, C, D, sharp=SHARP)
    return Discs(1j * discs.centre, discs.radius)


def separate_pole_discs(A: Enclosure) -> Discs:
    """As `pole_discs`, separately for each diagonal block of A's block triangular form.

    A suitable order of the states makes A block triangular, if states do not influence each other
    in a circle. Its eigenvalues are then those of the blocks. A chain of equal lags, whose
    eigenvectors are all alike, becomes as many blocks of one state.
    """
    acts = (A.mid != 0) | (A.rad != 0)
    count, block = connected_components(acts, connection="strong")
    places = [np.ix_(block == k, block == k) for k in range(count)]
    found = [pole_discs(Enclosure(A.mid[place], A.rad[place])) for place in places]
    empty = [np.zeros(0)]
    return Discs(
        np.concatenate([discs.centre for discs in found] or empty),
        np.concatenate([discs.radius for discs in found] or empty),
    )


def touched(discs: Discs) -> tuple[RealArray, RealArray]:
    """Least and greatest real number in each disc that meets the real axis."""
    x, y, r = discs.centre.real, np.abs(discs.centre.imag), discs.radius
    meets = y <= r
    x, y, r = x[meets], y[meets], r[meets]
    with np.errstate(invalid="ignore"):
        half = np.where(np.isinf(r), np.inf, np.sqrt((r + y) * np.maximum(r - y, 0.0)))
    half = half * UPWARD + 4 * EPS * np.abs(x)
    return x - half, x + half

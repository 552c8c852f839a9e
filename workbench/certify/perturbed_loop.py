"""Perturbations of a system, proven in ball arithmetic to destabilise it or to raise its gain.

Let A(t) = A + B t Delta (I - D t Delta)^-1 C be the closed loop of a stable system and a constant
t Delta. Its eigenvalues are continuous in t while I - t D Delta is regular. Where A(0) is stable
and A(1) is not, some t Delta with 0 < t <= 1 therefore makes I - M(j omega) t Delta singular at a
frequency, or at infinity where I - t D Delta is singular: the peak of mu is at least 1 / |Delta|.
A complex Delta may be singular at -omega; its conjugate then is at omega.

That A(1) is not stable follows from one eigenvalue. The trace of (s I - A)^-1 is the sum of
1 / (s - lambda_i), so some eigenvalue is within n / |trace| of s.

Source: K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 9.1, for the
continuity.
"""

from __future__ import annotations

import numpy as np
from flint import acb, arb, ctx

from workbench._core.arrays import Array
from workbench.certify.balls import (
    Matrix,
    balls,
    below,
    identity,
    length,
    matrices_in_balls,
    middle,
    response_of,
    submatrix,
)
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.rounding import in_its_unit
from workbench.certify.singularity import proven_bound, size_of, structured_part
from workbench.certify.stable_system import StableSystem
from workbench.structure import Structure

GROWTHS = (2.0**-34, 2.0**-24, 2.0**-16)
"""Shares by which a perturbation on the stability boundary is enlarged, so that it lies beyond.
They are tried in turn. Half or double: the perturbation said is larger or smaller by as much.
"""


def proven_at(
    system: StableSystem, structure: Structure, Delta: Array, omega: float | arb
) -> float:
    """The lower bound of mu at `omega` [rad/s] that Delta (r, c) proves; 0: not proven."""
    with ctx.workprec(PRECISIONS[1]):
        M = response_of(system, omega)
    return proven_bound(M, structure, Delta) if M is not None else 0.0


def sharp_response(system: StableSystem, omega: float | arb) -> Array | None:
    """The response (c, r) of the given system at `omega` [rad/s], computed to many digits.

    For a sampled system with clustered poles, doubles lose the digits that its realisation loses.
    None if balls cannot determine it.
    """
    with ctx.workprec(PRECISIONS[1]):
        M = response_of(system, omega)
    return None if M is None else middle(M)


def proven_over_frequency(system: StableSystem, structure: Structure, Delta: Array) -> float:
    """The lower bound of the peak of mu over all frequencies that Delta (r, c) proves.

    0 if it is not proven that Delta, slightly enlarged, destabilises the system.
    """
    if not (np.isfinite(Delta).all() and Delta.any()):
        return 0.0
    Delta = structured_part(structure, Delta)
    for growth in GROWTHS:
        for bits in PRECISIONS:
            with ctx.workprec(bits):
                larger = balls(Delta) * acb(1 + growth)
                if _is_unstable(_closed(system, larger)):
                    size = arb(size_of(structure, Delta)) * arb(1 + growth)
                    return max(below(arb(1) / size), 0.0)
    return 0.0


def _closed(system: StableSystem, Delta: Matrix) -> Matrix | None:
    """A + B Delta (I - D Delta)^-1 C; None if I - D Delta cannot be told from singular."""
    try:
        A, B, C, D = matrices_in_balls(system)
        return A + B * Delta * (identity(D.nrows()) - D * Delta).solve(C)
    except ZeroDivisionError:
        return None


def _is_unstable(A: Matrix | None) -> bool:
    """Whether an eigenvalue is proven to have a positive real part."""
    if A is None or not A.nrows():
        return False
    n = A.nrows()
    near, unit = in_its_unit(middle(A))
    try:
        values = np.linalg.eigvals(near) * unit
    except np.linalg.LinAlgError:  # an entry is not finite
        return False
    rightmost = complex(values[np.argmax(values.real)])
    if not rightmost.real > 0:
        return False
    # At a point near the eigenvalue, but not so near that the resolvent cannot be computed.
    s = acb(rightmost) + rightmost.real / (8 * n)
    try:
        trace = abs((s * identity(n) - A).inv().trace())
    except ZeroDivisionError:
        return False
    return bool(trace > 0 and s.real - arb(n) / trace > 0)


def proven_gain(
    system: StableSystem, structure: Structure, Delta: Array, omega: float | arb
) -> float:
    """A lower bound of sigma_max(F_u(N(j omega), Delta)) for exactly this Delta (r, c).

    0 if |Delta| <= 1 is not proven, or if the loop of Delta cannot be told from a singular one. For
    any u != 0, sigma_max(F) >= |F u| / |u|.
    """
    if not np.isfinite(Delta).all():
        return 0.0
    Delta = structured_part(structure, Delta)
    if not size_of(structure, Delta) <= 1:
        return 0.0
    r, c = structure.rows, structure.columns
    with ctx.workprec(PRECISIONS[0]):
        N = response_of(system, omega)
        if N is None:
            return 0.0
        (y, z), (w, d) = (
            np.split(np.arange(n), [own]) for n, own in ((N.nrows(), c), (N.ncols(), r))
        )
        N11, N12, N21, N22 = (
            submatrix(N, y, w),
            submatrix(N, y, d),
            submatrix(N, z, w),
            submatrix(N, z, d),
        )
        try:
            inner = (identity(c) - N11 * balls(Delta)).solve(N12)
        except ZeroDivisionError:
            return 0.0
        F = N22 + N21 * balls(Delta) * inner
        estimate = middle(F)
        if not np.isfinite(estimate).all():
            return 0.0
        u = balls(np.linalg.svd(estimate)[2][:1].conj().T)
        return max(below(length((F * u).entries()) / length(u.entries())), 0.0)

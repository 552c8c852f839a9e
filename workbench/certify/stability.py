"""Stability of a system or a closed loop, proven by discs that contain its poles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, Array, RealArray
from workbench.certificate import THIS_SYSTEM, Check
from workbench.certify.eigenvalues import FEWEST_KEPT, Discs, pole_discs, separate_pole_discs
from workbench.certify.modes.modal_form import MODAL_FORMS, real_balls
from workbench.certify.rounding import TINY, exact
from workbench.systems.balancing import balancing, with_state_units
from workbench.systems.conversion import as_loop

SHARP_SHARE = 1e-5
"""The worst pole's disc is small enough if its radius is below this share of its distance from the
boundary: `verify` compares these distances to a part in 10^4. Half or double: discs of poles take a
little more or less work; ten times as much is more than `verify` allows.
"""


def stability_check(loop: Any) -> Check:
    """Check that all poles of a loop are proven to be stable.

    Stable poles lie left of the imaginary axis in continuous time, and within the unit circle in
    discrete time. The value is an upper bound of their distance beyond that boundary. The loop is
    any linear system of python-control; of a transfer function all its poles count.

    Examples
    --------
    >>> import control
    >>> from workbench.certify import stability_check
    >>> stability_check(control.ss(-1.0, 1.0, 1.0, 0.0)).holds
    True
    """
    loop = as_loop(loop)
    A = np.asarray(loop.A, dtype=float)
    if len(A) >= FEWEST_KEPT and np.isfinite(A).all():
        # scaled as for the loop's norm, which uses the same discs
        scaled = with_state_units(A, *map(np.asarray, (loop.B, loop.C, loop.D)))[0]
        value, worst = _bound_of(scaled, bool(loop.dt))
    else:
        value, worst = pole_bound(A, bool(loop.dt))
    where = "" if worst is None else f"at {worst:.6g}"
    statement = "largest real part of a pole [rad/s], negative"
    if loop.dt:
        statement = "largest modulus of a pole, less 1, negative"
    return Check(
        "internal stability", statement, value, -TINY, where=where, over=THIS_SYSTEM, proven=True
    )


def pole_bound(A: RealArray, sampled: bool) -> tuple[float, complex | None]:
    """Upper bound of the poles' distance beyond the stability boundary, and the worst pole.

    Doubles are tried first, with a small disc: they may prove that all poles of A (n, n) are stable
    or that one is not. Otherwise ball arithmetic is used, and after that each block of the block
    triangular form by itself.
    """
    if not np.isfinite(A).all():
        return np.nan, None
    with np.errstate(all="ignore"):  # entries near the largest double: no scale, and no proof
        scaled = balanced_states(A)[0]
    return _bound_of(scaled, sampled)


def is_proven_unstable(A: RealArray, sampled: bool) -> bool:
    """Whether a pole of A (n, n) is proven to lie beyond the stability boundary."""
    if not np.isfinite(A).all():
        return False
    with np.errstate(all="ignore"):
        for discs in _attempts(balanced_states(A)[0]):
            bound, _, decided = _worst(discs, sampled)
            if decided:
                return bound >= 0.0
    return False


def _bound_of(A: RealArray, sampled: bool) -> tuple[float, complex | None]:
    """As `pole_bound`, for a matrix whose states are scaled."""
    best: tuple[float, complex | None] = np.inf, None
    with np.errstate(all="ignore"):  # an infinite radius proves nothing
        for discs in _attempts(A):
            bound, worst, decided = _worst(discs, sampled)
            if decided:
                return bound, worst
            if bound < best[0] or best[1] is None:
                best = bound, worst
    return best


def _attempts(A: RealArray) -> Iterator[Discs]:
    """Discs that contain the poles of a matrix whose states are scaled, with increasing effort."""
    yield pole_discs(exact(A))
    states = [real_balls(part) for part in (A, A[:, :0], A[:0])]
    for form_of, bits in MODAL_FORMS:
        modal = form_of(states, bits)
        if modal is not None:
            yield pole_discs(modal[0])
    yield separate_pole_discs(exact(A))


def _worst(discs: Discs, sampled: bool) -> tuple[float, complex | None, bool]:
    """The farthest point of the discs beyond the boundary, its disc, and whether that decides.

    A disc that only just misses the boundary, or is wide compared with its distance, decides
    nothing: other arithmetic finds another disc.
    """
    if not len(discs.centre):
        return -np.inf, None, True
    size = np.abs(discs.centre) * (1 + 4 * EPS)
    distance = size - 1.0 if sampled else discs.centre.real
    farthest = distance + discs.radius
    place = int(np.argmax(farthest))
    bound = float(farthest[place])
    sharp = discs.radius[place] <= SHARP_SHARE * np.abs(distance[place])
    decided = bool(bound < 0 and sharp) or discs.proves_some(distance > discs.radius)
    return bound, complex(discs.centre[place]), decided


def balanced_states(A: RealArray) -> tuple[RealArray, Array]:
    """A with its states scaled by powers of two, and the factors (n,)."""
    scale = balancing(A, len(A))[0]
    return A * scale[:, None] / scale, scale

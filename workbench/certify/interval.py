"""The interval of frequencies on which given multipliers prove a bound of mu.

With t = w - omega, multipliers D(t) and G(t) that are constant or linear in t prove the bound beta
at all frequencies w at which

    Phi(w) = beta^2 D_r - M^H D_l M - j (G M - M^H G^H) > 0,   M = D + C (jw - A)^-1 B.

Phi(w) is the Schur complement of jw - A and its adjoint in

           [  A - jw      0       B ]
    L(w) = [   -Q     -A^H - jw  -S ],     [ Q    S ]   [ C  D ]^H [ -D_l      j G^H     ] [ C  D ]
           [   S^H       B^H      R ]      [ S^H  R ] = [ 0  1 ]   [ -j G   beta^2 D_r ] [ 0  1 ]

so that it is singular exactly where L is, because A has no eigenvalue on the axis. Where it is
positive at omega, it stays so up to the nearest such frequency. Fixed multipliers with regular R
leave an eigenvalue problem, of the Hamiltonian that eliminates the last row (Boyd, Balakrishnan,
Kabamba, A bisection method for computing the H-infinity norm of a transfer matrix, Math. Control
Signals Systems 2 (1989) 207-219); linear ones leave the pencil L(omega) + t L_1. In both cases
discs contain all eigenvalues, despite rounding, and no disc may touch the axis within the interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, Array
from workbench.certify.eigenvalues import (
    Discs,
    linear_discs,
    real_discs,
    touched,
)
from workbench.certify.hamiltonian import ball_discs
from workbench.certify.modes.real_eigenvalues import real_part
from workbench.certify.rounding import (
    Enclosure,
    exact,
    nearest_power_of_two,
    positive_definite,
    solution,
    stacked_enclosures,
)
from workbench.certify.stable_system import StableSystem, stable_system

END_MARGIN = 1e-3
"""Share of the distance to each end that an interval gives up, so that another machine, whose discs
differ a little, can prove the same interval. Half or double: intervals are longer or shorter by as
much.
"""

WORTHWHILE = 0.05
"""Better coordinates are searched for if they may lengthen an interval by at least this share; for
less, the search takes longer than a further interval. Half or double changes the time only.
"""

Multipliers = Sequence[Array]
"""D_left (c, c), D_right (r, r) and G (r, c)."""


def certified_interval(
    system: Any,
    D_left: Array,
    D_right: Array,
    G: Array,
    beta: float,
    omega: float,
    slopes: Multipliers | None = None,
    half: float = math.inf,
    end_margin: float = END_MARGIN,
) -> tuple[float, float] | None:
    """The interval of frequencies around `omega` on which the multipliers prove the bound `beta`.

    Parameters
    ----------
    system
        Stable continuous-time system with c outputs and r inputs.
    D_left, D_right, G
        Multipliers (c, c), (r, r), (r, c) at `omega` as `upper_bound` gives them.
    beta
        The bound, positive.
    omega
        Frequency [rad/s]; 0 and infinity are allowed.
    slopes
        Derivatives of the multipliers with respect to frequency [s], zero if None.
    half
        Largest distance [rad/s] of the ends from omega; it must be finite if there are slopes.
    end_margin
        Share of the distance to each end that is given up.

    Returns
    -------
    (low, high) within [0, inf], proven despite rounding; None where nothing is proven: D or Phi is
    not positive definite at `omega`, or rounding hides it.

    Raises
    ------
    InputError
        As `stable_system`.
    """
    system, multipliers = stable_system(system), (D_left, D_right, G)
    ends, doubt = proven_in_doubles(system, multipliers, beta, omega, slopes, half, end_margin)
    if doubt and ends is None and slopes is None:
        ends = proven_in_balls(system, multipliers, beta, omega, end_margin)
    return ends


def proven_in_doubles(
    system: StableSystem,
    multipliers: Multipliers,
    beta: float,
    omega: float,
    slopes: Multipliers | None = None,
    half: float = math.inf,
    end_margin: float = END_MARGIN,
) -> tuple[tuple[float, float] | None, bool]:
    """As `certified_interval` in doubles only, and whether rounding may hide a wider interval."""
    ends, doubt = _proven(system, multipliers, beta, omega, slopes, half, end_margin)
    modal = system.modal() if doubt else None
    if modal is not None:
        other, _ = _proven(modal, multipliers, beta, omega, slopes, half, end_margin)
        if ends is None or (other is not None and other[1] - other[0] > ends[1] - ends[0]):
            ends = other
    return ends, doubt


def proven_in_balls(
    system: StableSystem,
    multipliers: Multipliers,
    beta: float,
    omega: float,
    end_margin: float = 0.0,
) -> tuple[float, float] | None:
    """As `certified_interval` for fixed multipliers, in ball arithmetic."""
    if not all(positive_definite(exact(np.asarray(D))) for D in multipliers[:2]):
        return None
    discs = ball_discs(system, multipliers, beta, omega)
    if discs is None:
        return None
    below, above, _ = _nearest(discs, omega, math.inf)
    return _interval_about(below, above, omega, math.inf, end_margin)


def _proven(
    system: StableSystem,
    multipliers: Multipliers,
    beta: float,
    omega: float,
    slopes: Multipliers | None,
    half: float,
    end_margin: float,
) -> tuple[tuple[float, float] | None, bool]:
    """As `proven_in_doubles`, in one choice of coordinates."""
    form = _form(system, multipliers, slopes, beta)
    if form is None:
        return None, False
    holds, refuted = _holds_at(form, omega)
    if not holds:
        return None, not refuted
    # If omega is large, the ends themselves are rounded.
    within = half * (1 + 16 * EPS) + 4 * EPS * omega if half < math.inf else math.inf
    below, above, doubt = _reach(form, omega, within)
    if slopes is not None and not all(
        positive_definite(exact(D) + exact(change).times(t))
        for t in (-below, above)
        for D, change in zip(multipliers[:2], slopes[:2], strict=True)
    ):
        return None, False
    return _interval_about(below, above, omega, half, end_margin), doubt


def _interval_about(
    below: float, above: float, omega: float, half: float, end_margin: float
) -> tuple[float, float] | None:
    """The interval from `below` to `above` omega, reduced by the margin and rounded inward."""
    inward = 1 - max(end_margin, 8 * EPS)
    if math.isinf(omega):
        return (above * (2 - inward), math.inf) if above < math.inf else None
    down, up = (half if reach >= half else inward * reach for reach in (below, above))
    low, high = max(omega - down, 0.0), omega + up
    if omega - low > (1 - 4 * EPS) * below:
        low = math.nextafter(low, omega)
    if high - omega > (1 - 4 * EPS) * above:
        high = math.nextafter(high, omega)
    held = omega - low <= (1 - 4 * EPS) * below and high - omega <= (1 - 4 * EPS) * above
    return (low, high) if held and low < high else None


@dataclass(frozen=True, eq=False)
class _Form:
    """The realisation and two quadratic forms of (y, u), at omega and its slope over frequency, in
    scaled units.

    The second form is None for fixed multipliers.
    """

    A: Enclosure
    B: Enclosure
    C: Enclosure
    D: Enclosure
    fixed: Enclosure
    slope: Enclosure | None


def _form(
    system: StableSystem, multipliers: Multipliers, slopes: Multipliers | None, beta: float
) -> _Form | None:
    """The inequality in units in which M, D and beta are near 1; None if D is not positive."""
    D_left, D_right, G = (np.asarray(part) for part in multipliers)
    with np.errstate(all="ignore"):
        y, u = (nearest_power_of_two(np.sqrt(np.diagonal(D).real)) for D in (D_left, D_right))
        level = float(nearest_power_of_two(beta))
        twist = np.abs(G / level / u[:, None] / y)
        # A large G would hide the other terms in its rows.
        twisted = nearest_power_of_two(np.sqrt(1.0 + (twist**2).sum(axis=1)))
    if not all(positive_definite(exact(D)) for D in (D_left, D_right)):
        return None

    def form(D_left: Array, D_right: Array, G: Array) -> Enclosure:
        """The form (c + r, c + r) of given multipliers."""
        left = exact(D_left).scaled(1 / y, 1 / y)
        right = exact(D_right).scaled(1 / u, 1 / u).times(beta / level).times(beta / level)
        twist = exact(G).scaled(1 / u, 1 / y).scaled(np.full(len(u), 1 / level), np.ones(len(y)))
        right, twist = (
            right.scaled(1 / twisted, 1 / twisted),
            twist.scaled(1 / twisted, np.ones(len(y))),
        )
        twist = Enclosure(1j * twist.mid, twist.rad)
        return stacked_enclosures([[-left, -twist.H], [-twist, right]])

    A, B, C, D = system.enclosures
    ones, inputs = np.ones(len(A.mid)), 1 / u / twisted
    B, C, D = B.scaled(ones, inputs), C.scaled(y / level, ones), D.scaled(y / level, inputs)
    between = nearest_power_of_two(
        np.sqrt(np.abs(C.mid).max(initial=0.0)) / np.sqrt(np.abs(B.mid).max(initial=0.0) or 1.0)
    )
    B, C = B.scaled(ones * between, np.ones(len(u))), C.scaled(np.ones(len(y)), ones / between)
    found = _Form(A, B, C, D, form(D_left, D_right, G), None if slopes is None else form(*slopes))
    parts = (B, C, D, found.fixed, *([] if found.slope is None else [found.slope]))
    return found if all(part.finite for part in parts) else None


def _minus_j_omega(A: Enclosure, omega: float) -> Enclosure:
    """A - j omega."""
    return A - exact(1j * omega * np.eye(len(A.mid)))


def _holds_at(form: _Form, omega: float) -> tuple[bool, bool]:
    """Whether Phi(omega) > 0 is proven, and whether it is clearly false."""
    M = form.D
    if math.isfinite(omega) and len(form.A.mid):
        states = solution(_minus_j_omega(form.A, omega), form.B)
        if states is None:
            return False, False
        M = M - form.C @ states
    N = stacked_enclosures([[M], [exact(np.eye(form.B.mid.shape[1]))]])
    Phi = N.H @ (form.fixed @ N)
    if positive_definite(Phi):
        return True, False
    return False, bool((np.diagonal(Phi.mid).real < -np.diagonal(Phi.rad)).any()) or (
        Phi.finite and float(np.linalg.eigvalsh(Phi.mid)[0]) < -float(np.linalg.norm(Phi.rad))
    )


def _reach(form: _Form, omega: float, half: float) -> tuple[float, float, bool]:
    """Distances [rad/s] below and above omega, within half, where L is proven to be regular.

    For omega at infinity, the second number is the frequency above which L is regular. The third
    result says whether the disc that ends an interval is a large one.
    """
    slope = form.slope
    discs = _fixed_discs(form, omega) if slope is None else _linear_discs(form, slope, omega, half)
    return _nearest(discs, omega, half)


def _nearest(discs: Discs, omega: float, half: float) -> tuple[float, float, bool]:
    """As `_reach`, given discs that contain all frequencies at which L is singular."""
    doubt = discs.doubtful() > 0
    first, last = touched(discs)
    if math.isinf(omega):
        return 0.0, max(float(last.max(initial=0.0)), 0.0), doubt
    if ((first <= 0) & (last >= 0)).any():
        return 0.0, 0.0, doubt
    above, below = (_end_from_zero(*ends, half) for ends in ((first, last), (-last, -first)))
    doubt = doubt and (above[1] or below[1])
    return below[0], above[0], doubt


def _end_from_zero(first: Array, last: Array, half: float) -> tuple[float, bool]:
    """The end of an interval from 0 at the nearest disc, and whether a large disc shortens it.

    ``first`` and ``last`` are the ends of the discs on the axis. A disc shortens the interval if
    the nearest middle of a disc lies clearly beyond the nearest end.
    """
    ahead = first > 0
    first, last = first[ahead], last[ahead]
    end = float(first.min(initial=half))
    middle = float(np.minimum((first + last) / 2, half).min(initial=half))
    return end, middle > end * (1 + WORTHWHILE)


def _fixed_discs(form: _Form, omega: float) -> Discs:
    """Discs that contain all t, or all w for omega at infinity, at which L(w) is singular.

    The signal y = C x + D u and its product with the form replace Q, S and R: all blocks are then
    data, and no product of them is rounded.
    """
    n, r = form.B.mid.shape
    c = len(form.C.mid)
    A = form.A
    zero, wide, high = (exact(np.zeros((n, columns))) for columns in (n, c, r))
    minus, none = exact(-np.eye(c)), exact(np.zeros((c, c)))
    (yy, yu), (uy, uu) = _four_blocks(real_part(form.fixed), c)
    return real_discs(
        stacked_enclosures([[A, zero], [zero, -A.H]]),
        stacked_enclosures([[form.B, wide, wide], [high, wide, -form.C.H]]),
        stacked_enclosures([[high.H, form.B.H], [form.C, wide.H], [wide.H, wide.H]]),
        stacked_enclosures([[uu, uy, form.D.H], [form.D, minus, none], [yu, yy, minus]]),
        omega if math.isfinite(omega) else 0.0,
    )


def _linear_discs(form: _Form, slope: Enclosure, omega: float, half: float) -> Discs:
    """Discs that contain all t of size up to `half` at which L(omega + t) is singular."""
    n, r = form.B.mid.shape
    A = _minus_j_omega(form.A, omega)
    zero, high, one = exact(np.zeros((n, n))), exact(np.zeros((n, r))), exact(1j * np.eye(n))
    (Q, S), (_, R) = _form_of_outputs(form, form.fixed)
    L = stacked_enclosures([[A, zero, form.B], [-Q, -A.H, -S], [S.H, form.B.H, R]])
    (Q, S), (_, R) = _form_of_outputs(form, slope)
    L_1 = stacked_enclosures(
        [[one, zero, high], [Q, one, S], [-S.H, high.H, -R]]
    )  # L = L_0 - t L_1
    return linear_discs(L, L_1, half)


def _form_of_outputs(form: _Form, weight: Enclosure) -> list[list[Enclosure]]:
    """Q, S, S^H and R of a form in (y, u)."""
    n, r = form.B.mid.shape
    N = stacked_enclosures([[form.C, form.D], [exact(np.zeros((r, n))), exact(np.eye(r))]])
    return _four_blocks(N.H @ (weight @ N), n)


def _four_blocks(matrix: Enclosure, n: int) -> list[list[Enclosure]]:
    """The four blocks of a matrix, divided after its first n rows and columns."""
    parts = slice(None, n), slice(n, None)
    return [
        [Enclosure(matrix.mid[row, column], matrix.rad[row, column]) for column in parts]
        for row in parts
    ]

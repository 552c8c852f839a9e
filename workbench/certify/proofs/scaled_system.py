"""A bound of mu on nearly all frequencies at once, by scalings that are functions of frequency.

For every block b of Delta let d_b be a stable function with a stable inverse. Delta commutes with D
= diag(d_b), so that mu of M is at most the largest singular value of D M D^-1. One Hamiltonian
matrix shows at which frequencies this is below beta: at all of them, unless rounding hides some.
D-K iteration ends with such functions, and with a controller designed for this norm (Doyle,
Structured uncertainty in control system design, IEEE Conf. Decision and Control (1985) 260-265).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import EPS, Array, BoolArray, RealArray
from workbench.certify.interval import proven_in_doubles
from workbench.certify.modes.enclosed_realisation import with_balanced_states
from workbench.certify.rounding import TINY, UPWARD, Enclosure, exact, stacked_enclosures
from workbench.certify.stable_system import StableSystem, enclosed_system
from workbench.structure import Structure


@dataclass(frozen=True, eq=False)
class ScalingFunctions:
    """Functions d_b of the first blocks of a structure; those of the other blocks are 1.

    d_b(s) = gain prod (s^2 + n1 s + n0) / (s^2 + m1 s + m0), with ``gain`` (b,), ``numerators`` and
    ``denominators`` (b, sections, 2) of rows n1 [rad/s], n0 [rad^2/s^2]. All of them are positive,
    so that the function and its inverse are stable, exactly.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certify.proofs.scaled_system import ScalingFunctions
    >>> lag = ScalingFunctions(np.ones(1), np.array([[[8.0, 4.0]]]), np.array([[[2.0, 1.0]]]))
    >>> lag.fault(blocks=2), lag.magnitudes(0.0).tolist()
    ('', [4.0])
    """

    gain: RealArray
    numerators: RealArray
    denominators: RealArray

    def fault(self, blocks: int) -> str:
        """Why these are no scalings for a structure with this many blocks; an empty text if they
        are.
        """
        parts = self.gain, self.numerators, self.denominators
        count, sections = self.gain.size, self.numerators.size // max(2 * self.gain.size, 1)
        shapes = (count,), (count, sections, 2), (count, sections, 2)
        if count > blocks or tuple(part.shape for part in parts) != shapes:
            return f"the scalings have shapes {[part.shape for part in parts]}"
        if not all(np.isfinite(part).all() and (part > 0.0).all() for part in parts):
            return "the scalings are not stable functions with stable inverses"
        return ""

    def magnitudes(self, omega: float) -> RealArray:
        """|d_b| (b,) at a frequency [rad/s], infinity allowed."""
        if np.isinf(omega):
            return self.gain
        above, below = (
            np.hypot(part[..., 1] - omega**2, omega * part[..., 0]).prod(axis=1)
            for part in (self.numerators, self.denominators)
        )
        found: RealArray = self.gain * above / below
        return found

    def multipliers(self, structure: Structure, omega: float) -> tuple[Array, Array, Array]:
        """D_left (c, c), D_right (r, r) and G (r, c) at a frequency [rad/s]."""
        d = np.ones(len(structure))
        d[: len(self.gain)] = self.magnitudes(omega) ** 2
        left = np.repeat(d, [block.columns for block in structure])
        right = np.repeat(d, [block.rows for block in structure])
        return np.diag(left), np.diag(right), np.zeros((len(right), len(left)))


class _Filters(NamedTuple):
    """Filters of some signals, side by side: x' = A x + E u, y = u + c x.

    State k belongs to signal ``signal[k]``: E (states, signals) has a 1 there or is zero, and c (1,
    states) has one entry for each state.
    """

    A: Enclosure
    enters: BoolArray
    c: Enclosure
    signal: NDArray[np.intp]

    @classmethod
    def of(cls, above: RealArray, below: RealArray, signal: NDArray[np.intp]) -> _Filters:
        """prod (s^2 + n1 s + n0) / (s^2 + m1 s + m0) of each signal (q,).

        ``above`` and ``below`` (q, sections, 2) hold n1, n0 and m1, m0. The output of a section
        enters all those after it.
        """
        q, sections, _ = above.shape
        # States are scaled by a power of two near their own frequency.
        unit = np.exp2(np.round(np.log2(below[..., 1]) / 2))
        c = np.stack([(above[..., 1] - below[..., 1]) / unit, above[..., 0] - below[..., 0]], -1)
        A = np.zeros((q, sections, 2, q, sections, 2))
        error = np.zeros_like(A)
        for k in range(q):
            for at in range(sections):
                A[k, at, 1, k, :at], error[k, at, 1, k, :at] = c[k, :at], EPS * np.abs(c[k, :at])
                A[k, at, 0, k, at, 1] = unit[k, at]
                A[k, at, 1, k, at] = -below[k, at, 1] / unit[k, at], -below[k, at, 0]
        n, flat = 2 * q * sections, c.reshape(1, -1)
        return cls(
            Enclosure(A.reshape(n, n), error.reshape(n, n) * UPWARD),
            np.tile([False, True], q * sections),
            Enclosure(flat, EPS * np.abs(flat) * UPWARD),
            np.repeat(signal, 2 * sections),
        )

    def before(self, matrix: Enclosure) -> Enclosure:
        """The matrix (rows, signals) times c: the contribution of each state to the rows."""
        size, error = np.abs(matrix.mid)[:, self.signal], matrix.rad[:, self.signal]
        c = np.abs(self.c.mid)
        rad = EPS * size * c + error * c + (size + error) * self.c.rad + TINY
        return Enclosure(matrix.mid[:, self.signal] * self.c.mid, rad * UPWARD)

    def after(self, matrix: Enclosure) -> Enclosure:
        """E times the matrix (signals, columns): the input of each state."""
        mid, rad = (
            np.where(self.enters[:, None], part[self.signal], 0.0)
            for part in (matrix.mid, matrix.rad)
        )
        return Enclosure(mid, rad)


def scaled_system(
    system: StableSystem, structure: Structure, scalings: ScalingFunctions
) -> StableSystem:
    """The system D M D^-1 for a stable M; the scalings must have no fault.

    No two large numbers are added, so that its poles are nearly as accurate as those of M.
    """
    A, B, C, D = system.enclosures
    outputs, inputs = (
        np.repeat(np.arange(len(structure)), [getattr(block, side) for block in structure])
        for side in ("columns", "rows")
    )
    count, (above, below) = len(scalings.gain), (scalings.numerators, scalings.denominators)
    place = outputs[outputs < count]
    left = _Filters.of(above[place], below[place], np.arange(len(place)))
    place = inputs[inputs < count]
    right = _Filters.of(below[place], above[place], np.arange(len(place)))
    through = right.before(D)
    n = [len(part.mid) for part in (left.A, A, right.A)]

    def nothing(row: int, column: int) -> Enclosure:
        return exact(np.zeros((n[row], n[column])))

    whole = stacked_enclosures(
        [
            [left.A, left.after(C), left.after(through)],
            [nothing(1, 0), A, right.before(B)],
            [nothing(2, 0), nothing(2, 1), right.A],
        ]
    )
    into = stacked_enclosures([[left.after(D)], [B], [right.after(exact(np.eye(len(inputs))))]])
    out = stacked_enclosures([[left.before(exact(np.eye(len(outputs)))), C, through]])
    gain = np.ones(len(structure))
    gain[:count] = scalings.gain
    into, D = (part.times(1.0 / gain[inputs]) for part in (into, D))
    into, D = (Enclosure(p.mid, p.rad + EPS * np.abs(p.mid) * UPWARD) for p in (into, D))
    out, D = (part.times(gain[outputs][:, None]) for part in (out, D))
    poles = np.linalg.eigvals(whole.mid).astype(complex)
    return enclosed_system(with_balanced_states(whole, into, out), D, poles)


def scaled_interval(
    system: StableSystem, structure: Structure, scalings: ScalingFunctions, beta: float
) -> tuple[float, float] | None:
    """The interval of frequencies [rad/s] on which scalings prove that mu is at most beta.

    The interval lies around the scale of the poles. It ends before 0 or infinity only where the
    scalings do not prove the bound there, or rounding hides it. None if nothing is proven.

    Parameters
    ----------
    system
        Stable system with c outputs and r inputs that fits the structure.
    structure
        Blocks of Delta.
    scalings
        Scalings of the first blocks, without a `fault`.
    beta
        The bound.
    """
    scaled = scaled_system(system, structure, scalings)
    if not all(part.finite for part in scaled.enclosures):
        return None
    c, r = scaled.D.shape
    ones = np.eye(c), np.eye(r), np.zeros((r, c))
    return proven_in_doubles(scaled, ones, beta, scaled.scale)[0]

"""Balancing: realisations and matrices scaled so that their entries have similar sizes."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import EPS, Array, RealArray


def balanced(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """A, B and C with the states scaled so that the entries have similar sizes."""
    factor = state_units(A, B, C)
    return A * factor[:, None] / factor, B * factor[:, None], C / factor


def with_state_units(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """A, B, C and D with states scaled by powers of two that regard D's entries too."""
    n = len(A)
    scale = balancing(np.block([[A, B], [C, D]]), n)[0][:n]
    return A * scale[:, None] / scale, B * scale[:, None], C / scale, D


def state_units(A: RealArray, B: RealArray, C: RealArray) -> RealArray:
    """Factors (n,), powers of two, by which the states are multiplied to balance a realisation."""
    M = np.block([[A, B], [C, np.zeros((len(C), B.shape[1]))]])
    return balancing(M, len(A))[0][: len(A)]


ZERO = 100.0
"""A product of matrices counts as zero up to this multiple of its rounding error."""


def speed(A: RealArray, B: RealArray, C: RealArray) -> float:
    """A frequency [rad/s], a power of two, that serves as the unit of time; 1 if there is none.

    It is the median size of the poles other than integrators. If all poles are integrators, their
    computed eigenvalues are rounding, and the frequency comes from the gain: the response is nearly
    h / s^k at high frequencies.
    """
    n = len(A)
    if not n:
        return 1.0
    size = np.sort(np.abs(np.linalg.eigvals(A)))
    by_gain = _speed_of_integrators(A, B, C)
    # In a unit of time that is far off, as for a large gain, poles may look like 0, and the units
    # of the states may hide some.
    alone = _integrators(A) == n and _integrators(_in_units(A, B, C, by_gain)) == n
    if alone or not size[-1] or _nilpotent(A):
        return by_gain
    rest = size[min(_integrators(_in_units(A, B, C, size[-1])), n - 1) :]
    return _power_of_two(float(np.median(rest[rest > 1e-8 * size[-1]])))


def _in_units(A: RealArray, B: RealArray, C: RealArray, rate: float) -> RealArray:
    """A with time measured in units of 1 / rate, and with its states balanced."""
    return balanced(A / rate, B / rate, C)[0]


def _integrators(A: RealArray) -> int:
    """Number of poles that are 0 up to rounding of the matrix."""
    return null_states_first(A, axis_rounding(A))[2]


AXIS_ROUNDING = 100.0
"""Multiple of a matrix's rounding error, its states balanced, up to which
a pole lies on the axis."""


def axis_rounding(A: RealArray) -> float:
    """Largest change of A (n, n), with balanced states, that counts as rounding of its poles."""
    return AXIS_ROUNDING * EPS * len(A) * float(np.linalg.norm(A))


def null_states_first(A: RealArray, small: float) -> tuple[RealArray, RealArray, int]:
    """Q, Q^T A Q and the number k of poles at 0, found from ranks.

    The first k columns of Q^T A Q have nonzero entries only above the diagonal. Singular values up
    to `small` count as 0.
    """
    n = len(A)
    Q, T, k = np.eye(n), A.copy(), 0
    while k < n:
        _, values, Vh = np.linalg.svd(T[k:, k:])
        null = int((values <= small).sum())
        if not null:
            break
        V = block_diag(np.eye(k), Vh[::-1].T)
        Q, T = Q @ V, V.T @ T @ V
        T[k:, k : k + null] = 0.0
        k += null
    return Q, T, k


def poles_at_zero(poles: Array) -> int:
    """Number of poles (n,) that are 0 up to rounding, in a unit of time in which the others are not
    small.

    Rounding splits a repeated pole at 0 into poles of the size of a root of the rounding error.
    Together they are the roots of a polynomial whose lower coefficients are rounding errors.
    """
    rising = poles[np.argsort(np.abs(poles))]
    for k in range(len(rising), 0, -1):
        if (np.abs(np.poly(rising[:k])[1:]) <= ZERO * len(rising) * EPS).all():
            return k
    return 0


def _nilpotent(A: RealArray) -> bool:
    """Whether a power of A is 0 up to the rounding of its entries."""
    power, bound = np.eye(len(A)), np.eye(len(A))
    for _ in A:
        power, bound, _ = _within_doubles(power @ A, bound @ np.abs(A))
        if (np.abs(power) <= ZERO * len(A) * EPS * bound).all():
            return True
    return False


def _speed_of_integrators(A: RealArray, B: RealArray, C: RealArray) -> float:
    """h^(1/k), where h is the largest entry of the first C A^(k-1) B that is not 0."""
    units = [float(np.frexp(np.abs(part).max(initial=0.0))[1]) for part in (A, B, C)]
    A, B, C = (np.ldexp(part, -int(unit)) for part, unit in zip((A, B, C), units, strict=True))
    rows, bound, taken = C, np.abs(C), units[1] + units[2]
    for k in range(1, len(A) + 1):
        h = np.abs(rows @ B)
        h = h[h > ZERO * len(A) * EPS * (bound @ np.abs(B))]
        if h.size:
            return float(np.exp2(np.round((np.log2(h.max()) + taken) / k)))
        rows, bound, exponent = _within_doubles(rows @ A, bound @ np.abs(A))
        taken += exponent + units[0]
    return 1.0


def _within_doubles(product: RealArray, bound: RealArray) -> tuple[RealArray, RealArray, float]:
    """Both matrices divided by a power of two near the largest bound, and its exponent.

    Without this, the powers of a matrix of many states would leave the range of doubles.
    """
    largest = float(bound.max(initial=0.0))
    exponent = float(np.floor(np.log2(largest))) if largest > 0.0 else 0.0
    return np.ldexp(product, -int(exponent)), np.ldexp(bound, -int(exponent)), exponent


def _power_of_two(size: float) -> float:
    return float(np.exp2(np.round(np.log2(size))))


FAR = 2.0**200
"""Entries beyond this size, or below its reciprocal, have squares whose quotients may overflow."""
FARTHEST = 1000.0
"""Largest exponent of two of a factor; factors of block triangular matrices would grow without
end.
"""


def balancing(M: Array, channels: int) -> tuple[Array, Array]:
    """Factors of the rows and of the columns of M that bring its entries to similar sizes.

    The factor of each of the first `channels` columns is the reciprocal of the factor of the same
    row, as in a change of coordinates; the other factors are free. All factors are powers of two,
    so that scaling causes no rounding (Osborne 1960).
    """
    size: RealArray = np.abs(M)
    known = size[size > 0.0]
    if known.size and not (known.min() > 1 / FAR and known.max() < FAR):
        # The factors for square roots of the entries are the square roots of the factors.
        roots = _balancing(size**0.125, channels)
        rows, columns = (np.exp2(np.clip(8 * np.log2(part), -FARTHEST, FARTHEST)) for part in roots)
        # Entries on the diagonal do not change.
        inner, outer = _balancing(np.minimum(_scaled(size, rows, columns), FAR), channels)
        rows, columns = (
            np.exp2(np.clip(np.log2(one) + np.log2(other), -FARTHEST, FARTHEST))
            for one, other in ((rows, inner), (columns, outer))
        )
        return rows, columns
    return _balancing(size, channels)


def _scaled(size: RealArray, rows: RealArray, columns: RealArray) -> RealArray:
    """Entries times the factors of their row and column; the factors' product alone may
    overflow.
    """
    with np.errstate(divide="ignore"):
        exponent = np.log2(size) + np.log2(rows)[:, None] + np.log2(columns)
    found: RealArray = np.where(size > 0.0, np.exp2(np.clip(exponent, -FARTHEST, FARTHEST)), 0.0)
    return found


def _balancing(size: RealArray, channels: int) -> tuple[Array, Array]:
    """As `balancing`, for the sizes of entries whose squares neither overflow nor underflow."""
    # Computed with squares, which norms of rows and columns are sums of: a step is two products
    # with vectors.
    square = size**2
    rows, columns = np.ones(size.shape[0]), np.ones(size.shape[1])
    for _ in range(50):
        into, out = rows * (square @ columns), columns * (rows @ square)
        into[into == 0.0], out[out == 0.0] = 1.0, 1.0
        # All factors change at once, so each makes half of the change that it would make alone.
        inner = np.sqrt(np.sqrt(into[:channels] / out[:channels]))
        rows[:channels] /= inner
        columns[:channels] *= inner
        rows[channels:] /= np.sqrt(into[channels:])
        columns[channels:] /= np.sqrt(out[channels:])
    rows, columns = (np.exp2(np.round(np.log2(factors) / 2)) for factors in (rows, columns))
    columns[:channels] = 1.0 / rows[:channels]
    return rows, columns


def singular(a: Array) -> bool:
    """Whether a square matrix is singular up to rounding, in any units of rows and columns.

    The spectral radius of |a^-1| |a| is the condition number for changes of each entry by a share
    of its size. It does not depend on these units.
    """
    if not a.size:
        return False
    if not np.isfinite(a).all():
        return True
    rows, columns = balancing(a, 0)
    scaled = rows[:, None] * a * columns
    try:
        growth = np.abs(np.linalg.inv(scaled)) @ np.abs(scaled)
    except np.linalg.LinAlgError:
        return True
    return not np.abs(np.linalg.eigvals(growth)).max() < 1e14 if np.isfinite(growth).all() else True

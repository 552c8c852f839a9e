"""Lower bound of leakage and noise of every stable fault filter, on the nominal plant.

T = F S may be any stable function, T = sum t_k z^k with z = (a - s) / (a + s). Suppose |W T - V| <=
1 at all frequencies. Then the lower triangular Toeplitz matrix of the first n coefficients of W T -
V has norm at most 1, whatever the later coefficients are. So it maps every unit vector to one of
norm at most 1; and the noise is at least that of the first n coefficients. The least E + 3 rms over
t_0 to t_(n-1) under finitely many such vector constraints is therefore a bound. The most violated
vectors are added in turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import toeplitz

from workbench._core.arrays import RealArray
from workbench.diagnosis.estimation.fault_loop import EstimationDemands
from workbench.diagnosis.estimation.front_program import solve_in_place
from workbench.errors import SolverError
from workbench.input_checks import need_positive

COEFFICIENTS = 64
"""Default number of coefficients t_k that are variables; more of them raise the bound."""
CIRCLE = 2**14
"""Number of points on the unit circle at which the modulus of a weight is sampled."""
WEIGHT_FLOOR = 1e-2
"""Value, in the unit of the demands, of a weight that should be zero in a band: outer functions
have no zeros. The amount that this adds to the bound is subtracted again.
"""
FIRST_VECTORS = 24
"""Number of windowed waves, one for each frequency, that state each limit in the first program."""
MOST_CUT_ROUNDS = 25
"""Largest number of programs that are solved; each adds the most violated vectors."""
CUTS = 3
"""Most vectors that are added for each limit in a round."""
LIMIT_EXCESS = 0.02
"""The rounds end when each limit's norm exceeds its bound by at most this fraction; the lower bound
is valid at any time.
"""
SOLVER_MARGIN = 1e-4
"""Relative amount by which the bound is lowered, for the solver's accuracy."""


@dataclass(frozen=True, eq=False)
class ToeplitzLimit:
    """|W T - V| <= 1, or <= E in the demands' unit: Toeplitz matrices (n, n) of W and of V."""

    W: RealArray
    V: RealArray
    leaks: bool


def least_total_error(
    demands: EstimationDemands, error: float, corner: float, *, coefficients: int = COEFFICIENTS
) -> float:
    """Lower bound on E + 3 rms for all stable filters with this relative error, nominal plant.

    It is in the unit of the fault and holds for any plant and controller of a continuous loop.

    Parameters
    ----------
    demands
        Demands on the estimate of the fault.
    error
        Relative error allowed from demands.error_above on.
    corner
        Corner a [rad/s] of z, near the frequencies of the demands.
    coefficients
        Number of coefficients t_k.

    Raises
    ------
    InputError
        Error or corner is not positive.
    SolverError
        The solver fails.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import EstimationDemands, least_total_error
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> bound = least_total_error(demands, error=0.5, corner=1.0, coefficients=16)
    >>> bool(0 < bound < 3e-3)
    True
    """
    import cvxpy as cp

    need_positive(error, "error")
    need_positive(corner, "corner")
    most = demands.gain

    theta = 2 * np.pi * (np.arange(CIRCLE) + 0.5) / CIRCLE
    omega = corner * np.abs(np.tan(theta / 2))
    f = omega / 2 / np.pi
    disturbance = demands.disturbance_size(omega) / demands.unit
    everywhere = _lower(_outer(np.full(CIRCLE, 1 / most), coefficients))
    relative = _lower(
        _outer(np.where(f >= demands.error_above_hz, 1 / error, 1 / (1 + most)), coefficients)
    )
    leaking = _lower(
        _outer(np.where(f <= demands.leakage_below_hz, disturbance, WEIGHT_FLOOR), coefficients)
    )
    limits = [
        ToeplitzLimit(everywhere, 0 * everywhere, False),
        ToeplitzLimit(relative, relative, False),
        ToeplitzLimit(leaking, 0 * leaking, True),
    ]
    N, lost = _noise(demands, corner, coefficients, theta, f)
    t, E, rms = cp.Variable(coefficients), cp.Variable(nonneg=True), cp.Variable(nonneg=True)
    held: list[Any] = [cp.norm(N @ t) <= rms, most * WEIGHT_FLOOR <= E]
    waves = [_wave(angle, coefficients) for angle in np.linspace(0.0, np.pi, FIRST_VECTORS)]
    held += [_limit_along(limit, v, t, E) for limit in limits for v in waves]
    best = 0.0
    for _ in range(MOST_CUT_ROUNDS):
        problem = cp.Problem(cp.Minimize(E + 3 * rms), held)
        said = solve_in_place(problem)
        if t.value is None:
            raise SolverError(f"the bound of a relative error of {error:g}: {said}")
        best = max(best, float(problem.value) * (1 - SOLVER_MARGIN))
        worst = 0.0
        for limit in limits:
            level = float(E.value) if limit.leaks else 1.0
            _, sizes, right = np.linalg.svd(limit.W @ _lower(t.value) - limit.V)
            worst = max(worst, sizes[0] / level - 1)
            held += [_limit_along(limit, right[k], t, E) for k in range(CUTS) if sizes[k] > level]
        if worst < LIMIT_EXCESS:
            break
    # A filter whose leakage is below the least E allowed counts as if it leaked that E.
    return max(best - most * WEIGHT_FLOOR - 3 * lost, 0.0) * demands.unit


def _lower(column: Any) -> Any:
    """The lower triangular Toeplitz matrix of coefficients."""
    return toeplitz(column, np.zeros(len(column)))


def _outer(modulus: RealArray, count: int) -> RealArray:
    """The first coefficients (count,) of the outer function with a modulus on the circle."""
    log = np.fft.fft(np.log(modulus)) / len(modulus)
    # The sample points lie half a step beside theta = 0.
    k = np.arange(count)
    d = (log[:count] * np.exp(-1j * np.pi * k / len(modulus))).real * np.where(k, 2.0, 1.0)
    w = np.zeros(count)
    w[0] = np.exp(d[0])
    for n in range(1, count):
        w[n] = (k[1 : n + 1] * d[1 : n + 1] * w[n - 1 :: -1][:n]).sum() / n
    return w


def _noise(
    demands: EstimationDemands, corner: float, count: int, theta: RealArray, f: RealArray
) -> tuple[RealArray, float]:
    """Toeplitz matrix of the noise's weight in the demands' unit, and the floor's contribution."""
    size = demands.noise / demands.unit
    density = (
        np.pi * size**2 / demands.noise_band_hz * corner / (4 * np.pi) / np.cos(theta / 2) ** 2
    )
    outside = f > demands.noise_band_hz
    floor = WEIGHT_FLOOR**2 * density[~outside].max()
    lost = demands.gain * np.sqrt(floor * outside.mean())
    return _lower(_outer(np.sqrt(np.where(outside, floor, density)), count)), float(lost)


def _wave(angle: float, count: int) -> Any:
    k = np.arange(count)
    window = np.sin(np.pi * (k + 0.5) / count)
    v = window * np.exp(1j * angle * k)
    return v / np.linalg.norm(v)


def _limit_along(limit: ToeplitzLimit, v: Any, t: Any, E: Any) -> Any:
    """||(W T - V) v|| <= 1 or E, T v = Toeplitz(v) t."""
    import cvxpy as cp

    A, b = limit.W @ _lower(v), limit.V @ v
    rows, offset = np.vstack([A.real, A.imag]), np.concatenate([b.real, b.imag])
    return cp.norm(rows @ t - offset) <= (E if limit.leaks else 1.0)

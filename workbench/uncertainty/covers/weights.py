"""Weights of an uncertainty model from its sets; containment holds by construction.

The real weight is fitted first, in magnitude and phase. The complex weight compensates for the
errors of that fit: at every frequency its magnitude covers the largest distance of a deviation from
the fitted segment. (In section 5.4.4 of the thesis the two are fitted separately, without
guarantee.)
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.coverage import least_margin
from workbench.fitting.magnitude.gain import COVER_GAIN_MARGIN
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import Stadium
from workbench.program import Program
from workbench.solution import solve

MIN_RADIUS_SHARE = 1e-3
"""Smallest radius of a fitted set, relative to its extent; thinner sets would be lines. With half
of it weights follow such sets to smaller radii, at frequencies that matter little; with double of
it sets are up to 0.1 % of their extent wider.
"""
MIN_POLE_DISTANCE = 1e-5
"""Smallest distance of poles from the imaginary axis, relative to the lowest frequency. The
response changes by that share at the lowest frequency. Half or double changes a sixth digit there;
0 would leave integrators, which no weight may have.
"""
MIN_POLE_DAMPING = 1e-7
"""Smallest damping ratio of poles. The realisation's poles are known to 1e-13 or so, and must lie
left of the axis. Half or double moves poles that no data determine.
"""
REACH = 1e4
"""Farthest root that a search leaves, relative to the highest frequency, and inverse of the nearest
one, relative to the lowest. There a root changes the response by 1e-4. Half or double moves roots
that change a response by 1e-4.
"""
CONSTANT_DECADES = 2
"""Number of decades below and above the given frequencies in which weights stay constant. A weight
without them may vanish or grow where nothing is known; farther out its roots decide by themselves.
Half leaves one decade; double fits farther than a weight of low order can follow.
"""
SUFFICIENT_DAMPING = 0.1
"""A pole with a damping ratio above this needs no more damping, even for coarse frequencies. A peak
that wide is seen at steps of log omega of 0.2. With half of it coarse frequencies may miss a peak;
with double of it weights are flatter than they need be.
"""
LARGEST_LOG_STEP = 0.02
"""Largest step of log omega in the fit of a cover, so that no resonance lies between the
frequencies. It resolves a damping of 0.01. With half of it fits take twice as long; with double of
it peaks between frequencies raise the gain at the end.
"""
MAX_GAIN_RAISES = 20
"""Largest number of increases of a weight's gain until it covers. Each leaves a rounding, or a peak
between frequencies, and they end once the weight covers. With half of them a hard cover may end in
the error; double takes longer to get there.
"""
MIN_RELATIVE_SIZE = 1e-6
"""Smallest size of a set in the weighting of a fit, relative to the largest set. A set of no size
would else have all the weight. Half or double changes the weight of sets that small only.
"""
HALF_LENGTH_SHARE = 2.0
"""Factor of a stadium's half-length in its size, which weights the errors of a fit. A stadium is
longer by twice its half-length than it is wide. With half of it, radii of long sets are fitted more
closely than they matter; with double of it, their half-lengths are.
"""


def fitted(program: Program, context: Context) -> Rational:
    """The answer of a fit, which must have a valid certificate.

    Raises
    ------
    SolverError
        There is no answer, or its certificate is not valid.
    """
    solution = solve(program, options=context.options)
    if solution.answer is None or not solution.certificate or not solution.certificate.valid:
        failures = "; ".join(solution.certificate.failures) if solution.certificate else ""
        raise SolverError(f"{type(program).__name__}: {failures or solution.message}")
    return solution.answer


def complex_weight(
    omega: RealArray, radius: RealArray, weight: RealArray, order: int, context: Context
) -> Rational:
    """Complex weight W_c (eq. 5.2, 5.15) that covers radii (F,) at and between the frequencies.

    ``weight`` (F,) weights the excess relative to the radius.
    """
    grid, magnitude, counts = _resolved_sizes(omega, radius, weight)
    fit = fitted(MagnitudeFit(grid, magnitude, order, weight=counts, cover=True), context)
    return reaching(fit, omega, radius)


def reaching(function: Rational, omega: RealArray, radius: RealArray) -> Rational:
    """The function, times a gain with which it covers radii (F,) at, between and beyond the
    frequencies.
    """
    grid, magnitude = _resolved_sizes(omega, radius)
    return raised(resolved(function, grid[CONSTANT_DECADES:-CONSTANT_DECADES]), grid, magnitude)


def _resolved_sizes(omega: RealArray, *sizes: RealArray) -> list[RealArray]:
    """Refined frequencies that extend beyond the given ones, and sizes (F,) there."""
    fine = np.unique(np.concatenate([omega, between(omega)]))
    log, logs = np.log(fine), np.log(omega)
    return [beyond(fine), *(lasting(np.exp(np.interp(log, logs, np.log(v)))) for v in sizes)]


def share_of_size(radius: RealArray, extent: RealArray) -> RealArray:
    """Ratio (F,) of the radius to the size of a set, the weight of an excess of the radius.

    It is 1 for circles. For stadiums the size is the radius plus HALF_LENGTH_SHARE times the part
    of the extent beyond the radius, since a long set may be almost a line at frequencies where a
    weight of low order cannot follow it.
    """
    return radius / (radius + HALF_LENGTH_SHARE * (extent - radius))


def between(omega: RealArray, step: float = LARGEST_LOG_STEP) -> RealArray:
    """Frequencies between the given ones (F,), so that log omega increases by at most ``step``."""
    log, gaps = np.log(omega), np.diff(np.log(omega))
    inside = np.maximum(np.ceil(gaps / step).astype(int) - 1, 0)
    first = np.repeat(np.cumsum(inside) - inside, inside)
    share = (np.arange(inside.sum()) - first + 1) / np.repeat(inside + 1, inside)
    found: RealArray = np.exp(np.repeat(log[:-1], inside) + share * np.repeat(gaps, inside))
    return found


def raised(function: Rational, omega: RealArray, magnitude: RealArray) -> Rational:
    """The function with its gain raised until it covers magnitudes (F,), also between the
    frequencies.

    Raises
    ------
    SolverError
        It still does not cover them after MAX_GAIN_RAISES increases.
    """
    for _ in range(MAX_GAIN_RAISES):
        margin, _ = least_margin(omega, magnitude, function)
        if margin >= 0:
            return function
        gain = function.gain * np.exp(-margin) * (1 + COVER_GAIN_MARGIN)
        function = Rational(function.zeros, function.poles, gain)
    raise SolverError(f"the weight still misses its cover by {-margin:.3g}, relative")


def real_weight(
    omega: RealArray, sets: Stadium, order: int, minimum_phase: bool, context: Context
) -> Rational:
    """Real weight W_r (eq. 5.15), fitted to segments half_length * exp(j angle) as complex numbers.

    Each segment has two ends; the end whose angle changes less along frequency is taken. An error
    of the fit widens the set by the same amount, so it is weighted like the excess of a cover.
    """
    end = unwrapped(sets.half_length * np.exp(1j * sets.angle))
    size = sets.radius + HALF_LENGTH_SHARE * sets.half_length
    weight = 1 / np.maximum(size, MIN_RELATIVE_SIZE * (size.max() or 1.0))
    return fitted(held(omega, end, weight, order, minimum_phase), context)


def held(
    omega: RealArray, end: ComplexArray, weight: RealArray, order: int, minimum_phase: bool
) -> ResponseFit:
    """Fit of a weight to ends of segments (F,), with real constants outside the frequencies."""
    ends = lasting(end)
    for part in (slice(CONSTANT_DECADES), slice(-CONSTANT_DECADES, None)):
        ends[part] = np.copysign(np.abs(ends[part]), ends[part].real)
    return ResponseFit(
        beyond(omega), ends, order, weight=lasting(weight), minimum_phase=minimum_phase
    )


def beyond(omega: RealArray) -> RealArray:
    """Frequencies (F,) with some decades added on either side, (F + 2 * CONSTANT_DECADES,)."""
    decades = 10.0 ** np.arange(1, CONSTANT_DECADES + 1)
    return np.concatenate([omega[0] / decades[::-1], omega, omega[-1] * decades])


def lasting(values: np.ndarray) -> np.ndarray:
    """Values (F,) continued as constants at the frequencies of `beyond`.

    Otherwise a weight could vanish or grow without limit where no response is known, for example at
    zero frequency.
    """
    return np.pad(values, CONSTANT_DECADES, mode="edge")


def unwrapped(end: ComplexArray) -> ComplexArray:
    """Ends (F,) of segments through 0; where the angle would change by more than pi/2, the opposite
    end is used.
    """
    steps = (end[1:] * end[:-1].conj()).real < 0
    sign = np.concatenate([[1.0], np.where(steps, -1.0, 1.0)]).cumprod()
    ends: ComplexArray = end * sign
    return ends


def damped(function: Rational, omega: RealArray) -> Rational:
    """The function with poles far enough left that its realisation is stable too.

    A fit may place poles very near the imaginary axis, as integrators or between the frequencies,
    where the data do not determine their distance from the axis.
    """
    return _left_by(
        np.maximum(MIN_POLE_DISTANCE * omega[0], MIN_POLE_DAMPING * np.abs(function.poles)),
        function,
    )


def resolved(function: Rational, omega: RealArray) -> Rational:
    """The function with enough damping that no resonance lies between the frequencies.

    The damping ratio of each pole becomes at least half the relative distance of the frequencies
    around it; the data do not show a narrower peak.
    """
    log = np.log(omega)
    size = np.abs(function.poles)
    around = np.interp(np.log(np.maximum(size, omega[0])), (log[1:] + log[:-1]) / 2, np.diff(log))
    return _left_by(np.minimum(around / 2, SUFFICIENT_DAMPING) * size, function)


def roots_within_reach(function: Rational, lowest: float, highest: float) -> Rational:
    """The function with no root far outside two frequencies [rad/s], and the same response between
    them. Roots at 0 stay.

    A search may move a root without limit where it has no effect. Beside a very fast pole, rounding
    hides the slow ones.
    """

    def moved(roots: ComplexArray) -> RealArray:
        """Factors of the roots."""
        size = np.where(roots == 0.0, highest, np.abs(roots))
        return np.clip(size, lowest / REACH, highest * REACH) / size

    def shrunk(factors: RealArray) -> float:
        """Sum of the logarithms of those factors that move roots nearer."""
        return float(np.log(np.minimum(factors, 1.0)).sum())

    zeros, poles = moved(function.zeros), moved(function.poles)
    gain = function.gain * np.exp(shrunk(poles) - shrunk(zeros))
    return Rational(function.zeros * zeros, function.poles * poles, gain)


def _left_by(distance: RealArray, function: Rational) -> Rational:
    """The function with every pole at least `distance` from the axis, on the same side as
    before.
    """
    poles = function.poles.copy()
    right = poles.real > 0
    poles.real = np.where(
        right, np.maximum(poles.real, distance), np.minimum(poles.real, -distance)
    )
    return Rational(function.zeros, poles, function.gain)


def needed_radius(away: ComplexArray, end: ComplexArray | None) -> RealArray:
    """Largest distance (F,) of deviations (F, N) from segments -end..end (F,), or from 0."""
    extent = np.abs(away).max(axis=1)
    if end is None:
        return extent
    return np.maximum(segment_distances(away, end).max(axis=1), MIN_RADIUS_SHARE * extent)


def segment_distances(away: ComplexArray, end: ComplexArray) -> RealArray:
    """Distances (F, N) of deviations (F, N) from segments -end..end (F,)."""
    square = np.maximum(np.abs(end) ** 2, np.finfo(float).tiny)
    along = np.clip((away * end.conj()[:, None]).real / square[:, None], -1, 1)
    found: RealArray = np.abs(away - along * end[:, None])
    return found

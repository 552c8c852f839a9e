"""Weights of an uncertainty model from its sets, with containment by construction.

The real weight is fitted first, in magnitude and phase. Whatever it misses, the complex weight
takes up: its magnitude covers, at every frequency, the largest distance of a deviation from the
fitted segment (thesis, section 5.4.4, where the two are fitted apart and nothing is guaranteed).
"""

from __future__ import annotations

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.coverage import least_margin
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import Stadium
from workbench.program import Program, solve

THIN = 1e-3
"""Least width of a fitted set, relative to its whole size: what is thinner is a line."""
SLOW = 1e-5
"""Least distance of poles from the imaginary axis, relative to the lowest frequency."""
UNDAMPED = 1e-7
"""Least damping of poles."""
DECADES = 2
"""Decades below and above the frequencies given over which weights hold their size."""
MOST_DAMPED = 0.1
"""Damping that is enough for any grid, however coarse."""
APART = 0.02
"""Largest step of log frequency at which a cover is fitted: no resonance hides in a coarser one."""
MOST_RAISES, BEYOND = 20, 1e-9
"""Times that a gain is raised, each by what it misses and this share more."""
NO_SIZE = 1e-6
"""Size of a set, relative to the largest, below which plants count as equal."""
SLACK = 2.0
"""What the length of a stadium counts beside its radius where a cover exceeds it."""


def fitted(program: Program, context: Context) -> Rational:
    """The certified answer of a fit.

    Raises
    ------
    SolverError
        Its certificate does not hold.
    """
    solution = solve(program, options=context.options)
    if solution.answer is None or not solution.certificate or not solution.certificate.valid:
        failures = "; ".join(solution.certificate.failures) if solution.certificate else ""
        raise SolverError(f"{type(program).__name__}: {failures or solution.message}")
    return solution.answer


def complex_weight(
    omega: RealArray, radius: RealArray, weight: RealArray, order: int, context: Context
) -> Rational:
    """W_c (eq. 5.2, 5.15): covers radii (F,), also between the frequencies.

    What it takes in excess, relative to the radius, counts with a weight (F,).
    """
    fine = np.unique(np.concatenate([omega, between(omega)]))
    log = np.log(fine)
    magnitude, counts = (np.exp(np.interp(log, np.log(omega), np.log(v))) for v in (radius, weight))
    grid, magnitude, counts = beyond(fine), lasting(magnitude), lasting(counts)
    fit = fitted(MagnitudeFit(grid, magnitude, order, weight=counts, cover=True), context)
    return raised(resolved(fit, fine), grid, magnitude)


def share_of_size(radius: RealArray, extent: RealArray) -> RealArray:
    """What an excess of the radius is, relative to the size of the set (F,).

    Of circles it is all of it; the size of stadiums is the radius and SLACK times what the extent
    has beyond it, since a long set may be all but a line where a low order cannot follow it.
    """
    return radius / (radius + SLACK * (extent - radius))


def between(omega: RealArray) -> RealArray:
    """Frequencies so close that little of a cover is hidden between them and those given (F,)."""
    log = np.log(omega)
    counts = np.ceil(np.diff(log) / APART).astype(int)
    steps = [
        np.linspace(a, b, n, endpoint=False)[1:]
        for a, b, n in zip(log[:-1], log[1:], counts, strict=True)
    ]
    return np.exp(np.concatenate(steps)) if steps else omega


def raised(function: Rational, omega: RealArray, magnitude: RealArray) -> Rational:
    """The function with the gain that it needs to cover magnitudes (F,) and what lies between."""
    for _ in range(MOST_RAISES):
        margin, _ = least_margin(omega, magnitude, function)
        if margin >= 0:
            return function
        gain = function.gain * np.exp(-margin) * (1 + BEYOND)
        function = Rational(function.zeros, function.poles, gain)
    raise SolverError(f"the weight misses its cover by {-margin:.3g} still, relative")


def real_weight(
    omega: RealArray, sets: Stadium, order: int, minimum_phase: bool, context: Context
) -> Rational:
    """W_r (eq. 5.15): follows the segments half_length * exp(j angle) in magnitude and phase.

    The end of a segment may be either of two; the one that turns less along frequency is taken.
    What the fit misses makes the set wider by as much; it counts as the excess of a cover does.
    """
    end = unwrapped(sets.half_length * np.exp(1j * sets.angle))
    size = sets.radius + SLACK * sets.half_length
    weight = 1 / np.maximum(size, NO_SIZE * (size.max() or 1.0))
    return fitted(held(omega, end, weight, order, minimum_phase), context)


def held(
    omega: RealArray, end: ComplexArray, weight: RealArray, order: int, minimum_phase: bool
) -> ResponseFit:
    """The fit of ends of segments (F,) that last beyond the frequencies given, real there."""
    ends = lasting(end)
    for part in (slice(DECADES), slice(-DECADES, None)):
        ends[part] = np.copysign(np.abs(ends[part]), ends[part].real)
    return ResponseFit(
        beyond(omega), ends, order, weight=lasting(weight), minimum_phase=minimum_phase
    )


def beyond(omega: RealArray) -> RealArray:
    """Frequencies (F,) and some decades on either side, (F + 2 * DECADES,)."""
    decades = 10.0 ** np.arange(1, DECADES + 1)
    return np.concatenate([omega[0] / decades[::-1], omega, omega[-1] * decades])


def lasting(values: np.ndarray) -> np.ndarray:
    """Values (F,) that last beyond the frequencies given.

    Without that a weight may vanish, or grow as it likes, where no response is known: at rest.
    """
    return np.pad(values, DECADES, mode="edge")


def unwrapped(end: ComplexArray) -> ComplexArray:
    """Ends (F,) of segments through 0, each or its opposite, so that no step turns past pi/2."""
    steps = (end[1:] * end[:-1].conj()).real < 0
    sign = np.concatenate([[1.0], np.where(steps, -1.0, 1.0)]).cumprod()
    ends: ComplexArray = end * sign
    return ends


def damped(function: Rational, omega: RealArray) -> Rational:
    """The function with poles that its realisation has left of the imaginary axis too.

    A fit may put them as near to it as no frequency tells, as integrators or between frequencies.
    """
    return _left_by(np.maximum(SLOW * omega[0], UNDAMPED * np.abs(function.poles)), function)


def resolved(function: Rational, omega: RealArray) -> Rational:
    """The function with no resonance that falls between the frequencies it was fitted at.

    Its poles are damped at least by half the relative distance of frequencies around them: a
    narrower peak is seen by none of them.
    """
    log = np.log(omega)
    size = np.abs(function.poles)
    around = np.interp(np.log(np.maximum(size, omega[0])), (log[1:] + log[:-1]) / 2, np.diff(log))
    return _left_by(np.minimum(around / 2, MOST_DAMPED) * size, function)


def _left_by(distance: RealArray, function: Rational) -> Rational:
    """The function with each pole at least so far left of the imaginary axis."""
    poles = function.poles.copy()
    poles.real = np.minimum(poles.real, -distance)
    return Rational(function.zeros, poles, function.gain)


def needed_radius(away: ComplexArray, end: ComplexArray | None) -> RealArray:
    """Largest distance (F,) of deviations (F, N) from segments -end..end (F,), or from 0."""
    extent = np.abs(away).max(axis=1)
    if end is None:
        return extent
    square = np.maximum(np.abs(end) ** 2, np.finfo(float).tiny)
    along = np.clip((away * end.conj()[:, None]).real / square[:, None], -1, 1)
    distance: RealArray = np.abs(away - along * end[:, None]).max(axis=1)
    return np.maximum(distance, THIN * extent)

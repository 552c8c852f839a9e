"""Fault filters on the front: full order over a Laguerre basis, then few states, certified.

Only the poles of the reduced filter are kept: the best filter with them solves a convex problem.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.diagnosis.estimation.fault_loop import FaultLoop
from workbench.diagnosis.estimation.front import FaultFront, FrontPoint, near_poles
from workbench.diagnosis.estimation.laguerre import LaguerreBasis
from workbench.diagnosis.estimation.program import FaultEstimation, FaultFilter
from workbench.errors import InputError, SolverError
from workbench.input_checks import need_positive
from workbench.mu import Conditions, conditions
from workbench.synthesis import approximations
from workbench.synthesis.implementation.approximation import ReductionMethod
from workbench.systems.realisation import realisation

PEAK_TOLERANCE = 1e-3
"""Relative width of the intervals that certify a filter's error, leakage and sensitivity."""
REDUCTIONS: tuple[ReductionMethod, ...] = ("weighted", "balanced", "hankel")
"""Methods of `reduced` whose poles are tried."""
TIGHTER = (1.0, 0.99, 0.97)
"""Factors on the limits of the grid, since a limit that is met there may be exceeded between grid
points.
"""


@dataclass(frozen=True, eq=False)
class FrontFilter:
    """A continuous filter F e -> u_f, its point of the front, and its certified answer.

    ``removal``: certified conditions of the loop while the estimate is subtracted from the error,
    its sensitivity divided by the peak asked for; None if no peak was asked for.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop, LaguerreBasis
    >>> from workbench.diagnosis import full_order_filter
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> found = full_order_filter(loop, grid, LaguerreBasis(loop, 1.0), 6, error=0.5, leakage=2e-3)
    >>> found.answer.K.noutputs, found.removal is None
    (1, True)
    """

    F: StateSpace
    point: FrontPoint
    answer: FaultFilter
    _: KW_ONLY
    removal: Conditions | None = None

    @property
    def meets(self) -> bool:
        """Whether all requirements are certified, with a margin for certifying them again.

        Intervals of relative width PEAK_TOLERANCE differ by no more than that from run to run.
        """
        bounds = [self.answer.upper]
        if self.removal is not None:
            stable, performs = self.removal.robust_stability, self.removal.robust_performance
            if stable is None or performs is None:
                return False
            bounds += [stable.upper, performs.upper]
        return max(bounds) * (1 + PEAK_TOLERANCE) <= 1.0


def full_order_filter(
    loop: FaultLoop,
    frequency_hz: ArrayLike,
    basis: LaguerreBasis,
    count: int,
    error: float,
    leakage: float,
    *,
    peak: float | None = None,
) -> FrontFilter:
    """The certified filter with least leakage and noise over a Laguerre basis, within limits.

    frequency_hz: grid [Hz] (F,) of the convex problem. count: number of basis functions. leakage:
    limit in the unit of the fault. peak: limit of the sensitivity while the estimate is subtracted
    from the error; None: it is never subtracted. Raises SolverError if the set of plants allows no
    such filter.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop, LaguerreBasis
    >>> from workbench.diagnosis import full_order_filter
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> found = full_order_filter(loop, grid, LaguerreBasis(loop, 1.0), 6, error=0.5, leakage=2e-3)
    >>> found.meets, found.point.error <= 0.5 * (1 + 1e-6)
    (True, True)
    """
    front = FaultFront(loop, frequency_hz)
    functions = basis.response(front.omega, count)
    point = front.least(functions, error, leakage=leakage, peak=peak)
    return certified_filter(loop, basis.filter(point.coefficients), point, error, leakage, peak)


def low_order_filter(
    loop: FaultLoop,
    frequency_hz: RealArray,
    F: StateSpace,
    order: int,
    error: float,
    leakage: float,
    *,
    peak: float | None = None,
) -> FrontFilter:
    """The best filter with the poles of a reduction of F, up to an order; F = 0 is kept.

    Filters that are certified to meet all requirements come first. ``frequency_hz`` (F,) [Hz]:
    grid, to which frequencies about the reduced poles are added. peak: as in `full_order_filter`.
    Raises SolverError if no reduction has poles that meet the relative error, the leakage and the
    peak.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import (
    ...     EstimationDemands,
    ...     FaultLoop,
    ...     LaguerreBasis,
    ...     low_order_filter,
    ...     full_order_filter,
    ... )
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> limits = {"error": 0.5, "leakage": 2e-3}
    >>> F = full_order_filter(loop, grid, LaguerreBasis(loop, 1.0), 6, **limits).F
    >>> low_order_filter(loop, grid, F, 3, **limits).F.nstates <= 3
    True
    """
    if not F.C.any() and not F.D.any():  # F = 0, which needs no states
        import control

        one = np.ones((len(frequency_hz), 1), complex)
        nothing = FaultFront(loop, frequency_hz).least(one, error, leakage=leakage, peak=peak)
        return certified_filter(loop, control.ss([], [], [], 0.0), nothing, error, leakage, peak)
    program = loop_estimation(loop, error, leakage)

    def tried(poles: StateSpace) -> FrontFilter | None:
        """The best filter with these poles; None if none meets the error and the leakage."""
        try:
            front = FaultFront(loop, near_poles(loop, frequency_hz, poles.poles()))
            functions = front.of_filter(poles)
        except InputError:
            return None
        best = None
        for factor in TIGHTER:
            limits = {"leakage": factor * leakage, "peak": peak and factor * peak}
            try:
                point = front.least(functions, factor * error, **limits)
            except (InputError, SolverError):
                break
            x = point.coefficients
            made = realisation((poles.A, poles.B, x[None, :-1], x[None, -1:]), 0.0)
            if not stability_check(made).holds:
                break
            found = certified_filter(loop, made, point, error, leakage, peak)
            best = best or found
            if found.meets:
                return found
        return best

    ways = [approximations(F, order, method=method, plant=program.plant) for method in REDUCTIONS]
    found = [one for way in ways for one in [tried(next(way))] if one is not None]
    if not found:  # no direct reduction works: take the first of the others that does
        others = filter(None, map(tried, chain.from_iterable(ways)))
        found = [one for one in [next(others, None)] if one is not None]
    if not found:
        raise SolverError(
            f"no filter of order {order} with a relative error of {error:g} and a leakage of "
            f"{leakage:g} by {REDUCTIONS}"
        )
    meeting = [each for each in found if each.meets]
    return min(meeting or found, key=lambda each: each.point.total_error)


def loop_estimation(loop: FaultLoop, error: float, leakage: float) -> FaultEstimation:
    """The fault estimation of a loop with its requirements."""
    return FaultEstimation(loop.plant, "f", requirements=loop.requirements(error, leakage))


def certified_filter(
    loop: FaultLoop,
    F: StateSpace,
    point: FrontPoint,
    error: float,
    leakage: float,
    peak: float | None = None,
) -> FrontFilter:
    """A filter with its certified bounds. Raises SolverError for one that is not stable."""
    answer = loop_estimation(loop, error, leakage).answer(F)
    if answer is None:
        raise SolverError(f"the filter is not stable: poles {np.sort(F.poles().real)[-2:]}")
    removal = None if peak is None else removal_conditions(loop, F, peak)
    return FrontFilter(F, point, answer, removal=removal)


def removal_conditions(
    loop: FaultLoop, F: StateSpace, peak: float, tolerance: float = PEAK_TOLERANCE
) -> Conditions:
    """Certified conditions of the loop while the estimate of F is subtracted from the error.

    Its performance is the sensitivity divided by the peak. tolerance: relative width of the
    intervals. Raises InputError for a peak that is not positive.
    """
    need_positive(peak, "peak")
    return conditions(loop.removal.weighted(performance=[1 / peak]), F, tolerance=tolerance)

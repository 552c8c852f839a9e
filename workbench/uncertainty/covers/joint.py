"""Nominal and real weight that make the sets about the nominal small.

Near a resonance that moves from plant to plant no curve of low order passes through the centres
of the smallest shapes. The size of the sets about the nominal is what matters, so the nominal is
chosen to minimise it; for stadiums the real weight is chosen with it. The cost is the mean over log
frequency of

    circles     radius^2
    stadiums    radius^2 + HALF_LENGTH_WEIGHT half-length^2

where the radius is the largest distance of a deviation from the nominal, or from the segment of the
real weight. Sizes are relative to the nominal or, for additive models, to the plants. The radius of
stadiums alone would be ill-posed: as |G| grows every relative deviation tends to -1, and a stadium
of half-length 1 and no width contains them all. Beyond the frequencies nothing is known: there the
square of the real weight counts a little, or it could grow without limit at zero frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.fitting.reach import within_reach
from workbench.uncertainty.covers.cover import HALF_LENGTH_WEIGHT, UncertaintyCover
from workbench.uncertainty.covers.set_sizes import mean_square_size

NORM_POWERS = (8, 32, 128)
"""Powers p of the p-norms that replace the maximum over the plants, one after the other."""
MAX_BFGS_STEPS = 200
"""Most quasi-Newton steps with each power."""
COVER_ROOT_REACH = 1e3
"""Largest factor from the first or last frequency to a root of the nominal or the real weight."""
BEYOND, BEYOND_DECADES = 0.01, 4
"""Weight of the mean square of the real weight at one frequency in each of so many decades below
and above the given ones."""
DIRECTIONS = 16
"""Larger point sets are reduced to the outermost point in each of this many directions."""


@dataclass(frozen=True)
class SmallSets:
    """Mean square size of the sets, as a function of the parameters of nominal and real weight.

    ``points`` (F, N) are the plants. ``nominal`` is a response (F,) if it is given and fixed;
    ``W_r`` is None for circles.
    """

    program: UncertaintyCover
    points: ComplexArray
    nominal: FactoredRational | ComplexArray
    W_r: FactoredRational | None

    def split(self, vector: RealArray) -> tuple[RealArray, RealArray]:
        """Parameters of the nominal, and parameters of the real weight."""
        count = self.nominal.start.size if isinstance(self.nominal, FactoredRational) else 0
        return vector[:count], vector[count:]

    @property
    def start(self) -> RealArray:
        """Vector of parameters at the start."""
        moving = [
            each.start for each in (self.nominal, self.W_r) if isinstance(each, FactoredRational)
        ]
        return np.concatenate([np.zeros(0), *moving])  # empty for circles about a given nominal

    def __call__(self, vector: RealArray, power: int) -> tuple[float, RealArray]:
        """Mean square size with norms of a given power over the plants, and its gradient."""
        of_nominal, of_weight = self.split(vector)
        omega, shares = self.program.responses.axis, self.program.responses.shares
        nominal, slope = _evaluated(self.nominal, of_nominal, omega)
        unit = self.program.unit
        end, turn = np.zeros(omega.size, dtype=complex), np.zeros((omega.size, 0), dtype=complex)
        if self.W_r is not None:
            end, turn = _evaluated(self.W_r, of_weight, omega)
            end, turn = end / unit, turn / unit[:, None]
        value, gradient = mean_square_size(
            self.points,
            nominal,
            slope,
            end,
            turn,
            unit,
            shares,
            self.program.form == "multiplicative",
            HALF_LENGTH_WEIGHT,
            power,
        )
        if self.W_r is None:
            return value, gradient
        out, turn = self._beyond(of_weight)
        gradient[of_nominal.size :] += 2 * BEYOND * (out.conj() @ turn).real
        return value + BEYOND * float((np.abs(out) ** 2).sum()), gradient

    def _beyond(self, of_weight: RealArray) -> tuple[ComplexArray, ComplexArray]:
        """The real weight beyond the frequencies, its squares' sum a mean square, and slopes."""
        omega, unit = self.program.responses.axis, self.program.unit
        decades = 10.0 ** np.arange(1, BEYOND_DECADES + 1)
        far = np.concatenate([omega[0] / decades, omega[-1] * decades])
        size = np.repeat([unit[0], unit[-1]], BEYOND_DECADES) * np.sqrt(far.size)
        assert self.W_r is not None
        end, turn = _evaluated(self.W_r, of_weight, far)
        return end / size, turn / size[:, None]


FoundModel = tuple[float, Rational, Rational | None]
"""Mean square size, nominal, real weight."""


def smallest_sets(
    program: UncertaintyCover, nominal: Rational, W_r: Rational | None, context: Context
) -> FoundModel:
    """Mean square size, nominal and real weight of the smallest sets found from a start.

    Without a real weight the sets are circles, even if the program asks for stadiums. The search
    takes quasi-Newton steps on the coefficients of quadratic factors, and approaches the maximum
    over the plants by norms of rising power. The answer is a local optimum.
    """
    omega = program.responses.axis
    band = float(omega[0]), float(omega[-1])
    moving: FactoredRational | ComplexArray = nominal.response(omega)
    if program.nominal is None:
        moving = FactoredRational.of(
            nominal, program.zeros, band, True, False, program.unstable_poles
        )
    weight = None
    if W_r is not None:
        weight = FactoredRational.of(
            W_r, W_r.order, band, stable=True, minimum_phase=program.minimum_phase
        )
    size = SmallSets(program, outermost(program.points), moving, weight)
    vector = size.start
    if vector.size:
        scale = np.maximum(np.abs(vector), 1e-3)

        def scaled(vector: RealArray, power: int) -> tuple[float, RealArray]:
            with np.errstate(all="ignore"):
                value, gradient = size(vector * scale, power)
            return (value, gradient * scale) if np.isfinite(value) else (np.inf, 0 * vector)

        vector = vector / scale
        for power in context.track(NORM_POWERS, "smallest sets"):
            steps = {"maxiter": MAX_BFGS_STEPS}
            vector = minimize(scaled, vector, (power,), "BFGS", jac=True, options=steps).x
        vector = vector * scale
    of_nominal, of_weight = size.split(vector)

    def found(factored: FactoredRational, vector: RealArray) -> Rational:
        return within_reach(factored.rational(vector), omega, COVER_ROOT_REACH)

    return (
        size(vector, NORM_POWERS[-1])[0],
        found(moving, of_nominal) if isinstance(moving, FactoredRational) else nominal,
        None if weight is None else found(weight, of_weight),
    )


def _evaluated(
    of: FactoredRational | ComplexArray, vector: RealArray, omega: RealArray
) -> tuple[ComplexArray, ComplexArray]:
    """Values (F,) and derivatives (F, P) at given parameters; P is 0 for a fixed response."""
    if isinstance(of, FactoredRational):
        return of.values(vector, omega)
    return of, np.zeros((omega.size, 0), dtype=complex)


def outermost(points: ComplexArray) -> ComplexArray:
    """The outermost points (F, DIRECTIONS) of large sets (F, N), one in each of the directions."""
    if points.shape[1] <= DIRECTIONS:
        return points
    away = points - points.mean(axis=1, keepdims=True)
    turn = np.exp(-2j * np.pi * np.arange(DIRECTIONS) / DIRECTIONS)
    farthest = np.stack([(away * t).real.argmax(axis=1) for t in turn], axis=1)
    return np.take_along_axis(points, farthest, axis=1)

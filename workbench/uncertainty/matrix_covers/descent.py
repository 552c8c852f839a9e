"""Diagonal weights by descent, or by differential evolution, over their poles and zeros.

Each weight is a quotient of products of sections s^2 + a s + b and s + c with positive
coefficients, so it is stable and has a stable inverse. The mean logarithm of the radius is a sum of
the logarithms of the weights' sizes. Containment adds the largest log |W_1^-1 X W_2^-1|. Its slope
by log |w_i| is -|u_i|^2, and its slope by log |w_j| is -|v_j|^2, where u and v are the singular
vectors. A soft maximum, which becomes harder, replaces the largest value. With a loop, the largest
log mu over frequency is minimised instead, plus a small share of the radius. Its slopes are |v_i|^2
and |u_j|^2 of the scaled loop, with the opposite roles of u and v.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, minimize
from scipy.special import logsumexp, softmax

from workbench._core.arrays import Array, RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.uncertainty.matrix_covers.cover import MatrixCover
from workbench.uncertainty.matrix_covers.sections import SideOfWeights
from workbench.uncertainty.matrix_covers.sets.loop import VOLUME_SHARE, loop_level, scaled_loop

HARDNESS = (30.0, 100.0, 300.0, 1000.0, 3000.0)
"""Factors of the logarithms in the soft maximum, used one after the other. The soft maximum of N
terms is too large by at most log N / hardness: 0.2 % of a size at last for 400 terms. With half of
them twice as much; with double of them the first descents are less smooth.
"""
STEPS = 200
"""Largest number of steps of the descent for one hardness. SciPy's L-BFGS ends earlier once it
settles. With half of them hard descents stop early, at larger sets; double costs time only.
"""
OUTERMOST = 8
"""Largest number of plants at each frequency that the descent uses. The others lie inside sets that
hold these. With half of them the gain may be raised more at the end; double takes twice as long.
"""
RANGE = 10.0
"""Largest change of the logarithm of a coefficient in the descent. It is a factor of 22,000 either
way. Half or double changes nothing for a start near the data.
"""
SPREAD = 2.0
"""Largest change of the logarithm of a coefficient in a population. It is a factor of 7.4 either
way: other local optima lie that far. Half finds fewer of them; double spreads the same population
more thinly.
"""
GENERATIONS, POPULATION = 100, 4
"""Number of generations, and number of members of the population for each coefficient. SciPy's
differential evolution takes fifteen by default; each member is costly here. With half of either
sets may be larger; double takes twice as long.
"""


def weights_by_descent(
    program: MatrixCover, left: Sequence[Rational], right: Sequence[Rational], context: Context
) -> tuple[list[Rational], list[Rational]]:
    """Weights with a lower cost, as functions of the bilinear plane, by descent from the given
    channels.

    A list with one weight stands for the same weight in all channels.
    """
    cost = _Cost(program, left, right)
    x = cost.start
    if x.size:
        bounds = [(each - RANGE, each + RANGE) for each in x]
        for hardness in context.track(HARDNESS, "descents"):
            x = minimize(
                cost, x, (hardness,), "L-BFGS-B", True, bounds=bounds, options={"maxiter": STEPS}
            ).x
    return cost.fits(x)


def weights_by_evolution(
    program: MatrixCover, left: Sequence[Rational], right: Sequence[Rational], context: Context
) -> tuple[list[Rational], list[Rational]]:
    """Weights with a lower cost, as functions of the bilinear plane, by a population around the
    given ones.
    """
    cost = _Cost(program, left, right)
    x = cost.start
    if x.size:
        bounds = [(each - SPREAD, each + SPREAD) for each in x]
        generations = iter(context.track(range(GENERATIONS), "generations"))

        def step(intermediate_result: OptimizeResult) -> None:
            next(generations, None)

        x = differential_evolution(
            lambda x: cost(x, HARDNESS[-1])[0],
            bounds,
            maxiter=GENERATIONS,
            popsize=POPULATION,
            x0=x,
            polish=False,
            rng=context.rng,
            callback=step,
        ).x
    return cost.fits(x)


class _Cost:
    """The cost of weights as a function of the logarithms of their coefficients, with its
    gradient.
    """

    def __init__(
        self, program: MatrixCover, left: Sequence[Rational], right: Sequence[Rational]
    ) -> None:
        fine, self.shares = program.for_fits()
        band = float(program.axis[0]), float(program.axis[-1])
        self.sides = [SideOfWeights(fine.axis, band, fits) for fits in (left, right)]
        self.X = _outermost_matrices(
            fine.matrices_to_cover, [side.logs(side.start)[0] for side in self.sides]
        )
        self.start = np.concatenate([side.start for side in self.sides])
        self.ends = np.cumsum([side.start.size for side in self.sides])[:-1]
        self.of_loop = None
        if program.loop_response is not None:
            sides = [SideOfWeights(program.axis, band, fits) for fits in (left, right)]
            sizes = program.deviations.shape[2:]
            self.of_loop = _LoopCost(program.loop_response, sizes, sides)

    def fits(self, x: RealArray) -> tuple[list[Rational], list[Rational]]:
        """The weights of both sides."""
        parts = np.split(x, self.ends)
        left, right = (side.fits(part) for side, part in zip(self.sides, parts, strict=True))
        return left, right

    def __call__(self, x: RealArray, hardness: float) -> tuple[float, RealArray]:
        """The cost with a soft maximum, and its gradient."""
        parts = np.split(x, self.ends)
        found = [side.logs(part) for side, part in zip(self.sides, parts, strict=True)]
        left, right = (np.exp(logs) for logs, _ in found)
        u, s, vh = np.linalg.svd(self.X / left[:, None, :, None] / right[:, None, None])
        largest = np.log(s[..., 0]) * hardness
        soft = softmax(largest)
        pull = [
            np.einsum("fk,fki->fi", soft, np.abs(u[..., 0]) ** 2),
            np.einsum("fk,fki->fi", soft, np.abs(vh[..., 0, :]) ** 2),
        ]
        # logarithm of the factor by which W_1 must grow until the model contains the plants
        raise_ = float(logsumexp(largest) / hardness)
        if self.of_loop is None:
            total, share, by_raise, slopes = raise_, 1.0, 1.0, [0.0 * part for part in parts]
        else:
            level, slopes, by_raise = self.of_loop(parts, raise_, hardness)
            share = VOLUME_SHARE
            total, by_raise = level + share * raise_, by_raise + share
        for (log, slope), grip, gradient in zip(found, pull, slopes, strict=True):
            total += share * float(self.shares @ log.mean(axis=1))
            weights = share * self.shares[:, None] / log.shape[1]
            weights = weights - by_raise * _for_channels(grip, log)
            gradient += np.einsum("fi,fid->d", weights, slope)
        return total, np.concatenate(slopes)


def _for_channels(grip: RealArray, log: RealArray) -> RealArray:
    """Slopes (F, n) by the logarithms (F, n) of all channels, or (F, 1) for one weight in all
    channels.
    """
    found: RealArray = grip if log.shape == grip.shape else grip.sum(axis=1, keepdims=True)
    return found


class _LoopCost:
    """The soft maximum of log mu of a loop over the given frequencies.

    ``sizes`` are the numbers of channels of both sides.
    """

    def __init__(self, loop: Array, sizes: Sequence[int], sides: Sequence[SideOfWeights]) -> None:
        self.loop, self.sizes, self.sides = loop, sizes, sides

    def __call__(
        self, parts: Sequence[RealArray], raise_: float, hardness: float
    ) -> tuple[float, list[RealArray], float]:
        """Value, slopes by the coefficients of each part, and slope by the logarithm of W_1."""
        found = [side.logs(part) for side, part in zip(self.sides, parts, strict=True)]
        P, S = (
            _diagonals(np.exp(-log - more), size)
            for (log, _), more, size in zip(found, (raise_, 0.0), self.sizes, strict=True)
        )
        p, m = self.sizes
        level, delta = loop_level(self.loop, P, S)
        u, _, vh = np.linalg.svd(scaled_loop(self.loop, P, S, delta), full_matrices=False)
        soft = softmax(level * hardness)[:, None]
        grips = soft * np.abs(vh[:, 0, :p]) ** 2, soft * np.abs(u[:, :m, 0]) ** 2
        slopes = [
            np.einsum("fi,fid->d", _for_channels(grip, log), slope)
            for grip, (log, slope) in zip(grips, found, strict=True)
        ]
        return float(logsumexp(level * hardness) / hardness), slopes, float(grips[0].sum())


def _diagonals(values: RealArray, size: int) -> Array:
    """Diagonal matrices (F, size, size) from values (F, size), or (F, 1) for all channels."""
    found: Array = np.eye(size) * np.broadcast_to(values, (len(values), size))[:, None]
    return found


def _outermost_matrices(X: Array, logs: Sequence[RealArray]) -> Array:
    """The OUTERMOST largest matrices of X (F, N, p, m) at each frequency, relative to the weights.

    ``logs`` are the logarithms (F, .) of the weights' sizes.
    """
    left, right = (np.exp(each) for each in logs)
    norms = np.linalg.norm(X / left[:, None, :, None] / right[:, None, None], 2, axis=(2, 3))
    order = np.argsort(-norms, axis=1)[:, :OUTERMOST]
    return np.take_along_axis(X, order[..., None, None], axis=1)

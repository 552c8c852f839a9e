"""Deviations of a model's parameters, from the curvature of the prediction errors and the noise.

In a short record, only a few spectral lines lie near a slow or lightly damped pole of the plant. A
model of the noise with as many poles as the plant follows the noise of these few lines. It often
finds too little noise there, and then the plant seems more certain than it is. So deviations are
computed twice: from the scatter of estimates over simulated records, and with a second model of
the noise, an autoregression of the errors of the free run, whose spectrum has no narrow dips. The
larger deviations count.

The larger of two uncertain numbers is too large on average, so both are made more certain. The
scatter over thirty records, which is known to 13 percent, is compared with that of the same
records' steps by their mean curvature. The expected size of the latter is known, and chance moves
both alike. And an autoregression counts only as far as it exceeds its own standard error.

Sources: L. Ljung, System Identification, 2nd ed., 1999, section 9.4; P. Glasserman, Monte Carlo
Methods in Financial Engineering, 2003, section 4.1 (control variates); K. Berk, "Consistent
autoregressive spectral estimates", Annals of Statistics 2(3), 1974, theorem 6 (standard error).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from workbench._core.arrays import Array, BoolArray, ComplexArray, RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.autoregression import chosen_autoregression
from workbench.identification.innovations.criterion import (
    Criterion,
    scaled_eigen,
    whitening,
)
from workbench.identification.innovations.gain_surface import GainSurface
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel

HESSIAN_ROUNDING = 1e-14
"""Relative curvature below which the record says nothing about a direction of the parameters."""
OPEN = 1e-3
"""Smallest change along such a direction, over the deviation by all others, that is not rounding.

A direction that only changes the basis of the states changes no pole and no response.
"""
KNOWN_ROUNDING = 1e-7
"""Smallest such change over the value itself: a value that is known exactly has no deviation."""
REPEATED, REPEATED_SEED = 30, 141421356237
"""Number of records simulated to find the scatter of estimates, and the seed of their noise.

The seed is one that no user chooses: noise from the seed of the input would be a multiple of the
input.
"""
REMEMBERED = 8
"""Number of models whose estimates are remembered.

Facts, bands and figures of one answer ask for the same estimates.
"""
Change = Callable[[Criterion, RealArray, RealArray], Array]
"""Change of values by a small step of the parameters: of a criterion, its parameters, the step."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimated parameters of a criterion, and how well it tells them.

    The parameters were free along the columns of ``free``. Each column of ``root`` is a change by
    one standard deviation. What changes along the columns of ``untold`` the record does not see.
    """

    criterion: Criterion
    theta: RealArray
    free: RealArray
    root: RealArray
    untold: RealArray

    def deviations(self, change: Change, values: Array) -> RealArray:
        """Standard deviations of values that ``change`` so with the parameters.

        They are infinite where these change along what the record does not see.
        """
        total = self._size(np.array([self._along(change, step) for step in self.root.T]))
        rounding = OPEN * total + KNOWN_ROUNDING * np.abs(values)
        for step in self.untold.T:
            total = np.where(np.abs(self._along(change, step)) > rounding, np.inf, total)
        return np.asarray(total)

    def covariances(self, change: Change) -> RealArray:
        """Covariances (..., 2, 2) of the real and imaginary part of values (...,) that change."""
        along = np.array([self._along(change, step) for step in self.root.T])
        found = covariance_of_moves(along)
        plain = np.trace(found, axis1=-2, axis2=-1)
        scale = self._size(along) ** 2 / np.where(plain > 0, plain, 1.0)
        return np.asarray(found * scale[..., None, None])

    def _along(self, change: Change, step: RealArray) -> Array:
        return change(self.criterion, self.theta, step)

    def _size(self, along: Array) -> RealArray:
        """Deviations of values whose changes (r, ...) along the columns of the root are given."""
        return np.asarray(np.sqrt(np.sum(np.abs(along) ** 2, axis=0)))


@dataclass(frozen=True, eq=False)
class RepeatedEstimates(Estimates):
    """Estimates of records that a model makes, each a Newton step away from the model.

    ``root`` is that of the mean of their curvatures. In its columns, ``steps`` (r, R) are those by
    the curvature of each record, ``plain`` those by the mean.
    """

    steps: RealArray
    plain: RealArray

    def _size(self, along: Array) -> RealArray:
        stepped, plain = (
            super(RepeatedEstimates, self)._size(np.tensordot(steps.T, along, 1))
            for steps in (self.steps, self.plain)
        )
        return super()._size(along) * stepped / np.where(plain > 0, plain, 1.0)


def covariance_of_moves(moves: ComplexArray) -> RealArray:
    """Covariances (..., 2, 2) of real and imaginary part from independent moves (p, ...)."""
    both = np.stack([moves.real, moves.imag], axis=-1)
    return np.asarray(np.einsum("p...a,p...b->...ab", both, both))


def largest_deviations(estimates: list[Estimates], change: Change, values: Array) -> RealArray:
    """The largest of the standard deviations by each of the estimates."""
    return np.max([each.deviations(change, values) for each in estimates], axis=0)


@lru_cache(maxsize=REMEMBERED)
def estimates_of(
    model: InnovationsModel, record: Experiments, direct: bool, known: Knowledge | None
) -> list[Estimates]:
    """What the record tells of a model with its own noise, and with the autoregressive one; the
    former by repetition, where nothing is known. The last few are remembered.
    """
    if known is not None:
        model = known.exact(model) or model
    entries = _free_entries(model, known)
    criterion = Criterion(model, record, 0.0, direct, entries)
    theta = criterion.start(model)
    own = _estimated(criterion, theta, criterion.expand(theta)[2], known)
    found = [own if known is not None else _repeated(own, model, record, direct, entries)]
    if model.radius < 1:
        simulator = replace(model, K=np.zeros_like(model.K))
        held = entries.copy()
        held[len(held) - model.K.size :] = False
        criterion = Criterion(simulator, record, 0.0, direct, held)
        theta = criterion.start(simulator)
        found.append(_estimated(criterion, theta, _autoregressive(criterion, theta), known))
    return found


def _repeated(
    found: Estimates,
    model: InnovationsModel,
    record: Experiments,
    direct: bool,
    entries: BoolArray,
) -> RepeatedEstimates:
    """Estimates that scatter as those of records which the model itself makes.

    Where a record hardly tells the noise, the curvature varies with the noise that it happens to
    have, and is largest where the estimate errs most. So what one record says of the scatter is too
    small, and the scatter is told by repetition.
    """
    criterion, theta = found.criterion, found.theta
    errors = criterion.errors(theta)
    covariance = errors.T @ errors / len(errors) + criterion.floor
    factor = np.linalg.inv(whitening(covariance)).T
    rng = np.random.default_rng(REPEATED_SEED)
    drawn = (rng.standard_normal(errors.shape) @ factor.T for _ in range(REPEATED))
    gradients, hessians = [], []
    for made in criterion.repeated(theta, record, drawn):
        repeated = Criterion(model, made, 0.0, direct, entries)
        _, gradient, hessian = repeated.expand(theta)
        gradients.append(gradient)
        hessians.append(hessian)
    mean = np.mean(hessians, axis=0)
    root = root_of_inverse(mean)
    plain = root.T @ np.array(gradients).T
    steps = []
    for gradient, hessian in zip(gradients, hessians, strict=True):
        own = root_of_inverse(hessian)
        steps.append(root.T @ (mean @ (own @ (own.T @ gradient))))
    moved = np.array(steps).T
    return RepeatedEstimates(criterion, theta, found.free, root, found.untold, moved, plain)


def _autoregressive(criterion: Criterion, theta: RealArray) -> RealArray:
    """Hessian (P, P) of a simulator's parameters, whose errors are autoregressions.

    Their spectra are taken one standard error lower, that of the lowest frequencies.
    """
    errors = criterion.errors(theta)
    filters = [np.concatenate([[1.0], -chosen_autoregression(v)]) for v in errors.T]
    hessian = np.zeros((len(theta), len(theta)))
    white = np.column_stack([lfilter(a, 1.0, v) for a, v in zip(filters, errors.T, strict=True)])
    whiten = whitening(white.T @ white / len(white) + criterion.floor)
    for columns, rows in criterion.filtered_rows(theta, filters):
        whitened = np.matmul(whiten.T, rows).reshape(-1, rows.shape[2])
        hessian[np.ix_(columns, columns)] += whitened.T @ whitened
    longest = max(len(a) for a in filters) - 1
    return hessian * (1 + np.sqrt(4 * longest / len(errors)))


def _estimated(
    criterion: Criterion, theta: RealArray, hessian: RealArray, known: Knowledge | None
) -> Estimates:
    """Estimates and their covariance from a Hessian, for changes that keep what is known."""
    free = np.eye(len(theta))
    if known is not None and known.gain is not None:
        scale = np.sqrt(np.diag(hessian))
        scale[scale == 0] = 1.0
        free = GainSurface(criterion, known).tangent(theta, scale) / scale[:, None]
    told, untold = _curved(free.T @ hessian @ free)
    return Estimates(criterion, theta, free, free @ told, free @ untold)


def _free_entries(model: InnovationsModel, known: Knowledge | None) -> BoolArray:
    """Which entries of A, B, C, D and K are free: those that nothing known keeps, nor structure.

    A polynomial model has states of the plant and states of the noise, which stay apart. A gain
    that is zero as a whole is that of a simulator, and is free.
    """
    gain = model.K if model.K.any() else np.ones_like(model.K)
    parts = (model.A, model.B, model.C, np.ones_like(model.D), gain)
    if known is None:
        return np.concatenate([part.ravel() != 0 for part in parts])
    kept = known.free_entries(model)
    return np.ones(sum(part.size for part in parts), bool) if kept is None else kept


def response_along(
    criterion: Criterion, theta: RealArray, step: RealArray, frequency: ArrayLike
) -> ComplexArray:
    """Change (F, ny, nu) of the response for a small step of the parameters, to first order."""
    return slope_along(lambda t: criterion.model(t).response(frequency), theta, step)


def slope_along(function: Callable[[RealArray], Array], theta: RealArray, step: RealArray) -> Array:
    """Derivative of a function along one standard deviation, by central differences."""
    small = 1e-4
    return np.asarray((function(theta + small * step) - function(theta - small * step)) / 2 / small)


def root_of_inverse(hessian: RealArray) -> RealArray:
    """Matrix R with R R' the inverse of a Hessian, where it has curvature."""
    return _curved(hessian)[0]


def _curved(hessian: RealArray) -> tuple[RealArray, RealArray]:
    """A root of the inverse of a Hessian, where it has curvature, and directions where it has none.

    The latter have the length of a standard deviation of the parameters, one by one.
    """
    values, vectors = scaled_eigen(hessian)
    kept = values > HESSIAN_ROUNDING * values[-1]
    return vectors[:, kept] / np.sqrt(values[kept]), vectors[:, ~kept]

"""What the errors of a linear model tell of a plant beyond it: distortion, and dynamics.

Distortion of a plant makes errors that depend on the input, so curvature does not tell their
effect on an estimate, and the best linear model of the plant is seldom of low order. Two tests see
this in a single record. Squares and cubes of the model's output must not tell its next error, and
past inputs must not, beyond what a change of the parameters explains. If they do, deviations are
those of a larger model, in which the error may depend on past inputs. They come from the scatter of
its equations over parts of the record, which is right for errors of any kind, and the difference
between both models counts as well. Where the input repeats, so does the distortion, and parts of
time would not show it. But at different lines of the spectrum it is as independent as noise is, so
there each line is a part.

Sources: J. Ramsey, "Tests for specification errors in classical linear least-squares regression
analysis", Journal of the Royal Statistical Society B 31(2), 1969 (powers of the fitted values);
L. Ljung, System Identification, 2nd ed., 1999, section 16.6 (errors and past inputs); H. White,
"Maximum likelihood estimation of misspecified models", Econometrica 50(1), 1982 (the covariance);
R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012,
chapter 3 (distortion at different lines).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter
from scipy.stats import chi2

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.curvature import (
    REMEMBERED,
    estimates_of,
    response_along,
)
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.whiteness import (
    WhitenedErrors,
    added_regressors,
    roots_where_new,
    whitened_errors,
)
from workbench.identification.record_tests.periods import common_period, period

LAGS, SLOWEST = 12, 10
"""Number of first-order lags through which past inputs count; the slowest takes a tenth of the
longest experiment.
"""
POWERS, DELAYS = (2, 3), (0, 1, 2)
"""Powers of the model's outputs, and delays [samples], from which its errors may follow."""
CHANCE = 1e-4
"""Errors count as told if chance alone explains that with a smaller probability than this.

It is so small because the distribution is of first order: of 124 records of linear plants, in many
of which a pole of the predictor came close to the unit circle, 16 % had probabilities below 5 %.
"""
PARTS = 30
"""Number of parts of a record whose input does not repeat, of which the scatter is taken."""
FEWEST_SAMPLES = 5 * PARTS
"""Fewest samples of a record whose scatter is taken."""
MOST_NUMBERS = 30_000_000
"""Largest table of regressors; the errors of larger records are not tested."""


@dataclass(frozen=True, eq=False)
class Distortion:
    """What one-step errors tell of a plant beyond its linear model.

    ``share``: of the errors' variance, that powers of the model's outputs tell; ``powers_chance``,
    ``inputs_chance``: probabilities of so much by chance, by powers and by past inputs. ``along``
    and ``regressors`` are directions of the parameters (P, k) and of the regressors of the
    whitened ``errors`` (ny, nu LAGS, k); ``change`` (k,) is the change along them that the errors
    ask for, and ``scatter`` (parts, k) that of parts of the record.
    """

    share: float
    powers_chance: float
    inputs_chance: float
    errors: WhitenedErrors
    poles: RealArray
    along: RealArray
    regressors: RealArray
    change: RealArray
    scatter: RealArray

    @property
    def found(self) -> bool:
        """Whether powers of the outputs, or past inputs, tell more than chance."""
        return min(self.powers_chance, self.inputs_chance) < CHANCE

    @property
    def words(self) -> str:
        """What was found, in words."""
        if self.powers_chance < CHANCE:
            return (
                f"squares and cubes of its output tell {self.share:.2g} of its errors' variance, "
                f"by chance with probability {self.powers_chance:.2g}: the plant is not linear"
            )
        chance = f"by chance with probability {self.inputs_chance:.2g}"
        return f"past inputs tell its errors, {chance}: it lacks a part of the plant"

    def moves(self, frequency: ArrayLike) -> ComplexArray:
        """Changes (1 + parts, F, ny, nu) of the response: to the larger model, and its scatter."""
        criterion, theta = self.errors.criterion, self.errors.theta
        model = criterion.model(theta)
        z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float)))[:, None]
        resolvent = np.linalg.inv(z[..., None] * np.eye(model.order) - model.A)
        noise = np.eye(len(model.C)) + model.C @ resolvent @ model.K
        filters = np.stack([np.polyval(a[::-1], 1 / z[:, 0]) for a in self.errors.filters], axis=1)
        unwhitened = np.linalg.inv(self.errors.whiten).T * filters[:, None] / filters[..., None]
        lags = (1 - self.poles) / (z - self.poles)
        late = z ** -np.asarray(model.delay_samples or (0,), dtype=float)
        shape = (len(model.C), model.B.shape[1], LAGS, -1)
        added = np.einsum(
            "fpo,oilk,fl->kfpi", noise @ unwhitened, self.regressors.reshape(shape), lags
        )
        each = [response_along(criterion, theta, one, frequency) for one in self.along.T]
        directions = np.array(each) + added * late[:, None]
        return np.tensordot(np.vstack([self.change, self.scatter]), directions, 1)


@lru_cache(maxsize=REMEMBERED)
def distortion_of(
    model: InnovationsModel,
    record: Experiments,
    direct: bool,
    known: Knowledge | None,
    repeats: int | None = None,
) -> Distortion | None:
    """What the one-step errors of a model on a record tell beyond it.

    ``repeats`` is the period of what drives it [samples]; None: that of the input, if it has one.
    The answer is None if the errors are too few, or too many. The last few are remembered.
    """
    own = estimates_of(model, record, direct, known)[0]
    if repeats is None and len(record.starts) == 1:
        repeats = common_period(record.u, [period(channel) for channel in record.u.T])
    return distortion_of_errors(own.criterion, own.theta, own.free, record, repeats)


def distortion_of_errors(
    criterion: Criterion,
    theta: RealArray,
    free: RealArray,
    record: Experiments,
    repeats: int | None,
    filters: list[RealArray] | None = None,
) -> Distortion | None:
    """What the one-step errors of parameters (P,) tell beyond a model; None as in `distortion_of`.

    The parameters were free along the columns of ``free`` (P, q); ``record`` is the criterion's,
    and ``repeats`` the period of what drives it [samples], None: it does not repeat.
    ``filters``, polynomials in the delay of a sample, make the errors of each output white; None:
    they are white without.
    """
    outputs, inputs = record.y.shape[1], record.u.shape[1]
    count = inputs * LAGS
    numbers = len(criterion.seen) * outputs * (count + len(POWERS) * len(DELAYS))
    if numbers > MOST_NUMBERS or len(criterion.seen) < FEWEST_SAMPLES:
        return None
    longest = max(len(u) for u, _ in record.pieces())
    constants = np.geomspace(1.0, max(longest / SLOWEST, 2.0), LAGS - 1)
    poles = np.append(0.0, np.exp(-1.0 / constants))
    errors = whitened_errors(criterion, theta, filters)
    added = _regressors(errors, poles)
    beside = added_regressors(errors, free, added)
    of_input = np.tile(np.arange(added.shape[2]) < count, outputs)
    lags = roots_where_new(beside.inner[np.ix_(of_input, of_input)], beside.sizes[of_input])
    asked = lags.T @ beside.score[of_input]

    # Powers count by what is new in them beside parameters and past inputs.
    shared = lags.T @ beside.inner[np.ix_(of_input, ~of_input)]
    rest = beside.inner[np.ix_(~of_input, ~of_input)] - shared.T @ shared
    powers = roots_where_new(rest, beside.sizes[~of_input])
    bent = powers.T @ (beside.score[~of_input] - shared.T @ asked)

    of_theta, of_lags = _contributions(errors, beside.root, added[..., :count], repeats)
    told = beside.told[:, of_input]
    scatter = np.hstack([of_theta, (of_lags - of_theta @ told) @ lags])
    along = np.hstack([-beside.root, beside.root @ told @ lags])
    still = np.zeros((outputs, count, beside.root.shape[1]))
    return Distortion(
        share=float(bent @ bent) / errors.white.size,
        powers_chance=_chance(bent),
        inputs_chance=_chance(asked),
        errors=errors,
        poles=poles,
        along=along,
        regressors=np.concatenate([still, lags.reshape(outputs, count, -1)], axis=2),
        change=np.concatenate([beside.slope, asked]),
        scatter=scatter,
    )


def _contributions(
    errors: WhitenedErrors, root: RealArray, added: RealArray, repeats: int | None
) -> tuple[RealArray, RealArray]:
    """Contributions of parts to the slopes along the root (parts, q), and to the inner products of
    regressors (N, ny, k) with the errors (parts, ny k): of thirty parts of time, less their mean,
    or of the lines of an input that repeats.
    """
    if repeats is not None:
        whole = np.concatenate([slopes @ root[columns] for _, columns, slopes in errors.rows()])
        of_root, of_added = (_by_line(errors.white, x, repeats) for x in (whole, added))
        return of_root.sum(axis=1), of_added.reshape(len(of_added), -1)
    seen = errors.criterion.seen
    parts = seen * PARTS // (seen[-1] + 1)
    of_root = np.zeros((PARTS, root.shape[1]))
    for block, columns, slopes in errors.rows():
        each = np.einsum("tpc,tp->tc", slopes, errors.white[block]) @ root[columns]
        np.add.at(of_root, parts[block], each)
    of_added = np.zeros((PARTS, *added.shape[1:]))
    np.add.at(of_added, parts, added * errors.white[..., None])
    centred = (x - x.mean(axis=0) for x in (of_root, of_added.reshape(PARTS, -1)))
    first, second = (x * np.sqrt(PARTS / (PARTS - 1)) for x in centred)
    return first, second


def _by_line(white: RealArray, regressors: RealArray, repeats: int) -> RealArray:
    """Contributions (lines, ny, k) to inner products of errors (N, ny) and regressors (N, ny, k).

    Frequencies count with the nearest line of a period of so many samples.
    """
    seen, spectrum = len(white), np.fft.rfft(white, axis=0) / len(white)
    spectrum[1 : (seen + 1) // 2] *= 2  # the negative frequencies
    line = np.rint(np.arange(len(spectrum)) * repeats / seen).astype(int)
    found = np.zeros((line[-1] + 1, *regressors.shape[1:]))
    for k in range(regressors.shape[2]):
        each = np.fft.rfft(regressors[..., k], axis=0).conj() * spectrum
        np.add.at(found[..., k], line, each.real)
    return found


def _chance(found: RealArray) -> float:
    """Probability that independent normal numbers (k,) of variance 1 are so large; 1 for none."""
    return float(chi2.sf(found @ found, len(found))) if len(found) else 1.0


def _regressors(errors: WhitenedErrors, poles: RealArray) -> RealArray:
    """Regressors (N, ny, nu LAGS + powers) of the errors: past inputs, then powers of an output.

    Past inputs are those through lags with these poles. All pass the errors' filters. A missing
    output has no error.
    """
    found = []
    runs = list(errors.criterion.driven(errors.theta))
    size = np.concatenate([driven for _, driven, _ in runs]).std(axis=0)
    for u, driven, y in runs:
        before = np.vstack([np.zeros_like(u[:1]), u[:-1]])
        past = np.stack([lfilter([1 - p], [1.0, -p], before, axis=0) for p in poles], axis=2)
        scaled = driven / np.maximum(size, np.finfo(float).tiny)
        bent = np.zeros((*y.shape, len(POWERS) * len(DELAYS)))
        for k, (power, delay) in enumerate(product(POWERS, DELAYS)):
            bent[delay:, :, k] = scaled[: len(y) - delay] ** power
        shared = np.broadcast_to(past.reshape(len(y), 1, -1), (*y.shape, past[0].size))
        both = np.where(np.isnan(y)[..., None], 0.0, np.concatenate([shared, bent], axis=2))
        each = zip(errors.filters, both.swapaxes(0, 1), strict=True)
        found.append(np.stack([lfilter(a, 1.0, one, axis=0) for a, one in each], axis=1))
    return np.concatenate(found)

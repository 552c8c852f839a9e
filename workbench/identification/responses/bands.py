"""Rational functions, polynomials among them, fitted by output error in narrow bands of lines.

Near each line the response of each input and the transient are rational functions with a common
denominator, as in a linear plant; without poles they are polynomials. The denominator is found by
linear fits, each weighted by the denominator of the last, then by Gauss-Newton steps of the output
error, so that output noise does not bias it.

Sources: T. McKelvey and G. Guérin, Non-parametric frequency response estimation using a local
rational model, 16th IFAC Symposium on System Identification, 2012; C. K. Sanathanan and J. Koerner,
IEEE Trans. Automatic Control 8(1), 1963; the covariance that holds for noise of unequal size:
J. G. MacKinnon and H. White, Journal of Econometrics 29(3), 1985.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import BoolArray, ComplexArray, IntegerArray, RealArray
from workbench.identification.responses.local_polynomial import SILENT, UNEXCITED

REWEIGHTED, STEPS = 3, 8
"""Number of reweighted linear fits, and of Gauss-Newton steps after them."""
SETTLED = 1e-4
"""Steps end when they change the squared residuals by less than this share."""
FIRST_DAMPING, DAMPING_FACTOR = 1e-3, 10.0
"""Damping of the first step, for slopes of length 1, and factor by which it changes after each
step.
"""
SINGULAR = 1e-13
"""Damping at which the equations, for slopes of length 1, can always be solved."""
LARGEST_LEVERAGE = 0.98
"""Leverage of a line above which its residual says nothing about its noise."""


@dataclass(frozen=True, eq=False)
class BandFits:
    """Results of the bands about F lines for one output.

    ``response`` (F, nu); ``variance`` (F, nu) of its error due to noise; ``unknowns`` (F,), number
    of coefficients, and ``free`` (F,), number of lines minus unknowns, both with mirrored lines
    counted once; ``lines`` (F, width), their numbers; ``squares`` (F, width), squared residuals at
    the lines; ``mirrored`` (F,), share of lines that a band contains twice.
    """

    response: ComplexArray
    variance: RealArray
    unknowns: RealArray
    free: RealArray
    lines: IntegerArray
    squares: RealArray
    mirrored: RealArray

    @cached_property
    def left(self) -> RealArray:
        """Sum (F,) of squared residuals."""
        found: RealArray = self.squares.sum(axis=1)
        return found

    def left_within(self, band: BandFits) -> RealArray:
        """Sum (F,) of squared residuals at the lines of a band that this one contains."""
        within = (self.lines >= band.lines[:, :1]) & (self.lines <= band.lines[:, -1:])
        found: RealArray = np.where(within, self.squares, 0.0).sum(axis=1)
        return found


def unknowns(inputs: int, degree: int, poles: int) -> int:
    """Number of coefficients of a band."""
    return (degree + 1) * (inputs + 1) + poles


def fitted_bands(
    U: ComplexArray,
    y: ComplexArray,
    samples: int,
    chosen: RealArray,
    width: int,
    models: Sequence[tuple[int, int]],
) -> list[BandFits]:
    """Fits of nested models about the chosen lines, from the spectra of a record.

    Parameters
    ----------
    U, y
        Spectra (L, nu) and (L,), from line 0 on, which is not used: it is the mean.
    chosen
        Numbers of lines, or places between lines, (F,).
    width
        Number of lines in a band. Bands extend beyond both ends of the spectrum by mirrored,
        conjugate lines, so that no line is at the edge of its band.
    models
        Degrees of the numerators and of the denominator; each model contains the one before, and
        starts from its coefficients if a linear fit is worse.
    """
    nu = U.shape[1]
    lines = np.round(chosen[:, None]).astype(int) - width // 2 + np.arange(width)
    lines += (lines >= 0) & (lines[:, :1] <= 0)  # without line 0
    around = lines % samples
    place = np.minimum(around, samples - around)
    mirrored = around > place
    inputs = np.where(mirrored[..., None], U[place].conj(), U[place])
    values = np.where(mirrored, y[place].conj(), y[place])
    columns = np.concatenate([inputs, np.ones((*lines.shape, 1))], axis=2)
    offset = 2.0 * (lines - chosen[:, None]) / width
    powers = offset[..., None] ** np.arange(max(max(model) for model in models) + 1)
    once = 1.0 + (np.diff(np.sort(place, axis=1), axis=1) > 0).sum(axis=1)
    found: list[BandFits] = []
    last: tuple[ComplexArray, ComplexArray] | None = None
    for degree, poles in models:
        fit = _Fit(columns, powers[..., : max(degree, poles) + 1], values, degree, poles)
        last, slopes, left = fit.solved(last)
        count = unknowns(nu, degree, poles)
        variance = _variance(slopes, left, nu, width - count)
        variance[_unexcited_bands(fit.above, degree, U)] = np.inf
        share = once / width
        sizes = count * share, (width - count) * share
        squares, twice = np.abs(left) ** 2, 2.0 * (1.0 - share)
        found.append(BandFits(last[0][:, :nu], variance, *sizes, lines, squares, twice))
    return found


def _unexcited_bands(above: ComplexArray, degree: int, U: ComplexArray) -> BoolArray:
    """Mask (F,) of bands in which an input excites too few lines for numerators of this degree."""
    size = np.linalg.norm(above, axis=1).reshape(len(above), degree + 1, -1)
    few = (size <= UNEXCITED * size[:, :1]).any(axis=(1, 2))
    silent = size[:, 0, :-1] <= SILENT * np.linalg.norm(U[1:], axis=0)
    dark: BoolArray = few | silent.any(axis=1)
    return dark


@dataclass(frozen=True, eq=False)
class _Fit:
    """Rational functions in F bands.

    The numerators' regressors are ``columns`` (F, width, nu + 1) times powers of the offset up to
    ``degree``; those of the denominator are powers from 1 to ``poles``. ``powers`` (F, width, ...)
    begin with 1; ``values`` (F, width).
    """

    columns: ComplexArray
    powers: RealArray
    values: ComplexArray
    degree: int
    poles: int

    @property
    def above(self) -> ComplexArray:
        """The numerators' regressors (F, width, n)."""
        powers = self.powers[..., : self.degree + 1]
        found: ComplexArray = powers[..., None] * self.columns[:, :, None]
        return found.reshape(*self.values.shape, -1)

    @property
    def count(self) -> int:
        """Number of coefficients of the numerators."""
        return (self.degree + 1) * self.columns.shape[2]

    def solved(
        self, smaller: tuple[ComplexArray, ComplexArray] | None
    ) -> tuple[tuple[ComplexArray, ComplexArray], ComplexArray, ComplexArray]:
        """Numerator (F, n) and denominator (F, poles) coefficients, their slopes, and residuals.

        ``smaller`` holds the coefficients of a model that this one contains.
        """
        theta = np.zeros((len(self.values), self.count + self.poles), complex)
        for _ in range(REWEIGHTED if self.poles else 1):
            denominator = self._denominator(theta)
            values = self.values / denominator
            theta = self._least_squares(denominator, values, values, SINGULAR)
        if self.poles:
            theta = self._descended(theta if smaller is None else self._better(theta, smaller))
        denominator, model = self._model(theta)
        below = -self.powers[..., 1 : self.poles + 1] * (model / denominator)[..., None]
        slopes = np.concatenate([self.above / denominator[..., None], below], axis=2)
        return (theta[:, : self.count], theta[:, self.count :]), slopes, self.values - model

    def _better(
        self, theta: ComplexArray, smaller: tuple[ComplexArray, ComplexArray]
    ) -> ComplexArray:
        """For each band, the coefficients with smaller residuals.

        Linear fits of large models can get trapped with poles beside a line, which follow its
        noise.
        """
        sizes = self.count, self.poles
        parts = [
            np.pad(part, ((0, 0), (0, size - part.shape[1])))
            for part, size in zip(smaller, sizes, strict=True)
        ]
        other = np.concatenate(parts, axis=1)
        less = [_square(self.values - self._model(one)[1]) for one in (other, theta)]
        found: ComplexArray = np.where((less[0] < less[1])[:, None], other, theta)
        return found

    def _descended(self, theta: ComplexArray) -> ComplexArray:
        """Coefficients after damped Gauss-Newton steps."""
        denominator, model = self._model(theta)
        left = self.values - model
        square = _square(left)
        damping = np.full(len(theta), FIRST_DAMPING)
        for _ in range(STEPS):
            step = self._least_squares(denominator, model / denominator, left, damping)
            tried, at = self._model(theta + step)
            after = _square(self.values - at)
            lower = after < square
            if not (after < (1.0 - SETTLED) * square).any():
                break
            theta = np.where(lower[:, None], theta + step, theta)
            denominator = np.where(lower[:, None], tried, denominator)
            model = np.where(lower[:, None], at, model)
            left, square = self.values - model, np.where(lower, after, square)
            damping *= np.where(lower, 1 / DAMPING_FACTOR, DAMPING_FACTOR)
        return theta

    def _denominator(self, theta: ComplexArray) -> ComplexArray:
        """Denominators (F, width), kept away from zero at the lines."""
        below = self.powers[..., 1 : self.poles + 1]
        found = 1.0 + (below @ theta[:, self.count :, None])[..., 0]
        tiny = np.sqrt(np.finfo(float).eps)
        result: ComplexArray = np.where(np.abs(found) < tiny, tiny, found)
        return result

    def _model(self, theta: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Denominators and models (F, width)."""
        denominator = self._denominator(theta)
        shape = len(theta), self.degree + 1, self.columns.shape[2]
        each = self.powers[..., : self.degree + 1] @ theta[:, : self.count].reshape(shape)
        return denominator, np.einsum("fwc,fwc->fw", each, self.columns) / denominator

    def _least_squares(
        self,
        denominator: ComplexArray,
        over: ComplexArray,
        values: ComplexArray,
        damping: RealArray | float,
    ) -> ComplexArray:
        """Coefficients (F, n) by damped least squares of the values on the slopes of a model.

        ``over`` is the model divided by the denominator. All slopes are powers of the offset times
        a few signals, so their products are moments of products of these signals; the damping is
        that for slopes of length 1.
        """
        signals = [self.columns / denominator[..., None], -over[..., None]]
        right = np.concatenate([*signals, values[..., None]], axis=2)
        left = right[..., :-1].conj()
        pairs = (left[..., None] * right[..., None, :]).reshape(*values.shape, -1)
        moments = (self._moments @ pairs.view(float)).view(complex)
        moments = moments.reshape(*moments.shape[:2], left.shape[2], right.shape[2])
        power, signal = self._places
        normal = moments[:, power[:, None] + power, signal[:, None], signal]
        diagonal = np.arange(len(power))
        scale = np.sqrt(normal[:, diagonal, diagonal].real)
        scale[scale == 0] = 1.0
        normal = normal / (scale[:, :, None] * scale[:, None, :])
        normal[:, diagonal, diagonal] += np.broadcast_to(damping, len(normal))[:, None] + SINGULAR
        told = moments[:, power, signal, -1] / scale
        found: ComplexArray = np.linalg.solve(normal, told[..., None])[..., 0] / scale
        return found

    @cached_property
    def _moments(self) -> RealArray:
        """Powers (F, ..., width) of the offset up to that of any product of two regressors."""
        most = self.powers.shape[2] - 1
        higher = self.powers[..., 1:] * self.powers[..., -1:]
        powers = np.concatenate([self.powers, higher], axis=2)[..., : 2 * most + 1]
        return np.ascontiguousarray(powers.swapaxes(1, 2))

    @cached_property
    def _places(self) -> tuple[IntegerArray, IntegerArray]:
        """For each coefficient, the power of the offset and the signal to which it belongs."""
        columns = self.columns.shape[2]
        power = [*np.repeat(np.arange(self.degree + 1), columns), *range(1, self.poles + 1)]
        signal = [*np.tile(np.arange(columns), self.degree + 1), *[columns] * self.poles]
        return np.array(power), np.array(signal)


def _square(x: ComplexArray) -> RealArray:
    found: RealArray = np.einsum("fw,fw->f", x, x.conj()).real
    return found


def _unit(slopes: ComplexArray) -> tuple[ComplexArray, RealArray]:
    """Columns scaled to length 1, and their lengths: inputs may differ by orders of magnitude."""
    scale = np.linalg.norm(slopes, axis=1)
    scale[scale == 0] = 1.0
    return slopes / scale[:, None], scale


def _variance(slopes: ComplexArray, left: ComplexArray, nu: int, free: int) -> RealArray:
    """E|error|^2 (F, nu) of the first coefficients: the larger of two estimates.

    One assumes equal noise over the band, the other separate noise at each line, which covers slow
    noise, and distortions at excited lines only.
    """
    unit, scale = _unit(slopes)
    Q, R = np.linalg.qr(unit)
    pivots = np.arange(R.shape[1])
    weak = np.abs(R[:, pivots, pivots]).min(axis=1) < np.sqrt(SINGULAR)
    R[weak] = np.eye(R.shape[1])
    ahead = np.linalg.solve(R.conj().swapaxes(1, 2), np.eye(R.shape[1])[:, :nu])
    power = np.abs(left) ** 2
    alike = power.sum(axis=1)[:, None] / free * np.sum(np.abs(ahead) ** 2, axis=1)
    leverage = np.minimum(np.sum(np.abs(Q) ** 2, axis=2), LARGEST_LEVERAGE)
    own = np.einsum("fwi,fw->fi", np.abs(Q @ ahead) ** 2, power / (1.0 - leverage))
    variance: RealArray = np.maximum(alike, own) / scale[:, :nu] ** 2
    variance[weak] = np.inf
    return variance

"""Frequency response and its variance from one arbitrary record, by the local polynomial method.

In a narrow band around each frequency, the response and the transients from the two ends of the
record are modelled as polynomials of the frequency. Least squares over the lines of the band gives
both, and the residuals give the noise.

Source: R. Pintelon, J. Schoukens, G. Vandersteen and K. Barbe, "Estimation of nonparametric noise
and FRF models for multivariable systems", Mechanical Systems and Signal Processing 24, 2010.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import IdentificationWarning, checked_record
from workbench.identification.experiments.reports import report_of_arrays


@dataclass(frozen=True, eq=False)
class LocalPolynomial:
    """A response at F frequencies, with the covariance of its errors.

    Parameters
    ----------
    cycles_per_sample
        Frequencies (F,) [cycles/sample].
    response
        Complex (F, ny, nu).
    covariance
        Covariance (F, ny nu, ny nu) of the entries of the response, row by row.
    noise
        Covariance (F, ny, ny) of the discrete Fourier transform, scaled by 1/sqrt(N), of the output
        noise.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import local_polynomial
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = local_polynomial(u[:, None], y[:, None], at=[100, 200])
    >>> found.cycles_per_sample.tolist(), found.variance.shape
    ([0.1, 0.2], (2, 1, 1))
    """

    cycles_per_sample: RealArray
    response: ComplexArray
    covariance: ComplexArray
    noise: ComplexArray

    @property
    def variance(self) -> RealArray:
        """E|error|^2 of each entry (F, ny, nu)."""
        diagonal = np.einsum("fii->fi", self.covariance).real
        result: RealArray = diagonal.reshape(self.response.shape)
        return result


UNEXCITED = 1e-8
"""Slope of an input over a band, relative to the input there, that counts as rounding."""
SILENT = 1e-13
"""Size of an input over a band, relative to that over all lines, that counts as rounding."""
UNTOLD = 1e-14
"""Regressors of length 1 are independent if the smallest eigenvalue of their products
exceeds this.
"""
SPARE_LINES = 8
"""Default number of lines in a band minus the number of unknowns."""
LINES_AT_ONCE = 8192
"""Number of lines whose bands are in memory at once."""


def local_polynomial(
    u: ArrayLike,
    y: ArrayLike,
    *,
    degree: int = 2,
    lines: int | None = None,
    at: ArrayLike | None = None,
    assume: str | Sequence[str] = (),
) -> LocalPolynomial:
    """Response from u (N, nu) to y (N, ny) at lines of the record between 0 and 1/2.

    A single channel may be given as (N,).

    The loop must be open; for a plant in a closed loop use `driven_response`. The memory used,
    apart from the record, its spectra and the result, does not grow with N.

    Parameters
    ----------
    degree
        Degree of the polynomials.
    lines
        Number of lines of a band; by default eight more than the unknowns. More lines lower the
        variance but blur resonances.
    at
        Numbers (F,) of the lines, rising, from 1 to the last one below 1/2; None: all of them.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Raises
    ------
    InputError
        The same as for `checked_record`; a finding forbids the use of the record; the band has too
        few lines for its unknowns, or the record for the band; or the numbers are not such lines.

    Warns
    -----
    IdentificationWarning
        An input excites too few lines of a band, as a periodic input does: the response is NaN
        there.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import local_polynomial
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = local_polynomial(u[:, None], y[:, None])
    >>> exact = 0.5 / (np.exp(2j * np.pi * found.cycles_per_sample) - 0.5)
    >>> bool(abs(found.response[:, 0, 0] - exact).max() < 1e-3)
    True
    """
    u, y = checked_record(u, y)
    report_of_arrays(u, y, assume)
    return polynomials_in_bands(u, y, degree, lines, at=at)


def polynomials_in_bands(
    u: RealArray,
    y: RealArray,
    degree: int = 2,
    lines: int | None = None,
    *,
    at: ArrayLike | None = None,
) -> LocalPolynomial:
    """As `local_polynomial`, for a record that has been checked."""
    unknowns = (degree + 1) * (u.shape[1] + 1)
    width = unknowns + SPARE_LINES if lines is None else lines
    return fitted_in_bands(u, y, degree, unknowns, width, at, _at_lines)


FitInBands = Callable[
    [ComplexArray, ComplexArray, np.ndarray, int, int],
    tuple[ComplexArray, ComplexArray, ComplexArray],
]
"""Function of the spectra of input and output, lines, a degree and the width of bands; it returns
the responses, their covariances and those of the noise.
"""


def fitted_in_bands(
    u: RealArray,
    y: RealArray,
    degree: int,
    unknowns: int,
    width: int,
    at: ArrayLike | None,
    fit: FitInBands,
) -> LocalPolynomial:
    """Results of a fit with this number of unknowns, in bands about the lines asked for."""
    samples, nu = u.shape
    # Omit line 0, the mean, which has been removed, and the last line of an even record, which is
    # real.
    U, Y = (spectrum(x)[1 : (samples + 1) // 2] for x in (u, y))
    if width <= unknowns or width > len(U):
        raise InputError(
            f"bands of {width} lines in a record that has {len(U)}: more than {unknowns} are "
            f"needed for {nu} inputs and degree {degree}; take a longer record or a lower degree"
        )
    chosen = np.arange(len(U)) if at is None else line_numbers(at, len(U)) - 1
    ny = Y.shape[1]
    response = np.empty((chosen.size, ny, nu), complex)
    covariance = np.empty((chosen.size, ny * nu, ny * nu), complex)
    noise = np.empty((chosen.size, ny, ny), complex)
    for start in range(0, chosen.size, LINES_AT_ONCE):
        part = slice(start, start + LINES_AT_ONCE)
        response[part], covariance[part], noise[part] = fit(U, Y, chosen[part], degree, width)
    return LocalPolynomial((chosen + 1) / samples, response, covariance, noise)


def spectrum(x: RealArray) -> ComplexArray:
    """Transform (lines, channels) of a record without its mean, scaled by 1/sqrt(N)."""
    found = np.empty((len(x) // 2 + 1, x.shape[1]), complex)
    for k, channel in enumerate(x.T):  # one channel at a time, since each is copied
        found[:, k] = np.fft.rfft(channel - channel.mean())
    found /= np.sqrt(len(x))
    return found


def line_numbers(at: ArrayLike, last: int) -> np.ndarray:
    """Rising whole numbers from 1 to the last line; raises InputError for others."""
    given = np.asarray(at)
    whole = given.ndim == 1 and given.size and np.issubdtype(given.dtype, np.integer)
    if not whole or given[0] < 1 or given[-1] > last or (np.diff(given) <= 0).any():
        raise InputError(
            f"at must be rising whole numbers of lines, (F,), from 1 to {last}, not {at!r:.60}"
        )
    return given


def _at_lines(
    U: ComplexArray, Y: ComplexArray, chosen: np.ndarray, degree: int, width: int
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Responses, their covariances and noise covariances at lines (F,), numbered from 0."""
    nu, unknowns = U.shape[1], (degree + 1) * (U.shape[1] + 1)
    first = np.clip(chosen - width // 2, 0, len(U) - width)
    band = first[:, None] + np.arange(width)
    offset = (band - chosen[:, None]) / width
    powers = offset[..., None] ** np.arange(degree + 1)
    columns = np.concatenate([U[band], np.ones((*band.shape, 1))], axis=2)
    regressors = (powers[..., None] * columns[:, :, None]).reshape(*band.shape, unknowns)

    # Scale each column to norm 1, because the inputs may differ by orders of magnitude.
    scale = np.linalg.norm(regressors, axis=1)
    dark = dark_bands(U, regressors, scale, chosen, degree)
    regressors[dark], scale[dark] = np.eye(width, unknowns), 1.0  # not used
    Q, R = np.linalg.qr(regressors / scale[:, None])
    theta = np.linalg.solve(R, Q.conj().swapaxes(1, 2) @ Y[band]) / scale[..., None]
    left = Y[band] - regressors @ theta
    noise = left.swapaxes(1, 2) @ left.conj() / (width - unknowns)
    inverse = np.linalg.inv(R)[:, :nu] / scale[:, :nu, None]
    spread = inverse @ inverse.conj().swapaxes(1, 2)
    covariance = np.einsum("fij,fkl->fikjl", noise, spread)
    for unknown in (theta, covariance, noise):
        unknown[dark] = np.nan
    size = Y.shape[1] * nu
    return theta[:, :nu].swapaxes(1, 2), covariance.reshape(len(chosen), size, size), noise


def dark_bands(
    U: ComplexArray, regressors: ComplexArray, scale: RealArray, chosen: np.ndarray, degree: int
) -> BoolArray:
    """Mask (F,) of bands where an input excites too few lines; warns of them.

    ``regressors`` (F, width, (degree + 1) (nu + 1)) are those of inputs and transient, ``scale``
    their norms.
    """
    nu = U.shape[1]
    parts = scale.reshape(len(chosen), degree + 1, nu + 1)
    dark = (parts <= UNEXCITED * parts[:, :1]).any(axis=(1, 2))
    dark |= (parts[:, 0, :nu] <= SILENT * np.linalg.norm(U, axis=0)).any(axis=1)
    lit = np.flatnonzero(~dark)
    columns = regressors[lit] / scale[lit][:, None]
    least = np.linalg.eigvalsh(columns.conj().swapaxes(1, 2) @ columns)[:, 0]
    dark[lit[least <= UNTOLD]] = True
    if dark.any():
        warnings.warn(
            f"an input excites too few lines about line {chosen[np.argmax(dark)] + 1} and "
            f"{dark.sum() - 1} others for degree {degree}: their response is NaN; take "
            "`periodic_local_polynomial` for periodic inputs, or more lines",
            IdentificationWarning,
            stacklevel=5,
        )
    return dark

"""Frequency response and its variance from one arbitrary record, by the local polynomial method.

In a narrow band around each frequency, the response and the transients from the two ends of the
record are modelled as polynomials of the frequency. Least squares over the lines of the band gives
both, and the residuals give the noise.

Source: R. Pintelon, J. Schoukens, G. Vandersteen and K. Barbe, "Estimation of nonparametric noise
and FRF models for multivariable systems", Mechanical Systems and Signal Processing 24, 2010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record


@dataclass(frozen=True, eq=False)
class LocalPolynomial:
    """A response at F frequencies, with the covariance of its errors.

    Parameters
    ----------
    frequency
        Frequencies (F,) [cycles/sample].
    response
        Complex (F, ny, nu).
    covariance
        Covariance (F, ny nu, ny nu) of the entries of the response, row by row.
    noise
        Covariance (F, ny, ny) of the discrete Fourier transform, scaled by 1/sqrt(N), of the output
        noise.
    """

    frequency: RealArray
    response: ComplexArray
    covariance: ComplexArray
    noise: ComplexArray

    @property
    def variance(self) -> RealArray:
        """E|error|^2 of each entry (F, ny, nu)."""
        diagonal = np.einsum("fii->fi", self.covariance).real
        result: RealArray = diagonal.reshape(self.response.shape)
        return result


def local_polynomial(
    u: ArrayLike, y: ArrayLike, degree: int = 2, lines: int | None = None
) -> LocalPolynomial:
    """Response from u (N, nu) to y (N, ny) at every line of the record between 0 and 1/2.

    Parameters
    ----------
    degree
        Degree of the polynomials.
    lines
        Number of lines of a band; by default eight more than the unknowns. More lines lower the
        variance but blur resonances.

    Raises
    ------
    InputError
        The same as for `checked_record`; too few lines in the band for its unknowns, or in the
        record for the band.
    """
    u, y = checked_record(u, y)
    samples, nu = u.shape
    unknowns = (degree + 1) * (nu + 1)
    width = unknowns + 8 if lines is None else lines
    spectra = [np.fft.rfft(x - x.mean(axis=0), axis=0) / np.sqrt(samples) for x in (u, y)]
    # Leave out line 0, the mean, which is removed, and the last line of an even record, a real one.
    U, Y = (spectrum[1 : (samples + 1) // 2] for spectrum in spectra)
    if width <= unknowns or width > len(U):
        raise InputError(
            f"bands of {width} lines in a record that has {len(U)}: more than {unknowns} are "
            f"needed for {nu} inputs and degree {degree}; take a longer record or a lower degree"
        )
    first = np.clip(np.arange(len(U)) - width // 2, 0, len(U) - width)
    band = first[:, None] + np.arange(width)
    offset = (band - np.arange(len(U))[:, None]) / width
    powers = offset[..., None] ** np.arange(degree + 1)
    columns = np.concatenate([U[band], np.ones((*band.shape, 1))], axis=2)
    regressors = (powers[..., None] * columns[:, :, None]).reshape(*band.shape, unknowns)

    # Scale each column to norm 1, because the inputs may differ by orders of magnitude.
    scale = np.linalg.norm(regressors, axis=1)
    Q, R = np.linalg.qr(regressors / scale[:, None])
    theta = np.linalg.solve(R, Q.conj().swapaxes(1, 2) @ Y[band]) / scale[..., None]
    left = Y[band] - regressors @ theta
    noise = left.swapaxes(1, 2) @ left.conj() / (width - unknowns)
    inverse = np.linalg.inv(R)[:, :nu] / scale[:, :nu, None]
    spread = inverse @ inverse.conj().swapaxes(1, 2)
    covariance = np.einsum("fij,fkl->fikjl", noise, spread)
    size = Y.shape[1] * nu
    return LocalPolynomial(
        np.arange(1, len(U) + 1) / samples,
        theta[:, :nu].swapaxes(1, 2),
        covariance.reshape(len(U), size, size),
        noise,
    )

"""Frequency response and its variance from one arbitrary record, by the local rational method.

In a narrow band around each frequency, response and transient of an output are rational functions
with a common denominator, as in a linear plant. A resonance only a few lines wide, which
polynomials blur, is followed exactly. The equation error is linear in the coefficients, but the
output's noise enters the regressors: if the noise is large, polynomials over more lines are better.

Source: T. McKelvey and G. Guérin, Non-parametric frequency response estimation using a local
rational model, 16th IFAC Symposium on System Identification, 2012.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray
from workbench.identification.experiments.quality import checked_record
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.responses.local_polynomial import (
    LocalPolynomial,
    dark_bands,
    fitted_in_bands,
)

SPARE_LINES = 12
"""Default number of lines in a band minus the number of unknowns."""


def local_rational(
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

    Parameters
    ----------
    degree
        Degree of numerators, transients and denominators.
    lines
        Number of lines of a band; by default twelve more than the unknowns.
    at
        Numbers (F,) of the lines, rising, from 1 to the last one below 1/2; None: all of them.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Raises
    ------
    InputError
        The same as for `local_polynomial`.

    Warns
    -----
    IdentificationWarning
        The same as for `local_polynomial`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import local_rational
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = local_rational(u[:, None], y[:, None], at=[100, 200])
    >>> exact = 0.5 / (np.exp(2j * np.pi * found.cycles_per_sample) - 0.5)
    >>> bool(abs(found.response[:, 0, 0] - exact).max() < 1e-3)
    True
    """
    u, y = checked_record(u, y)
    report_of_arrays(u, y, assume)
    unknowns = (degree + 1) * (u.shape[1] + 1) + degree
    width = unknowns + SPARE_LINES if lines is None else lines
    return fitted_in_bands(u, y, degree, unknowns, width, at, _in_bands)


def _in_bands(
    U: ComplexArray, Y: ComplexArray, chosen: np.ndarray, degree: int, width: int
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Responses, their covariances and noise covariances at lines (F,), numbered from 0."""
    nu, ny = U.shape[1], Y.shape[1]
    unknowns = (degree + 1) * (nu + 1) + degree
    first = np.clip(chosen - width // 2, 0, len(U) - width)
    band = first[:, None] + np.arange(width)
    offset = 2.0 * (band - chosen[:, None]) / width
    powers = offset[..., None] ** np.arange(degree + 1)
    columns = np.concatenate([U[band], np.ones((*band.shape, 1))], axis=2)
    known = (powers[..., None] * columns[:, :, None]).reshape(*band.shape, -1)
    dark = dark_bands(U, known, np.linalg.norm(known, axis=1), chosen, degree)
    known[dark] = np.eye(width, known.shape[2])  # not used
    response = np.empty((len(chosen), ny, nu), complex)
    left = np.empty((len(chosen), width, ny), complex)
    maps = np.empty((len(chosen), ny, nu, width), complex)
    for output in range(ny):
        values = Y[band, output]
        own = -powers[..., 1:] * values[..., None]
        regressors = np.concatenate([known, own], axis=2)
        scale = np.linalg.norm(regressors, axis=1)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(regressors / scale[:, None]) / scale[..., None]
        theta = (inverse @ values[..., None])[..., 0]
        response[:, output] = theta[:, :nu]
        left[:, :, output] = values - (regressors @ theta[..., None])[..., 0]
        maps[:, output] = inverse[:, :nu]
    noise = left.swapaxes(1, 2) @ left.conj() / (width - unknowns)
    shared = np.einsum("foiw,fqjw->foiqj", maps, maps.conj())
    covariance = noise[:, :, None, :, None] * shared
    for unknown in (response, covariance, noise):
        unknown[dark] = np.nan
    return response, covariance.reshape(len(chosen), ny * nu, ny * nu), noise

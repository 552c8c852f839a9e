"""Best linear approximation of a nonlinear plant from several realisations of its excitation.

With random phases and a fixed amplitude spectrum, the response of a nonlinear plant is that of its
best linear approximation plus a distortion. The distortion looks like noise, but is the same in
every period; it varies only between realisations. So the scatter over realisations is distortion
and noise, and the scatter over periods is noise alone (J. Schoukens, R. Pintelon, T. Dobrowiecki
and Y. Rolain, Automatica 41(3), 2005; R. Pintelon and J. Schoukens, System Identification, 2nd ed.,
2012, section 4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.responses.periodic import ResponseEstimate


@dataclass(frozen=True, eq=False, repr=False)
class LinearApproximation(ResponseEstimate):
    """The mean of responses to several realisations, with its variance by noise and distortion.

    Parameters
    ----------
    covariance
        Covariance (F, ny nu, ny nu) of the entries of the mean, row by row, due to noise and
        distortion.
    noise_variance
        Variance (F, ny, nu) of the mean due to noise alone.
    distortion_variance
        Variance (F, ny, nu) of a single realisation's response due to distortion. It is unbiased,
        so without distortion it is negative about as often as positive.
    realisations
        Number of realisations.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, best_linear_approximation
    >>> frequency, variance = np.array([1.0]), np.full((1, 1, 1), 1e-6)
    >>> seen = [
    ...     ResponseEstimate(frequency, np.full((1, 1, 1), g + 0j), variance, 6.0)
    ...     for g in (1.9, 2.1)
    ... ]
    >>> found = best_linear_approximation(seen)
    >>> float(found.response[0, 0, 0].real), bool(found.distortion_variance[0, 0, 0] > 1e-3)
    (2.0, True)
    """

    covariance: np.ndarray
    noise_variance: RealArray
    distortion_variance: RealArray
    realisations: int


def best_linear_approximation(responses: Sequence[ResponseEstimate]) -> LinearApproximation:
    """The best linear approximation from responses to independent realisations.

    Parameters
    ----------
    responses
        At least two responses at the same frequencies, each to a different realisation of random
        phases and with the variance due to its noise alone, as from `periodic_local_polynomial`.

    Raises
    ------
    InputError
        Fewer than two responses, or responses with different frequencies or sizes.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import (
    ...     best_linear_approximation,
    ...     periodic_local_polynomial,
    ...     random_multisine,
    ... )
    >>> rng, lines, responses = np.random.default_rng(0), np.arange(1, 20, 2), []
    >>> for _ in range(4):
    ...     u = np.tile(random_multisine(lines, 0.3, 64, rng).period(), 4)
    ...     y = control.forced_response(
    ...         control.tf([0.5], [1, -0.5], 1.0), inputs=u + 0.1 * u**3
    ...     ).outputs
    ...     y += 1e-3 * rng.standard_normal(len(y))
    ...     responses.append(periodic_local_polynomial(u[:, None], y[:, None], 64, lines=lines))
    ...
    >>> found = best_linear_approximation(responses)
    >>> found.realisations, bool((found.variance >= found.noise_variance).mean() > 0.8)
    (4, True)
    """
    given = list(responses)
    if len(given) < 2:
        raise InputError(
            f"{len(given)} realisation given: two are needed to tell distortion, which is the same "
            "in every period, from the response"
        )
    first = given[0]
    for number, each in enumerate(given[1:], 2):
        same = each.response.shape == first.response.shape
        if not same or not np.allclose(each.frequency_hz, first.frequency_hz, rtol=1e-9):
            raise InputError(f"realisation {number} has other frequencies or sizes than the first")
    values = np.stack([each.response for each in given])
    count = len(given)
    mean = values.mean(axis=0)
    left = (values - mean).reshape(count, len(mean), -1)
    covariance = np.einsum("rfa,rfb->fab", left, left.conj()) / (count * (count - 1))
    variance = np.einsum("faa->fa", covariance).real.reshape(mean.shape)
    noise = np.mean([each.variance for each in given], axis=0) / count
    return LinearApproximation(
        frequency_hz=first.frequency_hz,
        response=mean,
        variance=variance,
        degrees=2.0 * (count - 1),
        covariance=covariance,
        noise_variance=noise,
        distortion_variance=count * (variance - noise),
        realisations=count,
    )

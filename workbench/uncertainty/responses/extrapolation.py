"""From a few measured plants to the whole production: sets that contain a new plant with a
probability.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.input_checks import is_real, need_kind
from workbench.uncertainty.responses.plants import Responses

POLYGON_CORNERS = 24
"""Number of corners of the polygon around each prediction ellipse."""
MIN_PLANTS = 4
"""Least number of measured plants at a frequency for the estimate of a covariance."""


def widened_responses(responses: Responses, content: float) -> Responses:
    """The responses with an additional region at each frequency in which a further plant is
    expected.

    Assume that at each frequency the plants are drawn independently from one bivariate normal
    distribution of real and imaginary part. Then a further plant lies in the ellipse

        (x - mean)' S^-1 (x - mean) <= 2 (n - 1)(n + 1) / (n (n - 2)) F_{2, n-2}(content)

    with exactly the probability ``content``: this is Hotelling's prediction region of the n
    measured plants. The corners of a polygon around it are added as plants, so that every cover of
    the result contains it. The assumption is stored with the responses and printed in the cover's
    certificate. The probability holds at each single frequency, not at all of them together.

    Parameters
    ----------
    content
        Probability, between 0 and 1.

    Raises
    ------
    InputError
        The content is outside (0, 1), or there are fewer than 4 plants at a frequency.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, UncertaintyModel, widened_responses
    >>> omega = np.geomspace(1, 100, 30)
    >>> plants = Responses(
    ...     omega=omega, values=np.array(
    ...         [gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]
    ...     ).T
    ... )
    >>> model = UncertaintyModel(control.tf([30.0], [1.0, 30.0]), control.tf([0.11], [1.0]))
    >>> rng = np.random.default_rng(0)
    >>> many = Responses(omega=omega, values=1 + 0.1 * rng.standard_normal((30, 6, 2)) @ [1, 1j])
    >>> widened_responses(many, content=0.9).values.shape[1] > 6
    True
    """
    need_kind(responses, Responses, "responses")
    if not (is_real(content) and 0 < content < 1):
        raise InputError(f"content is a probability between 0 and 1, it is {content}")
    count = responses.present.sum(axis=1)
    if count.min() < MIN_PLANTS:
        raise InputError(
            f"{count.min()} plants at {responses.place(int(count.argmin()))} say too little about "
            f"a distribution: {MIN_PLANTS} or more are needed"
        )
    corners = prediction_polygon(responses.values, responses.present, content)
    return Responses(
        omega=responses.omega,
        values=np.hstack([responses.values, corners]),
        present=np.hstack([responses.present, np.ones(corners.shape, bool)]),
        plants=[*responses.plants, *(f"predicted {k + 1}" for k in range(POLYGON_CORNERS))],
        dt=responses.dt,
        unit=responses.unit,
        assumption=(
            "at each frequency the plants are drawn independently from one bivariate normal "
            f"distribution; then a further plant lies inside with probability {content:g}"
        ),
        known=[*responses.known, *[None] * POLYGON_CORNERS] if responses.known else None,
        reports=responses.reports,
    )


def prediction_polygon(values: ComplexArray, present: np.ndarray, content: float) -> ComplexArray:
    """Polygons (F, POLYGON_CORNERS) around the prediction ellipses of the measured values."""
    count = present.sum(axis=1)
    points = np.stack([values.real, values.imag], axis=-1)
    mean = np.where(present[..., None], points, 0).sum(axis=1) / count[:, None]
    away = np.where(present[..., None], points - mean[:, None], 0)
    covariance = np.einsum("fni,fnj->fij", away, away) / (count - 1)[:, None, None]
    quantile = stats.f.ppf(content, 2, count - 2)
    size = np.sqrt(2 * (count - 1) * (count + 1) / (count * (count - 2)) * quantile)
    spread, axes = np.linalg.eigh(covariance)
    spread = np.sqrt(np.maximum(spread, 0))
    turn = 2 * math.pi * np.arange(POLYGON_CORNERS) / POLYGON_CORNERS
    circle = np.stack([np.cos(turn), np.sin(turn)]) / math.cos(math.pi / POLYGON_CORNERS)
    scaled: RealArray = axes @ (spread[..., None] * circle) * size[:, None, None]
    corners: ComplexArray = (mean[..., None] + scaled)[:, 0] + 1j * (mean[..., None] + scaled)[:, 1]
    return corners

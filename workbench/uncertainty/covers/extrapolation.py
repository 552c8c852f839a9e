"""From a few measured plants to all that are made: sets of a stated probability content."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.uncertainty.covers.responses import Responses

CORNERS = 24
"""Corners of the polygon drawn around each ellipse."""
FEWEST = 4
"""Measured plants needed at every frequency for a covariance that means anything."""


def widened(responses: Responses, content: float) -> Responses:
    """The responses and, at each frequency, a region where a further plant is to be expected.

    Under the assumption that at each frequency the plants are drawn independently from one
    bivariate normal distribution of real and imaginary part, a further plant lies in the ellipse

        (x - mean)' S^-1 (x - mean) <= 2 (n - 1)(n + 1) / (n (n - 2)) F_{2, n-2}(content)

    with the probability ``content``, exactly: Hotelling's prediction region of the n measured
    ones. The corners of a polygon around it are added as plants, so that every cover of the result
    contains it. The assumption goes along and stands in the cover's certificate. It holds at each
    frequency by itself, not at all of them together.

    Parameters
    ----------
    content
        Probability, between 0 and 1.

    Raises
    ------
    InputError
        A content outside (0, 1); fewer than 4 plants at a frequency.
    """
    if not 0 < content < 1:
        raise InputError(f"content is a probability between 0 and 1, it is {content}")
    count = responses.present.sum(axis=1)
    if count.min() < FEWEST:
        raise InputError(
            f"{count.min()} plants at {responses.place(int(count.argmin()))} say too little about "
            f"a distribution: {FEWEST} or more are needed"
        )
    corners = prediction_polygon(responses.values, responses.present, content)
    return Responses(
        responses.omega,
        np.hstack([responses.values, corners]),
        np.hstack([responses.present, np.ones(corners.shape, bool)]),
        [*responses.plants, *(f"predicted {k + 1}" for k in range(CORNERS))],
        unit=responses.unit,
        assumption=(
            "at each frequency the plants are drawn independently from one bivariate normal "
            f"distribution; then a further plant lies inside with probability {content:g}"
        ),
    )


def prediction_polygon(values: ComplexArray, present: np.ndarray, content: float) -> ComplexArray:
    """Corners (F, CORNERS) of a polygon around the prediction ellipse of the present values."""
    count = present.sum(axis=1)
    points = np.stack([values.real, values.imag], axis=-1)
    mean = np.where(present[..., None], points, 0).sum(axis=1) / count[:, None]
    away = np.where(present[..., None], points - mean[:, None], 0)
    covariance = np.einsum("fni,fnj->fij", away, away) / (count - 1)[:, None, None]
    quantile = stats.f.ppf(content, 2, count - 2)
    size = np.sqrt(2 * (count - 1) * (count + 1) / (count * (count - 2)) * quantile)
    spread, axes = np.linalg.eigh(covariance)
    spread = np.sqrt(np.maximum(spread, 0))
    turn = 2 * math.pi * np.arange(CORNERS) / CORNERS
    circle = np.stack([np.cos(turn), np.sin(turn)]) / math.cos(math.pi / CORNERS)
    scaled: RealArray = axes @ (spread[..., None] * circle) * size[:, None, None]
    corners: ComplexArray = (mean[..., None] + scaled)[:, 0] + 1j * (mean[..., None] + scaled)[:, 1]
    return corners

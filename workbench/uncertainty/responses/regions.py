"""Confidence regions of measured responses, which a cover of the plants must contain because of
noise.

An estimate differs from the true response by its noise. The region of a response is the disc around
its estimate that contains the true response with a given probability. A cover that contains the
regions contains each plant with that probability, at each single frequency.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import IdentificationWarning
from workbench.input_checks import is_real
from workbench.uncertainty.responses.plants import Responses

REGION_CORNERS = 12
"""Number of corners of the polygon around each disc; its corners lie 3.5 % outside."""


def with_regions(responses: Responses, confidence: float) -> Responses:
    """The responses, where each one is replaced by the corners of a polygon around its confidence
    region.

    Raises
    ------
    InputError
        The confidence is not between 0 and 1, or the responses have no variance.
    """
    if not (is_real(confidence) and 0 < confidence < 1):
        raise InputError(f"confidence is {confidence!r}; it must lie between 0 and 1")
    if responses.confidence == confidence:
        return responses
    if responses.variance is None or responses.confidence is not None:
        raise InputError(
            "the responses have no variance: take Responses.from_files of records, "
            "Responses.from_estimates, or give variance="
        )
    responses = _with_ends(responses, confidence)
    radius = region_radius(responses, confidence)
    _warn_of_noise(responses, radius)
    turn = np.exp(2j * np.pi * np.arange(REGION_CORNERS) / REGION_CORNERS)
    reach = radius / np.cos(np.pi / REGION_CORNERS)
    corners = responses.values[..., None] + reach[..., None] * turn
    count = len(responses.omega), len(responses.plants) * REGION_CORNERS
    said = (
        f"the discs about the {len(responses.plants)} estimates hold the true responses, each "
        f"with probability {confidence:g}, at each single frequency"
    )
    return replace(
        responses,
        values=corners.reshape(count),
        present=np.repeat(responses.present, REGION_CORNERS, axis=1),
        plants=tuple(
            f"{name} ({k + 1})" for name in responses.plants for k in range(REGION_CORNERS)
        ),
        assumption="; ".join(filter(None, [responses.assumption, said])),
        known=(),
        variance=None,
        ratios=None,
        degrees=np.full(count[1], np.inf),
        confidence=confidence,
    )


def _with_ends(responses: Responses, confidence: float) -> Responses:
    """The responses at the frequencies where all regions are finite; warns of the other
    frequencies.
    """
    endless = (responses.present & ~np.isfinite(region_radius(responses, confidence))).any(axis=1)
    if not endless.any():
        return responses
    at = responses.frequency_hz[endless]
    told = (
        f"at {endless.sum()} of {endless.size} frequencies, from {at[0]:.6g} to {at[-1]:.6g} Hz, a "
        f"{100 * confidence:g} % region has no end, since the excitation is hardly seen in the "
        "input"
    )
    if endless.size - endless.sum() < 2:
        raise InputError(f"{told}: excite more, measure longer, or ask for a lower confidence")
    warnings.warn(f"{told}; they are left out", IdentificationWarning, stacklevel=5)
    return responses.at(np.flatnonzero(~endless))


def _warn_of_noise(responses: Responses, radius: RealArray) -> None:
    """Warn if a region contains zero, since it is then unknown whether the plant responds at
    all.
    """
    hidden = (responses.present & (radius >= np.abs(responses.values))).any(axis=1)
    if hidden.any():
        at = responses.frequency_hz[hidden]
        warnings.warn(
            f"at {hidden.sum()} of {hidden.size} frequencies, from {at[0]:.6g} to {at[-1]:.6g} Hz, "
            "the noise hides a plant: its region holds zero, and relative sets must be larger than "
            "the nominal; average longer, leave these out with responses.within(low, high) in Hz, "
            'or take form="additive"',
            IdentificationWarning,
            stacklevel=5,
        )


def region_radius(responses: Responses, confidence: float) -> RealArray:
    """Radii (F, N) of the discs that each contain the true response with this probability.

    Radii for ratios may be infinite.
    """
    if responses.ratios is not None:
        return responses.ratios.radius(responses.values, responses.degrees, confidence)
    variance = (
        np.zeros(responses.values.shape) if responses.variance is None else responses.variance
    )
    degrees = np.minimum(responses.degrees, 1e9)
    radius: RealArray = np.sqrt(stats.f.ppf(confidence, 2, degrees) * variance)
    return radius


def estimates(responses: Responses) -> ComplexArray:
    """The estimates (F, N) in the middle of the regions; the responses themselves without
    regions.
    """
    if responses.confidence is None:
        return responses.values
    corners = responses.values.reshape(len(responses.omega), -1, REGION_CORNERS)
    middle: ComplexArray = corners.mean(axis=-1)
    return middle

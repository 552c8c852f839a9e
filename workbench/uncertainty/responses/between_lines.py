"""Responses between the lines of records, by a model of each plant.

A light resonance between two lines is in no cover of the lines, and a cover follows straight lines
in logarithms between them. A rational model of each plant tells where these are wrong.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.solvers import Options
from workbench.uncertainty.responses.plant_models import measured_plants
from workbench.uncertainty.responses.plants import Responses

STRAIGHT = 0.05
"""Relative distance of a model from the straight line in logarithms between two frequencies, up to
which nothing is added between them."""
HALVINGS = 4
"""Most halvings, in logarithm, of the distance between two lines."""


def between_lines(responses: Responses, *, unstable_poles: int = 0) -> Responses:
    """The same plants with further frequencies between those measured, where they bend.

    A model of each plant, of the fewest poles that noise allows, tells light resonances between
    the frequencies and where the response is no straight line in logarithms. Between two of them
    the response is that model times the straight line through the ratios of response and model
    there. The relative variance lies on a straight line, too; what the model misses at the
    frequencies beyond noise is added to it.

    Parameters
    ----------
    responses
        Of F frequencies, with their variances; without, they count as exact.
    unstable_poles
        Poles of each plant right of the imaginary axis.

    Raises
    ------
    InputError
        The responses are corners of regions: take regions of what this returns.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, between_lines
    >>> omega = np.geomspace(0.1, 10.0, 30)
    >>> def ringing(omega):
    ...     return np.stack([1 / (1 - omega**2 + 0.02j * omega), 1 / (1 + 1j * omega)], axis=1)
    >>> fine = between_lines(Responses(omega, ringing(omega), variance=1e-8))
    >>> missed = np.abs(fine.values / ringing(fine.omega) - 1).max()
    >>> fine.omega.size > 40, bool(missed < 0.01)
    (True, True)
    """
    if responses.confidence is not None:
        raise InputError(
            "the responses are corners of confidence regions; give those of the records, and take "
            "regions of what lies between them"
        )
    models, _ = measured_plants(responses, 1, unstable_poles, Context(Options()))
    omega = _places(responses.omega, models)
    new = ~np.isin(omega, responses.omega)
    whole = np.searchsorted(omega, responses.omega)

    def along(columns: Any) -> Any:
        """Columns (F, ...) at all frequencies, by straight lines over log frequency."""
        flat = columns.reshape(len(columns), -1)
        log, logs = np.log(omega), np.log(responses.omega)
        return np.stack([np.interp(log, logs, one) for one in flat.T], axis=1).reshape(
            omega.size, *columns.shape[1:]
        )

    points = responses.points
    at_lines, everywhere = (
        np.stack([one.response(at) for one in models], axis=1) for at in (responses.omega, omega)
    )
    ratio = points / at_lines
    values = everywhere * np.exp(along(_logarithm(ratio)))
    share = np.zeros(points.shape)
    if responses.variance is not None:
        share = responses.variance / np.abs(points) ** 2
    missed = np.maximum(np.abs(ratio - 1) ** 2 - share, 0.0)
    added = np.where(new[:, None], along(missed) * np.abs(values) ** 2, 0.0)
    values[whole] = responses.values
    present = along(responses.present.astype(float)) == 1.0
    ratios = responses.ratios
    if ratios is not None:
        # The covariance of y is relative to |u|^2: it is kept relative to the response.
        sides = np.stack([points, np.ones_like(points)], axis=-1)
        relative = ratios.joint / (sides[..., :, None] * sides[..., None, :].conj())
        sides = np.stack([values, np.ones_like(values)], axis=-1)
        joint = along(relative) * (sides[..., :, None] * sides[..., None, :].conj())
        ratios = type(ratios)(joint, ratios.chosen).with_numerator(added)
    variance = along(share) * np.abs(values) ** 2 + added
    return replace(
        responses,
        omega=omega,
        values=np.where(present, values, 1.0),
        present=present,
        variance=None if responses.variance is None else variance,
        ratios=ratios,
    )


def _places(omega: RealArray, models: list[Rational]) -> RealArray:
    """The frequencies, and those between them at which a model is off a straight line."""
    for _ in range(HALVINGS):
        middle = np.sqrt(omega[1:] * omega[:-1])
        bent = np.zeros(middle.size, bool)
        for one in models:
            ends = one.response(omega)
            away = np.log(one.response(middle) ** 2 / (ends[1:] * ends[:-1])) / 2
            bent |= np.abs(away) > STRAIGHT
        omega = np.union1d(omega, middle[bent])
    return omega


def _logarithm(ratio: ComplexArray) -> ComplexArray:
    """Logarithm (F, N) of ratios, the phase unwrapped along frequency."""
    logarithm: ComplexArray = np.log(np.abs(ratio)) + 1j * np.unwrap(np.angle(ratio), axis=0)
    return logarithm

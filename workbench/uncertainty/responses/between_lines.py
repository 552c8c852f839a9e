"""Responses between the lines of records, by a model of each plant.

A light resonance between two lines is in no cover of the lines, and a cover follows straight lines
in logarithms between them. A rational model of each plant tells where these are wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.stable_system import bilinear_frequency
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.uncertainty.responses.plant_models import measured_plants
from workbench.uncertainty.responses.plants import Responses

STRAIGHT = 0.05
"""Relative distance of a model from the straight line in logarithms between two frequencies, up to
which nothing is added between them."""
HALVINGS = 4
"""Most halvings, in logarithm, of the distance between two lines."""


def refined_responses(responses: Responses, *, unstable_poles: int = 0) -> Responses:
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
    >>> from workbench.uncertainty import Responses, refined_responses
    >>> omega = np.geomspace(0.1, 10.0, 30)
    >>> def ringing(omega):
    ...     return np.stack([1 / (1 - omega**2 + 0.02j * omega), 1 / (1 + 1j * omega)], axis=1)
    >>> fine = refined_responses(Responses(omega=omega, values=ringing(omega), variance=1e-8))
    >>> missed = np.abs(fine.values / ringing(fine.omega) - 1).max()
    >>> fine.omega.size > 40, bool(missed < 0.01)
    (True, True)
    """
    if responses.confidence is not None:
        raise InputError(
            "the responses are corners of confidence regions; give those of the records, and take "
            "regions of what lies between them"
        )
    models, _ = measured_plants(responses, 1, unstable_poles, Context())
    lines, points = responses.omega, responses.points
    omega = _places(lines, models, responses.dt)
    ratio = points / modelled(models, lines, responses.dt)
    turned = np.log(np.abs(ratio)) + 1j * np.unwrap(np.angle(ratio), axis=0)
    values = modelled(models, omega, responses.dt) * np.exp(_along(omega, lines, turned))
    values[np.searchsorted(omega, lines)] = points
    present = _along(omega, lines, responses.present.astype(float)) == 1.0
    given = np.zeros(points.shape) if responses.variance is None else responses.variance
    share = given / np.abs(points) ** 2
    missed = np.maximum(np.abs(ratio - 1) ** 2 - share, 0.0)
    new = ~np.isin(omega, lines)[:, None]
    added = np.where(new, _along(omega, lines, missed) * np.abs(values) ** 2, 0.0)
    variance = _along(omega, lines, share) * np.abs(values) ** 2 + added
    ratios = responses.ratios
    if ratios is not None:
        # The covariance of y is over |u|^2: relative to the response it changes little.
        relative = _along(omega, lines, ratios.joint / products_with_input(points))
        ratios = replace(ratios, joint=relative * products_with_input(values)).with_numerator(added)
    return replace(
        responses,
        omega=omega,
        values=np.where(present, values, 1.0),
        present=present,
        variance=None if responses.variance is None else variance,
        ratios=ratios,
    )


def _places(omega: RealArray, models: Sequence[Rational], dt: float) -> RealArray:
    """The frequencies, and those between them at which a model is off a straight line."""
    for _ in range(HALVINGS):
        middle = np.sqrt(omega[1:] * omega[:-1])
        ends, inside = modelled(models, omega, dt), modelled(models, middle, dt)
        away = np.log(inside**2 / (ends[1:] * ends[:-1])) / 2
        omega = np.union1d(omega, middle[(np.abs(away) > STRAIGHT).any(axis=1)])
    return omega


def modelled(models: Sequence[Rational], omega: RealArray, dt: float) -> ComplexArray:
    """Responses (F, N) of the models."""
    axis = bilinear_frequency(omega, dt)
    return np.stack([one.response(axis) for one in models], axis=1)


def _along(omega: RealArray, lines: RealArray, columns: Any) -> Any:
    """Columns (L, ...) of the lines at other frequencies, by straight lines over log frequency."""
    log, logs = np.log(omega), np.log(lines)
    flat = [np.interp(log, logs, one) for one in columns.reshape(len(lines), -1).T]
    return np.stack(flat, axis=1).reshape(omega.size, *columns.shape[1:])


def products_with_input(values: ComplexArray) -> ComplexArray:
    """Products (F, N, 2, 2) of y and u with their conjugates, where u is 1."""
    both = np.stack([values, np.ones_like(values)], axis=-1)
    return both[..., :, None] * both[..., None, :].conj()

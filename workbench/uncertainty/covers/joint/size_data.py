"""What the size of a model depends on, besides its parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

NOMINAL, REAL, CIRCLE = 0, 1, 2
"""Parts of a model: the nominal, W_r and W_c."""
TINY = float(np.finfo(float).tiny)
"""Least divisor, against division by zero."""


class SizeData(NamedTuple):
    """Data on which the size of a model depends, besides its parameters (P,).

    ``points`` (F, N) are the plants at frequencies ``omega`` (F,) [rad/s], ``unit`` (F,) is the
    unit of their deviations, and ``floor`` (F,) is added to radii. ``nominal`` (F,) is the response
    of a given nominal, and ``shares`` (F,) are weights of the frequencies. W_c is evaluated at
    ``reached`` (R,) [rad/s], where its own size has the weight ``counted`` (R,). There it must
    reach the radii at the frequencies with index ``row`` (R,). Where ``onward`` (R,) is not 0, it
    must reach the radius interpolated in log-log scale at this share of the way to the next
    frequency. The square of W_r at ``far`` [rad/s] over that of ``far_unit`` is added.

    ``level``, ``coefficients``, ``moving`` and ``positive`` are the factors as `factored_values`
    takes them. Part k of the model has the factors from ``factor[k]`` to ``factor[k + 1]``, of
    which ``numerators[k]`` are in the numerator, and the parameters from ``parameter[k]`` to
    ``parameter[k + 1]``. A part that is given or missing has none.

    ``damping`` and ``tone`` (K, P + 1) give the logarithms of damping and frequency of the pairs of
    roots of the weights, the last column without parameters. ``gap`` are the distances of
    neighbours of log omega and ``middle`` their middles.

    The inflation needs radius plus half-length of the raw sets: ``about`` (F,) of those about a
    nominal, in units of the deviations, and ``free`` (F,) of those with free centres, in units
    ``plain`` (F,) of the plants. ``free_square`` is the mean square of the latter's radii.
    ``given`` (R,) tells which of the frequencies ``reached`` are given ones. For the mean square
    size ``about`` is empty.
    """

    omega: RealArray
    points: ComplexArray
    unit: RealArray
    floor: RealArray
    nominal: ComplexArray
    shares: RealArray
    reached: RealArray
    row: np.ndarray
    onward: RealArray
    counted: RealArray
    far: RealArray
    far_unit: RealArray
    level: RealArray
    coefficients: RealArray
    moving: np.ndarray
    positive: np.ndarray
    factor: np.ndarray
    numerators: np.ndarray
    parameter: np.ndarray
    damping: RealArray
    tone: RealArray
    middle: RealArray
    gap: RealArray
    multiplicative: bool
    length_weight: float
    about: RealArray
    free: RealArray
    plain: RealArray
    free_square: float
    given: np.ndarray

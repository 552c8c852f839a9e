"""The four estimators of section 4.1.1, each on a record of the coil's current.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import decimate

from workbench.identification import (
    ResponseEstimate,
    SampledRecord,
    TransferFunctionEstimate,
    filtered_least_squares,
    output_error,
    refined_instruments,
)
from workbench.types import ComplexArray, RealArray

from ...drive.actuator import SERIES_RESISTANCE
from ..bench_setup import RATE
from ..coil_current import RESONANCE, rational_current
from ..record import CoilRecord
from .excitations import OPEN, Excited

BY_RECORD = ("least_squares", "instruments", "prediction_errors")
"""Estimators that use the record; each gives regions of its own."""
ESTIMATORS = (*BY_RECORD, "likelihood")
"""All estimators; that of maximum likelihood is fitted to the response that an excitation gave."""
FEWER = 5
"""Decimation of a record after a filter."""


class Estimate(NamedTuple):
    """Response (F,) of a fitted model, distance (F,) of the truth over its 99 % region, and R, Bl,
    k, b.

    The distance is NaN if the estimator gives no region.
    """

    response: ComplexArray
    distance: RealArray
    parameters: RealArray


def estimates(
    excited: Excited,
    excitation: str,
    record: CoilRecord,
    response: ResponseEstimate,
    truth: ComplexArray,
) -> list[Estimate]:
    """The estimates of v_r/u in the order of `ESTIMATORS`.

    response: response from the excitation, for the maximum-likelihood fit. truth (F,): v_r/u
    without noise.
    """
    # Equal filters in both channels do not change their ratio; without them the few samples would
    # alias.
    gain, driven = excited.laboratory.coil_gain, excited.played[excitation].exact[:, 1]
    u, v = (decimate(one, FEWER, ftype="fir") for one in (driven, record.v_r / gain))
    short = SampledRecord(u, v, 1 / (RATE / FEWER), hold="first-order", assume=OPEN)
    rate = 2 * np.pi * RESONANCE[excited.laboratory.axis]
    start = filtered_least_squares(short, (2, 2), np.poly([-rate, -rate]))
    found = [start, refined_instruments(short, start), output_error(short, start)]
    return [*(_by_record(excited, one, truth) for one in found), _by_response(excited, response)]


def _by_record(excited: Excited, model: TransferFunctionEstimate, truth: ComplexArray) -> Estimate:
    A, b1, _ = model.numerator
    _, d1, a2 = model.denominator
    mass, a1 = excited.sweep.mass, b1 / A
    force = (
        mass * SERIES_RESISTANCE / A * (d1 - a1)
    )  # equation 4.23; a negative value is impossible
    return Estimate(
        model.response(excited.frequency),
        model.distance(excited.frequency, truth),
        np.array(
            [
                SERIES_RESISTANCE * (1 - A) / A,
                np.sqrt(force) if force > 0 else np.nan,
                mass * a2,
                mass * a1,
            ]
        ),
    )


def _by_response(excited: Excited, measured: ResponseEstimate) -> Estimate:
    """The maximum-likelihood parameters for a response with normal errors of its variance."""
    one, mass = excited.sweep, excited.sweep.mass
    entries = measured.response[:, 0, 0], measured.variance[:, 0, 0]
    R, Bl, k, b = one.fit(*entries, measured.degrees, mass).values[:4]
    total = R + SERIES_RESISTANCE
    coefficients = {"A": SERIES_RESISTANCE / total, "a1": b / mass, "a2": k / mass}
    coefficients["b1"] = coefficients["a1"] + Bl**2 / total / mass
    response = rational_current(coefficients, 2j * np.pi * excited.frequency)
    return Estimate(response, np.full(len(response), np.nan), np.array([R, Bl, k, b]))

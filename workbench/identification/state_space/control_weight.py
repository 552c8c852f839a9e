"""Errors of simulations, weighted as they affect a controller of an intended bandwidth.

A controller designed on a model Gm of a plant G moves the output of the loop, to first order in the
error, by S T (G - Gm) / G times the reference: little where the loop gain is low, T = 0, and little
where it is high, S = 0. So errors matter around the bandwidth. The weight S T is that of the
simplest loop transfer function, omega_b / s:

    S T = (s / omega_b) / (1 + s / omega_b)^2

Sources: R. J. P. Schrama, "Accurate identification for control: the necessity of an iterative
scheme", IEEE Trans. Autom. Control 37(7), 1992; D. E. Rivera, J. F. Pollard, C. E. Garcia,
"Control-relevant prefiltering: a systematic design approach and case study", IEEE Trans. Autom.
Control 37(7), 1992.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import bilinear, lfilter

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel


def need_bandwidth(bandwidth: float, sample_time: float) -> None:
    """Raise `InputError` unless a bandwidth [Hz] lies below half the sampling frequency."""
    real = isinstance(bandwidth, (int, float, np.floating, np.integer))
    if not real or isinstance(bandwidth, bool) or not 0 < bandwidth < 0.5 / sample_time:
        raise InputError(
            f"bandwidth is {bandwidth!r}; it must be a number of Hz above 0 and below half the "
            f"sampling frequency, {0.5 / sample_time:g} Hz"
        )


def control_weight(bandwidth: float, sample_time: float) -> tuple[RealArray, RealArray]:
    """Numerator and denominator (3,), in powers of 1/z, of S T at a bandwidth [Hz].

    The bilinear transformation preserves the response at the bandwidth, which is 1/2.
    """
    omega = 2 / sample_time * np.tan(np.pi * bandwidth * sample_time)
    numerator, denominator = bilinear([omega, 0.0], [1.0, 2 * omega, omega**2], fs=1 / sample_time)
    return np.asarray(numerator), np.asarray(denominator)


def weighted_runs(
    model: InnovationsModel, record: Experiments, washout: int, bandwidth: float
) -> tuple[RealArray, RealArray]:
    """Weighted outputs and weighted free-run errors, both (N, ny), without the washout.

    Missing samples count as no error and as the mean output.
    """
    weight = control_weight(bandwidth, record.dt)
    mean = np.nanmean(record.y, axis=0)
    outputs, errors = [], []
    for u, y in record.pieces():
        if len(u) > washout:
            missed = np.nan_to_num((y - model.free_run(u, y, washout))[washout:])
            moved = np.nan_to_num((y - mean)[washout:])
            outputs.append(lfilter(*weight, moved, axis=0))
            errors.append(lfilter(*weight, missed, axis=0))
    return np.vstack(outputs), np.vstack(errors)


def control_fit(
    model: InnovationsModel, record: Experiments, washout: int, bandwidth: float
) -> RealArray:
    """Fit 100 (1 - |W (y - yhat)| / |W (y - mean y)|) [%] of each output (ny,) in free run."""
    with np.errstate(all="ignore"):
        outputs, errors = weighted_runs(model, record, washout, bandwidth)
        size = np.maximum(np.linalg.norm(outputs, axis=0), np.finfo(float).tiny)
        fit = 100 * (1 - np.linalg.norm(errors, axis=0) / size)
    return np.where(np.isfinite(fit), fit, -np.inf)

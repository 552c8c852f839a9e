"""The part of a loop's signals that an external excitation explains: the signals without noise.

Source: P. Van den Hof, R. Schrama, "An indirect method for transfer function estimation from
closed loop data", Automatica 29(6), 1993 (the first of two stages).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.impulse_responses import impulse_model_that_ends
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.recursions import observability, predictions
from workbench.identification.state_space.validation import nrmse_fit

SILENT = 1e-6
"""A line whose amplitude, relative to the largest one, is below this counts as not excited."""
REPEATS = 1e-6
"""Largest difference between periods of an excitation, relative to its range, that is allowed."""


def explained_part(record: Experiments, period: int | None) -> tuple[Experiments | None, bool]:
    """The record with only the excitation's part of u and y, and whether it is the whole part.

    With a period, this is the mean over the periods at the lines of the excitation: no model is
    needed, and no noise remains except at these lines. Without a period, it is the response of
    estimated impulse responses to the excitation; where they have not died out at their end, what
    the excitation did before is lacking. None if the record is too short.
    """
    if period is not None:
        return mean_period(record, period), True
    r, joint = excitation_of(record), np.hstack([record.u, record.y])
    model, ended = impulse_model_that_ends(Experiments(r, joint))
    if model is None:
        return None, False
    return _with_signals(record, _driven(model, r, joint)), ended


def noise_shares(record: Experiments, period: int | None) -> tuple[float, float]:
    """Shares of noise in the power of what the excitation explains of inputs and of outputs.

    Of the inputs the largest share counts, since each is used as if it had no noise; of the outputs
    the smallest, since one that shows the excitation is enough. The explained parts by the two
    halves of the record have independent noise: their difference shows it. Shares are zero if the
    halves are too short to explain anything.
    """
    r, joint = excitation_of(record), np.hstack([record.u, record.y])
    middle, nu = len(r) // 2, record.u.shape[1]
    if period is None:
        models = [impulse_model_that_ends(Experiments(r[a], joint[a]))[0] for a in _halves(middle)]
        parts = [_driven(model, r, joint) for model in models if model is not None]
    else:
        middle -= middle % period
        parts = [_mean_period(r[a], joint[a], period)[:period] for a in _halves(middle)]
    if len(parts) < 2:
        return 0.0, 0.0
    apart, mean = np.subtract(*parts) / 2, np.mean(parts, axis=0)
    shares = apart.var(axis=0) / np.maximum(mean.var(axis=0), np.finfo(float).tiny)
    return float(shares[:nu].max()), float(shares[nu:].min())


def _halves(middle: int) -> tuple[slice, slice]:
    return slice(0, middle), slice(middle, 2 * middle)


def _driven(model: InnovationsModel, r: RealArray, joint: RealArray) -> RealArray:
    """Signals (N, channels) that an excitation r (N, nr) causes by finite impulse responses.

    The states are past excitations. Those before the record are estimated from the first signals
    ``joint``, with a prior of their mean and spread: freely they would follow the noise.
    """
    drive, measured = r - model.u_offset, joint - model.y_offset
    matrices, count = model.matrices(np.zeros_like(model.K)), model.order
    left = measured - predictions(*matrices, np.zeros(count), drive, measured)
    noise = np.maximum(np.nanstd(left[count:], axis=0), SILENT * np.nanstd(measured, axis=0))
    rows = observability(model.A, matrices[2], count) / noise[:, None]
    early = left[:count] / noise
    seen = np.isfinite(early)
    prior = np.diag(1 / np.repeat(drive.std(axis=0), count // drive.shape[1]))
    x0 = np.linalg.lstsq(
        np.vstack([rows.reshape((*seen.shape, count))[seen], prior]),
        np.concatenate([early[seen], np.zeros(count)]),
        rcond=None,
    )[0]
    return np.asarray(predictions(*matrices, x0, drive, measured) + model.y_offset)


def mean_period(record: Experiments, period: int) -> Experiments:
    """The record with u and y replaced by their mean over whole periods, at the lines of r only."""
    r, joint = excitation_of(record), np.hstack([record.u, record.y])
    return _with_signals(record, _mean_period(r, joint, period))


def _with_signals(record: Experiments, signals: RealArray) -> Experiments:
    """The record with other signals (N, nu + ny): inputs, then outputs."""
    nu = record.u.shape[1]
    return replace(record, u=signals[:, :nu], y=signals[:, nu:], starts=(0,))


def excitation_of(record: Experiments) -> RealArray:
    """The excitation (N, nr) of a record; raises InputError if it was not recorded."""
    if record.excitation is None:
        raise InputError("the record has no excitation; make it by ClosedLoopFit")
    return record.excitation


def refuse_other_period(r: RealArray, period: int) -> None:
    """Raise InputError unless an excitation (N, nr) is periodic with this period."""
    if not 2 <= period <= len(r) // 2:
        raise InputError(
            f"period is {period}; it must be 2 or more, and {len(r)} samples must hold it twice"
        )
    apart = np.abs(r[period:] - r[:-period]).max() / np.ptp(r)
    if apart > REPEATS:
        raise InputError(
            f"periods of {period} samples of the excitation differ by {apart:.2g} of its range; "
            "leave out what came before it settled, or give no period"
        )


def _mean_period(r: RealArray, signals: RealArray, period: int) -> RealArray:
    """Mean over whole periods of signals (N, channels), at the lines of r only."""
    count = len(r) // period
    if count == 0:
        raise InputError(
            f"a part of {len(r)} samples holds no period of {period}; take a longer record"
        )
    driven, lines = (
        np.fft.rfft(np.nanmean(one[: count * period].reshape(count, period, -1), axis=0), axis=0)
        for one in (r, signals)
    )
    size = np.abs(driven).max(axis=1)
    silent = size <= SILENT * size[1:].max()
    silent[0] = False  # keep the levels of u and y
    lines[silent] = 0.0
    mean = np.fft.irfft(lines, period, axis=0)
    return np.tile(mean, (count + 1, 1))[: len(r)]


def steady_fit(model: InnovationsModel, clean: Experiments, period: int) -> RealArray:
    """Fit [%] of each output (ny,) in steady state, for periodic signals.

    So slow modes do not count, whose initial state cannot be determined from a few samples.
    """
    made = steady_response(model.response, clean.u[:period])
    return nrmse_fit(clean.y[:period] - clean.y[:period].mean(axis=0), made)


def steady_response(response: Callable[[RealArray], ComplexArray], inputs: RealArray) -> RealArray:
    """Outputs (N, ny) with mean zero in response to periodic inputs (N, nu), one period.

    ``response`` gives responses (F, ny, nu) at frequencies (F,) [cycles/sample].
    """
    found = response(np.arange(1, len(inputs) // 2 + 1) / len(inputs))
    lines = np.einsum("fij,fj->fi", found, np.fft.rfft(inputs, axis=0)[1:])
    level = np.zeros((1, lines.shape[1]))
    return np.asarray(np.fft.irfft(np.vstack([level, lines]), len(inputs), axis=0))

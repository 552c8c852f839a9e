"""Responses of inputs and outputs of closed loops to an excitation, line by line.

Besides the responses Y / R and U / R there is the joint covariance of their errors. If the
excitation is periodic, whole periods are averaged, and the noise is estimated between the lines;
otherwise local polynomials estimate both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.record_tests.periods import period
from workbench.identification.responses.local_polynomial import polynomials_in_bands
from workbench.identification.responses.local_response import spaced_in_log
from workbench.identification.responses.of_records import excited_together
from workbench.identification.responses.periodic_local import periodic_local_polynomial
from workbench.identification.responses.ratios import seen

DEGREE, FINER, SPARE_LINES = 2, 4, 20
"""Degree of local polynomials, a higher degree that shows their bias, and number of lines minus
unknowns. Bands are wide, because with few degrees of freedom the region of U / R is seldom bounded.
"""
FEWEST_SEEN = 2
"""Fewest lines that make a response."""
ITSELF = 1e-12
"""An excitation and an input are the same signal if their correlation differs from 1 by less than
this.
"""


@dataclass(frozen=True, eq=False)
class DrivenRecord:
    """Experiments on one plant in a closed loop.

    Parameters
    ----------
    u, y, r
        Inputs (N, nu, experiments), outputs (N, ny, experiments), excitations (N, nu, experiments).
    period_samples
        Period of the excitation [samples]; None if it is not periodic.
    recorded
        Whether r was recorded; if not, r is a pulse in each period, at input k in experiment k.
    """

    u: RealArray
    y: RealArray
    r: RealArray
    period_samples: int | None
    recorded: bool


def driven_record(u: ArrayLike, y: ArrayLike, excitation: ArrayLike | int) -> DrivenRecord:
    """A record with a usable excitation; raises `InputError` for any other."""
    given = _experiments(u), _experiments(y)
    experiments = given[0].shape[-1]
    if given[1].shape[-1] != experiments:
        raise InputError(f"{experiments} experiments in u and {given[1].shape[-1]} in y")
    joined = checked_record(*(one_after_another(one) for one in given))
    u, y = (np.stack(np.split(one, experiments), axis=-1) for one in joined)
    inputs = u.shape[1]
    if isinstance(excitation, int | np.integer) and not isinstance(excitation, bool):
        _need_experiments(inputs, experiments)
        r = pulses(len(u), int(excitation), experiments)
        return DrivenRecord(u, y, r, int(excitation), recorded=False)
    r = _experiments(excitation)
    if r.ndim == 3 and r.shape[-1] != experiments:
        raise InputError(f"{experiments} experiments in u and {r.shape[-1]} in the excitation")
    try:
        r, _ = checked_record(one_after_another(r), joined[1])
    except InputError as error:
        raise InputError(f"excitation, in the place of u: {error}") from None
    r = np.stack(np.split(r, experiments), axis=-1)
    if r.shape[1] != inputs:
        raise InputError(
            f"{inputs} inputs and {r.shape[1]} excitations; one of each is needed, or as many of "
            "both: take ClosedLoopFit for others"
        )
    _need_other(one_after_another(u), one_after_another(r))
    moving = [one for one in np.moveaxis(r, 0, -1).reshape(-1, len(r)) if np.ptp(one) > 0]
    periods = {period(one) for one in moving}
    samples = periods.pop() if len(periods) == 1 else None
    if samples is not None or experiments > 1:
        _need_experiments(inputs, experiments)
    if samples is None and experiments > 1:
        raise InputError(
            f"{experiments} experiments with excitations that do not repeat themselves alike: "
            "excite all by signals of one period, or take one experiment that excites all inputs"
        )
    return DrivenRecord(u, y, r, samples, recorded=True)


def _experiments(signal: ArrayLike) -> Any:
    """A signal as (N, channels, experiments); invalid ones are refused later."""
    try:
        given = np.asarray(signal)
    except ValueError:
        raise InputError("u, y and the excitation need samples by channels, all alike") from None
    given = given[:, None] if given.ndim == 1 else given
    return given[..., None] if given.ndim == 2 else given


def one_after_another(signal: Any) -> Any:
    """A signal (N, channels, experiments) as (N experiments, channels), one after another."""
    if np.ndim(signal) != 3:
        return signal
    return np.concatenate(np.moveaxis(signal, -1, 0))


def pulses(count: int, samples: int, experiments: int = 1) -> RealArray:
    """A periodic excitation (count, experiments, experiments) that excites every line.

    If the excitation of a loop was not recorded, the last whole periods give the same result
    whatever signal of that period drove them, since it cancels in (Y / R) / (U / R).
    """
    if not 1 < samples <= count // 2:
        raise InputError(
            f"an excitation that repeats itself after {samples} samples: a period of 2 to "
            f"{count // 2} samples is needed, of which a record of {count} samples holds two"
        )
    one = np.where(np.arange(count) % samples == 0, 1.0, 0.0)
    found: RealArray = one[:, None, None] * np.eye(experiments)
    return found


def _need_experiments(inputs: int, experiments: int) -> None:
    if experiments != inputs:
        raise InputError(
            f"{inputs} inputs and {experiments} experiments with a periodic excitation: as many "
            f"experiments as inputs are needed, u of shape (N, {inputs}, {inputs})"
        )


def _need_other(u: RealArray, r: RealArray) -> None:
    """Raise `InputError` if an excitation of r (N, n) equals an input of u (N, n)."""
    alike = np.corrcoef(u, r, rowvar=False)[: u.shape[1], u.shape[1] :]
    if (np.abs(alike) > 1 - ITSELF).any():
        raise InputError(
            "the excitation is the input itself: give what was added from outside, such as the "
            "set-point, or leave it out where the loop is open"
        )


@dataclass(frozen=True, eq=False)
class DrivenParts:
    """Responses (F, outputs + inputs, inputs) of the outputs and of the inputs to the excitations.

    Unlike a `ResponseEstimate`, it has the responses of outputs and inputs before they are
    divided.

    ``noise`` (F, outputs + inputs, outputs + inputs) and ``spread`` (F, inputs, inputs) give
    E[error_ai conj(error_bj)] = noise_ab spread_ij.
    """

    frequency: RealArray
    response: ComplexArray
    noise: ComplexArray
    spread: ComplexArray
    degrees: float

    @property
    def inputs(self) -> int:
        return self.response.shape[2]

    @property
    def visible(self) -> BoolArray:
        """Mask (F,) of frequencies at which U / R is distinguishable from a singular matrix."""
        U = self.response[:, -self.inputs :]
        apart = np.linalg.svd(U, compute_uv=False)
        whole = apart[:, -1] > np.finfo(float).eps * apart[:, 0]
        inverse: Any = np.linalg.inv(np.where(whole[:, None, None], U, np.eye(self.inputs)))
        noise: Any = self.noise[:, -self.inputs :, -self.inputs :]
        own = noise @ _inverse_covariance(self.spread, inverse)
        largest = np.abs(np.linalg.eigvals(own)).max(axis=1)
        with np.errstate(divide="ignore"):
            power = np.where(whole, 1.0 / largest, 0.0)
        return seen(power, self.degrees)


def _inverse_covariance(spread: ComplexArray, inverse: ComplexArray) -> ComplexArray:
    """Covariance S of rows multiplied by an inverse, from that of the rows: E[conj(e_i) e_j]."""
    found: ComplexArray = inverse.conj().swapaxes(1, 2) @ spread.conj() @ inverse
    return found


def rows_after(parts: DrivenParts, chosen: BoolArray) -> tuple[ComplexArray, ...]:
    """The plant's response (F, outputs, inputs) at chosen lines, and J and S of its rows.

    J (F, outputs, 1 + inputs, 1 + inputs) is the noise covariance of an output and of the inputs; S
    (F, inputs, inputs) is the factor by which the inverse of U / R changes it (see `row_reach`).
    """
    n = parts.inputs
    both, noise = parts.response[chosen], parts.noise[chosen]
    outputs = both.shape[1] - n
    inverse: Any = np.linalg.inv(both[:, outputs:])
    ways = np.array([[o, *range(outputs, outputs + n)] for o in range(outputs)])
    joint = noise[:, ways[:, :, None], ways[:, None, :]]
    return both[:, :outputs] @ inverse, joint, _inverse_covariance(parts.spread[chosen], inverse)


def parts_of_bands(
    records: Sequence[DrivenRecord], rate: float, most: int
) -> tuple[list[DrivenParts], str]:
    """Responses to the excitations by local polynomials, from records cut to the same length."""
    length = min(len(one.u) for one in records)
    unknowns = (DEGREE + 1) * (records[0].r.shape[1] + 1)
    lines = unknowns + SPARE_LINES
    if length < 2 * lines + 1:
        raise InputError(f"{length} samples; {2 * lines + 1} are needed: take a longer record")
    at = spaced_in_log(np.arange(1, (length + 1) // 2), most)
    found = []
    for one in records:
        both = np.hstack([one.y[..., 0], one.u[..., 0]])[-length:]
        local, finer = (
            polynomials_in_bands(one.r[-length:, :, 0], both, degree, lines, at=at)
            for degree in (DEGREE, FINER)
        )
        spread, more = (_covariance_factor(fit.covariance, fit.noise) for fit in (local, finer))
        noise = local.noise + _bias(finer.response - local.response, local.noise, spread, more)
        found.append(
            DrivenParts(
                local.cycles_per_sample * rate, local.response, noise, spread, 2.0 * SPARE_LINES
            )
        )
    cut = ", cut to one length" if len({len(one.u) for one in records}) > 1 else ""
    said = f"local polynomials from the excitation at {at.size} lines of {length} samples{cut}"
    return found, said


def parts_of_periods(
    records: Sequence[DrivenRecord], samples: int, rate: float, most: int
) -> tuple[list[DrivenParts], str]:
    """Responses to excitations of one period, with transients subtracted."""
    each = [
        excited_together(_periods(one.r if one.recorded else one.u, samples)) for one in records
    ]
    lines = each[0]
    for other in each[1:]:
        lines = np.intersect1d(lines, other)
    if lines.size < FEWEST_SEEN:
        raise InputError(
            f"the excitations have {lines.size} lines in common; two are needed: excite all plants "
            "by the same signal"
        )
    at = spaced_in_log(lines, most)
    found = []
    for one in records:
        both = np.concatenate([one.y, one.u], axis=1)
        local = periodic_local_polynomial(one.r, both, samples, lines=at, dt=1 / rate)
        columns = one.r.shape[1]
        parts = local.covariance.reshape(-1, both.shape[1], columns, both.shape[1], columns)
        noise = np.einsum("faibi->fab", parts)
        spread = _covariance_factor(local.covariance, noise)
        found.append(DrivenParts(local.frequency_hz, local.response, noise, spread, local.degrees))
    thin = f", {at.size} taken" if at.size < lines.size else ""
    said = f"an excitation of period {samples} samples; {lines.size} excited lines{thin}"
    return found, said


def _periods(signal: RealArray, samples: int) -> ComplexArray:
    """Amplitudes (lines, periods, channels, experiments) of the whole periods of a signal."""
    count = len(signal) // samples
    shape = count, samples, *signal.shape[1:]
    found = np.fft.rfft(signal[-count * samples :].reshape(shape), axis=1)
    return np.asarray(found.swapaxes(0, 1))


def _bias(
    apart: ComplexArray, noise: ComplexArray, spread: ComplexArray, more: ComplexArray
) -> ComplexArray:
    """Bias (F, a, b) of responses, in the form of noise, from the difference to a finer fit.

    ``apart`` (F, rows, columns) is the difference between the fits of one band. Noise alone gives
    it the covariance of the finer fit, noise x ``more``, minus that of the coarse one, noise x
    ``spread``; the excess of each row is bias.
    """
    inner = np.linalg.inv(spread)
    square = apart @ inner.conj() @ apart.conj().swapaxes(1, 2)
    by_noise = np.einsum("fij,fji->f", inner, more - spread).real[:, None]
    rows = np.einsum("faa->fa", square).real
    noisy = np.maximum(by_noise, 0.0) * np.einsum("faa->fa", noise).real
    share = np.sqrt(np.maximum(rows - noisy, 0.0) / np.where(rows > 0, rows, 1.0))
    found: ComplexArray = share[:, :, None] * square * share[:, None, :]
    return found


def _covariance_factor(covariance: ComplexArray, noise: ComplexArray) -> ComplexArray:
    """The factor (F, i, j) of a covariance (F, a i, b j).

    The other factor is the noise (F, a, b).
    """
    rows = noise.shape[1]
    columns = covariance.shape[1] // rows
    parts = covariance.reshape(-1, rows, columns, rows, columns)
    total = np.einsum("faa->f", noise).real
    there = total > 0
    found = np.einsum("faiaj->fij", parts) / np.where(there, total, 1.0)[:, None, None]
    return np.where(there[:, None, None], found, np.eye(columns))

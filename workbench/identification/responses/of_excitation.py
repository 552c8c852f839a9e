"""Responses of plants in closed loops, from the responses of u and y to an excitation.

Feedback carries the noise of y into u, so the estimated response from u to y is biased towards
minus the inverse of the controller. For an excitation r that does not depend on the noise, the
estimates of Y / R and of U / R have no such bias, and the plant is their ratio. Its regions are
Fieller's sets (`ratios`), since U / R is uncertain too.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 13.5 (joint input-output
identification).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.record_tests.report import RecordReport
from workbench.identification.responses.driven_parts import (
    FEWEST_SEEN,
    DrivenParts,
    DrivenRecord,
    driven_record,
    one_after_another,
    parts_of_bands,
    parts_of_periods,
    rows_after,
)
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.identification.responses.ratios import of_chosen, row_reach, row_variance
from workbench.input_checks import need_positive, need_whole

FROM_OUTSIDE = "excitation from outside"
"""Name of the assumption about an excitation."""


@dataclass(frozen=True, eq=False, repr=False)
class DrivenResponse(ResponseEstimate):
    """A response (Y / R) / (U / R) at the lines at which U shows the excitation R.

    Unlike a `ResponseEstimate` in general, it is a quotient, with the joint covariance of its
    two parts.

    Its `radius` is that of the disc about the estimate that contains Fieller's set. On average a
    share ``confidence`` of all these discs together contains the true response; some discs are
    unbounded. With several inputs, the discs of one output hold for all its inputs simultaneously.

    Parameters
    ----------
    joint
        Covariance (F, outputs, 1 + inputs, 1 + inputs) of the noise of an output and of the inputs.
        For a single input it is divided by |U / R|^2, and so is that of the errors of Y / R and U /
        R.
    spread
        Factor (F, inputs, inputs) by which the inverse of U / R changes that noise; 1 for a single
        input.
    chosen
        Share of the examined lines that are used; at the others U / R is not distinguishable from
        zero.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import driven_response
    >>> G, C = control.tf([0.5], [1, -0.5], 1.0), control.tf([0.4], [1], 1.0)
    >>> r, v = np.random.default_rng(0).standard_normal((2, 1000))
    >>> u = control.forced_response(control.feedback(C, G), inputs=r - 0.1 * v).outputs
    >>> y = control.forced_response(G, inputs=u).outputs + 0.1 * v
    >>> found = driven_response(u, y, r, 1.0)
    >>> found.chosen, found.joint.shape == (found.omega.size, 1, 2, 2)
    (1.0, True)
    """

    joint: ComplexArray
    spread: ComplexArray
    chosen: float

    def _radius(self, confidence: float) -> RealArray:
        """Radius (F, outputs, inputs) of the disc about the estimate with Fieller's set in it."""
        single = of_chosen(confidence, np.asarray(self.chosen))
        spread = self.spread[:, None]
        return row_reach(self.response, self.joint, spread, np.asarray(self.degrees), single)

    def _half_width(self, confidence: float) -> RealArray:
        """As `radius`, which also bounds the errors of the real and of the imaginary part."""
        return self._radius(confidence)


def driven_response(
    u: ArrayLike,
    y: ArrayLike,
    excitation: ArrayLike | int,
    dt: float,
    *,
    most: int = 200,
    assume: str | Sequence[str] = (),
) -> DrivenResponse:
    """Response from u to y of a plant in a closed loop that an external excitation drives.

    Parameters
    ----------
    u
        Input (N,), inputs (N, inputs), or inputs of as many experiments (N, inputs, experiments).
    y
        Outputs (N,), (N, outputs) or (N, outputs, experiments).
    excitation
        Signal added from outside, such as the set-point; of the shape of u, one for each input. It
        must not depend on the noise of y. If it is periodic, whole periods are averaged, and
        several inputs need as many experiments. If it was not recorded but is periodic, its period
        in samples is sufficient.
    dt
        Sampling time [s].
    most
        Largest number of frequencies; more are thinned to equal spacing in log frequency.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Returns
    -------
    DrivenResponse
        At the frequencies at which u shows the excitation.

    Raises
    ------
    InputError
        The record is faulty or too short, or a finding forbids its use; the excitation is the input
        itself, or u shows it at fewer than two lines; or, with several inputs, the number of
        excitations differs from theirs, or for periodic ones the number of experiments.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import driven_response
    >>> G, C = control.tf([0.5], [1, -0.5], 1.0), control.tf([0.4], [1], 1.0)
    >>> r, v = np.random.default_rng(0).standard_normal((2, 1000))
    >>> u = control.forced_response(control.feedback(C, G), inputs=r - 0.1 * v).outputs
    >>> y = control.forced_response(G, inputs=u).outputs + 0.1 * v
    >>> found = driven_response(u, y, r, 1.0)
    >>> exact = 0.5 / (np.exp(1j * found.omega) - 0.5)
    >>> off = abs(found.response[:, 0, 0] - exact) / found.radius(confidence=0.95)[:, 0, 0]
    >>> bool((off < 1).mean() > 0.9)
    True
    """
    need_positive(dt, "dt")
    record = driven_record(u, y, excitation)
    samples, experiments = len(record.u), record.u.shape[-1]
    inputs, outputs, driven = map(one_after_another, (record.u, record.y, record.r))
    starts = tuple(range(0, samples * experiments, samples))
    joined = Experiments(inputs, outputs, starts=starts, dt=dt, excitation=driven)
    report = joined.report.assuming(assume)
    if not record.recorded:
        report = unrecorded(report, record.period_samples)
    report.need_usable()
    found, _ = responses_of_driven([record], 1.0 / dt, most)
    return replace(found[0], report=report)


def unrecorded(report: RecordReport, samples: object) -> RecordReport:
    """The report for an excitation that was not recorded, but is stated to be periodic."""
    return report.with_reasons(
        {FROM_OUTSIDE: f"not recorded, and stated to repeat itself after {samples} samples"}
    )


def driven_responses(
    records: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike | int]], rate: float, most: int
) -> tuple[list[DrivenResponse], str]:
    """Responses of plants from records (u, y, excitation), and a report.

    All have the same frequencies: those at which the inputs of all plants show the excitation.
    ``rate`` [Hz] is the sampling frequency. Raises as `driven_response`.
    """
    return responses_of_driven([driven_record(*record) for record in records], rate, most)


def responses_of_driven(
    records: Sequence[DrivenRecord], rate: float, most: int
) -> tuple[list[DrivenResponse], str]:
    """As `driven_responses`, for records that have been checked."""
    need_whole(most, "most")
    if most < FEWEST_SEEN:
        raise InputError(f"most is {most}; two frequencies or more are needed")
    periods = {one.period_samples for one in records}
    shortest = min(len(one.u) for one in records)
    samples = periods.pop() if len(periods) == 1 else None
    if samples is not None and shortest >= 2 * samples:
        parts, said = parts_of_periods(records, samples, rate, most)
    else:
        parts, said = parts_of_bands(records, rate, most)
    visible = np.all([one.visible for one in parts], axis=0)
    if visible.sum() < FEWEST_SEEN:
        raise InputError(
            f"the excitation is seen in the input at {visible.sum()} of {visible.size} "
            "frequencies; two are needed: excite more, measure longer, or name the signal that was "
            "added from outside"
        )
    hidden = parts[0].frequency[~visible]
    if hidden.size:
        said += (
            f"; {hidden.size} lines from {hidden[0]:.4g} to {hidden[-1]:.4g} Hz left out, where "
            "what the excitation makes of the input is not distinguishable from zero"
        )
    return [_plant(one, visible) for one in parts], said


def _plant(parts: DrivenParts, chosen: BoolArray) -> DrivenResponse:
    """The plant's response at the chosen lines."""
    response, joint, spread = rows_after(parts, chosen)
    if parts.inputs == 1:
        joint, spread = joint * spread[:, None], np.ones_like(spread)
    return DrivenResponse(
        frequency_hz=parts.frequency[chosen],
        response=response,
        variance=row_variance(response, joint, spread[:, None]),
        degrees=parts.degrees,
        joint=joint,
        spread=spread,
        chosen=float(chosen.mean()),
    )

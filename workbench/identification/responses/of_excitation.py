"""Responses of plants in closed loops, by what an excitation from outside makes of u and y.

Feedback carries the noise of y into u, so that the response from u to y is pulled towards that of
the inverse controller, with the sign changed. An excitation r that does not depend on the noise
makes Y / R of y and U / R of u, each without that pull, and the plant is their ratio. Its regions
are Fieller's sets (`ratios`), since U / R is uncertain too.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 13.5 (joint input-output
identification).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.record_tests.periods import period
from workbench.identification.responses.local_polynomial import polynomials_in_bands
from workbench.identification.responses.local_response import spaced_in_log
from workbench.identification.responses.of_records import excited
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.identification.responses.periodic_local import periodic_local_polynomial
from workbench.identification.responses.ratios import (
    of_chosen,
    ratio_reach,
    ratio_variance,
    seen,
)
from workbench.input_checks import need_positive, need_whole

DEGREE, LINES = 2, 26
"""Degree of local polynomials, and lines of their bands. They are wide, because a region of U / R
with few degrees of freedom seldom ends."""
FEWEST_SAMPLES = 2 * LINES + 1
"""Samples of the shortest record that has so many lines beside its mean."""
FEWEST_SEEN = 2
"""Fewest lines that make a response."""


@dataclass(frozen=True, eq=False)
class DrivenResponse(ResponseEstimate):
    """A response (Y / R) / (U / R) at the lines at which the excitation R is seen in U.

    Its `radius` is that of the disc about the estimate that holds Fieller's set. Of these discs,
    all together, a share ``confidence`` holds the true response in the mean; some have no end.

    Parameters
    ----------
    joint
        Covariance (F, outputs, 2, 2) of the errors of Y / R and U / R, over |U / R|^2.
    chosen
        Share of all lines that were looked at; at the others U / R is not told from zero, and they
        are left out.

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
    chosen: float

    def _radius(self, confidence: float) -> RealArray:
        """Radius (F, outputs, 1) of the disc about the estimate that holds Fieller's set."""
        single = of_chosen(confidence, np.asarray(self.chosen))
        reach = ratio_reach(self.response[..., 0], self.joint, np.asarray(self.degrees), single)
        return reach[..., None]

    def _half_width(self, confidence: float) -> RealArray:
        """As `radius`, which bounds the errors of the real and of the imaginary part."""
        return self._radius(confidence)


def driven_response(
    u: ArrayLike,
    y: ArrayLike,
    excitation: ArrayLike,
    dt: float,
    *,
    most: int = 200,
    assume: str | Sequence[str] = (),
) -> DrivenResponse:
    """Response from u to y of a plant in a closed loop that an excitation drives from outside.

    Parameters
    ----------
    u
        Input (N,) or (N, 1).
    y
        Outputs (N,) or (N, outputs).
    excitation
        What was added from outside, such as the set-point, (N,) or (N, 1). It must not depend on
        the noise of y. Where it repeats itself whole periods are averaged.
    dt
        Sampling time [s].
    most
        Largest number of frequencies; more are thinned to equal steps of log frequency.
    assume
        Assumptions on the record that you vouch for against its `record_report`.

    Returns
    -------
    DrivenResponse
        At the frequencies at which the excitation is seen in u.

    Raises
    ------
    InputError
        A record that is broken or too short, or that a finding forbids to use; an excitation that
        is the input itself, or that is seen in u at fewer than two lines.

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
    >>> off = abs(found.response[:, 0, 0] - exact) / found.radius(0.95)[:, 0, 0]
    >>> bool((off < 1).mean() > 0.9)
    True
    """
    need_positive(dt, "dt")
    columns = [np.asarray(one)[:, None] if np.ndim(one) == 1 else one for one in (u, y, excitation)]
    record = _checked(*columns)
    report = report_of_arrays(record[0], record[1], assume, dt, r=record[2])
    found, _ = driven_responses([record], 1.0 / dt, most)
    return replace(found[0], report=report)


def driven_responses(
    records: Sequence[tuple[ArrayLike, ...]], rate: float, most: int
) -> tuple[list[DrivenResponse], str]:
    """Responses of plants from records (u (N, 1), y (N, outputs), r (N, 1)), and what was found.

    All are at the same frequencies: those at which the excitation is seen in the input of every
    plant. ``rate`` [Hz] is the sampling frequency. Raises as `driven_response`.
    """
    need_whole(most, "most")
    if most < FEWEST_SEEN:
        raise InputError(f"most is {most}; two frequencies or more are needed")
    checked = [_checked(*record) for record in records]
    periods = {period(r[:, 0]) for _, _, r in checked}
    shortest = min(len(u) for u, _, _ in checked)
    samples = periods.pop() if len(periods) == 1 else None
    if samples is not None and shortest >= 2 * samples:
        estimates, said = _of_periods(checked, samples, rate, most)
    else:
        estimates, said = _of_bands(checked, rate, most)
    visible = np.all([one.visible for one in estimates], axis=0)
    if visible.sum() < FEWEST_SEEN:
        raise InputError(
            f"the excitation is seen in the input at {visible.sum()} of {visible.size} "
            "frequencies; two are needed: excite more, measure longer, or name the signal that was "
            "added from outside"
        )
    hidden = estimates[0].frequency[~visible]
    if hidden.size:
        said += (
            f"; {hidden.size} lines from {hidden[0]:.4g} to {hidden[-1]:.4g} Hz left out, where "
            "what the excitation makes of the input is not distinguishable from zero"
        )
    return [one.ratio(visible) for one in estimates], said


def _checked(u: ArrayLike, y: ArrayLike, r: ArrayLike) -> tuple[RealArray, RealArray, RealArray]:
    """A record whose excitation can be used; raises `InputError` for another."""
    u, y = checked_record(u, y)
    try:
        r, _ = checked_record(r, y)
    except InputError as error:
        raise InputError(f"excitation, in the place of u: {error}") from None
    if u.shape[1] != 1 or r.shape[1] != 1:
        raise InputError(
            f"{u.shape[1]} inputs and {r.shape[1]} excitations; one of each is needed: take "
            "ClosedLoopFit for several"
        )
    if abs(np.corrcoef(u[:, 0], r[:, 0])[0, 1]) > 1 - 1e-12:
        raise InputError(
            "the excitation is the input itself: give what was added from outside, such as the "
            "set-point, or leave it out where the loop is open"
        )
    return u, y, r


@dataclass(frozen=True, eq=False)
class _Driven:
    """Responses (F, outputs + 1) of the outputs and, last, of the input to the excitation.

    ``covariance`` (F, outputs + 1, outputs + 1) is that of their errors.
    """

    frequency: RealArray
    response: ComplexArray
    covariance: ComplexArray
    degrees: float

    @property
    def visible(self) -> BoolArray:
        """Where U / R is distinguishable from zero (F,)."""
        return seen(self.response[:, -1], self.covariance[:, -1, -1].real, self.degrees)

    def ratio(self, chosen: BoolArray) -> DrivenResponse:
        """The plant's response at the chosen lines."""
        both, last = self.response[chosen], self.response.shape[1] - 1
        response = both[:, :-1] / both[:, -1:]
        pairs = np.array([[o, last] for o in range(last)])
        joint = self.covariance[chosen][:, pairs[:, :, None], pairs[:, None, :]]
        joint = joint / np.abs(both[:, -1, None, None, None]) ** 2
        return DrivenResponse(
            frequency=self.frequency[chosen],
            response=response[..., None],
            variance=ratio_variance(response, joint)[..., None],
            degrees=self.degrees,
            joint=joint,
            chosen=float(chosen.mean()),
        )


def _of_bands(
    records: Sequence[tuple[RealArray, ...]], rate: float, most: int
) -> tuple[list[_Driven], str]:
    """Responses to the excitations by local polynomials, from records cut to one length."""
    length = min(len(u) for u, _, _ in records)
    if length < FEWEST_SAMPLES:
        raise InputError(f"{length} samples; {FEWEST_SAMPLES} are needed: take a longer record")
    at = spaced_in_log(np.arange(1, (length + 1) // 2), most)
    degrees = 2.0 * (LINES - 2 * (DEGREE + 1))
    found = []
    for u, y, r in records:
        both = np.column_stack([y, u])[-length:]
        local = polynomials_in_bands(r[-length:], both, DEGREE, LINES, at=at)
        response = local.response[..., 0]
        found.append(_Driven(local.frequency * rate, response, local.covariance, degrees))
    cut = ", cut to one length" if len({len(u) for u, _, _ in records}) > 1 else ""
    said = f"local polynomials from the excitation at {at.size} lines of {length} samples{cut}"
    return found, said


def _of_periods(
    records: Sequence[tuple[RealArray, ...]], samples: int, rate: float, most: int
) -> tuple[list[_Driven], str]:
    """Responses to excitations of one period, transients taken off."""
    lines = excited(_periods(records[0][2], samples))
    for _, _, r in records[1:]:
        lines = np.intersect1d(lines, excited(_periods(r, samples)))
    if lines.size < FEWEST_SEEN:
        raise InputError(
            f"the excitations have {lines.size} lines in common; two are needed: excite all plants "
            "by the same signal"
        )
    at = spaced_in_log(lines, most)
    found = []
    for u, y, r in records:
        both = np.column_stack([y, u])
        local = periodic_local_polynomial(r, both, samples, at, sample_rate=rate)
        found.append(
            _Driven(local.frequency, local.response[..., 0], local.covariance, local.degrees)
        )
    thin = f", {at.size} taken" if at.size < lines.size else ""
    said = f"an excitation of period {samples} samples; {lines.size} excited lines{thin}"
    return found, said


def _periods(r: RealArray, samples: int) -> ComplexArray:
    """Amplitudes (lines, periods) of the whole periods of an excitation (N, 1)."""
    count = len(r) // samples
    return np.asarray(np.fft.rfft(r[-count * samples :].reshape(count, samples), axis=1).T)

"""Initial choices for a design, derived from responses: order, bandwidth, weights.

They are where a designer starts, not where the design ends; each comes with its reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import relocated_fits, vector_fits
from workbench.geometry.exact_circle import exact_circle
from workbench.input_checks import need_positive
from workbench.solvers import Options
from workbench.starter.integrator import integrates_down_to
from workbench.uncertainty import Responses
from workbench.uncertainty.covers.nominal import mean_response
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.covers.sides import FAR_BETTER, POOR, TRIED
from workbench.uncertainty.responses.regions import region_radius

Shape = Literal["circle", "stadium"]
"""Shapes of a cover."""
CONFIDENCE = 0.99
"""Probability of the regions, each at one frequency, in which the plants are assumed to lie. With a
few plants at some dozens of frequencies hardly one lies outside its region.
"""
SEEN = 0.95
"""Probability of the regions by which a plant is judged to be hidden by noise."""
BENT = 0.01
"""Assumed standard deviation, relative to a response, of its difference from the linear plant at
the working point. Flows and forces that depend nonlinearly on the signal's size cause a few per
cent of difference.
"""
HIDDEN = 0.5
"""Noise hides a plant at a frequency if the region's radius exceeds this fraction of
the response.
"""
BESIDE = 3
"""Fewest neighbouring frequencies at which a plant is seen that do not count as chance."""
FEWEST = 8
"""Least number of frequencies that must remain after those hidden by noise are dropped."""
LARGEST_ORDER = 6
"""Largest order of the nominal plant that is tried."""
AS_GOOD, OF_SPREAD = 1.5, 0.3
"""Limits for taking a smaller order: its fit error may be so many times that of the best order, or
so large a fraction of the spread of the plants.
"""
FIT_FREQUENCIES = 60
"""Most frequencies used in the fit."""
PHASE_BUDGET = 0.35
"""Phase lag [rad] that hold and delay may have at the bandwidth: 20 degrees."""
LATEST = np.radians(-186.0)
"""Lowest phase [rad] that plant, hold and delay may have at the bandwidth. A controller can lead by
some 60 degrees, and a sensitivity of 2 for every plant of the set needs nearly all of them.
"""
WORST_SET = 0.7
"""Largest min(|W_e|, r) over frequency, where r is the relative size of the set. A perturbed loop
can meet its weight only if |W_e| (1 - T) + r T is below 1 for some T in [0, 1]; its least value is
min(|W_e|, r).
"""
ERROR_PEAK = 2.0
"""Largest sensitivity that the error weight allows."""
BELOW_THE_END = 3.0
"""Least ratio of the last measured frequency to the bandwidth."""
BELOW_ZERO = 3.0
"""Least ratio of a right half-plane zero to the bandwidth."""
OVERSHOOT = 0.1
"""Largest overshoot that is demanded around an unstable plant, whose loop overshoots by itself,
relative to the step.
"""
EFFORT = 0.05
"""Control weight times the least |G| below the bandwidth: the control may be 20 / |G|."""
OVER_UNSTABLE = 2.0
"""Least crossover of a loop over an unstable pole of its plant (S. Skogestad, I. Postlethwaite,
Multivariable Feedback Control, 2nd ed., Wiley 2005, section 5.9); the control acts up to there."""


@dataclass(frozen=True)
class FirstChoices:
    """Numbers of a first design, each with its reason.

    ``band_hz`` [Hz]: frequencies at which noise hides no plant. ``order``, ``unstable_poles``: of
    the nominal plant. ``bandwidth_hz`` [Hz]: frequency at which the error weight is about 1.
    ``effort``: the control weight at low frequencies. ``reasons``: the reason for each number, by
    name. ``columns``: the columns read from the records; ``notes``: peculiarities of the records;
    ``tested``: assumptions about the records, with the results of their tests. ``peak``: certified
    peak of mu with a first controller, below 1 if it meets the weights; NaN before one was tried.
    ``shape``, ``form``, ``weight_order``: of its cover. ``states``: fewest states of
    a controller that meets them; 0 before one was tried. ``overshoot``: largest overshoot,
    relative to the step; None if none is demanded.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses
    >>> omega = np.geomspace(1, 1e3, 60)
    >>> response = np.array([gain / (1j * omega / 50 + 1) for gain in (0.9, 1.0, 1.1)])
    >>> plants = Responses(omega=omega, values=response.T)
    >>> from workbench.starter import first_choices
    >>> choices = first_choices(plants, dt=1e-3)
    >>> sorted(choices.reasons)
    ['band_hz', 'bandwidth_hz', 'effort', 'order']
    """

    band_hz: tuple[float, float]
    order: int
    unstable_poles: int
    bandwidth_hz: float
    effort: float
    reasons: dict[str, str]
    columns: str = field(default="", kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    tested: tuple[str, ...] = field(default=(), kw_only=True)
    peak: float = field(default=np.nan, kw_only=True)
    shape: Shape = field(default="circle", kw_only=True)
    form: CoverForm = field(default="multiplicative", kw_only=True)
    weight_order: int = field(default=4, kw_only=True)
    states: int = field(default=0, kw_only=True)
    overshoot: float | None = field(default=None, kw_only=True)


def first_choices(
    responses: Responses, dt: float, *, delay_samples: float = 1.0, at_most_hz: float = np.inf
) -> FirstChoices:
    """Initial choices for a controller of these plants that runs on a computer.

    Parameters
    ----------
    responses
        Responses of two plants or more.
    dt
        Sampling time of the controller [s].
    delay_samples
        Delay of the computer [samples].
    at_most_hz
        Largest bandwidth [Hz].

    Raises
    ------
    InputError
        Noise hides the plants nearly everywhere; or an unstable pole needs a higher bandwidth than
        another limit allows, which the message names.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses
    >>> omega = np.geomspace(1, 1e3, 60)
    >>> response = np.array([gain / (1j * omega / 50 + 1) for gain in (0.9, 1.0, 1.1)])
    >>> plants = Responses(omega=omega, values=response.T)
    >>> from workbench.starter import first_choices
    >>> choices = first_choices(plants, dt=1e-3)
    >>> choices.order, choices.unstable_poles, round(choices.bandwidth_hz)
    (1, 0, 37)
    """
    need_positive(dt, "dt")
    reasons = {}
    used, reasons["band_hz"] = _seen_band(responses)
    nominal, reasons["order"] = _nominal(used)
    lowest = integrates_down_to(used)
    if lowest is not None:
        reasons["order"] += f"; every plant behaves as an integrator down to {lowest:.4g} Hz"
    unstable = int((nominal.poles.real > 0).sum())
    bandwidth, reasons["bandwidth_hz"] = _bandwidth(used, nominal, dt, delay_samples, at_most_hz)
    stabilised = OVER_UNSTABLE * float(nominal.poles.real.max(initial=0.0)) / (2 * np.pi)
    last = max(bandwidth, stabilised, 1.01 * used.frequency_hz[0])
    below = 2 * np.pi * np.geomspace(used.frequency_hz[0], last, 50)
    least = float(np.abs(nominal.response(below)).min())
    effort = float(f"{EFFORT * least:.3g}")
    up_to = "twice the unstable pole" if stabilised > bandwidth else "the bandwidth"
    reasons["effort"] = f"{EFFORT:g} times the least gain of the plants below {up_to}"
    overshoot = None
    if unstable:
        overshoot = OVERSHOOT
        reasons["overshoot"] = (
            "a loop around an unstable plant overshoots; a filter of the set-point limits it"
        )
    band = float(used.frequency_hz[0]), float(used.frequency_hz[-1])
    return FirstChoices(
        band, nominal.order, unstable, bandwidth, effort, reasons, overshoot=overshoot
    )


def _seen_band(responses: Responses) -> tuple[Responses, str]:
    """The responses in the longest band in which noise hides no plant, and how it was found.

    If plants are seen on both sides of hidden frequencies, as about an antiresonance, the band
    continues across: the plants do act beyond, and a controller would meet them there.
    """
    radius = np.where(responses.present, region_radius(responses, SEEN), 0.0)
    size = np.where(responses.present, np.abs(responses.values), 0.0)
    hidden = np.asarray((responses.present & (radius >= HIDDEN * size)).any(axis=1), dtype=bool)
    bridged = hidden & ~_bridges(hidden, radius.max(axis=1), size.max(axis=1))
    edges = np.flatnonzero(np.diff(np.concatenate([[True], bridged, [True]])))
    runs = edges.reshape(-1, 2)
    widths = [np.log(responses.omega[end - 1] / responses.omega[start]) for start, end in runs]
    start, end = runs[int(np.argmax(widths))] if widths else (0, 0)
    if end - start < FEWEST:
        raise InputError(
            f"noise hides a plant at {hidden.sum()} of {hidden.size} frequencies (its "
            f"{100 * SEEN:g} % region is wider than half its response): excite more, or "
            "average longer"
        )
    seen = responses.within(*responses.frequency_hz[[start, end - 1]])
    wider = f"a plant's {100 * SEEN:g} % region is wider than half its response"
    text = f"elsewhere {wider}" if bridged.any() else "all that is given"
    inside = responses.frequency_hz[start:end][hidden[start:end]]
    if inside.size:
        text += f"; at {inside.size} frequencies from {inside[0]:.4g} Hz on, too, {wider}"
    known, below = _without_vague_start(seen)
    return known, text + below


def _without_vague_start(responses: Responses) -> tuple[Responses, str]:
    """The responses without the lowest frequencies at which noise makes their set too large, and
    the reason.

    Slow disturbances hide the lowest lines of many records. A controller with an integrator needs
    little knowledge there, but a bandwidth can only lie below a frequency at which the set is too
    large. Where the plants themselves differ as much, nothing is left out.
    """
    size, apart = _relative_sizes(responses)
    known = (size < WORST_SET) | (apart >= WORST_SET)
    first = int(np.argmax(known))
    if first == 0 or size.size - first < FEWEST:
        return responses, ""
    said = (
        f"; below {responses.frequency_hz[first]:.4g} Hz noise lets the plants differ by "
        f"{100 * size[:first].min():.0f} % or more"
    )
    return responses.within(responses.frequency_hz[first], responses.frequency_hz[-1]), said


def _bridges(hidden: np.ndarray, radius: RealArray, size: RealArray) -> np.ndarray:
    """Hidden frequencies (F,) with a seen frequency above them, counting larger regions as seen.

    A few frequencies may count as seen by chance; `BESIDE` of them in a row do not.
    """
    seen = ~hidden
    row = np.convolve(seen, np.ones(BESIDE), "valid") == BESIDE
    sure = np.convolve(row, np.ones(BESIDE)) > 0
    beyond = np.maximum.accumulate(np.where(sure, size, 0.0)[::-1])[::-1]
    before = np.cumsum(sure) > 0
    found: np.ndarray = hidden & before & (radius < HIDDEN * beyond)
    return found


def _nominal(responses: Responses) -> tuple[Rational, str]:
    """The nominal plant of the smallest order that fits nearly as well as the best; and why."""
    responses = responses.thinned(FIT_FREQUENCIES)
    omega, mean = responses.omega, mean_response(responses.points)
    away = np.where(responses.present, responses.values / mean[:, None] - 1, 0.0)
    spread = float(np.median(np.abs(away).max(axis=1)))  # the few lines about a notch do not count
    context = Context(options=Options())

    def fits(count: int) -> list[tuple[float, Rational]]:
        found = []
        for order in range(max(1, count), min(LARGEST_ORDER, omega.size // 4) + 1):
            fit = ResponseFit(omega, mean, order, zeros=order - 1, unstable_poles=count)
            every = [*relocated_fits(fit, context), vector_fits(fit, context)[0]]
            errors = [float(np.sqrt(np.mean(fit.errors(one) ** 2))) for one in every]
            found.append(min(zip(errors, every, strict=True), key=lambda pair: pair[0]))
        return found

    tried = fits(0)
    least = min(error for error, _ in tried)
    for count in TRIED:
        if least <= POOR:
            break
        other = fits(count)
        if min(error for error, _ in other) < FAR_BETTER * least:
            tried, least = other, min(error for error, _ in other)
    enough = max(AS_GOOD * least, OF_SPREAD * spread, 1e-6)
    error, chosen = next(pair for pair in tried if pair[0] <= enough)
    right = int((chosen.poles.real > 0).sum())
    poles = f", {right} poles of it right of the axis" if right else ""
    return chosen, (
        f"the smallest that fits the mean of the plants well: to {100 * error:.2g} % rms, the best "
        f"up to {LARGEST_ORDER} to {100 * least:.2g} %, the spread is {100 * spread:.2g} %{poles}"
    )


def _bandwidth(
    responses: Responses, nominal: Rational, period: float, delay: float, at_most: float
) -> tuple[float, str]:
    """Bandwidth [Hz] that a first design can hope for, and the reason that limits it."""
    size, _ = _relative_sizes(responses)
    dead = (delay + 0.5) * period
    limits = {
        f"hold and delay, {dead:.3g} s, take {np.degrees(PHASE_BUDGET):.0f} degrees there":
            PHASE_BUDGET / dead,
        "a third of the last frequency that was measured": responses.omega[-1] / BELOW_THE_END,
    }  # fmt: skip
    zeros = nominal.zeros[nominal.zeros.real > 0]
    if zeros.size:
        limits[f"a third of a zero right of the axis, {np.abs(zeros).min():.3g} rad/s"] = float(
            np.abs(zeros).min() / BELOW_ZERO
        )
    late = _phase(nominal, responses.omega) - dead * responses.omega < LATEST
    if late.any():
        words = f"plant, hold and delay turn by {-np.degrees(LATEST):.0f} degrees there"
        limits[words] = float(responses.omega[max(int(np.argmax(late)) - 1, 0)])
    wide = size >= WORST_SET
    if wide.any():
        # At that frequency |W_e| must be below WORST_SET, with |W_e|^2 = 1 / ERROR_PEAK^2 +
        # (omega_b / omega)^2.
        room = np.sqrt(WORST_SET**2 - ERROR_PEAK**-2)
        first = int(np.argmax(wide))
        words = (
            f"at {responses.frequency_hz[first]:.3g} Hz the plants, as far as known, differ by "
            f"{100 * size[first]:.0f} % from any nominal"
        )
        limits[words] = float(room * responses.omega[first])
    why = min(limits, key=lambda one: limits[one])
    most = limits[why]
    fastest = float(np.abs(nominal.poles[nominal.poles.real > 0]).max(initial=0.0))
    if fastest > most:
        raise InputError(
            f"an unstable pole of {fastest:.3g} rad/s needs a bandwidth of "
            f"{fastest / (2 * np.pi):.3g} Hz or more; but {why}: at most "
            f"{most / (2 * np.pi):.3g} Hz"
        )
    if 2 * np.pi * at_most < most:
        most, why = 2 * np.pi * at_most, "no more is asked for"
    if most < responses.omega[0]:
        raise InputError(
            f"{why}: a bandwidth of at most {most / (2 * np.pi):.3g} Hz, below the first frequency "
            f"that was measured, {responses.frequency_hz[0]:.3g} Hz; measure lower, or mend that "
            "limit"
        )
    return float(f"{most / (2 * np.pi):.3g}"), why


def _phase(nominal: Rational, omega: RealArray) -> RealArray:
    """Phase (F,) [rad] of a function with positive static gain, unwrapped from frequency zero."""

    def turned(roots: np.ndarray) -> RealArray:
        """Sum of the phases of s - root; a left half-plane root starts at 0, a right one at pi."""
        s = 1j * omega[:, None]
        left = np.angle(s - np.where(roots.real > 0, -roots.conj(), roots))
        angle: RealArray = np.where(roots.real > 0, np.pi - left, left).sum(axis=1)
        return angle

    right = int((nominal.zeros.real > 0).sum())
    return turned(nominal.zeros) - np.pi * right - turned(nominal.poles)


def _relative_sizes(responses: Responses) -> tuple[RealArray, RealArray]:
    """Radius over |centre| (F,) of the smallest circle that encloses the plants with their regions,
    and of the one that encloses their responses.

    Infinite if the centre is 0.
    """
    center, radius = exact_circle(responses.points)
    regions = np.where(responses.present, region_radius(responses, CONFIDENCE), 0.0).max(axis=1)
    infinite = np.full((2, *center.shape), np.inf)
    size, apart = np.divide(
        [radius + regions, radius], np.abs(center), out=infinite, where=center != 0
    )
    return size, apart

"""Margins of measured loops: where the data cross, and how accurately, by their variances.

Between neighbouring frequencies ln |L| and the unwrapped phase are taken as linear in ln omega, as
they nearly are for an integrator or a lag. Ranges follow from the variances to first order: the
errors of the two neighbours are independent and circular, so that ln |L| and the phase of each have
the variance E|error|^2 / (2 |L|^2), and both move the crossing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Figure
from workbench.answer import Answer
from workbench.certificate import Check, Checker
from workbench.errors import InputError
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import need_sampling_time
from workbench.mu.margins import drawn
from workbench.mu.margins.classical import (
    NOT_TOLD,
    delay_in_words,
    in_both_units,
    least_delay,
    least_phase,
    nearest_factors,
)
from workbench.second_opinion.margins.measured import (
    chords_that_cross,
    lies_on_chord,
    redrawn_spread,
)
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.uncertainty.responses.plants import Responses

CONFIDENCE = 0.95
"""Probability that a range contains the true margin. It is the usual one in the field. With half of
the distance from 1 (97.5 %) ranges are 14 % wider, with double of it (90 %) 16 % narrower; tests
and texts name 95 %.
"""
REPEATED = 1e-9
"""Relative difference allowed between margins of data and those computed again on another
processor. The same few operations on the same data differ by rounding, 1e-14, and by more where a
crossing is nearly tangential. Half or double decides the same.
"""
CHORD = 1.0
"""Largest distance of a crossing from the crossing of the chord between its two data, as a share of
the chord: the crossing must lie between the same data. It follows from what a chord is: half would
refuse true crossings, and double would accept one between other data.
"""
SPREAD = 1.5
"""Largest ratio between a range and the spread of margins of redrawn data: both are first-order
results. A spread of a few hundred redrawn sets is known to 5 %; the rest is curvature. With half of
the distance from 1 true ranges may be contradicted; with double of it one that is wrong by two is
overlooked.
"""


@dataclass(frozen=True, eq=False)
class MeasuredLoop:
    """Responses L (F,) of one loop at rising frequencies [rad/s] (F,).

    Unlike a `ResponseEstimate`, it is a loop transfer function of one channel.

    ``variance`` is E|error|^2 (F,), with the given number of real degrees of freedom; None if it is
    unknown.
    """

    omega: RealArray
    values: ComplexArray
    variance: RealArray | None
    degrees: float

    @property
    def width(self) -> float:
        """Half-widths of the ranges, in standard deviations."""
        return float(stats.t.ppf((1 + CONFIDENCE) / 2, self.degrees))


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredMargins(Answer):
    """Margins of a measured loop that is closed with negative feedback, as far as the data show
    them.

    Unlike `ClassicalMargins`, it comes from data, with ranges.

    Each crossing is a row (K, 4): the margin, its frequency [rad/s], the lower and the upper end of
    its range. ``gains`` are factors on the gain at which L passes -1; ``phases_deg`` [deg] and
    ``delays`` [s] are the margins at |L| = 1. ``modulus`` (3,) is the least distance from -1 at the
    data, and its range. Each range holds with a probability of 95 %, from the variances of the data
    to first order; without variances ranges are NaN. ``band`` [rad/s] has the lowest and the
    highest frequency of the data: outside there may be more crossings. The data do not tell whether
    the closed loop is stable. ``dt`` [s] is the sampling time, 0 in continuous time.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.mu import MeasuredMargins, loop_margins
    >>> omega = np.geomspace(0.1, 10.0, 30)
    >>> found = loop_margins(control.frd(2.0 / (1j * omega), omega)).classical["loop"]
    >>> isinstance(found, MeasuredMargins), round(found.phase_deg, 6)
    (True, 90.0)
    """

    gains: RealArray
    phases_deg: RealArray
    delays: RealArray
    modulus: RealArray
    band: tuple[float, float]
    dt: float

    @property
    def gain(self) -> tuple[float, float]:
        """The nearest destabilising factors below and above 1; 0 and infinity if there is none."""
        return nearest_factors(self.gains)

    @property
    def phase_deg(self) -> float:
        """The least phase margin [deg], negative against lead; infinite without a crossing."""
        return least_phase(self.phases_deg)

    @property
    def delay(self) -> float:
        """The least delay margin [s]; infinite without a crossing."""
        return least_delay(self.delays)

    def lines(self) -> list[str]:
        """The least margins with their ranges and frequencies, a line each."""
        low, high = (f"{factor:.4g}{_with_range(self.gains, factor)}" for factor in self.gain)
        late = delay_in_words(self.delay, self.dt)
        return [
            f"gain from {low} to {high}",
            f"phase {self.phase_deg:.4g} degrees{_with_range(self.phases_deg, self.phase_deg)}",
            f"delay {late}{_with_range(self.delays, self.delay)}",
            f"modulus {self.modulus[0]:.4g}{_range(self.modulus[1:])}",
        ]

    def summary(self) -> str:
        low, high = (in_both_units(one) for one in self.band)
        first = f"MeasuredMargins of the data from {low} to {high}"
        return "\n  ".join([first, *self.lines(), NOT_TOLD])


@dataclass(frozen=True, eq=False)
class MeasuredChecker(Checker):
    """Checks `MeasuredMargins` against the data."""

    data: MeasuredLoop

    @property
    def quantifier(self) -> str:
        noise = "" if self.data.variance is None else f", ranges of {100 * CONFIDENCE:g} % each"
        return f"at the {self.data.omega.size} frequencies of the data only{noise}"

    def checks(self, answer: MeasuredMargins, tolerance: float) -> list[Check]:
        again = margins_of_data(self.data)
        statement = "largest relative difference to what the data give again"
        pairs = {name: (getattr(answer, name), getattr(again, name)) for name in TABLES}
        return [
            Check(name, statement, _difference(*pair), REPEATED) for name, pair in pairs.items()
        ]

    def second_opinion(self, answer: MeasuredMargins) -> list[Check]:
        """Chords between the data must cross nearby, and redrawn data must spread as the ranges
        say.
        """
        omega, L = self.data.omega, self.data.values
        statement = "distance of a crossing from the chord of its neighbours, in chords"
        circle = [lies_on_chord(omega, L, w, on_circle=True) for w in answer.phases_deg[:, 1]]
        axis = [lies_on_chord(omega, L, w, on_circle=False) for w in answer.gains[:, 1]]
        found = [Check("chords", statement, max([*circle, *axis], default=0.0), CHORD)]
        counts = np.subtract(chords_that_cross(L), (len(answer.phases_deg), len(answer.gains)))
        statement = "difference of the numbers of chords that cross and of crossings"
        found.append(Check("crossings", statement, float(np.abs(counts).max()), 0.0))
        if self.data.variance is not None and len(answer.phases_deg):
            half = np.diff(answer.phases_deg[:, 2:])[:, 0] / 2 / self.data.width
            spread = redrawn_spread(omega, L, self.data.variance, answer.phases_deg[:, 1])
            ratio = float(np.nanmax(np.maximum(spread / half, half / spread), initial=1.0))
            statement = "factor between the spread of redrawn phase margins and their range"
            found.append(Check("redrawn", statement, ratio, SPREAD))
        return found

    def figures(self, answer: MeasuredMargins) -> dict[str, Figure]:
        """The Nyquist curve of the data, with discs that hold 95 % of the noise."""
        data, radius = self.data, None
        if data.variance is not None:
            radius = np.sqrt(data.variance * stats.f.ppf(CONFIDENCE, 2, data.degrees))
        return {"margins": drawn.measured_figure(data.values, radius)}


TABLES = ("gains", "phases_deg", "delays", "modulus")
"""Tables of a measured loop that are checked."""


def measured_margins(data: MeasuredLoop, dt: float = 0.0) -> MeasuredMargins:
    """The margins of one measured loop, with their checker."""
    return margins_of_data(data, dt).with_checker(MeasuredChecker(data))


def margins_of_data(data: MeasuredLoop, dt: float = 0.0) -> MeasuredMargins:
    """The margins of one measured loop."""
    omega, size = data.omega, np.log(np.abs(data.values))
    phase, u = np.unwrap(np.angle(data.values)), np.log(data.omega)
    spread = np.full(omega.size, math.nan)
    if data.variance is not None:
        spread = np.sqrt(data.variance / 2) / np.abs(data.values)
    gains, phases, delays = [], [], []
    for k in np.flatnonzero(np.diff(np.floor((phase - math.pi) / (2 * math.pi)))):
        d_size, d_phase = np.diff(size[k : k + 2])[0], np.diff(phase[k : k + 2])[0]
        turn = max(phase[k : k + 2]) - math.pi
        passed = math.floor(turn / (2 * math.pi)) * 2 * math.pi + math.pi
        t = (passed - phase[k]) / d_phase
        factor = math.exp(-(size[k] + t * d_size))
        sigma = _mixed(spread[k : k + 2], t) * math.hypot(1.0, d_size / d_phase) * data.width
        gains.append([factor, math.exp(u[k] + t * (u[k + 1] - u[k])),
                      factor * math.exp(-sigma), factor * math.exp(sigma)])  # fmt: skip
    for k in np.flatnonzero(np.diff(size >= 0)):
        d_size, d_phase = np.diff(size[k : k + 2])[0], np.diff(phase[k : k + 2])[0]
        t = -size[k] / d_size
        at = math.exp(u[k] + t * (u[k + 1] - u[k]))
        angle = phase[k] + t * d_phase + math.pi
        angle -= 2 * math.pi * math.ceil(angle / (2 * math.pi) - 0.5)  # in (-pi, pi]
        mixed = _mixed(spread[k : k + 2], t) * data.width
        reach = math.degrees(mixed * math.hypot(1.0, d_phase / d_size))
        degrees = math.degrees(angle)
        phases.append([degrees, at, degrees - reach, degrees + reach])
        late = angle % (2 * math.pi)
        slope = (d_phase - late * (u[k + 1] - u[k])) / d_size
        room = mixed * math.hypot(1.0, slope) / at
        delays.append([late / at, at, late / at - room, late / at + room])
    away, noise = np.abs(1.0 + data.values), spread * np.abs(data.values) * data.width
    least = max(float((away - noise).min()), 0.0) if data.variance is not None else math.nan
    tables = [np.array(rows).reshape(-1, 4) for rows in (gains, phases, delays)]
    return MeasuredMargins(
        gains=tables[0],
        phases_deg=tables[1],
        delays=tables[2],
        modulus=np.array([away.min(), least, (away + noise).min()]),
        band=(float(omega[0]), float(omega[-1])),
        dt=dt,
    )


def _mixed(spread: RealArray, t: float) -> float:
    """Standard deviation of an interpolated value between two independent errors."""
    return math.hypot((1 - t) * spread[0], t * spread[1])


def _difference(one: RealArray, other: RealArray) -> float:
    """The largest relative difference of two tables; infinite if their sizes differ."""
    if one.shape != other.shape:
        return math.inf
    if not np.array_equal(np.isfinite(one), np.isfinite(other)):
        return math.inf
    size = np.maximum(np.abs(other), 1e-300)
    return float(np.nanmax(np.abs(one - other) / size, initial=0.0))


def _with_range(rows: RealArray, value: float) -> str:
    """Range and frequency of a margin of a table, in words."""
    found = rows[rows[:, 0] == value]
    return f"{_range(found[0, 2:])} at {in_both_units(found[0, 1])}" if len(found) else ""


def _range(ends: RealArray) -> str:
    return "" if math.isnan(ends[0]) else f" ({ends[0]:.4g} to {ends[1]:.4g})"


# --- loops of measured plants ------------------------------------------------------------------


def is_measured(given: Any) -> bool:
    """Whether something is a response of python-control, `Responses` or a `ResponseEstimate`."""
    return hasattr(given, "frdata") or isinstance(given, Responses | ResponseEstimate)


def loops_of(plant: Any, controller: Any) -> tuple[dict[str, MeasuredLoop], float]:
    """The loops of measured plants and a controller, by the plants' names, and the sampling time.

    Raises InputError if the plants have several channels, or if sampling times do not agree.
    """
    need_sampling_time(getattr(plant, "dt", 0.0), "the measured response")
    dt = float(getattr(plant, "dt", 0.0) or 0.0)
    variances: dict[str, RealArray] = {}
    degrees: dict[str, float] = {}
    present: dict[str, Any] = {}
    if hasattr(plant, "frdata"):
        _need_one(plant.frdata.shape[:2])
        values = {"loop": np.asarray(plant.frdata, dtype=complex)[0, 0]}
    elif isinstance(plant, ResponseEstimate):
        _need_one(plant.response.shape[1:])
        values = {"loop": plant.response[:, 0, 0]}
        variances = {"loop": np.asarray(plant.variance)[:, 0, 0]}
        degrees = {"loop": float(plant.degrees)}
    else:
        values = dict(zip(plant.plants, plant.values.T, strict=True))
        present = dict(zip(plant.plants, plant.present.T, strict=True))
        degrees = dict(zip(plant.plants, np.broadcast_to(plant.degrees, len(values)), strict=True))
        if plant.variance is not None:
            variances = dict(zip(plant.plants, plant.variance.T, strict=True))
    omega = np.asarray(plant.omega, dtype=float)
    found = {}
    for name, column in values.items():
        kept = np.flatnonzero(present.get(name, np.ones(omega.size, bool)) & (omega > 0))
        kept = kept[np.argsort(omega[kept])]
        K = _controller(controller, omega[kept], dt)
        L = column[kept] * K
        if kept.size < 2 or not np.isfinite(L).all() or not L.all():
            raise InputError(
                f"{name}: two or more responses at positive frequencies are needed, finite and not "
                "zero, those of the controller too"
            )
        variance = variances[name][kept] * np.abs(K) ** 2 if name in variances else None
        found[name] = MeasuredLoop(omega[kept], L, variance, float(degrees.get(name, math.inf)))
    return found, dt


def _need_one(shape: tuple[int, ...]) -> None:
    if tuple(shape) != (1, 1):
        raise InputError(
            f"the measured response has {shape[0]} outputs and {shape[1]} inputs; margins need "
            "one of each: take a channel, as in frd[0, 0]"
        )


def _controller(controller: Any, omega: RealArray, dt: float) -> ComplexArray:
    """Responses of the controller (F,)."""
    K = as_system(controller, "controller")
    if not K.issiso():
        raise InputError(f"controller has {K.noutputs} outputs and {K.ninputs} inputs, not one")
    if K.nstates and float(K.dt or 0.0) != dt:
        raise InputError(
            f"the data have dt = {dt:g} and the controller {K.dt!r} [s] (0 is continuous time); "
            "they must be the same: control.frd(values, omega, dt) says how data were sampled"
        )
    values: ComplexArray = response(K, omega)[:, 0, 0]
    return values

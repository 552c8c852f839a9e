"""How far a controller's gain can be changed while robust performance is kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real as Number
from typing import Any

from workbench._core.heavy_types import Dataset
from workbench.answer import Answer, restored_numbers, stored_numbers
from workbench.certificate import Check, Checker
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import need_tolerance
from workbench.mu.frequency.peak_bounds import (
    Peak,
    PeakChecker,
    restored_peak,
    stored_peak,
)
from workbench.mu.robust.performance import performance_peak
from workbench.systems.generalised_plant import GeneralisedPlant

PEAK_TOLERANCE = 1e-4
"""Relative width of the interval that certifies each peak. A factor is asked for to 1e-3 or so, and
the peak must be ten times sharper to decide. Half takes longer; with double of it factors nearer to
the edge stay undecided.
"""
FIRST_STEP = 1.25
"""First factor tried upwards and downwards; each further step squares it. It is 2 dB, near the room
of many loops, and squaring reaches any factor soon. Half or double of the distance from 1 changes
the number of steps, and not the edge.
"""
ENDS = {"below": False, "low": True, "high": True, "above": False}
"""Factors of a `GainRoom`, and whether they keep robust performance."""
BELOW_ONE = math.nextafter(1.0, 0.0)
"""The largest number below 1."""


@dataclass(frozen=True, repr=False)
class GainRoom(Answer):
    """Factors of a controller's gain: ``low`` and ``high`` are proven to keep robust performance.

    At ``below`` and ``above`` it is proven to be lost, by a perturbation or because the nominal
    loop is unstable; they are 0 and infinite if no such factor was found. About factors between
    ``low`` and ``high`` nothing is proven. ``peak_low`` and the other peaks are the peaks of mu at
    these factors, with their proofs: None for an unstable loop, or if there is no such factor.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import gain_room
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> room = gain_room(plant, K, tolerance=0.05)
    >>> room.below <= room.low, room.high <= room.above
    (True, True)
    """

    below: float
    low: float
    high: float
    above: float
    peak_below: Peak | None
    peak_low: Peak | None
    peak_high: Peak | None
    peak_above: Peak | None

    def summary(self) -> str:
        return (
            f"GainRoom: factors from {self.low:.5g} to {self.high:.5g} keep robust performance; "
            f"{self.below:.5g} and {self.above:.5g} do not"
        )


def gain_room(
    plant: GeneralisedPlant, controller: Any, *, tolerance: float = 1e-3, most: float = 100.0
) -> GainRoom | None:
    """Factors of a controller's gain at which the peak of mu is proven below 1, by bisection.

    Parameters
    ----------
    plant
        With performance outputs and exogenous inputs, as of `performance_peak`.
    controller
        StateSpace or TransferFunction, from the plant's measurements to its controls.
    tolerance
        Relative distance between a factor that keeps robust performance and one that does not.
    most
        Largest factor tried; its inverse is the least one.

    Returns
    -------
    GainRoom
        None if robust performance is not proven with the given gain.

    Raises
    ------
    InputError
        A tolerance or ``most`` out of its range, or as `performance_peak`.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import gain_room
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> room = gain_room(plant, K, tolerance=0.05)
    >>> room.low <= 1 <= room.high
    True
    """
    need_tolerance(tolerance)
    if not (isinstance(most, Number) and most > FIRST_STEP):
        raise InputError(f"most is {most!r}; it must be a number above {FIRST_STEP}")
    tried = _Tried(plant, controller)
    if tried.kept(1.0) is not True:
        return None
    high, above = tried.edge(tolerance, float(most), 1.0)
    low, below = tried.edge(tolerance, float(most), -1.0)
    peaks = (tried.peaks.get(factor) for factor in (below, low, high, above))
    return GainRoom(below, low, high, above, *peaks).with_checker(RoomChecker(plant, controller))


@dataclass(frozen=True, eq=False)
class RoomChecker(Checker):
    """Checks a `GainRoom` by the proofs of the peaks of mu at its factors.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import RoomChecker, gain_room
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> parts = [(control.tf([1.0], [1.0, 1.0]), "v", "y"), (control.tf([0.2], [1.0]), "u", "z")]
    >>> plant = generalised_plant(
    ...     [*parts, (control.tf([0.4], [1.0]), "e", "z_e")],
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> RoomChecker(plant, K).certify(gain_room(plant, K, tolerance=0.05), 1e-6).holds
    True
    """

    plant: GeneralisedPlant
    controller: Any

    @property
    def quantifier(self) -> str:
        return "for every plant of the set, at the factors"

    def checks(self, answer: GainRoom, tolerance: float) -> list[Check]:
        found: list[Check] = []
        for end, kept in ENDS.items():
            factor, peak = getattr(answer, end), getattr(answer, f"peak_{end}")
            if not kept and factor in (0.0, math.inf):
                continue
            if peak is None:
                stable = stability_check(self.plant.close(factor * self.controller)).holds
                said = "whether the nominal loop is stable, or performance has no proof"
                found.append(Check(end, said, float(stable or kept), 0.0))
                continue
            value, said = (
                (peak.upper, "upper bound of the peak, kept below 1")
                if kept
                else (1.0 / peak.lower, "inverse of the lower bound of the peak, lost above 1")
            )
            found.append(Check(end, said, value, BELOW_ONE))
            found += _named(end, self._at(factor).checks(peak, tolerance))
        return found

    def second_opinion(self, answer: GainRoom) -> list[Check]:
        return [
            check
            for end in ENDS
            if (peak := getattr(answer, f"peak_{end}")) is not None
            for check in _named(end, self._at(getattr(answer, end)).second_opinion(peak))
        ]

    def stored_answer(self, name: str, answer: GainRoom) -> dict[str, Any]:
        found = stored_numbers(name, answer, *ENDS)
        for end in ENDS:
            peak = getattr(answer, f"peak_{end}")
            found |= {} if peak is None else stored_peak(f"{name}_peak_{end}", peak)
        return found

    def restored_answer(self, name: str, data: Dataset) -> GainRoom | None:
        factors = restored_numbers(name, data, *ENDS)
        if factors is None:
            return None
        below, low, high, above = (restored_peak(data, f"{name}_peak_{end}") for end in ENDS)
        return GainRoom(**factors, peak_below=below, peak_low=low, peak_high=high, peak_above=above)

    def _at(self, factor: float) -> PeakChecker:
        """The checker of the peak of mu with this factor of the gain."""
        loop = self.plant.close(factor * self.controller)
        return PeakChecker(loop, self.plant.performance_structure)


def _named(end: str, checks: Sequence[Check]) -> list[Check]:
    """Checks, renamed after the factor that they are about."""
    return [replace(check, name=f"{end}: {check.name}") for check in checks]


class _Tried:
    """Peaks of mu for each factor of the gain; None for an unstable nominal loop."""

    def __init__(self, plant: GeneralisedPlant, K: Any) -> None:
        self.plant, self.K = plant, K
        self.peaks: dict[float, Peak | None] = {}

    def kept(self, factor: float) -> bool | None:
        """Whether the peak is proven below 1; None where it is undecided."""
        peak = performance_peak(self.plant, factor * self.K, tolerance=PEAK_TOLERANCE)
        self.peaks[factor] = peak
        if peak is None or peak.lower > 1.0:
            return False
        return True if peak.upper < 1.0 else None

    def edge(self, tolerance: float, most: float, direction: float) -> tuple[float, float]:
        """The last factor that keeps robust performance, and the first that does not."""
        inside, outside, step = 1.0, most, FIRST_STEP
        while True:  # factors upwards; they are inverted at the end if the direction is downwards
            kept = self.kept(min(step, most) ** direction)
            if kept is not True:
                outside = step
                break
            inside = min(step, most)
            if step >= most:
                return inside**direction, math.inf**direction
            step *= step
        lost = outside if kept is False else math.inf
        while outside / inside > 1.0 + tolerance:
            middle = (inside * outside) ** 0.5
            kept = self.kept(middle**direction)
            if kept is True:
                inside = middle
            else:
                outside = middle
                if kept is False:
                    lost = middle
        return inside**direction, lost**direction

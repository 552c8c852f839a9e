"""How far a controller's gain can be changed while robust performance is kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real as Number
from typing import Any

from workbench.answer import Answer, PartsChecker
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.input_checks import need_tolerance
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.performance import performance_peak
from workbench.systems.generalised_plant import GeneralisedPlant

PEAK_TOLERANCE = 1e-4
"""Relative width of the interval that certifies each peak."""
FIRST_STEP = 1.25
"""First factor tried upwards and downwards; each further step squares it."""


@dataclass(frozen=True, repr=False)
class GainRoom(Answer):
    """Factors of a gain: ``low`` and ``high`` are proven to keep robust performance.

    At ``below`` and ``above`` it is proven not to be kept, by a perturbation or because the nominal
    loop is unstable; they are 0 and infinite where no such factor was found. Of factors between
    ``low`` and ``high`` nothing is proven.

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

    def said(self) -> str:
        return (
            f"GainRoom: factors from {self.low:.5g} to {self.high:.5g} keep robust performance; "
            f"{self.below:.5g} and {self.above:.5g} do not"
        )


def gain_room(
    plant: GeneralisedPlant, K: Any, tolerance: float = 1e-3, most: float = 100.0
) -> GainRoom | None:
    """Factors of a controller's gain at which the peak of mu is proven below 1, by bisection.

    Parameters
    ----------
    plant
        With performance outputs and exogenous inputs, as of `performance_peak`.
    K
        StateSpace or TransferFunction, from the plant's measurements to its controls.
    tolerance
        Relative distance between a factor that keeps robust performance and one that does not.
    most
        Largest factor tried; its inverse is the least one.

    Returns
    -------
    GainRoom
        None where robust performance is not proven with the gain as it is.

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
    if _kept(plant, K, 1.0) is not True:
        return None
    high, above = _edge(plant, K, tolerance, float(most), 1.0)
    low, below = _edge(plant, K, tolerance, float(most), -1.0)
    return GainRoom(below, low, high, above).checked_by(RoomChecker(plant, K))


@dataclass(frozen=True, eq=False)
class RoomChecker(PartsChecker):
    """Checks a `GainRoom` by the peaks of mu at its factors."""

    plant: GeneralisedPlant
    K: Any

    @property
    def quantifier(self) -> str:
        return "for every plant of the set, at the two factors"

    def parts(self, answer: GainRoom) -> Mapping[str, Peak | None]:
        return {
            name: performance_peak(self.plant, factor * self.K, PEAK_TOLERANCE)
            for name, factor in (("low", answer.low), ("high", answer.high))
        }

    def checks(self, answer: GainRoom, tolerance: float) -> list[Check]:
        wanted = [("low", answer.low, True), ("high", answer.high, True)]
        lost = (("below", answer.below), ("above", answer.above))
        wanted += [(name, factor, False) for name, factor in lost if 0 < factor < float("inf")]
        statement = "whether robust performance is not kept, or lost, as claimed"
        return [
            Check(name, statement, float(_kept(self.plant, self.K, factor) is not kept), 0.0)
            for name, factor, kept in wanted
        ]


def _kept(plant: GeneralisedPlant, K: Any, factor: float) -> bool | None:
    """Whether the peak with a factor of the gain is proven below 1; None where it is undecided."""
    peak = performance_peak(plant, factor * K, PEAK_TOLERANCE)
    if peak is None or peak.lower > 1.0:
        return False
    return True if peak.upper < 1.0 else None


def _edge(
    plant: GeneralisedPlant, K: Any, tolerance: float, most: float, direction: float
) -> tuple[float, float]:
    """The last factor that keeps robust performance, and the first that does not."""
    inside, outside, step = 1.0, most, FIRST_STEP
    while True:  # in factors upwards, inverted at the end where the direction is downwards
        kept = _kept(plant, K, min(step, most) ** direction)
        if kept is not True:
            outside = step
            break
        inside = min(step, most)
        if step >= most:
            return inside**direction, float("inf") ** direction
        step *= step
    lost = outside if kept is False else float("inf")
    while outside / inside > 1.0 + tolerance:
        middle = (inside * outside) ** 0.5
        kept = _kept(plant, K, middle**direction)
        if kept is True:
            inside = middle
        else:
            outside = middle
            if kept is False:
                lost = middle
    return inside**direction, lost**direction

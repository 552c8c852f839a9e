"""Mixed uncertainty models with a complex and a real weight: stadiums around a nominal (thesis,
5.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import ClassVar, Literal

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.geometry import NarrowestStadium, Stadium
from workbench.uncertainty.covers.checks import left_check
from workbench.uncertainty.covers.cover import RADIUS_ROUNDING, UncertaintyCover
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.orientation import Orientation, smooth_orientation
from workbench.uncertainty.covers.sets import stadiums_about_nominal
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.covers.weights import real_weight


@dataclass(frozen=True, eq=False)
class StadiumCover(UncertaintyCover):
    """G (1 + W_c delta_c + W_r delta_r): a nominal and two weights that contain every response.

    Parameters
    ----------
    real_order
        Order of the real weight.
    orientation
        Function of frequencies and deviations that returns the angles of the third set; see
        `workbench.uncertainty.covers.orientation`.
    minimum_phase
        Whether the zeros of the real weight must also lie in the left half plane, as in the thesis.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import Responses, StadiumCover
    >>> omega = np.geomspace(1, 100, 20)
    >>> plants = Responses(
    ...     omega=omega, values=np.array(
    ...         [gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]
    ...     ).T
    ... )
    >>> solution = wb.solve(StadiumCover(plants, order=1, complex_order=1, real_order=1))
    >>> solution.certificate.valid
    True
    """

    _: KW_ONLY
    real_order: int = 4
    orientation: Orientation = field(default_factory=smooth_orientation, kw_only=True)
    minimum_phase: bool = field(default=False, kw_only=True)

    shape: ClassVar[Literal["circle", "stadium"]] = "stadium"
    headline: ClassVar[str] = "width_peak"
    size_name: ClassVar[str] = "width"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.orientation):
            raise InputError(f"orientation must be a function, not {self.orientation!r}")

    @property
    def _most(self) -> dict[str, int]:
        return super()._most | {"real_order": self.responses.omega.size - 1}

    def first_program(self, points: ComplexArray) -> NarrowestStadium:
        return NarrowestStadium(points)

    def second_set(self, away: ComplexArray) -> Stadium:
        return stadiums_about_nominal(away)

    def third_set(self, away: ComplexArray, W_r: Rational | None = None) -> Stadium:
        omega = self.responses.axis
        if W_r is None:
            return stadiums_about_nominal(away, self.orientation(omega, away))
        return stadiums_about_nominal(away, np.angle(W_r.response(omega)))

    def real_weight(self, third: Stadium, context: Context) -> Rational:
        omega = self.responses.axis
        return real_weight(omega, third, self.real_order, self.minimum_phase, context)

    def checks(self, answer: CoverSteps, tolerance: float) -> Sequence[Check]:
        checks = list(super().checks(answer, tolerance))
        if self.minimum_phase:
            checks.append(left_check("W_r minimum phase", "zero", answer.model.W_r.zeros))
        return checks

    def least_radius(self, sets: NarrowestStadium, second: Stadium) -> RealArray:
        return sets.radius_bound(second)

    def _orders(self, model: UncertaintyModel) -> list[tuple[str, Rational, int]]:
        return [*super()._orders(model), ("W_r", model.W_r, self.real_order)]

    def metrics(self, answer: CoverSteps) -> dict[str, float]:
        model, second = answer.model, answer.second
        width, length = model.sizes(self.responses.omega)
        inflation = width / np.maximum(second.radius, RADIUS_ROUNDING * width)
        return super().metrics(answer) | {
            "inflation_width": float(np.max(inflation)),
            "inflation_width_median": float(np.median(inflation)),
            "radius_peak": float(np.abs(self.deviations_from(model.nominal, self.points)).max()),
            "length_peak": float(second.half_length.max()),
            "length_peak_fitted": float(length.max()),
            "order_Wr": model.W_r.order,
        }

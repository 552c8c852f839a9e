"""Covers of response sets: a nominal and uncertainty weights from measured plants.

These are the methods of thesis chapter 5, based on circles and on "olympic stadiums", as Programs.
The data are the responses. The answer is the fitted model with the sets of every step. The check is
containment, computed only from the data and the model's roots.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.answer import answer_of
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import right_check
from workbench.fitting.samples import as_count
from workbench.geometry import Circle, NarrowestStadium, SmallestCircle, Stadium
from workbench.geometry.enclosing_shape import CONTAINMENT_TOLERANCE
from workbench.input_checks import need_choice
from workbench.program import Program
from workbench.second_opinion.fits import decays, growing_modes, inverse_decays
from workbench.systems.range_hints import warn_far_frequencies
from workbench.uncertainty.covers.checks import (
    at_most,
    given_nominal,
    left_check,
    realised_support,
)
from workbench.uncertainty.covers.everywhere import (
    containment_check,
    sampled_containment,
)
from workbench.uncertainty.covers.figures import cover_figures
from workbench.uncertainty.covers.model import UncertaintyModel, contains
from workbench.uncertainty.covers.sets import CoverForm, corners, deviations, kept
from workbench.uncertainty.covers.sizes.inflation import Inflation, inflation_of, plant_sizes
from workbench.uncertainty.covers.sizes.set_checks import least_radii, set_check, set_off
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.covers.weights import damped
from workbench.uncertainty.responses.plane import plane_function
from workbench.uncertainty.responses.plants import Responses
from workbench.uncertainty.responses.regions import estimates, with_regions

HALF_LENGTH_WEIGHT = 0.1
"""Weight of the squared half-length of a stadium, compared with its squared radius. A real weight
costs a controller less than a complex one of the same size, and some weight keeps it bounded. It is
part of the objective: half or double asks for other covers, with longer or shorter stadiums.
"""
RADIUS_ROUNDING = 1e-12
"""Amount added to radii, relative to the size of the plants. It is the radius for equal plants. It
is 4,500 roundings, as responses and radii of large sets have; the containment of plants is proven
with it. With half of it a plant on the boundary may be found outside; double widens sets by 1e-12.
"""


@dataclass(frozen=True, eq=False)
class UncertaintyCover(Program):
    """Base of the covers with circles and with stadiums.

    Parameters
    ----------
    responses
        Responses of the plants.
    order
        Order of the nominal model.
    zeros
        Largest number of zeros of the nominal; None for as many as poles.
    complex_order
        Order of the complex weight.
    form
        ``"multiplicative"`` weights, relative to the nominal, or ``"additive"`` ones.
    nominal
        A given nominal (a SISO system of python-control, or a `Rational`), which is then not
        fitted.
    unstable_poles
        Number of poles right of the imaginary axis, for the nominal and for every plant.
    leave_out
        Number of points that may lie outside at each frequency; the most costly ones are left out.
    confidence
        Probability with which each disc around an estimate contains the true response. The cover
        contains these discs; with None it contains the responses themselves.
    windows_hz
        Ranges of frequency [Hz] to draw enlarged, by caption.
    """

    responses: Responses
    order: int
    _: KW_ONLY
    zeros: Any = None  # it is an int after construction
    complex_order: int = 4
    form: CoverForm = field(default="multiplicative", kw_only=True)
    nominal: Any = field(
        default=None, kw_only=True
    )  # it is a Rational after construction, if given
    unstable_poles: int = field(default=0, kw_only=True)
    leave_out: int = field(default=0, kw_only=True)
    confidence: float | None = field(default=None, kw_only=True)
    windows_hz: Any = field(default_factory=dict, kw_only=True)

    default_method: ClassVar[str] = "joint"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.uncertainty.covers.conic",
        "workbench.uncertainty.covers.methods",
    )
    shape: ClassVar[Literal["circle", "stadium"]]
    size_name: ClassVar[str]
    """Name of a set's radius in the metrics."""

    def __post_init__(self) -> None:
        if not isinstance(self.responses, Responses):
            raise InputError(
                f"responses must be Responses, not {type(self.responses).__name__}; "
                "Responses.from_frd and Responses.from_files make them"
            )
        if self.confidence is not None:
            if self.leave_out:
                raise InputError("leave_out counts plants, confidence covers regions: give one")
            object.__setattr__(self, "responses", with_regions(self.responses, self.confidence))
        need_choice(self.form, CoverForm, "form")
        if self.nominal is not None:
            nominal = plane_function(self.nominal, "the given nominal", self.responses.dt)
            if self.nominal is not nominal:  # otherwise it is that of a cover made before
                warn_far_frequencies(self.responses.omega, self.nominal)
            object.__setattr__(self, "nominal", nominal)
        object.__setattr__(self, "order", as_count("order", self.order))
        if self.zeros is None:
            object.__setattr__(self, "zeros", self.order)
        object.__setattr__(self, "zeros", as_count("zeros", self.zeros))
        for name in self._most:
            object.__setattr__(self, name, as_count(name, getattr(self, name)))
        if self.zeros > self.order:
            raise InputError(f"zeros={self.zeros}: at most the order, {self.order}, can be had")
        for name, most in self._most.items():
            if getattr(self, name) > most:
                raise InputError(
                    f"{name} is {getattr(self, name)}; {self.responses.omega.size} frequencies "
                    f"determine {most} at most"
                )
        if not 0 <= as_count("unstable_poles", self.unstable_poles) <= self.order:
            raise InputError(f"unstable_poles is {self.unstable_poles}; the order is {self.order}")
        if self.nominal is not None:
            self._need_sides(self.nominal)
        if self.unstable_poles and self.responses.known_plants:
            raise InputError(
                "known plants are stable: leave out unstable_poles, or give their responses alone"
            )
        # Points with a variance are estimates; those that stand for an assumption have none.
        if self.leave_out and self.responses.assumption and self.responses.variance is None:
            raise InputError(
                f"leave_out is {self.leave_out}, but the responses stand for an assumption "
                f"({self.responses.assumption}), which needs all of them"
            )
        _ = self.points  # raises InputError if so many points cannot be left out

    def _need_sides(self, nominal: Rational) -> None:
        """Raise InputError if a given nominal has another number of poles right of the axis."""
        right = int((nominal.poles.real > 0).sum())
        if (nominal.poles.real == 0).any():
            raise InputError(
                f"the given nominal has poles on the imaginary axis: {nominal.poles}; move them off"
            )
        if right != self.unstable_poles:
            raise InputError(
                f"the given nominal must be stable but for {self.unstable_poles} poles, its poles "
                f"are {nominal.poles}; say unstable_poles={right} if every plant has as many"
            )

    @property
    def _most(self) -> dict[str, int]:
        """Largest orders that can be determined from the number of frequencies, by name."""
        count = self.responses.omega.size
        order = 2 * count - 1 - min(self.zeros, self.order)
        if self.nominal is not None:
            order = self.order
        return {"order": order, "complex_order": count // 2 - 1}

    # --- the steps --------------------------------------------------------------------------------

    @cached_property
    def points(self) -> ComplexArray:
        """Vertices (F, H) of the convex hulls of the point sets to cover, without the points left
        out.
        """
        return corners(kept(self.responses, self.leave_out, self.shape))

    def thinned(self, most: int) -> Self:
        """The same program with at most `most` of the frequencies."""
        return self._of(self.responses.thinned(most))

    def refined(self) -> Self:
        """The same program at further frequencies that show the known plants' resonances."""
        return self._of(self.responses.refined())

    def _of(self, responses: Responses) -> Self:
        """The same program for other responses; for its own responses, the program itself."""
        return self if responses is self.responses else replace(self, responses=responses)

    @property
    def useful_zeros(self) -> int:
        """Largest number of zeros with which the nominal is as small as all known plants at high
        frequency.

        With more zeros, a multiplicative deviation would tend to -1 at infinite frequency.
        """
        known = list(self.responses.known_plants.values())
        if self.form == "additive" or len(known) < len(self.responses.plants):
            return int(self.zeros)
        excess = min(plant.poles.size - plant.zeros.size for plant in known)
        return max(min(self.zeros, self.order - excess), 0)

    @property
    def minimum_phase(self) -> bool:
        """Whether the zeros of a real weight must lie in the left half plane."""
        return False

    @abstractmethod
    def first_program(self, points: ComplexArray) -> SmallestCircle | NarrowestStadium:
        """The program of the smallest shapes around the points (F, N), with free centres."""

    def first_set(self, points: ComplexArray) -> Circle | Stadium:
        """Smallest shapes around the points (F, N), with free centres."""
        found: Circle | Stadium = answer_of(self.first_program(points))
        return found

    @cached_property
    def raw_sets(self) -> Circle | Stadium:
        """Smallest shapes around the plants, with free centres."""
        return self.first_set(self.points)

    @abstractmethod
    def second_set(self, away: ComplexArray) -> Stadium:
        """Smallest shapes around the deviations (F, N) from a nominal, centred on the nominal."""

    @abstractmethod
    def third_set(self, away: ComplexArray, W_r: Rational | None = None) -> Stadium:
        """Second set with the orientation of the cover or, if given, that of a real weight."""

    @abstractmethod
    def real_weight(self, third: Stadium, context: Context) -> Rational | None:
        """Real weight W_r fitted to the third set; None for circles."""

    def deviations_from(self, nominal: Rational, points: ComplexArray) -> ComplexArray:
        """Deviations (F, N) of the points (F, N) from a nominal."""
        response = nominal.response(self.responses.axis)
        return deviations(points, response, self.form, self.responses)

    @cached_property
    def unit(self) -> RealArray:
        """Unit (F,) of sizes in method `joint`: 1, or the plants' root mean square.

        Deviations of a multiplicative model are already relative, so their unit is 1.
        """
        if self.form == "multiplicative":
            return np.ones(self.responses.omega.size)
        return plant_sizes(self.points)

    def deviation_scale(self, nominal: Rational) -> RealArray:
        """Size (F,) of plants plus nominal, in units of the deviations."""
        size = np.abs(self.points).max(axis=1)
        response = np.abs(nominal.response(self.responses.axis))
        return size / response + 1 if self.form == "multiplicative" else size + response

    def realisable(self, nominal: Rational) -> Rational:
        """Nominal whose poles are far enough left that its realisation is stable too."""
        return nominal if self.nominal is not None else damped(nominal, self.responses.axis)

    # --- objective --------------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of points to cover, at all frequencies together."""
        return float(self.points.size)

    def objective(self, answer: CoverSteps) -> float:
        """Mean over log frequency of radius^2 + HALF_LENGTH_WEIGHT half-length^2 of the model's
        sets.

        Sizes are in the units of `unit`.
        """
        width, length = answer.model.sizes(self.responses.omega)
        square = width**2 + HALF_LENGTH_WEIGHT * length**2
        return float(self.responses.shares @ (square / self.unit**2))

    def inflation(self, answer: CoverSteps) -> Inflation:
        """Ratios of the sizes of the model's sets to those of the raw ones."""
        return inflation_of(self.responses, self.points, answer)

    # --- the check --------------------------------------------------------------------------------

    checks_follow_accuracy = True

    def checks(self, answer: CoverSteps, tolerance: float) -> Sequence[Check]:
        model = answer.model
        if model.form != self.form:
            raise InputError(f"the answer has the form {model.form!r}, not {self.form!r}")
        inside = contains(model, self.responses, leave_out=self.leave_out)
        spared = f" but the {self.leave_out} worst at each frequency" if self.leave_out else ""
        assumed = self.responses.assumption
        statement = (
            f"largest distance of a response{spared} beyond its set, relative to the radius"
            + (f"; assumed: {assumed}" if assumed else "")
        )
        fits = self._orders(model)
        return [
            Check(
                "containment",
                statement,
                inside.worst,
                CONTAINMENT_TOLERANCE,
                where=inside.where,
                over=self.responses.over,
            ),
            *self._between(containment_check, model),
            *self._set_checks(answer, max(tolerance, CONTAINMENT_TOLERANCE)),
            *(at_most("order", name, of.order, most) for name, of, most in fits),
            self._nominal_check(model.nominal),
            self._sides_check(model.nominal),
            *(left_check(f"{name} stable", "pole", of.poles) for name, of, _ in fits[1:]),
            left_check("W_c minimum phase", "zero", model.W_c.zeros),
        ]

    def second_opinion(self, answer: CoverSteps) -> Sequence[Check]:
        systems = answer.model.systems()
        return [
            realised_support(systems, self.form, self.responses, self.leave_out),
            *self._between(sampled_containment, answer.model),
            *(
                growing_modes(system, self.unstable_poles, name)
                if name == "G" and self.unstable_poles
                else decays(system, f"{name} decays")
                for name, system in systems.items()
            ),
            inverse_decays(answer.model.W_c, "inverse of W_c decays"),
        ]

    def _between(
        self, check: Callable[[UncertaintyModel, Responses], Check], model: UncertaintyModel
    ) -> list[Check]:
        """The check that includes the known plants between the frequencies, where none may lie
        outside.
        """
        if self.leave_out or not self.responses.known_plants:
            return []
        return [check(model, self.responses)]

    @abstractmethod
    def least_radius(self, sets: NarrowestStadium, second: Stadium) -> RealArray:
        """Lower bound (F,) on the radii of sets around the nominal, from the points only."""

    def _set_checks(self, answer: CoverSteps, limit: float) -> list[Check]:
        """Checks that the sets of each step are the smallest; the third set has a given angle."""
        nominal, first, second, third = (
            answer.model.nominal, answer.first, answer.second, answer.third
        )  # fmt: skip
        away, scale = self.deviations_from(nominal, self.points), self.deviation_scale(nominal)
        free = self.first_program(self.points)
        about = NarrowestStadium(away, center=0.0)
        turned = NarrowestStadium(away, center=0.0, angle=third.angle)
        rounding, size = RADIUS_ROUNDING * scale, np.abs(self.points).max(axis=1)
        off = {
            "first": set_off(free, first, least_radii(free, first), RADIUS_ROUNDING * size),
            "second": set_off(about, second, self.least_radius(about, second), rounding),
            "third": set_off(turned, third, self.least_radius(turned, third), rounding),
        }
        given = {"first": "", "second": " about the nominal", "third": " about the nominal"}
        over = self.responses.over
        return [
            set_check(f"{name} set", given[name], one, limit, self.responses, over)
            for name, one in off.items()
        ]

    def _sides_check(self, nominal: Rational) -> Check:
        """Check that the nominal is stable, or has as many unstable poles as the plants."""
        if self.unstable_poles:
            return replace(right_check(nominal.poles, self.unstable_poles), name="nominal")
        return left_check("nominal stable", "pole", nominal.poles)

    def _nominal_check(self, nominal: Rational) -> Check:
        """Check of the number of zeros; for a given nominal, check that it is the given one."""
        if self.nominal is None:
            return at_most("zeros", "nominal", nominal.zeros.size, self.zeros)
        return given_nominal(nominal, self.nominal, self.responses)

    def _orders(self, model: UncertaintyModel) -> list[tuple[str, Rational, int]]:
        """Name, function and largest order of the nominal and of each weight."""
        order = self.order if self.nominal is None else self.nominal.order
        return [("nominal", model.nominal, order), ("W_c", model.W_c, self.complex_order)]

    # --- results ----------------------------------------------------------------------------------

    def facts(self, answer: CoverSteps) -> Sequence[str]:
        return self.responses.tested

    def metrics(self, answer: CoverSteps) -> dict[str, float]:
        model, second, shares = answer.model, answer.second, self.responses.shares
        width, _ = model.sizes(self.responses.omega)
        over = self.inflation(answer)
        return {
            f"{self.size_name}_peak": float(second.radius.max()),
            f"{self.size_name}_rms": float(np.sqrt(shares @ second.radius**2)),
            f"{self.size_name}_peak_fitted": float(width.max()),
            f"{self.size_name}_rms_fitted": float(np.sqrt(shares @ width**2)),
            "inflation": float(over.about.max()),
            "inflation_free": float(over.free.max()),
            f"{self.size_name}_rms_inflation": over.rms,
            f"{self.size_name}_rms_inflation_free": over.rms_free,
            "order_nominal": model.nominal.order,
            "order_Wc": model.W_c.order,
            "outside": int(contains(model, self.responses, leave_out=self.leave_out).outside.sum()),
        } | self._noise(answer)

    def _noise(self, answer: CoverSteps) -> dict[str, float]:
        """Metrics of the sets around the nominal without noise, which show the share of noise."""
        if self.confidence is None:
            return {}
        nominal, shares = answer.model.nominal, self.responses.shares
        spread = self.second_set(self.deviations_from(nominal, estimates(self.responses))).radius
        rms = float(np.sqrt(shares @ spread**2))
        whole = float(np.sqrt(shares @ answer.second.radius**2))
        return {f"{self.size_name}_rms_estimates": rms, "noise_share": 1.0 - rms / whole}

    def to_dataset(self, answer: CoverSteps) -> Dataset:
        from workbench.uncertainty.covers.storage import cover_dataset

        return cover_dataset(self.responses, answer)

    def from_dataset(self, data: Dataset) -> CoverSteps:
        from workbench.uncertainty.covers.storage import cover_function, cover_sets

        parts = [cover_function(data, name) for name in ("nominal", "W_c", "W_r")]
        model = UncertaintyModel(
            parts[0],
            parts[1],
            parts[2],
            form=self.form,
            dt=self.responses.dt,
            tested=self.responses.tested,
            measured=self.responses.ends,
        )
        first: Circle | Stadium = cover_sets(data, "first")
        if self.shape == "circle":
            first = Circle(first.center, first.radius)
        return CoverSteps(model, first, cover_sets(data, "second"), cover_sets(data, "third"))

    def figures(self, answer: CoverSteps) -> dict[str, Figure]:
        return cover_figures(self.responses, answer, self.windows_hz)

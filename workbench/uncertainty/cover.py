"""Covers of response sets: from measured plants to a nominal and uncertainty weights.

The methods of thesis chapter 5, based on circles and on "olympic stadiums", as Programs: data are
the responses, the answer is the sets of every step and the fitted model, the check is containment
from the data and the model's roots alone.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np

from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Complex, Rational, from_system
from workbench.geometry import Circle, Stadium
from workbench.program import Check, Program, worst
from workbench.uncertainty.model import ROUNDING, UncertaintyModel, contains
from workbench.uncertainty.responses import Real, Responses
from workbench.uncertainty.sets import Form, deviations, kept
from workbench.uncertainty.weights import complex_weight, needed_radius

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class CoverSteps:
    """What each step of a cover gave.

    ``first`` lies in the Nyquist plane; ``second`` and ``third`` are centred on the nominal, in
    the units of the weights. Of circles the third set is the second.
    """

    model: UncertaintyModel
    first: Circle | Stadium
    second: Stadium
    third: Stadium


@dataclass(frozen=True, eq=False)
class UncertaintyCover(Program):
    """What covers by circles and by stadiums share.

    Parameters
    ----------
    responses
        The plants' responses.
    order
        Of the nominal model.
    zeros
        How many zeros it may have; None: as many as poles.
    complex_order
        Of the complex weight.
    form
        ``"multiplicative"`` weights, relative to the nominal, or ``"additive"`` ones.
    nominal
        A given nominal (a SISO system of python-control, or `Rational`), which is then not fitted.
    leave_out
        How many points may lie outside at each frequency: those that cost most.
    windows
        Ranges of frequency [Hz] to show enlarged, by caption.
    """

    responses: Responses
    order: int
    zeros: Any = None  # an int from here on
    complex_order: int = 4
    form: Form = field(default="multiplicative", kw_only=True)
    nominal: Any = field(default=None, kw_only=True)  # Rational from here on, if given
    leave_out: int = field(default=0, kw_only=True)
    windows: Any = field(default_factory=dict, kw_only=True)

    default_method: ClassVar[str] = "joint"
    shape: ClassVar[Literal["circle", "stadium"]]
    size_name: ClassVar[str]
    """What the radius of a set is called in metrics."""

    def __post_init__(self) -> None:
        if self.form not in get_args(Form):
            raise InputError(f"form is {self.form!r}; it must be one of {get_args(Form)}")
        if self.nominal is not None and not isinstance(self.nominal, Rational):
            object.__setattr__(self, "nominal", from_system(self.nominal))
        if self.zeros is None:
            object.__setattr__(self, "zeros", self.order)
        for name, value in self._counts.items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise InputError(f"{name} must be a whole number, 0 or more, not {value!r}")
        if self.zeros > self.order:
            raise InputError(f"zeros={self.zeros}: at most the order, {self.order}, can be had")
        _ = self.points  # says what cannot be left out

    @property
    def _counts(self) -> dict[str, Any]:
        return {"order": self.order, "zeros": self.zeros, "complex_order": self.complex_order}

    # --- the steps --------------------------------------------------------------------------------

    @cached_property
    def points(self) -> Complex:
        """The point sets to cover (F, N), without what is left out."""
        return kept(self.responses.points, self.leave_out, self.shape)

    @property
    def minimum_phase(self) -> bool:
        """Whether the zeros of a real weight must lie in the left half plane."""
        return False

    @abstractmethod
    def first_set(self, points: Complex) -> Circle | Stadium:
        """The smallest shapes around the points, wherever their centres lie."""

    @abstractmethod
    def second_set(self, away: Complex) -> Stadium:
        """The smallest shapes around deviations from a nominal, centred on it."""

    @abstractmethod
    def third_set(self, away: Complex, W_r: Rational | None = None) -> Stadium:
        """The second set with its orientation limited, or along a given real weight."""

    @abstractmethod
    def real_weight(self, third: Stadium, context: Context) -> Rational | None:
        """W_r fitted to the third set; None where the shapes have no straight part."""

    def away(self, nominal: Rational, points: Complex) -> Complex:
        """Deviations (F, N) of the points from a nominal."""
        response = nominal.response(self.responses.omega)
        return deviations(points, response, self.form, self.responses)

    def finished(
        self,
        first: Circle | Stadium,
        nominal: Rational,
        third: Stadium,
        W_r: Rational | None,
        context: Context,
    ) -> CoverSteps:
        """The last step: a complex weight that covers whatever the real one leaves over."""
        omega, away = self.responses.omega, self.away(nominal, self.points)
        radius = needed_radius(away, None if W_r is None else W_r.response(omega))
        extent = np.abs(away).max(axis=1)
        W_c = complex_weight(omega, radius, extent, self.complex_order, context)
        model = UncertaintyModel(nominal, W_c, W_r, self.form)
        return CoverSteps(model, first, self.second_set(away), third)

    # --- the check --------------------------------------------------------------------------------

    def checks(self, answer: CoverSteps, tolerance: float) -> Sequence[Check]:
        model = answer.model
        if model.form != self.form:
            raise InputError(f"the answer is {model.form}, asked for was {self.form}")
        inside = contains(model, self.responses, self.leave_out)
        spared = f" but the {self.leave_out} worst at each frequency" if self.leave_out else ""
        assumed = self.responses.assumption
        statement = (
            f"largest distance of a response{spared} beyond its set, relative to the radius"
            + (f"; assumed: {assumed}" if assumed else "")
        )
        fits = self._orders(model)
        excess, where = worst(self.excess(answer), lambda i: f"at {self.responses.place(i[0])}")
        return [
            Check("containment", statement, inside.worst, ROUNDING, inside.where),
            Check(
                "second set",
                "a radius above its least about the nominal, relative",
                excess,
                max(tolerance, ROUNDING),
                where,
            ),
            *(_at_most(name, of.order, most) for name, of, most in fits),
            *(
                left_check(f"{name} stable", "pole", of.poles)
                for name, of, _ in self._orders(model)
            ),
            left_check("W_c minimum phase", "zero", model.W_c.zeros),
        ]

    @abstractmethod
    def excess(self, answer: CoverSteps) -> Real:
        """Relative excess (F,) of the second set over a bound from the points alone."""

    def _orders(self, model: UncertaintyModel) -> list[tuple[str, Rational, int]]:
        """Name, function and highest order of what was fitted."""
        order = self.order if self.nominal is None else self.nominal.order
        return [("nominal", model.nominal, order), ("W_c", model.W_c, self.complex_order)]

    # --- results ----------------------------------------------------------------------------------

    def metrics(self, answer: CoverSteps) -> dict[str, float]:
        model, second, shares = answer.model, answer.second, self.responses.shares
        width, length = model.sizes(self.responses.omega)
        return {
            f"{self.size_name}_peak": float(second.radius.max()),
            f"{self.size_name}_rms": float(np.sqrt(shares @ second.radius**2)),
            f"{self.size_name}_peak_fitted": float(width.max()),
            f"{self.size_name}_rms_fitted": float(np.sqrt(shares @ width**2)),
            "inflation": float(np.max((width + length) / (second.radius + second.half_length))),
            "order_nominal": model.nominal.order,
            "order_Wc": model.W_c.order,
            "outside": int(contains(model, self.responses, self.leave_out).outside.sum()),
        }

    def to_dataset(self, answer: CoverSteps) -> xr.Dataset:
        from workbench.uncertainty.storage import to_dataset

        return to_dataset(self.responses, answer)

    def from_dataset(self, data: xr.Dataset) -> CoverSteps:
        from workbench.uncertainty.storage import rational, shape

        model = UncertaintyModel(
            rational(data, "nominal"), rational(data, "W_c"), rational(data, "W_r"), self.form
        )
        first: Circle | Stadium = shape(data, "first")
        if self.shape == "circle":
            first = Circle(first.center, first.radius)
        return CoverSteps(model, first, shape(data, "second"), shape(data, "third"))

    def figures(self, answer: CoverSteps) -> dict[str, Figure]:
        from workbench.uncertainty.figures import cover_figures

        return cover_figures(self.responses, answer, self.windows)


def _at_most(name: str, value: int, limit: int) -> Check:
    statement = f"order of {name}, at most what was asked for"
    return Check(f"order of {name}", statement, float(value), float(limit))


def left_check(name: str, kind: str, roots: Complex) -> Check:
    """That roots lie left of the imaginary axis."""
    value = float(roots.real.max(initial=-np.inf))
    text = f"largest real part of a {kind} [rad/s], negative"
    return Check(name, text, value, -np.finfo(float).tiny)

"""Cost in size and in mu of minimum-phase stadiums, and of covers for drives beyond the twelve
(9.2).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.fitting import Rational
from workbench.mu import performance_peak, performance_sweep
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import DataArray, Figure, RealArray
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel, cover_sets

from ..drive.plants import controller
from ..drive.shared_parameters import TABLES, Frequencies
from ..drive.tables import Axis
from .control_problem import generalised
from .design import uncertainty
from .loop_weights import CHANNELS

VARIANTS = ("default", "minimum phase", "extrapolated")
QUANTITIES = ("width", "length", "fitted width", "fitted length")
"""Radius and half-length of the narrowest sets about the nominal, and of the fitted weights."""
CHANNEL = "disturbance"


def needs(axis: str, frequencies: int = 400, content: float = 0.9, **_: Any) -> dict[str, Any]:
    """References to the stadiums: by steps, with a minimum-phase real weight, and for widened
    responses.
    """
    asked: dict[str, dict[str, Any]] = {
        "default": {},
        "minimum_phase": {"minimum_phase": True},
        "extrapolated": {"content": content},
    }
    return {
        name: ref(f"cd/{axis}/stadium-cover", method="steps", frequencies=frequencies, **extra)
        for name, extra in asked.items()
    }


@dataclass(frozen=True, eq=False)
class CoverVariants(Study):
    """Sizes of three covers by stadiums, and mu of the reference controller's loop with them."""

    axis: Axis
    runs: dict[str, Run]

    headline: ClassVar[str] = "peak_minimum_phase"

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    variant, bound = dim(VARIANTS), dim("lower", "upper")
    quantity = dim(QUANTITIES)
    frequency = dim(
        lambda self: self.runs["default"].data["frequency"].values,
        unit="Hz",
        meaning="frequency",
    )

    def model(self, variant: str) -> UncertaintyModel:
        """The uncertainty model of a cover."""
        found = uncertainty(self.axis, self.runs[variant])
        assert isinstance(found, UncertaintyModel)
        return found

    def plant(self, variant: str) -> GeneralisedPlant:
        """The generalised plant from w_p to z_p."""
        exogenous, performance = CHANNELS[CHANNEL]
        return generalised(self.axis, self.model(variant)).channel(
            performance=performance, exogenous=exogenous
        )

    @array(
        dims=(variant, bound), unit="1", meaning="certified bounds of the peak of mu, w_p to z_p"
    )
    def peak(self, context: Context) -> RealArray:
        """NaN if the nominal loop is unstable."""
        found = []
        for variant in context.track(VARIANTS, "peaks"):
            one = performance_peak(self.plant(variant), controller(self.axis), tolerance=1e-4)
            found.append([np.nan] * 2 if one is None else [one.lower, one.upper])
        return np.array(found)

    @array(
        dims=(variant, bound, frequency), unit="1", meaning="mu of robust performance, w_p to z_p"
    )
    def mu(self, frequency: DataArray) -> RealArray:
        omega = 2 * np.pi * frequency.values
        found = []
        for variant in VARIANTS:
            one = performance_sweep(self.plant(variant), controller(self.axis), omega)
            found.append([one.lower, one.upper])
        return np.array(found)

    @array(dims=(variant, quantity, frequency), unit="1", meaning="sizes relative to the nominal")
    def size(self, frequency: DataArray) -> RealArray:
        omega = 2 * np.pi * frequency.values
        found = []
        for variant in VARIANTS:
            sets = cover_sets(self.runs[variant].data, "second")
            fitted = self.model(variant).sizes(omega)
            found.append([sets.radius, sets.half_length, *fitted])
        return np.array(found)

    @array(dims=(variant,), unit="rad/s", meaning="largest real part of a zero of the real weight")
    def rightmost_zero(self) -> RealArray:
        return np.array([_rightmost(self.model(variant).W_r) for variant in VARIANTS])

    @check(title="peaks", statement="lower over upper bound of a peak", at_most=1.0)
    def peaks_in_order(peak: DataArray) -> DataArray:  # noqa: N805
        return peak.sel(bound="lower") / peak.sel(bound="upper")

    @check(
        title="curves",
        statement="mu at the frequencies over the certified peak, less 1",
        at_most=1e-6,
    )
    def curves_below(mu: DataArray, peak: DataArray) -> float:  # noqa: N805
        over = mu.sel(bound="lower").max("frequency") / peak.sel(bound="upper")
        return float(over.max()) - 1

    @check(
        title="minimum phase",
        statement="largest real part of a zero of that weight [rad/s]",
        at_most=0.0,
    )
    def zeros_left(rightmost_zero: DataArray) -> float:  # noqa: N805
        return float(rightmost_zero.sel(variant="minimum phase"))

    @metric
    def numbers(
        self, peak: DataArray, size: DataArray, rightmost_zero: DataArray
    ) -> dict[str, float]:
        """Peaks, and sizes relative to those of the default cover: largest, and median of the
        quotient.
        """
        found: dict[str, float] = {}
        for variant in VARIANTS:
            name = variant.replace(" ", "_")
            low, high = peak.sel(variant=variant).values
            found |= {f"peak_{name}": float(high), f"peak_lower_{name}": float(low)}
            found[f"rightmost_zero_{name}_rad_s"] = float(rightmost_zero.sel(variant=variant))
            for quantity in QUANTITIES:
                one = size.sel(variant=variant, quantity=quantity)
                over = one / size.sel(variant="default", quantity=quantity)
                word = quantity.replace(" ", "_")
                found[f"{word}_peak_{name}"] = float(one.max())
                found[f"{word}_over_default_{name}"] = float(over.median())
        return found

    @table
    def costs(
        self, peak: DataArray, size: DataArray, rightmost_zero: DataArray
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for variant in VARIANTS:
            low, high = peak.sel(variant=variant).values
            largest = [
                f"{float(size.sel(variant=variant, quantity=q).max()):.3f}" for q in QUANTITIES
            ]
            zero = f"{float(rightmost_zero.sel(variant=variant)):.4g}"
            rows.append([variant, f"{low:.4f} to {high:.4f}", *largest, zero])
        heads = [f"largest {quantity}" for quantity in QUANTITIES]
        return ["stadiums", "peak of mu", *heads, "rightmost zero of W_r [rad/s]"], rows

    @figure
    def curves(self, mu: DataArray, size: DataArray) -> Figure:
        """Mu of the loops, and the fitted widths and lengths, over frequency."""
        drawn, panels = figures.axes(1, 3, size=(13.0, 4.4), sharex=True)
        shown = (
            (mu.sel(bound="upper"), "$\\mu$, $w_p$ to $z_p$"),
            (size.sel(quantity="fitted width"), "fitted width, relative"),
            (size.sel(quantity="fitted length"), "fitted length, relative"),
        )
        for panel, (values, name) in zip(panels, shown, strict=True):
            for variant, dash in zip(VARIANTS, ("-", "--", "-."), strict=True):
                curve = values.sel(variant=variant)
                panel.loglog(curve["frequency"], curve, dash, label=variant)
            figures.label(panel, x="frequency [Hz]", y=name, title=self.axis)
        panels[0].axhline(1.0, color="0.4", linewidth=0.8)
        figures.legend_below(drawn, panels[0])
        return drawn


def _rightmost(weight: Rational | None) -> float:
    assert weight is not None
    return float(np.max(weight.zeros.real, initial=-np.inf))


@problem("cd/{axis}/cover-variants", axis=("focus", "radial"), needs=needs, data=TABLES)
def cover_variants(
    axis: Axis,
    default: Run,
    minimum_phase: Run,
    extrapolated: Run,
    frequencies: Frequencies = 400,
    content: Annotated[float, Field(gt=0, lt=1)] = 0.9,
) -> CoverVariants:
    """What stadiums of minimum phase, and those beyond the twelve drives, cost (5.4.4, 9.2).

    Section 5.4.4 fits the length of the stadiums by a real weight that is stable and of minimum
    phase; the default cover leaves its zeros free. Section 9.2 asks for a set that represents all
    possible drives: the twelve points are replaced by ellipses that contain a further drive with
    probability ``content``, if responses are normally distributed. Sizes of the covers, and
    certified peaks of mu with the reference controller, are compared with the default cover.

    frequencies: number of frequencies of the covers. content: probability that the ellipses contain
    a further drive.
    """
    runs = dict(zip(VARIANTS, (default, minimum_phase, extrapolated), strict=True))
    return CoverVariants(axis, runs)

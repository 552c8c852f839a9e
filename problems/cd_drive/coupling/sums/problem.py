"""Sums of focus and radial diodes while the lens moves by 150 um to both sides (figure 4.6).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    metric,
    part,
    share_interval,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ...drive.photo_diodes import S_CURVE_LINEAR, S_CURVE_PEAK
from .diode_plane import DIODES, Layout, normalised

REACH = 150e-6
"""Largest focus error [m] of figure 4.6."""
ERRORS = np.linspace(-REACH, REACH, 151)
"""Focus errors [m]: every second micrometre."""
NEAR = abs(ERRORS) <= S_CURVE_LINEAR + 1e-12
"""Where the focus error is linear."""
RANGES = {
    "half_length": (4e-6, 10e-6),
    "gap": (0.0, 8e-6),
    "side_width": (4e-6, 15e-6),
    "side_length": (3e-6, 12e-6),
    "side_light": (0.03, 0.25),
    "shift": (-0.5e-6, 0.5e-6),
}
"""Ranges of what the thesis does not print, as lengths at the disc [m]; guesses. gap: between the
middle diodes and S1, S2.
"""
EXAMPLE = Layout(6.4e-6, 5e-6, 14e-6, 8e-6, 8e-6, 1 / 15)
"""Layout that the figure shows; chosen so that its sums look as figure 4.6 is described."""
HALF_WIDTH = 6.4e-6
"""Half width of D1 and D2 [m]; chosen so that their difference turns 6 um from the focus."""
RISE = 1.05
"""Factor by which a sum must exceed that in focus to count as a rise."""


@problem("cd/sums", data=("data/disc_formats.csv",))
def sums(layouts: Annotated[int, Field(ge=10, le=10_000)] = 150) -> Sums:
    """Focus and radial sums over 150 um of focus error, of many guessed layouts (figure 4.6).

    The five diodes of figure 3.11 under three beams, by rays: half of the pupil falls on D1 and D2,
    the other half on D3, and the side beams on S1 and S2. Out of focus the light of the main beam
    spreads to S1 and S2.

    Assumed: the arrangement, and the ranges of sizes, gaps and of the side beams' light, of which
    the thesis prints none. Computed: the light of every layout. Told: in which share of the layouts
    figure 4.6 is as section 4.6.3 describes it, with 99 % Clopper-Pearson intervals over layouts.

    layouts: number of layouts drawn.
    """
    return Sums(layouts)


@dataclass(frozen=True)
class Sums(Study):
    """Light on the diodes of many layouts, and of an example."""

    layouts: int

    headline: ClassVar[str] = "rises_mean"

    @property
    def quantifier(self) -> str:
        return f"for {self.layouts} layouts drawn from the ranges"

    draw = dim(lambda self: range(self.layouts), meaning="layout")
    size = dim(RANGES, meaning="what is drawn")
    diode = dim(DIODES)
    error = dim(ERRORS, unit="m", meaning="focus error")

    @array(dims=(draw, size), unit="m or 1", meaning="sizes of the layouts")
    def drawn_sizes(self, context: Context) -> RealArray:
        low, high = np.transpose(list(RANGES.values()))
        return context.rng.uniform(low, high, (self.layouts, len(RANGES))).astype("f4")

    @part
    def light(self, drawn_sizes: DataArray, context: Context) -> RealArray:
        """Light (layouts, diodes, errors)."""
        rows = context.track(drawn_sizes.values.tolist(), "layouts")
        return np.array([layout_of(*row).light(ERRORS) for row in rows])

    told = arrays(
        draw,
        lambda light: {name: one.astype("f4") for name, one in features(light).items()},
        focus_peak=("m", "focus error at the largest focus sum"),
        radial_peak=("m", "focus error at the largest radial sum"),
        radial_rise=("1", "largest radial sum over that in focus"),
        radial_end=("1", "radial sum at 150 um over its largest"),
        radial_near=("1", "relative change of the radial sum within 2 um"),
        focus_near=("1", "relative change of the focus sum within 2 um"),
        radial_false=("1", "largest normalised radial error where the radial sum has its peak"),
        turn=("m", "focus error at the extreme of D2 - D1"),
        by_d3=("1", "relative difference of the focus error normalised by D3, within 2 um"),
    )
    example = array(
        dims=(diode, error),
        unit="1",
        meaning="light of the example over that of the main beam's half",
        value=lambda: EXAMPLE.light(ERRORS).astype("f4"),
    )

    @check(title="all the light", at_most=1e-3)
    def conserved(self) -> float:
        """largest light that endless diodes miss, over that of the main beam's half"""
        endless = Layout(1.0, 1.0, 2.0, 1.0, 1.0, 0.1)
        d1, d2, _, s1, s2 = endless.light(ERRORS)
        return float(abs(d1 + d2 + s1 + s2 - 1.2).max())

    @check(title="s-curve", at_most=0.1)
    def turns(self, turn: DataArray) -> float:
        """relative distance of the extremes of D2 - D1 from those of the s-curve, median"""
        return float(abs(abs(turn).median() / S_CURVE_PEAK - 1.0))

    @check(title="sides alike", at_most=1e-9)
    def mirrored(self) -> float:
        """largest difference of the example's S1 from its S2, over the main beam's half

        Both beams are in the middle of their diodes.
        """
        light = EXAMPLE.light(ERRORS)
        return float(abs(light[3] - light[4]).max())

    @metric
    def shares(self, answer: Dataset) -> dict[str, float]:
        """Shares of the layouts of which a sentence of section 4.6.3 is true."""
        rises = answer["radial_rise"] > RISE
        true = {
            "focus_sum_peaks_in_focus": abs(answer["focus_peak"]) <= S_CURVE_PEAK,
            "rises": rises,
            "radial_sum_near_constant": answer["radial_near"] <= 0.05,
            "radial_sum_falls": answer["radial_end"] <= 0.5,
        }
        numbers = {}
        for name, one in true.items():
            for end in (found := share_interval(one))["summary"].values:
                numbers[f"{name}_{end}"] = float(found.sel(summary=end))
        light = answer["drawn_sizes"].sel(size="side_light")
        shown = answer["example"].sel(diode=["S1", "S2"]).sum("diode")
        peak = 1e6 * abs(answer["radial_peak"]).where(rises)
        return numbers | {
            "example_rise": float(shown.max() / shown.sel(error=0.0, method="nearest")),
            "example_end": float(shown.isel(error=-1) / shown.max()),
            "rise_median": float(answer["radial_rise"].where(rises).median()),
            "rise_at_um_median": float(peak.median()),
            "side_light_rises_median": float(light.where(rises).median()),
            "side_light_else_median": float(light.where(~rises).median()),
            "radial_false_median": float(answer["radial_false"].where(rises).median()),
            "radial_near_largest": float(answer["radial_near"].max()),
            "by_d3_off_median": float(answer["by_d3"].median()),
        }

    @table
    def told_shares(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Layouts with and without a rise of the radial sum: medians of their sizes."""
        rises, rows = answer["radial_rise"] > RISE, []
        for name in RANGES:
            one = answer["drawn_sizes"].sel(size=name)
            factor, unit = (1.0, "") if name == "side_light" else (1e6, " [um]")
            medians = [
                f"{factor * float(one.where(case).median()):.3g}" for case in (rises, ~rises)
            ]
            rows.append([name.replace("_", " ") + unit, *medians])
        return ["size", "radial sum rises", "does not"], rows

    @figure
    def drawn(self, answer: Dataset) -> Figure:
        """Errors and sums of the example, and what decides whether the radial sum rises."""
        shown, (left, right) = figures.axes(1, 2, size=(11.0, 4.4))
        light = answer["example"].values.astype(float)
        at = 1e6 * answer["error"]
        sums = {"focus sum": light[0] + light[1], "radial sum": light[3] + light[4]}
        for n, (name, one) in enumerate(sums.items()):
            left.plot(at, one / one[len(one) // 2], color=figures.CYCLE[n], label=name)
        left.plot(at, light[1] - light[0], color=figures.BLACK, label="D2 - D1")
        figures.label(left, x=r"focus error [$\mu$m]", y="over the sum in focus")
        left.set_title("an example, to figure 4.6")
        left.legend()
        rises = (answer["radial_rise"] > RISE).values
        side = answer["drawn_sizes"].sel(size="side_light").values
        peak = answer["radial_rise"].values
        for case, colour, text in (
            (rises, figures.ORANGE, "rises"),
            (~rises, figures.BLUE, "falls"),
        ):
            right.plot(side[case], peak[case], ".", color=colour, label=f"radial sum {text}")
        right.set_yscale("log")
        right.legend()
        figures.label(
            right,
            x="light of a side beam over the main one",
            y="largest radial sum over that in focus",
        )
        right.set_title(f"{self.layouts} layouts")
        return shown


def layout_of(
    half_length: float,
    gap: float,
    side_width: float,
    side_length: float,
    side_light: float,
    shift: float,
) -> Layout:
    """A layout with these sizes; all beams are shifted alike along both directions."""
    apart = half_length + side_length + gap
    shifts = shift, shift
    return Layout(HALF_WIDTH, half_length, apart, side_width, side_length, side_light, shifts)


def features(light: RealArray) -> dict[str, RealArray]:
    """Features (layouts,) of the light (layouts, diodes, errors)."""
    focus, radial = light[:, 0] + light[:, 1], light[:, 3] + light[:, 4]
    middle = len(ERRORS) // 2
    inside = [normalised(one[:, NEAR]) for one in light]
    by_sum, by_d3, _ = (np.array(one) for one in zip(*inside, strict=True))
    scale = abs(by_sum).max(axis=1)
    peak = np.arange(len(light)), radial.argmax(axis=1)
    beside = (light[:, 3] - light[:, 4])[peak] / radial[peak]
    return {
        "focus_peak": ERRORS[focus.argmax(axis=1)],
        "radial_peak": ERRORS[radial.argmax(axis=1)],
        "radial_rise": radial.max(axis=1) / radial[:, middle],
        "radial_end": np.maximum(radial[:, 0], radial[:, -1]) / radial.max(axis=1),
        "radial_near": np.ptp(radial[:, NEAR], axis=1) / radial[:, middle],
        "focus_near": np.ptp(focus[:, NEAR], axis=1) / focus[:, middle],
        "radial_false": abs(beside),
        "turn": ERRORS[(light[:, 1] - light[:, 0]).argmax(axis=1)],
        "by_d3": abs(by_d3 - by_sum).max(axis=1) / scale,
    }

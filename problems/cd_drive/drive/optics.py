"""The readout beam of CD, DVD and Blu-ray: why dust on the surface is out of focus (section 2.4).

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, figures, problem
from workbench.executor import Context
from workbench.heavy_types import Axes, DataArray, Dataset, Figure

from .tables import DiscFormat, disc_formats

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]

PRINTED_STEP = {"theta1": 1.0, "theta2": 1.0, "D": 1e-5, "d": 1e-8}
"""One unit of the last printed digit of Table 2.2: angles [deg], lengths [m]."""
UNITS = {"theta1": "deg", "theta2": "deg", "D": "m", "d": "m"}


@dataclass(frozen=True)
class Beam:
    """The readout beam: angles theta1 in air and theta2 in the cover layer [deg], diameters D at
    the surface and d at the information layer [m], information density [1/m^2]."""

    theta1: float
    theta2: float
    D: float
    d: float
    density: float


def readout_beam(disc: DiscFormat, whole_degrees: bool = False) -> Beam:
    """Equations 2.1 to 2.5.

    whole_degrees: round the refracted angle to whole degrees before equation 2.4, as the printed
    Table 2.2 does.
    """
    theta1 = math.asin(disc.NA)
    theta2 = math.asin(disc.NA / disc.refractive_index)
    if whole_degrees:
        theta2 = math.radians(round(math.degrees(theta2)))
    d = disc.wavelength / (2 * disc.NA)
    D = 2 * disc.layer_thickness * math.tan(theta2) + d
    density = (disc.NA / disc.wavelength) ** 2
    return Beam(math.degrees(theta1), math.degrees(theta2), D, d, density)


def blocked_by_particle(D: float, diameter: float) -> float:
    """Share of a uniform round beam of diameter D that a round particle inside it blocks."""
    return min(1.0, diameter / D) ** 2


def blocked_by_hair(D: float, width: float) -> float:
    """Share of a uniform round beam of diameter D that a straight hair across its centre blocks."""
    half = min(1.0, width / D)
    return 2 / math.pi * (math.asin(half) + half * math.sqrt(1 - half**2))


@problem("cd/optics", data=("data/disc_formats.csv", "data/readout_beams.csv"))
def optics(dust: Length = 40e-6, hair: Length = 75e-6) -> Optics:
    """Readout beams of CD, DVD and Blu-ray, and what dust blocks of them (Tables 2.1, 2.2).

    Equations 2.1 to 2.5, compared with the printed Table 2.2. The beam enters the surface far wider
    than its focus on the information layer, so a particle takes a share of the light and no pit.

    dust: diameter of a particle [m]; hair: width of a hair [m].
    """
    return Optics(dust, hair)


@dataclass(frozen=True)
class Optics(Study):
    """Beams of the three formats, and the share that a dust particle or a hair blocks."""

    dust: float
    hair: float

    headline: ClassVar[str] = "blocked_by_dust_CD"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        formats = disc_formats()
        beams = [readout_beam(disc) for disc in formats.values()]
        rounded = [readout_beam(disc, whole_degrees=True) for disc in formats.values()]
        rows: list[list[list[float]]] = [
            [[getattr(record, name) for name in UNITS] for record in records]
            for records in (beams, rounded, list(formats.values()))
        ]
        shares = [
            (blocked_by_particle(b.D, self.dust), blocked_by_hair(b.D, self.hair)) for b in beams
        ]
        table = ("format", "quantity")
        return xr.Dataset(
            {
                "beam": (table, rows[0], {"long_name": "equations 2.1 to 2.4"}),
                "beam_whole_degrees": (table, rows[1], {"long_name": "theta2 rounded for D"}),
                "printed": (table, rows[2], {"long_name": "Table 2.2"}),
                "density": ("format", [b.density for b in beams], {"units": "1/m^2"}),
                "layer_thickness": (
                    "format",
                    [disc.layer_thickness for disc in formats.values()],
                    {"units": "m"},
                ),
                "blocked": (
                    ("format", "obstacle"),
                    shares,
                    {"units": "1", "long_name": "blocked share of a uniform beam, one pass"},
                ),
            },
            coords={
                "format": list(formats),
                "quantity": list(UNITS),
                "unit": ("quantity", list(UNITS.values())),
                "obstacle": ["dust", "hair"],
                "size": ("obstacle", [self.dust, self.hair], {"units": "m"}),
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        wide = answer["beam"].sel(quantity="D") / answer["beam"].sel(quantity="d")
        theta1, theta2 = (np.radians(answer["beam"].sel(quantity=f"theta{i}")) for i in (1, 2))
        index = [disc.refractive_index for disc in disc_formats().values()]
        snell = np.max(np.abs(np.sin(theta1) / np.sin(theta2) / index - 1))
        return [
            *(
                Check(
                    f"Table 2.2, {name}",
                    "distance from the printed value, in halves of its last digit",
                    float(self._halves(answer, "beam_whole_degrees").sel(quantity=name).max()),
                    1.0 + 1e-9,
                )
                for name in UNITS
            ),
            Check("refraction", "relative error of Snell's law", float(snell), 1e-12),
            Check(
                "out of focus", "d/D, focus over beam at the surface", 1 / float(wide.min()), 0.01
            ),
        ]

    def _halves(self, answer: Dataset, variable: str) -> DataArray:
        steps = np.array([PRINTED_STEP[str(name)] for name in answer["quantity"].values])
        distance: DataArray = abs(answer[variable] - answer["printed"]) / (steps / 2)
        return distance

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for name in answer["format"].values:
            one = answer.sel(format=name)
            numbers[f"D_{name}_m"] = float(one["beam"].sel(quantity="D"))
            numbers[f"d_{name}_m"] = float(one["beam"].sel(quantity="d"))
            for obstacle in answer["obstacle"].values:
                share = float(one["blocked"].sel(obstacle=obstacle))
                numbers[f"blocked_by_{obstacle}_{name}"] = share
            numbers[f"density_{name}_over_CD"] = float(
                one["density"] / answer["density"].sel(format="CD")
            )
        unrounded = self._halves(answer, "beam").sel(quantity="D")
        numbers["printed_D_missed_by_exact_angles"] = float((unrounded > 1.0).sum())
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = [
            "| format | quantity | printed | computed | with theta2 in whole degrees |",
            "| --- | --- | ---: | ---: | ---: |",
        ]
        for name in answer["format"].values:
            for quantity in answer["quantity"].values:
                one = answer.sel(format=name, quantity=quantity)
                values = (one["printed"], one["beam"], one["beam_whole_degrees"])
                cells = " | ".join(f"{float(value):.4g}" for value in values)
                lines.append(f"| {name} | {quantity} [{UNITS[str(quantity)]}] | {cells} |")
        return {"table-2-2": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        names = answer["format"].values
        figure, panels = figures.axes(2, 3, size=(9.0, 7.6), sharex=True, height_ratios=(1.55, 1.0))
        for side, above, name in zip(panels[:3], panels[3:], names, strict=True):
            self._side(side, answer.sel(format=name))
            self._above(above, answer.sel(format=name))
            side.set_title("Blu-ray" if name == "BRD" else str(name))
        panels[0].set_ylabel("depth below the surface [mm]")
        panels[3].set_ylabel("seen from above [mm]")
        figures.legend_below(figure, panels[0], columns=5)
        return {"out-of-focus": figure}

    def _side(self, panel: Axes, one: Dataset) -> None:
        """The converging cone through the cover layer, the dust and the hair lying on it."""
        from matplotlib.patches import Circle

        theta1, _, D, d = one["beam"].values
        thick = float(one["layer_thickness"])
        air = 0.25e-3
        wide = D / 2 + air * math.tan(math.radians(theta1))
        mm = 1e3
        panel.axhspan(0, thick * mm, color="#eeeeee", label="cover layer")
        outline = np.array([-wide, -D / 2, -d / 2, d / 2, D / 2, wide]) * mm
        depth = np.array([-air, 0, thick, thick, 0, -air]) * mm
        panel.fill(outline, depth, color=figures.ORANGE, alpha=0.35, lw=0, label="laser beam")
        panel.axhline(thick * mm, color=figures.BLACK, lw=1.5, label="information layer")
        for place, size, colour, label in self._obstacles():
            panel.add_patch(
                Circle((place * mm, -size / 2 * mm), size / 2 * mm, color=colour, label=label)
            )
        panel.set_aspect("equal")
        panel.set_ylim(1.25, -0.25)
        panel.set_xlim(-0.55, 0.55)
        panel.grid(False)

    def _above(self, panel: Axes, one: Dataset) -> None:
        """The beam's footprint on the surface with the dust and the hair."""
        from matplotlib.patches import Circle, Rectangle

        D, mm = float(one["beam"].sel(quantity="D")), 1e3
        panel.add_patch(Circle((0, 0), D / 2 * mm, color=figures.ORANGE, alpha=0.35, lw=0))
        (at, size, colour, _), (hair_at, width, hair_colour, _) = self._obstacles()
        panel.add_patch(Circle((at * mm, 0), size / 2 * mm, color=colour))
        left = (hair_at - width / 2) * mm
        panel.add_patch(Rectangle((left, -0.6), width * mm, 1.2, color=hair_colour))
        dust, hair = one["blocked"].values
        panel.set_title(f"at the centre of the beam\ndust blocks {dust:.1%}, hair {hair:.0%}")
        panel.set_aspect("equal")
        panel.set_ylim(-0.45, 0.45)
        panel.set_xlabel("across the beam [mm]")
        panel.grid(False)

    def _obstacles(self) -> tuple[tuple[float, float, str, str], ...]:
        """Place [m], size [m], colour and label; side by side, so that both can be seen."""
        gap = 10e-6
        dust_at, hair_at = -(self.dust + gap) / 2, (self.hair + gap) / 2
        return (
            (dust_at, self.dust, figures.BLUE, f"dust, {self.dust * 1e6:g} um"),
            (hair_at, self.hair, figures.BLACK, f"hair, {self.hair * 1e6:g} um"),
        )

"""Readout beams of CD, DVD and Blu-ray, and why dust on the surface is out of focus (section 2.4).

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import Axes, DataArray, Dataset, Figure

from .tables import DiscFormat, disc_formats

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]

UNITS = {"theta1": "deg", "theta2": "deg", "D": "m", "d": "m"}
PRINTED_STEP = {"theta1": 1.0, "theta2": 1.0, "D": 1e-5, "d": 1e-8}
"""One unit of the last printed digit of Table 2.2: angles [deg], lengths [m]."""


@dataclass(frozen=True)
class Beam:
    """A readout beam.

    theta1, theta2: half angles of the cone in air and in the cover layer [deg]. D, d: diameters at
    the surface and at the information layer [m]. density: density of information [1/m^2]. depth:
    distance from the focus [m] at which the wave front is wrong by a quarter of a wavelength.
    """

    theta1: float
    theta2: float
    D: float
    d: float
    density: float
    depth: float


def readout_beam(disc: DiscFormat, whole_degrees: bool = False) -> Beam:
    """The readout beam of a disc format, from equations 2.1 to 2.5.

    whole_degrees: round the refracted angle to whole degrees before equation 2.4, as in the printed
    Table 2.2.
    """
    theta1 = math.asin(disc.NA)
    theta2 = math.asin(disc.NA / disc.refractive_index)
    if whole_degrees:
        theta2 = math.radians(round(math.degrees(theta2)))
    d = disc.wavelength / (2 * disc.NA)
    D = 2 * disc.layer_thickness * math.tan(theta2) + d
    density = (disc.NA / disc.wavelength) ** 2
    depth = disc.wavelength / (2 * disc.NA**2)
    return Beam(math.degrees(theta1), math.degrees(theta2), D, d, density, depth)


def blocked_by_particle(D: float, diameter: float) -> float:
    """Share of a round, uniform beam of diameter D that a round particle in the beam blocks."""
    return min(1.0, diameter / D) ** 2


def blocked_by_hair(D: float, width: float) -> float:
    """Share of a round, uniform beam of diameter D that a straight hair across its
    centre blocks.
    """
    half = min(1.0, width / D)
    return 2 / math.pi * (math.asin(half) + half * math.sqrt(1 - half**2))


@problem("cd/optics", data=("data/disc_formats.csv", "data/readout_beams.csv"))
def optics(dust: Length = 40e-6, hair: Length = 75e-6) -> Optics:
    """Readout beams of CD, DVD and Blu-ray, and what dust blocks of them (Tables 2.1, 2.2).

    Equations 2.1 to 2.5 are compared with the printed Table 2.2. The beam is far wider at the
    surface than at its focus on the information layer, so a particle takes some of the light but
    hides no pit.

    dust: diameter of a particle [m]; hair: width of a hair [m].
    """
    return Optics(dust, hair)


@dataclass(frozen=True)
class Optics(Study):
    """Beams of the three formats, and the share that a dust particle or a hair blocks."""

    dust: float
    hair: float

    headline: ClassVar[str] = "blocked_by_dust_CD"

    @property
    def quantifier(self) -> str:
        return "for these disc formats"

    format = dim(lambda formats: list(formats))
    quantity = dim(UNITS)
    obstacle = dim("dust", "hair")
    bound = dim("least", "most")
    unit = array(dims=quantity, value=lambda: UNITS, coordinate=True)
    size = array(
        dims=obstacle, unit="m", value=lambda self: [self.dust, self.hair], coordinate=True
    )

    formats = part(lambda: disc_formats())
    beams = part(lambda formats: [readout_beam(one) for one in formats.values()])
    rounded = part(lambda formats: [readout_beam(one, True) for one in formats.values()])

    both = (format, quantity)
    beam = array(dims=both, meaning="equations 2.1 to 2.4", value=lambda beams: _rows(beams))
    beam_whole_degrees = array(
        dims=both, meaning="theta2 rounded for D", value=lambda rounded: _rows(rounded)
    )
    printed = array(dims=both, meaning="Table 2.2", value=lambda formats: _rows(formats.values()))
    density = array(dims=format, unit="1/m^2", value=lambda beams: [one.density for one in beams])
    depth_of_focus = array(dims=format, unit="m", value=lambda beams: [one.depth for one in beams])
    wavelength_inside = array(
        dims=format,
        unit="m",
        meaning="in the cover layer",
        value=lambda formats: [one.wavelength / one.refractive_index for one in formats.values()],
    )
    capacity = array(
        dims=(format, bound),
        unit="GB",
        value=lambda formats: [(one.capacity_min, one.capacity_max) for one in formats.values()],
    )
    layer_thickness = array(
        dims=format,
        unit="m",
        value=lambda formats: [one.layer_thickness for one in formats.values()],
    )

    @array(dims=(format, obstacle), unit="1", meaning="blocked share of a uniform beam, one pass")
    def blocked(self, beams: list[Beam]) -> list[tuple[float, float]]:
        dust, hair = self.dust, self.hair
        return [(blocked_by_particle(b.D, dust), blocked_by_hair(b.D, hair)) for b in beams]

    as_printed = check(
        title="Table 2.2, {quantity}",
        statement="distance from the printed value, in halves of its last digit",
        value=lambda beam_whole_degrees, printed: _halves(beam_whole_degrees, printed).max(
            "format"
        ),
        at_most=1.0 + 1e-9,
        each="quantity",
    )

    @check(at_most=1e-12)
    def refraction(self, beam: DataArray) -> float:
        """relative error of Snell's law"""
        theta1, theta2 = (np.radians(beam.sel(quantity=f"theta{i}").values) for i in (1, 2))
        index = [disc.refractive_index for disc in disc_formats().values()]
        return float(np.max(np.abs(np.sin(theta1) / np.sin(theta2) / index - 1)))

    @check(at_most=0.01)
    def out_of_focus(self, beam: DataArray) -> DataArray:
        """d/D, focus over beam at the surface"""
        return 1 / (beam.sel(quantity="D") / beam.sel(quantity="d")).min()

    diameters = metric(
        template="{quantity}_{format}_m", value=lambda beam: beam.sel(quantity=["D", "d"])
    )
    shares = metric("blocked_by_{obstacle}_{format}", value=lambda blocked: blocked)
    densities = metric(
        template="density_{format}_over_CD", value=lambda density: density / density.loc["CD"]
    )
    depths = metric(
        template="depth_of_focus_{format}_m", value=lambda depth_of_focus: depth_of_focus
    )
    inside = metric(
        template="wavelength_inside_{format}_m", value=lambda wavelength_inside: wavelength_inside
    )

    @metric("capacity_{format}_{bound}_over_CD")
    def capacities(self, capacity: DataArray) -> DataArray:
        """The least capacity over the CD's largest, and the largest over the CD's least."""
        return capacity / capacity.sel(format="CD").values[::-1]

    missed = metric(
        template="printed_D_missed_by_exact_angles",
        value=lambda beam, printed: (_halves(beam, printed).sel(quantity="D") > 1.0).sum(),
    )

    @table
    def table_2_2(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        columns = [answer[name] for name in ("printed", "beam", "beam_whole_degrees")]
        rows = [
            [name, f"{quantity} [{unit}]", *(f"{one.loc[name, quantity]:.4g}" for one in columns)]
            for name in answer["format"].values
            for quantity, unit in UNITS.items()
        ]
        return ["format", "quantity", "printed", "computed", "with theta2 in whole degrees"], rows

    @figure
    def out_of_focus_figure(self, answer: Dataset) -> dict[str, Figure]:
        names = answer["format"].values
        drawn, panels = figures.axes(2, 3, size=(9.0, 7.6), sharex=True, height_ratios=(1.55, 1.0))
        for side, above, name in zip(panels[:3], panels[3:], names, strict=True):
            self._side(side, answer.sel(format=name))
            self._above(above, answer.sel(format=name))
            side.set_title("Blu-ray" if name == "BRD" else str(name))
        panels[0].set_ylabel("depth below the surface [mm]")
        panels[3].set_ylabel("seen from above [mm]")
        figures.legend_below(drawn, panels[0], columns=5)
        return {"out-of-focus": drawn}

    def _side(self, panel: Axes, one: Dataset) -> None:
        """Draw the converging cone in the cover layer, with the dust and the hair on it."""
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
            centre = (place * mm, -size / 2 * mm)
            panel.add_patch(Circle(centre, size / 2 * mm, color=colour, label=label))
        panel.set(aspect="equal", xlim=(-0.55, 0.55), ylim=(1.25, -0.25))
        panel.grid(False)

    def _above(self, panel: Axes, one: Dataset) -> None:
        """Draw the beam's footprint on the surface, with the dust and the hair."""
        from matplotlib.patches import Circle, Rectangle

        D, mm = float(one["beam"].sel(quantity="D")), 1e3
        panel.add_patch(Circle((0, 0), D / 2 * mm, color=figures.ORANGE, alpha=0.35, lw=0))
        (at, size, colour, _), (hair_at, width, hair_colour, _) = self._obstacles()
        panel.add_patch(Circle((at * mm, 0), size / 2 * mm, color=colour))
        left = (hair_at - width / 2) * mm
        panel.add_patch(Rectangle((left, -0.6), width * mm, 1.2, color=hair_colour))
        dust, hair = one["blocked"].values
        title = f"at the centre of the beam\ndust blocks {dust:.1%}, hair {hair:.0%}"
        panel.set(aspect="equal", ylim=(-0.45, 0.45), xlabel="across the beam [mm]", title=title)
        panel.grid(False)

    def _obstacles(self) -> tuple[tuple[float, float, str, str], ...]:
        """Place [m], size [m], colour and label of dust and hair, which are drawn side by side."""
        gap = 10e-6
        dust_at, hair_at = -(self.dust + gap) / 2, (self.hair + gap) / 2
        return (
            (dust_at, self.dust, figures.BLUE, f"dust, {self.dust * 1e6:g} $\\mu$m"),
            (hair_at, self.hair, figures.BLACK, f"hair, {self.hair * 1e6:g} $\\mu$m"),
        )


def _rows(records: Iterable[Beam | DiscFormat]) -> list[list[float]]:
    """The quantities of Table 2.2, one row per record."""
    return [[getattr(record, name) for name in UNITS] for record in records]


def _halves(computed: DataArray, printed: DataArray) -> DataArray:
    """Distance between computed and printed quantities, in halves of the last printed digit."""
    steps = np.array(list(PRINTED_STEP.values()))
    distance: DataArray = abs(computed - printed) / (steps / 2)
    return distance

"""Base of the programs for circles and stadiums: data, labels, containment checks, datasets.

A circle is a stadium of half-length 0, so one containment check and one way of drawing serve both.
The checks share no code with the methods: they work in extended precision from the points alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.certificate import Check, counted_quantifier, worst_value
from workbench.errors import InputError
from workbench.geometry.figures import shape_figures
from workbench.geometry.points import as_points
from workbench.geometry.shapes import Shape
from workbench.program import Program
from workbench.second_opinion.support import reach_beyond

SUPPORT_TOLERANCE = 1e-8
"""Same as `CONTAINMENT_TOLERANCE`, for the second opinion in plain double precision."""
CONTAINMENT_TOLERANCE = 1e-9
"""Largest distance of a point beyond its shape, relative to the radius, in a valid certificate."""


@dataclass(frozen=True, eq=False)
class EnclosingShape(Program):
    """Program for the smallest shape, circle or stadium, around each of many point sets.

    Parameters
    ----------
    points
        Complex, shape (..., N): one set for each leading index. The results take the names and
        coordinates of an `xarray.DataArray`.
    windows
        Parts to draw enlarged: for each caption a range of the first axis's coordinate.
    """

    points: Any  # an ndarray after construction
    windows: Mapping[str, tuple[float, float]] = field(default_factory=dict, kw_only=True)
    labels: DataArray | None = field(default=None, init=False, repr=False)

    default_method: ClassVar[str] = "exact"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.geometry.conic",
        "workbench.geometry.nonlinear",
    )
    headline: ClassVar[str] = "radius_peak"
    answer_names: ClassVar[Mapping[str, str]]
    """Names of the arrays of an answer, each with its long name for datasets."""

    def __post_init__(self) -> None:
        labelled = hasattr(self.points, "dims")
        object.__setattr__(self, "labels", self.points if labelled else None)
        values = self.points.values if labelled else self.points
        object.__setattr__(self, "points", as_points(values))

    @property
    def batch(self) -> tuple[int, ...]:
        """Leading shape (...) of ``points``: that of the array of sets."""
        return self.points.shape[:-1]

    def place(self, index: tuple[int, ...]) -> str:
        """Name of the set of a given index, for messages."""
        parts = []
        for dim, i in zip(self._labelled().dims[:-1], index, strict=False):
            coordinate = self._labelled().coords.get(dim)
            if coordinate is None:
                parts.append(f"{dim} {i}")
            else:
                unit = coordinate.attrs.get("units", "")
                value = coordinate.values[i]
                text = f"{value:.6g}" if isinstance(value, float) else str(value)
                parts.append(f"{dim} {text} {unit}".rstrip())
        return "at " + ", ".join(parts) if parts else ""

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of points in all sets together."""
        return float(self.points.size)

    def objective(self, answer: Any) -> float:
        """The sum of the radii of all sets."""
        return float(np.sum(answer.radius))

    def objective_rounding(self, answer: Any) -> float:
        """8 eps of the largest |p| of each set: the rounding of its points' own coordinates."""
        return float(8 * EPS * np.sum(self.reach))

    # --- checks -------------------------------------------------------------------------------

    @property
    def quantifier(self) -> str:
        points = f"of {self.points.shape[-1]} points"
        return counted_quantifier(math.prod(self.batch), f"set {points}", f"sets {points}")

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        center, radius = np.asarray(answer.center), np.asarray(answer.radius)
        half_length, angle = np.asarray(answer.half_length), np.asarray(answer.angle)
        shapes = {a.shape for a in (center, radius, half_length, angle)}
        if shapes != {self.batch}:
            raise InputError(f"arrays of shape {self.batch} are needed, not {sorted(shapes)}")
        proper = (
            np.isfinite(center)
            & np.isfinite(radius)
            & np.isfinite(half_length)
            & np.isfinite(angle)
            & (radius >= 0)
            & (half_length >= 0)
        )
        improper, where = worst_value(~proper, self.place)
        properness = Check(
            "proper",
            "whether a centre, radius, half-length or angle is not finite, or a size is negative",
            improper,
            0.0,
            where=where if improper else "",
        )
        excess, where = worst_value(self.excess(answer), self.place)
        containment = Check(
            "containment",
            "largest distance of a point beyond its shape, less 8 eps of the largest |p|, "
            "relative to the radius",
            excess,
            CONTAINMENT_TOLERANCE,
            where=where,
        )
        return [properness, containment]

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        shape = answer.center, answer.radius, answer.half_length, answer.angle
        excess = reach_beyond(self.points, *map(np.asarray, shape)).max(axis=-1)
        excess = relative(excess - 8 * EPS * self.reach, answer.radius)
        value, where = worst_value(excess, self.place)
        statement = "how far the points reach beyond their shape in a direction, over the radius"
        return [Check("support", statement, value, SUPPORT_TOLERANCE, where=where)]

    def distance(self, answer: Shape) -> np.ndarray:
        """Distance (..., N) of every point from its shape's segment, in extended precision."""
        t, h = self.coordinates(answer.center, answer.angle)
        length = np.asarray(answer.half_length, dtype=np.longdouble)[..., None]
        return np.hypot(t - np.clip(t, -length, length), h)

    def coordinates(self, center: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (..., N) of every point along and across a direction [rad] from a centre.

        They are computed in extended precision.
        """
        angle = np.asarray(angle, dtype=np.longdouble)[..., None]
        away = self.points.astype(np.clongdouble) - np.asarray(center)[..., None]
        cos, sin = np.cos(angle), np.sin(angle)
        return away.real * cos + away.imag * sin, away.imag * cos - away.real * sin

    def excess(self, answer: Shape) -> np.ndarray:
        """Largest distance (...) of a point beyond its shape, relative to the shape's radius.

        The rounding of a point's own coordinates, 8 eps of the largest |p|, is subtracted first.
        """
        radius = np.asarray(answer.radius, dtype=np.longdouble)
        beyond = self.distance(answer).max(axis=-1) - radius
        return relative(beyond - 8 * EPS * self.reach, radius)

    @property
    def reach(self) -> np.ndarray:
        """Largest |p| (...) of each set, in extended precision because |p| may overflow."""
        return np.abs(self.points.astype(np.clongdouble)).max(axis=-1)

    def metrics(self, answer: Any) -> dict[str, float]:
        with np.errstate(divide="ignore", invalid="ignore"):
            relative_size = np.asarray(answer.radius / np.abs(answer.center))
        sizes = {"radius_peak": answer.radius, "radius_relative_peak": relative_size}
        if "half_length" in self.answer_names:
            sizes["half_length_peak"] = answer.half_length
        peaks = {name: float(np.max(size, initial=0.0)) for name, size in sizes.items()}
        return peaks | {"sets": int(np.prod(self.batch)), "points": self.points.shape[-1]}

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: Any) -> Dataset:
        import xarray as xr

        points = self._labelled()
        dims = points.dims[:-1]
        unit = {"units": points.attrs.get("units", "1")}
        boundary = np.asarray(answer.radius) * (1 - CONTAINMENT_TOLERANCE) - 8 * EPS * self.reach
        touching = self.distance(answer) >= boundary[..., None]
        variables = {
            "points": (points.dims, self.points, unit | {"long_name": "points to cover"}),
            "support": (
                points.dims,
                touching.astype("int8"),
                {"units": "1", "long_name": "1 where the point lies on the boundary"},
            ),
        }
        for name, long_name in self.answer_names.items():
            units = {"units": "rad"} if name == "angle" else unit
            values = np.asarray(getattr(answer, name))
            variables[name] = (dims, values, units | {"long_name": long_name})
        return xr.Dataset(variables, coords=points.coords)

    def figures(self, answer: Any) -> dict[str, Figure]:
        return shape_figures(self._labelled(), answer, self.windows)

    def _labelled(self) -> DataArray:
        """Points as a labelled array, with plain names for the axes where none were given."""
        import xarray as xr

        if self.labels is not None:
            return self.labels
        count = len(self.batch)
        names = [f"set_{axis}" for axis in range(count)] if count > 1 else ["set"] * count
        return xr.DataArray(self.points, dims=[*names, "point"], attrs={"units": "1"})


def relative(length: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """``max(length, 0) / radius``, where 0 / 0 is 0 and NaN stays NaN."""
    beyond = np.where(np.isnan(length), np.nan, np.maximum(length, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(beyond == 0, 0.0, beyond / np.abs(radius)).astype(float)

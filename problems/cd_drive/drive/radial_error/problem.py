"""Radial errors over a track by four methods, and their dependence on the pits (section 2.4.4).

Section, table and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from workbench import problem
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import DataArray, Dataset, RealArray

from ..photo_diodes import TRACK_PITCH
from ..tables import drives
from .figures import against_depth, over_track
from .methods import DPD, METHODS, PUSH_PULL, TWIN, TrackSensor, printed_depth

BITS = (3, 5, 7, 9, 11)
"""Lengths of pits [channel bits]."""
STAGGERS = (0.0, 0.25, 0.5)
"""Shifts of the pits from track to track, over their period."""
DEPTHS = tuple(n / 64 for n in range(2, 25))
"""Depths of pits [wavelengths in the disc]."""
LANDING = 0.1
"""Displacement of the light on the diodes [radii of the pupil]: 0.18 mm of a lens of 4 mm, which is
half of the movement by the radial coil.
"""
WIDTHS = (0.4e-6, 0.5e-6, 0.6e-6)
"""Widths of pits [m]. No source of ours prints them; these are about those of pressed discs."""
PLACES = 33
"""Number of places over one pitch."""
TYPICAL = (0.5e-6, 5, 0.25)
"""Width, length and stagger of the pits whose depth is varied, near the mean length."""


@problem(
    "cd/radial-error", data=("data/disc_formats.csv", "data/drives.csv", "data/compact_disc.csv")
)
def radial_error() -> RadialError:
    """Radial error by twin spot, push-pull, track wobble and phase detection (section 2.4.4).

    Scalar diffraction at a layer of equal pits: orders of the layer overlap in the pupil of the
    objective. Computed are each method's error over one track, for pits of 3 to 11 channel bits,
    0.4 to 0.6 um wide, with three shifts between neighbouring tracks and the printed depth of 0.12
    um; its strength over the depth; its false error if the light lands beside the middle of the
    diodes; and the same layer with dark pits of no depth.
    """
    return RadialError()


@dataclass(frozen=True)
class RadialError(Study):
    """Errors of all methods."""

    headline: ClassVar[str] = "contrast_twin_spot_median"

    @property
    def quantifier(self) -> str:
        return f"for {len(WIDTHS) * len(BITS) * len(STAGGERS)} layers of pits"

    scheme = dim(METHODS)
    width = dim(WIDTHS, unit="m", meaning="width of a pit")
    bits = dim(BITS, meaning="length of a pit in channel bits")
    stagger = dim(STAGGERS, meaning="shift from track to track over the period")
    place = dim(
        lambda: np.linspace(-0.5, 0.5, PLACES) * TRACK_PITCH,
        unit="m",
        meaning="distance from the track",
    )
    depth = dim(DEPTHS, meaning="depth of a pit in wavelengths in the disc")
    layers = (width, bits, stagger)

    def over_layers(
        self, read: Callable[[TrackSensor], Any], depth: float, reflection: float = 1.0
    ) -> Any:
        """Values that `read` finds for all layers of one depth, in the order of `layers`."""
        every = product(WIDTHS, BITS, STAGGERS)
        found = [read(TrackSensor(depth, w, b, s, reflection)) for w, b, s in every]
        return np.reshape(found, (len(WIDTHS), len(BITS), len(STAGGERS), *np.shape(found[0])))

    @array(dims=(*layers, scheme, place), unit="1", meaning="normalised error; of DPD in rad")
    def error(self, place: DataArray) -> Any:
        read = self.over_layers(lambda one: _all(one.errors(place.values)), printed_depth())
        return np.float32(read)

    @array(dims=(*layers, place), unit="1", meaning="light over a mirror's")
    def light(self, place: DataArray) -> Any:
        return self.over_layers(lambda one: one.light(place.values), printed_depth())

    @array(dims=(*layers, scheme), unit="1/m", meaning="slope at the track")
    def slope(self) -> Any:
        return self.over_layers(_slope, printed_depth())

    @array(
        dims=(scheme, depth), unit="1", meaning="strength before normalising, over a mirror's light"
    )
    def strength(self) -> RealArray:
        found = [TrackSensor(one, *TYPICAL).strengths() for one in DEPTHS]
        return np.array([[one[name] for one in found] for name in METHODS])

    @array(
        dims=(scheme, depth),
        unit="m",
        meaning="false error by light beside the middle of the diodes",
    )
    def offset(self) -> RealArray:
        """Error on the track with displaced light, over the slope with centred light."""
        found = []
        for one in DEPTHS:
            false = TrackSensor(one, *TYPICAL, landing=LANDING).errors(np.zeros(1))
            slope = _slope(TrackSensor(one, *TYPICAL))
            with np.errstate(divide="ignore", invalid="ignore"):
                found.append(_all(false)[:, 0] / slope)
        return np.transpose(found)

    @array(dims=(*layers, scheme), unit="1/m", meaning="slope with dark pits that have no depth")
    def dark_slope(self) -> Any:
        return self.over_layers(_slope, 0.0, reflection=0.3)

    # --- checks ---------------------------------------------------------------------------------

    @check(at_most=1e-5)
    def odd(self, error: DataArray) -> float:
        """largest sum of the errors at opposite distances from an unshifted track [1; DPD: rad]"""
        one = error.sel(stagger=0.0).values[..., 1:-1]
        return float(abs(one + one[..., ::-1]).max())

    @check(at_most=1e-2)
    def sinusoids(self, light: DataArray) -> float:
        """share of the light's variation that is no sine of one period per track"""
        return float(_harmonics(light).max())

    @check(at_most=1e-9)
    def brightest_mirror(self, light: DataArray) -> float:
        """largest excess of a layer's light over a mirror's, as a share of the mirror's"""
        return max(0.0, float(light.max()) - 1.0)

    # --- what is told ---------------------------------------------------------------------------

    @metric
    def told(self, answer: Dataset) -> dict[str, float]:
        """Numbers of each method; the least over the layers unless the name says otherwise."""
        error, numbers = answer["error"], dict[str, float]()
        wave = np.sin(2 * np.pi * error["place"] / TRACK_PITCH)
        for name in METHODS:
            one, key = error.sel(scheme=name), method_key(name)
            numbers[f"likeness_to_a_sine_{key}"] = float(_likeness(one, wave).min())
            right = (one * wave).where(abs(one["place"]) < 0.24 * TRACK_PITCH, drop=True)
            numbers[f"right_side_{key}"] = float((right >= -1e-6).mean())
            slope = answer["slope"].sel(scheme=name)
            numbers[f"slope_{key}_per_um_least"] = 1e-6 * float(slope.min())
            numbers[f"slope_{key}_per_um_median"] = 1e-6 * float(slope.median())
            numbers[f"slope_{key}_per_um_most"] = 1e-6 * float(slope.max())
            dark = 1e-6 * abs(answer["dark_slope"].sel(scheme=name)).max()
            numbers[f"slope_dark_{key}_per_um_most"] = float(dark)
            strength = answer["strength"].sel(scheme=name)
            numbers[f"best_depth_{key}"] = float(strength.idxmax("depth"))
            quarter, eighth = (float(strength.sel(depth=one)) for one in (0.25, 0.125))
            numbers[f"quarter_over_eighth_{key}"] = quarter / eighth
            at_eighth = answer["offset"].sel(scheme=name, depth=0.125)
            numbers[f"offset_{key}_um"] = 1e6 * float(abs(at_eighth))
        return numbers

    @metric
    def contrasts(self, light: DataArray) -> dict[str, float]:
        """Light between tracks over that on them, and the contrast of both, over the layers."""
        on, between = light.sel(place=0.0, method="nearest"), light.isel(place=0)
        ratio, contrast = between / on, (between - on) / (between + on)
        numbers = {"between_over_on_track": ratio, "mirror_over_on_track": 1.0 / on}
        found: dict[str, float] = {}
        for name, one in (numbers | {"contrast_twin_spot": contrast}).items():
            found |= {
                f"{name}_least": float(one.min()),
                f"{name}_median": float(one.median()),
                f"{name}_most": float(one.max()),
            }
        return found

    @metric
    def measured(self, slope: DataArray) -> dict[str, float]:
        """Middle radial gain of Table A.3 over the slope of twin spots, for each layer."""
        table = [one.K_optn for one in drives("radial", "printed")]
        ratio = (min(table) + max(table)) / 2 / slope.sel(scheme=TWIN)
        return {
            "table_A_3_over_twin_spot_least": float(ratio.min()),
            "table_A_3_over_twin_spot_median": float(ratio.median()),
            "table_A_3_over_twin_spot_most": float(ratio.max()),
        }

    @table
    def methods(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Table of the methods: values over the layers at the printed depth, and over the
        depths.
        """
        numbers = self.metrics(answer)
        heads = ["method", "slope [1/um]", "likeness to a sine", "strongest at depth"]
        heads += ["strength at 1/4 over 1/8", "false error by landing [um]", "slope, dark pits"]
        rows = []
        for name in METHODS:
            key = method_key(name)
            ends = (numbers[f"slope_{key}_per_um_{end}"] for end in ("least", "most"))
            rows.append(
                [
                    name,
                    "{:.3f} to {:.3f}".format(*ends),
                    f"{numbers[f'likeness_to_a_sine_{key}']:.3f}",
                    f"{numbers[f'best_depth_{key}']:.3f}",
                    f"{numbers[f'quarter_over_eighth_{key}']:.3f}",
                    f"{numbers[f'offset_{key}_um']:.3f}",
                    f"{numbers[f'slope_dark_{key}_per_um_most']:.3f}",
                ]
            )
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {
            "radial-errors": over_track(answer),
            "depth-and-landing": against_depth(answer, printed_depth(), (TWIN, PUSH_PULL, DPD)),
        }


def method_key(name: str) -> str:
    """Name of a method as it appears in metrics."""
    return name.replace(" ", "_").replace("-", "_")


def _all(errors: dict[str, RealArray]) -> RealArray:
    return np.array([errors[name] for name in METHODS])


def _slope(sensor: TrackSensor) -> RealArray:
    """Slope [1/m] of every method's error at the track."""
    step = 5e-9
    ends = _all(sensor.errors(np.array([-step, step])))
    slope: RealArray = (ends[:, 1] - ends[:, 0]) / (2 * step)
    return slope


def _harmonics(values: DataArray) -> RealArray:
    """Size of the higher harmonics of values over one period, relative to the first harmonic."""
    period = values.isel(place=slice(0, -1))
    found = np.fft.rfft(period.values, axis=-1)
    higher = np.sqrt((abs(found[..., 2:]) ** 2).sum(axis=-1))
    share: RealArray = higher / np.maximum(abs(found[..., 1]), np.finfo(float).tiny)
    return share


def _likeness(error: DataArray, wave: Any) -> DataArray:
    """Correlation of the errors with a sine wave over one pitch."""
    return (error * wave).sum("place") / np.sqrt((error**2).sum("place") * (wave**2).sum("place"))

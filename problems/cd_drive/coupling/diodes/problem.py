"""Signals of the five diodes over focus and radial error, their gains, and HF (section 3.6.2).

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import problem
from workbench.executor import Context
from workbench.simulation import Converter
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import DataArray, Dataset, RealArray

from ...drive.photo_diodes import S_CURVE_LINEAR, TRACK_PITCH
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import drives
from ...laboratory.bench_setup import DIODE_GAIN, INPUT_LIMIT
from .figures import gains_drawn, maps, pits_drawn
from .light import DIODES, SPLITS, diffracted_ratio, diode_light, normalised_errors
from .pits import PLACES, modulation

NORMALISERS = ("sum", "D3", "none")
"""By what the focus error is divided: D1 + D2, D3, or nothing."""
REFLECTIONS = (0.2, 0.5, 1.0, 1.4)
"""Reflections over that of the disc of Table A.3. A CD reflects at least 0.7: the first is a
rewritable disc with 0.15, the last a perfect mirror.
"""
FOCUS = np.linspace(-12e-6, 12e-6, 25)
RADIAL = TRACK_PITCH / 2 * np.linspace(-1.0, 1.0, 17)
"""Errors [m] of the maps: to the end of the contrast's table, and from track to track."""
NEAR = 0.05e-6
"""Errors [m] at whose two ends a slope is taken."""
BITS = (3, 4, 5, 7, 9, 11)
"""Lengths of pits in channel bits; a CD has 3 to 11."""
DEFOCUS = np.linspace(0.0, 4e-6, 9)
"""Focus errors [m] at which the modulation by pits is computed."""
EXAMPLE = "nominal"


@problem("cd/diodes", data=(*TABLES, "data/disc_formats.csv", "data/compact_disc.csv"))
def diodes() -> Diodes:
    """Signals of the five diodes over focus and radial error, their gains, and HF (section 3.6.2).

    D1 and D2 give the focus error, S1 and S2 the radial one. The focus error is normalised by
    D1 + D2 or by D3; HF is D1 + D2 + D3. The thesis knows no D4.

    Assumed: the s-curve and the sine of the laboratory with the gains of Table A.3; equal pits; one
    half of the pupil falls on D1 and D2 and the other on D3, parted across or along the track.
    Computed by scalar diffraction: how light and tracks vary, the difference of the halves, and the
    modulation by pits. Nothing is random.
    """
    return Diodes()


@dataclass(frozen=True)
class Diodes(Study):
    """Maps of the signals of one drive, and the gains of twelve."""

    headline: ClassVar[str] = "D3_off_on_track_along"

    @property
    def quantifier(self) -> str:
        return "for these 12 drives and reflections"

    split, diode = dim(SPLITS, meaning="line that parts the pupil"), dim(DIODES)
    normaliser = dim(NORMALISERS)
    reflection = dim(REFLECTIONS, meaning="over that of the disc of Table A.3")
    drive = dim(lambda: [one.name for one in drives("focus")])
    focus = dim(FOCUS, unit="m", meaning="focus error")
    radial = dim(RADIAL, unit="m", meaning="radial error")
    bits = dim(BITS, meaning="length of pits in channel bits")
    defocus = dim(DEFOCUS, unit="m", meaning="focus error")
    place = dim(PLACES)

    @array(dims=(split, diode, focus, radial), unit="1", meaning="signals over the focus sum")
    def signal(self) -> RealArray:
        found = np.array([diode_light(EXAMPLE, one, FOCUS, RADIAL) for one in SPLITS])
        middle = len(FOCUS) // 2, len(RADIAL) // 2
        return (found / found[0, :2, *middle].sum()).astype("f4")

    @array(
        dims=(normaliser, split, reflection, drive),
        unit="1/m or V/m",
        meaning="slope of the focus error on a track",
    )
    def gain(self, drive: DataArray) -> RealArray:
        every = [
            [[_focus_gains(str(name), one, 0.0, r) for name in drive.values] for r in REFLECTIONS]
            for one in SPLITS
        ]
        return np.moveaxis(np.array(every), -1, 0)

    @array(dims=(reflection, drive), unit="1/m", meaning="slope of the radial error in focus")
    def radial_gain(self, drive: DataArray) -> RealArray:
        names = drive.values.tolist()
        return np.array([[_radial_gain(name, 0.0, one) for name in names] for one in REFLECTIONS])

    @array(
        dims=(normaliser, split, radial),
        unit="1",
        meaning="focus gain over that on the track",
    )
    def gain_beside(self) -> RealArray:
        every = [[_focus_gains(EXAMPLE, one, y) for y in RADIAL] for one in SPLITS]
        found = np.moveaxis(np.array(every), -1, 0)
        over: RealArray = found / found[:, :, [len(RADIAL) // 2]]
        return over

    @array(dims=focus, unit="1", meaning="radial gain over that in focus")
    def radial_gain_off(self) -> RealArray:
        found = np.array([_radial_gain(EXAMPLE, x) for x in FOCUS])
        return found / found[len(FOCUS) // 2]

    @array(
        dims=(bits, defocus, place),
        unit="1",
        meaning="amplitude of the light at the pits' frequency over its mean",
    )
    def pits(self, context: Context) -> RealArray:
        rows = context.track(list(BITS), "pits")
        return np.array([[modulation(one, x) for x in DEFOCUS] for one in rows]).astype("f4")

    # --- checks -------------------------------------------------------------------------------

    @check(title="Table A.3", at_most=1e-6)
    def as_printed(self, gain: DataArray) -> float:
        """relative distance of the gain by the sum from K_optFn"""
        printed = np.array([one.K_optn for one in drives("focus")])
        return float(abs(gain.sel(normaliser="sum").values / printed - 1.0).max())

    @check(at_most=1e-9)
    def independent_of_reflection(self, gain: DataArray, radial_gain: DataArray) -> float:
        """relative change of a normalised gain with the reflection"""
        normalised = gain.sel(normaliser=["sum", "D3"])
        return float(max(_spread(normalised).max(), _spread(radial_gain).max()))

    @check(title="halves", at_most=0.02)
    def sine(self, signal: DataArray) -> float:
        """difference of D3 over D1 + D2 from diffraction at every radial error, within 4 um"""
        ratio = signal.sel(diode="D3") / signal.sel(diode=["D1", "D2"]).sum("diode")
        off = [
            ratio.sel(split=one).sel(focus=x, method="nearest").values
            - diffracted_ratio(one, x, RADIAL)
            for one in SPLITS
            for x in DEFOCUS[::2]
        ]
        return float(np.abs(off).max())

    @check(title="pits", at_most=0.0)
    def fading(self, pits: DataArray) -> DataArray:
        """increase of the modulation by the shortest pits from one focus error to the next"""
        return pits.sel(bits=3, place=PLACES[0]).diff("defocus")

    # --- what is told -------------------------------------------------------------------------

    @metric
    def gains(self, answer: Dataset) -> dict[str, float]:
        """Relative changes of gains: by the reflection, and by errors that are allowed."""
        allowed = abs(answer["radial"]) <= ACCEPTABLE_ERROR["radial"] + 1e-12
        off = abs(answer["gain_beside"] - 1.0)
        numbers = {
            f"{one}_changes_by_reflection": float(_spread(answer["gain"].sel(normaliser=one)).max())
            for one in NORMALISERS
        }
        for split in SPLITS:
            own = off.sel(normaliser="D3", split=split)
            numbers[f"D3_off_on_track_{split}"] = float(own.where(allowed).max())
            numbers[f"D3_off_anywhere_{split}"] = float(own.max())
        numbers["sum_off_anywhere"] = float(off.sel(normaliser="sum").max())
        numbers["none_off_on_track"] = float(off.sel(normaliser="none").where(allowed).max())
        step = Converter(INPUT_LIMIT).step / DIODE_GAIN
        dimmest = answer["gain"].sel(normaliser="none", reflection=REFLECTIONS[0])
        near = abs(answer["focus"]) <= S_CURVE_LINEAR + 1e-12
        lost = 1.0 - answer["radial_gain_off"].where(near)
        return numbers | {
            "radial_changes_by_reflection": float(_spread(answer["radial_gain"]).max()),
            "radial_gain_lost_in_range": float(lost.max()),
            "step_nm_rewritable_most": 1e9 * step / float(dimmest.min()),
        }

    @metric
    def high_frequency(self, answer: Dataset) -> dict[str, float]:
        """HF: its mean beside the track, and what pits modulate of it."""
        HF = answer["signal"].sel(diode=["D1", "D2", "D3"]).sum("diode")
        across = HF.sel(split=SPLITS[0]).isel(focus=len(FOCUS) // 2)
        whole = answer["pits"].sel(place=PLACES[0])
        beside = answer["pits"].sel(place=PLACES[1], defocus=0.0)
        numbers = {f"modulation_{n}T": float(whole.sel(bits=n, defocus=0.0)) for n in (3, 11)}
        near = whole.sel(defocus=S_CURVE_LINEAR, method="nearest")
        kept = near / whole.sel(defocus=0.0)
        return numbers | {
            "HF_between_over_on_track": float(across.max() / across.isel(radial=len(RADIAL) // 2)),
            "HF_over_focus_sum": float(across.isel(radial=len(RADIAL) // 2)),
            "peak_to_peak_3T_over_top": 2
            * numbers["modulation_3T"]
            / (1 + numbers["modulation_3T"]),
            "modulation_3T_between": float(beside.sel(bits=3)),
            "modulation_3T_kept_in_range": float(kept.sel(bits=3)),
            "modulation_11T_kept_in_range": float(kept.sel(bits=11)),
        }

    @table
    def told(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Focus gain by normaliser: largest relative changes."""
        rows = []
        for one in NORMALISERS:
            beside = abs(answer["gain_beside"].sel(normaliser=one) - 1.0).max("radial")
            change = float(_spread(answer["gain"].sel(normaliser=one)).max())
            rows.append([one, f"{change:.2g}", *(f"{float(n):.2g}" for n in beside)])
        return ["divided by", "reflection 0.2 to 1.4", *(f"beside, {one}" for one in SPLITS)], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"maps": maps(answer), "gains": gains_drawn(answer), "pits": pits_drawn(answer)}


def _spread(gain: DataArray) -> DataArray:
    """Largest gain over the smallest, less 1, by reflection."""
    return gain.max("reflection") / gain.min("reflection") - 1.0


def _focus_gains(drive: str, split: Any, beside: float, light: float = 1.0) -> list[float]:
    """Slopes by NORMALISERS [1/m], [1/m], [V/m] at this distance [m] from a track."""
    ends, place = np.array([-NEAR, NEAR]), np.array([beside])
    errors = normalised_errors(diode_light(drive, split, ends, place, light))
    return [float(np.diff(errors[one][:, 0])[0] / (2 * NEAR)) for one in NORMALISERS]


def _radial_gain(drive: str, off: float, light: float = 1.0) -> float:
    """Slope of the radial error [1/m] at this distance [m] from the focus."""
    ends, place = np.array([-NEAR, NEAR]), np.array([off])
    found = normalised_errors(diode_light(drive, SPLITS[0], place, ends, light))
    return float(np.diff(found["radial"][0])[0] / (2 * NEAR))

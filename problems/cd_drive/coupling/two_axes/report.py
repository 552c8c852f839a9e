"""What the study of both axes tells: metrics and a table of its stored arrays."""

from __future__ import annotations

from workbench.study import share_interval
from workbench.types import DataArray, Dataset

from ...drive.photo_diodes import CAPTURE, S_CURVE_LINEAR
from ...drive.tables import AXES
from .limits import GUESSED, PATHS, TOGETHER
from .performance import PLACES


def limits_told(answer: Dataset) -> dict[str, float]:
    """Limits of the drives: certified ones of any coupling, and those of each path."""
    numbers: dict[str, float] = {}
    for place in PLACES:
        one = answer["kept"].sel(place=place)
        numbers |= {f"kept_{place}_least": float(one.min()), f"kept_{place}_most": float(one.max())}
    for path in PATHS:
        numbers[f"limit_{path}_least"] = float(answer["limit"].sel(path=path).min())
    gain = answer["gain"].max("drive")
    return numbers | {
        f"gain_{one}_largest": float(gain.sel(case=one)) for one in gain["case"].values
    }


def errors_told(answer: Dataset) -> dict[str, float]:
    """Largest errors with couplings over those without, median and 90 % of all draws, and drives
    that lose the track.
    """
    numbers = {}
    largest, cases = answer["largest"], ("alike", "opposed")
    for axis in AXES:
        for case in cases:
            ratio = (largest.sel(case=case) / largest.sel(case="none")).sel(axis=axis)
            told = ratio.quantile([0.05, 0.5, 0.95]).values.tolist()
            for end, value in zip(("low", "median", "high"), told, strict=True):
                numbers[f"error_{axis}_{case}_{end}"] = value
    lost = (largest.sel(axis="radial") > CAPTURE["radial"]).any("draw").sum("drive")
    return numbers | {f"drives_lost_{one}": float(lost.sel(case=one)) for one in ("none", *cases)}


def kicks_told(answer: Dataset) -> dict[str, float]:
    """What a kick of one loop does to the other, without coupling but through the light."""
    one = answer.sel(case_kicked="none")
    focus, radial = one.sel(kick="focus"), one.sel(kick="radial")
    inside = focus["focus"] < S_CURVE_LINEAR
    followed = _over_shortest(focus["radial"]).where(inside).isel(pulse=slice(1, None))
    dragged = _lost(focus["radial_lost"], focus["focus_lost"])
    jumped = radial["radial_lost"] == 1
    return {
        "radial_error_by_focus_in_range": float(followed.mean()),
        "contrast_lost_in_range": float(1.0 - answer["contrast"].interp(distance=S_CURVE_LINEAR)),
        "track_lost_with_focus_mean": float(dragged.sel(summary="mean")),
        "track_lost_with_focus_low": float(dragged.sel(summary="low")),
        "focus_lost_by_jumps": float(radial["focus_lost"].where(jumped).mean()),
        "focus_error_by_jumps": float(_over_shortest(radial["focus"]).where(jumped).max()),
    }


def identification_told(answer: Dataset) -> dict[str, float]:
    """Coverage of the cross responses' discs, and what is seen of them."""
    numbers = {"covered_cross": float(answer["covered"].mean())}
    for entry, name in zip(answer["entry"].values, ("to_focus", "to_radial"), strict=True):
        numbers[f"resolved_{name}"] = float(answer["resolved"].sel(entry=entry).median())
        for case in answer["case_kicked"].values:
            seen = answer["seen"].sel(entry=entry, case_kicked=case)
            numbers[f"seen_{name}_{case}"] = float(seen.mean())
    return numbers


def sizes(answer: Dataset) -> tuple[list[str], list[list[str]]]:
    """Guessed sizes of each path, and the limits of the drives."""
    rows = []
    for path in PATHS:
        guess = "1" if path == TOGETHER else f"{getattr(GUESSED, path):g}"
        one = answer["limit"].sel(path=path).min("sign")
        least = str(one["drive"].values[int(one.values.argmin())])
        rows.append([path, guess, f"{float(one.min()):.3g}", least, f"{float(one.median()):.3g}"])
    return ["path", "guessed", "least limit", "drive", "median limit"], rows


def _over_shortest(error: DataArray) -> DataArray:
    """Errors over those after the shortest kick."""
    return error / error.isel(pulse=0)


def _lost(one: DataArray, given: DataArray) -> DataArray:
    """Share of the experiments with one loss among those with a given loss, with its interval."""
    import xarray as xr

    return share_interval(xr.DataArray(one.values[given.values == 1] == 1, dims="draw"))

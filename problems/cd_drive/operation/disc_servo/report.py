"""What the study of the disc servo tells: metrics and a table of its stored arrays."""

from __future__ import annotations

import numpy as np

from workbench.study import interval_text, share_interval
from workbench.types import DataArray, Dataset

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.tables import compact_disc
from .servo import Spindle


def servo_told(answer: Dataset) -> dict[str, float]:
    """Certified bounds over all discs and radii, and what a whole disc showed."""
    disc = compact_disc()
    most = {name: float(answer[name].max()) for name in ("swing", "deviation", "turn_change")}
    return {
        "swing_most_frames": most["swing"] * disc.frame_rate,
        "swing_most_sectors": most["swing"] * disc.frame_rate / disc.sector_frames,
        "deviation_most": most["deviation"],
        "turn_change_most": most["turn_change"],
        "whole_swing_frames": float(answer["whole_swing"].max()) * disc.frame_rate,
        "whole_deviation": float(answer["whole_deviation"].max()),
        "whole_turn_change": float(answer["whole_turn_change"].max()),
    }


def discs_told(answer: Dataset) -> dict[str, float]:
    """Rotation at both ends, times until it has changed by a hundredth, and the least time of a
    jump from end to end.
    """
    one, radii = Spindle(), answer["radius"].values
    numbers = {"least_seek_s": one.least_seek(radii[0], radii[-1])}
    for name, r in (("first", radii[0]), ("last", radii[-1])):
        rate = TRACK_PITCH * one.velocity / (2 * np.pi * r**2)
        numbers[f"rotation_{name}_hz"] = float(one.rotation(r))
        numbers[f"one_percent_{name}_s"] = float(0.01 / rate)
    return numbers


def strategies_told(answer: Dataset) -> dict[str, float]:
    """Error of what is told, and excursions over the reference strategy's, all radii: medians, and
    shares that are not below it, with 99 % intervals.
    """
    numbers, ratio = {}, _over_reference(answer)
    for how in answer["told"].values.tolist():
        key = how.replace(" ", "_")
        numbers[f"wrong_{key}_most"] = float(abs(answer["wrong"].sel(told=how)).max())
        for axis in answer["axis"].values.tolist():
            for strategy in answer["strategy"].values.tolist():
                one = ratio.sel(told=how, axis=axis, strategy=strategy)
                name = f"{axis}_{strategy}_{key}"
                numbers[f"over_reference_{name}_median"] = float(one.median())
                for end in (found := share_interval(one >= 1.0))["summary"].values:
                    numbers[f"not_below_{name}_{end}"] = float(found.sel(summary=end))
    numbers["lost_last_turn"] = float(answer["lost"].sel(told="last turn").mean())
    return numbers


def told_by_case(answer: Dataset) -> tuple[list[str], list[list[str]]]:
    """Every axis, strategy and way to tell: error of what is told, excursion over the reference
    strategy's by radius, and share that is not below it.
    """
    ratio, rows = _over_reference(answer), []
    for axis in answer["axis"].values.tolist():
        for strategy in answer["strategy"].values.tolist():
            for how in answer["told"].values.tolist():
                at = {"axis": axis, "strategy": strategy, "told": how}
                one, wrong = ratio.sel(at), 100 * abs(answer["wrong"].sel(at)).median()
                medians = [f"{float(one.sel(radius=r).median()):.2f}" for r in one["radius"].values]
                share = interval_text(share_interval(one >= 1.0), form="{:.2f}")
                rows.append([axis, strategy, how, f"{float(wrong):.2g} %", *medians, share])
    heads = [f"excursion over the reference's, {1e3 * r:.0f} mm" for r in answer["radius"].values]
    return ["axis", "strategy", "told by", "wrong by", *heads, "not below it"], rows


def _over_reference(answer: Dataset) -> DataArray:
    return answer["excursion"] / answer["reference_excursion"]

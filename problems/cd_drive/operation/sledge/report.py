"""What the study of the sledge tells: metrics and a table of its stored arrays."""

from __future__ import annotations

from typing import Any

from workbench.study import interval_text, share_interval
from workbench.types import DataArray, Dataset

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import AXES
from .train import Sledge

CLEAN = 0.1
"""Largest friction of the rods [N] of a sledge in order."""


def name_of(rods: float) -> str:
    """Friction of the rods in the name of a metric."""
    return f"{1e3 * rods:g}_mN"


def bounds_told(answer: Dataset) -> dict[str, float]:
    """Certified speeds of the carriage, the errors that they cause, and the drop of friction that
    is surely harmless.
    """
    speed = 1e3 * answer["kept_speed"]
    numbers: dict[str, Any] = {}
    for axis in AXES:
        one = answer["per_speed"].sel(axis=axis)
        numbers[f"kept_speed_{axis}_least_mm_s"] = speed.sel(axis=axis, share=0.0).min()
        numbers[f"error_per_speed_{axis}_most_um_s_per_mm"] = 1e3 * one.max()
        numbers[f"error_per_speed_{axis}_least_um_s_per_mm"] = 1e3 * one.min()
    focus, radial = (answer["per_speed"].sel(axis=axis) for axis in ("focus", "radial"))
    motor = float(answer["quiet_motor"].sel(rods=CLEAN).max())
    least = float(answer["kept_speed"].sel(axis="radial", share=0.0).min())
    acceptable = ACCEPTABLE_ERROR["focus"] / ACCEPTABLE_ERROR["radial"]
    numbers |= {
        "kept_speed_radial_half_disc_least_mm_s": speed.sel(axis="radial", share=0.5).min(),
        "kept_speed_radial_whole_disc_least_mm_s": speed.sel(axis="radial", share=1.0).min(),
        "focus_over_radial_most": (focus / radial).max(),
        "focus_over_radial_of_acceptable_most": (focus / radial).max() / acceptable,
        "motor_speed_mm_s": 1e3 * motor,
        "harmless_drop_mN": 1e3 * Sledge().harmless_drop(least, motor),
    }
    return {name: float(one) for name, one in numbers.items()}


def felt_told(answer: Dataset) -> dict[str, float]:
    """Errors of quiet rides over the acceptable ones, medians of the drives, by friction."""
    numbers = {}
    for rods in answer["rods"].values:
        one = answer.sel(rods=rods)
        for axis, name in (("radial", "quiet_largest"), ("focus", "quiet_focus")):
            felt = float(one[name].median()) / ACCEPTABLE_ERROR[axis]
            numbers[f"felt_{axis}_{name_of(rods)}_over_acceptable"] = felt
    return numbers


def shares_told(answer: Dataset) -> dict[str, float]:
    """Shares of rides with an error that is not acceptable, and of losses, with 99 % intervals."""
    numbers = {}
    beyond, lost = _beyond(answer), answer["lost"] == 1.0
    for rods in answer["rods"].values:
        for name, one in (("outside", beyond.sel(share=0.0)), ("lost", lost)):
            found = share_interval(one.sel(rods=rods))
            for end in found["summary"].values:
                numbers[f"{name}_{name_of(rods)}_{end}"] = float(found.sel(summary=end))
    held = answer["reach"].where(answer["rods"] <= CLEAN).where(~lost)
    numbers["reach_clean_most_tracks"] = float(held.max()) / TRACK_PITCH
    return numbers


def rides_told(answer: Dataset) -> tuple[list[str], list[list[str]]]:
    """Every friction and disc: shares with 99 % intervals, median error and speed."""
    beyond, rows = _beyond(answer), []
    for rods in answer["rods"].values:
        for share in answer["share"].values:
            at = {"rods": rods, "share": share}
            one = answer.sel(at)
            shares = [
                interval_text(share_interval(each), form="{:.2f}")
                for each in (beyond.sel(at), one["lost"] == 1.0)
            ]
            sizes = [f"{1e6 * float(one['largest'].median()):.3g}"]
            sizes.append(f"{1e3 * float(one['speed'].median()):.3g}")
            rows.append([f"{rods:g}", f"{share:g}", *shares, *sizes])
    heads = ["rods [N]", "disc / Red Book", "not acceptable", "track lost"]
    return [*heads, "error [um]", "speed [mm/s]"], rows


def _beyond(answer: Dataset) -> DataArray:
    return answer["largest"] > ACCEPTABLE_ERROR["radial"]

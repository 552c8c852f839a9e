"""What the study of recoveries tells: metrics and a table of its stored arrays."""

from __future__ import annotations

from workbench.study import interval_text, share_interval
from workbench.types import DataArray, Dataset


def whole_time(answer: Dataset) -> DataArray:
    """Time [s] from the cause until the own track is read again; NaN if that is not reached."""
    return answer["back"] + answer["home"]


def times_told(answer: Dataset) -> dict[str, float]:
    """Losses and searches by cause and patience, and median times until the data are back."""
    numbers, time = {}, whole_time(answer)
    several = answer.sizes["patience"] > 1
    for cause in answer["cause"].values.tolist():
        name = cause.replace(" ", "_")
        for end, share in zip(("mean", "low", "high"), _lost(answer, cause), strict=True):
            numbers[f"lost_{name}_{end}"] = share
        low, median, high = (
            time.sel(cause=cause)
            .isel(patience=-2 if several else 0)
            .quantile([0.05, 0.5, 0.95])
            .values
        )
        numbers |= {
            f"back_{name}_median_s": median,
            f"back_{name}_low_s": low,
            f"back_{name}_high_s": high,
        }
    off = time.where(answer["lost"] == 1.0).isel(patience=-2 if several else 0)
    numbers["back_after_losses_median_s"] = float(off.median())
    numbers["never_back"] = float(time.isnull().mean())
    numbers["tracks_away_median"] = float(abs(answer["away"]).where(answer["lost"] == 1.0).median())
    if several:
        for patience in answer["patience"].values:
            one = answer.sel(patience=patience)
            alarm = (one["searches"] > 0) & (one["lost"] == 0)
            at = f"{1e3 * patience:g}".replace(".", "_")
            numbers[f"false_searches_burst_{at}_ms"] = float(alarm.sel(cause="burst").mean())
            numbers[f"back_mean_{at}_ms_s"] = float(time.sel(patience=patience).mean())
    return {name: float(one) for name, one in numbers.items()}


def told_by_cause(answer: Dataset) -> tuple[list[str], list[list[str]]]:
    """Every cause: share lost, and median time until the data are back, by patience."""
    time, rows = whole_time(answer), []
    for cause in answer["cause"].values.tolist():
        lost = answer["lost"].sel(cause=cause).isel(patience=-1) == 1.0
        medians = [
            f"{1e3 * float(time.sel(cause=cause, patience=one).median()):.3g}"
            for one in answer["patience"].values
        ]
        rows.append([cause, interval_text(share_interval(lost), form="{:.2f}"), *medians])
    heads = [f"back [ms], {1e3 * one:g} ms dark" for one in answer["patience"].values]
    return ["cause", "lost", *heads], rows


def _lost(answer: Dataset, cause: str) -> list[float]:
    """Share of a cause's runs, with the longest patience, that lose the loop, and its interval."""
    lost = answer["lost"].sel(cause=cause).isel(patience=-1) == 1.0
    return [float(one) for one in share_interval(lost).values]

"""Numbers of the drives' tables and of their identification, read from stored arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from workbench import Run

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.tables import Axis
from ...laboratory.bench_setup import OUTPUT_LIMIT
from ..items import Number

DRIVES = "cd/drives"
End = Literal["min", "median", "max"]
Reading = Callable[[Run], float]
SAME = 1e-9
"""Relative difference below which two ways to compute a response are the same."""


def derived(axis: Axis, quantity: str, end: End) -> Reading:
    """Least, median or largest of a derived quantity over the twelve drives."""
    return lambda run: float(
        getattr(run.data["derived"].sel(axis=axis, quantity=quantity), end)("drive")
    )


def off_by(axis: Axis, quantity: str) -> Reading:
    """Largest magnitude of a derived quantity over the twelve drives."""
    return lambda run: float(abs(run.data["derived"].sel(axis=axis, quantity=quantity)).max())


def how_many_off(quantity: str, rounding: float) -> Reading:
    """How many of the 24 loops have a derived quantity beyond what rounding explains."""
    return lambda run: float((abs(run.data["derived"].sel(quantity=quantity)) > rounding).sum())


def resonance_range(axis: Axis, kind: str, end: End) -> Reading:
    """Least, median or largest natural frequency [Hz] over the twelve drives."""
    return lambda run: float(getattr(run.data["resonance"].sel(axis=axis, kind=kind), end)("drive"))


def general_slope(axis: Axis, low: float) -> Reading:
    """Slope of |x / u| of the general model over the decade from `low` [Hz] [dB per decade]."""

    def slope(run: Run) -> float:
        every = abs(run.data["actuator_general"].sel(axis=axis).median("drive"))
        ends = every.sel(frequency=[low, 10 * low], method="nearest")
        decades = np.diff(np.log10(ends["frequency"]))[0]
        return float(20 * np.diff(np.log10(ends))[0] / decades)

    return slope


def peak_over_quality(run: Run) -> float:
    """Height of the first peak over the level at rest, over the quality factor: farthest from 1."""
    one = {name: run.data["parameters"].sel(parameter=name) for name in ("Bl", "k", "R")}
    at_rest = one["Bl"] / one["k"] / (one["R"] * (1 + run.data["derived"].sel(quantity="r over R")))
    height = abs(run.data["actuator_general"]).max("frequency") / at_rest
    ratio = height / run.data["derived"].sel(quantity="driven quality")
    return float(1 + abs(ratio - 1).max())


def tracks_in_reach(run: Run) -> float:
    """Tracks that the radial coil reaches to one side at the converter's limit of 10 V."""
    slowest = run.data["response"].sel(axis="radial").isel(frequency=0)
    K_optn = run.data["parameters"].sel(axis="radial", parameter="K_optn")
    return float((abs(slowest) / K_optn).median()) * OUTPUT_LIMIT / TRACK_PITCH


def covered_response(run: Run) -> float:
    """Share of the frequencies at which the 99 % region of v_r/u holds the noise-free value."""
    inside = abs(run.data["response"] - run.data["exact"]) <= run.data["radius"]
    return float(inside.mean())


def response_error(run: Run) -> float:
    """Largest relative error of the measured v_r/u."""
    return float((abs(run.data["response"] - run.data["exact"]) / abs(run.data["exact"])).max())


def bias_of_last_periods(count: int) -> Reading:
    """Mean of v_r/u over the last periods less that over those before, in standard deviations.

    Of the mean over all frequencies; the larger one of real and imaginary part.
    """

    def bias(run: Run) -> float:
        every = run.data["periods"]
        last, before = every.isel(period=slice(-count, None)), every.isel(period=slice(-count))
        error = (last.mean("period") - before.mean("period")).values
        parts = np.array([error.real, error.imag])
        deviation = parts.std(axis=1, ddof=1) / np.sqrt(parts.shape[1])
        return float(abs(parts.mean(axis=1) / deviation).max())

    return bias


def dip(run: Run) -> float:
    """Frequency [Hz] at which |v_r/u| is least."""
    size = abs(run.data["response"])
    return float(size["frequency"][int(size.values.argmin())])


def ringing_left(axis: Axis, highest: float) -> Number:
    """What is left of the first resonance's ringing after ten periods at a frequency [Hz]."""
    decay = derived(axis, "decay", "median")
    return Number(
        f"ringing left after ten periods at {highest:g} Hz, {axis}",
        DRIVES,
        lambda run: float(np.exp(-10.0 / highest * decay(run))),
        low=0.05,
    )


def error_of_current(run: Run) -> float:
    """Largest error of R, Bl, k, b at the told mass, in nine draws of ten."""
    return max(run.metrics[f"error_{name}_told_mass_high"] for name in ("R", "Bl", "k", "b"))

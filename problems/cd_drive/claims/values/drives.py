"""The drives and their optical gains (chapter 3, appendix A)."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from workbench import Run

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.plants import total_gain as printed_total_gain
from ...drive.tables import Axis
from ...laboratory.bench_setup import OUTPUT_LIMIT
from .registry import value

End = Literal["min", "median", "max"]


@value
def derived(run: Run, axis: Axis, quantity: str, end: End) -> float:
    """Least, median or largest of a derived quantity over the twelve drives."""
    return float(getattr(run.data["derived"].sel(axis=axis, quantity=quantity), end)("drive"))


@value
def off_by(run: Run, axis: Axis, quantity: str) -> float:
    """Largest magnitude of a derived quantity over the twelve drives."""
    return float(abs(run.data["derived"].sel(axis=axis, quantity=quantity)).max())


@value
def how_many_off(run: Run, quantity: str, rounding: float) -> float:
    """Number of the 24 loops with a derived quantity beyond what rounding can explain."""
    return float((abs(run.data["derived"].sel(quantity=quantity)) > rounding).sum())


@value
def resonance_range(run: Run, axis: Axis, kind: str, end: End) -> float:
    """Least, median or largest natural frequency [Hz] over the twelve drives."""
    return float(getattr(run.data["resonance"].sel(axis=axis, kind=kind), end)("drive"))


@value
def general_slope(run: Run, axis: Axis, low: float) -> float:
    """Slope of |x / u| of the general model over the decade from `low` [Hz] [dB per decade]."""
    every = abs(run.data["actuator_general"].sel(axis=axis).median("drive"))
    ends = every.sel(frequency=[low, 10 * low], method="nearest")
    decades = np.diff(np.log10(ends["frequency"]))[0]
    return float(20 * np.diff(np.log10(ends))[0] / decades)


@value
def peak_over_quality(run: Run) -> float:
    """Height of the first peak over the static value, over the quality factor; the value farthest
    from 1.
    """
    one = {name: run.data["parameters"].sel(parameter=name) for name in ("Bl", "k", "R")}
    at_rest = one["Bl"] / one["k"] / (one["R"] * (1 + run.data["derived"].sel(quantity="r over R")))
    height = abs(run.data["actuator_general"]).max("frequency") / at_rest
    ratio = height / run.data["derived"].sel(quantity="driven quality")
    return float(1 + abs(ratio - 1).max())


@value
def tracks_in_reach(run: Run) -> float:
    """Number of tracks that the radial coil reaches on one side at the converter's
    limit of 10 V.
    """
    slowest = run.data["response"].sel(axis="radial").isel(frequency=0)
    K_optn = run.data["parameters"].sel(axis="radial", parameter="K_optn")
    return float((abs(slowest) / K_optn).median()) * OUTPUT_LIMIT / TRACK_PITCH


@value
def ringing_left(run: Run, axis: Axis, highest: float) -> float:
    """Remaining share of the first resonance's transient after ten periods at a frequency [Hz]."""
    return float(np.exp(-10.0 / highest * derived(run, axis, "decay", "median")))


CHOSEN_RESISTANCE = 1.0 / 1.25
"""The 1 ohm that was chosen for r, over the 1.25 ohm that was used (section 4.6.1)."""


@value
def spiral_time(run: Run) -> float:
    """Time [s] in which the radial coil follows the spiral from its middle to its limit at 9 Hz."""
    return tracks_in_reach(run) / 9.0


@value
def control_path(run: Run, axis: Axis) -> float:
    """Gain [dB] of attenuator and amplifier: K_total by equation 3.18 over K_optn."""
    K_optn = run.data["parameters"].sel(axis=axis, parameter="K_optn")
    middle = float(K_optn.min() + K_optn.max()) / 2
    return 20 * math.log10(run.metrics[f"K_total_by_eq_3_18_{axis}"] / middle)


@value
def power_drive(run: Run, axis: Axis) -> float:
    """Gain of the power drive that explains K_total of Table 5.2."""
    return printed_total_gain(axis) / run.metrics[f"K_total_by_eq_3_18_{axis}"]


@value
def extremes(run: Run) -> float:
    """Half the distance [m] between the extremes of the normalised s-curve, median of
    the drives.
    """
    curve = run.data["normalised"]
    apart = curve.idxmax("distance") - curve.idxmin("distance")
    return float(abs(apart).median()) / 2


@value
def turning_point(run: Run) -> float:
    """Distance [m] from the track at which the radial error is 0 again, median of the drives."""
    flank = run.data["normalised"].median("drive").sel(distance=slice(0.6e-6, 1.0e-6))
    slope, level = np.polyfit(flank["distance"], flank, 1)
    return float(-level / slope)


@value
def chosen_share(run: Run, axis: Axis) -> float:
    """The chosen 1 ohm over the coil's resistance, median over the drives."""
    return CHOSEN_RESISTANCE * float(
        run.data["derived"].sel(axis=axis, quantity="r over R").median()
    )


@value
def phase_at_resonance(run: Run) -> float:
    """Phase [deg] of equation 3.7 at the natural frequency; the value farthest from -90."""
    every = run.data["spring_response"].interp(relative=1.0)
    phase = np.degrees(np.angle(every.values))
    return float(phase[abs(phase + 90.0).argmax()])


@value
def slope_above(run: Run) -> float:
    """Slope [dB/decade] of equation 3.7 above five natural frequencies; the value farthest from
    -40.
    """
    above = run.data["spring_response"].sel(relative=slice(5.0, None)).isel(relative=[0, -1])
    levels = 20.0 * np.log10(abs(above.transpose("zeta", "relative").values))
    slope = (levels[:, 1] - levels[:, 0]) / np.diff(np.log10(above["relative"].values))
    return float(slope[abs(slope + 40.0).argmax()])


@value
def zero_over_pole(run: Run) -> float:
    """Largest ratio of the parasitic zero's frequency to the pole's over all 24 loops."""
    zero, pole = (run.data["resonance"].sel(kind=f"parasitic {one}") for one in ("zero", "pole"))
    return float((zero / pole).max())


@value
def share_of_damper(run: Run, end: Literal["min", "max"]) -> float:
    """Least or largest b2 / b of all 24 loops."""
    return float(getattr(run.data["derived"].sel(quantity="b2 over b"), end)())


@value
def contradictions(run: Run) -> float:
    """Number of values of Tables A.1 and A.2 that contradict others beyond their rounding."""
    return how_many_off(run, "k off", 0.15) + how_many_off(run, "b off", 1e-6)

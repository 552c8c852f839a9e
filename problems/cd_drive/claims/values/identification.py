"""Experiments and identification (chapter 4)."""

from __future__ import annotations

import numpy as np

from workbench import Run

from .registry import value


@value
def covered_response(run: Run) -> float:
    """Share of the frequencies at which the 99 % region of v_r/u holds the noise-free value."""
    inside = abs(run.data["response"] - run.data["exact"]) <= run.data["radius"]
    return float(inside.mean())


@value
def response_error(run: Run) -> float:
    """Largest relative error of the measured v_r/u."""
    return float((abs(run.data["response"] - run.data["exact"]) / abs(run.data["exact"])).max())


@value
def bias_of_last_periods(run: Run, count: int) -> float:
    """Mean of v_r/u over the last periods less that over those before, in standard deviations.

    Of the mean over all frequencies; the larger one of real and imaginary part."""
    every = run.data["periods"]
    last, before = every.isel(period=slice(-count, None)), every.isel(period=slice(-count))
    error = (last.mean("period") - before.mean("period")).values
    parts = np.array([error.real, error.imag])
    deviation = parts.std(axis=1, ddof=1) / np.sqrt(parts.shape[1])
    return float(abs(parts.mean(axis=1) / deviation).max())


@value
def dip(run: Run) -> float:
    """Frequency [Hz] at which |v_r/u| is least."""
    size = abs(run.data["response"])
    return float(size["frequency"][int(size.values.argmin())])


@value
def error_of_current(run: Run) -> float:
    """Largest error of R, Bl, k, b at the told mass, in nine draws of ten."""
    return max(run.metrics[f"error_{name}_told_mass_high"] for name in ("R", "Bl", "k", "b"))


@value
def by_equations(run: Run) -> float:
    """Largest relative distance of parameters by equations 4.20-4.23 from the direct fit's."""
    return float(abs(run.data["by_equations"] / run.data["estimate"] - 1).max())


@value
def median_width(run: Run) -> float:
    """Median over the frequencies of the 99 % region's radius over the response."""
    return float((run.data["radius"] / abs(run.data["response"])).median())


@value
def largest_frequency(run: Run, axis: str) -> float:
    """Frequency at which the nominal drive's response is largest, the oval of figure 4.8."""
    size = abs(run.data["nominal"].sel(axis=axis))
    return float(size["frequency"][int(size.values.argmax())])


@value
def worst_parameters(run: Run, names: str) -> float:
    """Largest rms error of parameters over the four estimators, from sines."""
    errors = run.data["parameter_error"].sel(noise="quiet", excitation="sines")
    chosen = errors.sel(parameter=names.split()).astype(float)
    return float(((chosen**2).mean("draw") ** 0.5).max())


@value
def nearer(run: Run, noise: str, pairs: list[str]) -> float:
    """Least share of the draws in which the first estimator of a pair is nearer to the truth."""
    return min(run.metrics[f"nearer_{noise}_{pair}"] for pair in pairs)


@value
def apart(run: Run) -> float:
    """Largest difference [%] between the levels of input and output in open loop."""
    levels = run.data["thd"].sel(loop="open")
    return float(abs(levels.sel(channel="input") - levels.sel(channel="output")).max())


@value
def added(run: Run) -> float:
    """Mean THD of the output with eight harmonics over that with five."""
    eight, five = (run.metrics[f"output_closed_{n}_harmonics_percent"] for n in (8, 5))
    return eight / five


@value
def two_or_three_of_random_arms(run: Run) -> float:
    """Share of random arms with links that differ by 40 % (standard deviation) and show 2 or 3
    resonances.
    """
    return float(run.data["random_shown"].sel(deviation=0.4, count=[2, 3]).sum())


@value
def least_known_damper(run: Run) -> float:
    """Half-width of b2's 99 % interval in closed loop, over b2."""
    return float(
        (run.data["half_width"].mean("draw") / run.data["table_value"]).sel(parameter="b2")
    )


@value
def error_of_last_periods(run: Run) -> float:
    """Largest relative error of v_r/u from the mean of the last ten periods, transient included."""
    found = run.data["periods"].isel(period=slice(-10, None)).mean("period")
    return float((abs(found - run.data["exact"]) / abs(run.data["exact"])).max())

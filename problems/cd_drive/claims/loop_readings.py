"""Ways to read numbers of chapter 6: curves of mu, weights, margins of drives, balloons' arms."""

from __future__ import annotations

import numpy as np

from workbench import Run
from workbench.arrays import RealArray

from ..drive.tables import Axis
from .items import Number, Value, at_least, at_most

ANALYSIS, FIVE_X = "cd/focus/mu-pid-analysis", "cd/focus/five-x"
NYQUIST, SENSITIVITY = "cd/{}/nyquist", "cd/focus/sensitivity"
SWITCHED, PLAYED = "cd/{}/two-controllers-switched", "cd/playability"
DEFECTS = ["scratch", "finger print", "black dot", "dropout"]
"""Arms of the balloon that are surface defects."""


def check_of(name: str) -> Value:
    """The value of a check of the run's certificate."""

    def value(run: Run) -> float:
        assert run.certificate is not None
        return next(one.value for one in run.certificate.checks if one.name == name)

    return value


# --- curves of mu ---------------------------------------------------------------------------------


def stadium_above_circle(run: Run) -> float:
    """Frequencies at which mu with stadiums is proven above mu with circles, w_p to z_p, 1X."""
    mu = run.data["mu"].sel(gain="own", speed=1.0, channel="disturbance")
    lower = mu.sel(form="stadium", bound="lower").values
    return float((lower > mu.sel(form="circle", bound="upper").values).sum())


def fails_above(form: str, frequency: float) -> Value:
    """Frequencies above one [Hz] at which mu of the fitted sets is above 1, w_p to z_p, 1X."""

    def count(run: Run) -> float:
        mu = run.data["mu"].sel(gain="own", speed=1.0, channel="disturbance", form=form)
        above = mu.sel(bound="lower", frequency=slice(frequency, None))
        return float((above > 1).sum())

    return count


def set_fails_above(kind: str, frequency: float) -> Value:
    """The same for sets that are not fitted."""

    def count(run: Run) -> float:
        mu = run.data["set_mu"].sel(gain="own", speed=1.0, single="disturbance", set=kind)
        return float((mu.sel(frequency=slice(frequency, None)) > 1).sum())

    return count


def flatness(low: float, high: float, **of: str) -> Value:
    """Least over largest mu of a controller between two frequencies [Hz]."""

    def ratio(run: Run) -> float:
        mu = run.data["mu"].sel({"bound": "upper", **of}).sel(frequency=slice(low, high))
        return float(mu.min() / mu.max())

    return ratio


# --- weights, and margins of the drives -----------------------------------------------------------


def _printed_weight(frequency: RealArray, slope: int) -> RealArray:
    """|W_p| of equation 6.11 at X = 1; 3 is the printed power, which makes -60 dB a decade."""
    s, w_B, w_I, M, A = 2j * np.pi * frequency, 2 * np.pi * 230, 2 * np.pi * 10, 2.0, 0.004
    corner = (s / M ** (1 / slope) + w_B) / (s + w_B * A ** (1 / slope))
    weight: RealArray = abs(corner**slope * (s + w_I) / (s + 0.001))
    return weight


def weight_off(run: Run) -> float:
    """Largest relative difference of the weight that is used from equation 6.11."""
    used = 1 / run.data["permitted"]
    return float(abs(used / _printed_weight(used["frequency"].values, 3) - 1).max())


def laxer_with_slope(slope: int) -> Value:
    """Error that 1 / W_p permits over what the Red Book does, most, with 20 dB times a slope."""

    def most(run: Run) -> float:
        allowed = run.data["red_book"]
        return float((1 / _printed_weight(allowed["frequency"].values, slope) / allowed).max())

    return most


def margin_over_least(drive: str, loop: str) -> Value:
    """Gain margin of a drive over the least of all drives [dB]."""

    def over(run: Run) -> float:
        margins = _gain_margin(run, loop)
        return margins[drive] - min(margins.values())

    return over


def margin_of(drive: str, loop: str) -> Value:
    """Gain margin of a drive [dB], up or down, the smaller one."""
    return lambda run: _gain_margin(run, loop)[drive]


def _gain_margin(run: Run, loop: str) -> dict[str, float]:
    one = run.data[["increase", "decrease"]].sel(loop=loop).drop_sel(drive="nominal")
    up, down = 20 * np.log10(one["increase"].values), -20 * np.log10(one["decrease"].values)
    names = one["drive"].values.tolist()
    return dict(zip(names, np.minimum(up, down).tolist(), strict=True))


# --- arms of balloons -----------------------------------------------------------------------------


def slow_in_defects(axis: Axis) -> Number:
    """How much longer defects put the slow controller out of spec than the fast one, mean."""

    def more(run: Run) -> float:
        arm = run.data["arm"].sel(group=DEFECTS).mean("group")
        return float(arm.sel(case="slow") - arm.sel(case="fast"))

    what = f"share of time out of spec in defects, K' less K, {axis}"
    return at_least(what, SWITCHED.format(axis), more, 0.02)


def raised_in_defects(axis: Axis) -> Number:
    """How much longer defects put the loop of raised gain out of spec than the printed one."""

    def more(run: Run) -> float:
        arm = run.data["arm"].sel(axis=axis, known=DEFECTS)
        return float((arm.sel(strategy="tuned") - arm.sel(strategy="reference")).max())

    return at_most(
        f"the same, raised gain less printed, most of defects, {axis}", PLAYED, more, 0.0
    )

"""mu, weights and margins (chapter 6)."""

from __future__ import annotations

import numpy as np

from workbench import Run
from workbench.types import RealArray

from ...drive.tables import gain_margins
from .registry import value

DEFECTS = ["scratch", "finger print", "black dot", "dropout"]
"""Arms of the balloon that are surface defects."""


@value
def check_of(run: Run, name: str) -> float:
    """The value of a check of the run's certificate."""
    assert run.certificate is not None
    return next(one.value for one in run.certificate.checks if one.name == name)


@value
def stadium_above_circle(run: Run) -> float:
    """Number of frequencies at which mu with stadiums is proven above mu with circles, w_p to z_p,
    1X.
    """
    mu = run.data["mu"].sel(gain="own", speed=1.0, channel="disturbance")
    lower = mu.sel(form="stadium", bound="lower").values
    return float((lower > mu.sel(form="circle", bound="upper").values).sum())


@value
def fails_above(run: Run, form: str, frequency: float) -> float:
    """Number of frequencies above one [Hz] at which mu of the fitted sets exceeds 1, w_p to z_p,
    1X.
    """
    mu = run.data["mu"].sel(gain="own", speed=1.0, channel="disturbance", form=form)
    above = mu.sel(bound="lower", frequency=slice(frequency, None))
    return float((above > 1).sum())


@value
def flatness(run: Run, low: float, high: float, **of: str) -> float:
    """Least over largest mu of a controller between two frequencies [Hz]."""
    mu = run.data["mu"].sel({"bound": "upper", **of}).sel(frequency=slice(low, high))
    return float(mu.min() / mu.max())


def _printed_weight(frequency: RealArray, slope: int) -> RealArray:
    """|W_p| of equation 6.11 at X = 1, with this power; the printed 3 gives -60 dB per decade."""
    s, w_B, w_I, M, A = 2j * np.pi * frequency, 2 * np.pi * 230, 2 * np.pi * 10, 2.0, 0.004
    corner = (s / M ** (1 / slope) + w_B) / (s + w_B * A ** (1 / slope))
    weight: RealArray = abs(corner**slope * (s + w_I) / (s + 0.001))
    return weight


@value
def weight_off(run: Run) -> float:
    """Largest relative difference of the weight that is used from equation 6.11."""
    used = 1 / run.data["permitted"]
    return float(abs(used / _printed_weight(used["frequency"].values, 3) - 1).max())


@value
def laxer_with_slope(run: Run, slope: int) -> float:
    """Largest ratio of the error that 1 / W_p permits to that of the Red Book, with 20 dB times a
    slope.
    """
    allowed = run.data["red_book"]
    return float((1 / _printed_weight(allowed["frequency"].values, slope) / allowed).max())


@value
def margin_over_least(run: Run, drive: str, loop: str) -> float:
    """Gain margin of a drive over the least of all drives [dB]."""
    margins = _gain_margin(run, loop)
    return margins[drive] - min(margins.values())


def _gain_margin(run: Run, loop: str) -> dict[str, float]:
    one = run.data[["increase", "decrease"]].sel(loop=loop).drop_sel(drive="nominal")
    up, down = 20 * np.log10(one["increase"].values), -20 * np.log10(one["decrease"].values)
    names = one["drive"].values.tolist()
    return dict(zip(names, np.minimum(up, down).tolist(), strict=True))


SETS = {"circle": "circle", "stadium": "stadium narrowest"}
"""Names of the sets before a fit."""


@value
def mu_peak(run: Run, form: str, channel: str, gain: str, sets: str, speed: float = 1.0) -> float:
    """Largest mu of robust performance with fitted weights, or with the sets before a fit."""
    if sets == "fitted":
        peak = run.data["peak"].sel(form=form, channel=channel, gain=gain, speed=speed)
        return float(peak.sel(condition="robust performance", bound="upper"))
    return _set_peak(run, SETS[form], channel, gain, speed)


@value
def circles_over_stadiums(run: Run, gain: str, sets: str) -> float:
    """Largest mu with circles over that with stadiums, w_p to z_p."""
    circle, stadium = (mu_peak(run, one, "disturbance", gain, sets) for one in SETS)
    return circle / stadium


@value
def set_ratio(run: Run, above: str, below: str, gain: str) -> float:
    """Largest mu of sets before a fit, w_p to z_p, over that of other sets."""
    return _set_peak(run, above, "disturbance", gain) / _set_peak(run, below, "disturbance", gain)


@value
def set_peak(run: Run, kind: str, channel: str, gain: str, speed: float) -> float:
    """Largest mu of robust performance with sets of a kind before a fit."""
    return _set_peak(run, kind, channel, gain, speed)


def _set_peak(run: Run, kind: str, channel: str, gain: str, speed: float = 1.0) -> float:
    mu = run.data["set_mu"].sel(gain=gain, speed=speed, single=channel, set=kind)
    return float(mu.max())


@value
def ramp_over_least(run: Run, drive: str) -> float:
    """Change of gain that an upward ramp reaches on a drive, over the least of all drives [dB],
    mean of the draws.
    """
    change = run.data["change"].sel(direction="up").mean("draw")
    return float(change.sel(drive=drive) - change.min())


@value
def ramp_correlation(run: Run) -> float:
    """Correlation of the changes that upward ramps reach on the drives with Table A.4."""
    change = run.data["change"].sel(direction="up").mean("draw")
    printed = [gain_margins()[str(name)] for name in change["drive"].values]
    return float(np.corrcoef(change.values, printed)[0, 1])

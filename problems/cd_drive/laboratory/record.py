"""Records of experiments in the virtual laboratory."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from workbench.types import Dataset, RealArray

UNITS = {"f_en": "1", "x": "m", "x_cd": "m", "f_sd": "m", "light": "1", "time": "s"}
"""Units of the recorded signals; signals not listed here are in V."""


class Event(NamedTuple):
    """An event of an experiment: its time [s] and its kind."""

    time: float
    kind: str


@dataclass(frozen=True, eq=False)
class CoilRecord:
    """Record of an experiment without optics, sampled at 35 kHz: arrays (N,).

    time [s]. u: commanded signal [V]; u_dac: the same after conversion, before the delay [V]. v_r:
    voltage over the series resistor, u_m: control signal, both as measured, divided by the gains of
    their amplifiers [V]. saturation: by signal, share of the samples at which its converter was at
    its limit.
    """

    time: RealArray
    u: RealArray
    u_dac: RealArray
    v_r: RealArray
    u_m: RealArray
    saturation: dict[str, float]

    def to_dataset(self) -> Dataset:
        """The record as labelled arrays; saturation and events become attributes."""
        import xarray as xr

        values = {field.name: getattr(self, field.name) for field in fields(self)}
        series = {name: array for name, array in values.items() if isinstance(array, np.ndarray)}
        units = {name: {"units": UNITS.get(name, "V")} for name in series}
        data = {name: ("time", array, units[name]) for name, array in series.items()}
        notes = {f"saturated_{name}": share for name, share in self.saturation.items()}
        events = [f"{e.kind} at {e.time:.6f} s" for e in values.get("events", ())]
        return xr.Dataset(data, attrs=notes | {"events": "; ".join(events)})


@dataclass(frozen=True, eq=False)
class Record(CoilRecord):
    """Record of an experiment with optics. Radially, d1, d2, f_en, x, x_cd stand for s1, s2, r_en,
    y, y_cd.

    d1, d2, their sum [V] and the normalised error f_en are as measured; x and x_cd [m] are the true
    positions of the focus point and of the layer. light is 1 on a clean disc, and f_sd [m] is the
    false displacement. events: focus or track lost and regained, in the order of time. signals (N,)
    by name: signals that parts of the controller report, see `SampledLoop`.
    """

    f_en: RealArray
    sum: RealArray
    d1: RealArray
    d2: RealArray
    x: RealArray
    x_cd: RealArray
    light: RealArray
    f_sd: RealArray
    events: tuple[Event, ...]
    signals: dict[str, RealArray]

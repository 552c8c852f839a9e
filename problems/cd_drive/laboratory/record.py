"""What an experiment in the virtual laboratory leaves behind."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from workbench.arrays import RealArray
from workbench.heavy_types import Dataset

UNITS = {"f_en": "1", "x": "m", "x_cd": "m", "f_sd": "m", "light": "1", "time": "s"}
"""Of the recorded signals; [V] where nothing else is said."""


class Event(NamedTuple):
    """Something that happened, and when [s]."""

    time: float
    kind: str


@dataclass(frozen=True, eq=False)
class CoilRecord:
    """An experiment without optics, sampled at 35 kHz: arrays (N,).

    time [s]; u commanded and u_dac converted, before the delay [V]; v_r over the series resistor
    and u_m the control signal [V], as measured, amplifiers taken out. saturation: share of the
    samples at which a converter was at its limit, by signal.
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
    """An experiment with optics. Radial: d1, d2, f_en, x, x_cd are s1, s2, r_en, y, y_cd.

    d1, d2 and their sum [V] and the normalised error f_en, as measured; x and x_cd [m], the true
    positions of the focus point and of the layer; light, 1 where the disc is clean, and f_sd [m],
    the false displacement. events: focus or track lost and regained, in the order of time. signals
    (N,) by name: what the parts of the controller told, see `SampledLoop`.
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

"""The printed tables of E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).

The tables are A.1-A.4 (twelve drives), 2.1-2.4 (discs), 5.2 and 5.3 (nominal parameters), as frozen
records in SI units. Sources and corrections are in data/README.md.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, get_args

from workbench.errors import InputError

Axis = Literal["focus", "radial"]
AXES: tuple[Axis, ...] = get_args(Axis)
Values = Literal["printed", "corrected"]

DATA = Path(__file__).parents[1] / "data"

_COLUMNS = {
    "L": "L_meas_H",
    "R_measured": "R_meas_ohm",
    "R": "R_ohm",
    "Bl": "Bl_N_per_A",
    "k": "k_N_per_m",
    "b": "b_Ns_per_m",
    "k1": "k1_N_per_m",
    "k2": "k2_N_per_m",
    "b1": "b1_Ns_per_m",
    "b2": "b2_Ns_per_m",
    "m1": "m1_kg",
    "m2": "m2_kg",
    "K_opt": "K_opt_V_per_m",
    "K_optn": "K_optn_per_m",
}


@dataclass(frozen=True, kw_only=True)
class ActuatorParameters:
    """Parameters of the specific actuator model, the fourth-order one (Table 3.2).

    Coil resistance R [ohm]; force factor Bl [N/A]; springs k1, k2 [N/m]; dampers b1, b2 [N s/m];
    masses m1 (lens side, carries the coil) and m2 (suspension side) [kg].
    """

    R: float
    Bl: float
    k1: float
    k2: float
    b1: float
    b2: float
    m1: float
    m2: float


@dataclass(frozen=True, kw_only=True)
class Drive(ActuatorParameters):
    """One axis of one drive (Tables A.1-A.3).

    Besides the parameters of the specific model: coil inductance L [H], measured resistance
    R_measured [ohm], lumped spring k [N/m] and damper b [N s/m] of the general model, and the
    optical gains K_opt [V/m] and K_optn [units/m].
    """

    name: str
    axis: Axis
    L: float
    R_measured: float
    k: float
    b: float
    K_opt: float
    K_optn: float


@dataclass(frozen=True)
class Correction:
    """A printed value of Tables A.1-A.2 that contradicts others, and its corrected value."""

    drive: str
    axis: Axis
    quantity: str
    printed: float
    corrected: float
    reason: str


@dataclass(frozen=True)
class Uncertain:
    """A parameter nominal * (1 + tolerance * delta) with |delta| <= 1 (equation 5.10)."""

    nominal: float
    tolerance: float


@dataclass(frozen=True)
class DiscFormat:
    """One column of Tables 2.1 and 2.2; lengths [m], capacities [GB], angles [deg].

    theta1, theta2 are the incident and refracted angles; D and d the diameters of the readout beam
    at the disc surface and at the information layer.
    """

    disc_diameter: float
    disc_thickness: float
    track_pitch: float
    layer_thickness: float
    wavelength: float
    NA: float
    refractive_index: float
    capacity_min: float
    capacity_max: float
    theta1: float
    theta2: float
    D: float
    d: float


@dataclass(frozen=True)
class RedBook:
    """Largest deviations of a disc in one direction (Tables 2.3, 2.4), below and above 500 Hz.

    deviation [m] and acceleration [m/s^2] hold below 500 Hz, deviation_above [m] above it. The
    radial deviation_above is a tracking error in closed loop, not a property of the disc alone.
    """

    deviation: float
    acceleration: float
    deviation_above: float


@dataclass(frozen=True)
class CompactDisc:
    """A CD by Standard ECMA-130.

    Radii [m] of the start of the lead-in and of the program area; scanning velocities [m/s]; frames
    per second, and bytes of a frame with the error code; frames and data bytes of a sector; the
    open loop by which the tracking error is measured, with its crossover and the corners of its
    lead network [Hz].
    """

    lead_in_radius: float
    program_start: float
    program_end: float
    velocity_min: float
    velocity_max: float
    frame_rate: float
    frame_coded_bytes: float
    sector_frames: float
    sector_bytes: float
    tracking_crossover: float
    tracking_lead_zero: float
    tracking_lead_pole: float


def check_axis(axis: str) -> None:
    """Raise InputError unless `axis` is "focus" or "radial"."""
    if axis not in AXES:
        raise InputError(f'axis is {axis!r}; it must be "focus" or "radial"')


def check_values(values: str) -> None:
    """Raise InputError unless `values` is "printed" or "corrected"."""
    if values not in get_args(Values):
        raise InputError(f'values is {values!r}; it must be "printed" or "corrected"')


def _rows(name: str) -> list[dict[str, str]]:
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@cache
def corrections() -> tuple[Correction, ...]:
    """The corrections that values="corrected" applies to Tables A.1-A.2."""
    return tuple(
        Correction(
            row["drive"],
            "focus" if row["axis"] == "focus" else "radial",
            row["quantity"],
            float(row["printed"]),
            float(row["corrected"]),
            row["reason"],
        )
        for row in _rows("corrections.csv")
    )


@cache
def drives(axis: Axis, values: Values = "printed") -> tuple[Drive, ...]:
    """The twelve drives CD1 ... CD12 on one axis (Tables A.1-A.3), printed or corrected values.

    Raises InputError for an unknown axis or choice of values.
    """
    check_axis(axis)
    check_values(values)
    corrected = {
        (c.drive, c.quantity): c.corrected
        for c in corrections()
        if c.axis == axis and values == "corrected"
    }
    return tuple(
        Drive(
            name=(name := row["drive"]),
            axis=axis,
            **{
                field: corrected.get((name, field), float(row[column]))
                for field, column in _COLUMNS.items()
            },
        )
        for row in _rows("drives.csv")
        if row["axis"] == axis
    )


def gain_margins() -> dict[str, float]:
    """Measured focus gain margins [dB] by drive (Table A.4)."""
    return {row["drive"]: float(row["gain_margin_dB"]) for row in _rows("gain_margins.csv")}


def nominal_table(axis: Axis) -> dict[str, Uncertain]:
    """Table 5.2 as printed: K_total [units/V] and the fields of ActuatorParameters [SI]."""
    check_axis(axis)
    return {
        row["parameter"].replace("Kdc_total", "K_total"): Uncertain(
            float(row[f"{axis}_nom"]), float(row[f"{axis}_rel"])
        )
        for row in _rows("nominal.csv")
    }


def reduced_tolerances(axis: Axis) -> dict[str, float]:
    """Table 5.3: relative tolerances of R, k1 and k2 when only these are uncertain."""
    check_axis(axis)
    return {row["parameter"]: float(row[f"{axis}_rel"]) for row in _rows("reduced_tolerances.csv")}


def disc_formats() -> dict[str, DiscFormat]:
    """Tables 2.1 and 2.2 by format: "CD", "DVD", "BRD" (Blu-ray)."""
    rows = _rows("disc_formats.csv") + _rows("readout_beams.csv")
    return {
        name: DiscFormat(**{row["quantity"]: float(row[name]) for row in rows})
        for name in ("CD", "DVD", "BRD")
    }


def red_book(axis: Axis) -> RedBook:
    """Table 2.3 (focus: vertical deviations) or 2.4 (radial deviations)."""
    check_axis(axis)
    direction = "vertical" if axis == "focus" else "radial"
    deviation, acceleration, deviation_above = (
        float(row["value"]) for row in _rows("red_book.csv") if row["axis"] == direction
    )
    return RedBook(deviation, acceleration, deviation_above)


def compact_disc() -> CompactDisc:
    """The CD of Standard ECMA-130."""
    return CompactDisc(
        **{row["quantity"]: float(row["value"]) for row in _rows("compact_disc.csv")}
    )

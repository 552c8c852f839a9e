"""Chapter 2: the Red Book's limits, and the servo loops of sledge and disc."""

from __future__ import annotations

import math

import numpy as np

from workbench import Run

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.tables import Axis, red_book
from ..items import Item, Number, Value, Verdict, at_least, at_most, near

RED_BOOK = "cd/red-book"


def limit(what: str, axis: Axis, array: str, printed: float) -> Number:
    """A limit of Table 2.3 or 2.4: a maximum of an array over frequency."""
    return near(
        what, RED_BOOK, lambda run: float(run.data[array].sel(axis=axis).max()), printed, 1e-6
    )


def attenuation(axis: Axis) -> Value:
    """Largest deviation over the error that may remain."""
    return lambda run: float(10 ** (run.metrics[f"attenuation_{axis}_db"] / 20))


def slope(axis: Axis, low: float, high: float) -> Number:
    """Slope of the envelope between two frequencies [Hz]."""

    def slope_of(run: Run) -> float:
        envelope = run.data["envelope"].sel(axis=axis)
        logarithms = np.interp(np.log([low, high]), np.log(envelope["frequency"]), np.log(envelope))
        return float(20.0 * math.log10(math.e) * np.diff(logarithms)[0] / np.log10(high / low))

    return Number(f"slope, {axis} [dB per decade]", RED_BOOK, slope_of, -41.0, -39.0)


def disc_limit(run: Run) -> float:
    """Deviation [um] of the track that the measuring loop turns into 0.03 um at most."""
    return 1e6 * red_book("radial").deviation_above / run.metrics["largest_tracking_S"]


ITEMS = (
    Item(
        "Section 2.5.1",
        "A warped disc leaves the depth of focus, and an eccentric one jumps several tracks",
        Verdict.REPRODUCED,
        (
            at_least(
                "deviation over acceptable error [dB]", RED_BOOK, "attenuation_focus_db", 20.0
            ),
            at_least(
                "tracks that pass in half a revolution",
                RED_BOOK,
                lambda run: float(2 * run.data["envelope"].sel(axis="radial").max() / TRACK_PITCH),
                2.0,
            ),
        ),
        shown="figure-2-12",
    ),
    Item(
        "Table 2.3",
        "The Red Book allows 500 um and 10 m/s^2 below 500 Hz vertically",
        Verdict.REPRODUCED,
        (
            limit("deviation [m]", "focus", "envelope", 500e-6),
            limit("acceleration [m/s^2]", "focus", "acceleration", 10.0),
        ),
        shown="tables-2-3-2-4",
    ),
    Item(
        "Table 2.4",
        "The Red Book allows 70 um and 0.4 m/s^2 below 500 Hz radially",
        Verdict.REPRODUCED,
        (
            limit("deviation [m]", "radial", "envelope", 70e-6),
            limit("acceleration [m/s^2]", "radial", "acceleration", 0.4),
        ),
        shown="tables-2-3-2-4",
    ),
    Item(
        "Table 2.4",
        "Above 500 Hz a tracking error of 0.03 um is allowed, measured in a loop of 200 Hz",
        Verdict.READING,
        (
            Number(
                "largest sensitivity of that loop above 500 Hz",
                RED_BOOK,
                "largest_tracking_S",
                1.0,
                1.5,
            ),
            at_most("limit of the disc itself [um]", RED_BOOK, disc_limit, 0.03),
        ),
        "The loop is that of ECMA-130: double integrator, lead from 65 to 650 Hz. It enlarges "
        "deviations, so the disc itself may deviate less",
    ),
    Item(
        "Equation 2.7",
        "The focus deviation is bounded by its size up to 22 Hz",
        Verdict.REPRODUCED,
        (near("corner [Hz]", RED_BOOK, "lower_corner_focus_hz", 22.0, 0.03),),
    ),
    Item(
        "Equation 2.8",
        "From 500 Hz on the focus deviation is 1 um at most",
        Verdict.REPRODUCED,
        (near("corner [Hz]", RED_BOOK, "upper_corner_focus_hz", 500.0, 0.01),),
    ),
    Item(
        "Section 2.5.1",
        "The radial corners are 12 and 580 Hz",
        Verdict.READING,
        (
            near("lower corner [Hz]", RED_BOOK, "lower_corner_radial_hz", 12.0, 0.03),
            near("upper corner [Hz]", RED_BOOK, "upper_corner_radial_hz", 580.0, 0.01),
        ),
        "The upper one takes the 0.03 um, a tracking error in closed loop, for a deviation of the "
        "disc",
    ),
    Item(
        "Figure 2.12",
        "Between its corners the acceleration bounds the deviation",
        Verdict.REPRODUCED,
        (slope("focus", 50.0, 300.0), slope("radial", 50.0, 300.0)),
        shown="figure-2-12",
    ),
    Item(
        "Section 2.5.1",
        "Of 500 um and 70 um, 2 um and 0.2 um may remain",
        Verdict.REPRODUCED,
        (
            near("500 um over the error", RED_BOOK, attenuation("focus"), 250.0, 0.001),
            near("70 um over the error", RED_BOOK, attenuation("radial"), 350.0, 0.001),
        ),
        "The errors are taken over; the ratios are what the loops must attenuate",
        "figure-2-12",
    ),
    Item(
        "Section 2.5.1",
        "The largest vertical error, 2 um, can be calculated",
        Verdict.READING,
        (near("depth of focus of a CD [m]", "cd/optics", "depth_of_focus_CD_m", 2e-6, 0.05),),
        "As the depth of focus, lambda / (2 NA^2): there the wave front is wrong by a quarter of "
        "the wavelength",
    ),
    Item(
        "Section 2.5.2",
        "A sledge carries the pickup; its jerks disturb the radial loop more than the focus loop",
        Verdict.OPEN,
        found="Needs a sledge, its motor and its friction in the laboratory. The thesis prints no "
        "number of them",
    ),
    Item(
        "Section 2.5.3",
        "At 1.3 m/s the disc turns at about 9 Hz inside and 3 Hz outside",
        Verdict.READING,
        (
            near("where the lead-in starts [Hz]", RED_BOOK, "rotation_lead_in_hz", 9.0, 0.05),
            near("where the program ends [Hz]", RED_BOOK, "rotation_end_hz", 3.0, 0.2),
        ),
        "From the lead-in on. At 1.3 m/s even the disc's edge would turn at 3.4 Hz",
    ),
    Item(
        "Section 2.5.3",
        "The disc servo lowers the rotation linearly",
        Verdict.REFUTED,
        (
            at_most(
                "rotation halfway between the radii, over that of a straight line",
                RED_BOOK,
                lambda run: _below_line(
                    run.metrics["rotation_start_hz"], run.metrics["rotation_end_hz"]
                ),
                0.95,
                1.0,
            ),
        ),
        "It falls as one over the radius",
    ),
    Item(
        "Section 2.5.3",
        "The data rate is 150 KB/s",
        Verdict.REPRODUCED,
        (near("user data [1024 bytes/s]", RED_BOOK, "user_data_kib_per_s", 150.0, 0.01),),
        "75 sectors a second of 2048 bytes",
    ),
    Item(
        "Section 2.5.3",
        "The disc servo keeps the buffer filled at whatever speed is needed",
        Verdict.OPEN,
        found="Needs the disc motor, its loop and the data buffer. The laboratory's rotation is a "
        "given profile",
    ),
)


def _below_line(start: float, end: float) -> float:
    """Harmonic over arithmetic mean: rotation at the middle radius over the mean of both ends."""
    return 4.0 * start * end / (start + end) ** 2

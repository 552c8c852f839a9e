"""Chapter 3: the general model of actuator and optics, and the experimental setup."""

from __future__ import annotations

import math

import numpy as np

from workbench import Run

from ...drive.plants import total_gain
from ...drive.tables import Axis
from ..items import Item, Number, Value, Verdict, at_least, at_most, near
from .drive_readings import (
    DRIVES,
    SAME,
    derived,
    general_slope,
    peak_over_quality,
    tracks_in_reach,
)

CHOSEN_RESISTANCE = 1.0 / 1.25
"""The 1 ohm that was chosen for r over the 1.25 ohm that it became (section 4.6.1)."""
TURN_AROUND = 0.5
"""Delay [samples] of the hold, which stands beside that of the computer."""


def spiral_time(run: Run) -> float:
    """Time [s] in which the radial coil follows the spiral from its middle to its limit at 9 Hz."""
    return tracks_in_reach(run) / 9.0


def control_path(axis: Axis) -> Value:
    """Gain [dB] of attenuator and amplifier: K_total by equation 3.18 over K_optn."""

    def level(run: Run) -> float:
        K_optn = run.data["parameters"].sel(axis=axis, parameter="K_optn")
        middle = float(K_optn.min() + K_optn.max()) / 2
        return 20 * math.log10(run.metrics[f"K_total_by_eq_3_18_{axis}"] / middle)

    return level


def power_drive(axis: Axis) -> Value:
    """Gain of the power drive that K_total of Table 5.2 leaves to it."""
    return lambda run: total_gain(axis) / run.metrics[f"K_total_by_eq_3_18_{axis}"]


def extremes(run: Run) -> float:
    """Half the distance [m] of the extremes of the normalised s-curve, median of the drives."""
    curve = run.data["normalised"]
    apart = curve.idxmax("distance") - curve.idxmin("distance")
    return float(abs(apart).median()) / 2


def turning_point(run: Run) -> float:
    """Distance [m] from the track at which the radial error is 0 again, median of the drives."""
    flank = run.data["normalised"].median("drive").sel(distance=slice(0.6e-6, 1.0e-6))
    slope, level = np.polyfit(flank["distance"], flank, 1)
    return float(-level / slope)


def chosen_share(axis: Axis) -> Number:
    """Share of the 1 ohm that was chosen in the coil's resistance, median over the drives."""

    def share(run: Run) -> float:
        return CHOSEN_RESISTANCE * float(
            run.data["derived"].sel(axis=axis, quantity="r over R").median()
        )

    return near(f"1 ohm over R, {axis}", DRIVES, share, 0.05, 0.25)


def phase_at_resonance(run: Run) -> float:
    """Phase [deg] of equation 3.7 at the natural frequency, that farthest from -90."""
    every = run.data["spring_response"].interp(relative=1.0)
    phase = np.degrees(np.angle(every.values))
    return float(phase[abs(phase + 90.0).argmax()])


def slope_above(run: Run) -> float:
    """Slope [dB/decade] of equation 3.7 above five natural frequencies, that farthest from -40."""
    above = run.data["spring_response"].sel(relative=slice(5.0, None)).isel(relative=[0, -1])
    levels = 20.0 * np.log10(abs(above.transpose("zeta", "relative").values))
    slope = (levels[:, 1] - levels[:, 0]) / np.diff(np.log10(above["relative"].values))
    return float(slope[abs(slope + 40.0).argmax()])


ITEMS = (
    Item(
        "Equations 3.1 to 3.5",
        "A voltage drives the coil's current against R, L and the back-EMF; the force is Bl i",
        Verdict.REPRODUCED,
        (
            at_most(
                "distance from the model put together of its elements",
                DRIVES,
                "equation_3_10_off",
                SAME,
            ),
        ),
    ),
    Item(
        "Equation 3.6",
        "Above its resonance the actuator falls by 40 dB per decade",
        Verdict.REPRODUCED,
        (
            near("slope, focus [dB]", DRIVES, general_slope("focus", 200.0), -40.0, 0.02),
            near("slope, radial [dB]", DRIVES, general_slope("radial", 500.0), -40.0, 0.02),
        ),
    ),
    Item(
        "Equation 3.7",
        "Q = 1 / (2 zeta) is the height of the peak over the level at low frequency",
        Verdict.REPRODUCED,
        (near("height over Q, the drive farthest off", DRIVES, peak_over_quality, 1.0, 0.02),),
        "With the damping of the back-EMF in zeta, as the coil is fed by a voltage",
    ),
    Item(
        "Figure 3.8",
        "Bode plots of a mass on a damped spring for several damping ratios",
        Verdict.REPRODUCED,
        (
            at_most(
                "relative distance of the peaks from sqrt(1 - 2 zeta^2)",
                DRIVES,
                "figure_3_8_frequency_off",
                0.01,
            ),
            at_most(
                "of their heights from 1 / (2 zeta sqrt(1 - zeta^2))",
                DRIVES,
                "figure_3_8_height_off",
                0.01,
            ),
            near("phase at the natural frequency [deg]", DRIVES, phase_at_resonance, -90.0, 0.001),
            near("slope of the last octave [dB/decade]", DRIVES, slope_above, -40.0, 0.03),
        ),
        "Of equation 3.7, by frequency over the natural one. The thesis' ratios are not legible; "
        "these go from 0.005 to 1",
        "figure-3-8",
    ),
    Item(
        "Section 3.2.2",
        "The resonance of an optical drive has a quality factor of 10 to 100",
        Verdict.REPRODUCED,
        (
            Number("least, focus", DRIVES, derived("focus", "quality", "min"), 10.0, 100.0),
            Number("largest, focus", DRIVES, derived("focus", "quality", "max"), 10.0, 100.0),
            Number("least, radial", DRIVES, derived("radial", "quality", "min"), 10.0, 100.0),
            Number("largest, radial", DRIVES, derived("radial", "quality", "max"), 10.0, 100.0),
        ),
        "Of the mechanics alone. With the back-EMF it is 9.6 to 12.2",
        "derived",
    ),
    Item(
        "Equations 3.8, 3.9",
        "Near the focus and the track the error is the distance times an optical gain",
        Verdict.REPRODUCED,
        (
            at_most(
                "error of K_optF by a scan, nine draws of ten",
                "cd/focus/optical-gain",
                "error_K_opt_high",
                0.06,
            ),
            at_most(
                "error of K_optR by a scan, nine draws of ten",
                "cd/radial/optical-gain",
                "error_K_opt_high",
                0.03,
            ),
        ),
        shown="s-curve",
    ),
    Item(
        "Equation 3.10",
        "From voltage to displacement the general model is of third order",
        Verdict.REPRODUCED,
        (
            at_most(
                "largest relative distance from the printed equation",
                DRIVES,
                "equation_3_10_off",
                SAME,
            ),
        ),
        "R is that of the whole circuit, R + r",
    ),
    Item(
        "Equation 3.11",
        "A power drive of gain K_pd stands between control voltage and coil",
        Verdict.READING,
        (
            Number("K_pd that K_total leaves, focus", DRIVES, power_drive("focus"), 1.0, 2.0),
            Number("K_pd that K_total leaves, radial", DRIVES, power_drive("radial"), 1.0, 2.0),
        ),
        "K_pd is not printed. It is read from K_total of Table 5.2, and differs between the axes",
    ),
    Item(
        "Section 3.5",
        "Electrical, magnetic, mechanical and optical paths couple focus and radial loop",
        Verdict.OPEN,
        found="Needs both axes in one laboratory, and the diodes' sum as a function of both "
        "errors. No size is printed",
    ),
    Item(
        "Section 3.5",
        "The optical coupling is the largest, and small while errors are in the linear range",
        Verdict.OPEN,
        found="Needs the same two-axis laboratory. Its diodes would have to be modelled from the "
        "optics",
    ),
    Item(
        "Section 3.6",
        "Attenuator and amplifier of the control signal have -54 and 40 dB",
        Verdict.REPRODUCED,
        (
            near("both together, focus [dB]", DRIVES, control_path("focus"), -14.0, 0.01),
            near("both together, radial [dB]", DRIVES, control_path("radial"), -14.0, 0.01),
        ),
        "Used as printed, as are 60 and 38 dB, 8 and 35 kHz, 12 bits, 5 and 10 V",
    ),
    Item(
        "Section 3.6",
        "The series resistor is about 5 % of the coil's resistance",
        Verdict.READING,
        (chosen_share("focus"), chosen_share("radial")),
        "Of the 1 ohm that was chosen. The 1.25 ohm after soldering are 7 %",
        "derived",
    ),
    Item(
        "Section 3.6",
        "The diodes' currents are below 12 uA",
        Verdict.NOT_COMPUTABLE,
        found="A measurement. The tables give the diodes' signals as voltages only",
    ),
    Item(
        "Section 3.6.1",
        "The focus is lost beyond 6 um",
        Verdict.READING,
        (near("extremes of the s-curve [m]", "cd/focus/optical-gain", extremes, 6e-6, 0.1),),
        "Read as the extremes of the s-curve, whose distance of 12 um is the scale of the scan",
        "s-curve",
    ),
    Item(
        "Section 3.6.1",
        "A radial error of more than 0.8 um jumps to the next track",
        Verdict.REPRODUCED,
        (
            near(
                "where the radial error is 0 again [m]",
                "cd/radial/optical-gain",
                turning_point,
                0.8e-6,
                0.05,
            ),
        ),
        "Half of the track pitch, which is the scale of the scan",
    ),
    Item(
        "Sections 2.5.2, 3.6.1",
        "The radial coil reaches a few hundred tracks",
        Verdict.READING,
        (
            Number(
                "tracks to one side at the converter's 10 V", DRIVES, tracks_in_reach, 200.0, 900.0
            ),
        ),
        "At the largest control voltage, with K_total of Table 5.2",
    ),
    Item(
        "Section 3.6.1",
        "Without the sledge the radial coil is at its limit after a few seconds",
        Verdict.REFUTED,
        (at_least("time from the middle at 9 Hz [s]", DRIVES, spiral_time, 20.0),),
        "A few hundred tracks at 9 tracks a second take longer, unless the coil starts near its "
        "limit",
    ),
    Item(
        "Section 3.6.1",
        "The computer's delay is between one and two sampling periods",
        Verdict.READING,
        (
            Number(
                "delay that Table A.4 asks for [samples]",
                "cd/focus/sensitivity",
                lambda run: run.metrics["delay_of_table_a4_samples"] + TURN_AROUND,
                0.9,
                2.0,
            ),
            Number(
                "delay that the stated bandwidth asks for [samples]",
                "cd/focus/sensitivity",
                lambda run: run.metrics["delay_of_bandwidth_samples"] + TURN_AROUND,
                0.9,
                2.0,
            ),
        ),
        "The half sample of the hold counted in. Drive by drive Table A.4 does not fit a delay",
        "margins",
    ),
)

"""Chapter 4: how the drives are identified (sections 4.2 to 4.4)."""

from __future__ import annotations

from workbench import Run

from ...drive.tables import Axis
from ..items import Item, Number, Verdict, at_least, at_most, near
from ..readings import quotient
from .drive_readings import (
    DRIVES,
    bias_of_last_periods,
    covered_response,
    derived,
    dip,
    error_of_current,
    resonance_range,
    response_error,
)

OPEN_FOCUS, OPEN_RADIAL = "cd/focus/open-loop", "cd/radial/open-loop"
GAIN_CONTROL_FOCUS, GAIN_CONTROL_RADIAL = "cd/focus/gain-control", "cd/radial/gain-control"
CLOSED_FOCUS, CLOSED_RADIAL = "cd/focus/closed-loop", "cd/radial/closed-loop"
ENOUGH_PERIODS = 4
"""Periods of which section 4.2.1 says that they suffice."""
SURE = 3.0
"""Standard deviations beyond which a mean is called biased."""


def by_equations(run: Run) -> float:
    """Largest relative distance of parameters by equations 4.20-4.23 from the direct fit's."""
    return float(abs(run.data["by_equations"] / run.data["estimate"] - 1).max())


def residual_noise(axis: Axis) -> Number:
    """Chi-square per degree of freedom of the fit of equation 4.17: 1 when only noise is left."""
    what = f"chi-square of the fit per degree of freedom, {axis}"
    return Number(what, f"cd/{axis}/open-loop", "chi_square_mean", 0.75, 1.25)


def share_covered(axis: Axis) -> Number:
    """Share of the frequencies at which the 99 % region holds the noise-free response."""
    what = f"share of the frequencies that hold the truth, {axis}"
    return Number(what, f"cd/{axis}/open-loop", covered_response, 0.97, 1.0, 0.99)


def shown_in_current(axis: Axis) -> tuple[Number, Number]:
    """How much of both resonances the coil's current shows, over its level."""
    return (
        at_most(
            f"most that a drive's parasitic resonance shows, {axis}",
            DRIVES,
            derived(axis, "parasitic in current", "max"),
            0.01,
        ),
        at_least(
            f"least that a drive's first resonance shows, {axis}",
            DRIVES,
            derived(axis, "first in current", "min"),
            0.1,
        ),
    )


ITEMS = (
    Item(
        "Equations 4.4 to 4.13",
        "Averages over periods of noisy input and output give the response",
        Verdict.REPRODUCED,
        (
            at_most("largest relative error of v_r/u, focus", OPEN_FOCUS, response_error, 0.01),
            at_most("largest relative error of v_r/u, radial", OPEN_RADIAL, response_error, 0.01),
        ),
        "For CD1, with noise on both channels",
        "bode",
    ),
    Item(
        "Section 4.2.1",
        "Four periods are enough for an unbiased mean",
        Verdict.REPRODUCED,
        (
            at_most(
                "bias over its standard deviation, focus",
                OPEN_FOCUS,
                bias_of_last_periods(ENOUGH_PERIODS),
                SURE,
            ),
            at_most(
                "bias over its standard deviation, radial",
                OPEN_RADIAL,
                bias_of_last_periods(ENOUGH_PERIODS),
                SURE,
            ),
        ),
        "Mean of v_r/u over the last four of twenty periods less that over the six before them",
    ),
    Item(
        "Equations 4.14, 4.15",
        "Student's t gives 99 % intervals of the response",
        Verdict.READING,
        (share_covered("focus"), share_covered("radial")),
        "As regions of a complex number, by the F distribution",
        "bode",
    ),
    Item(
        "Section 4.2.3",
        "Small changes of the fitted coefficients cover the region, and so give their intervals",
        Verdict.READING,
        (
            at_least("share of R, Bl, k, b within, focus", OPEN_FOCUS, "covered", 0.95),
            at_least("share of R, Bl, k, b within, radial", OPEN_RADIAL, "covered", 0.95),
        ),
        "By the covariance of a weighted fit of the physical parameters instead of fitsys.m",
        "parameters",
    ),
    Item(
        "Section 4.3",
        "An experiment in closed loop tells less than one in open loop",
        Verdict.REPRODUCED,
        (
            at_most(
                "error of R, Bl, k, b at the told mass, focus", OPEN_FOCUS, error_of_current, 0.01
            ),
            at_least(
                "interval of m2 in closed loop, focus", CLOSED_FOCUS, "half_width_m2_mean", 0.02
            ),
            at_most("the same, radial", OPEN_RADIAL, error_of_current, 0.01),
            at_least(
                "interval of m2 in closed loop, radial", CLOSED_RADIAL, "half_width_m2_mean", 0.02
            ),
        ),
        "Largest errors in nine draws of ten against half-widths of 99 %, of different parameters",
        "parameters",
    ),
    Item(
        "Equations 4.16, 4.17",
        "v_r/u shows all parameters of the lumped model, by the back-EMF",
        Verdict.READING,
        (residual_noise("focus"), residual_noise("radial")),
        "With c/m in equation 4.17 read as b/m",
        "bode",
    ),
    Item(
        "Section 4.3.1",
        "v_r/u is flat with one peak, near 30 Hz in focus and 50 Hz radially",
        Verdict.READING,
        (
            near("where v_r/u is smallest, focus [Hz]", OPEN_FOCUS, dip, 30.0, 0.1),
            near("where v_r/u is smallest, radial [Hz]", OPEN_RADIAL, dip, 50.0, 0.1),
        ),
        "The peak is a dip: at the resonance the back-EMF is largest. For CD1",
        "bode",
    ),
    Item(
        "Sections 4.3.1, 4.6.1",
        "The first resonance lies near 30 Hz in focus and 50 Hz radially",
        Verdict.REPRODUCED,
        (
            near("median, focus [Hz]", DRIVES, "first_resonance_focus_hz", 30.0, 0.1),
            near("median, radial [Hz]", DRIVES, "first_resonance_radial_hz", 50.0, 0.1),
        ),
        shown="bode",
    ),
    Item(
        "Section 4.3.1",
        "The parasitic resonance does not show in v_r/u",
        Verdict.REPRODUCED,
        (*shown_in_current("focus"), *shown_in_current("radial")),
        shown="derived",
    ),
    Item(
        "Section 4.3.1",
        "The parasitic resonance lies near 500 Hz in focus",
        Verdict.REPRODUCED,
        (near("median of the pole [Hz]", DRIVES, "parasitic_pole_focus_hz", 500.0, 0.05),),
        shown="bode",
    ),
    Item(
        "Section 4.3.1",
        "The parasitic resonance lies near 800 Hz radially",
        Verdict.REFUTED,
        (
            at_least(
                "lowest pole of twelve [Hz]",
                DRIVES,
                resonance_range("radial", "parasitic pole", "min"),
                840.0,
                800.0,
            ),
        ),
        "Tables A.1 and A.2 give 856 to 976 Hz",
        "bode",
    ),
    Item(
        "Equation 4.18",
        "The lumped damper is b1 + b2",
        Verdict.REFUTED,
        (
            at_most(
                "b of the lumped fit over b1 + b2, less 1, focus", OPEN_FOCUS, "bias_b", -0.05, 0.0
            ),
            at_most("the same, radial", OPEN_RADIAL, "bias_b", -0.05, 0.0),
        ),
        "At low frequency the arm moves by k2 / (k1 + k2) of the lens, and b1 counts by the square "
        "of that",
        "parameters",
    ),
    Item(
        "Equation 4.18",
        "The lumped spring is that of k1 and k2 in series",
        Verdict.READING,
        (
            Number(
                "k of the lumped fit over it, less 1, focus", OPEN_FOCUS, "bias_k", -0.01, 0.01, 0.0
            ),
            Number("the same, radial", OPEN_RADIAL, "bias_k", -0.01, 0.01, 0.0),
        ),
        "The equation is printed upside down",
        "parameters",
    ),
    Item(
        "Equations 4.19 to 4.23",
        "R, b, k and Bl follow from the four coefficients of v_r/u",
        Verdict.REPRODUCED,
        (
            at_most("largest distance from the direct fit, focus", OPEN_FOCUS, by_equations, 1e-4),
            at_most(
                "largest distance from the direct fit, radial", OPEN_RADIAL, by_equations, 1e-4
            ),
        ),
        shown="parameters",
    ),
    Item(
        "Equations 4.24, 4.25, figure 4.3",
        "A sine added in closed loop tells how masses, springs and dampers are distributed",
        Verdict.REPRODUCED,
        (
            at_least(
                "share of draws and six parameters within their intervals, focus",
                CLOSED_FOCUS,
                "covered",
                0.95,
            ),
            at_most(
                "largest relative error of the fitted response, mean of draws, focus",
                CLOSED_FOCUS,
                "error_fitted_mean",
                0.1,
            ),
            at_least("share within their intervals, radial", CLOSED_RADIAL, "covered", 0.95),
            at_most("largest relative error, radial", CLOSED_RADIAL, "error_fitted_mean", 0.1),
        ),
        "For CD1. Of b2 it tells only that it is small",
        "parameters",
    ),
    Item(
        "Section 4.4",
        "A wobble at crossover lets the gain control remove differences of the gain",
        Verdict.REPRODUCED,
        (
            at_least(
                "spread of the loops' gains before, focus [dB]",
                GAIN_CONTROL_FOCUS,
                "spread_before",
                3.0,
            ),
            at_most(
                "after, nine draws of ten [dB]", GAIN_CONTROL_FOCUS, "spread_ordinary_high", 1.0
            ),
            at_most("takes, nine of ten [s]", GAIN_CONTROL_FOCUS, "time_ordinary_high", 0.5),
            at_least("before, radial [dB]", GAIN_CONTROL_RADIAL, "spread_before", 2.0),
            at_most("after, radial [dB]", GAIN_CONTROL_RADIAL, "spread_ordinary_high", 0.75),
            at_least(
                "spread of the crossover after over that before, radial",
                GAIN_CONTROL_RADIAL,
                quotient("crossover_spread_ordinary_mean", "crossover_spread_before"),
                0.5,
            ),
            at_least(
                "share of starts that lose a scratched disc, focus",
                GAIN_CONTROL_FOCUS,
                "lost_scratch",
                0.1,
            ),
        ),
        "At the wobble's frequency, on a disc of any deviation that the Red Book allows. Radially "
        "the crossover still spreads, because a parasitic resonance lies there; a scratch in every "
        "turn spoils it",
        "spread",
    ),
    Item(
        "Section 4.4.1",
        "In practice Foucault's curve comes near the astigmatic one",
        Verdict.READING,
        (
            at_most(
                "K_optFn, middle of Table A.3, over Foucault's gain by diffraction",
                "cd/focus-error",
                "table_A_3_over_gain_Foucault",
                1.0,
            ),
            at_least(
                "over that of the astigmatic method with extremes about 12 um apart",
                "cd/focus-error",
                "table_A_3_over_gain_astigmatic",
                1.0,
            ),
        ),
        "Read as: the measured gain lies between those of the two methods",
        "figure-2-8",
    ),
    Item(
        "Section 4.4.1",
        "A ramp through the s-curve, whose extremes are 12 um apart, gives the focus gain",
        Verdict.REPRODUCED,
        (
            at_most(
                "relative error, nine draws of ten",
                "cd/focus/optical-gain",
                "error_K_optn_high",
                0.06,
            ),
        ),
        shown="s-curve",
    ),
    Item(
        "Section 4.4.2",
        "Tracks that pass sideways, 1.6 um apart, give the radial gain",
        Verdict.REPRODUCED,
        (
            at_most(
                "relative error, nine draws of ten",
                "cd/radial/optical-gain",
                "error_K_optn_high",
                0.03,
            ),
        ),
    ),
    Item(
        "Section 4.4.2",
        "Tracks that pass sideways give a sine, whose zeros are on a track and between two",
        Verdict.REPRODUCED,
        (
            at_least(
                "correlation of the error by twin spots with a sine, least of 45 layers",
                "cd/radial-error",
                "likeness_to_a_sine_twin_spot",
                0.999,
            ),
        ),
        "By diffraction: of the layer's orders across the tracks only the first enter the lens",
        "radial-errors",
    ),
)

"""Chapter 4: what the experiments on the drives gave (sections 4.6.1 to 4.6.3)."""

from __future__ import annotations

from workbench import Run

from ..arm_readings import ARMS_FOCUS, ARMS_RADIAL, two_or_three_of_random_arms
from ..items import Item, Number, Verdict, at_least, at_most, near
from ..readings import both
from .chapter_4 import CLOSED_RADIAL, OPEN_FOCUS, OPEN_RADIAL
from .drive_readings import DRIVES, derived, off_by, ringing_left

GAIN_FOCUS, GAIN_RADIAL = "cd/focus/optical-gain", "cd/radial/optical-gain"
IDENTIFIED, WORST = "cd/{}/identified", "worst_response"
LEAST_P = 1e-3
"""p-value below which an assumption is rejected."""


def median_width(run: Run) -> float:
    """Median over the frequencies of the 99 % region's radius over the response."""
    return float((run.data["radius"] / abs(run.data["response"])).median())


def largest_frequency(axis: str) -> Number:
    """Frequency at which the nominal drive's response is largest: the oval of figure 4.8."""

    def frequency(run: Run) -> float:
        size = abs(run.data["nominal"].sel(axis=axis))
        return float(size["frequency"][int(size.values.argmax())])

    printed = {"focus": 30.0, "radial": 50.0}[axis]
    return near(f"where the response is largest, {axis} [Hz]", DRIVES, frequency, printed, 0.1)


ITEMS = (
    Item(
        "Section 4.6.1",
        "After ten periods the transients have died out",
        Verdict.REFUTED,
        (
            ringing_left("focus", 50.0),
            ringing_left("radial", 100.0),
        ),
        "At the end of the sweep a seventh and a quarter of the ringing are left. A fit of the "
        "decay takes it out",
    ),
    Item(
        "Section 4.6.1",
        "Real and imaginary part are equally noisy and independent",
        Verdict.READING,
        (
            at_least("p-value of a circle, focus", OPEN_FOCUS, "circular_p_low", LEAST_P),
            at_least("p-value of independence, focus", OPEN_FOCUS, "independent_p_low", LEAST_P),
            at_least("p-value of a circle, radial", OPEN_RADIAL, "circular_p_low", LEAST_P),
            at_least("p-value of independence, radial", OPEN_RADIAL, "independent_p_low", LEAST_P),
        ),
        "Once the transient is taken out of the periods",
    ),
    Item(
        "Figure 4.4",
        "The Bode plot of CD1 in focus has a narrow 99 % interval",
        Verdict.REPRODUCED,
        (at_most("median half-width over the response", OPEN_FOCUS, median_width, 0.01),),
        shown="bode",
    ),
    Item(
        "Sections 4.6.1, 4.6.2",
        "All twelve drives are identified in both axes, 24 plots",
        Verdict.REPRODUCED,
        (
            *both(at_most, "largest relative error of a response", IDENTIFIED, WORST, 0.08),
            *both(at_most, "chi-square per degree of freedom", IDENTIFIED, "chi_square", 1.5),
        ),
        "In the laboratory, from one draw of both experiments on each drive. The mass is told with "
        "an error of 2 %, which scales the response",
        "nyquist",
    ),
    Item(
        "Section 4.6.1",
        "The series resistor shifts the resonances by -1 Hz in focus and -2 Hz radially",
        Verdict.REFUTED,
        (
            Number(
                "largest shift, focus [Hz]", DRIVES, off_by("focus", "shift by r"), -0.1, 0.1, -1.0
            ),
            Number(
                "largest shift, radial [Hz]",
                DRIVES,
                off_by("radial", "shift by r"),
                -0.1,
                0.1,
                -2.0,
            ),
        ),
        "It changes the damping, hardly the frequency",
        "derived",
    ),
    Item(
        "Section 4.6.1",
        "A low Bl shows as a lower resonance frequency",
        Verdict.REFUTED,
        (
            at_least(
                "shift of the peak by a Bl a tenth smaller, least, focus [Hz]",
                DRIVES,
                derived("focus", "shift by Bl", "min"),
                0.0,
            ),
            at_least("the same, radial [Hz]", DRIVES, derived("radial", "shift by Bl", "min"), 0.0),
        ),
        "A lower Bl damps less, which raises the peak by less than a hundredth of a hertz",
        "derived",
    ),
    Item(
        "Section 4.6.1",
        "Estimated and measured R differ by less than 2 % in all 24 cases",
        Verdict.REPRODUCED,
        (
            at_most("largest difference, focus", DRIVES, off_by("focus", "R off"), 0.02, 0.02),
            at_most("largest difference, radial", DRIVES, off_by("radial", "R off"), 0.02, 0.02),
        ),
        shown="derived",
    ),
    Item(
        "Section 4.6.1",
        "At 99 % the parameters are known to 1 %, b to 5 %",
        Verdict.READING,
        tuple(
            at_most(
                f"error of {name} at the told mass, {axis}",
                run,
                f"error_{name}_told_mass_high",
                accuracy,
                accuracy,
            )
            for axis, run in (("focus", OPEN_FOCUS), ("radial", OPEN_RADIAL))
            for name, accuracy in (("R", 0.01), ("Bl", 0.01), ("k", 0.01), ("b", 0.05))
        ),
        "True of what the current tells: R, Bl^2/m, k/m, b/m. With a mass known to 2 % the "
        "half-widths of Bl, k and b are 2.6 to 5.2 %",
        "parameters",
    ),
    Item(
        "Section 4.6.1",
        "Bl of the radial coils is below the data sheet's minimum",
        Verdict.NOT_COMPUTABLE,
        found="The data sheet's values are not printed",
    ),
    Item(
        "Section 4.6.2, figure 4.5",
        "Estimated and fitted response of CD1 agree radially",
        Verdict.REPRODUCED,
        (
            at_most(
                "largest relative error of the fitted response",
                CLOSED_RADIAL,
                "error_fitted_mean",
                0.1,
            ),
        ),
        shown="figure-4-5",
    ),
    Item(
        "Section 4.6.2, figure 4.5",
        "CD12 shows two parasitic resonances; four unlike arms make a model of order 10",
        Verdict.READING,
        (
            near("resonances that two unlike halves show", ARMS_FOCUS, "shown_halves", 2.0, 0.0),
            near("order of their model", ARMS_FOCUS, "order_halves", 6.0, 0.0),
            near("resonances that four unlike arms show", ARMS_FOCUS, "shown_four", 2.0, 0.0),
            near("order of the model of four", ARMS_FOCUS, "order_four", 10.0, 0.0),
            at_least(
                "share of random arms, links off by 40 %, that show two, focus",
                ARMS_FOCUS,
                "random_2_shown_40_percent",
                0.3,
            ),
            at_most("that show four", ARMS_FOCUS, "random_4_shown_40_percent", 0.05),
            at_least(
                "share that show two or three, radial",
                ARMS_RADIAL,
                two_or_three_of_random_arms,
                0.5,
            ),
        ),
        "How unlike the arms are is assumed, as the tables hold one resonance: halves 20 %, four "
        "arms 30 and 20 % off. Arms that differ by 10 % show one only",
        "figure-4-5",
    ),
    Item(
        "Section 4.6.2",
        "A model of too low an order makes the intervals hard to give",
        Verdict.REPRODUCED,
        (
            at_least(
                "share of draws that reject order 4, halves", ARMS_FOCUS, "rejected_halves_4", 0.95
            ),
            at_most(
                "share of its intervals of m2 that hold", ARMS_FOCUS, "covered_m2_halves_4", 0.5
            ),
            at_least("the same with order 6", ARMS_FOCUS, "covered_m2_halves_6", 0.95),
            at_least("share that reject order 4, four arms", ARMS_FOCUS, "rejected_four_4", 0.95),
            at_most("share of intervals of m2 that hold", ARMS_FOCUS, "covered_m2_four_4", 0.5),
            at_least("with order 10", ARMS_FOCUS, "covered_m2_four_10", 0.9),
            at_most(
                "intervals of m2, order 4, halves, radial", ARMS_RADIAL, "covered_m2_halves_4", 0.5
            ),
            at_least("with order 6, radial", ARMS_RADIAL, "covered_m2_halves_6", 0.95),
            at_most(
                "share of draws that reject order 6, four arms", ARMS_FOCUS, "rejected_four_6", 0.05
            ),
        ),
        "For CD12. Two resonances show, so order 6 is enough for four arms but for b2",
        "fits",
    ),
    Item(
        "Section 4.6.3, figure 4.6",
        "A focus error changes the radial sum, which peaks away from the focus",
        Verdict.OPEN,
        found="A cross-coupling. Needs both axes and their diodes in one laboratory",
    ),
    Item(
        "Section 4.6.3",
        "The focus gain spreads by more than 50 % over the drives, normalised by less than 20 %",
        Verdict.REPRODUCED,
        (
            at_least("spread of K_optF", GAIN_FOCUS, "spread_K_opt_mean", 0.5, 0.5),
            at_most("spread of K_optFn", GAIN_FOCUS, "spread_K_optn_mean", 0.2, 0.2),
        ),
    ),
    Item(
        "Section 4.6.3",
        "The radial gain spreads by nearly 30 % over the drives, normalised by around 10 %",
        Verdict.REPRODUCED,
        (
            near("spread of K_optR", GAIN_RADIAL, "spread_K_opt_mean", 0.3, 0.1),
            near("spread of K_optRn", GAIN_RADIAL, "spread_K_optn_mean", 0.1, 0.15),
        ),
    ),
    Item(
        "Figure 4.8",
        "The large ovals of the Nyquist plots are the resonances at 30 and 50 Hz",
        Verdict.REPRODUCED,
        (largest_frequency("focus"), largest_frequency("radial")),
        "Of the tables' parameters, not of identified ones",
        "nyquist",
    ),
)

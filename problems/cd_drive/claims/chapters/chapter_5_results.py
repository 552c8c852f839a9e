"""Chapter 5: uncertainty models of the twelve drives (sections 5.5 and 5.6)."""

from __future__ import annotations

import numpy as np

from workbench import Run

from ..items import Item, Number, Verdict, at_least, at_most
from ..readings import (
    DRIVES,
    PARAMETRIC,
    both,
    combinations,
    convention,
    cover_size,
    half_range,
    masses_apart,
    nominals_off,
    quotient,
    reduced_tolerance,
    tolerances_off,
    total_gain,
)

COMPARISON = "cd/{}/uncertainty-comparison"
FOLLOWING = ("R", "Bl", "k2", "b1", "m2")
"""Rows of Table 5.2 that follow in both axes from Tables A.1 to A.3, but for their rounding."""


def middle_radius(run: Run) -> float:
    """Radius of the 99 % region of a measured response over the response, median."""
    return float((run.data["radius"] / abs(run.data["response"])).median())


ITEMS = (
    Item(
        "Section 5.5",
        "The drives differ by more than the confidence regions of their measured responses",
        Verdict.READING,
        (
            at_most("region over response, open loop", "cd/focus/open-loop", middle_radius, 0.01),
            at_least("in closed loop", "cd/focus/closed-loop", middle_radius, 0.1),
            at_least(
                "radius of the drives' circles, median, relative",
                COMPARISON.format("focus"),
                cover_size("radius", np.median),
                0.1,
            ),
        ),
        "In open loop. In closed loop a region of the laboratory is about as wide as the drives "
        "differ",
    ),
    Item(
        "Figures 5.10, 5.11, section 5.6",
        "The three nominal models can hardly be told apart",
        Verdict.READING,
        (
            *both(
                at_most,
                "largest difference away from resonances [dB]",
                "cd/{}/nominal",
                "difference_db",
                2.0,
            ),
            *both(
                at_most,
                "in them [dB]",
                "cd/{}/nominal",
                "difference_at_resonances_db",
                4.0,
            ),
        ),
        "On a plot over all frequencies. Near the resonances they differ",
        "bode",
    ),
    Item(
        "Table 5.2",
        "Nominal values and tolerances are midrange and half-range over the drives",
        Verdict.READING,
        (
            at_most("nominals, most, focus", DRIVES, nominals_off("focus", FOLLOWING), 0.025),
            at_most("nominals, most, radial", DRIVES, nominals_off("radial", FOLLOWING), 0.025),
            at_most("tolerances, most, focus", DRIVES, tolerances_off("focus", FOLLOWING), 0.01),
            at_most("tolerances, most, radial", DRIVES, tolerances_off("radial", FOLLOWING), 0.01),
        ),
        "R, Bl, k2, b1 and m2, but for rounded Tables A.1 and A.2. So do k1 and m1 of focus",
        "table-5-2",
    ),
    Item(
        "Table 5.2",
        "b2 is 0.38e-3 and 0.64e-3 N s/m",
        Verdict.READING,
        (convention("focus", 0.38e-3), convention("radial", 0.64e-3)),
        "b2 is 5 % of b by convention. Table A.1 cuts b2 of CD4 to one digit, hence another "
        "midrange",
        "table-5-2",
    ),
    Item(
        "Table 5.2",
        "The gain in all is 76000 and 300000 units/V",
        Verdict.REFUTED,
        (total_gain("focus", 70e3, 76e3), total_gain("radial", 250e3, 300e3)),
        "It does not follow from Table A.3: the power driver's gain of equation 3.11 is missing in "
        "3.18, and one factor cannot mend both",
        "table-5-2",
    ),
    Item(
        "Table 5.2",
        "The gain in all has tolerances of 7.9 % and 20 %",
        Verdict.REFUTED,
        (
            at_least("of K_optn, focus", DRIVES, half_range("focus", "K_optn"), 0.12, 0.079),
            at_most("radial", DRIVES, half_range("radial", "K_optn"), 0.15, 0.2),
        ),
        "Neither is that of the optical gains of Table A.3",
        "table-5-2",
    ),
    Item(
        "Table 5.2",
        "k1 of the radial loop has a tolerance of 5.8 %",
        Verdict.REFUTED,
        (at_least("half-range", DRIVES, half_range("radial", "k1"), 0.08, 0.058),),
        "CD9's 51.8 N/m has two digits exchanged: with 58.1 the entry follows",
        "table-5-2",
    ),
    Item(
        "Table 5.2",
        "m1 of the radial loop has a tolerance of 0.05 %",
        Verdict.REFUTED,
        (at_least("half-range", DRIVES, half_range("radial", "m1"), 0.004, 0.0005),),
        "A zero too many: 0.5 % would follow",
        "table-5-2",
    ),
    Item(
        "Section 5.5",
        "The masses of focus and radial loop, which are one, differ by 1e-6 kg",
        Verdict.READING,
        (Number("m1 of focus less that of radial [kg]", DRIVES, masses_apart, 0.0, 1.5e-6, 1e-6),),
        "From masses that are printed to 1e-6 kg. The sums m1 + m2 of Table 5.2 are equal",
    ),
    Item(
        "Figure 5.12",
        "Weights of fourth order describe the circles",
        Verdict.READING,
        both(
            at_most,
            "largest weight over the radius",
            COMPARISON,
            cover_size("W_c circle", max, "radius"),
            2.5,
        ),
        "Ours must cover: they are at most about twice the radius, a tenth above it in the median "
        "of focus",
        "sizes",
    ),
    Item(
        "Figure 5.13",
        "Weights are fitted to the widths of the stadiums",
        Verdict.READING,
        both(
            at_least,
            "weight over the width, median",
            COMPARISON,
            cover_size("W_c stadium", np.median, "width about"),
            5.0,
        ),
        "They cover, yet at fourth order they are tens of times too wide, since W_r misses the "
        "direction: most of what stadiums gain is lost",
        "sizes",
    ),
    Item(
        "Figures 5.14, 5.15",
        "A low order hardly fits the lengths in magnitude and phase",
        Verdict.REPRODUCED,
        both(
            at_most,
            "largest weight over the largest length",
            "cd/{}/stadium-cover",
            quotient("length_peak_fitted", "length_peak"),
            0.9,
        ),
        "Fourth order. What W_r misses the complex weight takes over",
    ),
    Item(
        "Section 5.5",
        "Three levels of nine parameters make 19683 plants, five nearly 2 million",
        Verdict.REPRODUCED,
        (combinations(3, 19683.0, 0.0), combinations(5, 2e6, 0.05)),
    ),
    Item(
        "Section 5.5",
        "Minimum, nominal and maximum of each parameter give about the worst case",
        Verdict.REFUTED,
        both(
            at_least,
            "largest excess of a plant inside",
            PARAMETRIC,
            "interior_excess",
            0.1,
        ),
        "True of the peak at the first resonance. At the parasitic one plants inside deviate more",
        "deviation",
    ),
    Item(
        "Table 5.3",
        "R stands for five others, with 2 and 2.5 times its tolerance: 13.8 % and 6.8 %",
        Verdict.REPRODUCED,
        (reduced_tolerance("focus", 2.0, 0.138), reduced_tolerance("radial", 2.5, 0.068)),
        "tables-5-2-5-3",
    ),
    Item(
        "Table 5.3, section 5.5",
        "Three parameters keep a similar worst case",
        Verdict.READING,
        (
            *both(
                at_least,
                "peak over that of all but the gain",
                PARAMETRIC,
                quotient("deviation_peak_reduced", "deviation_peak_no_gain"),
                0.8,
            ),
        ),
        "Beside the eight without the gain, and to a fifth",
        "deviation",
    ),
    Item(
        "Section 5.5",
        "Without the gain's spread the uncertainty is smaller",
        Verdict.REPRODUCED,
        both(
            at_most,
            "peak without over with it",
            PARAMETRIC,
            quotient("deviation_peak_no_gain", "deviation_peak"),
            0.95,
        ),
    ),
    Item(
        "Section 5.5",
        "The gain's spread can be left out, since the automatic gain control evens it out",
        Verdict.READING,
        (
            *both(
                at_most,
                "share of drives and frequencies outside the three's",
                PARAMETRIC,
                "drives_agc_beyond_reduced",
                0.05,
            ),
            *both(
                at_least,
                "the same without gain control",
                PARAMETRIC,
                "drives_own_beyond_reduced",
                0.1,
            ),
        ),
        "With gains that are equal at crossover",
    ),
    Item(
        "Figure 5.16",
        "Parametric and complex uncertainty are of comparable size",
        Verdict.REFUTED,
        (
            at_most(
                "least parametric over complex, focus",
                COMPARISON.format("focus"),
                cover_size("parametric", min, "W_c circle"),
                0.5,
            ),
            at_least(
                "largest, focus",
                COMPARISON.format("focus"),
                cover_size("parametric", max, "W_c circle"),
                2.0,
            ),
            at_most(
                "least, radial",
                COMPARISON.format("radial"),
                cover_size("parametric", min, "W_c circle"),
                0.5,
            ),
        ),
        "Comparable at the resonance and in order of magnitude, but by frequency they differ more "
        "than twofold both ways",
        "sizes",
    ),
    Item(
        "Figure 5.16",
        "Mixed uncertainty, by its width, is the least",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "largest width over largest radius",
                COMPARISON,
                quotient("width_peak_own", "radius_peak_own"),
                0.5,
            ),
            *both(
                at_most,
                "median width over median radius above 100 Hz",
                COMPARISON,
                quotient("median_width_own", "median_radius_own"),
                0.1,
            ),
        ),
        "Of the sets. The length is not in that comparison",
        "sizes",
    ),
    Item(
        "Section 5.6",
        "Mixed uncertainty never exceeds complex uncertainty",
        Verdict.READING,
        (
            *both(
                at_most,
                "largest width over radius",
                COMPARISON,
                cover_size("width about", max, "radius about"),
                1.0,
            ),
            *both(
                at_least,
                "of the fitted weights",
                COMPARISON,
                cover_size("W_c stadium", max, "W_c circle"),
                1.0,
            ),
        ),
        "True of the sets about one nominal. The fitted weight of stadiums exceeds that of circles "
        "at some frequencies",
        "sizes",
    ),
    Item(
        "Section 5.6",
        "The parametric set is conservative, since the drives do not have every combination",
        Verdict.READING,
        (
            at_most(
                "peak of drives over that of eight parameters, focus",
                PARAMETRIC.format("focus"),
                quotient("drives_peak_agc", "deviation_peak_no_gain"),
                0.8,
            ),
            at_least(
                "the same, radial",
                PARAMETRIC.format("radial"),
                quotient("drives_peak_agc", "deviation_peak_no_gain"),
                1.0,
            ),
        ),
        "In focus, with gain control. Radially CD9's k1 and m1's tolerance leave it",
    ),
)

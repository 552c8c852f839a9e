"""Sections 7.1.3 to 7.1.5: residuals, their disturbances, and how faults are detected."""

from __future__ import annotations

from ...defect_readings import (
    FILTER,
    PLANE,
    RAISED,
    RESIDUALS,
    alarms_of_error,
    alarms_of_sum,
    largest_coupling,
    largest_other_sum,
    told_rightly,
)
from ...items import Item, Number, Verdict, at_least, at_most
from ...readings import both

AGEING = "cd/{}/ageing"
LEAST_GAIN = 0.05
"""Share of a peak of mu from which on it counts as a gain."""

FOCUS = PLANE.format("focus")
AFTER_DEFECTS, INTEGRATED = "cd/{}/after-defects", "cd/{}/integrated-design"
EXACT, INDEX = "cd/{}/exact-residuals", "cd/{}/residual-index"
LEAK_PLUS, LEAK_MINUS = "leak_plus_equation_7_6", "least_leak_minus_equation_7_6"

ITEMS = (
    Item(
        "Equations 7.15 to 7.20",
        "A set of residuals, each blind to some faults, isolates them",
        Verdict.REPRODUCED,
        both(
            at_least,
            "share of black dots, scratches and shocks told rightly",
            RESIDUALS,
            told_rightly("fault", "isolated_as"),
            0.6,
        ),
        "By sum, fast and slow error. Black dots are taken for scratches at times, and the other "
        "way",
        "isolation",
    ),
    Item(
        "Section 7.1.3",
        "Finger prints, scratches and black dots can be told apart by where the diodes go",
        Verdict.REPRODUCED,
        both(
            at_least,
            "share of defects of new drives told rightly",
            PLANE,
            told_rightly("kind", "found"),
            0.9,
        ),
        "By clusters of four features, with dropouts as the fourth kind",
        "confusion",
    ),
    Item(
        "Section 7.1.3",
        "White dots, and tracks that are jumped, raise the sum",
        Verdict.READING,
        (
            at_least(
                "sum in a white dot over the clean one, least of 90 %",
                RAISED,
                "sum_white_dot_low",
                1.2,
            ),
            at_most("in the defects of other kinds, largest mean", RAISED, largest_other_sum, 0.9),
            at_least(
                "largest focus sum while tracks are jumped, over that on the track, least of 90 %",
                RAISED,
                "sum_most_jumping_low",
                1.3,
            ),
            at_least("mean, least of 90 %", RAISED, "sum_mean_jumping_low", 1.1),
            at_most(
                "largest under a shock without a jump, most of 90 %",
                RAISED,
                "sum_most_stood_high",
                1.2,
            ),
        ),
        "White dots are read as areas with few pits or none. Their light, and the sum between "
        "tracks, are by diffraction. The binary detector sees none of them, the quality signal all",
        "sums, jump",
    ),
    Item(
        "Section 7.1.4, equation 7.22",
        "The sum is decoupled from the disturbances, shocks among them",
        Verdict.REPRODUCED,
        (
            *both(
                at_most, "largest squared correlation with the error", PLANE, largest_coupling, 0.02
            ),
            *both(at_least, "false alarms by the error under shocks", PLANE, alarms_of_error, 10.0),
            *both(at_most, "by the sum at any time, over that", PLANE, alarms_of_sum, 0.01),
        ),
        "While the loop holds. Under shocks, on every drive",
        "false-alarms",
    ),
    Item(
        "Section 7.1.4",
        "Defects cannot be decoupled wholly from disturbances in the error: their spectra overlap",
        Verdict.REPRODUCED,
        (
            at_least(
                "leakage [m] that no filter gets below at a relative error of 0.3",
                FILTER,
                lambda run: float(run.data["least_total"].sel(point=0.3, method="nearest")),
                1e-7,
            ),
        ),
        "Disc and noise together, on the nominal drive",
        "front",
    ),
    Item(
        "Equation 7.23",
        "A filter can be chosen by the ratio of disturbances to faults in the residual",
        Verdict.READING,
        (
            *both(
                at_most,
                "ratio of norms of a narrow band-pass over the bound of every filter",
                INDEX,
                "narrowest_over_bound",
                1.05,
            ),
            *both(
                at_least,
                "of no filter at all over that bound",
                INDEX,
                "all_frequencies_over_bound_H2",
                10.0,
            ),
            *both(
                at_most, "spread of the largest ratio over filters", INDEX, "spread_of_index", 1e-6
            ),
        ),
        "Denominator H_photo K_optn W_sd, ratio of norms from 10 Hz to 10 kHz: it picks the top of "
        "the range. At one frequency it is the same for every filter, and chooses none",
        "indices",
    ),
    Item(
        "Equation 7.23",
        "Its denominator is H_act W_sd",
        Verdict.REFUTED,
        (
            at_least(
                "factor by which this over the gain from the fault varies, focus",
                INDEX.format("focus"),
                "printed_over_mended_varies",
                10.0,
            ),
            Number(
                "frequency at which the printed ratio is least [Hz], focus",
                INDEX.format("focus"),
                "printed_least_hz",
                1000.0,
                9000.0,
            ),
        ),
        "A fault enters by H_photo K_optn (7.10). The printed ratio is no number, and would pick "
        "another frequency than the top of the range",
        "index",
    ),
    Item(
        "Equations 7.24 to 7.29",
        "Robust estimation bounds what disturbances and what faults leave in the estimate",
        Verdict.READING,
        (
            at_most("relative error of the estimate", FILTER, "fault_error", 0.3),
            at_most("leakage of the disc [m]", FILTER, "leakage", 0.5e-6),
        ),
        "In physical units: error above 1.5 kHz, leakage of the Red Book's disc below 200 Hz, over "
        "every plant of the stadiums",
        "filters",
    ),
    Item(
        "Section 7.1.5",
        "Designing controller and filter in one improves neither over one after the other",
        Verdict.READING,
        (
            *both(
                at_most,
                "spread of the estimate's least level over four controllers",
                INTEGRATED,
                "level_spread",
                1e-3,
            ),
            *both(
                at_most,
                "of a filter's certified norm, carried over to them",
                INTEGRATED,
                "carried_over_spread",
                0.01,
            ),
            *both(
                at_least,
                "control's norm in one synthesis over that alone",
                INTEGRATED,
                "joint_over_separate_control",
                1.0,
            ),
            *both(
                at_least,
                "the estimate's",
                INTEGRATED,
                "joint_over_separate_estimate",
                0.999,
            ),
        ),
        "Nominal class: a filter beside one controller is F (1 + L') / (1 + L) beside another, "
        "with the same error, so that the two separate exactly",
        "designs",
    ),
    Item(
        "Section 7.1.5",
        "With robust performance of both the designs are coupled",
        Verdict.REPRODUCED,
        both(
            at_least,
            "least robust error beside the mu-PID over that beside a third of it, at one frequency",
            INTEGRATED,
            "pid_over_third",
            1.1,
        ),
        "Complex uncertainty as large as the spread of twelve drives' gains, by bounds on all "
        "filters. A controller chosen for the estimate's sake would help it, at a cost to control",
        "designs",
    ),
    Item(
        "Figures 7.6, 7.8",
        "The filter is a problem of mu with stadiums, with the controller in the loop",
        Verdict.READING,
        (at_most("peak of mu, full order", FILTER, "peak_full", 1.0),),
        "The loop turns a defect into S times it, so that the filter has to undo S",
        "figure-7-12",
    ),
)

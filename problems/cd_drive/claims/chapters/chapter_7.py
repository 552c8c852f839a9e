"""Chapter 7: faults of a drive, and how they are detected, isolated and estimated (section 7.1)."""

from __future__ import annotations

from ..defect_readings import (
    FILTER,
    PLANE,
    RAISED,
    RESIDUALS,
    STRATEGIES,
    alarms_of_error,
    alarms_of_sum,
    largest_coupling,
    largest_other_sum,
    least_diode,
    lost_light,
    lowest_sum,
    missed_by,
    missed_deep,
    scratch_error,
    swing,
    told_rightly,
)
from ..items import Item, Number, Verdict, at_least, at_most
from ..readings import both

AGEING = "cd/{}/ageing"
LEAST_GAIN = 0.05
"""Share of a peak of mu from which on it counts as a gain."""

FOCUS = PLANE.format("focus")
AFTER_DEFECTS, INTEGRATED = "cd/{}/after-defects", "cd/{}/integrated-design"
EXACT, INDEX = "cd/{}/exact-residuals", "cd/{}/residual-index"
LEAK_PLUS, LEAK_MINUS = "leak_plus_equation_7_6", "least_leak_minus_equation_7_6"

ITEMS = (
    Item(
        "Equations 7.1 to 7.5",
        "Faults of actuators are inputs or changes of parameters, those of sensors displacements",
        Verdict.NOT_COMPUTABLE,
        found="Definitions, with nothing to judge. The library has all three",
    ),
    Item(
        "Section 7.1.1",
        "An ageing suspension, estimated at each start, lets the controller be less robust",
        Verdict.REFUTED,
        (
            at_most(
                "what a start gains of the peak of mu, suspension softened to 75 %, focus",
                AGEING.format("focus"),
                "gain_75_percent",
                LEAST_GAIN,
            ),
            at_most(
                "softened to 50 %, focus", AGEING.format("focus"), "gain_50_percent", LEAST_GAIN
            ),
            at_most(
                "of the peak that is guaranteed, 50 %, focus",
                AGEING.format("focus"),
                "gain_of_guarantee_50_percent",
                LEAST_GAIN,
            ),
            *both(
                at_most,
                "gained where nothing is uncertain, 50 %",
                AGEING,
                "most_gain_50_percent",
                0.15,
            ),
            *both(
                at_most,
                "peak with one controller for a life down to 50 %",
                AGEING,
                "peak_life_on_life_50_percent",
                1.0,
            ),
            *both(at_least, "share of starts that hold k1", AGEING, "covered_k1", 0.9),
        ),
        "How far it softens is assumed, and that 5 % of the peak are a gain. Controllers of third "
        "order. Radially it is undecided: 6 % of the guaranteed peak are gained at 50 %, as much "
        "as the search for a controller misses",
        "peaks",
    ),
    Item(
        "Equations 7.6 to 7.8, figure 7.3",
        "A residual of u and f_en is zero without a fault",
        Verdict.READING,
        (
            *both(at_most, "gain from u to it over that of H_act alone", EXACT, LEAK_PLUS, 1e-9),
            *both(at_least, "the same with the printed sign, least", EXACT, LEAK_MINUS, 1.9),
        ),
        "With a plus in 7.8 and 7.20, as 7.6, 7.7 and 7.19 ask for. The printed minus fits 7.30, "
        "where the lens moves the error the other way. On the nominal drive, with no disturbance",
        "signs",
    ),
    Item(
        "Equation 7.8, section 7.1.4",
        "Modelling errors keep such a residual from being zero",
        Verdict.REPRODUCED,
        both(
            at_least,
            "gain at 100 Hz on some drive of twelve over that of H_act alone",
            EXACT,
            "drives_leak_at_100_hz",
            0.05,
        ),
        "With the residual of the nominal drive. At the resonances it is more than 1",
        "figure-7-3",
    ),
    Item(
        "Equation 7.9",
        "A residual beyond a threshold tells a fault",
        Verdict.REPRODUCED,
        both(
            at_most,
            "share missed by the sum, 40 % of the light, 1 mm",
            RESIDUALS,
            missed_deep("sum"),
            0.05,
        ),
        "At one false alarm a second, at three noises, on a disc that wobbles",
        "areas",
    ),
    Item(
        "Section 7.1.2",
        "A fading laser is an incipient fault, which a threshold finds late",
        Verdict.REPRODUCED,
        (
            at_least(
                "light lost when a level of the sum alarms",
                RESIDUALS.format("focus"),
                lost_light("level"),
                0.01,
            ),
            at_most(
                "light lost when a slow sum alarms, over that",
                RESIDUALS.format("focus"),
                lambda run: (
                    float(run.data["fade"].sel(way="slow sum").mean())
                    / float(run.data["fade"].sel(way="level").mean())
                ),
                0.8,
            ),
        ),
        "Means",
    ),
    Item(
        "Equations 7.10 to 7.12",
        "A defect is detectable in the error and strongly detectable in the sum",
        Verdict.REPRODUCED,
        (
            *both(at_least, "share missed by the error", PLANE, missed_by("error"), 0.3),
            *both(at_most, "by the sum", PLANE, missed_by("binary"), 0.02),
        ),
        shown="detection",
    ),
    Item(
        "Figure 7.4",
        "In a defect the error has spikes of both signs, and the sum drops",
        Verdict.REPRODUCED,
        (
            at_most("least error in a scratch", FOCUS, scratch_error("min"), -0.05),
            at_least("largest", FOCUS, scratch_error("max"), 0.05),
            at_most("least sum in a black dot", FOCUS, lowest_sum, 0.5),
        ),
        shown="figure-7-5-7-10",
    ),
    Item(
        "Section 7.1.2",
        "After a defect its effects remain in the error and not in the sum",
        Verdict.REPRODUCED,
        (
            *both(
                at_least,
                "time in which a scratch's effect on the error settles, least of 90 % [ms]",
                AFTER_DEFECTS,
                "error_settles_reference_strategy_low_ms",
                0.2,
            ),
            *both(
                at_most,
                "on the sum, most of 90 % [ms]",
                AFTER_DEFECTS,
                "sum_settles_reference_strategy_high_ms",
                0.1,
            ),
            at_least(
                "swing of the error in the 1.5 ms of full light after, over that before",
                STRATEGIES.format("focus"),
                swing("reference", "f_en", 0),
                2.0,
            ),
        ),
        "Reference strategy, to a twentieth of its size, without noise; the swing in one record",
        "durations",
    ),
    Item(
        "Section 7.1.2",
        "They are visible in the error",
        Verdict.READING,
        (
            *both(
                at_least,
                "time that a scratch is seen in the error after it, mean [ms]",
                AFTER_DEFECTS,
                "error_after_scratch_reference_strategy_mean_ms",
                0.03,
            ),
            *both(
                at_most,
                "with no detector, which opens no loop [ms]",
                AFTER_DEFECTS,
                "error_after_scratch_no_detector_mean_ms",
                0.1,
            ),
        ),
        "Beyond three standard deviations of its noise: for a few samples only, on discs of the "
        "Red Book's deviation in focus and of half of it radially",
        "durations",
    ),
    Item(
        "Figure 7.5",
        "All measurements of the diodes lie in a triangle",
        Verdict.REPRODUCED,
        both(at_least, "least normalised diode signal", PLANE, least_diode, -0.02),
        "But for noise across its long side",
        "figure-7-5-7-10",
    ),
    Item(
        "Equations 7.13, 7.14",
        "The quality falls from 1 to 0 with the distance from the line of clean measurements",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "least quality in a scratch",
                PLANE,
                lambda run: float(run.data["zoom_quality"].min()),
                0.2,
            ),
            *both(
                at_least,
                "samples of it between 0.01 and 0.99",
                PLANE,
                lambda run: float(
                    ((run.data["zoom_quality"] > 0.01) & (run.data["zoom_quality"] < 0.99)).sum()
                ),
                4.0,
            ),
        ),
        shown="figure-7-11",
    ),
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

"""Chapter 7: faults of a drive, and how they are detected, isolated and estimated (section 7.1)."""

from __future__ import annotations

from ..defect_readings import (
    FILTER,
    PLANE,
    RESIDUALS,
    STRATEGIES,
    alarms_of_error,
    alarms_of_sum,
    largest_coupling,
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
            *both(
                at_most,
                "what a start gains of the peak of mu, suspension softened to 75 %",
                AGEING,
                "gain_75_percent",
                LEAST_GAIN,
            ),
            *both(at_most, "softened to 50 %", AGEING, "gain_50_percent", LEAST_GAIN),
            at_most(
                "of the peak that is guaranteed, 50 %, focus",
                AGEING.format("focus"),
                "gain_of_guarantee_50_percent",
                LEAST_GAIN,
            ),
            Number(
                "of the peak that is guaranteed, 50 %, radial",
                AGEING.format("radial"),
                "gain_of_guarantee_50_percent",
                LEAST_GAIN,
                2 * LEAST_GAIN,
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
        "How far it softens is assumed, and that 5 % on the aged drive are a gain. Controllers of "
        "third order; radially at 50 % the gain is of the size of what their search misses",
        "peaks",
    ),
    Item(
        "Equations 7.6 to 7.8, figure 7.3",
        "A residual of u and f_en is zero without a fault",
        Verdict.OPEN,
        found="Needs H_act and H_photo of the drive. The library makes such residuals (textbook "
        "run). By 7.7 the sign of 7.8 and of 7.20 has to be plus",
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
            at_least(
                "swing of the error in the 1.5 ms of full light after, over that before",
                STRATEGIES.format("focus"),
                swing("reference", "f_en", 0),
                2.0,
            ),
        ),
        "Reference strategy, one record. The quality, which follows the sum, is 1 again by then",
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
        Verdict.OPEN,
        found="Needs a defect that reflects more in the laboratory, and the sum as a function of "
        "the place between tracks",
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
        Verdict.OPEN,
        found="The library has that index. Needs its least value over filters for the drive, with "
        "W_p and W_sd, over frequency",
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
        Verdict.OPEN,
        found="Needs the design classes of that paper: controller and filter in one synthesis, "
        "beside the filter made for a given controller, by both criteria",
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

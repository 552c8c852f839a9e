"""Sections 8.1 to 8.6: strategies against surface defects."""

from __future__ import annotations

from ...defect_readings import (
    EXCURSION,
    STRATEGIES,
    SWITCHING,
    crossovers,
    error_at_top,
    longest_at,
    ratio,
    share_below,
    swing,
)
from ...items import Item, Number, Verdict, at_least, at_most, near
from ...readings import both, quotient

FOCUS, EXCURSIONS = STRATEGIES.format("focus"), EXCURSION.format("focus")
SWITCHED, SLOWER = SWITCHING.format("focus"), "cd/focus/lower-bandwidth"
ROTATION = "cd/{}/wrong-rotation"
DESIGNED, FEEDBACK = "cd/{}/designed-filter", "cd/{}/state-feedback"

ITEMS = (
    Item(
        "Equation 8.1",
        "A lens that stops is up to 53.7 um off after a defect",
        Verdict.READING,
        (near("error [um]", EXCURSIONS, "thesis_um", 53.7, 0.005),),
        "500 um, 9 Hz, 1.9 ms, the defect symmetric about the crossing: 2 A sin(w dt / 2)",
        "equation-8-1",
    ),
    Item(
        "Section 8.2",
        "The longest defect that is repaired takes 1.9 ms at 1.4 m/s",
        Verdict.REFUTED,
        (
            at_most("at 1.4 m/s [ms]", EXCURSIONS, longest_at(1.4), 1.85, 1.9),
            near("at 1.3 m/s [ms]", EXCURSIONS, longest_at(1.3), 1.9, 0.02),
        ),
        "2.5 mm take 1.9 ms at 1.3 m/s",
    ),
    Item(
        "Section 8.2",
        "At the top of the deviation a defect does no harm",
        Verdict.REPRODUCED,
        (at_most("error of a lens that stops, over the largest", EXCURSIONS, error_at_top, 0.01),),
        "By equation 8.1, about a defect's middle",
        "equation-8-1",
    ),
    Item(
        "Section 8.2",
        "A lens that stopped would leave the linear range, but it keeps moving with the disc",
        Verdict.REPRODUCED,
        (
            at_least("lens that stops [um]", EXCURSIONS, "standing_um", 6.0),
            at_most("free lens over that", EXCURSIONS, quotient("free_um", "standing_um"), 0.1),
            at_most(
                "lens under the blind controller over that",
                EXCURSIONS,
                quotient("driven_um", "standing_um"),
                0.5,
            ),
        ),
        "A free lens follows best. The blind controller spoils a good part of it",
        "theory",
    ),
    Item(
        "Figures 8.2 to 8.5",
        "Four structures: the reference strategy, A, B and C",
        Verdict.REPRODUCED,
        tuple(
            at_most(f"draws in which focus is lost, {name}", FOCUS, f"draws_lost_{name}", 0.02)
            for name in ("reference", "A", "B", "C")
        ),
        "Once settled, on a disc of 500 um with scratches, on all drives",
        "errors",
    ),
    Item(
        "Section 8.3",
        "Repetitive control removes the periodic error, low-passed for robustness",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "periodic error with A over without",
                STRATEGIES,
                ratio("periodic", "A"),
                0.1,
            ),
            *both(
                at_most, "small gain of its loop, worst drive", STRATEGIES, "repetitive_level", 1.0
            ),
        ),
        shown="figure-8-7",
    ),
    Item(
        "Section 8.4",
        "State feedback instead of controller and switch would be more elegant in B",
        Verdict.READING,
        (
            at_least(
                "draws in which it errs less than B, focus",
                FEEDBACK.format("focus"),
                "below_B_1.2mm",
                0.95,
            ),
            Number("radial", FEEDBACK.format("radial"), "below_B_1.2mm", 0.05, 0.95),
            *both(
                at_most,
                "draws in which it loses the loop",
                FEEDBACK,
                "lost_state_feedback_1.2mm",
                0.02,
            ),
            *both(
                at_least,
                "its phase margin, least of the drives [deg]",
                FEEDBACK,
                "phase_margin_state_feedback_deg",
                30.0,
            ),
            *both(
                at_most,
                "its crossover over that of B",
                FEEDBACK,
                quotient("crossover_state_feedback_hz", "crossover_B_hz"),
                0.7,
            ),
        ),
        "Least squares, with the reference loop's crossover for known states. B's slow filter "
        "leaves it less bandwidth. In focus it errs half as much after a scratch, radially neither "
        "is better",
        "experiments, loops",
    ),
    Item(
        "Section 8.5, figure 8.6",
        "The fault filter makes of K a controller of lower bandwidth",
        Verdict.REPRODUCED,
        (at_most("crossover over that with K", SWITCHED, crossovers, 0.9),),
        "With a high-pass of 450 Hz in the filter's place",
        "figure-8-10",
    ),
    Item(
        "Section 8.5",
        "A K' of lower bandwidth can be designed in the mu framework, stable and robust",
        Verdict.REPRODUCED,
        (
            at_most("peak of mu", SLOWER, "peak", 1.0),
            at_least("gain margin [dB]", SWITCHED, "gain_margin_lower_db", 6.0),
            at_least("phase margin [deg]", SWITCHED, "phase_margin_lower_deg", 30.0),
        ),
        "Third order",
        "figure-8-10",
    ),
    Item(
        "Figure 8.7",
        "A makes the spike after a scratch smaller, without oscillation",
        Verdict.REPRODUCED,
        (
            at_least("draws with a smaller excursion", FOCUS, share_below("A"), 0.95),
            at_most("mean excursion over the reference's", FOCUS, ratio("excursion", "A"), 2 / 3),
            at_most("swing after the scratch over that before", FOCUS, swing("A", "f_en", 0), 2.0),
            at_least("the same, reference", FOCUS, swing("reference", "f_en", 0), 3.0),
        ),
        "Over 13 drives; the mean on the nominal one; swing of the measured error in one record",
        "figure-8-7",
    ),
    Item(
        "Figure 8.8",
        "So does B, and it removes the periodic error",
        Verdict.REPRODUCED,
        (
            at_least("draws with a smaller excursion", FOCUS, share_below("B"), 0.95),
            at_most("mean excursion over the reference's", FOCUS, ratio("excursion", "B"), 2 / 3),
            at_most("swing after the scratch over that before", FOCUS, swing("B", "f_en", 0), 2.0),
            at_most("periodic error over the reference's", FOCUS, ratio("periodic", "B"), 0.1),
        ),
        shown="figure-8-8",
    ),
    Item(
        "Figure 8.9",
        "C leaves the periodic error as it is and is better in defects",
        Verdict.READING,
        (
            Number(
                "periodic error over the reference's", FOCUS, ratio("periodic", "C"), 0.95, 1.05
            ),
            at_most("mean excursion over the reference's", FOCUS, ratio("excursion", "C"), 2 / 3),
            at_least("draws with a smaller excursion", FOCUS, share_below("C"), 0.75),
        ),
        "With a high-pass of 450 Hz for the fault filter. Better in most draws, not in all",
        "figure-8-9",
    ),
    Item(
        "Sections 8.5, 8.6",
        "C works with the fault filter that was designed",
        Verdict.READING,
        (
            *both(
                at_least,
                "draws that err less than the reference strategy",
                DESIGNED,
                "below_reference_estimation_1.2mm",
                0.75,
            ),
            *both(
                at_most, "draws in which the loop is lost", DESIGNED, "lost_estimation_1.2mm", 0.02
            ),
            *both(
                at_least,
                "loops of 13 that are unstable meanwhile",
                DESIGNED,
                "unstable_estimation",
                13,
            ),
            *both(at_most, "their fastest growth [1/s]", DESIGNED, "growth_estimation", 1500.0),
        ),
        "With the filter of `cd/<axis>/fault-filter`, in scratches of 1.2 mm. Its loop is unstable "
        "on every drive while a defect passes, slowly enough for that",
        "experiments, loops",
    ),
)

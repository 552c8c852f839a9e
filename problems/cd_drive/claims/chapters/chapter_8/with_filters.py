"""Sections 8.5 to 8.7: strategy C with its fault filters, and the strategies compared."""

from __future__ import annotations

from ...defect_readings import (
    ESTIMATOR,
    EXCURSION,
    STRATEGIES,
    SWITCHING,
    least_over_others,
    ratio,
    unstable_drives,
    worse_at_red_book,
    worse_cells,
)
from ...items import Item, Number, Verdict, at_least, at_most, near
from ...readings import both, quotient

FOCUS, EXCURSIONS = STRATEGIES.format("focus"), EXCURSION.format("focus")
SWITCHED, SLOWER = SWITCHING.format("focus"), "cd/focus/lower-bandwidth"
ROTATION = "cd/{}/wrong-rotation"
DESIGNED, FEEDBACK = "cd/{}/designed-filter", "cd/{}/state-feedback"

ITEMS = (
    Item(
        "Section 8.5",
        "The design of the filter can be changed until its loop is stable and robust",
        Verdict.READING,
        (
            *both(at_most, "mu of stability", DESIGNED, "mu_with_margins", 1.0),
            *both(
                at_most,
                "largest sensitivity while a defect passes, every plant",
                DESIGNED,
                "peak_robust_with_margins",
                3.0,
            ),
            *both(
                at_least,
                "phase margin, least of the drives [deg]",
                DESIGNED,
                "phase_margin_with_margins",
                19.0,
            ),
            *both(
                at_least,
                "draws that err less than the reference strategy",
                DESIGNED,
                "below_reference_with_margins_1.2mm",
                0.75,
            ),
        ),
        "Not by trial and error: with the sensitivity as one requirement more the filter is a "
        "convex problem. It costs accuracy: the estimate may be off by a half instead of 0.3",
        "loops, front, experiments",
    ),
    Item(
        "Section 8.6",
        "Simulations and experiments are very similar",
        Verdict.NOT_COMPUTABLE,
        found="The experiments are shown in figures alone, and these are not at hand",
    ),
    Item(
        "Figure 8.10",
        "With K the gain margin is about 20 dB, the phase margin 55 degrees",
        Verdict.REPRODUCED,
        (
            near("gain margin [dB]", SWITCHED, "gain_margin_K_db", 20.0, 0.15),
            near("phase margin [deg]", SWITCHED, "phase_margin_K_deg", 55.0, 0.05),
        ),
        "Sampled at 35 kHz",
        "figure-8-10",
    ),
    Item(
        "Figure 8.10",
        "With K' = K (1 - K_f) they are about 3 dB and 8 degrees, which is not robust",
        Verdict.READING,
        (
            near("gain margin [dB]", SWITCHED, "gain_margin_filter_db", 3.0, 0.15),
            near("phase margin [deg]", SWITCHED, "phase_margin_filter_deg", 8.0, 0.1),
            at_least("mu of robust stability", SWITCHED, "mu_filter", 1.0),
        ),
        "A first-order high-pass of 450 Hz has these margins. The printed filter is not known",
        "figure-8-10",
    ),
    Item(
        "Sections 8.7, 9.2",
        "C's loop may diverge while a defect lasts, slowly enough to be acceptable",
        Verdict.REPRODUCED,
        (
            Number(
                "unstable drives, a sample of delay",
                SWITCHED,
                unstable_drives("K (1 - F)", "delayed"),
                1,
                12,
            ),
            at_most("draws in which C loses focus", FOCUS, "draws_lost_C", 0.02),
            at_least(
                "defect over which all drives keep focus [mm]",
                SWITCHED,
                "kept_filter_rotation_mm",
                2.5,
            ),
        ),
        "Two drives of twelve, radially all. Proven for a disc that moves at its rotation alone",
        "loops, dwell",
    ),
    Item(
        "Section 8.7",
        "The reference strategy is the poorest",
        Verdict.REPRODUCED,
        both(
            at_least,
            "its mean excursion over the largest mean of A, B and C",
            STRATEGIES,
            least_over_others,
            1.5,
        ),
        shown="errors",
    ),
    Item(
        "Section 8.7",
        "A and B are the most alike, so B's estimator of the focus point adds nothing",
        Verdict.READING,
        (
            Number(
                "mean excursion of A over B's, focus",
                FOCUS,
                quotient("excursion_A_drives_mean", "excursion_B_drives_mean"),
                2 / 3,
                1.5,
            ),
            Number(
                "radial",
                STRATEGIES.format("radial"),
                quotient("excursion_A_drives_mean", "excursion_B_drives_mean"),
                2 / 3,
                1.5,
            ),
            at_most("draws in which A is below B, focus", FOCUS, "A_below_B", 0.4),
        ),
        "Alike within a fifth. In focus B is the better one in three of four draws",
        "claims",
    ),
    Item(
        "Section 8.7",
        "To follow the periodic disturbance is enough against defects",
        Verdict.REPRODUCED,
        both(at_least, "draws that stay readable under A", STRATEGIES, "readable_A", 0.95),
        "A has no feedback in a defect",
    ),
    Item(
        "Section 8.7",
        "C lets low frequencies through, which restricts the excursion enough",
        Verdict.REPRODUCED,
        both(at_least, "draws that stay readable under C", STRATEGIES, "readable_C", 0.9),
        "Of a scratch of 1.2 mm",
    ),
    Item(
        "Section 8.7",
        "At other angles A and B are at least equal to the reference strategy",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "draws and defects with a larger error, A",
                EXCURSION,
                worse_at_red_book("A"),
                0.05,
            ),
            *both(at_most, "B", EXCURSION, worse_at_red_book("B"), 0.05),
        ),
        "Angles and lengths of a defect, on the Red Book's disc at 9 Hz",
        "survival",
    ),
    Item(
        "Section 8.7",
        "At other angles C is at least equal to the reference strategy",
        Verdict.REFUTED,
        (
            at_least(
                "draws and defects with a larger error", EXCURSIONS, worse_at_red_book("C"), 0.1
            ),
            at_least(
                "defects of 30 at which its mean error is larger", EXCURSIONS, worse_cells("C"), 3.0
            ),
        ),
        "About the top of the deviation it is a toss-up, where the reference strategy hardly errs, "
        "and now and then it loses focus. Radially it is better",
        "survival",
    ),
    Item(
        "Section 8.7",
        "With a wrong rotation frequency B can be worse than the reference strategy",
        Verdict.REPRODUCED,
        (
            *both(
                at_least,
                "draws in which B is better, rotation known",
                ROTATION,
                "below_reference_B_0pct",
                0.9,
            ),
            *both(at_most, "half too fast", ROTATION, "below_reference_B_50pct", 0.3),
            *both(
                at_least,
                "mean excursion over the reference's, a fifth too fast",
                ROTATION,
                "over_reference_B_20pct_mean",
                1.0,
            ),
        ),
        "From an error of about a tenth on. A suffers sooner, radially from a twentieth",
        "wrong-rotation",
    ),
    Item(
        "Section 8.7",
        "Following the rotation frequency avoids that",
        Verdict.REPRODUCED,
        (
            near("frequency followed [Hz]", ESTIMATOR, "followed_kalman_hz", 5.5, 0.002),
            at_most(
                "spike with it over that with the frequency known",
                ESTIMATOR,
                quotient("spike_kalman_adapted_mean_um", "spike_kalman_mean_um"),
                1.1,
            ),
        ),
        "In the estimator, started 5 % off, not in B's loop",
        "rotation",
    ),
    Item(
        "Section 8.7",
        "The radial loop is expected to show comparable results",
        Verdict.READING,
        (
            *(
                at_most(
                    f"mean excursion of {name} over the reference's",
                    STRATEGIES.format("radial"),
                    ratio("excursion", name),
                    2 / 3,
                )
                for name in ("A", "B", "C")
            ),
            at_most(
                "phase margin of K (1 - F) [deg]",
                SWITCHING.format("radial"),
                "phase_margin_filter_deg",
                4.0,
            ),
        ),
        "It does in the laboratory. But C's loop has hardly a margin there",
        "excursion",
    ),
)

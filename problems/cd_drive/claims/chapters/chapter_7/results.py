"""Chapter 7: detectors, the fault filter and the estimators of position (sections 7.3, 7.4)."""

from __future__ import annotations

from ...defect_readings import (
    ESTIMATOR,
    FILTER,
    PLANE,
    clean_inside,
    drops_per_second,
    filter_gain,
    filter_pole,
    gain_off,
    lead,
    sensed_gain,
)
from ...items import Item, Number, Verdict, at_least, at_most, near
from ...readings import both, quotient

FOCUS = PLANE.format("focus")
OBSERVED = "cd/{}/observer-bandwidth"

ITEMS = (
    Item(
        "Equation 7.31",
        "White noise of 0.15 um up to 1750 Hz matches the experiments",
        Verdict.NOT_COMPUTABLE,
        found="The experiments are not at hand. The laboratory uses that noise",
    ),
    Item(
        "Figure 7.10",
        "On a clean disc both diodes stay roughly between 0.4 and 0.6",
        Verdict.READING,
        (at_least("share of points with both inside", FOCUS, clean_inside, 0.7),),
        "Roughly: four of five points. Their standard deviation is 0.067",
        "figure-7-5-7-10",
    ),
    Item(
        "Figure 7.11",
        "The quality falls from 1 to 0 and returns, once a revolution of about 5 Hz",
        Verdict.REPRODUCED,
        (near("falls per second", FOCUS, drops_per_second, 5.0, 0.15),),
        shown="figure-7-11",
    ),
    Item(
        "Section 7.4",
        "The quality signal or its binary form makes no notable difference: a few samples",
        Verdict.READING,
        (
            Number("lead of the quality [samples]", FOCUS, lead, 0.0, 5.0),
            Number("radial", PLANE.format("radial"), lead, 0.0, 12.0),
        ),
        "In focus under two samples in the mean. Radially eight, most of all at finger prints",
        "detection",
    ),
    Item(
        "Equation 7.32",
        "W_sd lets defects of up to 1.6 mm be estimated",
        Verdict.REFUTED,
        (
            at_least(
                "error of a bump of 1.6 mm over its size, filter made with W_sd",
                FILTER,
                "estimation_error_slow_bump_H_infinity",
                1.0,
            ),
            at_least(
                "of the robust filter, worst drive", FILTER, "estimation_error_slow_bump", 1.0
            ),
            at_most("of a swing of 0.8 mm, robust filter", FILTER, "estimation_error_doublet", 0.5),
        ),
        "Read as a length along the track at 1.3 m/s, with channels in physical units: at 1.6 mm "
        "no estimate at all is better. How the length follows from the weight is not told",
        "filters",
    ),
    Item(
        "Section 7.3.2",
        "With scalings of 5e-3 and 2e-5 all values of mu come below 1",
        Verdict.NOT_COMPUTABLE,
        found="No filter at all passes as well: W_sd is at most 250, times 2e-5 is 0.005. The "
        "numbers do not define the filter of figure 7.12",
    ),
    Item(
        "Figure 7.12",
        "The filter of 104th order can be reduced to a sampled one of 10th order",
        Verdict.READING,
        (
            near("states of the sampled filter", FILTER, "order_discrete", 10.0, 0.0),
            at_most("peak of mu with it", FILTER, "peak", 1.0),
            at_most("states of the full one", FILTER, "order_full", 104.0),
        ),
        "With channels in physical units. The sampled one is designed at that order",
        "figure-7-12",
    ),
    Item(
        "Figure 7.12, section 7.4",
        "At high frequency its gain is about -110 dB, the inverse of the optical gain",
        Verdict.READING,
        (near("gain at 10 kHz [dB]", FILTER, sensed_gain(10e3), -110.0, 0.03),),
        "From the normalised error to metres",
        "figure-7-12",
    ),
    Item(
        "Figure 7.12, section 7.4",
        "It attenuates low frequencies and passes high ones",
        Verdict.REPRODUCED,
        (
            at_most("at 10 Hz [dB]", FILTER, filter_gain(10.0), -12.0),
            at_least("at 10 kHz [dB]", FILTER, filter_gain(10e3), -4.0),
        ),
        "Metres to metres",
        "figure-7-12",
    ),
    Item(
        "Section 7.4",
        "The filter from defect to estimate has to be stable by itself",
        Verdict.REPRODUCED,
        (at_most("largest modulus of a pole, sampled", FILTER, filter_pole, 1 - 1e-9),),
    ),
    Item(
        "Figure 7.13, section 7.4",
        "A fast defect is well estimated, a slower one slightly less so",
        Verdict.READING,
        (
            at_most("error of a bump over its size", FILTER, "estimation_error_bump", 0.75),
            at_most("of a doublet", FILTER, "estimation_error_doublet", 0.5),
            at_least("of a slow bump", FILTER, "estimation_error_slow_bump", 1.0),
        ),
        "Its shape is, on every drive. A slow defect is worse off than with no estimate, which is "
        "more than slightly",
        "figure-7-13",
    ),
    Item(
        "Equations 7.33, 7.34",
        "ITAE poles at 5 kHz give five printed gains of the observer",
        Verdict.READING,
        (at_most("largest relative deviation", ESTIMATOR, gain_off, 0.15),),
        "In companion form, of the model sampled at 35 kHz with the gain in all of Table 5.2",
        "equation-7-34",
    ),
    Item(
        "Equation 7.35",
        "The estimator of the disturbance has gains of 45",
        Verdict.READING,
        (near("slowest settling [1/s]", ESTIMATOR, "K_p_settles_per_s", 45.0, 0.05),),
        "Read as what the oscillator's states gain per second. It then settles as fast",
    ),
    Item(
        "Section 7.3.3",
        "An observer of 5 kHz does not change the bandwidth of the loop",
        Verdict.READING,
        (
            *both(
                at_most,
                "largest relative change on twelve drives, controller fed by the observer",
                OBSERVED,
                "largest_change_thesis_estimate_no_u_p",
                0.05,
            ),
            *both(
                at_least,
                "drives of twelve that one of 300 Hz makes unstable",
                OBSERVED,
                "unstable_drives_itae_300_hz_estimate_no_u_p",
                1.0,
            ),
        ),
        "The observer alone, a clean disc, one sample of delay",
        "bandwidths",
    ),
    Item(
        "Section 7.3.3",
        "Neither does strategy B, which adds u_p by the gains of 45 at all times",
        Verdict.REFUTED,
        (
            at_most(
                "relative change of the nominal bandwidth, f_en seen",
                OBSERVED.format("focus"),
                "nominal_change_thesis_f_en",
                -0.05,
            ),
            at_least(
                "largest on a drive",
                OBSERVED.format("focus"),
                "largest_change_thesis_f_en",
                0.1,
            ),
            at_most(
                "largest with a Kalman filter",
                OBSERVED.format("focus"),
                "largest_change_Kalman_f_en",
                0.01,
            ),
        ),
        "Focus, K_p read as in the item before. Oscillators that settle as fast reach up to the "
        "bandwidth; those of a Kalman filter do not",
        "bandwidths",
    ),
    Item(
        "Figure 7.14",
        "In a defect the estimator runs by itself and gives the position of the layer",
        Verdict.REFUTED,
        (
            at_least(
                "its largest error, least of 90 % [um]", ESTIMATOR, "during_thesis_low_um", 5.0
            ),
            at_most(
                "of the measurement, most of 90 % [um]", ESTIMATOR, "during_measured_high_um", 5.0
            ),
            at_least(
                "growth of the observer at some quality [1/s]",
                ESTIMATOR,
                "growth_thesis_per_s",
                100.0,
            ),
            at_most(
                "of a Kalman filter, most of 90 % [um]", ESTIMATOR, "during_kalman_high_um", 0.75
            ),
        ),
        "While the quality falls its scaled gain is unstable: errors of tens of um, over 50 draws. "
        "A Kalman filter does it",
        "figure-7-14",
    ),
    Item(
        "Figure 7.15",
        "After a defect a spike of about 1 um is left, and its effect is substantially removed",
        Verdict.REFUTED,
        (
            Number(
                "its spike, mean over draws [um]",
                ESTIMATOR,
                "spike_thesis_mean_um",
                2.0,
                200.0,
                1.0,
            ),
            at_least(
                "opened without delay, least of 90 % [um]",
                ESTIMATOR,
                "spike_thesis_prompt_low_um",
                2.0,
            ),
            at_most(
                "of a Kalman filter, most of 90 % [um]", ESTIMATOR, "spike_kalman_high_um", 1.0
            ),
        ),
        "Not even without noise and delay. A Kalman filter stays below 1 um",
        "figure-7-15",
    ),
    Item(
        "Sections 7.2.2, 8.4",
        "The model of the disturbance has to follow the rotation",
        Verdict.REPRODUCED,
        (
            at_least(
                "slow observer's spike with a wrong rotation over that with the right one, means",
                ESTIMATOR,
                quotient("spike_itae_300_hz_wrong_mean_um", "spike_itae_300_hz_mean_um"),
                1.5,
            ),
            at_most(
                "with one that is followed over that",
                ESTIMATOR,
                quotient("spike_itae_300_hz_adapted_mean_um", "spike_itae_300_hz_mean_um"),
                1.2,
            ),
        ),
        "The rotation is 5 % off",
        "rotation",
    ),
    Item(
        "Section 7.4",
        "A map of four diodes' signals takes those in a defect back to those without one",
        Verdict.OPEN,
        found="Needs both pairs of diodes in one record, focus and radial loop together, and a "
        "regression of the true errors on all four",
    ),
)

"""Chapter 5: methods of synthesis, and sets that cover measured points (sections 5.1 to 5.4)."""

from __future__ import annotations

from workbench import Run

from ..items import Item, Value, Verdict, at_least, at_most, near
from ..readings import (
    CONTROLLERS,
    METHODS,
    both,
    circle_excess,
    cover_size,
    largest_turn,
    quotient,
    reach_over_narrowest,
    second_sets_missed,
    stadium_excess,
)

MASS_SPRING, FIVE_X = "mass-spring/analysis", "cd/focus/five-x"
AREAS = "cd/{}/smallest-area-stadiums"
JUMP, VARIANTS = "textbook/real-mu-jump", "cd/{}/cover-variants"
ROUNDING = 1e-9
"""Relative excess of a size that rounding explains."""


def states_over(model: str) -> Value:
    """States of a controller by (D, G)-K iteration over those of one by (mu, D)-K iteration."""

    def states(run: Run) -> float:
        order = run.data["order"].sel(model=model)
        return float(order.sel(controller="(D, G)-K") / order.sel(controller="(mu, D)-K"))

    return states


ITEMS = (
    Item(
        "Table 5.1",
        "D-K iteration takes real uncertainties as complex, (D, G)-K and (mu, D)-K do not",
        Verdict.REPRODUCED,
        (
            at_least(
                "peak of D-K's controller over that of (D, G)-K's",
                CONTROLLERS,
                quotient("peak_parametric_D_K", "peak_parametric_D_G_K"),
                1.2,
            ),
            at_least(
                "over that of (mu, D)-K's",
                CONTROLLERS,
                quotient("peak_parametric_D_K", "peak_parametric_mu_D_K"),
                1.2,
            ),
        ),
        "With the three real parameters of Table 5.3",
        "peaks",
    ),
    Item(
        "Table 5.1, equation 5.6",
        "Mixed sensitivity gives nominal performance, and robust performance only conservatively",
        Verdict.REPRODUCED,
        (
            at_most(
                "nominal performance", METHODS, "peak_nominal_performance_mixed_sensitivity", 1
            ),
            at_least("robust performance", METHODS, "peak_mixed_sensitivity", 1.0),
        ),
    ),
    Item(
        "Equation 5.7",
        "Loop shaping needs no model of the uncertainty in its second step",
        Verdict.REPRODUCED,
        (
            at_most("robust stability", METHODS, "peak_robust_stability_loop_shaping", 1.0),
            at_least("robust performance", METHODS, "peak_loop_shaping", 1.0),
        ),
        "It is robustly stable without one. It does not know W_p and misses it",
    ),
    Item(
        "Section 5.1.1, equation 5.1",
        "A real parameter that is taken as complex adds plants, which is conservative",
        Verdict.REPRODUCED,
        (
            at_least(
                "mu-PID, peak with complex parameters over that with real ones",
                METHODS,
                quotient("peak_complex_scalars_reference", "peak_reference"),
                1.2,
            ),
            at_most(
                "two masses, robust stability, real springs",
                MASS_SPRING,
                "peak_mixed_stability",
                1.0,
            ),
            at_least("complex springs", MASS_SPRING, "peak_complex_stability", 1.0),
        ),
    ),
    Item(
        "Equations 5.2, 5.3",
        "A weight times a Delta of norm 1 describes a set of plants about the nominal one",
        Verdict.REPRODUCED,
        both(
            at_most,
            "responses of drives outside the set",
            "cd/{}/circle-cover",
            "outside",
            0.0,
        ),
    ),
    Item(
        "Section 5.1.1",
        "An unstructured Delta is simple and conservative",
        Verdict.REPRODUCED,
        (
            at_least(
                "mu-PID, peak with a full block over that with complex scalars",
                METHODS,
                quotient("peak_full_block_reference", "peak_complex_scalars_reference"),
                1.2,
            ),
        ),
    ),
    Item(
        "Equations 5.4, 5.5",
        "H-infinity synthesis comes as near to the least norm as one likes",
        Verdict.REPRODUCED,
        (
            at_most(
                "norm reached over a norm that no controller beats",
                FIVE_X,
                quotient("nominal_norm", "nominal_bound"),
                1.01,
            ),
        ),
        "Nominal plant at 5X",
    ),
    Item(
        "Equations 5.8, 5.9",
        "mu is at most the largest singular value",
        Verdict.REPRODUCED,
        (
            at_most(
                "mu over the norm with a full block, most of eight controllers",
                METHODS,
                lambda run: float(
                    (
                        run.data["peak"].sel(condition="robust performance", bound="lower")
                        / run.data["peak"].sel(condition="full block", bound="upper")
                    ).max()
                ),
                1.0,
            ),
        ),
        "The norm with a full block has one scaling, for the units of performance",
    ),
    Item(
        "Section 5.1.3",
        "D-K iteration is reliable in practice, though it may end in a local minimum",
        Verdict.REPRODUCED,
        (
            at_most(
                "its peak with circles over what no controller beats",
                CONTROLLERS,
                quotient("peak_circle_D_K", "least_possible_circle"),
                1.05,
            ),
        ),
    ),
    Item(
        "Section 5.1.3",
        "(mu, D)-K iteration gives up the convergence that (D, G)-K iteration has",
        Verdict.REPRODUCED,
        (
            at_least(
                "its peak with stadiums over that of (D, G)-K",
                CONTROLLERS,
                quotient("peak_stadium_mu_D_K", "peak_stadium_D_G_K"),
                1.2,
            ),
            at_least(
                "with three parameters",
                CONTROLLERS,
                quotient("peak_parametric_mu_D_K", "peak_parametric_D_G_K"),
                1.2,
            ),
        ),
    ),
    Item(
        "Section 5.1.3",
        "Fitting G in magnitude and phase makes controllers of (D, G)-K large, unlike (mu, D)-K's",
        Verdict.REFUTED,
        (
            at_most(
                "states by (D, G)-K over those by (mu, D)-K, three parameters",
                CONTROLLERS,
                states_over("parametric"),
                0.9,
            ),
            at_most("stadiums", CONTROLLERS, states_over("stadium"), 0.9),
        ),
        "Here (D, G)-K has the fewer states. How the scalings are fitted decides that",
    ),
    Item(
        "Section 5.2",
        "mu of real uncertainties alone may jump, and a small complex part makes it continuous",
        Verdict.REPRODUCED,
        (
            at_least("decrease beside one parameter, real alone", JUMP, "jump_real", 0.3),
            at_most("with 1 % complex part", JUMP, "jump_at_most_complex_0.01", 1e-3),
            at_most("with 10 %", JUMP, "jump_at_most_complex_0.1", 1e-3),
        ),
        "Two real parameters, mu by hand and by certified bounds: 2 at one value of the data, 4/3 "
        "at every other. Of an example, not of the drive",
        "mu, values",
    ),
    Item(
        "Equations 5.10 to 5.14, figure 5.5",
        "A parameter and the inverse of one are LFTs, whose deltas are pulled out",
        Verdict.REPRODUCED,
        (
            near(
                "channels of R, k1 and k2, as in figure 6.1",
                "cd/focus/parametric",
                "channels_reduced",
                3.0,
                0.0,
            ),
        ),
        "The model pulled out equals the actuator's equations at random deltas",
        "tables-5-2-5-3",
    ),
    Item(
        "Section 5.3.1, figure 5.6",
        "The procedure finds the smallest circle about the points of a frequency",
        Verdict.REPRODUCED,
        both(
            at_most,
            "largest excess of its radius over the certified one",
            "cd/{}/circles",
            circle_excess,
            ROUNDING,
        ),
    ),
    Item(
        "Section 5.3.2",
        "Circles about a fitted nominal, and a weight fitted to their radii, cover every drive",
        Verdict.REPRODUCED,
        both(
            at_least,
            "least weight over the radius",
            "cd/{}/uncertainty-comparison",
            cover_size("W_c circle", min, "radius"),
            1.0 - ROUNDING,
        ),
        "The weight is fitted from above",
    ),
    Item(
        "Equation 5.15, figure 5.7",
        "A real and a complex perturbation together describe a stadium",
        Verdict.REPRODUCED,
        both(
            at_most,
            "responses of drives outside the realised stadiums",
            "cd/{}/stadium-cover",
            "outside",
            0.0,
        ),
    ),
    Item(
        "Section 5.4",
        "Syntheses for mixed uncertainty use the orientation of stadiums, D-K does not",
        Verdict.REPRODUCED,
        (
            at_least(
                "peak of D-K with stadiums over that of (D, G)-K",
                CONTROLLERS,
                quotient("peak_stadium_D_K", "peak_stadium_D_G_K"),
                1.01,
            ),
        ),
        "The difference is small: no controller gets far below for these stadiums",
    ),
    Item(
        "Section 5.4",
        "D-K iteration takes stadiums for circles, so those of the smallest area suit it better",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "radius plus half-length over the narrowest ones', most",
                AREAS,
                reach_over_narrowest(max),
                1.0 + ROUNDING,
            ),
            *both(
                at_most,
                "least",
                AREAS,
                reach_over_narrowest(min),
                0.9,
            ),
        ),
        "By the circle's radius, of sets with free centres. At most frequencies the two are one "
        "stadium",
        "sizes",
    ),
    Item(
        "Section 5.4.1, figure 5.8",
        "The procedure finds the narrowest stadium about the points of a frequency",
        Verdict.REPRODUCED,
        both(
            at_most,
            "largest excess of its width over the certified one",
            "cd/{}/stadiums",
            stadium_excess,
            ROUNDING,
        ),
    ),
    Item(
        "Section 5.4.2, figure 5.9",
        "The narrowest stadium about a given centre is one of two candidates",
        Verdict.REFUTED,
        both(
            at_least,
            "frequencies of 400 at which the procedure misses it",
            "cd/{}/nyquist",
            second_sets_missed,
            1.0,
        ),
        "As printed it tries the midpoints of sides alone, and accepts too few sides. With the "
        "midpoints of all pairs of corners it is right",
    ),
    Item(
        "Section 5.4.3",
        "Erratic orientations can be limited, which makes a third set",
        Verdict.REPRODUCED,
        (
            at_least(
                "largest turn between neighbours before [deg]",
                "cd/focus/nyquist",
                largest_turn("steps second"),
                40.0,
            ),
            at_most("after [deg]", "cd/focus/nyquist", largest_turn("steps third"), 30.0),
        ),
    ),
    Item(
        "Section 5.4.4",
        "The weights of stadiums can be stable and of minimum phase",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "largest real part of a zero of W_r [rad/s]",
                VARIANTS,
                "rightmost_zero_minimum_phase_rad_s",
                0.0,
            ),
            *both(
                at_least,
                "peak of mu over that with zeros left free",
                VARIANTS,
                quotient("peak_minimum_phase", "peak_default"),
                1.2,
            ),
        ),
        "The cover contains every drive. As fitted it costs: W_r meets phase and magnitude less "
        "well, which makes mu of the loop 1.9 times as large, radially 1.3 times",
        "costs, curves",
    ),
)

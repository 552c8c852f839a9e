"""Chapter 2: how focus and track are sensed (sections 2.4.3 and 2.4.4)."""

from __future__ import annotations

from ...drive.focus_error.problem import MUCH
from ...drive.radial_error.methods import METHODS as RADIAL_METHODS
from ...drive.radial_error.problem import method_key
from ..items import Item, Number, Verdict, at_least, at_most, near

FOCUS_ERROR, RADIAL_ERROR = "cd/focus-error", "cd/radial-error"
METHODS = tuple((name, method_key(name)) for name in RADIAL_METHODS)
"""Methods to sense a track, and their names in metrics."""

ITEMS = (
    Item(
        "Section 2.4.3, figure 2.8",
        "The astigmatic method catches the focus in a much smaller range than Foucault's",
        Verdict.READING,
        (
            at_least(
                "Foucault's over it, same diodes, least of 12 designs, by the extremes",
                FOCUS_ERROR,
                "extremes_Foucault_over_astigmatic_least",
                1.0,
            ),
            at_most(
                "median",
                FOCUS_ERROR,
                "extremes_Foucault_over_astigmatic_median",
                MUCH,
            ),
            at_least(
                "median with the same gain at the focus, too",
                FOCUS_ERROR,
                "extremes_Foucault_over_same_gain_median",
                MUCH,
            ),
            at_least(
                "the same by half of the extremes",
                FOCUS_ERROR,
                "half_Foucault_over_same_gain_median",
                MUCH,
            ),
        ),
        "By scalar diffraction. With the same diodes it is smaller in every design, but twice so "
        "only with wide ones. It is much smaller, by a factor of 2, if it must have Foucault's "
        "gain: focal lines and gain are tied, while Foucault's range is set by the diodes",
        "figure-2-8",
    ),
    Item(
        "Section 2.4.3",
        "The lateral position of Foucault's knife is highly critical",
        Verdict.READING,
        (
            at_least(
                "false focus by a displacement of the diodes [um/um]",
                FOCUS_ERROR,
                "offset_Foucault_um_per_um_on_the_diodes",
                0.2,
            ),
            at_most(
                "with the astigmatic method [um/um]",
                FOCUS_ERROR,
                "offset_astigmatic_um_per_um_on_the_diodes",
                1e-3,
            ),
        ),
        "Lenses of 4 and 24 mm: 5 um on the diodes cost 2 um, all of the error that is allowed",
    ),
    Item(
        "Section 2.4.4",
        "Twin spot, push-pull, track wobble and phase detection give a radial error",
        Verdict.REPRODUCED,
        (
            *(
                at_least(
                    f"share of places within 0.38 um told on the right side, {name}",
                    RADIAL_ERROR,
                    f"right_side_{key}",
                    1.0,
                )
                for name, key in METHODS
            ),
            *(
                at_least(
                    f"least slope, {name} [1/um]", RADIAL_ERROR, f"slope_{key}_per_um_least", 0.0
                )
                for name, key in METHODS
            ),
        ),
        "By scalar diffraction, for pits of 3 to 11 clock periods and the printed depth",
        "radial-errors",
    ),
    Item(
        "Section 2.4.4, figure 2.9",
        "A side spot that leaves the track meets less interference and more reflection",
        Verdict.REPRODUCED,
        (
            at_least(
                "light between the tracks over that on them, least",
                RADIAL_ERROR,
                "between_over_on_track_least",
                1.0,
            ),
            Number(
                "K_optRn, middle of Table A.3, over the slope by twin spots, median",
                RADIAL_ERROR,
                "table_A_3_over_twin_spot_median",
                0.5,
                1.5,
            ),
        ),
        "The drives' radial gain is that of twin spots over a disc by the printed dimensions, "
        "within what the lengths of the pits change",
        "radial-errors",
    ),
    Item(
        "Section 2.4.4",
        "Push-pull may develop an offset by drift",
        Verdict.READING,
        (
            at_least(
                "false error by light 0.1 radii beside the middle [um]",
                RADIAL_ERROR,
                "offset_push_pull_um",
                0.02,
            ),
            at_most("the same of twin spots [um]", RADIAL_ERROR, "offset_twin_spot_um", 1e-6),
        ),
        "Of pits an eighth of the wavelength deep, where push-pull is strongest. 0.2 um are "
        "allowed in all",
        "depth-and-landing",
    ),
    Item(
        "Section 2.4.4",
        "Push-pull depends on the depth of the pits and fails with pure amplitude patterns",
        Verdict.REPRODUCED,
        (
            near(
                "depth of pits at which it is strongest [wavelengths]",
                RADIAL_ERROR,
                "best_depth_push_pull",
                0.125,
                0.01,
            ),
            at_most(
                "strength at a quarter wavelength over that at an eighth",
                RADIAL_ERROR,
                "quarter_over_eighth_push_pull",
                0.01,
            ),
            at_most(
                "slope with dark pits of no depth [1/um]",
                RADIAL_ERROR,
                "slope_dark_push_pull_per_um_most",
                1e-6,
            ),
            at_least(
                "the same of twin spots [1/um]",
                RADIAL_ERROR,
                "slope_dark_twin_spot_per_um_most",
                0.1,
            ),
        ),
        "The other three methods are strongest at a quarter wavelength",
        "depth-and-landing",
    ),
)

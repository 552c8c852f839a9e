"""Chapter 2: optical discs and their readout beam.

The servo loops are in `chapter_2_servos`.
"""

from __future__ import annotations

from workbench import Run

from ...drive.focus_error.problem import MUCH
from ...drive.radial_error.methods import METHODS as RADIAL_METHODS
from ...drive.radial_error.problem import method_key
from ..items import Item, Number, Verdict, at_least, at_most, near

OPTICS, RED_BOOK = "cd/optics", "cd/red-book"
FOCUS_ERROR, RADIAL_ERROR = "cd/focus-error", "cd/radial-error"
METHODS = tuple((name, method_key(name)) for name in RADIAL_METHODS)
"""Methods to sense a track, and their names in metrics."""
DEBRIS = 300e-6
"""Diameter [m] that stands for "a few hundred micrometres"."""


def blocked_by_debris(run: Run) -> float:
    """Share of the light of a CD's beam that a particle of the size DEBRIS takes."""
    return (DEBRIS / run.metrics["D_CD_m"]) ** 2


def angle(quantity: str, disc: str, printed: float) -> Number:
    """An angle [deg] of Table 2.2, which prints whole degrees."""
    return Number(
        f"{quantity} of a {disc} [deg]",
        OPTICS,
        lambda run: float(run.data["beam"].sel(format=disc, quantity=quantity)),
        printed - 0.5,
        printed + 0.5,
        printed,
    )


ITEMS = (
    Item(
        "Section 2.1",
        "A DVD holds up to 25 times as much as a CD",
        Verdict.REPRODUCED,
        (near("largest ratio", OPTICS, "capacity_DVD_most_over_CD", 25.0, 0.05),),
    ),
    Item(
        "Section 2.1",
        "High-capacity discs of 20 to 50 GB hold about 30 to 75 times as much as a CD",
        Verdict.REPRODUCED,
        (
            near(
                "20 GB over a CD",
                OPTICS,
                lambda run: 20.0 / float(run.data["capacity"].sel(format="CD", bound="least")),
                30.0,
                0.05,
            ),
            near("50 GB over a CD", OPTICS, "capacity_BRD_most_over_CD", 75.0, 0.05),
        ),
    ),
    Item(
        "Table 2.1",
        "CD, DVD and Blu-ray differ in cover layer, wavelength and aperture",
        Verdict.REPRODUCED,
        (
            near(
                "cover layer of a CD [m]",
                OPTICS,
                lambda run: float(run.data["layer_thickness"].sel(format="CD")),
                1.17e-3,
                1e-6,
            ),
            at_least("density of a DVD over a CD's", OPTICS, "density_DVD_over_CD", 2.0),
        ),
        "The table is taken over as printed; Table 2.2 follows from it",
        "table-2-2",
    ),
    Item(
        "Section 2.3",
        "The error code repairs about 4000 bits, 2.5 mm of track",
        Verdict.READING,
        (
            near(
                "bits behind the error code on 2.5 mm, slow disc",
                RED_BOOK,
                lambda run: 2.5 * run.metrics["coded_bits_per_mm_slow"],
                4000.0,
                0.05,
            ),
        ),
        "Bits counted behind the error code, at 1.2 m/s. At 1.4 m/s they are 3360",
    ),
    Item(
        "Section 2.3",
        "Pits of 3 to 11 clock periods are read by slicer, oscillator and eye pattern (figure 2.4)",
        Verdict.OPEN,
        found="Needs a model of the data channel: modulation, HF signal, slicer, phase-locked "
        "loop. No run has one",
    ),
    Item(
        "Section 2.4",
        "The light of a CD is about 500 nm long in the disc, and a pit is a quarter of it high",
        Verdict.REPRODUCED,
        (
            near("wavelength [m]", OPTICS, "wavelength_inside_CD_m", 500e-9, 0.02),
            near(
                "a quarter of it [m]",
                OPTICS,
                lambda run: run.metrics["wavelength_inside_CD_m"] / 4,
                0.12e-6,
                0.06,
            ),
        ),
    ),
    Item(
        "Equations 2.1, 2.2, Table 2.2",
        "The light enters at 27, 37 and 58 degrees and goes on at 17, 23 and 33",
        Verdict.REPRODUCED,
        (
            angle("theta1", "CD", 27.0),
            angle("theta1", "DVD", 37.0),
            angle("theta1", "BRD", 58.0),
            angle("theta2", "CD", 17.0),
            angle("theta2", "DVD", 23.0),
            angle("theta2", "BRD", 33.0),
        ),
        shown="table-2-2",
    ),
    Item(
        "Equation 2.4, Table 2.2",
        "The beam is 0.72, 0.51 and 0.13 mm wide where it enters a CD, a DVD and a Blu-ray disc",
        Verdict.READING,
        (
            near("CD [m]", OPTICS, "D_CD_m", 0.72e-3, 0.015),
            near("DVD [m]", OPTICS, "D_DVD_m", 0.51e-3, 0.015),
            near("Blu-ray [m]", OPTICS, "D_BRD_m", 0.13e-3, 0.015),
        ),
        "The printed widths follow from angles that are rounded to whole degrees",
        "table-2-2",
    ),
    Item(
        "Equation 2.3, Table 2.2",
        "The spot is 0.87, 0.54 and 0.24 um wide in its focus",
        Verdict.REPRODUCED,
        (
            near("CD [m]", OPTICS, "d_CD_m", 0.87e-6, 0.01),
            near("DVD [m]", OPTICS, "d_DVD_m", 0.54e-6, 0.01),
            near("Blu-ray [m]", OPTICS, "d_BRD_m", 0.24e-6, 0.01),
        ),
        shown="table-2-2",
    ),
    Item(
        "Equation 2.5",
        "Information density grows with the aperture and falls with the wavelength, squared",
        Verdict.REPRODUCED,
        (
            at_least("density of a DVD over a CD's", OPTICS, "density_DVD_over_CD", 1.0),
            at_least(
                "of a Blu-ray disc over a DVD's",
                OPTICS,
                lambda run: run.metrics["density_BRD_over_CD"] / run.metrics["density_DVD_over_CD"],
                1.0,
            ),
        ),
    ),
    Item(
        "Section 2.4.1",
        "Dust of 40 um and hair of 75 um are no issue on a CD",
        Verdict.REPRODUCED,
        (
            at_most("light that dust takes", OPTICS, "blocked_by_dust_CD", 0.25),
            at_most("light that a hair takes", OPTICS, "blocked_by_hair_CD", 0.25),
        ),
        shown="table-2-2",
    ),
    Item(
        "Section 2.4.1",
        "Debris of up to a few hundred micrometres on a CD is out of focus and costs no data",
        Verdict.READING,
        (at_most("light that a particle of 300 um takes", OPTICS, blocked_by_debris, 0.5),),
        "Read as: most of the light still comes back. What the data need is not modelled",
    ),
    Item(
        "Section 2.4.1",
        "DVD and Blu-ray discs stand dust and hair less well than a CD",
        Verdict.REPRODUCED,
        (
            at_least(
                "light that dust takes from a DVD over that from a CD",
                OPTICS,
                lambda run: run.metrics["blocked_by_dust_DVD"] / run.metrics["blocked_by_dust_CD"],
                1.0,
            ),
            at_least(
                "from a Blu-ray disc over that from a CD",
                OPTICS,
                lambda run: run.metrics["blocked_by_dust_BRD"] / run.metrics["blocked_by_dust_CD"],
                1.0,
            ),
        ),
        shown="table-2-2",
    ),
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
        "By diffraction. With the same diodes it is always smaller, but half as large only where "
        "they are wide. With Foucault's gain, too, it is less than half as large in the median",
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
        "By diffraction, for pits of 3 to 11 clock periods, 0.4 to 0.6 um wide (assumed), and the "
        "printed depth",
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

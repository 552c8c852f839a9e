"""Chapter 2: optical discs and their readout beam.

How focus and track are sensed is in `chapter_2_sensing`, the servo loops in `chapter_2_servos`.
"""

from __future__ import annotations

from workbench import Run

from ..items import Item, Number, Verdict, at_least, at_most, near

OPTICS, RED_BOOK = "cd/optics", "cd/red-book"
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
)

"""Chapter 2: optical discs, their player and its servo loops."""

from __future__ import annotations

from ..items import Item, Verdict, at_least, near

OPTICS, RED_BOOK = "cd/optics", "cd/red-book"

ITEMS = (
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
        "Equation 2.7",
        "The focus deviation is bounded by its size up to 22 Hz",
        Verdict.REPRODUCED,
        (near("corner [Hz]", RED_BOOK, "lower_corner_focus_hz", 22.0, 0.03),),
    ),
    Item(
        "Equation 2.8",
        "The focus loop has to reach 500 Hz",
        Verdict.REPRODUCED,
        (near("corner [Hz]", RED_BOOK, "upper_corner_focus_hz", 500.0, 0.01),),
    ),
)

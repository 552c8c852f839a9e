"""The items of each chapter."""

from __future__ import annotations

from ..items import Item
from . import (
    appendix,
    chapter_1,
    chapter_2,
    chapter_2_disturbances,
    chapter_2_servos,
    chapter_3,
    chapter_3_drive,
    chapter_4,
    chapter_4_methods,
    chapter_4_results,
    chapter_5,
    chapter_5_results,
    chapter_6,
    chapter_6_mu,
    chapter_7,
    chapter_8,
    chapter_9,
)

CHAPTERS: dict[str, tuple[Item, ...]] = {
    "Chapter 1": chapter_1.ITEMS,
    "Chapter 2": chapter_2.ITEMS + chapter_2_servos.ITEMS + chapter_2_disturbances.ITEMS,
    "Chapter 3": chapter_3.ITEMS + chapter_3_drive.ITEMS,
    "Chapter 4": (
        chapter_4_methods.ESTIMATION
        + chapter_4.ITEMS
        + chapter_4_results.ITEMS
        + chapter_4_methods.LINEARITY
    ),
    "Chapter 5": chapter_5.ITEMS + chapter_5_results.ITEMS,
    "Chapter 6": chapter_6_mu.ITEMS + chapter_6.ITEMS,
    "Chapter 7": chapter_7.ITEMS,
    "Chapter 8": chapter_8.ITEMS,
    "Chapter 9": chapter_9.ITEMS,
    "Appendix": appendix.ITEMS,
}

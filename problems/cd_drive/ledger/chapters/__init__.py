"""The items of each chapter."""

from __future__ import annotations

from ..items import Item
from . import (
    chapter_1,
    chapter_2,
    chapter_2_disturbances,
    chapter_2_servos,
    chapter_3,
    chapter_3_drive,
)

CHAPTERS: dict[str, tuple[Item, ...]] = {
    "Chapter 1": chapter_1.ITEMS,
    "Chapter 2": chapter_2.ITEMS + chapter_2_servos.ITEMS + chapter_2_disturbances.ITEMS,
    "Chapter 3": chapter_3.ITEMS + chapter_3_drive.ITEMS,
}

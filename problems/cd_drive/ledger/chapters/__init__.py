"""The items of each chapter."""

from __future__ import annotations

from ..items import Item
from . import chapter_2

CHAPTERS: dict[str, tuple[Item, ...]] = {"Chapter 2": chapter_2.ITEMS}

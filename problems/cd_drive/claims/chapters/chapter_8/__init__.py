"""Chapter 8: strategies against surface defects."""

from ...items import Item
from . import strategies, with_filters

ITEMS: tuple[Item, ...] = strategies.ITEMS + with_filters.ITEMS

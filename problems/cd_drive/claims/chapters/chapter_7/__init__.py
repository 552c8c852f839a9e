"""Chapter 7: faults of a drive, and how they are detected, isolated and estimated."""

from ...items import Item
from . import faults, residuals, results

ITEMS: tuple[Item, ...] = faults.ITEMS + residuals.ITEMS + results.ITEMS

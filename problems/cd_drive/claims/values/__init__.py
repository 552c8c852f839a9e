"""What the tables of the chapters compute from stored runs."""

from . import covers, defects, discs, drives, identification, loops, strategies, tables
from .registry import VALUES

__all__ = [
    "VALUES",
    "covers",
    "defects",
    "discs",
    "drives",
    "identification",
    "loops",
    "strategies",
    "tables",
]

"""Functions by which the chapters' tables compute values from stored runs."""

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

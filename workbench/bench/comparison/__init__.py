"""What is made of a comparison's cells: verdicts, tables, figures and files."""

from workbench.bench.comparison.study import (
    HEADS,
    METHOD,
    UNFIT,
    Comparison,
    alike,
    rows,
    unfit,
)

__all__ = ["HEADS", "METHOD", "UNFIT", "Comparison", "alike", "rows", "unfit"]

"""Studies that read as their science: arrays, checks, metrics, tables and figures declared once."""

from workbench.study.checks import check
from workbench.study.declarations import array, arrays, dim, part, system, variables
from workbench.study.study import Study
from workbench.study.views import figure, lines, metric, table

__all__ = [
    "Study",
    "array",
    "arrays",
    "check",
    "dim",
    "figure",
    "lines",
    "metric",
    "part",
    "system",
    "table",
    "variables",
]

"""Studies: arrays, checks, metrics, tables and figures, each declared once as a function."""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.study.answers import answers
from workbench.study.checks import check
from workbench.study.declarations import array, arrays, dim, part, system, variables
from workbench.study.draws import (
    coverage_p,
    draws_summary,
    independent_seeds,
    interval_text,
    share_interval,
    share_of_draws,
    verdict_of_share,
)
from workbench.study.study import Study
from workbench.study.views import figure, lines, metric, table

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "Study",
    "answers",
    "array",
    "arrays",
    "check",
    "coverage_p",
    "dim",
    "draws_summary",
    "figure",
    "independent_seeds",
    "interval_text",
    "lines",
    "metric",
    "part",
    "share_interval",
    "share_of_draws",
    "system",
    "table",
    "variables",
    "verdict_of_share",
]

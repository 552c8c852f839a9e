"""Studies: arrays, checks, metrics, tables and figures, each declared once as a function.

Takes: functions with decorators, and parameters.
Gives: a Study, whose arrays are stored, checked, tabulated and drawn.
Rests on: binomial intervals and the bootstrap, for statements about random draws.
"""

from typing import TYPE_CHECKING

from workbench._core.array_cache import array_cache
from workbench._core.arrays import single_precision_bounds
from workbench._core.on_demand import no_more_names
from workbench._core.tables import Rows, markdown_table
from workbench.study.answers import answers
from workbench.study.checks import check
from workbench.study.declarations import array, arrays, dim, identifier, part, system, variables
from workbench.study.draws import (
    CLAIM_SHARE,
    LEAST_COVERAGE_P,
    SUMMARY,
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
    "CLAIM_SHARE",
    "LEAST_COVERAGE_P",
    "SUMMARY",
    "Rows",
    "Study",
    "answers",
    "array",
    "array_cache",
    "arrays",
    "check",
    "coverage_p",
    "dim",
    "draws_summary",
    "figure",
    "identifier",
    "independent_seeds",
    "interval_text",
    "lines",
    "markdown_table",
    "metric",
    "part",
    "share_interval",
    "share_of_draws",
    "single_precision_bounds",
    "system",
    "table",
    "variables",
    "verdict_of_share",
]

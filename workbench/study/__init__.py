"""Studies: arrays, checks, metrics, tables and figures, each declared once as a function."""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.study.answers import answers
from workbench.study.checks import check
from workbench.study.declarations import array, arrays, dim, part, system, variables
from workbench.study.draws import (
    claim_of,
    coverage_p,
    independent_seeds,
    over_draws,
    share_interval,
    share_of_draws,
    with_interval,
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
    "claim_of",
    "coverage_p",
    "dim",
    "figure",
    "independent_seeds",
    "lines",
    "metric",
    "over_draws",
    "part",
    "share_interval",
    "share_of_draws",
    "system",
    "table",
    "variables",
    "with_interval",
]

"""Results of a comparison, made from its cells: verdicts, tables, figures and files."""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.bench.comparison.changes import changed_cells, changes, changes_table
from workbench.bench.comparison.files import need_table_file, write_cells
from workbench.bench.comparison.layout import (
    DIMS,
    METHOD,
    NOT_COMPARED,
    UNFIT,
    need_comparison,
)
from workbench.bench.comparison.numbers import badge, counts, shifted_mean
from workbench.bench.comparison.study import Comparison
from workbench.bench.comparison.tables import HEADS, alike_methods, failures, left_out, rows
from workbench.bench.comparison.verdicts import SAFETY, judged_cells

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "DIMS",
    "HEADS",
    "METHOD",
    "NOT_COMPARED",
    "SAFETY",
    "UNFIT",
    "Comparison",
    "alike_methods",
    "badge",
    "changed_cells",
    "changes",
    "changes_table",
    "counts",
    "failures",
    "judged_cells",
    "left_out",
    "need_comparison",
    "need_table_file",
    "rows",
    "shifted_mean",
    "write_cells",
]

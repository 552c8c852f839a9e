"""Where work runs, how it shows its progress, when it must stop, and where it keeps its state.

Takes: functions with their arguments, and a time limit.
Gives: their results as they end, progress, and states from which an interrupted run resumes.
Rests on: no theorem; results depend neither on the place nor on the order of the work.
"""

# There is one interface: `concurrent.futures.Executor`. Code that submits tasks need not know
# whether they run in this process, in a pool of processes that can be killed, or on a cluster.

from typing import TYPE_CHECKING, Any

from workbench._core.on_demand import no_more_names
from workbench.executor.cluster import Cluster
from workbench.executor.context import Checkpoint, Context
from workbench.executor.local import InProcess, Threads
from workbench.executor.progress import Progress, Row, Watch, no_progress, no_watch, row_entry
from workbench.executor.spread import finished_calls, spread
from workbench.executor.workers import Workers

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

WALL_TIME: dict[str, Any] = {"wall_time": 1}
"""Attribute of stored arrays of times, which a re-run does not reproduce."""

__all__ = [
    "WALL_TIME",
    "Checkpoint",
    "Cluster",
    "Context",
    "InProcess",
    "Progress",
    "Row",
    "Threads",
    "Watch",
    "Workers",
    "finished_calls",
    "no_progress",
    "no_watch",
    "row_entry",
    "spread",
]

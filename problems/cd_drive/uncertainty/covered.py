"""The responses that a cover covers, in full precision: its file has them to look at only."""

from __future__ import annotations

from typing import cast

from workbench import Run
from workbench._core.heavy_types import DataArray
from workbench.uncertainty.covers.cover import UncertaintyCover


def covered_responses(run: Run) -> DataArray:
    """Responses (frequency [Hz], plant) that the run of a cover was asked to cover."""
    return cast(UncertaintyCover, run.task).responses.labelled()

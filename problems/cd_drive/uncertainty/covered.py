"""The responses that a cover contains, in full precision; the cover's file holds rounded ones to
look at.
"""

from __future__ import annotations

from typing import cast

from workbench import Run
from workbench.types import DataArray
from workbench.uncertainty import CircleCover, StadiumCover


def covered_responses(run: Run) -> DataArray:
    """Responses (frequency [Hz], plant) that the run of a cover had to cover."""
    return cast(CircleCover | StadiumCover, run.task).responses.labelled_points()

"""Frequency responses that are not rational, for rational functions to be fitted to."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

Shape = Literal["delay", "half-order"]
Order = Annotated[int, Field(ge=1, le=10)]
OMEGA = np.geomspace(0.05, 50.0, 60)
"""Frequencies [rad/s] of the data, on both sides of 1 rad/s, where the delay of 1 s and the corner
act.
"""

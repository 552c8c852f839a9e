"""Identification of the CD-player arm from its one measured record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.identification import StateSpaceFit

RECORD = "data/CD_player_arm.dat"
ESTIMATION = 1024
"""Number of samples from which models are estimated and their order is chosen; the rest tests the
models.
"""


@problem("cd-arm/identification", data=RECORD)
def identification(
    highest_order: Annotated[int, Field(ge=1)] = 16,
) -> StateSpaceFit:
    """State-space models of a measured CD-player arm to predict and to simulate, on held-out data.

    The record has two inputs, two outputs and 2048 samples (DaISy 96-007). Its sampling time is not
    given, so frequencies are in cycles per sample. The first 1024 samples serve for estimation and
    for the choice of orders. The fits are computed on the rest, whose first 50 samples give the
    initial state. One model is chosen to predict and one to simulate, each by validation in its own
    use.

    highest_order: orders from 2 to this one, in steps of two, are tried.
    """
    orders = tuple(range(2, highest_order + 1, 2)) or (1,)
    return arm_fit(orders, title="CD-player arm", poles="stable")


def arm_fit(orders: tuple[int, ...], **options: Any) -> StateSpaceFit:
    """Models of the record, which its authors converted to open-loop data."""
    return StateSpaceFit(
        *read_record(), estimation=ESTIMATION, orders=orders, assume="open loop", **options
    )


def read_record() -> tuple[np.ndarray, np.ndarray]:
    """Inputs u1 u2 (actuator forces) and outputs y1 y2 (tracking), each (2048, 2),
    without units.
    """
    columns = np.loadtxt(Path(__file__).parent / RECORD)
    return columns[:, :2], columns[:, 2:]

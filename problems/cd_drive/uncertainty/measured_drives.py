"""Responses of the twelve drives from which covers are made, and parameters that covers share.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003). Responses are those of the actuator, without the anti-aliasing filter: a
factor that all plants share changes no relative set.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from workbench import Run, ref
from workbench.uncertainty import Responses, widened_responses

from ..drive.plants import Gain, responses_of, systems_of
from ..drive.shared_parameters import grid
from ..drive.tables import ActuatorParameters, Axis, Values, drives

Source = Literal["tables", "identified"]
Order = Annotated[int, Field(ge=0, le=12)]
Content = Annotated[float, Field(gt=0, lt=1)]
LeaveOut = Annotated[int, Field(ge=0, le=4)]


def identified_drives(axis: str, source: Source = "tables", **_: Any) -> dict[str, Any]:
    """References to the laboratory's identification runs; empty if the tables are the source."""
    if source == "tables":
        return {}
    return {
        "identified": ref(f"cd/{axis}/identified"),
        "optical_gains": ref(f"cd/{axis}/optical-gain"),
    }


def measured_drives(
    axis: Axis,
    frequencies: int,
    lowest: float,
    highest: float,
    gain: Gain = "own",
    values: Values = "printed",
    identified: Run | None = None,
    optical_gains: Run | None = None,
    content: float | None = None,
) -> Responses:
    """Responses u [V] to f_en [units] of twelve drives, from the tables or as identified.

    The drives' models are known at every frequency, so covers contain them between the given
    frequencies, too. With ``content`` the responses are widened so that they contain a further
    drive with this probability.
    """
    frequency = grid(frequencies, lowest, highest)
    twelve = drives(axis, values)
    names = [drive.name for drive in twelve]
    models: list[ActuatorParameters] = [*twelve]
    gains = [drive.K_optn for drive in twelve]
    if identified is not None and optical_gains is not None:
        table = identified.data["value"]
        parameters = [str(name) for name in table["parameter"].values]
        models = [
            ActuatorParameters(**dict(zip(parameters, row.tolist(), strict=True)))
            for row in table.sel(drive=names).values
        ]
        found = optical_gains.data["gain"].sel(quantity="K_optn").sel(drive=names)
        gains = found.values.tolist()
    measured = Responses(
        omega=2 * np.pi * frequency,
        values=responses_of(axis, models, gains, frequency, gain, False).T,
        plants=names,
        unit="units/V",
        known=systems_of(axis, models, gains, gain, False),
    )
    return measured if content is None else widened_responses(measured, content)

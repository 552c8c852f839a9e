"""Uncertainty models of chapter 5 from the responses of the twelve drives.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003). Responses are those of the actuator, without the anti-aliasing filter: a
factor that all plants share changes no relative set.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from workbench import Run, problem, ref
from workbench.uncertainty import (
    CircleCover,
    Orientation,
    Responses,
    StadiumCover,
    limited,
    narrowest,
    smooth,
    widened,
)

from .drives import Gain, responses, responses_of
from .sets import TABLES, WINDOWS, Frequencies, Frequency, grid
from .tables import ActuatorParameters, Axis, Values, drives

Source = Literal["tables", "identified"]
Order = Annotated[int, Field(ge=0, le=12)]
Form = Literal["multiplicative", "additive"]
Content = Annotated[float, Field(gt=0, lt=1)]

ORIENTATIONS: dict[str, Orientation] = {
    "narrowest": narrowest,
    "limited": limited(),
    "smooth": smooth(),
}


def identified_drives(axis: str, source: Source = "tables", **_: Any) -> dict[str, Any]:
    """The drives as the virtual laboratory identified them, on request."""
    if source == "tables":
        return {}
    return {
        "identified": ref(f"cd/{axis}/identified"),
        "optical_gains": ref(f"cd/{axis}/optical-gain"),
    }


@problem("cd/{axis}/circle-cover", axis=("focus", "radial"), needs=identified_drives, data=TABLES)
def circle_cover(
    axis: Axis,
    identified: Run | None = None,
    optical_gains: Run | None = None,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
    source: Source = "tables",
    order: Order = 4,
    zeros: Order = 2,
    complex_order: Order = 4,
    form: Form = "multiplicative",
    leave_out: Annotated[int, Field(ge=0, le=4)] = 0,
    content: Content | None = None,
) -> CircleCover:
    """Nominal and complex weight that contain twelve drives (section 5.3, figures 5.10-5.12).

    Method "steps" fits the nominal to the centres of the smallest circles, as the thesis does;
    "joint" chooses it for small circles about it.

    frequencies, lowest, highest, gain, values: as in cd/<axis>/circles. source: drives from the
    measured "tables", or as "identified" in the virtual laboratory. order, zeros: of the nominal;
    complex_order: of the weight. form: weights "multiplicative" or "additive". leave_out: drives
    that may lie outside at each frequency. content: widen the sets so that a further drive is
    inside with this probability, if drives are normally distributed.
    """
    measured = measured_drives(
        axis, frequencies, lowest, highest, gain, values, identified, optical_gains, content
    )
    return CircleCover(
        measured,
        order,
        zeros,
        complex_order,
        form=form,
        leave_out=leave_out,
        windows=WINDOWS[axis],
    )


@problem("cd/{axis}/stadium-cover", axis=("focus", "radial"), needs=identified_drives, data=TABLES)
def stadium_cover(
    axis: Axis,
    identified: Run | None = None,
    optical_gains: Run | None = None,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
    source: Source = "tables",
    order: Order = 4,
    zeros: Order = 2,
    complex_order: Order = 4,
    real_order: Order = 4,
    orientation: Literal["narrowest", "limited", "smooth"] = "limited",
    minimum_phase: bool = False,
    form: Form = "multiplicative",
    leave_out: Annotated[int, Field(ge=0, le=4)] = 0,
    content: Content | None = None,
) -> StadiumCover:
    """Nominal, complex and real weight that contain twelve drives (section 5.4, figures 5.13-5.15).

    Method "steps" takes the seven steps of the thesis; "joint" chooses nominal and real weight
    together for narrow stadiums.

    real_order: of the real weight, minimum_phase: its zeros in the left half plane. orientation:
    of the third set, each stadium the "narrowest", "limited" where erratic, or "smooth" along
    frequency. The others: as in cd/<axis>/circle-cover.
    """
    measured = measured_drives(
        axis, frequencies, lowest, highest, gain, values, identified, optical_gains, content
    )
    return StadiumCover(
        measured,
        order,
        zeros,
        complex_order,
        real_order,
        orientation=ORIENTATIONS[orientation],
        minimum_phase=minimum_phase,
        form=form,
        leave_out=leave_out,
        windows=WINDOWS[axis],
    )


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

    Widened to where a further drive is inside with probability ``content``, if that is given.
    """
    frequency = grid(frequencies, lowest, highest)
    names = [drive.name for drive in drives(axis, values)]
    if identified is None or optical_gains is None:
        found = responses(axis, frequency, gain, values, antialiasing=False)
    else:
        table = identified.data["value"]
        parameters = [str(name) for name in table["parameter"].values]
        models = [
            ActuatorParameters(**dict(zip(parameters, row.tolist(), strict=True)))
            for row in table.sel(drive=names).values
        ]
        gains = optical_gains.data["gain"].sel(quantity="K_optn").sel(drive=names)
        found = responses_of(axis, models, gains.values.tolist(), frequency, gain, False)
    measured = Responses(2 * np.pi * frequency, found.T, plants=names, unit="units/V")
    return measured if content is None else widened(measured, content)

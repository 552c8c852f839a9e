"""Mixed uncertainty of the twelve drives: stadiums about a nominal (section 5.4).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003). Responses are those of the actuator, without the anti-aliasing filter: a
factor that all plants share changes no relative set.
"""

from __future__ import annotations

from typing import Literal

from workbench import Run, problem
from workbench.uncertainty import (
    CoverForm,
    Orientation,
    StadiumCover,
    limited_orientation,
    narrowest_angles,
    smooth_orientation,
)

from ..drive.plants import Gain
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies, Frequency
from ..drive.tables import Axis, Values
from .measured_drives import Content, LeaveOut, Order, Source, identified_drives, measured_drives

ORIENTATIONS: dict[str, Orientation] = {
    "narrowest": narrowest_angles,
    "limited": limited_orientation(),
    "smooth": smooth_orientation(),
}


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
    form: CoverForm = "multiplicative",
    leave_out: LeaveOut = 0,
    content: Content | None = None,
) -> StadiumCover:
    """Nominal, complex and real weight that contain twelve drives (section 5.4, figures 5.13-5.15).

    Method "steps" takes the seven steps of the thesis; "joint" chooses nominal and real weight
    together for narrow stadiums.

    real_order: order of the real weight. minimum_phase: whether its zeros are in the left half
    plane. orientation of the third set: each stadium the "narrowest", "limited" if the angle is
    erratic, or "smooth" along frequency. The other parameters: as in cd/<axis>/circle-cover.
    """
    measured = measured_drives(
        axis, frequencies, lowest, highest, gain, values, identified, optical_gains, content
    )
    return StadiumCover(
        measured,
        order,
        zeros=zeros,
        complex_order=complex_order,
        real_order=real_order,
        orientation=ORIENTATIONS[orientation],
        minimum_phase=minimum_phase,
        form=form,
        leave_out=leave_out,
        windows_hz=WINDOWS[axis],
    )

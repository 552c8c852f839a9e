"""Complex uncertainty of the twelve drives: circles about a nominal (section 5.3).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003). Responses are those of the actuator, without the anti-aliasing filter: a
factor that all plants share changes no relative set.
"""

from __future__ import annotations

from workbench import Run, problem
from workbench.uncertainty import CircleCover, CoverForm

from ..drive.plants import Gain
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies, Frequency
from ..drive.tables import Axis, Values
from .measured_drives import Content, LeaveOut, Order, Source, identified_drives, measured_drives


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
    form: CoverForm = "multiplicative",
    leave_out: LeaveOut = 0,
    content: Content | None = None,
) -> CircleCover:
    """Nominal and complex weight that contain twelve drives (section 5.3, figures 5.10-5.12).

    Method "steps" fits the nominal to the centres of the smallest circles, as the thesis does.
    Method "joint" chooses the nominal so that the circles around it are small.

    frequencies, lowest, highest, gain, values: as in cd/<axis>/circles. source: drives from the
    measured "tables", or as "identified" in the virtual laboratory. order, zeros: of the nominal;
    complex_order: of the weight. form: weights "multiplicative" or "additive". leave_out: number of
    drives that may be outside at each frequency. content: the sets are widened so that they contain
    a further drive with this probability, if drives are normally distributed.
    """
    measured = measured_drives(
        axis, frequencies, lowest, highest, gain, values, identified, optical_gains, content
    )
    return CircleCover(
        measured,
        order,
        zeros=zeros,
        complex_order=complex_order,
        form=form,
        leave_out=leave_out,
        windows_hz=WINDOWS[axis],
    )

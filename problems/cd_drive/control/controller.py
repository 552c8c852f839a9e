"""Robust controllers of the CD drive for each form of uncertainty, by any method (section 6.3).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from workbench import Run, problem, ref
from workbench.errors import InputError
from workbench.synthesis import MuSynthesis, approximate
from workbench.types import StateSpace

from ..drive.plants import Gain
from ..drive.plants import controller as reference
from ..drive.shared_parameters import TABLES, Frequencies
from ..drive.tables import Axis
from .control_problem import SIGNAL_UNITS
from .design import CoverMethod, UncertaintyForm, cover_of, synthesis_plant, uncertainty

After = Literal["", "reference", "dk", "mu-dk", "dgk"]
Speed = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class LoopController(MuSynthesis):
    """Mu synthesis that starts from a given controller."""

    default_method: ClassVar[str] = "fixed"


def needs(axis: str, after: After = "reference", **parameters: Any) -> dict[str, Any]:
    """References to the cover, and to the controller of the previous method in a chain."""
    found = cover_of(axis, **parameters)
    if after not in ("", "reference"):
        parameters.pop("order", None)
        found["start"] = ref(f"cd/{axis}/controller", method=after, **parameters)
    return found


@problem("cd/{axis}/controller", axis=("focus", "radial"), needs=needs, data=TABLES)
def controller(
    axis: Axis,
    covered: Run | None = None,
    start: Run | None = None,
    form: UncertaintyForm = "parametric",
    cover: CoverMethod = "steps",
    gain: Gain = "own",
    frequencies: Frequencies = 400,
    speed: Speed = 1.0,
    after: After = "reference",
    order: Annotated[int, Field(ge=0)] | None = None,
) -> LoopController:
    """The controller with the least certified peak of mixed mu, from w_p to z_p and z_u.

    form: form of the uncertainty. cover, gain, frequencies: of the circle or stadium models, as in
    `cd/<axis>/circle-cover` and `/stadium-cover`. speed: speed X of the disc. after: start of the
    method, either the "reference" controller (eq. 6.12) or that of another method. order: number of
    states to which the start is reduced first; None keeps all. Method "fixed", the default, needs a
    start.
    """
    plant = synthesis_plant(axis, uncertainty(axis, covered), speed)
    K: StateSpace | None = None
    if after == "reference":
        import control

        K = control.ss(reference(axis))
    elif start is not None:
        K = start.answer.K
    if order is not None:
        if K is None:
            raise InputError(
                f"order = {order} reduces the controller of an earlier method: name it by after"
            )
        if K.nstates > order:
            K = approximate(K, order, plant=plant)
    return LoopController(plant, start=K, units=SIGNAL_UNITS)

"""A benchmark's robust controller as C code for a processor."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from workbench import Run, problem, ref
from workbench.synthesis import Implementation, Precision

from .first_order import unstable_first_order


@problem("unstable-first-order/board", needs={"design": ref("unstable-first-order/controller")})
def board(
    design: Run,
    period: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 0.02,
    delay: Annotated[float, Field(ge=0.0, le=10.0)] = 0.5,
    precision: Precision = "float",
    order: Annotated[int, Field(ge=0)] | None = 4,
) -> Implementation:
    """The controller of the unstable plant with few states, sampled, in C.

    The results folder holds controller.h. The certificate is about the sampled loop with its hold,
    the computing delay, and the rounding of coefficients and signals.

    period: sampling time [s]. delay: computing delay [samples]. precision: double, float or fixed.
    order: number of states to which the controller is reduced; None keeps all.
    """
    scale = (10.0, 10.0) if precision == "fixed" else None
    plant = unstable_first_order()
    return Implementation(
        plant,
        design,
        period,
        delay_samples=delay,
        precision=precision,
        order=order,
        full_scale=scale,
    )

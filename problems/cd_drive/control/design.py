"""The plant for which controllers of a CD drive are designed, and its uncertainty."""

from __future__ import annotations

from typing import Any, Literal

from workbench import Run, ref
from workbench.synthesis import regularise
from workbench.uncertainty import (
    GeneralisedPlant,
    ParametricModel,
    UncertaintyModel,
    cover_function,
)

from ..drive.plants import Gain
from ..drive.tables import Axis
from ..uncertainty.parametric_model import parametric_plant
from .control_problem import generalised

UncertaintyForm = Literal["parametric", "circle", "stadium"]
CoverMethod = Literal["steps", "joint", "inflation"]
MEASUREMENT_NOISE = 0.1
"""Measurement noise above the filter's corner, relative to f_en; it keeps poles below 0.4 MHz."""


def cover_of(
    axis: str,
    form: UncertaintyForm = "parametric",
    cover: CoverMethod = "steps",
    frequencies: int = 400,
    gain: Gain = "own",
    **_: Any,
) -> dict[str, Any]:
    """Reference to the cover of a form of uncertainty; the parametric form needs none."""
    if form == "parametric":
        return {}
    name = f"cd/{axis}/{form}-cover"
    return {"covered": ref(name, method=cover, frequencies=frequencies, gain=gain)}


def uncertainty(axis: Axis, covered: Run | None) -> UncertaintyModel | ParametricModel:
    """Uncertain plant u [V] -> f_en [units]: that of a cover's run, or the parametric one."""
    if covered is None:
        return parametric_plant(axis)
    nominal, W_c, W_r = (cover_function(covered.data, name) for name in ("nominal", "W_c", "W_r"))
    assert nominal is not None and W_c is not None
    return UncertaintyModel(nominal, W_c, W_r)


def synthesis_plant(
    axis: Axis, uncertain: UncertaintyModel | ParametricModel, speed: float = 1.0
) -> GeneralisedPlant:
    """The plant for controller design: w_p and a little noise to (z_p, z_u), u to f_en.

    w_p and w_u enter the loop at the same place, so w_p alone drives both channels: a 2 x 2
    performance block would count one disturbance twice, and its mu could be sqrt(2) times that of
    the channels. No disturbance reaches f_en directly. Noise above the corner of the anti-aliasing
    filter, of size MEASUREMENT_NOISE relative to the response of f_en there, keeps controllers from
    being infinitely fast.

    Raises InputError as `performance_weight`.
    """
    return regularise(
        generalised(axis, uncertain, speed).channel(performance=("z_p", "z_u"), exogenous="w_p"),
        MEASUREMENT_NOISE,
    )

"""The generalised plant of demands: rows of weighted S, K S and T, driven by the set-point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.input_checks import is_real, need_kind, need_positive
from workbench.synthesis.demands.demands import Demands, DemandWeight, rational_of, strictest
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import UncertaintyModel

READS = {"S": "e", "T": "y", "KS": "u"}
"""The signal that the set-point drives through each weighted transfer function."""
HOLD = 0.5
"""Mean delay of a hold [samples]."""
LOAD = 0.25
"""Size of a load at the plant's input, relative to the input that an error of 1 needs at the
bandwidth. The integral action is then as fast as by the SIMC rules, whose integral time is four
times the closed loop's time constant.
"""


def demanded_plant(
    model: UncertaintyModel, demands: Demands, dt: float, *, delay_samples: float = 0.0
) -> GeneralisedPlant:
    """The loop u = K e, e = r - y of an uncertain plant, with a weight of each demand.

    If mu is below 1, every plant of the model satisfies each demand's weight, and also all weights
    together in the sum of their squares. Weights that another one of the same shape implies are
    left out. A load also acts at the plant's input. Its size is `LOAD` times the input that an
    error of 1 needs at the bandwidth. So errors due to a load decay as fast as errors due to the
    set-point.

    Parameters
    ----------
    model
        Uncertainty model, continuous, from u to y.
    demands
        One or more.
    dt
        Sampling time [s] of the controller. The controller is continuous here, and its hold is a
        delay of half a sample.
    delay_samples
        Computation delay [samples].

    Raises
    ------
    InputError
        Nothing is demanded; the model is sampled; or as in `Demands.weights`.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import PI, Demands, MuSynthesis, demanded_plant
    >>> from workbench.uncertainty import UncertaintyModel
    >>> model = UncertaintyModel(control.tf([2.0], [10.0, 1.0]), control.tf([0.1], [1.0]))
    >>> plant = demanded_plant(model, Demands(bandwidth=0.1, effort=0.02), dt=0.5)
    >>> wb.solve(MuSynthesis(plant, family=PI(), integral=True)).metrics["peak"] < 1
    True
    """
    need_kind(model, UncertaintyModel, "model")
    need_kind(demands, Demands, "demands")
    if model.dt:
        raise InputError(f"the model is sampled every {model.dt:g} s; a continuous one is needed")
    if not demands.asked:
        raise InputError("nothing is demanded; give a bandwidth, for example")
    rows = strictest(demands.weights(model.nominal, dt))
    omega = np.array([demands.crossover])
    load = LOAD / float(np.abs(model.nominal.response(omega)[0])) if demands.crossover else None
    return weighted_loop(model, lateness(dt, delay_samples), rows, load)


def lateness(dt: float, delay_samples: float) -> Rational:
    """The delay T of hold and computer as the approximation (-s + 2 / T) / (s + 2 / T)."""
    need_positive(dt, "dt")
    if not (is_real(delay_samples) and 0.0 <= delay_samples < float("inf")):
        raise InputError(
            f"delay_samples is {delay_samples!r}; it must be a number of samples, 0 or more"
        )
    corner = 2 / ((delay_samples + HOLD) * dt)
    return rational_of([corner], [-corner], -1.0)


def weighted_loop(
    plant: UncertaintyModel | StateSpace,
    late: Rational | None,
    rows: Sequence[DemandWeight],
    load: float | None = None,
) -> GeneralisedPlant:
    """The loop with an output for each weight. ``late`` acts before the plant, and ``load`` is the
    size of a disturbance at the plant's input.
    """
    names = [f"z_{one.name}" for one in rows]
    parts: list[Any] = [
        (one.W.state_space(), READS[one.channel], name)
        for one, name in zip(rows, names, strict=True)
    ]
    sums, enters = {"e": "r - y"}, "u"
    if late is not None:
        parts.append((late.state_space(), "u", "late"))
        enters = "late"
    if load is not None:
        parts.append((rational_of([], [], load).state_space(), "d", "load"))
        sums["v"], enters = f"{enters} + load", "v"
    return generalised_plant(
        [(plant, enters, "y"), *parts],
        sums,
        exogenous=["r"] if load is None else ["r", "d"],
        control="u",
        performance=names,
        measurement="e",
    )

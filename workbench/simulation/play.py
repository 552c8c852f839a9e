"""Run of a sampled controller, filter or estimator on a recorded series, without a loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.simulation.controllers import Controller
from workbench.simulation.road import SIMULATION


def play(controller: Controller, measurement: ArrayLike) -> RealArray:
    """Outputs (N, p) of a controller for a record (N, r) of its measurements.

    The controller starts from its initial state and reads one sample after the other, as in a loop.
    Raises InputError if the record is not finite, has not two axes or too few measurements, or if
    an output is not finite; the message says at which sample.

    Examples
    --------
    >>> from workbench.simulation import play, adder
    >>> play(adder(), [[1.0, 2.0], [3.0, 4.0]]).ravel().tolist()
    [3.0, 7.0]
    """
    if not isinstance(controller, Controller):
        raise InputError(
            f"controller must be a Controller, not {type(controller).__name__}; estimators have one"
        )
    try:
        record = np.ascontiguousarray(measurement, float)
    except (TypeError, ValueError):
        raise InputError("the record must be an array of numbers, (N, measurements)") from None
    if record.ndim != 2 or not record.size:
        raise InputError(f"the record has shape {record.shape}; it must be (N, measurements)")
    if not np.isfinite(record).all():
        row = np.flatnonzero(~np.isfinite(record).all(axis=1))[0]
        raise InputError(f"the record has values that are not finite, first in row {row}")
    controller.need_measurements(record.shape[1])
    output = np.zeros((len(record), controller.outputs))
    state = np.array(controller.state, float)
    parameters = np.array(controller.parameters, float)
    road = None if controller.plain else SIMULATION.taken()
    if road is None:
        for row, told in zip(record, output, strict=True):
            controller.step(state, parameters, row, told)
    else:
        road.fast_play(controller.step, state, parameters, record, output)
    finite = np.isfinite(output).all(axis=1)
    if not finite.all():
        stop = int(np.argmin(finite))
        raise InputError(f"the output is not finite at sample {stop} of {len(record)}")
    return output

"""Plants of several channels, each with a cover of its own, and the loop of demands around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_array, as_list, need_kind
from workbench.synthesis.demands.demands import Demands, rational_of, strictest
from workbench.synthesis.demands.weighted_loop import LOAD, READS, lateness
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation
from workbench.uncertainty import UncertaintyModel

OF_CHANNELS = ("bandwidth", "settling_time", "overshoot", "effort")
"""Demands that have the same meaning for every channel once signals are divided by their sizes."""


def channel_plant(models: Sequence[Sequence[UncertaintyModel]]) -> StateSpace:
    """The nominal plant of several channels, from rows of models.

    Parameters
    ----------
    models
        Continuous models as p rows, one for each output; each row has m models, one for each input.

    Raises
    ------
    InputError
        The rows are not of equal length, or hold something else.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import channel_plant
    >>> from workbench.uncertainty import UncertaintyModel
    >>> row = [UncertaintyModel(control.tf([k], [1.0, 1.0]), control.tf(0.1, 1)) for k in (1, 2)]
    >>> plant = channel_plant([row, row])
    >>> plant.nstates, plant.noutputs, plant.ninputs
    (4, 2, 2)
    """
    rows = _rows(models)
    A, B, C, D = zip(
        *[
            (part.A, part.B, part.C, part.D)
            for part in (one.nominal.state_space() for row in rows for one in row)
        ],
        strict=True,
    )
    p, m = len(rows), len(rows[0])
    into, out = np.tile(np.eye(m), (p, 1)), np.repeat(np.eye(p), m, axis=1)
    parts = block_diag(*A), block_diag(*B) @ into, out @ block_diag(*C), out @ block_diag(*D) @ into
    return realisation(parts, 0.0)


def demanded_channels(
    models: Sequence[Sequence[UncertaintyModel]],
    demands: Demands,
    dt: float,
    *,
    sizes: tuple[Any, Any],
    delay_samples: float = 0.0,
) -> GeneralisedPlant:
    """The loop u = K e, e = r - y of a plant of several channels, with the weights of the demands.

    It is the loop of `demanded_plant`, in which every signal is divided by its size: a bandwidth,
    an overshoot and a settling time are demanded of all outputs together, and the effort of all
    inputs. The uncertainty of each channel is a perturbation of its own.

    Parameters
    ----------
    models
        As in `channel_plant`.
    demands
        Demands among bandwidth, settling time, overshoot and effort.
    dt
        Sampling time [s] of the controller.
    sizes
        Sizes of the inputs (m,) and of the outputs (p,), which count as equally large.
    delay_samples
        Computation delay [samples].

    Raises
    ------
    InputError
        Nothing or something else is demanded; sizes do not fit or are not positive; or as
        `channel_plant`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import Demands, demanded_channels
    >>> from workbench.uncertainty import UncertaintyModel
    >>> row = [UncertaintyModel(control.tf([k], [1.0, 1.0]), control.tf(0.1, 1)) for k in (1, 2)]
    >>> plant = demanded_channels(
    ...     [row, row[::-1]], Demands(bandwidth=0.5), dt=0.1, sizes=([1, 1], [2, 2])
    ... )
    >>> plant.controls, plant.measurements, len(plant.structure)
    (2, 2, 4)
    """
    rows = _rows(models)
    need_kind(demands, Demands, "demands")
    if not demands.asked or not set(demands.asked) <= set(OF_CHANNELS):
        raise InputError(
            f"demanded is {', '.join(demands.asked) or 'nothing'}; a plant of several channels "
            f"takes demands among {', '.join(OF_CHANNELS)}"
        )
    ins, outs = range(len(rows[0])), range(len(rows))
    u_sizes, y_sizes = _sizes(sizes, (len(ins), len(outs)))
    blocks: list[Any] = [(rows[i][j], f"v{j}", f"y{i}_{j}") for i in outs for j in ins]
    sums = {f"y{i}": " + ".join(f"y{i}_{j}" for j in ins) for i in outs}
    sums |= {f"e{i}": f"r{i} - y{i}" for i in outs}
    late = lateness(dt, delay_samples).state_space()
    omega = np.array([demands.crossover])
    loads = LOAD / np.abs(sized_response(rows, omega, sizes)[0]).max(axis=0) * u_sizes
    loaded = bool(demands.crossover)
    for j in ins:
        blocks.append((late, f"u{j}", f"late{j}"))
        if loaded:
            blocks.append((_gain(loads[j]), f"d{j}", f"load{j}"))
        sums[f"v{j}"] = f"late{j} + load{j}" if loaded else f"late{j}"
    performance = []
    for one in strictest(demands.weights(rows[0][0].nominal, dt)):
        signal = READS[one.channel]
        for k, size in enumerate(u_sizes if signal == "u" else y_sizes):
            performance.append(f"z_{one.name}{k}")
            blocks.append((one.W.scaled(1 / size).state_space(), f"{signal}{k}", performance[-1]))
    for i, size in enumerate(y_sizes):
        blocks.append((_gain(size), f"step{i}", f"r{i}"))
    loads_named = [f"d{j}" for j in ins] if loaded else []
    return generalised_plant(
        blocks,
        sums,
        exogenous=[*(f"step{i}" for i in outs), *loads_named],
        control=[f"u{j}" for j in ins],
        performance=performance,
        measurement=[f"e{i}" for i in outs],
    )


def sized_response(
    models: Sequence[Sequence[UncertaintyModel]], omega: RealArray, sizes: tuple[Any, Any]
) -> ComplexArray:
    """Response (F, p, m) of the nominal plant, with signals divided by their sizes."""
    u_sizes, y_sizes = (np.asarray(one, dtype=float) for one in sizes)
    response = np.array([[one.nominal.response(omega) for one in row] for row in models])
    found: ComplexArray = np.moveaxis(response, -1, 0) * u_sizes / y_sizes[:, None]
    return found


def _gain(size: float) -> StateSpace:
    """A gain as a system."""
    return rational_of([], [], float(size)).state_space()


def _rows(models: Sequence[Sequence[UncertaintyModel]]) -> list[list[UncertaintyModel]]:
    """The rows of models, of equal length."""
    rows = [as_list(row, "models") for row in as_list(models, "models")]
    if not rows or not rows[0] or {len(row) for row in rows} != {len(rows[0])}:
        raise InputError("models must be rows of equal length, a row for each output")
    for row in rows:
        for one in row:
            need_kind(one, UncertaintyModel, "a model of a channel")
            if one.dt:
                raise InputError(f"a model is sampled every {one.dt:g} s; give continuous ones")
    return rows


def _sizes(sizes: tuple[Any, Any], counts: tuple[int, int]) -> tuple[RealArray, RealArray]:
    """Sizes of inputs and outputs as arrays."""
    pair = as_list(sizes, "sizes")
    if len(pair) != 2:
        raise InputError(f"sizes are {sizes!r}; sizes of the inputs and of the outputs are needed")
    u_sizes, y_sizes = (np.atleast_1d(as_array(one, "sizes")).astype(float) for one in pair)
    for found, count, kind in ((u_sizes, counts[0], "inputs"), (y_sizes, counts[1], "outputs")):
        if found.shape != (count,) or not (np.isfinite(found).all() and (found > 0).all()):
            raise InputError(
                f"sizes of the {kind} are {found.tolist()}; {count} positive numbers are needed"
            )
    return u_sizes, y_sizes

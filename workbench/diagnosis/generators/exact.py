"""Residual generators of least order that decouple controls and disturbances exactly.

For every residual the left null space (see `decoupling`) is searched for a row of least order nu.
Divided by a stable polynomial of degree nu, the row is a generator with the given poles (Frank and
Ding, J. Process Control 7 (1997); Varga, Solving Fault Diagnosis Problems (2017),
sections 5.2 and 5.4). For a sampled system with all poles at 0 it is a parity relation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.generators.generator import (
    Poles,
    ResidualGenerator,
    denominator,
    realised,
    residual_response,
    stacked,
)
from workbench.diagnosis.models.decoupling import Parity
from workbench.diagnosis.models.detectability import (
    detectability,
    frequencies,
    masking_inputs,
    need_faults,
    unattainable_faults,
)
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError, SolverError
from workbench.input_checks import as_array
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

FAULT_EFFECT_ROUNDING = 1e-10
"""The effect of a fault on a row counts as 0 below this share of its effect on the outputs."""
LARGEST_LEAK = 1e-6
"""Largest gain from a decoupled input to a residual, relative to the largest from a fault."""
RANDOM_COMBINATIONS = 400
"""Number of random combinations of rows among which the one with the largest least sensitivity to
the faults is chosen.
"""
SENSITIVITY_GRID = np.geomspace(1e-2, 1e2, 33)
"""Frequencies at which sensitivities are compared, in units of the model's fastest pole."""
LEAK_FREQUENCIES = np.array([0.0173, 0.061, 0.23, 0.71])
"""Frequencies at which leaks are measured, in units of the fastest pole; for sampled models in
units of pi / dt.
"""


def fault_detection(
    model: FaultModel, poles: Poles, *, omega: ArrayLike | None = None
) -> ResidualGenerator:
    """The generator of one residual, of least order, that reacts to faults alone and to every one.

    Parameters
    ----------
    model
        With one fault at least; its noise is ignored.
    poles
        One pole for all, or a list from which the first ones are taken, in s or z.
    omega
        Frequencies [rad/s] at which every fault must have an effect (strong detection), for
        instance 0 for constant faults. None: an effect at almost all frequencies is enough.

    Returns
    -------
    ResidualGenerator
        Scaled so that the largest gain from a fault is 1 at the first frequency of `omega`; if
        `omega` is None, at the peak.

    Raises
    ------
    InputError
        A fault cannot be detected; the message names it and what masks it. Poles are unstable,
        too few or without their conjugates.
    SolverError
        Rounding spoils the decoupling, at orders from about 20 on.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, fault_detection
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> generator = fault_detection(model, poles=-3.0, omega=0.0)
    >>> round(float(abs(generator.R(0j))), 6)  # the gain from the fault
    1.0
    """
    need_faults(model)
    return fault_isolation(model, np.ones((1, len(model.faults)), dtype=bool), poles, omega=omega)


def fault_isolation(
    model: FaultModel, structure: ArrayLike, poles: Poles, *, omega: ArrayLike | None = None
) -> ResidualGenerator:
    """The generator of residuals of least order that show exactly the faults of their rows.

    Parameters
    ----------
    structure
        An array (q, k) of 0 and 1: whether residual i shows fault j.
    model, poles, omega
        As for `fault_detection`; every residual takes its poles from the front of the list.

    Raises
    ------
    InputError
        As for `fault_detection`. A structure has another shape, other entries, a row of zeros, or
        a row that is not attainable; the message says which faults cannot be told from which.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, fault_isolation, structure_matrix
    >>> plant = control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0, inputs=["f1", "f2"])
    >>> model = FaultModel(plant, faults=("f1", "f2"))
    >>> generator = fault_isolation(model, [[1, 0], [0, 1]], poles=-2.0)
    >>> structure_matrix(generator.Q, model).astype(int).tolist()
    [[1, 0], [0, 1]]
    """
    need_faults(model)
    rows = _structure(model, structure)
    at = None if omega is None else frequencies(model, omega)
    if at is not None and not at.size:
        raise InputError("omega is empty; give a frequency [rad/s], or None for a generic effect")
    denominator(poles, 0, model.dt)  # poles that no order can use are refused at once
    return stacked([_residual(model, i, row, poles, at) for i, row in enumerate(rows)])


def _structure(model: FaultModel, structure: ArrayLike) -> NDArray[np.bool_]:
    given = np.atleast_2d(as_array(structure, "structure"))
    k = len(model.faults)
    if given.ndim != 2 or given.shape[1] != k or not len(given):
        raise InputError(
            f"structure has shape {given.shape}; the model has {k} faults: (residuals, {k})"
        )
    if not np.isin(given, (0, 1)).all():
        raise InputError("structure must have entries 0 and 1 only")
    rows: NDArray[np.bool_] = given.astype(bool)
    if not rows.any(axis=1).all():
        empty = int((~rows.any(axis=1)).argmax()) + 1
        raise InputError(f"row {empty} of structure is zero: a residual that shows no fault")
    return rows


def _residual(
    model: FaultModel,
    number: int,
    row: NDArray[np.bool_],
    poles: Poles,
    omega: Array | None,
) -> ResidualGenerator:
    """The generator of the residual with one row of a structure."""
    hidden = unattainable_faults(model, row, omega=omega)
    if hidden:
        raise InputError(_explanation(model, number, row, hidden, omega))
    shown = tuple(name for name, one in zip(model.faults, row, strict=True) if one)
    zeros = tuple(name for name, one in zip(model.faults, row, strict=True) if not one)
    parity = Parity(model, (*model.disturbances, *zeros))
    for order in range(parity.complete + 1):
        v = _combination(parity, order, shown, poles, omega)
        if v is not None:
            found = realised(parity, [v.reshape(order + 1, -1)], poles)
            found = _normalised(found, shown, omega, parity.rate)
            _need_decoupled(found, parity, shown)
            return found
    raise SolverError(
        f"no residual shows {', '.join(shown)}, though each can be detected: their effects are "
        "too small beside others for the tolerances; scale the faults' entries"
    )


def _combination(
    parity: Parity, order: int, shown: Sequence[str], poles: Poles, omega: Array | None
) -> Array | None:
    """The row of an order whose least relative sensitivity to the shown faults is largest.

    None if the rows of that order do not show every fault.
    """
    rows = parity.rows(order)
    if not len(rows):
        return None
    model = parity.model
    d = denominator(poles, order, model.dt, parity.rate)
    grid = (
        SENSITIVITY_GRID * parity.rate
        if not model.dt
        else np.geomspace(1e-3, 1.0, 33) * np.pi / model.dt
    )
    at = grid if omega is None else omega
    points = parity.points_at(at)
    before = parity.effects(order, shown, points)
    after = rows @ before  # (points, rows, faults)
    if omega is None:  # sensitivities are summed over the grid
        seen = np.linalg.norm(after, axis=(0, 1)) > FAULT_EFFECT_ROUNDING * np.linalg.norm(
            before, axis=(0, 1)
        )
    else:
        seen = np.linalg.norm(after, axis=1) > FAULT_EFFECT_ROUNDING * np.linalg.norm(
            before, axis=1
        )
    if not seen.all():
        return None
    after = after / np.abs(np.polynomial.polynomial.polyval(points, d))[:, None, None]
    rng = np.random.default_rng(0)
    tried = np.vstack([np.eye(len(rows)), rng.standard_normal((RANDOM_COMBINATIONS, len(rows)))])
    tried /= np.linalg.norm(tried, axis=1, keepdims=True)
    gain = np.abs(np.einsum("cr,srf->csf", tried, after))
    if omega is None:
        share = np.linalg.norm(gain, axis=1) / np.linalg.norm(after, axis=(0, 1))
    else:
        share = (gain / np.linalg.norm(after, axis=1)).reshape(len(tried), -1)
    found: Array = tried[share.min(axis=1).argmax()] @ rows
    return found


def _normalised(
    found: ResidualGenerator, shown: Sequence[str], omega: Array | None, rate: float
) -> ResidualGenerator:
    """The generator scaled to a largest fault gain of 1, at the first of omega or on the grid."""
    dt = float(found.Q.dt or 0.0)
    grid = SENSITIVITY_GRID * rate if not dt else np.geomspace(1e-3, 1.0, 33) * np.pi / dt
    places = [found.faults.index(name) for name in shown]
    gains = response(found.R, grid if omega is None else omega[:1])[:, 0, places]
    k, j = np.unravel_index(int(np.abs(gains).argmax()), gains.shape)
    gain = abs(gains[k, j]) * (1.0 if gains[k, j].real >= 0.0 else -1.0)

    return replace(found, Q=_divided_outputs(found.Q, gain), R=_divided_outputs(found.R, gain))


def _need_decoupled(found: ResidualGenerator, parity: Parity, shown: Sequence[str]) -> None:
    """Raise SolverError if rounding leaves a gain above LARGEST_LEAK from a decoupled input."""
    model = parity.model
    names = (*model.controls, *parity.decoupled, *shown)
    dt = model.dt
    at = LEAK_FREQUENCIES * (np.pi / dt if dt else parity.rate)
    gains = np.abs(residual_response(found.Q, model, names, at)).max(axis=(0, 1))
    leak, most = gains[: -len(shown)].max(initial=0.0), gains[-len(shown) :].max()
    if not leak <= LARGEST_LEAK * most:
        worst = names[int(gains[: -len(shown)].argmax())]
        raise SolverError(
            f"the residual of {', '.join(shown)} has order {found.Q.nstates}, at which rounding "
            f"leaves a gain of {leak / most:.2g} from {worst}; reduce the model, or measure more"
        )


def _divided_outputs(system: StateSpace, gain: float) -> StateSpace:
    """A system with its outputs divided by a gain."""
    return realisation(
        (system.A, system.B, system.C / gain, system.D / gain),
        float(system.dt or 0.0),
        inputs=list(system.input_labels),
        outputs=list(system.output_labels),
    )


def _explanation(
    model: FaultModel,
    number: int,
    row: NDArray[np.bool_],
    hidden: Sequence[str],
    omega: Array | None,
) -> str:
    """A message that says which faults of a row cannot be shown by a residual, and why."""
    zeros = tuple(name for name, one in zip(model.faults, row, strict=True) if not one)
    test = detectability(model, omega=0.0 if omega is None else omega, decoupled=zeros)
    reasons = []
    for name in hidden:
        place = test.faults.index(name)
        if not test.weak[place]:
            masks = masking_inputs(model, name, (*model.disturbances, *zeros))
            kinds = [
                f"{'the fault' if mask in zeros else 'the disturbance'} {mask}" for mask in masks
            ]
            if not masks:
                reasons.append(f"{name} moves no output")
            else:
                reasons.append(f"{name} cannot be told from {' and '.join(kinds)}")
        else:
            at = test.omega[~test.strong[place]]
            reasons.append(f"{name} leaves nothing at {', '.join(f'{w:.6g}' for w in at)} rad/s")
    start = (
        "no residual detects every fault"
        if row.all()
        else f"row {number + 1} of the structure is not attainable"
    )
    return f"{start}: {'; '.join(reasons)}"

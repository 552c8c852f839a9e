"""Parameters that change: how they enter a model, and the model as a function of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import InputError
from workbench.input_checks import as_array
from workbench.structure import Real, Structure
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation

if TYPE_CHECKING:
    from workbench.diagnosis.models.fault_model import FaultModel


RANK = 1e-12
"""Singular values of a parameter's matrix below this share of the largest are rounding."""


def multiplicative_lft(
    model: FaultModel, changes: Mapping[str, tuple[ArrayLike | None, ...]]
) -> GeneralisedPlant:
    """The system as a linear fractional transformation of its parameter faults delta: exact.

    Parameters
    ----------
    model
        Its other inputs stay, controls last; its outputs are the measurements.
    changes
        For each parameter its (dA, dB, dC, dD), None: zero. A parameter of rank k is the block
        `Real(k)` of its name, in that order.

    Raises
    ------
    InputError
        As `FaultModel.with_multiplicative_fault`; no parameter.
    """
    if not changes:
        raise InputError("changes is empty; it needs the matrices of one parameter or more")
    found = {name: factors(model, name, _four(name, dM)) for name, dM in changes.items()}
    left = np.hstack([L for L, _ in found.values()])
    right = np.vstack([R for _, R in found.values()])
    blocks = [Real(L.shape[1], name) for name, (L, _) in found.items()]
    exogenous = (*model.disturbances, *model.faults, *model.noise)
    B_w, D_w = model.matrices(exogenous)
    B_u, D_u = model.matrices(model.controls)
    system, n, k, w = model.system, int(model.system.nstates), left.shape[1], len(exogenous)
    through = np.hstack([np.zeros((k, k + w)), right[:, n:]])
    signals = [f"{name}_{i}" for name, (L, _) in found.items() for i in range(L.shape[1])]
    plant = realisation(
        (
            system.A,
            np.hstack([left[:n], B_w, B_u]),
            np.vstack([right[:, :n], system.C]),
            np.vstack([through, np.hstack([left[n:], D_w, D_u])]),
        ),
        model.dt,
        inputs=[*(f"d_{s}" for s in signals), *exogenous, *model.controls],
        outputs=[*(f"q_{s}" for s in signals), *model.outputs],
    )
    return GeneralisedPlant(plant, Structure(blocks), len(model.controls), len(model.outputs))


def factors(
    model: FaultModel, name: str, parts: tuple[ArrayLike | None, ...]
) -> tuple[Array, Array]:
    """L (n + p, k) and R (k, n + m) of full rank with L R = [dA dB; dC dD]."""
    n, p, m = int(model.system.nstates), len(model.outputs), len(model.controls)
    shapes = {"dA": (n, n), "dB": (n, m), "dC": (p, n), "dD": (p, m)}
    given: list[Array] = []
    for (label, shape), part in zip(shapes.items(), parts, strict=True):
        matrix = np.zeros(shape) if part is None else as_array(part, f"{label} of {name}")
        if matrix.shape != shape:
            raise InputError(
                f"{label} of fault {name!r} has shape {matrix.shape}; the model has {n} states, "
                f"{p} outputs and {m} controls: {shape} is needed"
            )
        if not np.isfinite(matrix).all():
            raise InputError(f"{label} of fault {name!r} has entries that are not finite")
        given.append(matrix)
    dM = np.block([given[:2], given[2:]])
    if not dM.any():
        raise InputError(f"fault {name!r} changes nothing: dA, dB, dC and dD are zero")
    U, sizes, V = np.linalg.svd(dM)
    rank = int((sizes > RANK * sizes[0]).sum())
    if rank == 1:  # one column of a matrix stays what it was, as I_i in equation 7.2
        pivot = int(np.abs(dM).sum(axis=0).argmax())
        L = dM[:, [pivot]]
        return L, np.linalg.lstsq(L, dM, rcond=None)[0]
    return U[:, :rank], sizes[:rank, None] * V[:rank]


def _four(name: str, parts: tuple[ArrayLike | None, ...]) -> tuple[ArrayLike | None, ...]:
    if not (isinstance(parts, tuple) and len(parts) == 4):
        raise InputError(f"parameter {name!r} needs the four matrices (dA, dB, dC, dD)")
    return parts

"""Parameters that change: how they enter a model, and the model as an LFT of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.diagnosis.models.fault_model import FaultModel
from workbench.diagnosis.models.rank_factors import rank_factors
from workbench.errors import InputError
from workbench.structure import Real, Structure
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation


def multiplicative_lft(
    model: FaultModel, changes: Mapping[str, tuple[ArrayLike | None, ...]]
) -> GeneralisedPlant:
    """The system as an exact linear fractional transformation of its parameter faults delta.

    Parameters
    ----------
    model
        Its inputs become the exogenous inputs and, last, the controls; its outputs become the
        measurements.
    changes
        (dA, dB, dC, dD) for each parameter; None stands for zero. A parameter of rank k becomes the
        block `Real(k)` with its name, in the order given.

    Raises
    ------
    InputError
        As `FaultModel.with_multiplicative_fault`; or there is no parameter.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, multiplicative_lft
    >>> plant = control.ss(
    ...     [[0.0, 1.0], [-4.0, -0.5]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs=["u"]
    ... )
    >>> stiffness = ([[0.0, 0.0], [1.0, 0.0]], None, None, None)
    >>> lft = multiplicative_lft(FaultModel(plant, controls=("u",)), {"stiffness": stiffness})
    >>> [block.name for block in lft.structure]
    ['stiffness']
    """
    if not changes:
        raise InputError("changes is empty; it needs the matrices of one parameter or more")
    sizes = int(model.system.nstates), len(model.outputs), len(model.controls)
    found = {name: rank_factors(name, _four(name, dM), *sizes) for name, dM in changes.items()}
    left = np.hstack([L for L, _ in found.values()])
    right = np.vstack([R for _, R in found.values()])
    blocks = [Real(L.shape[1], name=name) for name, (L, _) in found.items()]
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


def _four(name: str, parts: tuple[ArrayLike | None, ...]) -> tuple[ArrayLike | None, ...]:
    if not (isinstance(parts, tuple) and len(parts) == 4):
        raise InputError(f"parameter {name!r} needs the four matrices (dA, dB, dC, dD)")
    return parts

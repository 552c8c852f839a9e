"""Parity relations of sampled systems: residuals that are weighted sums over some samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from workbench.diagnosis.generators.generator import ResidualGenerator, realised
from workbench.diagnosis.models.decoupling import NULL_SPACE_SHARE, Parity
from workbench.diagnosis.models.detectability import FAULT_EFFECT_SHARE, need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError
from workbench.input_checks import need_whole

NOISE_RIDGE = 1e-12
"""The noise matrix may be singular; this share of its trace, times the identity, is added to it."""


@dataclass(frozen=True, eq=False)
class ParityRelation:
    """r(k) = sum_i v_i y(k - order + i) - w_i u(k - order + i), with v of size 1.

    ``v`` is (order + 1, p), ``w`` (order + 1, m), ``generator`` the same relation as a filter.
    ``index`` is equation 7.23 of the thesis on a window: the norm of the row from disturbances and
    noise to r, over that of the row from the faults; 0 if disturbances and noise are decoupled.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, parity_relation
    >>> plant = control.ss(0.5, [[1.0, 1.0]], 1.0, 0.0, 1.0, inputs=["u", "f"])
    >>> relation = parity_relation(FaultModel(plant, controls=("u",), faults=("f",)), order=1)
    >>> relation.v.shape, relation.w.shape, relation.generator.faults
    ((2, 1), (2, 1), ('f',))
    """

    v: NDArray[np.float64]
    w: NDArray[np.float64]
    index: float
    generator: ResidualGenerator


def parity_relation(model: FaultModel, order: int) -> ParityRelation:
    """The parity relation over order + 1 samples with the least index.

    Initial states are always decoupled. Disturbances are decoupled if that leaves an effect of the
    faults; otherwise they count as noise. If neither disturbances nor noise remain, the norm of v
    takes their place.

    Parameters
    ----------
    model
        Sampled, with one fault at least; disturbances, noise and faults in units of one size.
    order
        Number of samples before the present one, 0 or more.

    Raises
    ------
    InputError
        The model is in continuous time; the order is negative, or too low to show a fault.

    References
    ----------
    Chow, Willsky, IEEE TAC 29 (1984) 603; Ding, Model-based Fault Diagnosis Techniques (2013),
    section 7.4: the generalised eigenvalue problem of the optimal parity vector.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, parity_relation
    >>> plant = control.ss(0.5, [[1.0, 1.0]], 1.0, 0.0, 1.0, inputs=["u", "f"])
    >>> relation = parity_relation(FaultModel(plant, controls=("u",), faults=("f",)), order=1)
    >>> ratio = relation.v[0, 0] / relation.v[1, 0]
    >>> round(float(ratio), 6)  # y(k) - 0.5 y(k - 1) needs no initial state
    -0.5
    """
    need_faults(model)
    need_whole(order, "order")
    if order < 0:
        raise InputError(f"order is {order}; it must not be negative")
    if not model.dt:
        raise InputError(
            "parity relations are for sampled models; sample this one, or ask fault_detection()"
        )
    parity = Parity(model, ())
    seen = parity.observability(order)
    rows = null_space(seen.T, rcond=NULL_SPACE_SHARE).T if len(parity.A) else np.eye(len(seen))
    T_u, T_d, T_f = (
        parity.toeplitz(order, *parity.entry(names))
        for names in (model.controls, model.disturbances, model.faults)
    )
    exact = (
        null_space((rows @ T_d).T, rcond=NULL_SPACE_SHARE).T @ rows
        if T_d.size and len(rows)
        else rows
    )
    if _leaves(exact, T_f):
        rows, T_n = exact, parity.toeplitz(order, *parity.entry(model.noise))
    elif _leaves(rows, T_f):
        T_n = parity.toeplitz(order, *parity.entry((*model.disturbances, *model.noise)))
    else:
        raise InputError(
            f"no parity relation of order {order} shows a fault: raise the order (that of the "
            f"model is {len(parity.A)}), or measure more"
        )
    gain, cost = rows @ T_f, rows @ T_n
    noisy = bool(np.linalg.norm(cost) > FAULT_EFFECT_SHARE * np.linalg.norm(T_n))
    size = cost @ cost.T if noisy else np.eye(len(rows))
    size += NOISE_RIDGE * np.trace(size) * np.eye(len(size))
    v = eigh(gain @ gain.T, size)[1][:, -1] @ rows
    v /= np.linalg.norm(v.reshape(order + 1, -1) / parity.y_units)
    index = float(np.linalg.norm(v @ T_n) / np.linalg.norm(v @ T_f)) if noisy else 0.0
    row = v.reshape(order + 1, -1)
    return ParityRelation(
        row / parity.y_units,
        (v @ T_u).reshape(order + 1, len(model.controls)),
        index,
        realised(parity, [row], 0.0),
    )


def _leaves(rows: NDArray[Any], T_f: NDArray[Any]) -> bool:
    return bool(len(rows)) and bool(
        np.linalg.norm(rows @ T_f) > FAULT_EFFECT_SHARE * np.linalg.norm(T_f)
    )

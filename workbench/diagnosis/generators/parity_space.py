"""Parity relations of sampled systems: residuals that are sums over a window of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from workbench.diagnosis.generators.generator import ResidualGenerator, realised
from workbench.diagnosis.models.decoupling import NULL, Parity
from workbench.diagnosis.models.detectability import EFFECT, need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError
from workbench.input_checks import need_whole

RIDGE = 1e-12
"""Share of the identity in the denominator of the index where noise does not reach all rows."""


@dataclass(frozen=True, eq=False)
class ParityRelation:
    """r(k) = sum_i v_i y(k - order + i) - w_i u(k - order + i), with v of size 1.

    ``v`` is (order + 1, p), ``w`` (order + 1, m), ``generator`` the same as a filter. ``index`` is
    the size of what disturbances and noise of unit size in the window add, over that of the faults:
    equation 7.23 on a window; 0 where they are decoupled.
    """

    v: NDArray[np.float64]
    w: NDArray[np.float64]
    index: float
    generator: ResidualGenerator


def parity_relation(model: FaultModel, order: int) -> ParityRelation:
    """The parity relation over order + 1 samples with the least index.

    Initial states are always decoupled. Disturbances are where that leaves something of the
    faults; else they count as noise, and so does a unit norm of v where there is neither.

    Parameters
    ----------
    model
        Sampled, with one fault at least; disturbances, noise and faults in units of one size.
    order
        Samples before the present one, from 0 on.

    Raises
    ------
    InputError
        A model in continuous time, an order that is negative or that leaves nothing of the faults.

    References
    ----------
    Chow, Willsky, IEEE TAC 29 (1984) 603; Ding, Model-based Fault Diagnosis Techniques (2013),
    section 7.4: the generalised eigenvalue problem of the optimal parity vector.
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
    rows = null_space(seen.T, rcond=NULL).T if len(parity.A) else np.eye(len(seen))
    T_u, T_d, T_f = (
        parity.toeplitz(order, *parity.entry(names))
        for names in (model.controls, model.disturbances, model.faults)
    )
    exact = null_space((rows @ T_d).T, rcond=NULL).T @ rows if T_d.size and len(rows) else rows
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
    noisy = bool(np.linalg.norm(cost) > EFFECT * np.linalg.norm(T_n))
    size = cost @ cost.T if noisy else np.eye(len(rows))
    size += RIDGE * np.trace(size) * np.eye(len(size))
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
    return bool(len(rows)) and bool(np.linalg.norm(rows @ T_f) > EFFECT * np.linalg.norm(T_f))

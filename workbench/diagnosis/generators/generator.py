"""Residual generators: a filter of measurements and controls, and what it leaves of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array
from workbench.diagnosis.models.decoupling import Parity
from workbench.diagnosis.models.detectability import frequencies, need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

Poles = complex | Sequence[complex]
CANCELLED = 1e-8
"""See `structure_matrix`."""
SPREAD = 12
"""Frequencies at which a weak structure is looked at."""
CONJUGATE = 1e-9
"""How far a polynomial's coefficients may be from real, relative."""


@dataclass(frozen=True, eq=False)
class ResidualGenerator:
    """r = Q [y; u], and on the model it was made for r = R [f; w].

    ``R``, from faults and noise, holds no mode that cancels, so that its poles and its response
    at a pole of the plant are those of the residual.
    """

    Q: StateSpace
    R: StateSpace
    faults: tuple[str, ...]
    noise: tuple[str, ...]


def transfer(
    Q: StateSpace, model: FaultModel, names: Sequence[str], omega: ArrayLike
) -> NDArray[np.complex128]:
    """From inputs of the model to the residuals r = Q [y; u] at `omega` [rad/s]: (F, q, k).

    With the faults this is the fault transfer matrix G_rf of equation 7.10. By responses of Q and
    of the model alone.

    Raises
    ------
    InputError
        Q with other inputs than outputs and controls of the model, or sampled differently; a pole
        of either at one of the frequencies.
    UnknownNameError
        A name that is no input of the model.
    """
    if not isinstance(model, FaultModel):
        raise InputError(f"model must be a FaultModel, not {type(model).__name__}")
    Q = as_system(Q, "Q")
    p, m = len(model.outputs), len(model.controls)
    if int(Q.ninputs) != p + m:
        raise InputError(
            f"Q has {Q.ninputs} inputs; the model has {p} outputs and {m} controls, one for each"
        )
    if float(Q.dt or 0.0) != model.dt:
        raise InputError(f"Q has the sampling time {Q.dt}, the model {model.dt} (0: continuous)")
    into = np.array([[name == u for name in names] for u in model.controls], dtype=float)
    at = frequencies(model, omega)
    filtered = response(Q, at)
    found: NDArray[np.complex128] = filtered[:, :, :p] @ model.response(names, at)
    return found + filtered[:, :, p:] @ into.reshape(m, len(names))


def structure_matrix(
    Q: StateSpace, model: FaultModel, omega: ArrayLike | None = None
) -> NDArray[np.bool_]:
    """Which residual reacts to which fault: (q, k).

    A gain counts as 0 below `CANCELLED` of what the outputs' parts of it would add up to without
    cancelling.

    Parameters
    ----------
    omega
        Frequencies [rad/s] at every one of which a residual must react (strong structure); None:
        it must at one of some that are spread at random over the model's poles (weak structure).

    Raises InputError as `transfer`; frequencies as of `detectability`.
    """
    need_faults(model)
    if omega is None:
        rate = float(np.abs(model.system.poles()).max(initial=0.0)) or 1.0
        spread = np.random.default_rng(7).uniform(-1.5, 1.5, SPREAD)
        at = np.pi / model.dt * 10.0 ** (spread - 1.6) if model.dt else rate * 10.0**spread
    else:
        at = frequencies(model, omega)
    found = np.abs(transfer(Q, model, model.faults, at))
    parts = np.abs(response(Q, at)[:, :, : len(model.outputs)])
    reacts = found > CANCELLED * (parts @ np.abs(model.response(model.faults, at)))
    over = np.any if omega is None else np.all
    return np.asarray(over(reacts, axis=0))


def stacked(generators: Sequence[ResidualGenerator]) -> ResidualGenerator:
    """Several generators of one model as one, its residuals r1, r2, ... in their order."""
    first = generators[0]
    return ResidualGenerator(
        _stack([each.Q for each in generators]),
        _stack([each.R for each in generators]),
        first.faults,
        first.noise,
    )


def realised(parity: Parity, rows: Sequence[Array], poles: Poles) -> ResidualGenerator:
    """The generator with the rows' polynomials over those with the poles given.

    Parameters
    ----------
    rows
        Coefficients (order_i + 1, p) of rising powers, in the units of `parity`.
    poles
        One for all, or a list of which each residual takes as many as its order, in s or z.

    Raises
    ------
    InputError
        As `denominator`.
    """
    model = parity.model
    inner = (*model.faults, *model.noise)
    A_b, P = parity.rest
    into_b = P.T @ parity.entry(inner)[0]
    outer, kept = [], []
    for row in rows:
        order = len(row) - 1
        d = denominator(poles, order, model.dt, parity.rate)
        v = row.reshape(-1)
        T_u, T_f = (
            (v @ parity.toeplitz(order, *parity.entry(names))).reshape(order + 1, -1)
            for names in (model.controls, inner)
        )
        from_b = np.zeros((order + 1, len(A_b)))
        from_b[0] = v @ parity.observability(order) @ P
        outer.append(_observer_form(np.hstack([row / parity.y_units, -T_u]), d))
        kept.append(_observer_form(np.hstack([T_f, from_b]), d))
    A, B, C, D = _diagonal(kept)
    k, states, n_b = len(inner), len(A), len(A_b)
    # b' = A_b b + P' B_f f drives the polynomials
    A_R = np.block([[A, B[:, k:]], [np.zeros((n_b, states)), A_b]])
    B_R, C_R = np.vstack([B[:, :k], into_b]), np.hstack([C, D[:, k:]])
    A_Q, B_Q, C_Q, D_Q = _diagonal(outer)
    rate = parity.rate
    names = [f"r{i + 1}" for i in range(len(rows))]
    Q = realisation(
        (rate * A_Q, rate * B_Q, C_Q, D_Q),
        model.dt,
        inputs=[*model.outputs, *model.controls],
        outputs=names,
    )
    R = realisation(
        (rate * A_R, rate * B_R, C_R, D[:, :k]), model.dt, inputs=list(inner), outputs=names
    )
    return ResidualGenerator(Q, R, model.faults, model.noise)


def denominator(poles: Poles, order: int, dt: float, rate: float = 1.0) -> Array:
    """Coefficients of rising powers of s / rate (z / rate) with the first `order` of the poles.

    Raises InputError for poles that are not finite, not stable, too few, or whose complex ones are
    not in conjugate pairs.
    """
    try:
        given = np.asarray(poles, dtype=complex).reshape(-1)
    except (TypeError, ValueError):
        raise InputError(f"poles are {poles!r}; one number or a list of them is needed") from None
    if np.ndim(poles) == 0:
        chosen = np.full(order, given[0])
    else:
        if given.size < order:
            raise InputError(
                f"{given.size} poles for a residual generator of order {order}: give as many, or "
                "one for all"
            )
        chosen = given[:order]
    if not np.isfinite(given).all():
        raise InputError(f"poles are {poles!r}; they must be finite")
    beyond = np.abs(given) >= 1.0 if dt else given.real >= 0.0
    if beyond.any():
        where = "inside the unit circle" if dt else "left of the imaginary axis"
        raise InputError(
            f"an unstable residual generator is asked for: pole {given[beyond.argmax()]:.6g} is "
            f"not {where}"
        )
    found = np.atleast_1d(np.poly(chosen / rate))[::-1]
    if np.abs(np.imag(found)).max() > CONJUGATE * np.abs(found).max():
        raise InputError(
            f"the first {order} of the poles are {chosen}: complex ones must come in conjugate "
            "pairs, both or none among as many as the order"
        )
    return np.real(found)


def _observer_form(N: Array, d: Array) -> tuple[Array, Array, Array, Array]:
    """N(s) / d(s) with the coefficients of rising powers N (order + 1, inputs), d monic."""
    order = len(d) - 1
    A = np.eye(order, k=-1)
    if order:
        A[:, -1] = -d[:-1]
    return A, N[:-1] - d[:-1, None] * N[-1], np.eye(1, order, order - 1), N[-1:]


def _diagonal(parts: Sequence[tuple[Array, ...]]) -> tuple[Array, Array, Array, Array]:
    """Systems with common inputs, their outputs stacked."""
    from scipy.linalg import block_diag

    A = block_diag(*[part[0] for part in parts])
    C = block_diag(*[part[2] for part in parts])
    B, D = np.vstack([part[1] for part in parts]), np.vstack([part[3] for part in parts])
    return A, B, C, D


def _stack(systems: Sequence[StateSpace]) -> StateSpace:
    first = systems[0]
    matrices = _diagonal([(s.A, s.B, s.C, s.D) for s in systems])
    return realisation(
        matrices,
        float(first.dt or 0.0),
        inputs=list(first.input_labels),
        outputs=[f"r{i + 1}" for i in range(len(matrices[3]))],
    )

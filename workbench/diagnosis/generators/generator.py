"""Residual generators: filters of measurements and controls that react to faults and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.models.decoupling import Parity
from workbench.diagnosis.models.detectability import frequencies, need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

Poles = complex | Sequence[complex]
CANCELLED_GAIN_SHARE = 1e-8
"""A gain counts as 0 below this share of the sum of its parts, see `structure_matrix`."""
RANDOM_FREQUENCIES = 12
"""Number of random frequencies at which a weak structure is determined."""
IMAGINARY_COEFFICIENT_SHARE = 1e-9
"""Largest imaginary part of a polynomial's coefficients, relative to the largest coefficient."""


@dataclass(frozen=True, eq=False)
class ResidualGenerator:
    """A residual generator r = Q [y; u]; on its own model r = R [f; w].

    ``R``, from faults and noise, has no mode that cancels. Its poles are therefore those of the
    residual, and its response is right at poles of the plant too.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, fault_detection
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> generator = fault_detection(model, poles=-3.0, omega=0.0)
    >>> generator.faults, generator.R.poles().real.round(6).tolist()
    (('f',), [-3.0])
    """

    Q: StateSpace
    R: StateSpace
    faults: tuple[str, ...]
    noise: tuple[str, ...]


def residual_response(
    Q: StateSpace, model: FaultModel, names: Sequence[str], omega: ArrayLike
) -> NDArray[np.complex128]:
    """The response (F, q, k) from k inputs of the model to the residuals r = Q [y; u].

    `omega` [rad/s] are the frequencies (F,). For the faults this is the fault transfer matrix G_rf
    of equation 7.10 of the thesis. It is computed from the responses of Q and of the model alone.

    Raises
    ------
    InputError
        The inputs of Q are not the outputs and controls of the model; the sampling times differ; Q
        or the model has a pole at one of the frequencies.
    UnknownNameError
        A name that is no input of the model.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, fault_detection, residual_response
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> generator = fault_detection(model, poles=-3.0, omega=0.0)
    >>> abs(residual_response(generator.Q, model, ["f", "d", "u"], [0.0])).round(6).ravel().tolist()
    [1.0, 0.0, 0.0]
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
    Q: StateSpace, model: FaultModel, *, omega: ArrayLike | None = None
) -> NDArray[np.bool_]:
    """The structure matrix (q, k): whether residual i reacts to fault j.

    A gain is a sum of parts, one through each output. It counts as 0 below `CANCELLED_GAIN_SHARE`
    times the sum of the magnitudes of its parts.

    Parameters
    ----------
    omega
        Frequencies [rad/s] at all of which a residual must react (strong structure), as for
        `detectability`. None: it must react at one of some random frequencies around the model's
        poles (weak structure).

    Raises InputError as `residual_response` does.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel, fault_isolation, structure_matrix
    >>> plant = control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0, inputs=["f1", "f2"])
    >>> model = FaultModel(plant, faults=("f1", "f2"))
    >>> generator = fault_isolation(model, [[1, 1], [0, 1]], poles=-2.0)
    >>> structure_matrix(generator.Q, model).astype(int).tolist()
    [[1, 1], [0, 1]]
    """
    need_faults(model)
    if omega is None:
        rate = float(np.abs(model.system.poles()).max(initial=0.0)) or 1.0
        spread = np.random.default_rng(7).uniform(-1.5, 1.5, RANDOM_FREQUENCIES)
        at = np.pi / model.dt * 10.0 ** (spread - 1.6) if model.dt else rate * 10.0**spread
    else:
        at = frequencies(model, omega)
    found = np.abs(residual_response(Q, model, model.faults, at))
    parts = np.abs(response(Q, at)[:, :, : len(model.outputs)])
    reacts = found > CANCELLED_GAIN_SHARE * (parts @ np.abs(model.response(model.faults, at)))
    over = np.any if omega is None else np.all
    return np.asarray(over(reacts, axis=0))


def stacked(generators: Sequence[ResidualGenerator]) -> ResidualGenerator:
    """One generator with the residuals r1, r2, ... of several generators of one model."""
    first = generators[0]
    return ResidualGenerator(
        _stack([each.Q for each in generators]),
        _stack([each.R for each in generators]),
        first.faults,
        first.noise,
    )


def realised(parity: Parity, rows: Sequence[Array], poles: Poles) -> ResidualGenerator:
    """The generator whose numerators are the rows and whose denominators have the given poles.

    Parameters
    ----------
    rows
        Coefficients (order_i + 1, p) of rising powers, in the units of `parity`.
    poles
        One pole for all, or a list from which each residual takes as many as its order, in s or z.

    Raises
    ------
    InputError
        As `denominator` does.
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
    # the states b, with b' = A_b b + P' B_f f, drive the polynomials
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
    """The monic polynomial with the first `order` of the poles, in s / rate (sampled: z / rate).

    The coefficients are those of rising powers. Raises InputError for poles that are not finite,
    not stable, too few, or complex without their conjugates.
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
    if np.abs(np.imag(found)).max() > IMAGINARY_COEFFICIENT_SHARE * np.abs(found).max():
        raise InputError(
            f"the first {order} of the poles are {chosen}: complex ones must come in conjugate "
            "pairs, both or none among as many as the order"
        )
    return np.real(found)


def _observer_form(N: Array, d: Array) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of N(s) / d(s); coefficients of rising powers N (order + 1, inputs), d monic."""
    order = len(d) - 1
    A = np.eye(order, k=-1)
    if order:
        A[:, -1] = -d[:-1]
    return A, N[:-1] - d[:-1, None] * N[-1], np.eye(1, order, order - 1), N[-1:]


def _diagonal(parts: Sequence[tuple[Array, ...]]) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of several systems with common inputs, their outputs stacked."""
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

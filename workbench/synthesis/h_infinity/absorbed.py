"""Poles of weights on the stability boundary, moved into the controller.

An integrator in the weight of an error is a mode that no measurement shows, so no controller
stabilises it. If a measurement y drives it, xi' = Lambda xi + L y + M u, then the controller can
hold a copy of it, which knows xi from the start, and what is left to find is a controller of

    y' = y + F xi,    Lambda - L F stable,

which shows xi. Nothing is lost: y follows from y', u and a stable system. The controller of the
given plant has the poles of Lambda (internal model principle). In the loop that is certified, xi
stands once, in the controller, and drives the performance outputs: the pole that weight and
controller share is cancelled by construction. Its other states are those of the loop of the
controller with the plant without these weights, so that its stability is that of this loop.

The state that a measurement drives may be xi + T x with other states x. Modes that no control
reaches, such as those of disturbances that are integrated noise, are absorbed by the transposed
plant: their effect must be that of a control.

B. A. Francis, W. M. Wonham, The internal model principle of control theory, Automatica 12 (1976)
457-465.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space, schur, solve_continuous_are

from workbench.arrays import RealArray
from workbench.heavy_types import StateSpace
from workbench.synthesis.h_infinity.assumptions import HiddenModeError
from workbench.systems.balancing import axis_rounding, balanced, integrators_first, speed
from workbench.systems.bilinear import continuous, to_sampled
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

HIDDEN_SHARE = 1e-11
"""Singular values below this share of the largest, in balanced units, count as zero."""
AXIS_SHARE = 1e-8
"""A hidden mode lies on the axis if its real part is at most this share of its size."""
POLE_DISTANCE = 1e-5
"""Share of a frequency within which a pole spoils responses by cancellation."""
DRIVEN_SHARE = 1e-9
"""Largest share of what drives a mode that may be neither a measurement nor a control."""


@dataclass(frozen=True, eq=False)
class Absorbed:
    """The ``plant`` that remains to be controlled, and the copies that the controller holds.

    Each of ``copies`` is a generalised plant with inputs (y, u') and outputs (u, y'), whose
    controller is that of the next one. ``poles`` are the shared ones, in the plane of the plant.
    """

    plant: GeneralisedPlant
    copies: tuple[GeneralisedPlant, ...] = ()
    poles: tuple[complex, ...] = ()

    def whole(self, K: StateSpace) -> StateSpace:
        """The controller of the given plant, from one of ``plant``."""
        for copy in reversed(self.copies):
            K = copy.close(K)
        return K


def absorbed(plant: GeneralisedPlant) -> Absorbed:
    """The plant without the hidden modes on the stability boundary that a controller can share.

    Raises
    ------
    HiddenModeError
        The plant has a hidden mode beyond the stability boundary, or one on it that no controller
        can share; the message says which, and why.
    """
    given = standard_plant(plant)
    seen, measured, shown = _absorbed(continuous(given), given.dt, "measurement")
    reached, controlled, driven = _absorbed(seen.dual, given.dt, "control")
    if measured is None and controlled is None:
        return Absorbed(plant)
    copies = (measured, None if controlled is None else controlled.dual)
    parts = reached.dual
    matrices = (parts.A, parts.B, parts.C, parts.D)
    system = realisation(
        to_sampled(matrices) if given.dt else matrices,
        given.dt,
        inputs=list(plant.system.input_labels),
        outputs=list(plant.system.output_labels),
    )
    return Absorbed(
        GeneralisedPlant(system, plant.structure, plant.controls, plant.measurements),
        tuple(_system(copy, given.dt) for copy in copies if copy is not None),
        (*shown, *driven),
    )


def loop_gains(plant: GeneralisedPlant, K: StateSpace, omega: RealArray) -> RealArray:
    """Largest singular values (F,) of a loop by responses of plant and K."""
    P, k = plant.response(omega), response(K, omega)
    z, w = P.shape[-2] - plant.measurements, P.shape[-1] - plant.controls
    inner = np.eye(plant.measurements) - P[:, z:, w:] @ k
    closed = P[:, :z, :w] + P[:, :z, w:] @ k @ np.linalg.solve(inner, P[:, z:, :w])
    return np.linalg.norm(closed, 2, axis=(-2, -1))


def between_poles(omega: RealArray, plant: GeneralisedPlant, K: StateSpace) -> RealArray:
    """The frequencies at which no pole of plant or K spoils responses by cancellation."""
    poles = np.concatenate([plant.system.poles(), K.poles()])
    dt = plant.system.dt or 0.0
    points = np.exp(1j * omega * dt) if dt else 1j * omega
    apart = np.abs(points[:, None] - poles).min(axis=1, initial=np.inf)
    kept: RealArray = omega[apart > POLE_DISTANCE * np.abs(points)]
    return kept


def _system(copy: StandardPlant, dt: float) -> GeneralisedPlant:
    matrices = (copy.A, copy.B, copy.C, copy.D)
    system = realisation(to_sampled(matrices) if dt else matrices, dt)
    return GeneralisedPlant(system, None, copy.controls, copy.measurements)


def _absorbed(
    plant: StandardPlant, dt: float, through: str
) -> tuple[StandardPlant, StandardPlant | None, tuple[complex, ...]]:
    """A continuous plant whose measurements show every mode on the axis, the copy, its poles.

    `dt` is that of the given plant and `through` what is transposed, both for messages.
    """
    rate = speed(plant.A, plant.B, plant.C)
    root = np.sqrt(rate)
    A, B, C = balanced(plant.A / rate, plant.B / root, plant.C / root)
    scaled = replace(plant, A=A, B=B, C=C)
    V = _hidden_axis_modes(scaled, rate, dt, through)
    if not V.shape[1]:
        return plant, None, ()
    Lambda = V.T @ A @ V
    poles = tuple(_place(pole * rate, dt) for pole in np.linalg.eigvals(Lambda).astype(complex))
    found = _driven(scaled, V)
    if found is None:
        raise HiddenModeError(_refusal(through, poles[0], dt))
    W, T, L, M = found
    # Only the part that y and u reach leaves 0.
    R = _orthogonal(_unobservable(Lambda.T, np.hstack([L, M]).T), len(Lambda))
    V_r, Lambda, L, M = V @ R, R.T @ Lambda @ R, R.T @ L, R.T @ M
    q, x = len(Lambda), W.shape[1]
    C1 = np.hstack([scaled.C1 @ V_r, scaled.C1 @ W - scaled.C1 @ V @ T])
    if _unobservable(Lambda.T, L.T).shape[1]:
        raise HiddenModeError(_refusal(through, poles[0], dt))
    Lambda, columns, C_r = balanced(Lambda, np.hstack([L, M]), C1[:, :q])
    L, M = columns[:, : L.shape[1]], columns[:, L.shape[1] :]
    C1 = np.hstack([C_r, C1[:, q:]])
    F = L.T @ solve_continuous_are(Lambda, L, np.eye(q), np.eye(L.shape[1]))
    C2, D21, D22 = scaled.C2 @ W, plant.D21, plant.D22
    states = np.block([[Lambda, L @ C2], [np.zeros((x, q)), W.T @ A @ W]])
    entering = np.block([[L @ D21, L @ D22 + M], [W.T @ scaled.B1, W.T @ scaled.B2]])
    leaving = np.block([[C1], [F, C2]])
    shown = replace(plant, A=rate * states, B=root * entering, C=root * leaving)
    p, m = L.shape[1], M.shape[1]
    copy = StandardPlant(
        rate * Lambda,
        root * np.hstack([L, M]),
        root * np.vstack([np.zeros((m, q)), F]),
        np.block([[np.zeros((m, p)), np.eye(m)], [np.eye(p), np.zeros((p, m))]]),
        m,
        p,
    )
    return shown, copy, poles


def _hidden_axis_modes(plant: StandardPlant, rate: float, dt: float, through: str) -> RealArray:
    """Orthonormal basis (n, q) of the modes on the axis that no measurement shows."""
    A = plant.A
    N = _unobservable(A, plant.C2)
    if not N.shape[1]:
        return N
    hidden = N.T @ A @ N
    Q, T, k = integrators_first(hidden, axis_rounding(hidden))
    rest = T[k:, k:]

    def beyond(real: float, imag: float = 0.0) -> bool:
        return real >= -AXIS_SHARE * abs(complex(real, imag)) - axis_rounding(hidden)

    if len(rest):
        _, turn, more = schur(rest, sort=beyond)
        Q[:, k:] = Q[:, k:] @ turn
        k += more
    V: RealArray = N @ Q[:, :k]
    for mode in np.linalg.eigvals((V.T @ A @ V)[len(T) - len(rest) :, len(T) - len(rest) :]):
        if mode.real > AXIS_SHARE * abs(mode) + axis_rounding(hidden):
            where = _place(complex(mode) * rate, dt)
            raise HiddenModeError(
                f"{_fails(through)} the unstable mode {_said(where, dt)}; weights must be stable, "
                "but for poles on the stability boundary"
            )
    return V


def _driven(
    plant: StandardPlant, V: RealArray
) -> tuple[RealArray, RealArray, RealArray, RealArray] | None:
    """W, T, L, M for which V^T x + T W^T x is driven by L y + M u; None where there are none.

    W is an orthonormal basis of the other states.
    """
    W = _orthogonal(V, plant.states)
    Lambda, across, inner = V.T @ plant.A @ V, V.T @ plant.A @ W, W.T @ plant.A @ W
    q, x = V.shape[1], W.shape[1]
    wanted = np.hstack([across, V.T @ plant.B1])
    shown = np.hstack([plant.C2 @ W, plant.D21])
    size = np.linalg.norm(wanted) + np.linalg.norm(Lambda)
    # The simplest first: the mode itself is driven by measurements.
    T = np.zeros((q, x))
    L = np.linalg.lstsq(shown.T, wanted.T, rcond=HIDDEN_SHARE)[0].T
    if not np.linalg.norm(wanted - L @ shown) <= DRIVEN_SHARE * size:
        turned = np.hstack([inner, W.T @ plant.B1])
        kept = np.hstack([np.eye(x), np.zeros((x, plant.B1.shape[1]))])
        # wanted + T turned - Lambda T kept = L shown, in rows stacked one after another.
        one = np.eye(q)
        columns = np.hstack(
            [np.kron(one, shown.T), np.kron(Lambda, kept.T) - np.kron(one, turned.T)]
        )
        solution = np.linalg.lstsq(columns, wanted.ravel(), rcond=HIDDEN_SHARE)[0]
        L, T = solution[: q * len(shown)].reshape(q, -1), solution[q * len(shown) :].reshape(q, x)
        missed = wanted + T @ turned - Lambda @ T @ kept - L @ shown
        if not np.linalg.norm(missed) <= DRIVEN_SHARE * (size + np.linalg.norm(T)):
            return None
    L = np.where(np.abs(L) * np.linalg.norm(shown, axis=1) > DRIVEN_SHARE * size, L, 0.0)
    M = np.asarray(V.T @ plant.B2 + T @ W.T @ plant.B2 - L @ plant.D22)
    M[np.abs(M) <= DRIVEN_SHARE * np.linalg.norm(plant.B2)] = 0.0
    return W, T, L, M


def _unobservable(A: RealArray, C: RealArray) -> RealArray:
    """Orthonormal basis (n, k) of the states that C exp(A t) does not show."""
    size = max(float(np.linalg.norm(A)), float(np.linalg.norm(C)))
    N = np.eye(len(A))
    shown = C
    while N.shape[1]:
        kept = _null(shown @ N, HIDDEN_SHARE * size)
        if kept.shape[1] == N.shape[1]:
            return N
        N = N @ kept
        shown = A - N @ (N.T @ A)  # what leaves the space of N
    return N


def _null(M: RealArray, small: float) -> RealArray:
    """Orthonormal basis of what M takes to 0; unit vectors where it is spanned by such."""
    zero = np.abs(M).max(axis=0, initial=0.0) <= small
    _, values, Vh = np.linalg.svd(M)
    rank = int((values > small).sum())
    if int(zero.sum()) == M.shape[1] - rank:
        return np.eye(M.shape[1])[:, zero]
    return np.asarray(Vh[rank:].T)


def _orthogonal(V: RealArray, n: int) -> RealArray:
    """Orthonormal basis of what is orthogonal to the columns of V (n, k)."""
    return null_space(V.T) if V.shape[1] else np.eye(n)


def _place(pole: complex, dt: float) -> complex:
    """A pole of the transformed plant, in the plane of the given one."""
    return complex((1 + pole) / (1 - pole)) if dt else complex(pole)


def _said(pole: complex, dt: float) -> str:
    return f"z = {pole:.6g}" if dt else f"{pole:.6g} rad/s"


def _fails(through: str) -> str:
    if through == "measurement":
        return "(C2, A) is not detectable: no measurement shows"
    return "(A, B2) is not stabilisable: no control reaches"


def _refusal(through: str, pole: complex, dt: float) -> str:
    if through == "measurement":
        why = (
            "no measurement drives it alone, so no controller can hold it in place of a weight: "
            "weigh a signal that is measured, or move the pole to the left"
        )
    else:
        why = (
            "its effect is not that of a control, so no controller can hold it in place of a "
            "weight: move the pole to the left"
        )
    return f"{_fails(through)} the mode {_said(pole, dt)}, and {why}"

"""Realisations: their matrices, and python-control's StateSpace built from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import EPS, Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.systems.axis_poles import integrators_first, pole_may_be_at
from workbench.systems.balancing import axis_rounding, balancing, state_units

Matrices = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D of a realisation."""


NEAR_BOUNDARY = 1e-6
"""A pole may be on the boundary of stability if its distance from it, relative to its size, is
below this.
"""


def matrices_of(system: StateSpace) -> Matrices:
    """A, B, C and D in doubles."""
    A, B, C, D = (np.asarray(getattr(system, part), dtype=float) for part in "ABCD")
    return A, B, C, D


def pole_sizes(system: StateSpace) -> RealArray:
    """Sizes of the poles [rad/s]; for a sampled system those of log(z) / T, without poles at 0."""
    return root_sizes(system.poles(), system.dt)


def root_sizes(roots: Array, dt: Any) -> RealArray:
    """Sizes [rad/s] of poles or zeros of a system with this ``dt``, as `pole_sizes`."""
    if not dt:
        return np.abs(roots)
    used = roots[np.abs(roots) > 0].astype(complex)
    sizes: RealArray = np.abs(np.log(used)) / (1.0 if dt is True else dt)
    return sizes


def worst_pole(system: StateSpace) -> tuple[complex, float]:
    """The pole farthest right (sampled: farthest out), and how far it is beyond the boundary.

    The distance is not negative if the system is unstable; minus infinity for a system without
    states.
    """
    poles = system.poles()
    if not poles.size:
        return complex(-np.inf), -np.inf
    beyond = np.abs(poles) - 1.0 if system.dt else poles.real
    place = int(np.argmax(beyond))
    return complex(poles[place]), float(beyond[place])


def in_words(system: StateSpace) -> str:
    """Order of a system, whether it is stable by itself, and its fastest pole, in words.

    Integrators and undamped poles are named, and not counted as unstable.
    """
    size = pole_sizes(system)
    fastest = f", fastest pole {size.max():.4g} rad/s" if size.max(initial=0.0) > 0 else ""
    return f"order {system.nstates}, {_stability_in_words(system)}{fastest}"


def _stability_in_words(system: StateSpace) -> str:
    """Whether a system is stable by itself, apart from poles on the boundary, which are named."""
    count, undamped, rest = _boundary_poles(system)
    state = "stable" if (rest < 0).all() else "UNSTABLE"
    named = ["an integrator" if count == 1 else f"{count} integrators"] if count else []
    named += [f"undamped poles at {size:.4g} rad/s" for size in undamped]
    if not named:
        return f"{state} itself"
    return f"with {' and '.join(named)}{f', {state} otherwise' if len(rest) else ''}"


def _boundary_poles(system: StateSpace) -> tuple[int, list[float], RealArray]:
    """Poles on the boundary of stability, up to rounding, and the distances of the others beyond
    it.

    The number of integrators, the sizes of undamped pairs [rad/s], and distances (r,).
    """
    A, poles, at_rest = np.asarray(system.A, dtype=float), system.poles(), float(bool(system.dt))
    poles = poles[np.argsort(np.abs(poles - at_rest))]
    count = _integrators(system, at_rest)
    poles = poles[count:]
    boundary = poles / np.maximum(np.abs(poles), EPS) if system.dt else 1j * poles.imag
    near = np.abs(poles - boundary) <= NEAR_BOUNDARY * np.abs(poles)
    on = np.array([k for k in np.flatnonzero(near) if pole_may_be_at(complex(boundary[k]), A)], int)
    sizes = root_sizes(boundary[on[poles[on].imag >= 0]], system.dt)
    rest = np.delete(poles, on)
    beyond: RealArray = np.abs(rest) - 1.0 if system.dt else rest.real
    return count, sizes.tolist(), beyond


def _integrators(system: StateSpace, at_rest: float) -> int:
    """Number of poles at 0 (sampled: 1), up to rounding."""
    A = np.asarray(system.A, dtype=float)
    units = state_units(A, system.B, system.C)
    moved = A * units[:, None] / units
    small = axis_rounding(moved - at_rest * np.eye(len(A)))
    return integrators_first(moved, small, (at_rest,))[2]


def realisation(matrices: Matrices, dt: float | None, **labels: Any) -> StateSpace:
    """A StateSpace with these matrices (A, B, C, D) and all states.

    ``dt`` is its sampling time [s], 0 for continuous time. ``inputs``, ``outputs`` and ``states``
    name its signals, as in `control.ss`. Raises InputError for entries that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.systems import realisation
    >>> one = np.eye(1)
    >>> system = realisation((-one, one, one, 0.0 * one), 0.0, inputs=["u"], outputs=["y"])
    >>> system.nstates, system.input_labels
    (1, ['u'])
    """
    import control

    if not all(np.isfinite(part).all() for part in matrices):
        raise InputError(
            "a realisation has entries that are not finite: sizes in the system overflow doubles; "
            "measure its time or its signals in other units"
        )
    dt = dt if dt is None or dt is True else float(dt)
    return control.StateSpace(*matrices, dt, remove_useless_states=False, **labels)


def in_series(first: Matrices, second: Matrices) -> Matrices:
    """A signal passes the first system, then the second."""
    (A, B, C, D), (A2, B2, C2, D2) = first, second
    return (
        np.block([[A2, B2 @ C], [np.zeros((len(A), len(A2))), A]]),
        np.vstack([B2 @ D, B]),
        np.hstack([C2, D2 @ C]),
        D2 @ D,
    )


def in_parallel(*systems: Matrices) -> Matrices:
    """The sum of systems, with the states of each."""
    A, B, C, D = zip(*systems, strict=True)
    return block_diag(*A), np.vstack(B), np.hstack(C), sum(D[1:], D[0])


def side_by_side(systems: Sequence[Matrices], signals: int) -> Matrices:
    """Square systems side by side; further signals pass unchanged."""
    A, B, C, D = (block_diag(*parts) for parts in zip(*systems, strict=True))
    rest = signals - len(D)
    return (
        A,
        np.hstack([B, np.zeros((len(A), rest))]),
        np.vstack([C, np.zeros((rest, len(A)))]),
        block_diag(D, np.eye(rest)),
    )


def transposed_system(system: StateSpace) -> StateSpace:
    """The system with the transposed transfer matrix, with every state kept."""
    A, B, C, D = system.A, system.B, system.C, system.D
    return realisation((A.T, C.T, B.T, D.T), float(system.dt or 0.0))


def modal_form(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """A realisation whose blocks [s w; -w s] are the resonances, slow ones first, each C = [1 0].

    A (n, n), B (n, m), C (1, n) with complex poles only, each of them simple and observable. The
    states of similar plants then have the same meaning, the contribution of each resonance to the
    output, so that one function of the state can serve all of them. Raises InputError for a real
    pole and for more than one output.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.systems import modal_form
    >>> A, B, C = modal_form(np.array([[0.0, 1.0], [-4.0, -0.4]]), np.eye(2)[:, 1:], np.eye(2)[:1])
    >>> A.round(2).tolist(), C.round(6).tolist()
    ([[-0.2, 1.99], [-1.99, -0.2]], [[1.0, 0.0]])
    """
    poles, vectors = np.linalg.eig(A)
    up = [i for i in np.argsort(abs(poles)) if poles[i].imag > 0]
    if 2 * len(up) != len(A) or C.shape != (1, len(A)):
        raise InputError(f"poles {poles}, C of shape {C.shape}: need complex poles, one output")
    T = np.zeros_like(A)
    for place, i in enumerate(up):
        v = vectors[:, i] / (C @ vectors[:, i])
        T[:, 2 * place], T[:, 2 * place + 1] = v.real, v.imag
    into = np.linalg.inv(T)
    return into @ A @ T, into @ B, C @ T


def companion(system: Any) -> tuple[Array, int]:
    """[A B; C D] of a SISO transfer function with all its poles, and their number.

    Poles at 0 are exact: they are zeros at the end of the denominator.

    Raises InputError for an improper one.
    """
    num, den = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
    n = len(den) - 1
    if len(num) > n + 1:
        raise InputError(
            f"the transfer function is improper: its numerator has degree {len(num) - 1} and its "
            f"denominator {n}; add a filter, such as 1 / (T s + 1) with a short T, or multiply it "
            "with its neighbour first if their product is proper: plant * controller"
        )
    num = np.concatenate([np.zeros(n + 1 - len(num)), num]) / den[0]
    den = den / den[0]
    M = np.eye(n + 1, k=-1)
    M[0] = [*-den[1:], 1.0]
    M[n] = [*(num[1:] - num[0] * den[1:]), num[0]]
    rows, columns = balancing(M, n)
    rows[n:] = columns[n:] = 1.0
    return M * (rows[:, None] * columns), n


def with_all_poles(system: Any) -> StateSpace:
    """A StateSpace or TransferFunction as a new StateSpace, with the names of its signals.

    A transfer function of one input and output keeps all its poles, those at 0 exactly:
    python-control's realisation moves these by rounding, takes coefficients below 1e-14 for 0 in
    any unit of time, and leaves out poles that zeros cancel. Raises InputError for an improper one.
    """
    import control

    if not isinstance(system, control.TransferFunction) or not system.issiso():
        return control.ss(system)
    M, n = companion(system)
    parts = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    return realisation(parts, system.dt, **labels)

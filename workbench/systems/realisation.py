"""Realisations: their matrices, and python-control's StateSpace made of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.heavy_types import StateSpace

Matrices = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D of a realisation."""


def pole_sizes(system: StateSpace) -> RealArray:
    """Sizes of the poles [rad/s]; of a sampled system those of log(z) / T, without poles at 0."""
    return root_sizes(system.poles(), system.dt)


def root_sizes(roots: Array, dt: Any) -> RealArray:
    """Sizes [rad/s] of poles or zeros of a system with this ``dt``, as `pole_sizes`."""
    if not dt:
        return np.abs(roots)
    used = roots[np.abs(roots) > 0].astype(complex)
    sizes: RealArray = np.abs(np.log(used)) / (1.0 if dt is True else dt)
    return sizes


def worst_pole(system: StateSpace) -> tuple[complex, float]:
    """The pole farthest right, of a sampled system farthest out, and how far beyond the boundary.

    Not negative where the system is unstable; minus infinity for one without states.
    """
    poles = system.poles()
    if not poles.size:
        return complex(-np.inf), -np.inf
    beyond = np.abs(poles) - 1.0 if system.dt else poles.real
    place = int(np.argmax(beyond))
    return complex(poles[place]), float(beyond[place])


def in_words(system: StateSpace) -> str:
    """Order of a system, whether it is stable itself, and its fastest pole, for people."""
    stable, size = worst_pole(system)[1] < 0, pole_sizes(system)
    fastest = f", fastest pole {size.max():.4g} rad/s" if size.size else ""
    return f"order {system.nstates}, {'stable' if stable else 'UNSTABLE'} itself{fastest}"


def realisation(matrices: Matrices, dt: float, **labels: Any) -> StateSpace:
    """A StateSpace of the matrices, with every state kept; `labels` name its signals."""
    import control

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


def side_by_side(systems: Sequence[Matrices], signals: int) -> Matrices:
    """Systems of one input and output side by side; the last of so many signals pass unchanged."""
    A, B, C, D = (block_diag(*parts) for parts in zip(*systems, strict=True))
    rest = signals - len(systems)
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

    A (n, n), B (n, m), C (1, n) with complex poles only, each of them once and seen by C. The
    states of similar plants then mean the same, what each resonance adds to the output, so that one
    function of the state can serve all of them. Raises InputError for a real pole and for more than
    one output.
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

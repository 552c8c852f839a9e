"""The sampled loop of a drive while surface defects switch its controller (chapter 8).

With w the disc's deviation, x the lens, both in um, and AAF the anti-aliasing filter,

    eps = k AAF (w - x)    measured error [units],   u = z + C_i f + D_i eps,   z' = a z + b_i eps.

z is the integrator, f the fast states of every controller and filter, which run all the time. Both
controllers have the same slow pole a: the integrator is handed over, so that u keeps its slow part.
While a defect passes, the strategy replaces what the controller K is in clean parts:

    open    the reference strategy of section 8.2: eps = 0 to K, whose states run on
    filter  figure 8.6 as the thesis has it: K (1 - F), F a first-order high-pass of 450 Hz
    lower   figure 8.6 designed as one: K' of `cd/<axis>/lower-bandwidth`
    none    K goes on

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.simulation import sampled
from workbench.synthesis import discretised

from ..diagnosis.stand_in import low_pass
from ..drive.actuator import specific_model
from ..drive.plants import ANTIALIASING
from ..drive.tables import ActuatorParameters
from ..laboratory.bench_setup import PERIOD

Strategy = Literal["none", "open", "filter", "lower"]
MICRO = 1e-6
SAME = 1e-6
"""Relative distance of two slow poles that count as one."""


def closed(G: StateSpace, K: StateSpace, delay: float) -> RealArray:
    """Transition over a sample of G behind a hold, and K in negative feedback."""
    P = sampled(G, PERIOD, delay)
    corner = P.A - P.B @ K.D @ P.C
    return np.block([[corner, P.B @ K.C], [-K.B @ P.C, K.A]])


@dataclass(frozen=True, eq=False)
class LensModel:
    """u [V] -> lens and lens behind the anti-aliasing filter [um], held and sampled.

    ``k`` [units/um] makes the measured error of the filtered one.
    """

    A: RealArray
    B: RealArray
    lens: RealArray
    filtered: RealArray
    k: float


def lens_model(
    parameters: ActuatorParameters, K_total: float, K_optn: float, delay: float
) -> LensModel:
    """Of a drive; K_optn [units/m], delay [samples]."""
    import control

    moving = specific_model(parameters).state_space()
    A4, B4, C4 = modal(moving.A, moving.B, K_total / (K_optn * MICRO) * moving.C)
    n = len(A4)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = A4
    A[n, :n], A[n, n] = ANTIALIASING * C4[0], -ANTIALIASING
    outputs = np.zeros((2, n + 1))
    outputs[0, :n], outputs[1, n] = C4[0], 1.0
    B = np.vstack([B4, [[0.0]]])
    P = sampled(control.ss(A, B, outputs, 0.0), PERIOD, delay)
    return LensModel(P.A, P.B, P.C[:1], P.C[1:], K_optn * MICRO)


def modal(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """A realisation whose blocks [s w; -w s] are the resonances, slow ones first, each C = [1 0].

    The states of different drives then mean the same, what each resonance moves the lens by, so
    that one function of the state can serve all of them.
    """
    poles, vectors = np.linalg.eig(A)
    up = [i for i in np.argsort(abs(poles)) if poles[i].imag > 0]
    T = np.zeros_like(A)
    for place, i in enumerate(up):
        v = vectors[:, i] / (C @ vectors[:, i])
        T[:, 2 * place], T[:, 2 * place + 1] = v.real, v.imag
    into = np.linalg.inv(T)
    return into @ A @ T, into @ B, C @ T


@dataclass(frozen=True, eq=False)
class Regulator:
    """States z, f [V, units] of all controllers, and how eps and they make u in one mode."""

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray


@dataclass(frozen=True, eq=False)
class SwitchedLoop:
    """Both modes of a drive's loop: x[k+1] = A_i x[k] + B_i AAF w[k], error w - lens x."""

    clean: tuple[RealArray, RealArray]
    defect: tuple[RealArray, RealArray]
    lens: RealArray


def parted(K: StateSpace) -> tuple[float, float, RealArray, RealArray, RealArray, float]:
    """a, b of the slow state with gain 1 to u, and A, B, C of the fast ones, and D.

    Raises InputError where the slowest pole is not real and parted from the others.
    """
    A = K.A
    slow = int(np.argmin(abs(np.diag(A) - 1.0)))
    fast = [i for i in range(len(A)) if i != slow]
    if abs(A[slow, fast]).max(initial=0.0) + abs(A[fast, slow]).max(initial=0.0) > 0.0:
        raise InputError("the controller's slowest pole is not parted from its others")
    gain = float(K.C[0, slow])
    inner = A[np.ix_(fast, fast)]
    return (
        float(A[slow, slow]), gain * float(K.B[slow, 0]), inner, K.B[fast], K.C[:, fast],
        float(K.D[0, 0]),
    )  # fmt: skip


def regulators(
    K: StateSpace, strategy: Strategy, lower: StateSpace | None = None
) -> tuple[Regulator, Regulator]:
    """In clean parts and during defects; continuous K, and K' for strategy "lower".

    Raises InputError for another strategy, a missing K', and one with another slow pole than K.
    """
    a, b, A, B, C, D = parted(discretised(K, PERIOD))
    one = np.array([[1.0]])
    whole, enter = block_diag(a, A), np.vstack([[[b]], B])
    alone = Regulator(whole, enter, np.hstack([one, C]), np.array([[D]]))
    if strategy == "none":
        return alone, alone
    if strategy == "open":
        return alone, Regulator(whole, 0 * enter, alone.C, 0 * alone.D)
    if strategy == "filter":
        F = discretised(low_pass(), PERIOD)
        both = block_diag(whole, F.A)
        wide = np.hstack([alone.C, [[0.0]]])
        clean = Regulator(both, np.vstack([enter, F.B]), wide, alone.D)
        fed = both.copy()
        fed[:-1, -1:] = enter @ F.C
        return clean, Regulator(
            fed,
            np.vstack([enter @ F.D, F.B]),
            np.hstack([alone.C, alone.D @ F.C]),
            alone.D @ F.D,
        )
    if strategy != "lower":
        raise InputError(f'strategy is {strategy!r}; it must be "none", "open", "filter", "lower"')
    if lower is None:
        raise InputError('strategy "lower" needs a controller K\'; none is given')
    a2, b2, A2, B2, C2, D2 = parted(discretised(lower, PERIOD))
    if abs(a2 - a) > SAME * abs(1 - a) + 1e-15:
        raise InputError(
            f"K and K' have slow poles {a:.12g} and {a2:.12g}; the integrator can only be handed "
            "over if they are the same"
        )
    both = block_diag(whole, A2)
    none_1, none_2 = np.zeros_like(C), np.zeros_like(C2)
    clean = Regulator(both, np.vstack([enter, B2]), np.hstack([one, C, none_2]), alone.D)
    slow = np.vstack([[[b2]], B, B2])
    return clean, Regulator(both, slow, np.hstack([one, none_1, C2]), np.array([[D2]]))


def switched(model: LensModel, modes: tuple[Regulator, Regulator]) -> SwitchedLoop:
    """The loop of a drive with what switches in it."""
    clean, defect = ((transition(model, mode), entering(model, mode)) for mode in modes)
    lens = np.hstack([model.lens, np.zeros((1, len(modes[0].A)))])
    return SwitchedLoop(clean, defect, lens)


def transition(model: LensModel, mode: Regulator) -> RealArray:
    """A of the loop."""
    read = model.k * model.filtered
    return np.block(
        [[model.A - model.B @ mode.D @ read, model.B @ mode.C], [-mode.B @ read, mode.A]]
    )


def entering(model: LensModel, mode: Regulator) -> RealArray:
    """B of the loop, from the disc's deviation behind the filter [um]."""
    return model.k * np.vstack([model.B @ mode.D, mode.B])


def filtered(omega: RealArray) -> ComplexArray:
    """Response of the anti-aliasing filter at omega [rad/s]."""
    return np.asarray(ANTIALIASING / (1j * omega + ANTIALIASING))

"""Loop shaping: the controller with the largest margin against normalised coprime factor
uncertainty.

D. McFarlane, K. Glover, A loop shaping design procedure using H-infinity synthesis, IEEE Trans.
Automatic Control 37 (1992) 759-769; K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control
(1996), chapter 18.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import LinAlgError, solve_continuous_are, solve_continuous_lyapunov

from workbench._core.heavy_types import StateSpace
from workbench.certificate import EVERY_FREQUENCY, Check
from workbench.certify.norms import NORM_TOLERANCE
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import is_real, need_sampling_time
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.h_infinity.levels import LARGEST_LEVEL
from workbench.synthesis.h_infinity.methods import LEVEL_ACCURACY, distance
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.synthesis.h_infinity.settling import Made, claimed
from workbench.systems.balancing import balanced
from workbench.systems.bilinear import continuous
from workbench.systems.conversion import as_system, as_weight
from workbench.systems.equations.riccati import (
    ScaledStates,
    hamiltonian_solution,
    scaled_realisation,
)
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible_matrices
from workbench.systems.interconnection import common_dt, named_realisation
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices, matrices_of, realisation
from workbench.systems.standard_plant import standard_plant

HANKEL_ROUNDING = 1e6
"""Rounding error of the squared Hankel norm, in units of the machine epsilon."""


@dataclass(frozen=True, eq=False, init=False, kw_only=True)
class LoopShaping(HinfSynthesis):
    """The K with the largest stability margin of the shaped plant G_s = W2 G W1.

    The answer is K_inf for G_s: it minimises the norm of [K; 1] (1 + G_s K)^-1 [1 G_s] with
    negative feedback u = -K y. The loop tolerates perturbations of the normalised coprime factors
    of G_s up to the size epsilon = 1 / norm. `controller` gives K = W1 K_inf W2 for G (E. Vidal
    Sanchez, Robust and Fault Tolerant Control of CD-players (2003), eq. 5.7).

    Parameters
    ----------
    nominal
        StateSpace or TransferFunction.
    W1, W2
        Weights at the input and at the output of G: systems or numbers. A weight with a single
        channel acts on every channel.
    gamma
        As in `HinfSynthesis`.

    Raises
    ------
    InputError
        As in `HinfSynthesis`; or a weight does not fit.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import LoopShaping
    >>> program = LoopShaping(control.tf([1.0], [1.0, 0.0]))
    >>> solution = wb.solve(program)
    >>> solution.certificate.holds, round(solution.answer.norm**2, 2)  # of an integrator: 2
    (True, 2.0)
    """

    nominal: StateSpace
    W1: StateSpace
    W2: StateSpace
    shaped: StateSpace

    default_method: ClassVar[str] = "coprime"
    headline: ClassVar[str] = "epsilon"

    def __init__(
        self, nominal: Any, *, W1: Any = 1.0, W2: Any = 1.0, gamma: float | None = None
    ) -> None:
        nominal = as_system(nominal, "nominal")
        W2 = as_weight(W2, nominal.noutputs, "W2")
        W1 = as_weight(W1, nominal.ninputs, "W1") if is_real(W1) else as_system(W1, "W1")
        if (W1.ninputs, W1.noutputs) == (1, 1) and nominal.ninputs > 1:
            W1 = as_weight(W1, nominal.ninputs, "W1")
        if W1.noutputs != nominal.ninputs:
            raise InputError(f"W1 has {W1.noutputs} outputs; G has {nominal.ninputs} inputs")
        dt = common_dt([named_realisation(one) for one in (W2, nominal, W1)])
        need_sampling_time(dt, "nominal")
        shaped = W2 * nominal * W1
        parts = [np.asarray(getattr(shaped, name), dtype=float) for name in "ABCD"]
        A, B, C = visible_matrices(*balanced(*parts[:3]), dt or 0.0)
        shaped = realisation((A, B, C, parts[3]), dt or 0.0)
        fields = {"nominal": nominal, "W1": W1, "W2": W2, "shaped": shaped, "gamma": gamma}
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "plant", _four_blocks(shaped))
        self.__post_init__()

    def controller(self, answer: HinfController) -> StateSpace:
        """K = W1 K_inf W2 for the loop of G with negative feedback."""
        import control

        whole = self.W1 * answer.K * self.W2
        return control.ss(
            whole, inputs=self.nominal.output_labels, outputs=self.nominal.input_labels
        )

    def witnessed(self, answer: HinfController) -> HinfController:
        """The answer with the controller for the loop of G."""
        return replace(answer, whole=self.controller(answer))

    @cached_property
    def scaled_states(self) -> ScaledStates:
        """The shaped plant in continuous time, with time and states in units of its own."""
        return scaled_realisation(matrices_of(self.shaped), sampled=bool(self.shaped.dt))

    @cached_property
    def epsilon_max(self) -> float:
        """The largest margin sqrt(1 - |[N M]|_H^2), where |.|_H is the Hankel norm and N, M are
        normalised left coprime factors.

        It is computed from Lyapunov equations of the factors, which no method uses.
        """
        if not self.shaped.nstates:
            return 1.0
        A, B, C, D = self.scaled_states.matrices
        R = np.eye(len(D)) + D @ D.T
        # The generalised filter Riccati equation with its cross term.
        Z = solve_continuous_are(A.T, C.T, B @ B.T, R, s=B @ D.T)
        H = -np.linalg.solve(R, (Z @ C.T + B @ D.T).T).T
        root = np.linalg.cholesky(R)
        stable, entering = A + H @ C, np.hstack([B + H @ D, H])
        leaving = np.linalg.solve(root, C)
        with warnings.catch_warnings():  # the margin is lost in rounding; a check then shows this
            warnings.simplefilter("ignore", RuntimeWarning)
            P = solve_continuous_lyapunov(stable, -entering @ entering.T)
            Q = solve_continuous_lyapunov(stable.T, -leaving.T @ leaving)
        hankel = float(np.abs(np.linalg.eigvals(P @ Q)).max())
        return math.sqrt(max(1.0 - hankel, 0.0))

    def objective_scale(self, answer: HinfController) -> float:
        """The least norm, 1 / epsilon_max; infinite if the margin is lost in rounding."""
        return 1.0 / self.epsilon_max if self.epsilon_max > 0.0 else math.inf

    def checks(self, answer: HinfController, tolerance: float) -> list[Check]:
        found = super().checks(answer, tolerance)
        statement = "epsilon = 1 / norm over epsilon_max by the Hankel norm, less 1"
        largest = self.epsilon_max
        if not largest > 0.0:
            lost = Check("epsilon", statement, math.inf, 0.0, where="(lost in rounding)")
            return [*found, replace(lost, over=EVERY_FREQUENCY)]
        excess = 1.0 / (answer.norm * largest) - 1.0
        # A small margin is the difference of two numbers near 1.
        rounding = HANKEL_ROUNDING * np.finfo(float).eps / largest**2
        limit = 2.0 * NORM_TOLERANCE + rounding
        return [*found, Check("epsilon", statement, excess, limit, over=EVERY_FREQUENCY)]

    def gap(self, answer: HinfController) -> tuple[str, float]:
        return (
            "norm over 1 / epsilon_max by the Hankel norm, less 1",
            answer.norm * self.epsilon_max - 1.0,
        )

    def metrics(self, answer: HinfController) -> dict[str, float]:
        margins = {"epsilon": 1.0 / answer.norm, "epsilon_max": self.epsilon_max}
        return super().metrics(answer) | margins


def _four_blocks(G: StateSpace) -> GeneralisedPlant:
    """The plant (w_y, w_u, u) -> (u, y, -y) with y = w_y + G (u + w_u)."""
    m, p = G.ninputs, G.noutputs
    zero = np.zeros((G.nstates, p))
    direct = np.hstack([np.eye(p), G.D, G.D])
    D = np.vstack([np.hstack([np.zeros((m, p + m)), np.eye(m)]), direct, -direct])
    C = np.vstack([np.zeros((m, G.nstates)), G.C, -G.C])
    matrices = (G.A, np.hstack([zero, G.B, G.B]), C, D)
    dt = float(G.dt or 0.0)
    return GeneralisedPlant(realisation(matrices, dt), None, m, p)


@method(LoopShaping, "coprime", optimal=False, accuracy=LEVEL_ACCURACY)
def _coprime_riccati(program: LoopShaping, context: Context) -> Claim:
    """Two Riccati equations of G_s give the least level in closed form; K is made 1e-3 above it."""
    G, rate, _ = program.scaled_states
    found = _coprime_solutions(G)
    if found is None:
        return None, Outcome.FAILED, "a Riccati equation has no stabilising solution, numerically"
    X, Z = found
    least = math.sqrt(1.0 + float(np.abs(np.linalg.eigvals(X @ Z)).max(initial=0.0)))
    said = f"least level {least:.9g}"
    gamma = min(program.gamma or least * (1.0 + distance(context)), LARGEST_LEVEL)
    if gamma <= least:
        return None, Outcome.INFEASIBLE, f"no controller is below gamma = {gamma:.6g}: {said}"
    try:
        Ak, Bk, Ck, Dk = _central(G, X, Z, gamma)
    except LinAlgError as error:
        return None, Outcome.FAILED, f"{said}; {error}"
    root = math.sqrt(rate)
    K = rate * Ak, -root * Bk, root * Ck, -Dk  # negative feedback
    size = hinf_norm(continuous(standard_plant(program.plant)).close(K))
    return claimed(program, Made(K, size, gamma, said=said))


def _coprime_solutions(G: Matrices) -> tuple[np.ndarray, np.ndarray] | None:
    """X and Z of the normalised right and left coprime factors; None if they do not exist."""
    A, B, C, D = G
    S, R = np.eye(D.shape[1]) + D.T @ D, np.eye(len(D)) + D @ D.T
    corner = A - B @ np.linalg.solve(S, D.T @ C)
    inward, outward = B @ np.linalg.solve(S, B.T), C.T @ np.linalg.solve(R, C)
    X = hamiltonian_solution(np.block([[corner, -inward], [-outward, -corner.T]]))
    Z = hamiltonian_solution(np.block([[corner.T, -outward], [-inward, -corner]]))
    return None if X is None or Z is None else (X, Z)


def _central(G: Matrices, X: np.ndarray, Z: np.ndarray, gamma: float) -> Matrices:
    """The central controller for a level, u = K y with positive feedback."""
    A, B, C, D = G
    F = -np.linalg.solve(np.eye(D.shape[1]) + D.T @ D, D.T @ C + B.T @ X)
    L = (1.0 - gamma**2) * np.eye(len(A)) + X @ Z
    gain = gamma**2 * np.linalg.solve(L.T, Z @ C.T)
    return A + B @ F + gain @ (C + D @ F), gain, B.T @ X, -D.T

"""Lower bounds on the H-infinity norm that no controller can beat, from known disturbances.

Let a decaying disturbance w be completely known in advance. The least energy of z over all controls
u is then a linear-quadratic problem. The square root of this energy over the norm of w is at most
the norm of any stabilised loop, whatever the controller measures. Let w be the output of an
autonomous system x_g' = A_g x_g, w = C_g x_g. Then both energies are quadratic in x_g(0), and the
best bound over all such w is an eigenvalue. The bound is close to the least norm where the
measurement determines w.

J. C. Willems, Least squares stationary optimal control and the algebraic Riccati equation, IEEE
Trans. Automatic Control 16 (1971) 621-634.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, solve_continuous_are

from workbench._core.arrays import RealArray
from workbench.answer import REPEATED_ROUNDING, Answer
from workbench.certificate import Check, Checker, relative_excess
from workbench.errors import InputError, SolverError
from workbench.second_opinion import energies
from workbench.second_opinion.loops import SAMPLED_ROUNDING
from workbench.synthesis.h_infinity.normalised import has_rank, rank_advice
from workbench.systems.balancing import balanced
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import standard_plant

BOUND_LOWERING = 1e-6
"""Relative reduction of the bound that allows for rounding errors."""
DISSIPATION_TOLERANCE = 1e-9
"""The dissipation matrix counts as semidefinite if its least eigenvalue is above minus this share
of the largest.
"""


@dataclass(frozen=True, eq=False, repr=False)
class DisturbanceBound(Answer):
    """No stabilising K has a norm of F_l(P, K) below ``lower``.

    ``disturbance`` (exogenous, m) holds the coefficients of the orthonormal signals of
    `exponentials`. Its norm is 1. Even a controller that knows it in advance leaves z with at least
    the norm ``lower``.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import known_disturbance_bound
    >>> from workbench.uncertainty import GeneralisedPlant
    >>> P = control.ss(-1.0, [[1.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0], [0, 1], [0, 0]])
    >>> found = known_disturbance_bound(GeneralisedPlant(P, None, 1, 1), [0.5, 1.0])
    >>> found.holds, found.disturbance.shape
    (True, (1, 2))
    """

    lower: float
    disturbance: RealArray

    @property
    def value(self) -> float:
        """The bound ``lower``."""
        return self.lower

    def summary(self) -> str:
        return f"DisturbanceBound: no controller has a norm below {self.lower:.6g}"


@dataclass(frozen=True, eq=False)
class DisturbanceChecker(Checker):
    """Checks a `DisturbanceBound`: computes the bound again from the plant and the rates."""

    plant: GeneralisedPlant
    rates: RealArray

    @property
    def quantifier(self) -> str:
        return "for every stabilising controller"

    def checks(self, answer: DisturbanceBound, tolerance: float) -> list[Check]:
        again = _proven_bound(self.plant, self.rates).lower
        statement = "by which share the claimed bound is larger than the one computed again"
        return [Check("lower", statement, relative_excess(answer.lower, again), REPEATED_ROUNDING)]

    def second_opinion(self, answer: DisturbanceBound) -> list[Check]:
        """Compute the least energy of z for the disturbance by dynamic programming over samples."""
        given, rates = standard_plant(self.plant), np.unique(self.rates)
        start = answer.disturbance
        q, n = len(start), len(given.A)
        decay, seen = (np.kron(np.eye(q), part) for part in exponentials(rates))
        joint = np.block([[given.A, given.B1 @ seen], [np.zeros((len(decay), n)), decay]])
        into = np.vstack([given.B2, np.zeros((len(decay), given.B2.shape[1]))])
        whole = joint, into, np.hstack([given.C1, given.D11 @ seen]), given.D12
        poles = np.abs(np.linalg.eigvals(joint))
        rate = energies.UNIT * math.sqrt(float(rates[0] * max(poles.max(), rates[-1])))
        X = energies.least_energy(energies.in_samples(realisation(whole, 0.0), rate))
        if X is None:
            return []
        state = np.concatenate([np.zeros(n), start.ravel()])
        left = math.sqrt(max(float(state @ X @ state), 0.0)) / float(np.linalg.norm(start))
        statement = "claimed bound over the least norm that its disturbance leaves, less 1"
        value = relative_excess(answer.lower, left)
        return [Check("energy in samples", statement, value, SAMPLED_ROUNDING)]


def known_disturbance_bound(plant: GeneralisedPlant, rates: ArrayLike) -> DisturbanceBound:
    """A lower bound on the norm of F_l(P, K) over all stabilising K, and its disturbance.

    Parameters
    ----------
    plant
        Plant in continuous time; its perturbation channels count as exogenous and performance.
    rates
        Decay rates [rad/s] (m,) of the exponentials in the disturbance, positive and different.

    Returns
    -------
    DisturbanceBound
        Proven by a matrix that is positive semidefinite up to rounding.

    Raises
    ------
    InputError
        D12 (u -> z) does not have full column rank; the plant is sampled; or the rates are not
        positive, finite and different.
    SolverError
        The Riccati equation was not solved well enough to prove anything.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import hinf, known_disturbance_bound
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, -1.0])
    >>> plant = generalised_plant(
    ...     [(G, "v", "x")],
    ...     {"v": "u + d", "y": "x + n"},
    ...     exogenous=["d", "n"],
    ...     performance=["x", "u"],
    ...     control="u",
    ...     measurement="y",
    ... )
    >>> found = known_disturbance_bound(plant, [0.5, 1.0, 2.0])
    >>> bool(0 < found.lower < hinf(plant).norm), found.disturbance.shape
    (True, (2, 3))
    """
    found = _proven_bound(plant, rates)
    return found.with_checker(DisturbanceChecker(plant, np.array(rates, dtype=float)))


def _proven_bound(plant: GeneralisedPlant, rates: ArrayLike) -> DisturbanceBound:
    """The bound proven by the solution of the Riccati equation."""
    poles = np.unique(np.asarray(rates, dtype=float))
    if not (poles.size == np.size(rates) > 0 and (poles > 0).all() and np.isfinite(poles).all()):
        raise InputError("rates must be positive, finite and different [rad/s]")
    given = standard_plant(plant)
    if given.dt:
        raise InputError(f"the plant is sampled (dt = {given.dt} s); give it in continuous time")
    if not has_rank(given.D12):
        raise InputError(rank_advice("D12", given.D12))
    rate = math.sqrt(poles[0] * poles[-1])  # the unit of time
    root = math.sqrt(rate)
    B, C = np.hstack([given.B1, given.B2]), given.C1
    A, B, C = balanced(given.A / rate, B / root, C / root)
    D = np.hstack([given.D11, given.D12])
    q = given.D11.shape[1]
    # Transform u so that D12 has orthonormal columns.
    R = np.linalg.qr(D[:, q:])[1]
    B[:, q:], D[:, q:] = (np.linalg.solve(R.T, part[:, q:].T).T for part in (B, D))
    Ag, Cg = (np.kron(np.eye(q), part) for part in exponentials(poles / rate))
    n, m = len(A), len(Ag)
    joint = np.block([[A, B[:, :q] @ Cg], [np.zeros((m, n)), Ag]])
    into = np.vstack([B[:, q:], np.zeros((m, B.shape[1] - q))])
    out, direct = np.hstack([C, D[:, :q] @ Cg]), D[:, q:]
    try:
        X = solve_continuous_are(joint, into, out.T @ out, np.eye(into.shape[1]), s=out.T @ direct)
    except (LinAlgError, ValueError) as error:  # a reordering that fails is a ValueError
        raise SolverError(f"the Riccati equation has no solution, numerically: {error}") from None
    # d/dt x'Xx + |z|^2 >= 0 for every u: the energy of z is at least x(0)' X x(0).
    corner = X @ into + out.T @ direct
    dissipated = np.block(
        [[joint.T @ X + X @ joint + out.T @ out, corner], [corner.T, np.eye(into.shape[1])]]
    )
    ends = np.linalg.eigvalsh((dissipated + dissipated.T) / 2)[[0, -1]]
    if not ends[0] >= -DISSIPATION_TOLERANCE * ends[1]:
        raise SolverError(f"the Riccati equation is solved to {-ends[0] / ends[1]:.1e} only")
    values, vectors = np.linalg.eigh((X[n:, n:] + X[n:, n:].T) / 2)
    bound = math.sqrt(max(float(values[-1]), 0.0)) * (1.0 - BOUND_LOWERING)
    return DisturbanceBound(bound, vectors[:, -1].reshape(q, -1))


def exponentials(rates: RealArray) -> tuple[RealArray, RealArray]:
    """A (m, m) and C (1, m) whose responses to initial unit vectors are orthonormal signals.

    Since A + A^T = -C^T C, the energy of C exp(A t) c is |c|^2. Rates [rad/s] (m,), increasing.
    """
    size = np.sqrt(2.0 * rates)
    return -np.tril(np.outer(size, size), -1) - np.diag(rates), size[None]

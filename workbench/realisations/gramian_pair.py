"""Gramians of stable systems, each entry with a proven error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer
from workbench.certificate import THIS_SYSTEM, Check, Checker
from workbench.certify.realisations.lyapunov import (
    enclosed_gramian,
    rounded_gramian,
    stability_proof,
)
from workbench.errors import InputError
from workbench.realisations.stable_only import stable_states
from workbench.second_opinion.powers import SUM_ROUNDING, summed_gramians
from workbench.systems.balancing import balancing
from workbench.systems.realisation import matrices_of

BITS = (128, 256, 512, 1024)
"""Bits of the numbers, tried in turn until the error is that of rounding to doubles."""
CLAIMED_FACTOR = 2.0
"""Claimed errors are this multiple of the proven errors, which differ in their last bits between
processors, and at least this multiple of an entry's rounding.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Gramians(Answer):
    """Controllability and observability Gramian (n, n) of the states of ``system``.

    The exact entries lie within ``controllability_error`` and ``observability_error`` (n, n).

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import gramians
    >>> found = gramians(control.ss([[-1.0]], [[2.0]], [[3.0]], [[0.0]]))
    >>> found.controllability.item(), found.observability.item()
    (2.0, 4.5)
    """

    system: StateSpace
    controllability: RealArray
    observability: RealArray
    controllability_error: RealArray
    observability_error: RealArray

    def summary(self) -> str:
        relative = max(
            _relative(self.controllability, self.controllability_error),
            _relative(self.observability, self.observability_error),
        )
        return f"Gramians: of {self.system.nstates} states, errors up to {relative:.1g} of an entry"


def gramians(system: Any) -> Gramians:
    """The controllability and the observability Gramian of a stable system, with proven errors.

    P solves A P + P A' + B B' = 0 and Q solves A'Q + Q A + C'C = 0; in sampled time A P A' - P + B
    B' = 0 and A'Q A - Q + C'C = 0. They belong to the states of a StateSpace as given; for a
    transfer function they belong to the states of the answer's ``system``.

    Parameters
    ----------
    system
        A StateSpace, TransferFunction or other system with states, with any number of inputs and
        outputs, in continuous or sampled time.

    Raises
    ------
    InputError
        The system is improper or not stable, a pole is too near the boundary of stability, or
        entries overflow doubles.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import gramians
    >>> found = gramians(control.ss([[-1.0, 0.0], [0.0, -3.0]], [[1.0], [1.0]], [[1.0, 1.0]], 0.0))
    >>> found.controllability.round(4).tolist(), found.holds
    ([[0.5, 0.25], [0.25, 0.1667]], True)
    >>> bool(found.controllability_error.max() < 1e-15)
    True

    References
    ----------
    A. C. Antoulas, Approximation of Large-Scale Dynamical Systems, SIAM 2005, section 4.3; the
    proof is that of `workbench.certify.realisations.lyapunov`.
    """
    found = stable_states(system, "Gramians")
    parts: list[RealArray] = []
    for near, error in _enclosed(found):
        root = np.sqrt(np.abs(np.diagonal(near)))
        claimed = np.maximum(CLAIMED_FACTOR * error, EPS * np.outer(root, root))
        parts += [near, np.nextafter(claimed, np.inf) if near.any() else claimed]
    P, P_error, Q, Q_error = parts
    return Gramians(found, P, Q, P_error, Q_error).with_checker(GramiansChecker(found))


def _enclosed(system: StateSpace) -> list[tuple[RealArray, RealArray]]:
    """Both Gramians in doubles, and bounds of the errors of their entries."""
    A, B, C, D = matrices_of(system)
    dt, n = float(system.dt or 0.0), len(A)
    units = balancing(np.block([[A, B], [C, D]]), n)[0][:n]
    scaled = A * units[:, None] / units
    found = []
    for matrix, gains, back in (
        (scaled, B * units[:, None], 1.0 / units),
        (scaled.T, (C / units).T, units),
    ):
        near, error = _of_one(matrix, gains, dt)
        with np.errstate(over="ignore"):
            near, error = (back[:, None] * part * back for part in (near, error))
        if not (np.isfinite(near).all() and np.isfinite(error).all()):
            raise InputError(
                "entries of the Gramians overflow doubles; measure the signals or the states of "
                "the system in other units"
            )
        found.append((near, error))
    return found


def _of_one(A: RealArray, B: RealArray, dt: float) -> tuple[RealArray, RealArray]:
    """The controllability Gramian and its error bounds, to full double precision."""
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0))
    best = None
    for bits in BITS:
        gramian = enclosed_gramian(A, B, dt, bits)
        if gramian is None:
            continue
        best = near, error = rounded_gramian(gramian)
        root = np.sqrt(np.abs(np.diagonal(near)))
        if (error <= EPS * np.outer(root, root) + np.finfo(float).tiny).all():
            break
    if best is None:
        raise InputError(
            "the Gramians cannot be enclosed: a pole lies so near to the boundary of stability, or "
            "the states are so nearly dependent, that doubles do not solve the Lyapunov equation; "
            "give a balanced or modal realisation"
        )
    return best


def _relative(near: RealArray, error: RealArray) -> float:
    """The largest error of an entry, relative to the sizes of its states."""
    root = np.sqrt(np.abs(np.diagonal(near)))
    size = np.outer(root, root)
    return float((error[size > 0.0] / size[size > 0.0]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class GramiansChecker(Checker):
    """Checks Gramians by residuals of their equations in balls, and by sums over samples."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: Gramians, tolerance: float) -> list[Check]:
        found = [stability_proof(self.system)]
        proven = _enclosed(self.system)
        for name, (near, error) in zip(("controllability", "observability"), proven, strict=True):
            claimed, slack = getattr(answer, name), getattr(answer, f"{name}_error")
            apart = np.abs(claimed - near)
            over = (apart + error * (1.0 + 4.0 * EPS)) - slack
            statement = "distance of an entry from the Gramian beyond its claimed error"
            found.append(Check(name, statement, float(over.max(initial=0.0)), 0.0, proven=True))
        return found

    def second_opinion(self, answer: Gramians) -> list[Check]:
        one = self.system
        sums = summed_gramians(one.A, one.B, one.C, float(one.dt or 0.0))
        found = []
        for name, sum_ in zip(("controllability", "observability"), sums, strict=True):
            near = getattr(answer, name)
            apart = _relative(near, np.abs(near - sum_))
            statement = "distance of an entry from a sum over samples, relative to its states"
            found.append(Check(f"{name} summed", statement, apart, SUM_ROUNDING))
        return found

"""A system as the sum of its stable part, its part on the boundary and its antistable part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import ctx, fmpq_mat
from scipy.linalg import schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer
from workbench.certificate import THIS_SYSTEM, Check, Checker, relative_excess
from workbench.certify.realisations.lyapunov import rounded, stability_proof
from workbench.certify.realisations.parts import (
    boundary_projector,
    nearest_doubles,
    split_in_balls,
    sum_errors,
    unit_of_time,
)
from workbench.certify.rounding import BALL_BITS
from workbench.errors import InputError
from workbench.second_opinion.responses import farthest_sum
from workbench.systems.axis_poles import stable_last
from workbench.systems.balancing import state_units
from workbench.systems.conversion import as_system
from workbench.systems.realisation import in_parallel, matrices_of, realisation

NEAR = 1e-3
"""A pole may be on the unit circle if its distance from it is below this; rounding moves repeated
poles.
"""
RESPONSE_ROUNDING = 1e-6
"""Largest difference of responses in doubles that rounding explains."""
VANISHING = 2.0**-150
"""An entry of the part on the boundary counts as 0 below this share of the system's entries."""
CLAIMED_FACTOR = 2.0
"""Claimed errors are this multiple of the proven errors, which differ a little between
processors.
"""


@dataclass(frozen=True, eq=False, repr=False)
class SystemParts(Answer):
    """A system as a sum of three parts: ``stable``, on the ``boundary``, and ``antistable``.

    Unlike a `StateSpace`, it keeps three parts apart, with a proven error.

    The largest gain, over all frequencies, of the difference of the stable and the antistable part
    to the exact ones is at most ``error``. The first 2 k Markov parameters of the k states on the
    boundary have relative errors of at most ``boundary_error``. The states of the system are
    ``coordinates`` times those on the boundary, the antistable and the stable ones. The direct term
    belongs to the stable part. Where a system is needed, the answer stands for its stable part.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import stable_part
    >>> parts = stable_part(control.tf([1.0], [1.0, 1.0, 0.0]))
    >>> parts.boundary.poles().tolist(), parts.stable.poles().tolist()
    ([0j], [(-1+0j)])
    """

    stable: StateSpace
    boundary: StateSpace
    antistable: StateSpace
    coordinates: RealArray
    error: float
    boundary_error: float

    @property
    def value(self) -> float:
        """The proven bound of the gain of the difference."""
        return self.error

    @property
    def lti(self) -> StateSpace:
        """The stable part."""
        return self.stable

    def summary(self) -> str:
        counts = (part.nstates for part in (self.stable, self.boundary, self.antistable))
        words = ("stable", "on the boundary", "antistable")
        states = ", ".join(f"{n} {word}" for n, word in zip(counts, words, strict=True))
        return f"SystemParts: states {states}; gain of the difference at most {self.error:.2g}"


def stable_part(system: Any) -> SystemParts:
    """The stable part of a system, together with its part on the boundary and its antistable part.

    Poles on the imaginary axis (sampled: on the unit circle) are split off first, and kept exactly
    where they are 0 (sampled: 1). The sum of the three parts is the system, up to proven errors.

    Parameters
    ----------
    system
        As of `gramians`.

    Raises
    ------
    InputError
        The system is improper, or it has poles that are not exactly on the boundary but that
        rounding cannot tell from it.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import hankel_values, stable_part
    >>> lag, integrator = control.tf([1.0], [1.0, 3.0]), control.tf([2.0], [1.0, 0.0])
    >>> parts = stable_part(lag + integrator + control.tf([1.0], [1.0, -2.0]))
    >>> [round(part.poles().item().real, 9) for part in (parts.stable, parts.antistable)]
    [-3.0, 2.0]
    >>> parts.error < 1e-14, parts.holds
    (True, True)
    >>> hankel_values(parts).upper.round(6).tolist()
    [0.166667]

    References
    ----------
    M. G. Safonov, E. A. Jonckheere, M. Verma, D. J. N. Limebeer, Synthesis of positive real
    multivariable feedback systems, Int. J. Control 45 (1987) 817-842, for the splitting by ordered
    Schur forms; the proof is that of `workbench.certify.realisations.parts`.
    """
    found = as_system(system, "system")
    return parts_of(found).with_checker(SystemPartsChecker(found))


def parts_of(system: StateSpace) -> SystemParts:
    """The parts with their proven errors, without a checker."""
    A, B, C, D = matrices_of(system)
    dt = float(system.dt or 0.0)
    rate = 1.0 if dt else unit_of_time(A, B, C)
    given = _units(A, B, C, bool(dt))
    A, B, C = A / rate * given[:, None] / given, B / rate * given[:, None], C / given
    V, (k, antistable), projector = _coordinates(A, B, C, bool(dt))
    with ctx.workprec(BALL_BITS):
        found = split_in_balls((A, B, C), V, k, projector)
    if found is None:
        raise _undecided()
    own, rest = ([rounded(part) for part in parts] for parts in found)
    negligible = VANISHING * float(np.abs(A).max(initial=float(bool(dt))))
    Q, own[0] = exact_integrators(own[0], negligible, bool(dt))
    own[1:] = Q.T @ own[1], own[2] @ Q
    V[:, :k] = V[:, :k] @ Q
    a, b, c = rest
    two = [(a[place, place], b[place], c[:, place]) for place in _places(antistable, len(a))]
    blocks, scales = [], []
    for (a, b, c), direct in zip((own, *two), (0.0, 0.0, 1.0), strict=True):
        units = _units(a, b, c, bool(dt))
        scales.append(units)
        scaled = a * units[:, None] / units, b * units[:, None], c / units
        blocks.append((rate * scaled[0], rate * scaled[1], scaled[2], direct * D))
    coordinates = V / given[:, None] / np.concatenate(scales)
    error, relative = sum_errors(system, blocks[0], in_parallel(*blocks[1:]), coordinates)
    if not np.isfinite(error):
        raise _undecided()
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    boundary, antistable_part, stable = (realisation(part, dt, **labels) for part in blocks)
    errors = CLAIMED_FACTOR * error, CLAIMED_FACTOR * relative
    return SystemParts(stable, boundary, antistable_part, coordinates, *errors)


def _units(A: RealArray, B: RealArray, C: RealArray, sampled: bool) -> RealArray:
    """Scaling factors that balance the states, with time measured in units of the system's own
    speed.
    """
    rate = 1.0 if sampled else unit_of_time(A, B, C)
    return state_units(A / rate, B / rate, C)


def _places(first: int, n: int) -> tuple[slice, slice]:
    return slice(0, first), slice(first, n)


def _undecided() -> InputError:
    return InputError(
        "the system has poles that cannot be told from the boundary of stability, and its matrices "
        "do not say that they are on it: give it as a transfer function, or with integrators that "
        "are exact"
    )


def exact_integrators(
    A: RealArray, negligible: float, sampled: bool
) -> tuple[RealArray, RealArray]:
    """An orthogonal Q, and Q'AQ of the part on the boundary with its poles at 0 (sampled: 1) made
    exact.

    Entries up to ``negligible`` count as rounding of 0 (sampled: their distance from 1 does).
    """
    shift = np.eye(len(A)) if sampled else np.zeros((len(A), len(A)))
    moved = A - shift
    moved[np.abs(moved) <= negligible] = 0.0
    Q, T, _, _ = stable_last(moved)
    return Q, T + shift


def _coordinates(
    A: RealArray, B: RealArray, C: RealArray, sampled: bool
) -> tuple[RealArray, tuple[int, int], fmpq_mat | None]:
    """V that makes V^-1 A V block diagonal, sizes of its first two blocks, and a projector.

    The blocks have the poles on the boundary, beyond it, and inside it; the projector maps to the
    states of the first block.
    """
    n = len(A)
    units = _units(A, B, C, sampled)
    balanced = A * units[:, None] / units
    V, k = np.eye(n), 0
    projector = boundary_projector(A, sampled) if may_touch(balanced, sampled) else None
    if projector is not None:
        V, k = _bases(nearest_doubles(projector) * units[:, None] / units)
    if k == n:
        return V / units[:, None], (k, 0), projector
    rest = np.linalg.solve(V, balanced @ V)[k:, k:]
    try:
        T, Q, beyond = schur(rest if sampled else -rest, sort="ouc" if sampled else "lhp")
    except np.linalg.LinAlgError as failed:  # poles cross the boundary while they are sorted
        raise _undecided() from failed
    turn = np.eye(n - k)
    if 0 < beyond < n - k:
        turn[:beyond, beyond:] = solve_sylvester(
            T[:beyond, :beyond], -T[beyond:, beyond:], -T[:beyond, beyond:]
        )
    V[:, k:] = V[:, k:] @ Q @ turn
    return V / units[:, None], (k, beyond), projector


def may_touch(A: RealArray, sampled: bool) -> bool:
    """Whether rounding may put a pole on the boundary of stability."""
    n = len(A)
    if not n:
        return False
    if sampled:
        poles = np.linalg.eigvals(A)
        return bool((np.abs(np.abs(poles) - 1.0) < NEAR).any())
    return stable_last(A)[2] + stable_last(-A)[2] > n


def _bases(projector: RealArray) -> tuple[RealArray, int]:
    """Bases of the range of a projector and of its complement, side by side; and the size of the
    first.
    """
    k = round(float(np.trace(projector)))
    own = np.linalg.svd(projector)[0][:, :k]
    rest = np.linalg.svd(np.eye(len(projector)) - projector)[0][:, : len(projector) - k]
    return np.hstack([own, rest]), k


@dataclass(frozen=True, eq=False)
class SystemPartsChecker(Checker):
    """Checks a sum of parts in balls and fractions, and by responses at drawn points."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: SystemParts, tolerance: float) -> list[Check]:
        stable, boundary, antistable = (
            (one.A, one.B, one.C, one.D)
            for one in (answer.stable, answer.boundary, answer.antistable)
        )
        rest = in_parallel(antistable, stable)
        error, relative = sum_errors(self.system, boundary, rest, answer.coordinates)
        statement = "by which share a claimed error is below the proven one"
        within = stability_proof(answer.stable)
        beyond = replace(stability_proof(_mirrored(answer.antistable)), name="antistable")
        return [
            within,
            replace(beyond, proven=beyond.proven and not self.system.dt),  # of a rounded inverse
            Check("sum", statement, relative_excess(error, answer.error), 0.0, proven=True),
            Check(
                "boundary",
                statement,
                relative_excess(relative, answer.boundary_error),
                0.0,
                proven=True,
            ),
        ]

    def second_opinion(self, answer: SystemParts) -> list[Check]:
        parts = [answer.stable, answer.boundary, answer.antistable]
        apart = farthest_sum(self.system, parts)
        statement = "difference of responses at drawn points, relative to the sizes of the parts"
        return [Check("responses", statement, apart, RESPONSE_ROUNDING)]


def _mirrored(system: StateSpace) -> StateSpace:
    """The mirrored system, whose poles are stable where those of the antistable system are not."""
    A = np.asarray(system.A, dtype=float)
    n = len(A)
    mirrored = np.linalg.inv(A) if system.dt and n else -A
    no_gain = np.zeros((n, 1)), np.zeros((1, n)), np.zeros((1, 1))
    return realisation((mirrored, *no_gain), float(system.dt or 0.0))

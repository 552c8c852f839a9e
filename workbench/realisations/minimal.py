"""Minimal realisations, proven: states without effect from input to output are left out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer
from workbench.certificate import THIS_SYSTEM, Check, Checker, relative_excess
from workbench.certify.realisations.parts import boundary_part_error, gain_apart
from workbench.input_checks import need_positive
from workbench.realisations.boundary_states import least_boundary_part
from workbench.realisations.system_parts import (
    CLAIMED_FACTOR,
    RESPONSE_ROUNDING,
    SystemParts,
    SystemPartsChecker,
    exact_integrators,
    stable_part,
)
from workbench.second_opinion.responses import farthest_apart
from workbench.systems.balancing import balancing, speed, state_units
from workbench.systems.conversion import as_system
from workbench.systems.equations.gramians import balancing_projections, gramian_factors
from workbench.systems.frequency_response import frequency_response
from workbench.systems.realisation import Matrices, in_parallel, matrices_of, realisation

MINIMAL_TOLERANCE = 1e-9
"""Largest change of the gain that is allowed when states are left out, relative to the system's
gain.
"""


@dataclass(frozen=True, eq=False, repr=False)
class MinimalRealisation(Answer):
    """A ``system`` with the fewest states, and the ``removed_poles`` (k,) of the given one.

    Unlike a `StateSpace`, it is an answer with a proven error and with the removed poles.

    The largest gain of the difference over all frequencies is at most ``error``, not counting the
    part with poles on the boundary of stability. For that part, the first Markov parameters have
    relative errors of at most ``boundary_error``. The answer can be used as a system. ``sizes`` are
    the numbers of its states on the boundary, beyond it and inside it, in this order.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import minimal_realisation
    >>> found = minimal_realisation(control.tf([1.0, 2.0], [1.0, 3.0, 2.0]))
    >>> found.system.nstates, found.removed_poles.real.round(6).tolist()
    (1, [-2.0])
    """

    system: StateSpace
    removed_poles: ComplexArray
    error: float
    boundary_error: float
    parts: SystemParts
    sizes: tuple[int, int, int]

    @property
    def value(self) -> float:
        """The proven bound of the gain of the difference."""
        return self.error

    @property
    def lti(self) -> StateSpace:
        """The system."""
        return self.system

    def summary(self) -> str:
        gone = ", ".join(f"{pole:.6g}" for pole in self.removed_poles) or "none"
        return (
            f"MinimalRealisation: {self.system.nstates} states, poles left out: {gone}; gain of "
            f"the difference at most {self.error:.2g}"
        )


def minimal_realisation(system: Any, *, tolerance: float = MINIMAL_TOLERANCE) -> MinimalRealisation:
    """A realisation without the states that have no effect between input and output.

    Those are states that no input reaches or no output shows, and pairs of poles and zeros that
    cancel, exactly or nearly. Poles on the boundary of stability are left out only if they cancel
    exactly, decided in fractions: otherwise the difference would have no bound. Antistable states
    of a sampled system are kept. A system that is minimal already is returned unchanged.

    Parameters
    ----------
    system
        As of `gramians`; it need not be stable.
    tolerance
        Largest change of the gain, relative to the gain of the system near the poles that are left
        out, with signals in units that make the gains of all channels similar.

    Raises
    ------
    InputError
        As `stable_part`; the tolerance is not positive.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import minimal_realisation
    >>> system = control.tf([1.0, 2.0], [1.0, 2.0, 0.0]) * control.tf([1.0], [1.0, 5.0])
    >>> found = minimal_realisation(system)
    >>> found.system.nstates, found.system.poles().real.round(9).tolist()
    (2, [0.0, -5.0])
    >>> found.error < 1e-12, found.holds
    (True, True)

    References
    ----------
    K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity-error bounds, Int. J. Control 39 (1984) 1115-1193, for what truncation costs; here
    the gain of the difference itself is proven.
    """
    need_positive(tolerance, "tolerance")
    found = as_system(system, "system")
    parts = stable_part(found)
    checker = MinimalChecker(found)
    dt = float(found.dt or 0.0)
    of = [matrices_of(one) for one in (parts.boundary, parts.antistable, parts.stable)]
    boundary = _boundary_reduced(found, of[0])
    antistable = of[1] if dt else _mirrored(_reduced(_mirrored(of[1]), found, tolerance))
    stable = _reduced(of[2], found, tolerance)
    kept = [
        new if len(new[0]) < len(old[0]) else old
        for new, old in zip((boundary, antistable, stable), of, strict=True)
    ]
    errors = _errors(found, parts, kept)
    if not math.isfinite(errors[0]):  # an antistable part for which no difference can be proven
        kept[1] = of[1]
        errors = _errors(found, parts, kept)
    if sum(len(part[0]) for part in kept) == found.nstates:
        none = np.zeros(0, dtype=complex)
        sizes = len(of[0][0]), len(of[1][0]), len(of[2][0])
        return MinimalRealisation(found, none, 0.0, 0.0, parts, sizes).with_checker(checker)
    labels = {"inputs": found.input_labels, "outputs": found.output_labels}
    small = realisation(in_parallel(*kept), dt, **labels)
    removed = _unmatched(found.poles(), small.poles())
    sizes = len(kept[0][0]), len(kept[1][0]), len(kept[2][0])
    error, relative = CLAIMED_FACTOR * errors[0], CLAIMED_FACTOR * errors[1]
    return MinimalRealisation(small, removed, error, relative, parts, sizes).with_checker(checker)


def _errors(system: StateSpace, parts: SystemParts, kept: list[Matrices]) -> tuple[float, float]:
    """The bound of the gain of the difference, and the relative error of the part on the
    boundary.
    """
    dt = float(system.dt or 0.0)
    gain = parts.error
    gain += gain_apart(matrices_of(parts.stable), kept[2], dt, False)
    gain += gain_apart(matrices_of(parts.antistable), kept[1], dt, True)
    return gain, boundary_part_error(system, kept[0])


def _reduced(part: Matrices, system: StateSpace, tolerance: float) -> Matrices:
    """A stable part by balanced truncation, to the least order that is within the tolerance as a
    whole and about every pole.
    """
    A, B, C, D = part
    if not len(A):
        return part
    rate = 1.0 if system.dt else speed(A, B, C)
    a, b = A / rate, B / rate
    poles = np.linalg.eigvals(A).astype(complex)
    into, out = _channel_units(system, poles)
    b, c = b * into, out[:, None] * C
    units = state_units(a, b, c)
    a, b, c = a * units[:, None] / units, b * units[:, None], c / units
    if system.dt:
        shifted = np.eye(len(a)) + a
        back = np.linalg.inv(shifted)
        S, R = gramian_factors(
            back @ (a - np.eye(len(a))), math.sqrt(2.0) * back @ b, math.sqrt(2.0) * c @ back
        )
    else:
        S, R = gramian_factors(a, b, c)
    left, right, values = balancing_projections(S, R)
    whole = matrices_of(system)
    gains = out[:, None] * (_values_about(system, poles, whole[:3]) + whole[3]) * into
    sizes = np.append(np.linalg.norm(_finite(gains), axis=(-2, -1)), values)
    size = float(sizes.max(initial=0.0))
    tails = 2.0 * np.append(np.cumsum(values[::-1])[::-1], 0.0)
    least = int(np.argmax(tails <= tolerance * size))

    def values_about(order: int) -> ComplexArray:
        """The values of the part, truncated to an order, at the points of `gains`."""
        T, V = left[:order], right[:, :order]
        return _values_about(system, poles, (rate * (T @ a @ V), rate * (T @ b), c @ V))

    exact = _values_about(system, poles, (rate * a, rate * b, c))
    allowed = tolerance * np.linalg.norm(gains, axis=(-2, -1))
    order = next(
        (
            k
            for k in range(least, len(a))
            if (np.linalg.norm(exact - values_about(k), axis=(-2, -1)) <= allowed).all()
        ),
        len(a),
    )
    T, V = left[:order], right[:, :order]
    return rate * (T @ a @ V), rate * (T @ b) / into, (c @ V) / out[:, None], D


def _channel_units(system: StateSpace, poles: ComplexArray) -> tuple[RealArray, RealArray]:
    """Factors of the inputs and of the outputs with which all channels have gains of similar size.

    Otherwise an output in metres would have no effect beside one in volts. The sizes are those of
    the terms of a gain, so that what rounding leaves where terms cancel is no small unit.
    """
    A, B, C, D = matrices_of(system)
    n = len(A)
    from_u, to_y = (
        _values_about(system, poles, (A, B, np.eye(n))),
        _values_about(system, poles, (A, np.eye(n), C)),
    )
    with np.errstate(all="ignore"):
        terms = np.maximum(np.abs(C) @ np.abs(from_u), np.abs(to_y) @ np.abs(B)) + np.abs(D)
    out, into = balancing(_finite(terms).max(axis=0, initial=0.0), 0)
    return into, out


def _values_about(
    system: StateSpace, poles: ComplexArray, parts: tuple[RealArray, RealArray, RealArray]
) -> ComplexArray:
    """The values (n, p, m) of C (s - A)^-1 B at points of the plane around the n poles of the
    system, off the boundary.
    """
    A, B, C = parts
    turned = np.exp(1.2j)
    points = 1.0 + np.abs(poles - 1.0) * turned if system.dt else np.abs(poles) * turned
    with np.errstate(all="ignore"):
        M = np.block([[A, B], [C, np.zeros((len(C), B.shape[1]))]])
        return frequency_response(M, len(A), points)


def _finite(values: Array) -> Array:
    """Those of the matrices (n, p, m) that are finite."""
    return values[np.isfinite(values).all(axis=(-2, -1))]


def _mirrored(part: Matrices) -> Matrices:
    """G(-s), which is stable for an antistable part; applied twice, the part itself."""
    A, B, C, D = part
    return -A, -B, C, D


def _boundary_reduced(system: StateSpace, part: Matrices) -> Matrices:
    """The part on the boundary without states that are exactly unreachable or unobservable."""
    if not len(part[0]):
        return part
    A, B, C, D = least_boundary_part(system)
    if len(A) == len(part[0]):
        return part
    Q, A = exact_integrators(A, 0.0, bool(system.dt))
    B, C = Q.T @ B, C @ Q
    units = state_units(A, B, C)
    return A * units[:, None] / units, B * units[:, None], C / units, D


def _unmatched(poles: ComplexArray, kept: ComplexArray) -> ComplexArray:
    """The poles that remain after each kept pole has been paired with the nearest one."""
    left = list(poles)
    for pole in kept:
        left.pop(int(np.argmin(np.abs(np.array(left) - pole))))
    return np.array(left, dtype=complex)


@dataclass(frozen=True, eq=False)
class MinimalChecker(Checker):
    """Checks a minimal realisation by the parts of both systems, and by responses at points."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: MinimalRealisation, tolerance: float) -> list[Check]:
        statement = "by which share a claimed error is below the proven one"
        if answer.system.nstates == self.system.nstates:
            same = all(
                np.array_equal(getattr(answer.system, part), getattr(self.system, part))
                for part in "ABCD"
            )
            return [Check("same", "whether the system is not the given one", float(not same), 0.0)]
        found = SystemPartsChecker(self.system).checks(answer.parts, tolerance)
        kept, beside = _blocks(answer)
        error, relative = _errors(self.system, answer.parts, kept)
        return [
            *found,
            Check("blocks", "largest entry beside the blocks", beside, 0.0, proven=True),
            Check("gain", statement, relative_excess(error, answer.error), 0.0, proven=True),
            Check(
                "on the boundary", statement, relative_excess(relative, answer.boundary_error), 0.0
            ),
        ]

    def second_opinion(self, answer: MinimalRealisation) -> list[Check]:
        apart = farthest_apart(self.system, answer.system, answer.error)
        statement = "difference of responses at drawn points beyond the error, relative"
        return [Check("responses", statement, apart, RESPONSE_ROUNDING)]


def _blocks(answer: MinimalRealisation) -> tuple[list[Matrices], float]:
    """The parts of a realisation, and the largest entry of A outside their blocks."""
    A, B, C, D = matrices_of(answer.system)
    ends = np.cumsum([0, *answer.sizes])
    rest, found = A.copy(), []
    for kind, (start, end) in enumerate(pairwise(ends)):
        own = slice(int(start), int(end))
        rest[own, own] = 0.0
        found.append((A[own, own], B[own], C[:, own], float(kind == 2) * D))
    return found, float(np.abs(rest).max(initial=0.0)) if sum(answer.sizes) == len(A) else 1.0

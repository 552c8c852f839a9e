"""Approximations of systems with a proven bound on the gain of the difference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control
import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer
from workbench.certificate import EVERY_FREQUENCY, Check, Checker, relative_excess
from workbench.certify.realisations.changes import relative_change
from workbench.certify.realisations.parts import boundary_projector, states_of
from workbench.errors import InputError
from workbench.realisations.difference import difference_bound
from workbench.realisations.system_parts import may_touch
from workbench.second_opinion.responses import change_of_matrices, farthest_apart
from workbench.synthesis.reduction.kept_part import kept_and_stable, with_exact_poles
from workbench.systems.balancing import AXIS_ROUNDING
from workbench.systems.realisation import matrices_of, realisation

REPEATED_BOUND = 1e-6
"""Relative difference allowed between bounds that two processors compute."""
DIFFERENCE_ROUNDING = 1e-6
"""Rounding error of a difference of two responses, relative to the responses."""


@dataclass(frozen=True, eq=False)
class DifferenceChecker(Checker):
    """Checks the largest weighted gain of the difference to a system, by ball arithmetic and by
    responses.

    Some poles of the system may be on the boundary of stability up to rounding only. Then the error
    is proven for a system with exact poles, and the change of the matrices is proven to be
    rounding.
    """

    system: StateSpace
    output_weight: StateSpace | None = None
    input_weight: StateSpace | None = None

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    @cached_property
    def references(self) -> list[Reference]:
        """Systems equal to the given one up to rounding, for which the error may be proven."""
        given, dt = matrices_of(self.system), float(self.system.dt or 0.0)
        try:
            near = with_exact_poles(given, bool(dt))
            parts = kept_and_stable(given, bool(dt))
        except InputError:  # it cannot be decided whether its poles are integrators
            return [Reference(self.system)]
        exact = _poles_on_boundary(near[0][0], dt)
        if exact and exact != _poles_on_boundary(given[0], dt):
            found = [Reference(realisation(near[0], dt), *near[1:])]
        else:
            found = [Reference(self.system)]
        if parts.count:
            whole = realisation(parts.with_stable(parts.stable), dt)
            found.append(Reference(whole, parts.coordinates, parts.units))
        return found

    def proven(self, other: StateSpace) -> tuple[float, Reference]:
        """Bound on the gain of the difference to `other`, and the reference for which it is
        proven.
        """
        for one in self.references:
            found = difference_bound(one.system, other, self.output_weight, self.input_weight)
            if np.isfinite(found):
                return found, one
        return math.inf, self.references[0]

    def checks(self, answer: ApproximatedSystem, tolerance: float) -> list[Check]:
        bound, reference = self.proven(answer)
        statement = "by which share the claimed error is below the proven one"
        unbounded = float(not np.isfinite(answer.error))
        found = [
            Check("error", statement, relative_excess(bound, answer.error), 0.0, proven=True),
            Check("bounded", "whether no finite error is proven", unbounded, 0.0, proven=True),
        ]
        if reference.coordinates is not None:
            change = reference.change(self.system)
            statement = "relative change of the given matrices that makes kept poles exact"
            found.append(Check("kept poles", statement, change, self._rounding, proven=True))
        return found

    @property
    def _rounding(self) -> float:
        """Largest relative change of the given matrices that counts as rounding."""
        return 2.0 * AXIS_ROUNDING * self.system.nstates**2 * EPS

    def second_opinion(self, answer: ApproximatedSystem) -> list[Check]:
        _, reference = self.proven(answer)
        apart = farthest_apart(
            reference.system, answer, answer.error, self.output_weight, self.input_weight
        )
        statement = "difference of responses at drawn points beyond the error, relative"
        found = [Check("responses", statement, apart, DIFFERENCE_ROUNDING)]
        if reference.coordinates is not None:
            share = change_of_matrices(self.system, reference.system)
            statement = "least share by which matrices must change, told from responses"
            found.append(Check("given", statement, share, self._rounding))
        return found


@dataclass(frozen=True, eq=False)
class Reference:
    """A system for which an error is proven: the given one, or one that differs from it by
    rounding.

    The given states are ``coordinates`` (n, n) times the reference's own states. ``units`` (n,) are
    factors on the given states; rounding is judged in the scaled states.
    """

    system: StateSpace
    coordinates: RealArray | None = None
    units: RealArray | None = None

    def change(self, given: StateSpace) -> float:
        """Bound on the relative change of the given matrices that makes them those of this
        system.
        """
        assert self.coordinates is not None and self.units is not None
        parts = matrices_of(given), matrices_of(self.system)
        return relative_change(*parts, self.coordinates, self.units)


class ApproximatedSystem(Answer, control.StateSpace):
    """A StateSpace that approximates another one, with a proven bound on the error.

    Unlike a plain `StateSpace`, it is an answer with checks.

    Operations on it give a plain StateSpace. The error is proven when it is first asked for.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximate
    >>> G = control.tf([1.0], [1.0, 1.0]) + control.tf([1.0], [1.0, 100.0])
    >>> small = approximate(G, 1, method="balanced")
    >>> bool(0.004 < small.error < 0.01), small.holds, type(small + small).__name__
    (True, True, 'StateSpace')
    """

    __repr__ = control.StateSpace.__repr__
    plot = Answer.plot

    @classmethod
    def of(cls, system: StateSpace, checker: DifferenceChecker) -> ApproximatedSystem:
        """The system as an approximation of the checker's system."""
        labels = {"inputs": system.input_labels, "outputs": system.output_labels}
        parts = system.A, system.B, system.C, system.D, system.dt
        made: Any = cls(*parts, remove_useless_states=False, **labels)
        return made.with_checker(checker)

    @cached_property
    def error(self) -> float:
        """Bound on the gain of the weighted difference at every frequency.

        The parts with poles on the boundary of stability agree up to rounding and are left out. If
        rounding has moved such poles of the given system, the error refers to the system with exact
        poles, whose matrices are proven to differ by rounding only. The bound is infinite if these
        parts do not agree or no bound is proven; then no certificate holds.
        """
        checker = self._checked_by[0] if self._checked_by else None
        if not isinstance(checker, DifferenceChecker):
            return math.nan
        return checker.proven(self)[0] * (1.0 + REPEATED_BOUND)

    @property
    def value(self) -> float:
        """The proven error."""
        return self.error


def _poles_on_boundary(A: Any, dt: float) -> int:
    """Number of poles that are exactly on the boundary of stability."""
    if not may_touch(A, bool(dt)):
        return 0
    projector = boundary_projector(A, bool(dt))
    return 0 if projector is None else states_of(projector)

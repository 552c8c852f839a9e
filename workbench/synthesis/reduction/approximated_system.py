"""Approximations of systems, with the largest gain of the difference, proven."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control
import numpy as np

from workbench.answer import Answer
from workbench.arrays import EPS
from workbench.certificate import EVERY_FREQUENCY, Check, Checker, excess
from workbench.certify.realisations.changes import relative_change
from workbench.certify.realisations.parts import boundary_projector, states_of
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.realisations.difference import difference_bound
from workbench.realisations.system_parts import may_touch
from workbench.second_opinion.responses import change_of_matrices, farthest_apart
from workbench.synthesis.reduction.kept_part import with_exact_poles
from workbench.systems.balancing import AXIS_ROUNDING
from workbench.systems.realisation import matrices_of, realisation

REPEATED_BOUND = 1e-6
"""Share by which a bound of the gain may differ on another processor."""
DIFFERENCE_ROUNDING = 1e-6
"""Share of a response by which rounding may move a difference of responses."""


@dataclass(frozen=True, eq=False)
class DifferenceChecker(Checker):
    """Checks the largest weighted gain of the difference to a system, in balls and by responses.

    Where poles of the system lie within rounding of the boundary of stability and not on it, the
    ``reference`` is the system that has them there, and the change of the matrices is proven.
    """

    system: StateSpace
    output_weight: StateSpace | None = None
    input_weight: StateSpace | None = None

    @cached_property
    def _moved(self) -> tuple[StateSpace, float] | None:
        """The system with exact poles and the relative change; None where it has none to move."""
        given, dt = matrices_of(self.system), float(self.system.dt or 0.0)
        try:
            near, coordinates, units = with_exact_poles(given, bool(dt))
        except InputError:  # nothing says whether its poles are integrators
            return None
        exact = _poles_on_boundary(near[0], dt)
        if not exact or exact == _poles_on_boundary(given[0], dt):
            return None
        return realisation(near, dt), relative_change(given, near, coordinates, units)

    @property
    def reference(self) -> StateSpace:
        """The system that the error is proven of."""
        return self.system if self._moved is None else self._moved[0]

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    def bound(self, other: StateSpace) -> float:
        """The proven bound of another system."""
        return difference_bound(self.reference, other, self.output_weight, self.input_weight)

    def checks(self, answer: ApproximatedSystem, tolerance: float) -> list[Check]:
        statement = "by which share the claimed error is below the proven one"
        found = excess(self.bound(answer), answer.error)
        unbounded = float(not np.isfinite(answer.error))
        checks = [
            Check("error", statement, found, 0.0, proven=True),
            Check("bounded", "whether no finite error is proven", unbounded, 0.0, proven=True),
        ]
        if self._moved is not None:
            limit = 2.0 * AXIS_ROUNDING * self.system.nstates**2 * EPS
            statement = "relative change of the given matrices that makes integrators exact"
            checks.append(Check("integrators", statement, self._moved[1], limit, proven=True))
        return checks

    def second_opinion(self, answer: ApproximatedSystem) -> list[Check]:
        apart = farthest_apart(
            self.reference, answer, answer.error, self.output_weight, self.input_weight
        )
        statement = "difference of responses at drawn points beyond the error, relative"
        found = [Check("responses", statement, apart, DIFFERENCE_ROUNDING)]
        if self._moved is not None:
            share = change_of_matrices(self.system, self.reference)
            statement = "share by which matrices must change, told from responses"
            found.append(Check("given", statement, share, DIFFERENCE_ROUNDING))
        return found


class ApproximatedSystem(Answer, control.StateSpace):
    """A StateSpace that approximates another one, with the proven error of the approximation.

    What is computed from it is a StateSpace. The error is proven when it is first asked for.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximated
    >>> G = control.tf([1.0], [1.0, 1.0]) + control.tf([1.0], [1.0, 100.0])
    >>> small = approximated(G, 1, "balanced")
    >>> bool(0.004 < small.error < 0.01), small.holds, type(small + small).__name__
    (True, True, 'StateSpace')
    """

    __repr__ = control.StateSpace.__repr__
    plot = Answer.plot

    @classmethod
    def of(cls, system: StateSpace, checker: DifferenceChecker) -> ApproximatedSystem:
        """The system as an approximation of the one that the checker knows."""
        labels = {"inputs": system.input_labels, "outputs": system.output_labels}
        parts = system.A, system.B, system.C, system.D, system.dt
        made: Any = cls(*parts, remove_useless_states=False, **labels)
        return made.checked_by(checker)

    @cached_property
    def error(self) -> float:
        """Bound of the largest gain of the difference at every frequency, with the weights.

        The parts with poles on the boundary of stability agree up to rounding, and are left out.
        It is infinite where they do not, or nothing proves a bound: no certificate holds then.
        """
        checker = self._checked_by[0] if self._checked_by else None
        if not isinstance(checker, DifferenceChecker):
            return math.nan
        return checker.bound(self) * (1.0 + REPEATED_BOUND)

    @property
    def value(self) -> float:
        """The proven error."""
        return self.error


def _poles_on_boundary(A: Any, dt: float) -> int:
    """How many poles are exactly on the boundary of stability."""
    if not may_touch(A, bool(dt)):
        return 0
    projector = boundary_projector(A, bool(dt))
    return 0 if projector is None else states_of(projector)

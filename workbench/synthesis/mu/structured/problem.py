"""The peak of mixed mu as a function of the parameters of a family, with its gradient."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError, SolverError
from workbench.mu import UpperBound, bound_gradient, upper_bound
from workbench.structure import Structure
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.rounds import Iterate
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant, response

RESOLVED_SHARE, MAXIMUM_TOLERANCE, GRID_REFINEMENTS = 0.8, 5e-4, 5
"""Maxima above the first share of the peak are refined until neighbours differ by less than the
second share of the peak. The third number is the largest number of refinements.
"""


@dataclass(frozen=True, eq=False)
class PeakProblem:
    """Mixed mu of the loop as a function of the parameters of a family."""

    plant: GeneralisedPlant
    structure: Structure
    family: Family
    demands: Shippable = field(default_factory=Shippable)

    @cached_property
    def opened(self) -> GeneralisedPlant:
        """The plant whose controls are also exogenous inputs, and whose measurements are also
        outputs.
        """
        import control

        system, m, p = self.plant.system, self.plant.controls, self.plant.measurements
        inputs = [*range(system.ninputs), *range(system.ninputs - m, system.ninputs)]
        outputs = [*range(system.noutputs), *range(system.noutputs - p, system.noutputs)]
        doubled = control.StateSpace(
            system.A,
            system.B[:, inputs],
            system.C[outputs],
            system.D[np.ix_(outputs, inputs)],
            0,
            remove_useless_states=False,
        )
        return GeneralisedPlant(doubled, None, m, p)

    def loop(self, x: RealArray) -> StateSpace | None:
        """The closed loop; None if it is unstable or K does not meet the demands."""
        K = self.family.system(x)
        if self.demands.asked and not self.demands.admits(K):
            return None
        try:
            loop = self.plant.close(K)
        except InputError:  # direct terms cancel, so the loop is not determined
            return None
        return loop if stability_check(loop).holds else None

    def stable_loop(self, x: RealArray) -> StateSpace:
        """The closed loop for parameters that are known to stabilise."""
        loop = self.loop(x)
        if loop is None:
            raise SolverError(
                "rounding hides whether the loop of a stabilising controller is stable"
            )
        return loop

    def about(self, K: StateSpace, x: RealArray) -> tuple[PeakProblem, RealArray]:
        """The problem and the parameters x, where the family of all controllers is scaled for K."""
        if not isinstance(self.family, Modal):
            return self, x
        try:
            family, new = self.family.about(K)
        except InputError:  # equal real poles cannot form a block, so keep the present corners
            return self, x
        return replace(self, family=family), new

    def curve(self, loop: StateSpace) -> tuple[RealArray, RealArray]:
        """Frequencies (F,) [rad/s] that resolve the maxima of the upper bound, and bounds (F,)."""
        omega = frequencies_of(loop)
        bound = self._bound(loop, omega)
        for _ in range(GRID_REFINEMENTS):
            new = _refining_frequencies(omega, bound)
            if not new.size:
                break
            place = np.argsort(np.concatenate([omega, new]))
            bound = np.concatenate([bound, self._bound(loop, new)])[place]
            omega = np.concatenate([omega, new])[place]
        return omega, bound

    def linear(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Bounds (F,) at frequencies [rad/s] and their gradients (F, k) by the parameters."""
        # The response is computed from the closed loop, since the open loop may have poles on the
        # imaginary axis.
        m, p = self.plant.controls, self.plant.measurements
        whole = response(self.opened.close(self.family.system(x)), omega)
        N, back, out = whole[:, :-p, :-m], whole[:, :-p, -m:], whole[:, -p:, :-m]
        _, slopes = self.family.response(x, omega)
        bound: UpperBound = upper_bound(N, self.structure)
        # dN = back dK out
        with_K = out @ bound_gradient(N, self.structure, bound) @ back
        return bound.value, np.einsum("fij,fkji->fk", with_K, slopes).real

    def iterate(self, x: RealArray, bound: RealArray) -> Iterate:
        """The record of a round that ends at x with bounds (F,)."""
        return Iterate(float(bound.max()), np.nan, np.nan, self.family.system(x))

    def _bound(self, loop: StateSpace, omega: RealArray) -> RealArray:
        """Upper bounds on mixed mu (F,) at frequencies [rad/s]."""
        value: RealArray = upper_bound(response(loop, omega), self.structure).value
        return value


def _refining_frequencies(omega: RealArray, bound: RealArray) -> RealArray:
    """Frequencies to add on both sides of maxima that are not resolved."""
    top = bound.max()
    left = np.concatenate([[0.0], bound[:-1]])
    right = np.concatenate([bound[1:], [0.0]])
    peak = (bound >= left) & (bound >= right) & (bound > RESOLVED_SHARE * top)
    steep = np.abs(np.diff(bound)) > MAXIMUM_TOLERANCE * top
    wanted = steep & (peak[1:] | peak[:-1])
    middle: RealArray = np.sqrt(omega[1:] * omega[:-1])[wanted]
    return middle

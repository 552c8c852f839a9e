"""Common parts of the rules for starts: the family, a test of stability, and nearest members.

A rule returns controllers of the family. Most rules first design a controller of another form. Its
nearest members are then taken: nearest in the closed loop, and nearest in relative error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.families.three_terms import ThreeTerms
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.problem import PeakProblem
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.hidden_states import visible_matrices
from workbench.systems.norms import hinf_norm, stable
from workbench.systems.realisation import matrices_of, realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

BELOW_FASTEST = (0.27, 0.004)
"""Corners of examples, relative to the fastest pole allowed: for an order, whose poles are up to
three times as fast, and for other families.
"""
START_SPREAD, DRAWS_PER_START = 0.5, 20
"""Standard deviation of random starts, in units of the parameters, and the most draws per start
that is wanted."""
SHORTEST = 1e-3
"""Time for a start that comes late: it is its own answer [s]."""
BAND_DECADES, BAND_POINTS = 3.0, 120
"""Decades on both sides of the plant's speed, and number of frequencies, if no loop gives the
frequencies.
"""


@dataclass(frozen=True)
class Start:
    """A stabilising controller, and the rule that found it.

    Unlike a `MuController`, it only stabilises: a search starts from it.
    """

    K: StateSpace
    rule: str
    peak: float = np.inf


@dataclass(frozen=True, eq=False)
class Search:
    """A search for members of a family that stabilise the plant of a program.

    ``missed`` are members that do not stabilise; another search may start from them. ``abscissas``
    are the real parts [rad/s] of the rightmost poles of their loops.
    """

    program: MuSynthesis
    family: Family
    context: Context
    missed: list[StateSpace] = field(default_factory=list)
    abscissas: list[float] = field(default_factory=list)

    @cached_property
    def controlled(self) -> StateSpace:
        """The plant from the controls to the measurements without hidden states."""
        G = self.program.plant.controlled()
        return realisation((*visible_matrices(G.A, G.B, G.C), G.D), 0.0)

    @cached_property
    def speed(self) -> float:
        """The geometric mean of the sizes of the plant's poles [rad/s]."""
        return middle_size(self.controlled) or middle_size(self.program.plant.system) or 1.0

    @property
    def corners(self) -> tuple[float, ...]:
        """Corners [rad/s] of members with almost no effect, below the fastest pole allowed."""
        fastest = self.program.demands.fastest
        if fastest is None:
            return (self.speed,)
        return tuple(min(self.speed, share * fastest) for share in BELOW_FASTEST)

    @cached_property
    def gain(self) -> float:
        """The reciprocal of the plant's gain at its speed, which is the scale of relevant
        controller gains.
        """
        size = float(np.abs(response(self.controlled, [self.speed * 1.03])).max(initial=0.0))
        return 1.0 / size if size > 0 else 1.0

    @cached_property
    def _problem(self) -> PeakProblem:
        program = self.program
        structure = program.plant.performance_structure
        return PeakProblem(program.plant, structure, self.family, program.demands.without_gain)

    def stabilises(self, K: StateSpace) -> bool:
        """Whether a controller stabilises and meets the demands; others are remembered in
        ``missed``.

        Stability is proven for a perturbed plant only, whose descent begins with a proof. A proof
        takes minutes for a hundred states.
        """
        loop = self.closed(K) if self.program.demands.without_gain.admits(K) else None
        if loop is not None:
            self.abscissas.append(float(loop.poles().real.max(initial=-np.inf)))
            unperturbed = self.program.structure is None
            if stable(loop.A) and (unperturbed or stability_check(loop).holds):
                return True
        self.missed.append(K)
        return False

    def abscissa(self, K: StateSpace) -> float:
        """The real part [rad/s] of the rightmost pole of all loops; infinite if direct terms
        cancel, or numbers overflow.
        """
        try:
            loops = [P.close(matrices_of(K))[0] for P in self._standard_plants]
            poles = [np.linalg.eigvals(A).real.max(initial=-np.inf) for A in loops]
        except np.linalg.LinAlgError:
            return np.inf
        return float(max(poles))

    @cached_property
    def _standard_plants(self) -> list[StandardPlant]:
        return [standard_plant(plant) for plant in self.program.plants]

    def closed(self, K: StateSpace) -> StateSpace | None:
        """The loops of all plants; None if direct terms cancel, so that a loop is not
        determined.
        """
        try:
            return self.program.loop(K)
        except InputError:
            return None

    def peak(self, K: StateSpace) -> float:
        """The norm of the loop, or with a perturbation the largest upper bound on mu at frequencies
        that resolve it; infinite for an unstable loop.
        """
        if self.program.structure is None:
            whole = self.closed(K)
            try:
                return np.inf if whole is None else hinf_norm(matrices_of(whole))
            except ArithmeticError:
                return np.inf
        family, x = (self.program.family or Modal(K.nstates)).about(K)
        largest = 0.0
        for plant in self.program.plants:
            problem = replace(
                self._problem, plant=plant, structure=plant.performance_structure, family=family
            )
            loop = problem.loop(x)
            largest = max(largest, np.inf if loop is None else problem.curve(loop)[1].max())
        return float(largest)

    def _nominal(self, K: StateSpace) -> StateSpace | None:
        """The loop of the first plant; None if direct terms cancel."""
        try:
            return self.program.plant.close(K)
        except InputError:
            return None

    def members(self, targets: Iterable[StateSpace]) -> Iterator[StateSpace]:
        """The members nearest to controllers of any form."""
        for target in targets:
            for omega, weight in self._weights(target):
                try:
                    member = self.family.nearest(target, omega, weight)
                    member = None if member is None else self._meeting_pole_demands(member)
                except (InputError, SolverError, np.linalg.LinAlgError):
                    continue  # there is no near member, or its modes cannot form a block
                if member is not None:
                    yield member

    def _meeting_pole_demands(self, member: StateSpace) -> StateSpace:
        """A member whose parameters are changed, one by one, to meet the demands on poles."""
        family, x = self.family.about(member)
        demands = self.program.demands
        for row, side in zip(*family.halfspaces(demands.stable, demands.fastest), strict=True):
            own = np.flatnonzero(row)
            if len(own) == 1 and row @ x > side:
                x[own] = side / row[own]
                member = family.system(x)
        return member

    def _weights(self, target: StateSpace) -> Iterator[tuple[RealArray, RealArray]]:
        """Frequencies (F,) and weights (F,): those of the closed loop if it is stable, and those of
        relative error.
        """
        loop = self._nominal(target)
        omega = self.speed * np.logspace(-BAND_DECADES, BAND_DECADES, BAND_POINTS)
        if loop is not None and stable(loop.A):
            omega = frequencies_of(loop)
            m, p = self.program.plant.controls, self.program.plant.measurements
            whole = response(self._problem.opened.close(target), omega)
            # dN = back dK out
            back, out = whole[:, :-p, -m:], whole[:, -p:, :-m]
            weight = np.linalg.norm(back, axis=(1, 2)) * np.linalg.norm(out, axis=(1, 2))
            if weight.max() > 0:
                yield omega, weight / weight.max()
        size = np.linalg.norm(response(target, omega), axis=(1, 2))
        if size.max() > 0:
            yield omega, size.min() / np.maximum(size, size.max() * np.finfo(float).eps)

    def loops(self) -> tuple[list[StateSpace], Callable[[Sequence[StateSpace]], StateSpace]] | None:
        """Plants H of single loops u = C (r - H u), and a function that makes K from their
        controllers C.

        None if the plant cannot be split into single loops: its numbers of controls and
        measurements differ, or only several channels together reach and show a pole that is not
        stable.
        """
        import control

        G = self.controlled
        try:
            if isinstance(self.family, ThreeTerms) and self.family.setpoint_weights:
                difference = control.ss([], [], [], [[1.0, -1.0]])
                return [_element(G, 1, 0, 1.0)], lambda C: C[0] * difference
            if G.ninputs != G.noutputs:
                return None
            diagonal = [_element(G, i, i, -1.0) for i in range(G.ninputs)]
        except InputError:  # an element hides an unstable pole
            return None
        return diagonal, lambda C: control.append(*C)


def middle_size(system: StateSpace) -> float:
    """The geometric mean of the sizes of the poles [rad/s]; 0 if all poles are 0."""
    size = np.abs(system.poles())
    size = size[size > 0]
    return float(np.exp(np.mean(np.log(size)))) if size.size else 0.0


def _element(G: StateSpace, i: int, j: int, sign: float) -> StateSpace:
    """An element of G, times a sign, without hidden states."""
    A, B, C = visible_matrices(G.A, G.B[:, [j]], sign * G.C[[i]])
    return realisation((A, B, C, sign * G.D[[i]][:, [j]]), 0.0)

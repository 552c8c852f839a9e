"""Distances between plants in closed loop: the nu-gap, and the coprime margin to compare it with.

With the coprime margin b of a loop (P1, K), K stabilises every P2 with a nu-gap below b, and
arcsin b(P2, K) >= arcsin b(P1, K) - arcsin nu-gap(P1, P2).

Source: G. Vinnicombe, Uncertainty and feedback: H-infinity loop-shaping and the nu-gap metric,
Imperial College Press (2001).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker, no_better
from workbench.certificate import EVERY_FREQUENCY, Check, relative_excess
from workbench.certify.eigenvalues import pole_discs
from workbench.certify.rounding import exact
from workbench.certify.stable_system import angular_frequency, bilinear_frequency
from workbench.errors import InputError
from workbench.input_checks import common_time_base, need_sampling_time, need_tolerance
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.margins.returned import need_matching, need_stable_loop, returned_loop
from workbench.mu.robust.margin_bounds import RECIPROCAL_ROUNDING, reciprocal
from workbench.second_opinion.distances import chordal_distance, loop_distance
from workbench.second_opinion.loops import SAMPLED_ROUNDING
from workbench.second_opinion.responses import tried_frequencies
from workbench.structure import Full, Structure
from workbench.systems.balancing import balanced, singular
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.equations.riccati import right_factors
from workbench.systems.realisation import realisation, transposed_system
from workbench.uncertainty.algebra.system import uncertain


@dataclass(frozen=True, repr=False)
class NuGap(Answer):
    """Bounds of the nu-gap of two plants, from 0 to 1.

    ``omega`` [rad/s] is the frequency of the largest chordal distance. ``winding`` is False if the
    winding number condition fails; the nu-gap is 1 then. None: the condition is undecided, and
    ``upper`` is 1.
    """

    lower: float
    upper: float
    omega: float
    winding: bool | None


@dataclass(frozen=True, repr=False)
class CoprimeMargin(Answer):
    """Bounds of b(P, K): the nu-gap below which every plant is stabilised by the controller.

    Unlike `LoopMargins`, it is one number for all channels, in the nu-gap.
    """

    lower: float
    upper: float
    omega: float


@dataclass(frozen=True, eq=False)
class NuGapChecker(PartsChecker):
    """Checks a `NuGap` of two plants in continuous time, which may stand for sampled ones.

    ``distance`` is the peak of their chordal distance, ``period`` [s] the sampling time of sampled
    plants.
    """

    first: StateSpace
    second: StateSpace
    period: float
    distance: Peak

    @property
    def quantifier(self) -> str:
        return f"{EVERY_FREQUENCY}, for these two plants"

    def parts(self, answer: NuGap) -> Mapping[str, Peak]:
        return {"chordal distance": self.distance}

    def checks(self, answer: NuGap, tolerance: float) -> list[Check]:
        factors = right_factors(self.first, "first"), right_factors(self.second, "second")
        winding = _winds_not(*factors)
        lower = 1.0 if winding is False else self.distance.lower
        upper = self.distance.upper if winding else 1.0
        statement = "by which share it is better than the proven one"
        return no_better(answer, lower, min(upper, 1.0), statement, RECIPROCAL_ROUNDING)

    def second_opinion(self, answer: NuGap) -> list[Check]:
        """Check by the formula for the responses of both plants, without coprime factors."""
        poles = np.concatenate([one.poles() for one in (self.first, self.second)])
        omega = _inner(tried_frequencies(poles, bilinear_frequency(answer.omega, self.period)))
        chord = chordal_distance(self.first, self.second, omega)
        worst = int(np.argmax(chord))
        return [
            Check(
                "sampled distance",
                "largest chordal distance over the claimed gap, less 1",
                relative_excess(float(chord[worst]), answer.upper),
                SAMPLED_ROUNDING,
                over=f"at {omega.size} frequencies",
            )
        ]


@dataclass(frozen=True, eq=False)
class CoprimeChecker(PartsChecker):
    """Checks a `CoprimeMargin`; ``norm`` is the peak whose reciprocal it is."""

    plant: StateSpace
    controller: StateSpace
    norm: Peak

    @property
    def quantifier(self) -> str:
        return f"{EVERY_FREQUENCY}, for this one loop"

    def parts(self, answer: CoprimeMargin) -> Mapping[str, Peak]:
        return {"norm": self.norm}

    def checks(self, answer: CoprimeMargin, tolerance: float) -> list[Check]:
        lower, upper = reciprocal(self.norm.upper), reciprocal(self.norm.lower)
        statement = "by which share it is better than the reciprocal of the proven norm"
        return no_better(answer, lower, upper, statement, RECIPROCAL_ROUNDING)

    def second_opinion(self, answer: CoprimeMargin) -> list[Check]:
        """Check by the chordal distance of the plant from the controller's inverse."""
        P, K = self.plant, self.controller
        poles = np.concatenate([P.poles(), K.poles()])
        omega = _inner(tried_frequencies(poles, answer.omega, P.dt))
        margin = loop_distance(P, K, omega)
        worst = int(np.argmin(margin))
        return [
            Check(
                "sampled margin",
                "claimed margin over the least of those sampled, less 1",
                relative_excess(answer.lower, float(margin[worst])),
                SAMPLED_ROUNDING,
                over=f"at {omega.size} frequencies",
            )
        ]


def nu_gap(first: Any, second: Any, *, tolerance: float = 1e-4) -> NuGap:
    """The nu-gap of two plants, proven between grid points for their computed coprime factors.

    The supremum of the chordal distance is the nu-gap only if det(N2~ N1 + M2~ M1) does not wind
    about 0, which means that it has as many zeros right of the axis as G2~ has poles. The zeros are
    counted in discs that are proven to contain them.

    Parameters
    ----------
    first, second
        Systems of the same numbers of inputs and outputs, in continuous or sampled time.
    tolerance
        Relative distance of the bounds.

    Raises
    ------
    InputError
        Sizes or sampling times differ.
    SolverError
        A plant has no normalised coprime factors: a mode on the axis is hidden.
    """
    need_tolerance(tolerance)
    P1, P2 = as_system(first, "first"), as_system(second, "second")
    if (P1.noutputs, P1.ninputs) != (P2.noutputs, P2.ninputs):
        raise InputError(
            f"first has {P1.noutputs} outputs and {P1.ninputs} inputs, second {P2.noutputs} and "
            f"{P2.ninputs}; they must be the same"
        )
    dt = common_time_base((P1.dt, P2.dt))
    need_sampling_time(dt, "first")
    period = float(dt or 0.0)
    if period:
        P1, P2 = bilinear_continuous(P1), bilinear_continuous(P2)
    G1, G2 = right_factors(P1, "first"), right_factors(P2, "second")
    left = transposed_system(
        right_factors(transposed_system(P2), "second")
    )  # [N2 M2], coprime from the left
    p, m = P1.noutputs, P1.ninputs
    # N2 M1 - M2 N1, the first plant's factors from the left
    turn = np.block([[np.zeros((m, p)), np.eye(m)], [-np.eye(p), np.zeros((p, m))]])
    chord = left * realisation((G1.A, G1.B, turn @ G1.C, turn @ G1.D), 0.0)
    found = peak(chord, Structure([Full(m, p)]), tolerance=tolerance)
    omega = float(angular_frequency(found.omega, period))
    winding = _winds_not(G1, G2)
    lower, upper = min(found.lower, 1.0), min(found.upper, 1.0)
    if not winding:
        lower, upper = (1.0 if winding is False else lower), 1.0
    return NuGap(lower, upper, omega, winding).with_checker(NuGapChecker(P1, P2, period, found))


def coprime_margin(plant: Any, controller: Any, *, tolerance: float = 1e-4) -> CoprimeMargin:
    """The normalised coprime margin b(P, K) of a loop u = -K y, proven between grid points.

    Raises
    ------
    InputError
        Plant and controller do not fit each other, or their loop is unstable.
    """
    need_tolerance(tolerance)
    P, K = as_system(plant, "plant"), as_system(controller, "controller")
    need_matching(P, K)
    m, p = P.ninputs, P.noutputs
    loop = returned_loop(uncertain(P), uncertain(K)).nominal
    need_stable_loop(loop)
    # K y = -(u before the added signal), and y after the added signal.
    through = np.block([[np.zeros((m, m + p))], [np.zeros((p, m)), np.eye(p)]])
    signs = np.diag([-1.0] * m + [1.0] * p)
    whole = realisation((loop.A, loop.B, signs @ loop.C, signs @ loop.D + through), loop.dt or 0.0)
    found = peak(whole, Structure([Full(m + p, m + p)]), tolerance=tolerance)
    margin = CoprimeMargin(1.0 / found.upper, 1.0 / found.lower, found.omega)
    return margin.with_checker(CoprimeChecker(P, K, found))


def _inner(omega: RealArray) -> RealArray:
    """The frequencies (F,) other than 0 and infinity; one arbitrary frequency if there is no other.

    The case occurs for static gains, whose response is the same everywhere, and integrators, which
    have no frequency of their own.
    """
    found = omega[(omega > 0) & np.isfinite(omega)]
    return found if found.size else np.ones(1)


def _winds_not(G1: StateSpace, G2: StateSpace) -> bool | None:
    """Whether det(G2~ G1) has as many zeros right of the axis as poles; None: undecided."""
    adjoint = realisation((-G2.A.T, G2.C.T, -G2.B.T, G2.D.T), 0.0)
    whole = adjoint * G1
    if singular(whole.D):  # the determinant is 0 at infinity
        return False
    if not whole.nstates:
        return True
    zeros = whole.A - whole.B @ np.linalg.solve(whole.D, whole.C)
    scaled, _, _ = balanced(zeros, np.zeros((len(zeros), 0)), np.zeros((0, len(zeros))))
    discs = pole_discs(exact(scaled))
    right = discs.centre.real > discs.radius
    left = discs.centre.real < -discs.radius
    if not (right | left).all():
        return None
    return int(right.sum()) == G2.nstates

"""Bounds of mu over frequency, on a grid that finds narrow peaks."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench import figures
from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.heavy_types import Figure
from workbench.answer import Answer
from workbench.certificate import Check, Checker
from workbench.certify.agreement import need_agreement
from workbench.certify.band_cover import FrequencyBounds, refined_bounds
from workbench.certify.mu_bound import structured
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.errors import InputError
from workbench.input_checks import need_structure
from workbench.mu.lower.bound import lower_bound
from workbench.mu.lower.program import LowerBound, MuLowerBound
from workbench.mu.upper.bound import upper_bound
from workbench.mu.upper.program import MuUpperBound, UpperBound
from workbench.second_opinion.responses import plain_response
from workbench.structure import Structure
from workbench.systems.conversion import as_system
from workbench.systems.range_hints import warn_far_frequencies

RESPONSE_ROUNDING = 1e-6
"""Largest relative difference allowed between responses that are computed in two ways. Poles near
the axis and large realisations lose half of the digits of a double. With half of it a true response
may be contradicted; double overlooks an error of 2e-6.
"""
MET = 1e-3
"""A lower bound this close to the upper one, relative, is accepted without a further search. Nobody
needs mu at one frequency to more. With half of it the thorough search runs more often; double
leaves gaps of 0.2 %.
"""


@dataclass(frozen=True, repr=False)
class Sweep(Answer, FrequencyBounds):
    """Bounds of mu over frequency; ``Delta`` (F, r, c) proves the lower bounds ``lower`` (F,)."""

    lower: RealArray
    Delta: Array


@dataclass(frozen=True, eq=False)
class SweepChecker(Checker):
    """Checks a `Sweep` of a system, as given to `frequency_sweep`, and its structure."""

    system: Any
    structure: Structure
    frequencies: int

    @property
    def quantifier(self) -> str:
        return f"at {self.frequencies} frequencies, between them nothing"

    def checks(self, answer: Sweep, tolerance: float) -> list[Check]:
        stable = stable_system(self.system, sampled=True)
        M = stable.response(stable.plane(answer.omega))
        upper = UpperBound(answer.upper, answer.D_left, answer.D_right, answer.G)
        lower = LowerBound(answer.lower, answer.Delta)
        found = [
            *MuUpperBound(answer.M, self.structure).checks(upper, tolerance),
            *MuLowerBound(answer.M, self.structure).checks(lower, tolerance),
        ]
        return [_same_response(M, answer.M), *found]

    def second_opinion(self, answer: Sweep) -> list[Check]:
        M = plain_response(as_system(self.system, "system"), answer.omega)
        return [_same_response(M, answer.M)]

    def figures(self, answer: Sweep) -> dict[str, Figure]:
        """Both bounds over frequency."""
        return {"mu": mu_figure(answer)}


def mu_figure(found: Sweep, level: float | None = None) -> Figure:
    """Both bounds of mu over frequency, and the level that is proven at every one."""
    figure, (panel,) = figures.axes(1, 1)
    hertz = found.omega / (2 * np.pi)
    shown = (hertz > 0) & np.isfinite(hertz)
    for values, name, style in ((found.upper, "upper", "-"), (found.lower, "lower", ":")):
        panel.semilogx(hertz[shown], values[shown], style, label=f"{name} bound")
    if level is not None:
        panel.axhline(level, color=figures.BLACK, linestyle="--", label="at every frequency")
    figures.label(panel, x="frequency [Hz]", y="mu [1]")
    figures.legend_below(figure, panel)
    return figure


def _same_response(M: ComplexArray, claimed: ComplexArray) -> Check:
    """Check of the responses, relative to the largest entry at each frequency."""
    size = np.abs(M).max(axis=(1, 2), initial=0.0)
    apart = np.abs(M - claimed).max(axis=(1, 2), initial=0.0) / np.where(size > 0, size, 1.0)
    statement = "largest difference of the response that was bounded, relative"
    return Check("response", statement, float(apart.max(initial=0.0)), RESPONSE_ROUNDING)


def frequency_sweep(
    system: Any,
    structure: Structure,
    *,
    omega: ArrayLike | None = None,
    lower: str = "power",
    executor: Executor | None = None,
) -> Sweep:
    """Bounds of mu of a stable system over frequency.

    Parameters
    ----------
    system
        The StateSpace or TransferFunction that Delta closes, in continuous or sampled time.
    omega
        Frequencies [rad/s], not negative; infinity is allowed, for a sampled system half its
        sampling rate. None: a grid chosen from the poles, refined where the bound changes, with 0
        and infinity.
    lower
        Method of `lower_bound` for the frequencies at which ``"power"`` stays below the upper one.
    executor
        Executor that computes the upper bounds, 200 frequencies per task, such as that of
        `workbench.connect`; None: threads. The bounds are the same.

    Returns
    -------
    Sweep
        Its bounds hold at its frequencies only; `peak` certifies a bound between them too.

    Raises
    ------
    InputError
        As `stable_system`; the system does not fit the structure; frequencies are missing or wrong.
    ContradictionError
        A lower bound is above the upper one.

    Warns
    -----
    RangeWarning
        All frequencies lie above 100 times the fastest pole, or below 1/100 of the slowest.
    """
    stable = fitting(system, structure, sampled=True)
    if omega is None:
        found = refined_bounds(
            partial(bounds_at, stable, structure, executor=executor), stable.poles
        )
    else:
        try:
            points = np.unique(np.asarray(omega, dtype=float))
        except Exception:  # an object that is no array may say so by any error
            raise InputError(f"omega must be real frequencies [rad/s], not {omega!r}") from None
        if not points.size or np.isnan(points).any() or points[0] < 0:
            raise InputError("omega must have frequencies [rad/s], none of them negative or NaN")
        if not isinstance(system, StableSystem):
            warn_far_frequencies(points, system)
        found = bounds_at(stable, structure, np.unique(stable.plane(points)), executor)
    value, Delta = _lower_bounds(found, structure, lower)
    need_agreement(value, found.upper, place=lambda index: f"at {found.omega[index]:.6g} rad/s")
    parts = (
        stable.angular(found.omega),
        found.M,
        found.upper,
        found.D_left,
        found.D_right,
        found.G,
    )
    checker = SweepChecker(system, structure, found.omega.size)
    return Sweep(*parts, value, Delta).with_checker(checker)


def _lower_bounds(
    found: FrequencyBounds, structure: Structure, method: str
) -> tuple[RealArray, ComplexArray]:
    """Lower bounds (F,) and their Deltas; a slower method searches where the fast one leaves a
    gap.
    """
    fast = lower_bound(found.M, structure, method="power")
    value, Delta = fast.value, fast.Delta
    apart = value < found.upper * (1.0 - MET)
    # called even without a gap, so that the name of a method that does not exist is refused
    if method != "power":
        searched = lower_bound(found.M[apart], structure, method=method)
        better = searched.value > value[apart]
        place = np.flatnonzero(apart)[better]
        value[place], Delta[place] = searched.value[better], searched.Delta[better]
    return value, Delta


def fitting(system: Any, structure: Structure, *, sampled: bool = False) -> StableSystem:
    """The realisation of a stable system that fits the structure; InputError for any other."""
    need_structure(structure)
    stable = stable_system(system, sampled=sampled)
    structure.check(stable.D)
    return stable


def bounds_at(
    system: StableSystem,
    structure: Structure,
    omega: RealArray,
    executor: Executor | None = None,
) -> FrequencyBounds:
    """Upper bounds at frequencies [rad/s] (F,), increasing."""
    M = system.response(omega)
    bound = upper_bound(M, structure, executor=executor)
    # Bounds need only the part of the multipliers that the structure allows, so proofs store this
    # part.
    multipliers = structured(structure, bound.D_left, bound.D_right, bound.G)
    return FrequencyBounds(omega, M, bound.value, *multipliers)

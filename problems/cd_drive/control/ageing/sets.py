"""Sets of plants with an ageing suspension, and controllers that are made for them.

Table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from functools import partial
from typing import Literal

from workbench import solve
from workbench.errors import SolverError
from workbench.mu import performance_peak
from workbench.solvers import Options
from workbench.synthesis import PEAK_TOLERANCE, MuSynthesis
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant, Parameter, ParametricModel, parametric_lft

from ...drive.plants import controller
from ...drive.tables import Axis, nominal_table
from ...uncertainty.parametric_model import two_masses, uncertain_parameters
from ..design import synthesis_plant
from .start import Suspension

Design = Literal["fixed", "dk"]
AGEING = ("k1", "b1")
"""Parameters of the suspension that fall as it ages."""
CERTAIN = 1e-3
"""Relative tolerance of a parameter that counts as known."""


Range = tuple[float, float]
"""Lowest and highest value of a parameter."""


def life(axis: Axis, softest: float) -> dict[str, Range]:
    """Ranges of k1 and b1 of all drives, from new down to the share `softest` of their values.

    New drives have the tolerance of Table 5.3 (k1) and of Table 5.2 (b1).
    """
    table = nominal_table(axis)
    tolerances = {one.name: one.tolerance for one in uncertain_parameters(axis)}
    found = {}
    for name in AGEING:
        nominal, tolerance = table[name].nominal, tolerances.get(name, table[name].tolerance)
        found[name] = softest * nominal * (1 - tolerance), nominal * (1 + tolerance)
    return found


def narrowed(known: dict[str, Range], suspension: Suspension) -> dict[str, Range]:
    """Intersection of the ranges known beforehand with those found at a start.

    Raises SolverError if it is empty: the start then contradicts the prior knowledge.
    """
    left = {}
    for one in suspension.parameters:
        low, high = known[one.name]
        low = max(low, one.nominal * (1 - one.tolerance))
        high = min(high, one.nominal * (1 + one.tolerance))
        if low >= high:
            raise SolverError(f"{one.name} was found outside of what is known of it")
        left[one.name] = low, high
    return left


def aged_model(axis: Axis, ranges: dict[str, Range]) -> ParametricModel:
    """R and k2 uncertain as in Table 5.3, and k1 and b1 within these ranges."""
    others = [one for one in uncertain_parameters(axis) if one.name not in AGEING]
    ageing = [
        Parameter(name, (high + low) / 2, (high - low) / (high + low))
        for name, (low, high) in ranges.items()
    ]
    return _model(axis, [*others, *ageing])


def all_known(axis: Axis, softening: float) -> ParametricModel:
    """The nominal drive with an aged suspension and nothing uncertain, which no identification can
    beat.
    """
    table = nominal_table(axis)
    known = [Parameter(n, softening * table[n].nominal, CERTAIN) for n in AGEING]
    return _model(axis, known)


def _model(axis: Axis, uncertain: list[Parameter]) -> ParametricModel:
    """u [V] -> f_en [units] with these parameters uncertain, the others those of Table 5.2."""
    names = [one.name for one in uncertain]
    certain = {n: entry.nominal for n, entry in nominal_table(axis).items() if n not in names}
    return parametric_lft(partial(two_masses, **certain), uncertain, inputs=["u"], outputs=["f_en"])


def plant_of(axis: Axis, model: ParametricModel, speed: float = 1.0) -> GeneralisedPlant:
    """The plant for which controllers are made and on which they are judged."""
    return synthesis_plant(axis, model, speed)


def designed(axis: Axis, plant: GeneralisedPlant, design: Design, options: Options) -> StateSpace:
    """A controller for a plant: of third order from the reference controller, or by D-K iteration.

    Raises SolverError if the method gives none.
    """
    import control

    start = control.ss(controller(axis)) if design == "fixed" else None
    solution = solve(MuSynthesis(plant, start=start), method=design, options=options)
    if solution.answer is None:
        raise SolverError(f"{design} gave no controller: {solution.message}")
    K: StateSpace = solution.answer.K
    return K


def peak_of(plant: GeneralisedPlant, K: StateSpace) -> tuple[float, float]:
    """Certified bounds on the peak of mu; infinite if the nominal loop is unstable."""
    found = performance_peak(plant, K, tolerance=PEAK_TOLERANCE)
    return (float("inf"), float("inf")) if found is None else (found.lower, found.upper)

"""Two masses on two springs, fitted to a response that was measured in the loop (section 4.3.2).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from workbench import solve
from workbench.errors import SolverError
from workbench.identification import (
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    PeriodicResponse,
)
from workbench.solvers import Options
from workbench.types import ComplexArray, RealArray

from ..drive.plants import nominal_parameters
from ..drive.tables import Axis
from ..drive.two_masses import FITTED, LumpedValues, lens_on_arms, mismatch_names
from .in_the_loop import Chain, LoopExperiment, LoopRecord, neighbours_p, pool_steps
from .known_values import CHAIN, CONFIDENCE, Lumped, arm_parameters, chain_known, chain_ratio
from .unknowns import GAIN_DEVIATION, Told

ARM_SHARES = np.geomspace(0.5, 2.0, 9)
"""Springs and masses of the arm, over the nominal ones, that are tried as starting values of a fit.
"""
MISMATCHES = (0.1, 0.2, 0.35, 0.5)
"""Mismatches of the first arm that are tried as starting values of a fit of unlike arms."""
NUMBERS = (
    "gain",
    "chi_square",
    "chi_square_p",
    "neighbours_p",
    "independent_p",
    "unproven",
    "covered_response",
    "error_fitted",
)
"""Names of the numbers that describe the fit of a draw."""


class LoopFit(NamedTuple):
    """The fit of one draw.

    value, half_width (6,): parameters FITTED. response, radius, fitted, exact (F,): measured
    response with the radius of its region, fitted one, and one without noise, all with the told
    measurement chain.
    """

    value: RealArray
    half_width: RealArray
    response: ComplexArray
    radius: RealArray
    fitted: ComplexArray
    exact: ComplexArray
    numbers: dict[str, float]
    notes: list[str]


def fit_of_draw(
    experiment: LoopExperiment,
    record: LoopRecord,
    told: Told,
    known: Lumped,
    options: Options,
    arms: int = 1,
) -> LoopFit:
    """Fit of two masses on two springs to one draw; the second mass may be in several unlike arms.

    Raises SolverError if there is no answer.
    """
    bench, grid = experiment.bench, experiment.frequency
    chain = Chain.told(bench, told).response(grid)
    estimate = _lens_response(record.estimate, chain)
    program = two_mass_fit(estimate, known, bench.axis, arms)
    solution = solve(program, options=options)
    if solution.answer is None or solution.certificate is None:
        raise SolverError(f"the fit gave no answer: {solution.message}")
    found = solution.answer
    p, s = dict(zip(program.names, found.tolist(), strict=True)), 2j * np.pi * grid
    fitted = lens_on_arms(p, s, known.R, arms) * chain_ratio(p, s)
    response, radius = estimate.response[:, 0, 0], estimate.radius(confidence=CONFIDENCE)[:, 0, 0]
    exact = bench.actuator.response(grid) * Chain.told(bench).response(grid) / chain
    chi_square, p_value = program.chi_square(found)
    numbers = {
        "gain": p["gain"],
        "chi_square": chi_square,
        "chi_square_p": p_value,
        "neighbours_p": neighbours_p((response - fitted) / radius, pool_steps(grid)),
        "independent_p": record.estimate.assumptions.independent,
        "unproven": len(solution.certificate.failures),
        "covered_response": (abs(response - exact) <= radius).mean(),
        "error_fitted": (abs(fitted - exact) / abs(exact)).max(),
    }
    value, half_width = found[: len(FITTED)], program.intervals(found)[: len(FITTED)]
    shown = response, radius, fitted, exact
    return LoopFit(value, half_width, *shown, numbers, program.notes(found))


def _lens_response(raw: PeriodicResponse, chain: ComplexArray) -> PeriodicResponse:
    """A measured f_en/u_m, divided by the measurement chain (F,): x / coil voltage."""
    factor = chain[:, None, None]
    variance = raw.variance / abs(factor) ** 2
    return replace(raw, response=raw.response / factor, variance=variance)


def two_mass_fit(
    estimate: PeriodicResponse, known: Lumped, axis: Axis, arms: int = 1
) -> ParameterFit:
    """Fit of the masses, springs and dampers to a measured response x / coil voltage [m/V].

    The force factor and the measurement chain are fitted as well, since they are not known exactly
    either. The search starts at the best of several arms with the known lumped values, because a
    resonance in noise has other minima, at which the arm's mass diverges. If the arm is in several
    parts, their mismatches are fitted too, and the starts have mismatches of several sizes.
    """

    def model(p: Any, s: Any) -> Any:
        return lens_on_arms(p, s, known.R, arms) * chain_ratio(p, s)

    response, chain = MeasuredResponse.of(model, estimate), chain_known(GAIN_DEVIATION[axis])
    data: list[Any] = [response, known.data, chain]
    mismatches = {
        name: FittedParameter(0.0, lower=-0.95, upper=0.95) for name in mismatch_names(arms)
    }
    parameters = arm_parameters(axis, (*FITTED, "Bl")) | CHAIN | mismatches
    program = ParameterFit(data, parameters)
    shape = np.linspace(1.0, -1.0, arms)[:-1]
    starts = [
        np.array([*arm.values(), known.values.Bl, *np.ones(len(CHAIN)), *(size * shape)])
        for arm in _starting_arms(known.values, axis)
        for size in (MISMATCHES if arms > 1 else (0.0,))
    ]
    best = min(starts, key=lambda values: float(np.linalg.norm(program.residuals(values))))
    near = dict(zip(program.names, best.tolist(), strict=True))
    return ParameterFit(data, {n: replace(one, start=near[n]) for n, one in parameters.items()})


def _starting_arms(values: LumpedValues, axis: Axis) -> Iterator[dict[str, float]]:
    """FITTED parameters with these lumped values, for arms with link and mass around the nominal
    ones.
    """
    arm = nominal_parameters(axis)
    for share, weight in product(ARM_SHARES, ARM_SHARES):
        k2, m2, b2 = share * arm.k2, weight * arm.m2, arm.b2
        k1 = values.k * k2 / (k2 - values.k)
        rho = k2 / (k1 + k2)
        m1, b1 = values.m - m2 * rho**2, (values.b - b2 * (1 - rho) ** 2) / rho**2
        yield dict(zip(FITTED, (m1, m2, k1, k2, b1, b2), strict=True))

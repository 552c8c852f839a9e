"""Mixed H2/H-infinity synthesis by linear matrix inequalities, with any conic solver."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench.accuracy import AccuracyRange
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Options, Outcome, solve_conic
from workbench.synthesis.h2.direct import with_D22, without_D22
from workbench.synthesis.h2.methods import claim_of_step, riccati_step
from workbench.synthesis.h2.program import H2Synthesis
from workbench.synthesis.mixed_norms.inequalities import MixedInequalities
from workbench.synthesis.mixed_norms.program import H2HinfSynthesis
from workbench.systems.balancing import balanced, speed
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

MOST_STATES = 20
"""Largest number of states of a plant. The semidefinite programs of larger plants take too long."""
RISES = (0.0, 1e-4, 1e-3, 1e-2, 5e-2, 0.2)
"""Relative distances above the least bound, tried until the loop keeps the limit and the bound."""
SHARES = (0.0, -1.0, 1.0, -2.0, 2.0, -3.0, 3.0, -4.0, 4.0)
"""Decimal logarithms of the shares of gamma tried first."""
FINER_STEPS = (0.5, 0.25, 0.12, 0.06)
"""Steps of the decimal logarithm, tried on both sides of the best share so far."""
INSIDE = 1.0 - 1e-3
"""The inequalities ask for this share of the limit, since solvers satisfy them only up to their
accuracy.
"""
FINEST_ACCURACY = 1e-7
"""Finest accuracy asked of solvers."""


def _unfit(program: H2HinfSynthesis) -> str | None:
    """Why the method cannot solve the program; None where it can."""
    states = program.plant.system.nstates
    if program.further_plants:
        return "it has several plants"
    if not states:
        return "it has no states"
    if states > MOST_STATES:
        return f"it has {states} states; LMIs are practical for at most {MOST_STATES}"
    return None


@conic_method(
    H2HinfSynthesis, optimal=False, unfit=_unfit, accuracy=AccuracyRange(finest=FINEST_ACCURACY)
)
def _conic(program: H2HinfSynthesis, context: Context, solver: ConicSolver) -> Claim:
    """One Lyapunov matrix for both norms; the H2 bound may exceed its least value by a fifth."""
    options = replace(context.options, tolerance=max(context.options.accuracy, FINEST_ACCURACY))
    given = standard_plant(program.plant)
    plant, rate = _scaled_plant(without_D22(given))
    channels = _channel(program, plant, "nominal"), _channel(program, plant, "perturbation")
    with context.stating():
        stated = MixedInequalities(*channels, INSIDE * program.gamma)
    energy, said = _least_energy(stated, solver, options, context)
    if not math.isfinite(energy):
        message = "no Lyapunov matrix common to both norms was found; gamma may be too small"
        return None, Outcome.FAILED, f"{said}: {message}"
    least = least_norm(program)
    for rise in context.track(RISES, "distances"):
        if rise:
            outcome, said = _well_conditioned(
                stated, energy * (1 + rise) ** 2, solver, options, context
            )
            if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
                continue
        bound = math.sqrt(rate * energy) * (1 + rise)
        try:
            A, B, C, D = stated.controller()
            root = math.sqrt(rate)
            K = with_D22((rate * A, root * B, root * C, D), given.D22)
            answer = program.answer(realisation(K, given.dt), bound=bound, least=least)
        except (np.linalg.LinAlgError, ArithmeticError, InputError) as error:
            said = f"{said}; {error}"
            continue
        if answer is not None and answer.norm <= bound:
            return answer, Outcome.SOLVED, f"{said}; an upper bound by a common Lyapunov matrix"
    return None, Outcome.FAILED, f"{said}; no controller of the values found keeps the bounds"


def least_norm(program: H2HinfSynthesis) -> float:
    """The least H2 norm without the limit, for the plant where it is largest; NaN if it is not
    known.
    """
    found = []
    for plant in program.plants:
        try:
            answer, *_ = claim_of_step(H2Synthesis(plant.nominal()), riccati_step)
        except (InputError, SolverError):
            continue
        if answer is not None and not math.isnan(answer.least):
            found.append(answer.least)
    return max(found, default=math.nan)


def _least_energy(
    stated: MixedInequalities, solver: ConicSolver, options: Options, context: Context
) -> tuple[float, str]:
    """The least bound on the energy over shares of gamma, and the solver's message. The bound is
    infinite where none was found.
    """
    import cvxpy as cp

    problem = cp.Problem(cp.Minimize(stated.energy), stated.constraints)
    found: dict[float, float] = {}
    said = ""

    def energy(log: float) -> float:
        nonlocal said
        stated.set_share(10.0**log)
        outcome, said = solve_conic(problem, solver, options, context)
        solved = outcome in (Outcome.SOLVED, Outcome.INACCURATE)
        found[log] = float(stated.energy.value) if solved else math.inf
        return found[log]

    for log in context.track(SHARES, "shares"):
        energy(log)
    best = min(found, key=lambda log: found[log])
    if math.isfinite(found[best]):
        for step in FINER_STEPS:
            for log in (best - step, best + step):
                energy(log)
            best = min(found, key=lambda log: found[log])
        energy(best)
    return found[best], said


def _well_conditioned(
    stated: MixedInequalities,
    energy: float,
    solver: ConicSolver,
    options: Options,
    context: Context,
) -> tuple[Outcome, str]:
    """Solve again for small X and Y with this bound on the energy, because the controller of the
    least bound is ill-conditioned.
    """
    import cvxpy as cp

    size = cp.trace(stated.X) + cp.trace(stated.Y)
    held = [*stated.constraints, stated.energy <= energy]
    return solve_conic(cp.Problem(cp.Minimize(size), held), solver, options, context)


def _scaled_plant(plant: StandardPlant) -> tuple[StandardPlant, float]:
    """The plant with balanced states and time scaled by its own rate [rad/s], and that rate."""
    rate = 1.0 if plant.dt else speed(plant.A, plant.B, plant.C)
    root = math.sqrt(rate)
    A, B, C = balanced(plant.A / rate, plant.B / root, plant.C / root)
    return replace(plant, A=A, B=B, C=C), rate


def _channel(program: H2HinfSynthesis, plant: StandardPlant, which: str) -> StandardPlant:
    """A scaled plant with only some of its exogenous inputs and performance outputs."""
    channel = program.plant.perturbation()
    rows, columns = channel.performance, channel.exogenous
    z, w = plant.D11.shape
    outputs, inputs = (slice(rows, z), slice(columns, w))
    if which == "perturbation":
        outputs, inputs = slice(0, rows), slice(0, columns)
    kept = np.r_[outputs, z : len(plant.C)], np.r_[inputs, w : plant.B.shape[1]]
    return replace(
        plant, B=plant.B[:, kept[1]], C=plant.C[kept[0]], D=plant.D[np.ix_(kept[0], kept[1])]
    )

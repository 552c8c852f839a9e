"""Direct, two-stage, instrumental-variable and indirect methods for closed loops.

Sources: P. Van den Hof, R. Schrama, "An indirect method for transfer function estimation from
closed loop data", Automatica 29(6), 1993 (two stages); L. Ljung, System Identification, 2nd ed.,
1999, section 13.5 (direct and indirect).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import InputError
from workbench.executor import Context
from workbench.identification.closed_loop.explained import excitation_of, steady_response
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.closed_loop.starts import (
    LoopStarts,
    allowed_instruments,
    best_by_instruments,
    with_gain,
)
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import all_but_gain
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.prediction_error import refine
from workbench.identification.state_space.methods import (
    CONVERGED,
    FitterOfOrder,
    claim,
    identify,
    refined_fits,
)
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import least_of
from workbench.identification.state_space.subspace import best_subspace_of
from workbench.program import Claim, method
from workbench.systems.sampling import respond

TRIED = 2
"""Number of starts for the direct method's search, which ends when it has converged.

Without a model that follows the noise, one search in eight ends in a local minimum, and a step that
gains only 1 is still far from the minimum: estimates would scatter with the points where searches
stopped.
"""


@method(ClosedLoopFit, "direct", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _direct(program: ClosedLoopFit, context: Context) -> Claim:
    """Prediction errors of u and y; assumes a model of the noise that is rich enough."""
    way = refined_fits(program, LoopStarts(program), 0.0, TRIED, CONVERGED)
    return claim(identify(program, way, way, context))


def _refuses_knowledge(program: ClosedLoopFit) -> str | None:
    known = "it does not hold models to known poles and gains; take method direct"
    return None if program.known is None else known


def _needs_free_runs(program: ClosedLoopFit) -> str | None:
    if program.poles == "any":
        return (
            'its models are stable, and poles is "any"; take method direct or '
            "instrumental-variables, or say that the plant is stable by poles"
        )
    return _refuses_knowledge(program)


@method(
    ClosedLoopFit,
    "two-stage",
    optimal=False,
    unfit=_needs_free_runs,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _two_stage(program: ClosedLoopFit, context: Context) -> Claim:
    """Output error for the part of u that r explains; assumes a linear loop, a stable plant."""
    way = _simulators(program, explained_input)
    return claim(identify(program, way, way, context))


@method(
    ClosedLoopFit,
    "instrumental-variables",
    optimal=False,
    unfit=_refuses_knowledge,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _instrumental_variables(program: ClosedLoopFit, context: Context) -> Claim:
    """ARX; the instruments are the parts of u and y that r explains; assumes a linear loop."""

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            clean = program.explained_part(record)
            if clean is None:
                return None
            best = best_by_instruments(program, record, clean, order, program.largest_radius)
            return best and with_gain(program, best, record)

        return fit

    return claim(identify(program, way, way, context))


def _no_controller(program: ClosedLoopFit) -> str | None:
    if program.controller is None:
        return "it needs the controller"
    return _needs_free_runs(program)


@method(ClosedLoopFit, "indirect", optimal=False, unfit=_no_controller, accuracy=ANY_ACCURACY_ALIKE)
def _indirect(program: ClosedLoopFit, context: Context) -> Claim:
    """Uses the part of y that r explains, and u by the controller; assumes a known controller."""
    way = _simulators(program, rebuilt_input)
    return claim(identify(program, way, way, context))


CleanInput = Callable[[ClosedLoopFit, Experiments, Experiments], RealArray]
"""Function that returns a noise-free input (N, nu), from a program, a record and its explained
part.
"""


def explained_input(program: ClosedLoopFit, record: Experiments, clean: Experiments) -> RealArray:
    """The part of u that the excitation explains."""
    return clean.u


def rebuilt_input(program: ClosedLoopFit, record: Experiments, clean: Experiments) -> RealArray:
    """The excitation minus the controller's response to the explained part of y."""
    fed = _fed_back(program, clean.y - clean.y.mean(axis=0))
    u = excitation_of(record) - fed
    # integrators do not determine a level
    return np.asarray(u - u.mean(axis=0) + clean.u.mean(axis=0))


def _fed_back(program: ClosedLoopFit, y: RealArray) -> RealArray:
    """Output (N, nu) of the controller for y (N, ny); it starts at rest unless y is periodic."""
    controller, period = program.controller, program.period_samples
    if controller is None:
        raise InputError("the controller is missing; give it, or take method two-stage")
    if period is None:
        return respond(controller, y)

    def response(frequency: RealArray) -> ComplexArray:
        z = np.exp(2j * np.pi * frequency)
        return np.moveaxis(np.asarray(controller(z, squeeze=False)), -1, 0)

    steady = steady_response(response, y[:period])
    return np.tile(steady, (len(y) // period + 1, 1))[: len(y)]


def _simulators(program: ClosedLoopFit, clean_input: CleanInput) -> FitterOfOrder:
    """Fitting functions that minimise free-run errors for a noise-free input."""

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            clean = program.explained_part(record)
            if clean is None:
                return None
            clean = replace(clean, u=clean_input(program, record, clean))
            # With a periodic excitation, the noise between the lines carries no information, but it
            # would change the modes that no line excites.
            y = record.y if program.period_samples is None else clean.y
            model = _simulator(program, clean, order, replace(record, u=clean.u, y=y, starts=(0,)))
            return model and with_gain(program, model, record)

        return fit

    return way


def _simulator(
    program: ClosedLoopFit, clean: Experiments, order: int, record: Experiments
) -> InnovationsModel | None:
    """State-space model with the least free-run errors, without a model of the noise.

    The search starts from the result for the explained record: in the measured record the noise may
    be larger than the input's effect.
    """
    largest = min(program.largest_radius, 1.0)
    models = [
        best_subspace_of(clean, order, direct=program.direct, largest_radius=largest),
        *allowed_instruments(program, clean, clean, order, largest),
    ]
    still = [replace(m, K=np.zeros_like(m.K)) for m in models if m is not None and m.radius < 1]
    start = least_of(still, lambda model: program.misfit(model, clean))
    if start is None:
        return None
    free = all_but_gain(start)
    return refine(start, record, 0.0, direct=program.direct, largest_radius=largest, entries=free)[
        0
    ]

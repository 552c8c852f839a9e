"""Direct, two-stage, instrumental-variable and indirect methods for closed loops.

Sources: P. Van den Hof, R. Schrama, "An indirect method for transfer function estimation from
closed loop data", Automatica 29(6), 1993 (two stages); L. Ljung, System Identification, 2nd ed.,
1999, sections 13.5 (direct and indirect) and 7.6 (instrumental variables).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.prediction_error import refine
from workbench.identification.polynomials.regressions import arx_from_lags, impulse_response
from workbench.identification.state_space.methods import (
    FitterOfOrder,
    SubspaceStarts,
    claim,
    identify,
    refined_fits,
)
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import allowed
from workbench.identification.state_space.subspace import best_subspace_of
from workbench.program import Claim, method


@method(ClosedLoopFit, "direct", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _direct(program: ClosedLoopFit, context: Context) -> Claim:
    """Prediction errors of u and y; assumes that the model of the noise is rich enough."""
    starts = SubspaceStarts(program)
    way = refined_fits(program, starts, 0.0)
    return claim(identify(program, way, way, context))


def _refuses_knowledge(program: ClosedLoopFit) -> str | None:
    known = "it does not hold models to known poles and gains; take method direct"
    return None if program.known is None else known


@method(
    ClosedLoopFit,
    "two-stage",
    optimal=False,
    unfit=_refuses_knowledge,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _two_stage(program: ClosedLoopFit, context: Context) -> Claim:
    """What r explains of u, then its output error; assumes a linear loop and a stable plant."""

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            explained = _explained(record)
            if explained is None:
                return None
            clean = replace(record, u=explained[0], starts=(0,))
            return _simulator(program, clean, order)

        return fit

    return claim(identify(program, way, way, context))


@method(
    ClosedLoopFit,
    "instrumental-variables",
    optimal=False,
    unfit=_refuses_knowledge,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _instrumental_variables(program: ClosedLoopFit, context: Context) -> Claim:
    """ARX with what r explains of u and y as instruments; assumes a linear loop, no noise model."""

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            explained = _explained(record)
            if explained is None:
                return None
            model = instrumental_arx(record, *explained, order, program.direct)
            return allowed(model, record, program.direct, program.largest_radius)

        return fit

    return claim(identify(program, way, way, context))


def _no_controller(program: ClosedLoopFit) -> str | None:
    if program.controller is None:
        return "it needs the controller"
    return _refuses_knowledge(program)


@method(ClosedLoopFit, "indirect", optimal=False, unfit=_no_controller, accuracy=ANY_ACCURACY_ALIKE)
def _indirect(program: ClosedLoopFit, context: Context) -> Claim:
    """The loop from r to y, opened by the controller; assumes that it is known and r is added."""
    way = _opened(program)
    return claim(identify(program, way, way, context))


def _opened(program: ClosedLoopFit) -> FitterOfOrder:
    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            driven = replace(record, u=_excitation(record))
            own = 0 if program.controller is None else program.controller.nstates
            loop = _simulator(program, driven, order + own)
            if loop is None:
                return None
            plant = opened_loop(loop, program)
            return allowed(plant, record, program.direct, program.largest_radius)

        return fit

    return way


def opened_loop(loop: InnovationsModel, program: ClosedLoopFit) -> InnovationsModel:
    """The plant G = T (1 - C T)^-1 of a loop T from r to y; raises InputError without controller.

    Its states are those of the loop and of the controller; those of the loop hold the controller's
    too, which cancel but for the errors of the loop.
    """
    if program.controller is None:
        raise InputError("the controller is missing; give it, or take method two-stage")
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    own = [np.asarray(getattr(program.controller, name), dtype=float) for name in "ABCD"]
    # r = u + C_c y: the loop is fed by the plant's input and by the controller's output.
    inverse = np.linalg.inv(np.eye(len(C)) - D @ own[3])
    seen = inverse @ np.hstack([C, D @ own[2]])
    through = inverse @ D
    fed = np.hstack([np.zeros((len(own[3]), len(A))), own[2]]) + own[3] @ seen
    direct = np.eye(B.shape[1]) + own[3] @ through
    states = np.block(
        [[A, np.zeros((len(A), len(own[0])))], [np.zeros((len(own[0]), len(A))), own[0]]]
    )
    A_open = states + np.vstack([B @ fed, own[1] @ seen])
    B_open = np.vstack([B @ direct, own[1] @ through])
    return replace(
        loop,
        A=A_open,
        B=B_open,
        C=seen,
        D=through,
        K=np.zeros((len(A_open), len(C))),
        u_offset=loop.u_offset - _static_gain(own) @ loop.y_offset,
    )


def _static_gain(controller: list[RealArray]) -> RealArray:
    """Static gain of a controller, by its offset of y; zero where it integrates."""
    A, B, C, D = controller
    rest = np.eye(len(A)) - A
    if len(A) and np.linalg.cond(rest) > 1 / np.finfo(float).eps:
        return np.zeros_like(D)
    return np.asarray(C @ np.linalg.solve(rest, B) + D)


def _excitation(record: Experiments) -> RealArray:
    if record.excitation is None:
        raise InputError("the record has no excitation; make it by ClosedLoopFit")
    return record.excitation


def _explained(record: Experiments) -> tuple[RealArray, RealArray] | None:
    """What the excitation explains of u (N, nu) and of y (N, ny); None of too short a record."""
    r, joint = _excitation(record), np.hstack([record.u, record.y])
    model = impulse_response(Experiments(r, joint))
    if model is None:
        return None
    found = model.free_run(r, joint, model.order)
    return found[:, : record.u.shape[1]], found[:, record.u.shape[1] :]


def _simulator(program: ClosedLoopFit, record: Experiments, order: int) -> InnovationsModel | None:
    """State-space model whose free run has the least errors, without a model of the noise."""
    largest = min(program.largest_radius, 1.0)
    start = best_subspace_of(record, order, direct=program.direct, largest_radius=largest)
    if start is None:
        return None
    still = replace(start, K=np.zeros_like(start.K))
    if still.radius >= 1:
        return None
    sizes = [getattr(still, name).size for name in "ABCDK"]
    entries = np.arange(sum(sizes)) < sum(sizes[:4])
    return refine(
        still, record, 0.0, direct=program.direct, largest_radius=largest, entries=entries
    )[0]


def instrumental_arx(
    record: Experiments, u_clean: RealArray, y_clean: RealArray, order: int, direct: bool
) -> InnovationsModel:
    """ARX model of a record by instruments: its u (N, nu) and y (N, ny) without their noise."""
    means = record.u.mean(axis=0), record.y.mean(axis=0)
    u, y = record.u - means[0], record.y - means[1]
    lags = range(1, order + 1)

    def rows(inputs: RealArray, outputs: RealArray) -> RealArray:
        parts = [part[order - lag : len(part) - lag] for lag in lags for part in (inputs, outputs)]
        return np.hstack([*parts, inputs[order:]]) if direct else np.hstack(parts)

    regressors = rows(u, y)
    instruments = rows(u_clean - means[0], y_clean - means[1])
    moments = instruments.T @ regressors
    scale = np.sqrt(np.sum(regressors**2, axis=0))
    scale[scale == 0] = 1.0
    theta = np.linalg.lstsq(moments / scale, instruments.T @ y[order:], rcond=None)[0]
    found = (theta / scale[:, None]).T
    nu, ny = u.shape[1], y.shape[1]
    coefficients = found[:, : order * (nu + ny)].reshape(ny, order, nu + ny)
    D = found[:, order * (nu + ny) :] if direct else np.zeros((ny, nu))
    model = arx_from_lags(coefficients, D, np.zeros(ny))
    return replace(
        model,
        K=np.zeros_like(model.K),
        u_offset=means[0],
        y_offset=means[1],
        sample_time=record.sample_time,
        inputs=record.inputs,
        outputs=record.outputs,
    )

"""Standard deviations of models of closed loops, for noise of any spectrum.

The record is cut into parts. Each part adds a term to the equations that a method solves. These
terms scatter as the noise does, correlation over many samples included; so they show how the
estimate scatters, whether or not a model of the noise is right. With a periodic excitation the
parts are groups of its periods, and the equations are those at its lines (`of_lines`).

The direct method has a model of the noise, and is right only with it: feedback carries what this
model lacks into u, and so into the plant's model. If its errors are not white, its deviations are
infinite. If they are, they come from the curvature and its scatter over records (`curvature`), to
first order as in an open loop; slow parts of the noise need not end within a part of the record.
What the model lacks biases the plant before the errors show it. So deviations also count by how
much the response would change if the next error might depend on past ones (`whiteness`).

The part of the input that the excitation explains is an estimate too. Its error, passed through the
plant, and the loop's noise at the output add up to the plant's own noise: y minus the model's
response to the *measured* input. So the terms use that noise, and not the errors that two-stage
methods minimise.

Distortion of the plant repeats with a periodic excitation, and what a plant has beyond its model
moves every part alike, so the scatter of parts does not show them. Where the errors do
(`distortion`), deviations are at least those of a larger model.

Sources: L. Ljung, System Identification, 2nd ed., 1999, section 9.2 (the covariance if the model of
the noise is wrong); B. Efron, C. Stein, "The jackknife estimate of variance", Annals of Statistics
9(3), 1981 (instruments: each part is left out).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.errors import InputError
from workbench.identification.closed_loop.distortion import distortion_in_loop
from workbench.identification.closed_loop.instruments import filtered_by_poles, instrumental_arx
from workbench.identification.closed_loop.methods import (
    CleanInput,
    explained_input,
    rebuilt_input,
)
from workbench.identification.closed_loop.of_lines import moves_of_lines
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion, all_but_gain
from workbench.identification.innovations.curvature import (
    covariance_of_moves,
    estimates_of,
    response_along,
    root_of_inverse,
)
from workbench.identification.innovations.distortion import Distortion, distortion_of
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.whiteness import whiteness_of_errors

PARTS, FEWEST = 30, 8
"""Number of parts of a record without period; fewest periods of an excitation whose groups are the
parts.
"""
INPUTS: dict[str, CleanInput | None] = {
    "direct": None,
    "two-stage": explained_input,
    "instrumental-variables": explained_input,
    "indirect": rebuilt_input,
}
"""The input that each method uses; None: the measured one, with a model of the noise."""


def closed_loop_deviations(
    program: ClosedLoopFit, method: str, model: InnovationsModel, cycles_per_sample: ArrayLike
) -> RealArray:
    """Standard deviations (F, ny, nu) of |G - mean of G| for a method's model.

    They describe the estimate's scatter from record to record. The noise may have any spectrum, if
    its correlation ends within a part: a thirtieth of the record or, with a period, one period or
    more. They are of first order: if a criterion has several minima, estimates scatter more. If the
    errors show that the plant is distorted or of higher order, deviations are about its best linear
    approximation, the mean over realisations of the excitation. They count how far a larger model
    would be from this one, and its scatter over thirty parts of the record or, if the input
    repeats, over the lines of its spectrum. A bias that the errors do not show is not contained.

    For the direct method the order must be that of plant and noise together. If its errors are not
    white, all deviations are infinite; if they seem white, deviations count by how much the
    response would change if the noise had 12 parameters more, but a record seldom tells whether the
    order suffices. Deviations of the other methods are infinite if more than a hundredth of what
    the excitation explains of the input is noise, or more than a tenth of what it explains of the
    output. Without a period, so are those of the other methods if the model has a mode slower than
    a tenth of the record, and those of "two-stage" and "indirect" if the responses to the
    excitation have not died out where their estimates end. With thirty parts a deviation is
    accurate to about 13 percent.

    They are far too large if the model has a mode that is hardly excited.

    Parameters
    ----------
    program
        The question that was solved.
    method
        "direct", "two-stage", "instrumental-variables" or "indirect".
    model
        The answer's predictor for "direct", its simulator for the other methods.
    cycles_per_sample
        Frequencies (F,) [cycles/sample].

    Raises
    ------
    InputError
        Another method; an indirect one without the controller; a record too short to be explained.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import ClosedLoopFit, closed_loop_deviations
    >>> rng = np.random.default_rng(0)
    >>> r, v = rng.standard_normal((2, 2000))
    >>> G, C = control.tf([0.5], [1, -0.5], 1.0), control.ss([], [], [], [[0.4]], 1.0)
    >>> S = control.feedback(1, G * C)
    >>> y = control.forced_response(G * S, inputs=r).outputs
    >>> y = y + 0.1 * control.forced_response(S, inputs=v).outputs
    >>> program = ClosedLoopFit(r - 0.4 * y, y, orders=[1], direct=False, excitation=r)
    >>> model = wb.solve(program, method="two-stage").answer.simulator
    >>> found = closed_loop_deviations(program, "two-stage", model, [0.1, 0.2])
    >>> found.shape, bool((found < 0.05).all())
    ((2, 1, 1), True)
    """
    covariance = closed_loop_covariance(program, method, model, cycles_per_sample)
    return np.asarray(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1)))


def closed_loop_covariance(
    program: ClosedLoopFit, method: str, model: InnovationsModel, cycles_per_sample: ArrayLike
) -> RealArray:
    """Covariances (F, ny, nu, 2, 2) of the real and imaginary part of a model's response.

    Arguments, meaning and errors are as in `closed_loop_deviations`; its squares are the traces of
    these covariances. The response at frequency 0 is the static gain. Infinite covariances have no
    infinite entries beside the diagonal.

    Examples
    --------
    A 95 % band of the magnitude:

    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import ClosedLoopFit, closed_loop_covariance
    >>> rng = np.random.default_rng(0)
    >>> r, v = rng.standard_normal((2, 2000))
    >>> G, C = control.tf([0.5], [1, -0.5], 1.0), control.ss([], [], [], [[0.4]], 1.0)
    >>> S = control.feedback(1, G * C)
    >>> y = control.forced_response(G * S, inputs=r).outputs
    >>> y = y + 0.1 * control.forced_response(S, inputs=v).outputs
    >>> program = ClosedLoopFit(r - 0.4 * y, y, orders=[1], direct=False, excitation=r)
    >>> model = wb.solve(program, method="instrumental-variables").answer.simulator
    >>> at = np.array([0.1, 0.2])
    >>> covariance = closed_loop_covariance(program, "instrumental-variables", model, at)[:, 0, 0]
    >>> found = model.response(at)[:, 0, 0]
    >>> radial = np.array([found.real, found.imag]).T / abs(found)[:, None]
    >>> half = 1.96 * np.sqrt(np.einsum("fa,fab,fb->f", radial, covariance, radial))
    >>> exact = abs(0.5 / (np.exp(2j * np.pi * at) - 0.5))
    >>> bool((abs(abs(found) - exact) < 2 * half).all())
    True
    """
    if method not in INPUTS:
        raise InputError(f"method is {method!r}; it must be one of {', '.join(INPUTS)}")
    record, period, clean_input = program.estimation_record, program.period_samples, INPUTS[method]
    if period is not None and len(record) < FEWEST * period:
        period = None
    parts = _parts(len(record), period)
    if clean_input is None:
        return _of_direct(program, model, cycles_per_sample)
    if program.doubts(model, method):
        return _infinite(model.response(cycles_per_sample).shape)
    if period is not None:
        moves = moves_of_lines(program, clean_input, model, record, PARTS, cycles_per_sample)
    elif method == "instrumental-variables":
        moves = _of_instruments(program, model, record, parts, cycles_per_sample)
    else:
        moves = _of_errors(program, clean_input, model, record, parts, cycles_per_sample)
    share = (len(moves) - 1) / len(moves)
    found = share * covariance_of_moves(moves - moves.mean(axis=0))
    drive = clean_input(program, record, _explained(program, record))
    beyond = distortion_in_loop(
        model, record, drive, program.direct, program.washout_samples, program.period_samples
    )
    return _with_distortion(found, beyond, cycles_per_sample)


def _with_distortion(
    covariance: RealArray, beyond: Distortion | None, frequency: ArrayLike
) -> RealArray:
    """Covariances (F, ny, nu, 2, 2), and those of a larger model if the errors ask for it."""
    if beyond is None or not beyond.found:
        return covariance
    values, vectors = np.linalg.eigh(covariance_of_moves(beyond.moves(frequency)) - covariance)
    more = np.einsum("...ik,...k,...jk->...ij", vectors, np.maximum(values, 0.0), vectors)
    return np.asarray(covariance + more)


def _of_direct(program: ClosedLoopFit, model: InnovationsModel, frequency: ArrayLike) -> RealArray:
    """Covariances (F, ny, nu, 2, 2) by the model's own noise; infinite if that is wrong."""

    def change(criterion: Criterion, theta: RealArray, step: RealArray) -> ComplexArray:
        return response_along(criterion, theta, step, frequency)

    record, direct, known = program.estimation_record, program.direct, program.known
    own = estimates_of(model, record, direct, known)[0]
    white = whiteness_of_errors(own.criterion, own.theta, own.free)
    if not white.holds:
        return _infinite(model.response(frequency).shape)
    moves = np.array([change(own.criterion, own.theta, move) for move in white.moves.T])
    found = own.covariances(change) + covariance_of_moves(moves)
    beyond = distortion_of(model, record, direct, known, program.period_samples)
    return _with_distortion(found, beyond, frequency)


def _infinite(shape: tuple[int, ...]) -> RealArray:
    """Infinite covariances (F, ny, nu, 2, 2) of responses of a shape (F, ny, nu)."""
    return np.broadcast_to(np.diag([np.inf, np.inf]), (*shape, 2, 2)).copy()


def _of_instruments(
    program: ClosedLoopFit,
    model: InnovationsModel,
    record: Experiments,
    parts: IntegerArray,
    frequency: ArrayLike,
) -> ComplexArray:
    """Responses (parts, F, ny, nu); each leaves out the equations of one part."""
    clean = _explained(program, record)
    filtered = filtered_by_poles(model, program.period_samples, record, clean)
    order = model.order // record.y.shape[1]
    found = [
        instrumental_arx(*filtered, order, program.direct, parts != number).response(frequency)
        for number in range(int(parts[-1]) + 1)
    ]
    return np.array(found)


def _of_errors(
    program: ClosedLoopFit,
    clean_input: CleanInput,
    model: InnovationsModel,
    record: Experiments,
    parts: IntegerArray,
    frequency: ArrayLike,
) -> ComplexArray:
    """Changes of the response (parts, F, ny, nu) when one part is left out, to first order."""
    model = replace(model, K=np.zeros_like(model.K))
    errors = record.y - model.free_run(record.u, record.y, program.washout_samples)
    record = replace(record, u=clean_input(program, record, _explained(program, record)))
    criterion = Criterion(model, record, 0.0, program.direct, all_but_gain(model))
    theta = criterion.start(model)
    root = root_of_inverse(criterion.expand(theta)[2])
    along = np.array([response_along(criterion, theta, step, frequency) for step in root.T])
    rest = 1 - np.bincount(parts)[:, None] / len(parts)
    return np.tensordot(criterion.slopes(theta, parts, errors) @ root / rest, along, 1)


def _explained(program: ClosedLoopFit, record: Experiments) -> Experiments:
    clean = program.explained_part(record)
    if clean is None:
        raise InputError(f"{len(record)} samples are too few to explain; take a longer record")
    return clean


def _parts(samples: int, period: int | None) -> IntegerArray:
    """The number of the part to which each sample (N,) belongs; parts are whole periods."""
    time = np.arange(samples)
    if period is None:
        return time * PARTS // samples
    count = -(-samples // period)
    return time // period * min(PARTS, count) // count

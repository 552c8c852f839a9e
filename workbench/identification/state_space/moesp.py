"""MOESP, N4SID and CVA: state-space models from projections of the whole record.

Future outputs are projected on past inputs and outputs, along future inputs. The column space of
the projection is that of the observability matrix, whose shift gives A and C; B and D give the
simulation that fits the record best. The innovations gain solves a Riccati equation with the
covariance of the residuals of the projection's states. The three methods differ in the weights of
the projection. The inputs must not depend on past noise: for closed-loop records use method
"subspace".

Sources: M. Verhaegen, "Identification of the deterministic part of MIMO state space models given in
innovations form from input-output data", Automatica 30(1), 1994; P. Van Overschee, B. De Moor,
Subspace Identification for Linear Systems, 1996, sections 4.3 (the noise) and 5.1 (the weights).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import innovation_gain, with_inputs
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import lagged_triangle
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.state_space.gaps import bridged
from workbench.identification.state_space.methods import FitterOfOrder, claim, identify
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import best_fitting
from workbench.program import Claim, method

HALF_WINDOWS = (3, 5, 8, 12, 18, 25)
"""Numbers of samples of past, and of future, that are tried; the best model is kept."""
SMALLEST_FUTURE = 1e-8
"""Smallest singular value of future outputs, relative to the largest, that CVA divides by."""

ProjectionWeights = Literal["moesp", "n4sid", "cva"]


@method(StateSpaceFit, "moesp", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _moesp(program: StateSpaceFit, context: Context) -> Claim:
    """PO-MOESP: projections of the record, for open loops; no iterations."""
    return _answer(program, context, "moesp")


@method(StateSpaceFit, "n4sid", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _n4sid(program: StateSpaceFit, context: Context) -> Claim:
    """N4SID: oblique projections of the record without weights, for open loops; no iterations."""
    return _answer(program, context, "n4sid")


@method(StateSpaceFit, "cva", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _cva(program: StateSpaceFit, context: Context) -> Claim:
    """CVA: projections weighted by canonical correlations, for open loops; no iterations."""
    return _answer(program, context, "cva")


def _answer(program: StateSpaceFit, context: Context, weights: ProjectionWeights) -> Claim:
    way = projection_fits(program, weights)
    return claim(identify(program, way, way, context))


def projection_fits(program: StateSpaceFit, weights: ProjectionWeights) -> FitterOfOrder:
    """Fitting functions for models by projections with the weights of a method."""

    wholes: dict[int, Experiments] = {}

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            # the program keeps its parts, so that no other object gets their ids
            if id(record) not in wholes:
                wholes[id(record)] = bridged(record.delayed(program.delays_samples), program.direct)
            return best_projection(
                record, order, weights,
                direct=program.direct, delay=program.delays_samples,
                largest_radius=program.largest_radius, known=program.known,
                whole=wholes[id(record)],
            )  # fmt: skip

        return fit

    return way


def best_projection(
    record: Experiments,
    order: int,
    weights: ProjectionWeights = "moesp",
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
    largest_radius: float = 1.0,
    known: Knowledge | None = None,
    whole: Experiments | None = None,
) -> InnovationsModel | None:
    """The best model of experiments by projections over several windows, or None.

    Its predictor is stable, and its poles lie within the largest radius. The best model fits its
    own record best. The result is None if the record is too short for the order. ``whole`` is the
    record with its inputs delayed and its gaps filled, if that has been computed.
    """
    nu, ny = record.u.shape[1], record.y.shape[1]
    late = bridged(record.delayed(delay), direct) if whole is None else whole
    windows = [
        half
        for half in HALF_WINDOWS
        if order <= (half - 1) * ny and len(record) - 2 * half >= 4 * half * (nu + ny)
    ]
    models = (projection_model(late, order, half, weights, direct=direct) for half in windows)
    found = (
        replace(model, delay_samples=tuple(delay)) if model is not None and any(delay) else model
        for model in models
    )
    return best_fitting(found, record, direct=direct, largest_radius=largest_radius, known=known)


def projection_model(
    record: Experiments,
    order: int,
    half: int,
    weights: ProjectionWeights = "moesp",
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
) -> InnovationsModel | None:
    """Innovations model of experiments by projections; None if no gain K exists.

    It is also None if its simulation overflows, or if too few windows are complete.

    Parameters
    ----------
    order
        Number of states, at most (half - 1) ny.
    half
        Number of past samples in a window, and of future samples.
    weights
        "moesp", "n4sid" or "cva".
    direct
        Whether inputs may act within the sample.
    delay
        Delays [samples] of the inputs (nu,); empty for none.
    """
    late = record.delayed(delay)
    nu, ny = late.u.shape[1], late.y.shape[1]
    scaling = Scaling.of(late)
    pieces = [scaling.scaled(*piece) for piece in late.pieces()]
    lagged = lagged_triangle(pieces, 2 * half - 1, nu + ny)
    if lagged.rows < len(lagged.factor):
        return None
    windows = _Windows(lagged.factor, half, nu, ny)
    future = windows.told(half)
    observability = _observability(windows, future, order, weights)
    shift = np.linalg.lstsq(observability[:-ny], observability[ny:], rcond=None)[0]
    A = np.asarray(shift, dtype=float)
    C = observability[:ny]
    states = np.linalg.lstsq(observability, future, rcond=None)[0]
    next_states = np.linalg.lstsq(observability[:-ny], windows.told(half + 1), rcond=None)[0]
    measured = np.vstack([next_states, windows.outputs[half * ny : (half + 1) * ny]])
    left_over = measured - np.vstack([A, C]) @ states
    noise = left_over - _shares(left_over, windows.ahead) @ windows.ahead
    K = innovation_gain(A, C, noise @ noise.T)
    if K is None:
        return None
    model = InnovationsModel(
        A, np.zeros((order, nu)), C, np.zeros((ny, nu)), K, np.zeros(nu), np.zeros(ny)
    )
    simulating = with_inputs(model, list(_scaled(late, scaling)), direct)
    if simulating is None:
        return None
    found = scaling.restored(simulating, late)
    return replace(found, delay_samples=tuple(delay)) if any(delay) else found


def _scaled(record: Experiments, scaling: Scaling) -> Iterator[tuple[RealArray, RealArray]]:
    return (scaling.scaled(*piece) for piece in record.pieces())


class _Windows:
    """Inputs and outputs in windows of 2 half samples, as rows of a triangular factor, no means."""

    def __init__(self, factor: RealArray, half: int, nu: int, ny: int) -> None:
        m, length = nu + ny, 2 * half
        # Sample k of a window is the lag length - 1 - k of its last sample, which comes last.
        places = [1 + (length - 2 - k) * m for k in range(length - 1)] + [1 + (length - 1) * m]
        centred = factor[1:].T
        self.inputs = np.vstack([centred[p : p + nu] for p in places])
        self.outputs = np.vstack([centred[p + nu : p + m] for p in places])
        self._nu, self._ny = nu, ny
        self.ahead = self.inputs[half * nu :]
        self.future = self.outputs[half * ny :]

    def told(self, now: int) -> RealArray:
        """Outputs from sample ``now`` of a window on, as predicted by the past before it."""
        past = np.vstack([self.inputs[: now * self._nu], self.outputs[: now * self._ny]])
        known = np.vstack([past, self.inputs[now * self._nu :]])
        return _shares(self.outputs[now * self._ny :], known)[:, : len(past)] @ past


def _observability(
    windows: _Windows, future: RealArray, order: int, weights: ProjectionWeights
) -> RealArray:
    """Observability matrix (half * ny, order) by the weights of a method."""
    ahead = windows.ahead
    cleared = future if weights == "n4sid" else future - _shares(future, ahead) @ ahead
    if weights != "cva":
        left, singular, _ = np.linalg.svd(cleared, full_matrices=False)
        return np.asarray(left[:, :order] * np.sqrt(singular[:order]))
    outputs = windows.future - _shares(windows.future, ahead) @ ahead
    basis, size, _ = np.linalg.svd(outputs, full_matrices=False)
    size = np.maximum(size, SMALLEST_FUTURE * size[0])
    left, singular, _ = np.linalg.svd((basis / size).T @ cleared, full_matrices=False)
    return np.asarray((basis * size) @ (left[:, :order] * np.sqrt(singular[:order])))


def _shares(rows: RealArray, known: RealArray) -> RealArray:
    """Matrix X that minimises |rows - X known|."""
    return np.asarray(np.linalg.lstsq(known.T, rows.T, rcond=None)[0].T, dtype=float)

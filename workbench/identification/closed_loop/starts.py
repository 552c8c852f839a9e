"""Models to start from in closed loops: by instruments, which noise in the loop does not bias.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 7.6 and 10.5 (starting values).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from workbench.identification.closed_loop.instruments import refined_arx
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.autoregression import autoregression
from workbench.identification.innovations.gains import innovation_gain
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.folds import scored_fit
from workbench.identification.state_space.methods import SubspaceStarts
from workbench.identification.state_space.selection import allowed, least_of

NOISE_SHARES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Ratios of the noise's power to the input's from which the best predictor's is chosen."""
STABLE = 1 - 1e-9
"""Largest modulus of a plant's poles, where they are its predictor's too."""


class LoopStarts(SubspaceStarts):
    """Starting models by subspaces, and by instruments, for few lines and fast sampling."""

    def __init__(self, program: ClosedLoopFit) -> None:
        super().__init__(program)
        self._loop = program

    def _computed(self, record: Experiments, order: int) -> list[InnovationsModel]:
        program, found = self._loop, super()._computed(record, order)
        clean = program.explained_part(record)
        if clean is None or record.missing or program.delays_samples or program.known is not None:
            return found
        best = best_by_instruments(program, record, clean, order, program.largest_radius)
        found += [] if best is None else [with_gain(program, best, record)]
        return [*found, *_with_own_noise(program, record, clean, order)]


def _with_own_noise(
    program: ClosedLoopFit, record: Experiments, clean: Experiments, order: int
) -> Iterator[InnovationsModel]:
    """Models with ``order`` states, divided between the plant and the noise in every way.

    Noise that enters at the output does not have the plant's poles. A search that begins at a model
    with common poles often ends in another minimum.
    """
    outputs = record.y.shape[1]
    for states in range(1, order // outputs if order % outputs == 0 else 0):
        plant = best_by_instruments(
            program, record, clean, order // outputs - states, min(program.largest_radius, STABLE)
        )
        if plant is None or plant.radius >= 1:
            continue
        errors = record.y - plant.free_run(record.u, record.y, program.washout_samples)
        factors = [autoregression(v, states) for v in errors.T]
        first, shift = np.eye(1, states), np.eye(states, k=1)
        yield replace(
            plant,
            A=block_diag(plant.A, *(shift + a[:, None] * first for a in factors)),
            B=np.vstack([plant.B, np.zeros((states * outputs, plant.B.shape[1]))]),
            C=np.hstack([plant.C, np.kron(np.eye(outputs), first)]),
            K=np.vstack([np.zeros_like(plant.K), block_diag(*(a[:, None] for a in factors))]),
        )


def best_by_instruments(
    program: ClosedLoopFit, record: Experiments, clean: Experiments, order: int, largest: float
) -> InnovationsModel | None:
    """The model by refined instruments that simulates the explained record best."""
    models = allowed_instruments(program, record, clean, order, largest)
    return least_of(models, lambda model: program.misfit(model, clean))


def allowed_instruments(
    program: ClosedLoopFit, record: Experiments, clean: Experiments, order: int, largest: float
) -> list[InnovationsModel | None]:
    """Models by refined instruments whose poles lie within the largest radius."""
    models = refined_arx(record, clean, order, program.direct, program.period_samples)
    return [allowed(model, clean, program.direct, largest) for model in models]


def with_gain(
    program: ClosedLoopFit, model: InnovationsModel, record: Experiments
) -> InnovationsModel:
    """The model with the gain K that predicts best, among gains for noise at inputs and outputs."""
    inputs = model.B @ np.diag(record.u.var(axis=0)) @ model.B.T
    outputs = np.diag(np.nanvar(record.y, axis=0))
    gains = [
        innovation_gain(model.A, model.C, block_diag(share * inputs, outputs))
        for share in NOISE_SHARES
    ]
    models = [model, *(replace(model, K=gain) for gain in gains if gain is not None)]

    def errors(one: InnovationsModel) -> float:
        return float(-scored_fit(one.one_step, record, program.washout_samples).sum())

    return least_of(models, errors) or model

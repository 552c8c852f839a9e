"""The self-test of the compiled loop: a small loop whose answer NumPy gives as well."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench.simulation.cascade import Turn
from workbench.simulation.machine import fast_loop, fast_play

SAMPLES = 6
AGREEMENT = 1e-12
"""Largest difference of an answer of size 1 from the known one: rounding alone."""


def check_compiled_loop() -> None:
    """Raise ArithmeticError unless the compiled functions give the known answers.

    A plant of one state with the output of the sample before, a sensor of an error, a reading that
    multiplies, and a controller with an integrator that also reads its last output.
    """
    rng = np.random.default_rng(0)
    law, ends = np.array([-0.25, 0.125]), (np.array([0.5]), np.array([2.0]))
    exogenous, excitation, noise = (rng.normal(size=(SAMPLES + k, 1)) for k in (1, 0, 0))
    step = np.array([0.5, 0.8, 0.75]), np.array([0.1, 0.2, 0.5])
    weights = np.array([0.3, 0.1, 0.2, 0.4])
    wide, output, signals = (
        np.array([[0.0, -1e3, 1e3]]),
        np.empty((SAMPLES, 1)),
        np.empty((SAMPLES, 3)),
    )
    advance = (
        step[0].reshape(1, 3, 1),
        step[1].reshape(1, 3, 1),
        np.array([1]),
        np.array([0.5, 1.0]),
    )
    groups = (
        (np.zeros(1), np.zeros(1), exogenous[0].copy(), exogenous[0].copy()),
        tuple(np.zeros(1) for _ in range(5)),
        (*advance, weights[None], np.ones((1, 1))),
        (wide, wide),
        (excitation, exogenous, noise),
        (np.empty((SAMPLES, 1)), output, *np.empty((2, SAMPLES, 1)), *np.zeros((2, 1), np.int64)),
    )
    row = np.zeros(3)  # measurement, last output, command
    turn = Turn(_step, np.zeros(1), law, np.array([1, 0]), np.zeros(2), row[2:])
    stop = fast_loop([turn], _sense, _read, ends, row[:1], row, groups, signals, 0, SAMPLES)
    known = _known(law, exogenous[:, 0], excitation[:, 0], noise[:, 0], step, weights)
    played = np.empty((SAMPLES, 1))
    record = np.hstack([excitation, noise])
    fast_play(_step, np.zeros(1), law, record, played)
    sums = law[0] * noise.cumsum() + law[1] * excitation[:, 0]
    apart = max(np.abs(output[:, 0] - known).max(), np.abs(played[:, 0] - sums).max())
    if stop != SAMPLES or not apart <= AGREEMENT:
        raise ArithmeticError(f"the compiled loop is {apart:.2g} from the known answer")


def _known(
    law: RealArray,
    exogenous: RealArray,
    excitation: RealArray,
    noise: RealArray,
    step: tuple[RealArray, RealArray],
    weights: RealArray,
) -> RealArray:
    """Outputs of the controller, sample by sample."""
    (to_middle, to_end, to_next), (by_middle, by_end, by_next) = step
    x, integral, filtered, before = 0.0, 0.0, exogenous[0], exogenous[0]
    output, held = np.zeros(SAMPLES), 0.0
    for k in range(SAMPLES):
        integral += 2.0 * (filtered + noise[k])
        output[k] = law[0] * integral + law[1] * held + excitation[k]
        middle = (exogenous[k] + exogenous[k + 1]) / 2 - 0.5 * (to_middle * x + by_middle * held)
        end = exogenous[k + 1] - 0.5 * (to_end * x + by_end * held)
        x = to_next * x + by_next * held
        filtered = weights @ [filtered, before, middle, end]
        held, before = output[k], end
    return output


@kernel
def _sense(
    position: RealArray, exogenous: RealArray, parameters: RealArray, signals: RealArray
) -> None:
    signals[0] = exogenous[0] - parameters[0] * position[0]


@kernel
def _read(channels: RealArray, parameters: RealArray, measurement: RealArray) -> None:
    measurement[0] = parameters[0] * channels[0]


@kernel
def _step(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    state[0] += given[1]
    told[0] = parameters[0] * state[0] + parameters[1] * given[0]

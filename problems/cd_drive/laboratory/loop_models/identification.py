"""The closed-loop methods, and one open-loop method, on the record of a drive's loop."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workbench import Options, solve
from workbench.errors import SolverError
from workbench.identification import ClosedLoopFit, StateSpaceFit, closed_loop_deviations
from workbench.types import ComplexArray, RealArray, StateSpace

from .excitation import LoopSignals

ASSUMED = {
    "direct": "model of the noise as rich as the noise",
    "two-stage": "linear loop, known excitation",
    "instrumental-variables": "linear loop, known excitation",
    "indirect": "linear loop, known excitation, known linear controller",
    "open-loop": "input without feedback: not so here",
}
"""The methods, with the assumption of each."""
CLOSED = tuple(name for name in ASSUMED if name != "open-loop")
ORDERS = {"direct": 10} | dict.fromkeys(("two-stage", "instrumental-variables", "indirect"), 6)
"""Orders of the models: four states of the mechanics, and two of filter and hold. The direct method
needs more, for the noise that ends at 1750 Hz.
"""
EVERY = {"direct": 3}
"""Decimation of the record for methods that do not use USUAL. With denser samples a model of the
noise must be longer.
"""
USUAL = 2


class LoopModel(NamedTuple):
    """A model of one method: response and its standard deviation (F,), order, and failed checks.

    The deviation is NaN for the open-loop method.
    """

    response: ComplexArray
    deviation: RealArray
    order: int
    failures: int


def every_of(method: str) -> int:
    """Decimation of the record for a method."""
    return EVERY.get(method, USUAL)


def loop_model(
    method: str,
    signals: LoopSignals,
    controller: StateSpace | None,
    frequency: RealArray,
    options: Options,
) -> LoopModel:
    """The model of a method at frequencies [Hz] (F,). Raises SolverError if there is none.

    controller: from y to -u, sampled as the signals are; needed by the method indirect.
    """
    orders = (ORDERS.get(method, ORDERS["two-stage"]),)
    common: dict[str, Any] = {"orders": orders, "direct": False, "dt": signals.step}
    if method == "open-loop":
        program: StateSpaceFit = StateSpaceFit(signals.u, signals.y, assume="open loop", **common)
        solution = solve(program, method="output-error", options=options)
    else:
        program = ClosedLoopFit(
            signals.u,
            signals.y,
            excitation=signals.r,
            controller=controller,
            period_samples=signals.period,
            # From a poor start the direct method may pass through unstable models.
            poles="any" if method == "direct" else "marginal",
            **common,
        )
        solution = solve(program, method=method, options=options)
    if solution.answer is None or solution.certificate is None:
        raise SolverError(f"method {method} gave no model: {solution.message}")
    direct, found = method == "direct", solution.answer
    model = found.predictor if direct else found.simulator
    at = frequency * signals.step
    deviation = np.full(len(frequency), np.nan)  # feedback biases the open-loop method
    if isinstance(program, ClosedLoopFit):
        deviation = closed_loop_deviations(program, method, model, at)[:, 0, 0]
    failures = len(solution.certificate.failures)
    return LoopModel(model.response(at)[:, 0, 0], deviation, model.order, failures)

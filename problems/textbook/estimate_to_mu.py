"""From one noisy response to a mu controller: the uncertainty of the estimate in three forms."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from workbench import problem, solve
from workbench.fitting import Rational
from workbench.identification import ModelUncertainty, RationalModelFit
from workbench.synthesis import MuSynthesis
from workbench.types import ComplexArray
from workbench.uncertainty import (
    EstimateRegion,
    GeneralisedPlant,
    UncertaintyModel,
    cover_of_estimate,
    generalised_plant,
)

OMEGA = np.geomspace(0.1, 10.0, 30)
"""Frequencies of the response [rad/s]."""
TRUE_PLANT = Rational(np.zeros(0, complex), np.array([-0.1 + 0.995j, -0.1 - 0.995j]), 1.0)
"""An oscillator of 1 rad/s with a damping ratio of 0.1."""
FLOOR = 0.02
"""Smallest standard deviation of the noise at a frequency, relative to that at the largest
response.
"""
ERROR_WEIGHT = ([0.5, 0.7], [1.0, 0.007])
"""Numerator and denominator of the weight of the control error."""
CONTROL_WEIGHT = 0.1
COVER_ORDER = 4
"""Order of the weight that covers the discs."""

Uncertainty = Literal["discs", "ball", "box"]
"""Discs: a cover of the response. Ball, box: regions of the coefficients, as one full block or as
real scalars.
"""


def noisy_estimate(noise: float, draw: int) -> ModelUncertainty:
    """The estimate from one noisy response, with its distribution.

    noise: standard deviation relative to the response. Raises SolverError if the fit fails.
    """
    truth = TRUE_PLANT.response(OMEGA)[:, None, None]
    deviation = noise * np.maximum(np.abs(truth), FLOOR * np.abs(truth).max())
    parts = np.random.default_rng(draw).standard_normal((2, *truth.shape))
    noisy: ComplexArray = truth + deviation * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    program = RationalModelFit(OMEGA, noisy, deviation**2, orders=(2,), excess=2)
    return program.uncertainty(solve(program).answer.model)


def region_of(
    estimate: ModelUncertainty, uncertainty: Uncertainty, confidence: float
) -> EstimateRegion | UncertaintyModel:
    """The estimate's uncertainty in the asked form."""
    if uncertainty == "discs":
        return cover_of_estimate(estimate, COVER_ORDER, confidence=confidence, form="additive")
    return EstimateRegion(estimate, confidence=confidence, region=uncertainty)


def weighted_loop(part: object) -> GeneralisedPlant:
    """Generalised plant of a loop around a model from u to y, with weighted error and control
    signal.
    """
    import control

    return generalised_plant(
        [
            (part, "u", "y"),
            (control.tf(*ERROR_WEIGHT), "e", "z_e"),
            (control.tf(CONTROL_WEIGHT, 1), "u", "z_u"),
        ],
        {"e": "r - y"},
        exogenous="r",
        performance=("z_e", "z_u"),
        control="u",
        measurement="e",
    )


@problem(
    "textbook/{uncertainty}/estimate-to-mu",
    uncertainty=("discs", "ball", "box"),
    slow=True,
    method="dk",
)
def estimate_to_mu(
    uncertainty: Uncertainty,
    noise: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2,
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95,
    draw: Annotated[int, Field(ge=0)] = 0,
) -> MuSynthesis:
    """Mu controller for the confidence region of one estimate of an oscillator.

    The response at 30 frequencies is noisy, so the fitted model is uncertain. Its uncertainty is
    described by discs about its response, which a weight covers, or by its coefficients in a ball
    or in a box. Each region holds the true plant with the same probability.

    noise: standard deviation, relative to the response. confidence: probability that the region
    holds the true plant. draw: seed of the noise.
    """
    estimate = noisy_estimate(noise, draw)
    return MuSynthesis(weighted_loop(region_of(estimate, uncertainty, confidence)))

"""Feedback straight from the record of an unstable plant, proven for every plant that the record
allows.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.synthesis import FeedbackCriterion, FeedbackFromRecords, NoiseEnergy, StateRecords
from workbench.types import RealArray

A = np.array([[0.850, -0.038, -0.380], [0.735, 0.815, 1.594], [-0.664, 0.697, -0.064]])
B = np.array([[1.431, 0.705], [1.620, -1.129], [0.913, 0.369]])
"""The plant of section VI-A of van Waarde, Camlibel and Mesbahi, IEEE Trans. Automatic Control 67
(2022) 162-175, with poles at 1.5, 1 and -0.9."""
C = np.vstack([np.eye(3), np.zeros((2, 3))])
D = np.vstack([np.zeros((3, 2)), np.eye(2)])
"""Performance outputs: all states and inputs, with equal weights."""


def experiment(samples: int, radius: float, rng: np.random.Generator) -> tuple[RealArray, ...]:
    """States (3, T), inputs (2, T) and next states (3, T) of one experiment.

    Inputs and the first state are normal with variance 1. The noise is uniform in a ball of this
    radius.
    """
    states, inputs = [rng.standard_normal(3)], rng.standard_normal((2, samples))
    for u in inputs.T:
        way = rng.standard_normal(3)
        noise = radius * rng.random() ** (1 / 3) * way / np.linalg.norm(way)
        states.append(A @ states[-1] + B @ u + noise)
    path = np.array(states).T
    return path[:, :-1], inputs, path[:, 1:]


def bounded_records(
    samples: int, radius: float, rng: np.random.Generator, experiments: int = 1
) -> StateRecords:
    """Records of experiments of equal length, where each noise sample is known to be at most
    `radius`.
    """
    parts = [experiment(samples, radius, rng) for _ in range(experiments)]
    states, inputs, next_states = (np.hstack(each) for each in zip(*parts, strict=True))
    noise = NoiseEnergy.of_samples(radius, 3, experiments * samples)
    return StateRecords(states, inputs, next_states, noise)


@problem("textbook/{criterion}/record-feedback", criterion=("decay", "h2", "hinf"), slow=True)
def record_feedback(
    criterion: FeedbackCriterion,
    samples: Annotated[int, Field(ge=5, le=2000)] = 20,
    radius: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 0.2,
    draw: Annotated[int, Field(ge=0)] = 0,
) -> FeedbackFromRecords:
    """State feedback from one noisy record of an unstable plant, with no model in between.

    The gain is proven for every plant that agrees with the record and the noise bound. It has the
    least decay rate per sample, or the least H2 or H-infinity norm from noise to states and inputs.

    samples: number of samples of the record. radius: bound on each noise sample. draw: seed of the
    record.
    """
    records = bounded_records(samples, radius, np.random.default_rng(draw))
    if criterion == "decay":
        return FeedbackFromRecords(records)
    return FeedbackFromRecords(records, criterion=criterion, C=C, D=D)

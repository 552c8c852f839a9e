"""Second opinions on a feedback from records: drawn plants of the set, and other mathematics."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import Check
from workbench.executor.effort import tries
from workbench.second_opinion import recorded_plants as drawn
from workbench.synthesis.records.inequalities import FeedbackCriterion, ProvenFeedback
from workbench.synthesis.records.record import StateRecords

EVERY_PLANT = "for every plant that the records allow"
"""The set of plants for which the proofs hold, in words."""
DRAWN_ROUNDING = 1e-6
"""Relative excess over the claim that rounding may cause, for a drawn plant's norm or energy."""


class DrawnQuestion(Protocol):
    """The part of the Program that trials and figures use."""

    @property
    def records(self) -> StateRecords: ...

    @property
    def criterion(self) -> FeedbackCriterion: ...

    @property
    def performance(self) -> tuple[RealArray, RealArray]: ...

    @property
    def disturbance(self) -> RealArray: ...


def tried_claims(question: DrawnQuestion, answer: ProvenFeedback) -> list[Check]:
    """Checks with drawn plants, and of the whole set by the small gain theorem in the central
    loop.
    """
    records, noise, rounding = question.records, question.records.noise, DRAWN_ROUNDING
    after = records.next_states - (0.0 if noise.mean is None else noise.mean)
    about = records.regressors, after, noise.weight, noise.energy
    centre, left, right = drawn.edge_plants(*about)
    theta = centre + np.concatenate(
        [np.zeros((1, *centre.shape)), drawn.drawn_changes(left, right)]
    )
    closing = np.vstack([np.eye(records.order), answer.K])
    loops = theta @ closing
    over = f"for {len(theta)} plants drawn from the edge of the set"
    excess = drawn.excess_energy(theta, *about)
    statement = "noise energy that a drawn plant needs over that allowed, less 1"
    found = [Check("records allow the plants", statement, excess, rounding, over=over)]
    rate = answer.level if question.criterion == "decay" else 1.0
    slowest = drawn.fastest_loop(loops, rate)
    statement = "logarithmic growth of a loop per sample above the rate, less its rounding"
    found.append(Check("loops fall", statement, slowest, 0.0, over=over))
    C, D = question.performance
    seen, entering = C + D @ answer.K, question.disturbance
    if question.criterion != "decay":
        size = drawn.largest_h2(loops, entering, seen)
        if question.criterion == "hinf":
            size = drawn.largest_response(loops, entering, seen)[0]
        statement = "norm of a drawn loop over the level, less 1"
        found.append(Check("norms", statement, size / answer.level - 1.0, rounding, over=over))
    return [*found, _small_gain(question, answer, loops[0], left, right.T @ closing, seen)]


def _small_gain(
    question: DrawnQuestion,
    answer: ProvenFeedback,
    loop: RealArray,
    left: RealArray,
    right: RealArray,
    seen: RealArray,
) -> Check:
    """Check of the whole set by the small gain theorem: Delta is an operator of gain 1 in a
    loop.
    """
    root = math.sqrt(max(answer.multiplier, 0.0)) or math.nan
    V, E = root * left, np.vstack([right / root, seen])
    if question.criterion == "h2":
        cost = drawn.least_cost(loop, V, E)
        F = question.disturbance
        size = math.inf if cost is None else math.sqrt(float(np.trace(F.T @ cost @ F)))
        statement = "root of the guaranteed cost by iteration over the level, less 1"
        value, over = size / answer.level - 1.0, EVERY_PLANT
    else:
        radius = answer.level if question.criterion == "decay" else 1.0
        if question.criterion == "hinf":
            V = np.hstack([V, question.disturbance / answer.level])
        gain, angle = drawn.largest_response(loop[None], V, E, radius)
        statement = f"scaled gain of the central loop, at {angle:.4g} rad per sample, less 1"
        value, over = gain - 1.0, f"{EVERY_PLANT}, at {tries(drawn.ANGLES)} frequencies"
    return Check("small gain", statement, value, DRAWN_ROUNDING, over=over)

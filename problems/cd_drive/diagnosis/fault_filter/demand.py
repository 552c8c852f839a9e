"""What a stored study reaches of its demand on a fault filter, and how it is told."""

from __future__ import annotations

from typing import Any

from workbench import Check
from workbench._core.heavy_types import Dataset
from workbench.certificate import EVERY_PERTURBATION
from workbench.diagnosis import DemandReached

LIMITS_AGREE = 1e-12
"""Relative amount by which stored limits may differ, by rounding, from the factor times those
asked."""


def reached_of(answer: Dataset) -> DemandReached:
    """What a stored answer reaches of the demand."""
    return DemandReached(float(answer["set_share"]), float(answer["demand_factor"]))


def demand_check(answer: Dataset, limits: tuple[float, float]) -> Check:
    """Check that stored limits of error and leakage [m] are the factor times those asked."""
    stored = float(answer["allowed"]), float(answer["leakage_allowed"])
    off = max(abs(one / known - 1) for one, known in zip(stored, limits, strict=True))
    statement = "relative difference of the stored limits from the factor times those asked"
    return Check("demand", statement, off, LIMITS_AGREE)


def plants_of(reached: DemandReached) -> str:
    """The plants for which requirements are certified, in words."""
    if reached.share >= 1.0:
        return EVERY_PERTURBATION
    return f"{EVERY_PERTURBATION} up to {reached.share:.4g} of the set"


def limits_of(reached: DemandReached) -> str:
    """What a certified supremum is over, in words; nothing where it is the limit asked."""
    return f", limits {reached.factor:.4g} times those asked" if reached.factor > 1.0 else ""


def in_metrics(answer: Dataset, error: float, leakage: float) -> dict[str, float]:
    """The demand asked, error and leakage [m], and what is reached of it."""
    reached = reached_of(answer)
    return {
        "error_asked": error,
        "error_allowed": float(answer["allowed"]),
        "leakage_asked": leakage,
        "leakage_allowed": float(answer["leakage_allowed"]),
        "demand_factor": reached.factor,
        "set_share": reached.share,
    }


def demand_table(answer: Dataset, error: float, leakage: float, *more: list[str]) -> Any:
    """The demand asked and reached, and whether it is met. more: rows of further limits."""
    reached = reached_of(answer)
    rows = [
        ["relative error above 1.5 kHz", f"{error:.4g}", f"{float(answer['allowed']):.4g}"],
        ["leakage [um]", f"{1e6 * leakage:.4g}", f"{1e6 * float(answer['leakage_allowed']):.4g}"],
        *more,
        ["share of the set", "1", f"{reached.share:.4g}"],
    ]
    missed = []
    if reached.factor > 1.0:
        missed.append(f"limits {reached.factor:.4g} times as large")
    if reached.share < 1.0:
        missed.append(f"for {reached.share:.4g} of the set, which is what the loop itself bears")
    rows.append(["met", "", f"no: {', '.join(missed)}" if missed else "yes"])
    return ["demand", "asked", "reached"], rows

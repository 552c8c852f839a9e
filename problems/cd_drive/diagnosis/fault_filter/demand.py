"""The part of its demand on a fault filter that a stored study reaches, and its presentation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from workbench import Check
from workbench.certificate import EVERY_PERTURBATION
from workbench.diagnosis import DemandReached
from workbench.study import array
from workbench.types import Dataset

LIMITS_AGREE = 1e-12
"""Rounding error allowed when stored limits are compared with the factor times the asked ones."""


def reached_arrays(limits: Callable[[Any, DemandReached], Sequence[float]]) -> tuple[Any, ...]:
    """The reached part as arrays of a study, whose part ``reached`` it is: factor, share, limits.

    ``limits`` returns the limits of the relative error and of the leakage [m] from study and part.
    """
    kinds = (
        ("1", "limits reached over those asked", lambda reached: reached.factor),
        ("1", "share of the set that is reached", lambda reached: reached.share),
        ("1", "relative error reached", lambda self, reached: limits(self, reached)[0]),
        ("m", "leakage reached", lambda self, reached: limits(self, reached)[1]),
    )
    return tuple(
        array(dims=(), unit=unit, meaning=meaning, value=value) for unit, meaning, value in kinds
    )


def reached_of(answer: Dataset) -> DemandReached:
    """The part of the demand that a stored answer reaches."""
    return DemandReached(float(answer["set_share"]), float(answer["demand_factor"]))


def demand_check(answer: Dataset, limits: tuple[float, float]) -> Check:
    """Check that the stored limits of error and leakage [m] are the factor times the asked ones."""
    stored = float(answer["allowed"]), float(answer["leakage_allowed"])
    off = max(abs(one / known - 1) for one, known in zip(stored, limits, strict=True))
    statement = "relative difference of the stored limits from the factor times those asked"
    return Check("demand", statement, off, LIMITS_AGREE)


def plants_of(reached: DemandReached) -> str:
    """Description of the plants for which requirements are certified."""
    if reached.share >= 1.0:
        return EVERY_PERTURBATION
    return f"{EVERY_PERTURBATION} up to {reached.share:.4g} of the set"


def limits_of(reached: DemandReached) -> str:
    """Description of the domain of a certified supremum; empty if the asked limit is reached."""
    return f", limits {reached.factor:.4g} times those asked" if reached.factor > 1.0 else ""


def in_metrics(answer: Dataset, error: float, leakage: float) -> dict[str, float]:
    """The asked demand, error and leakage [m], and the reached part."""
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
    """The asked and the reached demand, and whether it is met. more: rows of further limits."""
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

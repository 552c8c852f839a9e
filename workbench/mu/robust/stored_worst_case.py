"""A worst-case gain in a dataset, and the checks that prove it again without any search."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.arrays import EPS
from workbench.certificate import EVERY_PERTURBATION, Check, quantified
from workbench.certify.proofs.peak_proof import proves
from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.stable_system import stable_system
from workbench.heavy_types import Dataset
from workbench.mu.frequency.stored_peak import REPROVEN_LOWER
from workbench.mu.robust.skewed_peak import LEVEL_ROUNDING, divided
from workbench.mu.robust.worst_case import WorstCaseGain, attained_gain
from workbench.structure import Structure

CHECKED_ROUNDING = LEVEL_ROUNDING * (1 - 16 * EPS)
"""Factor as LEVEL_ROUNDING, in a check. What is said has more, so that no last bit counts."""


def worst_case_checks(system: Any, structure: Structure, found: WorstCaseGain) -> list[Check]:
    """Checks of a worst-case gain by its multipliers and its perturbation alone.

    Parameters
    ----------
    system, structure
        As given to `worst_case_gain`.
    found
        The claimed bounds and what proves them. An infinite upper bound claims nothing.

    Raises
    ------
    InputError
        As `worst_case_gain`.
    """
    stable = stable_system(system, sampled=True)
    fault = ""
    if math.isfinite(found.upper):
        fault = _fault(stable, structure, found)
    attained = attained_gain(stable, structure, found.Delta, stable.plane(found.omega))
    lower, excess = found.lower, 0.0
    if lower > 0 and attained < lower:
        excess = lower / attained - 1 if attained > 0 and math.isfinite(lower) else math.inf
    return quantified(
        EVERY_PERTURBATION,
        [
            Check(
                "upper", "whether the multipliers leave it unproven", float(bool(fault)), 0.0, fault
            ),
            Check(
                "lower",
                "claimed gain over what its perturbation proves, less 1",
                excess,
                REPROVEN_LOWER,
            ),
            Check(
                "order",
                "whether the lower bound is above the upper one",
                float(lower > found.upper),
                0.0,
            ),
        ],
    )


def _fault(stable: Any, structure: Structure, found: WorstCaseGain) -> str:
    """What keeps the multipliers from proving the upper bound; the empty text for nothing."""
    if found.proof is None:
        return "no proof is stored"
    outputs, inputs = stable.D.shape
    whole = structure.with_performance(outputs - structure.columns, inputs - structure.rows)
    beta = found.proof.beta
    if not beta < 1:
        return f"the proof is one of mu {beta:.6g}, which is not below 1"
    if not found.level * beta * CHECKED_ROUNDING <= found.upper:
        return f"the proof is one of the gain {found.level * beta:.9g}"
    if found.level == 0:
        return proves(stable, whole, found.proof, beta)
    exogenous = np.arange(inputs) >= structure.rows
    return proves(divided(stable, exogenous, found.level), whole, found.proof, beta)


def stored_worst_case(name: str, found: WorstCaseGain) -> dict[str, Any]:
    """The gain as variables of a dataset, under a name; `restored_worst_case` reads them back."""
    one, parts = {"units": "1"}, np.stack([found.Delta.real, found.Delta.imag], axis=-1)
    about = {"long_name": "lower and upper bound of the worst-case gain"}
    return {
        f"{name}_bounds": (("bound",), [found.lower, found.upper], about),
        f"{name}_omega": ((), found.omega, {"units": "rad/s", "long_name": "of the lower bound"}),
        f"{name}_Delta": (
            (f"{name}_input", f"{name}_output", "complex"),
            parts,
            one | {"long_name": "worst perturbation, real and imaginary"},
        ),
        f"{name}_level": ((), found.level, {"long_name": "gain by which inputs are divided"}),
        **({} if found.proof is None else stored_proof(f"{name}_proof", found.proof)),
    }


def restored_worst_case(data: Dataset, name: str) -> WorstCaseGain:
    """The gain that `stored_worst_case` put into the dataset under this name."""
    lower, upper = data[f"{name}_bounds"].values.tolist()
    parts = data[f"{name}_Delta"].values
    proof = restored_proof(data, f"{name}_proof") if f"{name}_proof_band" in data else None
    return WorstCaseGain(
        lower,
        upper,
        float(data[f"{name}_omega"]),
        parts[..., 0] + 1j * parts[..., 1],
        "",
        float(data[f"{name}_level"]),
        proof,
    )

"""A peak in a dataset."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.stable_system import angular_frequency
from workbench.heavy_types import Dataset
from workbench.mu.frequency.peak_bounds import Peak


def stored_peak(name: str, found: Peak) -> dict[str, Any]:
    """The peak as variables of a dataset, under a name; `restored_peak` reads them back."""
    one, delta = {"units": "1"}, {"units": "1", "long_name": "perturbation of the lower bound"}
    parts = np.stack([found.Delta.real, found.Delta.imag], axis=-1)
    bounds = {"units": "1", "long_name": "lower and upper bound"}
    return {
        f"{name}_bounds": ("bound", [found.lower, found.upper], bounds),
        f"{name}_omega": ((), found.omega, {"units": "rad/s", "long_name": "of the lower bound"}),
        f"{name}_Delta": ((f"{name}_input", f"{name}_output", "complex"), parts, delta),
        **({} if found.proof is None else stored_proof(f"{name}_proof", found.proof)),
        f"{name}_complex_part": ((), found.complex_part, one),
        **({f"{name}_period": ((), found.period, {"units": "s"})} if found.period else {}),
    }


def restored_peak(data: Dataset, name: str) -> Peak | None:
    """The peak that `stored_peak` put into the dataset under this name; None: there is none."""
    if f"{name}_bounds" not in data:
        return None
    lower, upper = data[f"{name}_bounds"].values.tolist()
    parts = data[f"{name}_Delta"].values
    proof = restored_proof(data, f"{name}_proof") if f"{name}_proof_band" in data else None
    period = float(data[f"{name}_period"]) if f"{name}_period" in data else 0.0
    low, high = proof.band if proof else (0.0, math.inf)
    return Peak(
        lower,
        upper,
        float(data[f"{name}_omega"]),
        parts[..., 0] + 1j * parts[..., 1],
        proof.intervals if proof else (),
        "",
        float(data[f"{name}_complex_part"]),
        (angular_frequency(low, period), angular_frequency(high, period)),
        period,
        proof.scalings if proof else None,
    )

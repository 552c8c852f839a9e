"""A worst-case gain in a dataset."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.heavy_types import Dataset
from workbench.mu.robust.skewed_bounds import WorstCaseGain


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

"""Storage of the proof of a peak as variables of a dataset."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import Dataset
from workbench.certify.band_cover import CertifiedInterval
from workbench.certify.proofs.peak_proof import PeakProof
from workbench.certify.proofs.scaled_system import ScalingFunctions

MULTIPLIERS = ("D_left", "D_right", "G")
"""Names of an interval's multipliers."""
FACTORS = ("numerators", "denominators")
"""Names of the quadratic factors of scalings."""


def stored_proof(name: str, proof: PeakProof) -> dict[str, Any]:
    """The proof as variables of a dataset, under a name; `restored_proof` reads them back.

    A proof without intervals has only its bound, its band and its scalings.
    """
    about = {"long_name": f"bound that the multipliers of the {name} prove"}
    band = {"units": "rad/s", "long_name": f"band on which the {name} is proven"}
    parts: dict[str, Any] = {
        f"{name}_beta": ((), proof.beta, about),
        f"{name}_band": (("end",), np.array(proof.band), band),
    }
    if proof.scalings is not None:
        parts |= _stored_scalings(name, proof.scalings)
    if not proof.intervals:
        return parts
    interval, output, entering = (f"{name}_{kind}" for kind in ("interval", "output", "input"))
    places = np.array([[one.low, one.omega, one.high] for one in proof.intervals])
    about = {"units": "rad/s", "long_name": "low end, frequency of the multipliers, high end"}
    parts[f"{name}_frequencies"] = ((interval, "place"), places, about)
    shapes = (output, f"{output}_"), (entering, f"{entering}_"), (entering, output)
    for k, (key, shape) in enumerate(zip(MULTIPLIERS, shapes, strict=True)):
        at = np.array([getattr(one, key) for one in proof.intervals])
        slope = np.array(
            [
                np.zeros(at.shape[1:]) if one.slopes is None else one.slopes[k]
                for one in proof.intervals
            ]
        )
        for suffix, values, unit in (("", at, "1"), ("_slope", slope, "s")):
            parts[f"{name}_{key}{suffix}"] = (
                (interval, *shape, "complex"),
                np.stack([values.real, values.imag], axis=-1),
                {"units": unit, "long_name": f"{key}{suffix} of the intervals, real and imaginary"},
            )
    return parts


def _stored_scalings(name: str, scalings: ScalingFunctions) -> dict[str, Any]:
    """Scalings as variables of a dataset."""
    block = f"{name}_block"
    parts: dict[str, Any] = {
        f"{name}_gain": (block, scalings.gain, {"units": "1", "long_name": "gain of the scalings"})
    }
    for key in FACTORS:
        about = {"long_name": f"n1 [rad/s], n0 [rad^2/s^2] of s^2 + n1 s + n0 in the {key}"}
        shape = block, f"{name}_section", f"{name}_coefficient"
        parts[f"{name}_{key}"] = (shape, getattr(scalings, key), about)
    return parts


def restored_proof(data: Dataset, name: str) -> PeakProof:
    """The proof that `stored_proof` put into the dataset under this name."""
    low, high = (float(end) for end in data[f"{name}_band"].values)
    intervals: list[CertifiedInterval] = []
    if f"{name}_frequencies" in data:
        at = [_complex(data, f"{name}_{key}") for key in MULTIPLIERS]
        by = [_complex(data, f"{name}_{key}_slope") for key in MULTIPLIERS]
        for k, (first, omega, last) in enumerate(data[f"{name}_frequencies"].values.tolist()):
            slopes = (by[0][k], by[1][k], by[2][k])
            intervals.append(
                CertifiedInterval(
                    first,
                    last,
                    omega,
                    at[0][k],
                    at[1][k],
                    at[2][k],
                    slopes if any(slope.any() for slope in slopes) else None,
                )
            )
    scalings = None
    if f"{name}_gain" in data:
        parts = (data[f"{name}_{key}"].values for key in ("gain", *FACTORS))
        scalings = ScalingFunctions(*parts)
    return PeakProof(float(data[f"{name}_beta"]), tuple(intervals), (low, high), scalings)


def _complex(data: Dataset, name: str) -> Array:
    """A complex variable of the dataset."""
    values = data[name].values
    return values[..., 0] + 1j * values[..., 1]

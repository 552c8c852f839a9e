"""A stated spread of plants around a few measured ones, or around a single one.

A measurement of one plant says nothing about the next plant of its kind. A user who knows their
spread can state it: the other responses lie in a disc around the measured one, with a relative
radius, and their resonances have other frequencies.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.input_checks import is_real

CORNERS = 12
"""Number of corners of the polygon around a disc; its corners lie 3.5 % outside."""
SHIFTS = 5
"""Number of shifts of a resonance, from the lowest to the highest."""


def spread_about(
    found: dict[str, Any], spread: float | None, resonance_shift: float | None
) -> dict[str, Any]:
    """Arguments of `Responses` by name, where each plant is replaced by plants of a stated spread.

    Parameters
    ----------
    found
        Arguments for the measured plants: ``frequency`` (F,), ``values`` and ``variance`` (F, N),
        ``degrees`` and, if there are any, ``plants`` and ``ratios``.
    spread
        Radius of the disc around each response, relative to the response; None for no disc.
    resonance_shift
        Largest relative shift of a plant's frequencies: G(j omega / (1 + d)) for all |d| up to
        this; None for no shift. Frequencies too near to the ends of the band are left out.

    Raises
    ------
    InputError
        A spread or a shift is not between 0 and 1, or a shift leaves fewer than two frequencies.
    """
    for name, value in (("spread", spread), ("resonance_shift", resonance_shift)):
        if value is not None and not (is_real(value) and 0.0 < value < 1.0):
            raise InputError(f"{name} is {value!r}; it must lie between 0 and 1: 0.2 for 20 %")
    if spread is None and resonance_shift is None:
        return found
    frequency, values = np.asarray(found["frequency_hz"]), np.asarray(found["values"])
    variance, count = np.asarray(found["variance"]), np.shape(found["values"])[1]
    ratios = found.get("ratios")
    joint = np.zeros((*values.shape, 2, 2)) if ratios is None else ratios.joint
    stated = []
    if resonance_shift is not None:
        shifts = np.linspace(-resonance_shift, resonance_shift, SHIFTS)
        kept = frequency >= frequency[0] * (1 + resonance_shift)
        kept &= frequency <= frequency[-1] * (1 - resonance_shift)
        if kept.sum() < 2:
            raise InputError(
                f"a shift of {100 * resonance_shift:g} % leaves {kept.sum()} of the frequencies "
                f"from {frequency[0]:.4g} to {frequency[-1]:.4g} Hz: two are needed"
            )
        values, variance = (
            np.concatenate([_at(frequency[kept] / (1 + d), frequency, x) for d in shifts], axis=1)
            for x in (values, variance)
        )
        flat = joint.reshape(len(frequency), -1)
        moved = [_at(frequency[kept] / (1 + d), frequency, flat) for d in shifts]
        joint = np.concatenate([one.reshape(-1, count, 2, 2) for one in moved], axis=1)
        frequency = frequency[kept]
        stated.append(f"frequencies of theirs up to {100 * resonance_shift:g} % higher or lower")
    if spread is not None:
        turn = np.exp(2j * np.pi * np.arange(CORNERS) / CORNERS) / np.cos(np.pi / CORNERS)
        size = np.abs(1 + spread * turn)
        values = (values[..., None] * (1 + spread * turn)).reshape(len(frequency), -1)
        variance = (variance[..., None] * size**2).reshape(len(frequency), -1)
        sides = np.stack([1 + spread * turn, np.ones(CORNERS)], axis=1)
        joint = joint[:, :, None] * (sides[:, :, None] * sides[:, None, :].conj())
        joint = joint.reshape(len(frequency), -1, 2, 2)
        stated.append(f"responses within {100 * spread:g} % of the measured one")
    copies = values.shape[1] // count
    names = found.get("plants") or [f"plant {k + 1}" for k in range(count)]
    shifted = SHIFTS if resonance_shift is not None else 1
    order = np.tile(np.repeat(np.arange(count), copies // shifted), shifted)
    return found | {
        "frequency_hz": frequency,
        "values": values,
        "variance": variance,
        "degrees": np.asarray(found["degrees"])[order],
        "ratios": None
        if ratios is None
        else replace(ratios, joint=joint, chosen=ratios.chosen[order]),
        "plants": [f"{names[k]} [{number + 1}]" for number, k in enumerate(order)],
        "assumption": "; ".join(filter(None, [found.get("assumption"), _said(stated, count)])),
    }


def _said(stated: list[str], count: int) -> str:
    who = "the plants of which one was measured" if count == 1 else "the plants beside the measured"
    return f"stated, not measured: {who} have {' and '.join(stated)}"


def _at(places: RealArray, frequency: RealArray, x: ComplexArray | RealArray) -> Any:
    """Columns (F, N) at other frequencies, by linear interpolation over log frequency."""
    log = np.log(frequency)
    return np.stack([np.interp(np.log(places), log, column) for column in x.T], axis=1)

"""The true plants against the chain's answers: covers, weights and bandwidth."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.types import ComplexArray, RealArray

from .simulators.linear import LinearPlant, linear_plants
from .simulators.simc import loop, tuned
from .simulators.stranger import Stranger

POINTS = 400
"""Number of frequencies of the comparison."""
DECADES_BELOW = 1.0
"""Decades below the lowest measured frequency at which the comparison begins."""
STATIC = 1000.0
"""Error weight at low frequencies, as in the study that `workbench init` writes."""
HALF_A_SAMPLE = 0.5
"""Delay of the hold [samples]."""


def grid(plant: Stranger) -> RealArray:
    """Angular frequencies [rad/s] from below the measured band to half the sampling rate."""
    low = 2 * np.pi / (plant.test.samples * plant.period) / 10**DECADES_BELOW
    return np.geomspace(low, np.pi / plant.period, POINTS)


def excess_of_cover(
    G: ComplexArray, nominal: ComplexArray, W_c: ComplexArray, W_r: ComplexArray, form: str
) -> RealArray:
    """Distance (F, N) of plants (F, N) from the cover's real segment, divided by its radius (F,).

    A plant with at most 1 is covered. The segment holds the points W_r d with real |d| <= 1.
    """
    away = G - nominal[:, None] if form == "additive" else G / nominal[:, None] - 1
    along = W_r[:, None]
    size = np.abs(along) ** 2
    d = np.where(size > 0, (away * along.conj()).real / np.where(size > 0, size, 1.0), 0.0)
    return np.abs(away - np.clip(d, -1, 1) * along) / np.abs(W_c)[:, None]


def error_weight(omega: RealArray, bandwidth_hz: float) -> ComplexArray:
    """W_e of the study that `workbench init` writes: it asks for |S| of at most 2, and about 1 at
    the bandwidth.
    """
    corner = 2 * np.pi * bandwidth_hz
    return (0.5j * omega + corner) / (1j * omega + corner / STATIC)


def kept_bandwidth(S: Any, omega: RealArray) -> float:
    """Largest bandwidth [Hz] at which a sensitivity (F,) satisfies |W_e S| <= 1 at every frequency.

    Zero if there is none.
    """
    tried = np.geomspace(omega[0], omega[-1], 800) / (2 * np.pi)
    kept = [one for one in tried if np.abs(error_weight(omega, one) * S).max() <= 1.0]
    return float(max(kept, default=0.0))


def bandwidth_of_simc(plant: Stranger, delay: float) -> float:
    """Bandwidth [Hz] that a SIMC controller reaches on the true nominal plant; NaN if there is
    none.
    """
    (nominal,) = linear_plants(plant, plant.middle())
    hold, omega = (delay + HALF_A_SAMPLE) * plant.period, grid(plant)
    found = tuned(nominal, hold)
    if found is None:
        return float("nan")
    return kept_bandwidth(1 / (1 + loop(nominal, found, hold, omega)), omega)


def true_responses(plant: Stranger, omega: RealArray) -> tuple[list[LinearPlant], ComplexArray]:
    """True linear plants of the units, and their responses (F, N)."""
    every = linear_plants(plant, plant.drawn())
    return every, np.stack([one.response(omega)[:, 0, 0] for one in every], axis=1)


def broken_weights(
    G: ComplexArray, K: ComplexArray, omega: RealArray, late: float, parameters: dict[str, Any]
) -> RealArray:
    """Largest |W_e S| (N,) over frequency, for the true linear plants with the designed
    controller.
    """
    loops = G * (K * np.exp(-1j * omega * late))[:, None]
    W_e = error_weight(omega, float(parameters["bandwidth"]))
    peaks: RealArray = np.abs(W_e[:, None] / (1 + loops)).max(axis=0)
    return peaks

"""The true plants against the chain's answers: covers, weights and bandwidth."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import zpk2ss

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
CANCELLED = 0.02
"""Relative distance of a pole from a zero that counts as cancelled."""
HALF_A_SAMPLE = 0.5
"""Delay of the hold [samples]."""


def grid(plant: Stranger) -> RealArray:
    """Angular frequencies [rad/s] from below the measured band to half the sampling rate."""
    low = 2 * np.pi / (plant.test.samples * plant.period) / 10**DECADES_BELOW
    return np.geomspace(low, np.pi / plant.period, POINTS)


def excess_of_cover(
    G: ComplexArray, nominal: ComplexArray, W_c: ComplexArray, W_r: ComplexArray, form: str
) -> RealArray:
    """Distance (F, N, p, m) of plants (F, N, p, m) from the cover's real segment, divided by its
    radius, for covers (F, p, m) of each channel.

    A plant with at most 1 is covered. The segment holds the points W_r d with real |d| <= 1.
    """
    centre = nominal[:, None]
    away = G - centre if form == "additive" else G / centre - 1
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
    """Largest bandwidth [Hz] at which a sensitivity, of size (F,), satisfies |W_e S| <= 1 at every
    frequency.

    Zero if there is none.
    """
    tried = np.geomspace(omega[0], omega[-1], 800) / (2 * np.pi)
    kept = [one for one in tried if np.abs(error_weight(omega, one) * S).max() <= 1.0]
    return float(max(kept, default=0.0))


def bandwidth_of_simc(plant: Stranger, delay: float) -> float:
    """Bandwidth [Hz] that a SIMC controller reaches on the true nominal plant; NaN if there is
    none.

    A plant of several channels is decoupled at frequency zero, and each output has a SIMC
    controller of its own.
    """
    (nominal,) = linear_plants(plant, plant.middle())
    hold, omega = (delay + HALF_A_SAMPLE) * plant.period, grid(plant)
    if len(plant.inputs) == 1:
        found = tuned(nominal, hold)
        if found is None:
            return float("nan")
        return kept_bandwidth(1 / (1 + loop(nominal, found, hold, omega)), omega)
    decoupler = np.linalg.inv(-nominal.C @ np.linalg.solve(nominal.A, nominal.B))
    every = [tuned(decoupled(nominal, decoupler, i), hold) for i in range(len(plant.outputs))]
    K = np.stack([one.response(omega) for one in every if one is not None], axis=1)
    if K.shape[1] < len(every):
        return float("nan")
    late = np.exp(-1j * omega * hold)
    loops = nominal.response(omega) @ decoupler * (K * late[:, None])[:, None]
    return kept_bandwidth(size_of_sensitivity(loops, np.array(plant.demand.step)), omega)


def decoupled(plant: LinearPlant, decoupler: RealArray, i: int) -> LinearPlant:
    """The channel from the i-th input of a decoupler to output i, without the poles that its zeros
    cancel.
    """
    whole = LinearPlant(plant.A, plant.B @ decoupler[:, [i]], plant.C[[i]], plant.delay)
    poles, zeros = list(whole.poles), []
    for zero in whole.zeros:
        nearest = min(poles, key=lambda pole: abs(pole - zero))
        if abs(nearest - zero) < CANCELLED * abs(zero):
            poles.remove(nearest)
        else:
            zeros.append(zero)
    A, B, C, _ = zpk2ss(zeros, poles, 1.0)
    static = (-C @ np.linalg.solve(A, B)).item()
    return LinearPlant(A, B / static, C, plant.delay)


def size_of_sensitivity(loops: ComplexArray, sizes: RealArray) -> RealArray:
    """Largest singular value (...) of (1 + L)^-1 for loops (..., p, p), with outputs divided by
    their sizes (p,).
    """
    S = np.linalg.inv(np.eye(len(sizes)) + loops)
    found: RealArray = np.linalg.norm(S * sizes / sizes[:, None], 2, axis=(-2, -1))
    return found


def true_responses(plant: Stranger, omega: RealArray) -> tuple[list[LinearPlant], ComplexArray]:
    """True linear plants of the units, and their responses (F, N, p, m)."""
    every = linear_plants(plant, plant.drawn())
    return every, np.stack([one.response(omega) for one in every], axis=1)


def broken_weights(
    G: ComplexArray,
    K: ComplexArray,
    omega: RealArray,
    late: float,
    bandwidth_hz: float,
    sizes: RealArray,
) -> RealArray:
    """Largest |W_e S| (N,) over frequency, for the true linear plants (F, N, p, m) with the
    designed controller (F, m, p).
    """
    loops = G @ (K * np.exp(-1j * omega * late)[:, None, None])[:, None]
    W_e = np.abs(error_weight(omega, bandwidth_hz))
    peaks: RealArray = (W_e[:, None] * size_of_sensitivity(loops, sizes)).max(axis=0)
    return peaks

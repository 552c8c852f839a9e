"""Simulate records of six magnetic bearings, in place of measurements.

Without control the rotor falls to one side, so each bearing is measured while a simple controller
holds it, u = r - C y; r is periodic. Writes records/bearing1.csv to bearing6.csv.
"""

import sys
from pathlib import Path

import control
import numpy as np

RATE, SAMPLES, PERIODS, PLANTS = 10e3, 2000, 4, 6
"""Sampling frequency [Hz], samples of a period, periods, bearings."""
NOISE = 5e-8
"""Standard deviation of the noise of the gap sensor [m]."""
HOLD = control.ss(control.tf([8000.0 * 0.003, 8000.0], [0.0002, 1.0]))
"""The controller that holds the rotor while it is measured [A/m]."""


def bearing(rng: np.random.Generator) -> control.StateSpace:
    """Current [A] to gap [m]: k_i / (m s^2 - k_s), behind the lag of the amplifier."""
    mass, force, stiffness = 2.0, 40.0, 2.0e4  # kg, N/A, N/m
    mass *= 1 + 0.05 * rng.uniform(-1, 1)
    force *= 1 + 0.08 * rng.uniform(-1, 1)
    stiffness *= 1 + 0.15 * rng.uniform(-1, 1)
    return control.ss(control.tf([force], [mass, 0, -stiffness]) * control.tf([1], [1 / 6000, 1]))


def excitation() -> np.ndarray:
    """A multisine with the phases of Schroeder, 1 A at most, for all periods."""
    lines = np.unique(np.geomspace(1, 0.4 * SAMPLES, 90).astype(int))
    phase = -np.pi * np.arange(lines.size) ** 2 / lines.size
    angle = 2 * np.pi * np.outer(np.arange(SAMPLES), lines) / SAMPLES
    one = np.cos(angle + phase).sum(axis=1)
    return np.tile(one / np.abs(one).max(), PERIODS + 1)


def measured(plant: control.StateSpace, r: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Current and gap (N, 2) in the loop of the holding controller."""
    G, C = (control.sample_system(part, 1 / RATE) for part in (plant, HOLD))
    x, z, record = np.zeros(G.nstates), np.zeros(C.nstates), np.empty((r.size, 2))
    for k, reference in enumerate(r):
        y = (G.C @ x).item() + NOISE * rng.normal()
        u = reference - (C.C @ z + C.D[0] * y).item()
        x, z = G.A @ x + G.B[:, 0] * u, C.A @ z + C.B[:, 0] * y
        record[k] = u, y
    return record


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rng, r = np.random.default_rng(5), excitation()
    for number in range(1, PLANTS + 1):
        record = measured(bearing(rng), r, rng)[SAMPLES:]  # the first period settles
        columns = np.column_stack([np.arange(len(record)) / RATE, record])
        np.savetxt(
            folder / f"bearing{number}.csv",
            columns,
            delimiter=",",
            header="time [s],current [A],gap [m]",
            comments="",
            fmt="%.9g",
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "records"))

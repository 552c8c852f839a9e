"""Simulate records of five plants with two coupled tanks, in place of measurements.

Two pumps fill two tanks that a pipe joins. Each pump is excited alone, so each plant has two
records. Writes records/plant1_pump1.csv to plant5_pump2.csv.
"""

import sys
from pathlib import Path

import control
import numpy as np

RATE, SAMPLES, PERIODS, PLANTS = 2.0, 2000, 3, 5
"""Sampling frequency [Hz], samples of a period, periods, plants."""
NOISE = 2e-4
"""Standard deviation of the noise of the level sensors [m]."""


def tanks(rng: np.random.Generator) -> control.StateSpace:
    """Flows [l/min] of the pumps to levels [m], each pump behind a lag."""

    def about(value: float, share: float) -> float:
        return value * (1 + share * rng.uniform(-1, 1))

    area, outflow, pipe = 0.02, about(2e-4, 0.1), about(1e-4, 0.2)  # m^2, m^2/s
    lag, pumps = about(4.0, 0.1), [about(1 / 6e4, 0.08), about(1 / 6e4, 0.08)]
    A = np.zeros((4, 4))
    A[:2, :2] = np.array([[-(outflow + pipe), pipe], [pipe, -(outflow + pipe)]]) / area
    A[:2, 2:] = np.diag(pumps) / area
    A[2:, 2:] = -np.eye(2) / lag
    B = np.vstack([np.zeros((2, 2)), np.eye(2) / lag])
    return control.ss(A, B, np.hstack([np.eye(2), np.zeros((2, 2))]), np.zeros((2, 2)))


def excitation() -> np.ndarray:
    """A multisine with the phases of Schroeder, 2 l/min at most, for all periods."""
    lines = np.unique(np.geomspace(1, 0.2 * SAMPLES, 50).astype(int))
    phase = -np.pi * np.arange(lines.size) ** 2 / lines.size
    angle = 2 * np.pi * np.outer(np.arange(SAMPLES), lines) / SAMPLES
    one = np.cos(angle + phase).sum(axis=1)
    return np.tile(2 * one / np.abs(one).max(), PERIODS + 1)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rng, one = np.random.default_rng(3), excitation()
    for number in range(1, PLANTS + 1):
        sampled = control.sample_system(tanks(rng), 1 / RATE)
        for pump in (0, 1):
            flow = np.zeros((2, one.size))
            flow[pump] = one
            level = control.forced_response(sampled, inputs=flow).outputs
            level = level + NOISE * rng.normal(size=level.shape)
            columns = np.column_stack([np.arange(one.size) / RATE, one, *level])[SAMPLES:]
            np.savetxt(
                folder / f"plant{number}_pump{pump + 1}.csv",
                columns,
                delimiter=",",
                header="time [s],flow [l/min],level1 [m],level2 [m]",
                comments="",
                fmt="%.7g",
            )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "records"))

"""Simulate records of six servos with two masses, in place of measurements.

A motor turns a load through a shaft. Load, shaft and friction differ from servo to servo. Writes
records/drive1.csv to drive6.csv.
"""

import sys
from pathlib import Path

import control
import numpy as np

RATE, SAMPLES, PERIODS, PLANTS = 2000.0, 4000, 4, 6
"""Sampling frequency [Hz], samples of a period, periods, servos."""
NOISE = 0.003
"""Standard deviation of the noise of the speed sensor [rad/s]."""


def servo(rng: np.random.Generator) -> control.StateSpace:
    """Torque [N m] to speed of the motor [rad/s]."""

    def about(value: float, share: float) -> float:
        return value * (1 + share * rng.uniform(-1, 1))

    motor, load, shaft = about(0.01, 0.02), about(0.02, 0.1), about(300.0, 0.1)
    damping, friction = about(0.08, 0.3), about(0.05, 0.2)
    A = [
        [-(damping + friction) / motor, damping / motor, -shaft / motor],
        [damping / load, -(damping + friction) / load, shaft / load],
        [1.0, -1.0, 0.0],
    ]
    return control.ss(A, [[1 / motor], [0], [0]], [[1, 0, 0]], 0)


def excitation() -> np.ndarray:
    """A multisine with the phases of Schroeder, 1 N m at most, for all periods."""
    lines = np.unique(np.geomspace(1, 0.45 * SAMPLES, 120).astype(int))
    phase = -np.pi * np.arange(lines.size) ** 2 / lines.size
    angle = 2 * np.pi * np.outer(np.arange(SAMPLES), lines) / SAMPLES
    one = np.cos(angle + phase).sum(axis=1)
    return np.tile(one / np.abs(one).max(), PERIODS + 1)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rng, u = np.random.default_rng(1), excitation()
    for number in range(1, PLANTS + 1):
        sampled = control.sample_system(servo(rng), 1 / RATE)
        speed = control.forced_response(sampled, inputs=u).outputs + NOISE * rng.normal(size=u.size)
        columns = np.column_stack([np.arange(u.size) / RATE, u, speed])[SAMPLES:]
        np.savetxt(
            folder / f"drive{number}.csv",
            columns,
            delimiter=",",
            header="t [s],torque [N m],speed [rad/s]",
            comments="",
            fmt="%.9g",
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "records"))

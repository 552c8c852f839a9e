"""Simulation of a stranger's units: rest, integration steps, dead time, converters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .stranger import Array, Parameters, Stranger

NEWTON_STEPS, DIFFERENCE, SMALL = 30, 1e-6, 1e-3
"""Newton steps to the state of rest, relative width of differences, and least scale of a state."""


def jacobian(function: object, at: Array) -> Array:
    """Jacobian (k, n, N) of a function (n, N) -> (k, N), by central differences."""
    columns = []
    for i in range(len(at)):
        width = DIFFERENCE * np.maximum(np.abs(at[i]), 1e-3)
        step = np.zeros_like(at)
        step[i] = width
        columns.append((function(at + step) - function(at - step)) / (2 * width))  # type: ignore[operator]
    return np.stack(columns, axis=1)


def at_rest(plant: Stranger, p: Parameters) -> tuple[Array, Array]:
    """States (n, N) and inputs (m, N) at rest, where all derivatives are zero, by Newton's method.

    A plant that integrates has many states of rest; the one nearest to the guess is returned.
    """
    count, n = len(next(iter(p.__dict__.values()))), len(plant.guess)
    still = np.zeros(count)
    x = np.repeat(np.asarray(plant.guess)[:, None], count, axis=1)
    wanted = plant.rest_u if plant.rest_u is not None else plant.rest_y
    assert wanted is not None
    target = np.repeat(np.asarray(wanted)[:, None], count, axis=1)

    def moved(z: Array) -> Array:
        if plant.rest_u is not None:
            return plant.slope(z, target, still, p)
        return np.vstack([plant.slope(z[:n], z[n:], still, p), plant.output(z[:n], p) - target])

    middle = np.array([[0.5 * (one.low + one.high)] for one in plant.inputs])
    z = x if plant.rest_u is not None else np.vstack([x, np.repeat(middle, count, axis=1)])
    scale = np.maximum(np.abs(z), SMALL)
    for _ in range(NEWTON_STEPS):
        matrices, wrong = jacobian(moved, z) * scale, moved(z)
        rows = np.abs(matrices).max(axis=1)
        steps = [
            np.linalg.lstsq(
                matrices[:, :, k] / rows[:, None, k], wrong[:, k] / rows[:, k], rcond=1e-9
            )[0]
            for k in range(count)
        ]
        z = z - scale * np.stack(steps, axis=1)
    return (z, target) if plant.rest_u is not None else (z[:n], z[n:])


@dataclass
class Rig:
    """All units of a plant, side by side. They start at rest."""

    plant: Stranger
    p: Parameters

    def __post_init__(self) -> None:
        self.x, self.u_rest = at_rest(self.plant, self.p)
        self.y_rest = self.plant.output(self.x, self.p)
        self._step = self.plant.period / self.plant.substeps
        late = np.asarray(getattr(self.p, "delay", np.zeros(self.x.shape[1])))
        self._late = np.round(late / self._step).astype(int)
        self._past = np.repeat(self.u_rest[None], int(self._late.max()) + 1, axis=0)

    @property
    def y(self) -> Array:
        """Outputs (m, N), without noise."""
        return self.plant.output(self.x, self.p)

    def read(self, rng: np.random.Generator) -> Array:
        """Outputs (m, N) as the converters show them, with noise."""
        y = self.y
        return np.stack(
            [
                channel.converted(one + channel.noise * rng.standard_normal(one.shape))
                for channel, one in zip(self.plant.outputs, y, strict=True)
            ]
        )

    def advance(self, u: Array, load: float = 0.0) -> None:
        """Simulate one sampling period with held, limited inputs (m, N) and a disturbance."""
        low = np.array([[one.low] for one in self.plant.inputs])
        high = np.array([[one.high] for one in self.plant.inputs])
        given, units = np.clip(u, low, high), np.arange(self.x.shape[1])
        d, h, slope, p = np.full(self.x.shape[1], load), self._step, self.plant.slope, self.p
        for _ in range(self.plant.substeps):
            self._past = np.roll(self._past, 1, axis=0)
            self._past[0] = given
            now = self._past[self._late, :, units].T
            a = slope(self.x, now, d, p)
            b = slope(self.x + 0.5 * h * a, now, d, p)
            c = slope(self.x + 0.5 * h * b, now, d, p)
            e = slope(self.x + h * c, now, d, p)
            self.x = self.x + h / 6 * (a + 2 * b + 2 * c + e)

"""What a stranger is: equations, a spread, a logger, and what is asked of its loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

Array = np.ndarray
Parameters = Any
"""A namespace of arrays (N,): a number for each unit."""
Slope = Callable[[Array, Array, Array, Parameters], Array]
"""Derivative (n, N) of the states (n, N) with inputs (m, N) and a disturbance (N,)."""
Output = Callable[[Array, Parameters], Array]
"""Outputs (m, N) of the states (n, N)."""

BITS = 12
"""Of the converters."""


@dataclass(frozen=True)
class Channel:
    """A signal: its name and unit in the header, the range of its converter, and its noise.

    Noise is a standard deviation in the unit of the signal. The range of an input is its limits.
    """

    name: str
    unit: str
    low: float
    high: float
    noise: float = 0.0

    @property
    def resolution(self) -> float:
        """A step of the converter."""
        return (self.high - self.low) / 2**BITS

    def converted(self, values: Array) -> Array:
        """Values as the converter gives them."""
        steps = np.round((values - self.low) / self.resolution)
        return self.low + self.resolution * np.clip(steps, 0, 2**BITS - 1)


@dataclass(frozen=True)
class Demand:
    """What is asked of every unit's loop.

    The set-point of each output steps by ``step``; a disturbance ``load`` acts later. The output
    overshoots by a share of the step at most and stays within a twentieth of it after ``settling``
    [s]. In the end the error is below a step of the converter, or it stays within ``dead_zone``,
    which friction or backlash leave.
    """

    step: tuple[float, ...]
    overshoot: float
    settling: float
    load: float
    dead_zone: float = 0.0


@dataclass(frozen=True)
class Test:
    """How the records are made.

    A multisine of ``samples`` and of a largest size (m,), from ``lowest`` times its fundamental, in
    ``periods`` periods, and some more samples of some units. Where a plant does not stay where it
    is, a simple controller ``hold`` = (gain, rate gain) on the first output holds it meanwhile.
    """

    samples: int
    amplitude: tuple[float, ...]
    periods: int = 4
    lowest: int = 1
    lines: int = 60
    hold: tuple[float, float] | None = None
    delimiter: str = ","


@dataclass(frozen=True)
class Stranger:
    """A plant of several units.

    Parameters
    ----------
    title
        What it is.
    nominal, spread
        Parameters of the nominal unit, and half the width of each one's uniform spread, relative.
    slope, output
        The equations. A parameter ``delay`` [s] is dead time of the inputs.
    guess
        States near those at rest.
    rest_u, rest_y
        Inputs, or outputs, at rest; one of both is given.
    period, substeps
        Sampling time [s], and steps of integration in it.
    frictionless
        Parameters with which the plant is linearised, where it has dry friction or backlash.
    refusable
        Whether the chain may refuse it, or warn.
    """

    title: str
    nominal: Mapping[str, float]
    spread: Mapping[str, float]
    slope: Slope
    output: Output
    guess: tuple[float, ...]
    period: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    test: Test
    demand: Demand
    seed: int
    units: int = 5
    substeps: int = 2
    rest_u: tuple[float, ...] | None = None
    rest_y: tuple[float, ...] | None = None
    frictionless: Mapping[str, float] = field(default_factory=dict)
    refusable: bool = False

    def drawn(self) -> Parameters:
        """Parameters of the units, the same each time."""
        rng = np.random.default_rng(self.seed)
        return SimpleNamespace(
            **{
                name: value * (1.0 + self.spread.get(name, 0.0) * rng.uniform(-1, 1, self.units))
                for name, value in self.nominal.items()
            }
        )

    def middle(self) -> Parameters:
        """Parameters of the nominal unit, as of one unit."""
        return SimpleNamespace(**{name: np.array([value]) for name, value in self.nominal.items()})

    def linear(self, p: Parameters) -> Parameters:
        """Parameters without dry friction and backlash."""
        changed = {
            name: np.full_like(p.__dict__[name], value) for name, value in self.frictionless.items()
        }
        return SimpleNamespace(**{**p.__dict__, **changed})

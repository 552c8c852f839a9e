"""Definition of a stranger: equations, spread of its units, logger, and demands on its loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

Array = np.ndarray
Parameters = Any
"""Namespace of arrays (N,): each parameter's value for every unit."""
Slope = Callable[[Array, Array, Array, Parameters], Array]
"""Derivative (n, N) of the states (n, N) with inputs (m, N) and a disturbance (N,)."""
Output = Callable[[Array, Parameters], Array]
"""Outputs (m, N) of the states (n, N)."""

BITS = 12
"""Resolution of the converters [bit]."""


@dataclass(frozen=True)
class Channel:
    """A signal: its name and unit in the header, the range of its converter, and its noise.

    Noise is given as its standard deviation, in the unit of the signal. The range of an input is
    also its limits.
    """

    name: str
    unit: str
    low: float
    high: float
    noise: float = 0.0

    @property
    def resolution(self) -> float:
        """One step of the converter, in the unit of the signal."""
        return (self.high - self.low) / 2**BITS

    def converted(self, values: Array) -> Array:
        """Values after the converter: rounded and limited."""
        steps = np.round((values - self.low) / self.resolution)
        return self.low + self.resolution * np.clip(steps, 0, 2**BITS - 1)


@dataclass(frozen=True)
class Demand:
    """Demands on the loop of every unit.

    The set-point of each output changes by ``step``; a disturbance ``load`` acts later. The output
    overshoots by at most ``overshoot``, a share of the step, and stays within a twentieth of the
    step after ``settling`` [s]. At the end the error is below one step of the converter, or below
    ``dead_zone``, where friction or backlash leave an error.
    """

    step: tuple[float, ...]
    overshoot: float
    settling: float
    load: float
    dead_zone: float = 0.0


@dataclass(frozen=True)
class Test:
    """How the records are made.

    The excitation is a multisine with a period of ``samples`` and a largest size ``amplitude``
    (m,), from ``lowest`` times its fundamental, in ``periods`` periods; some units record some
    samples more. A plant that would drift away is held meanwhile by a simple controller on its
    first output, ``hold`` = (gain, rate gain).
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
    """A plant with several units.

    Parameters
    ----------
    title
        Name of the plant in figures.
    nominal, spread
        Parameters of the nominal unit, and the half width of each parameter's uniform spread,
        relative.
    slope, output
        Equations of state and output. A parameter ``delay`` [s] is the dead time of the inputs.
    guess
        States near the state of rest.
    rest_u, rest_y
        Inputs or outputs at rest; exactly one of both is given.
    period, substeps
        Sampling time [s], and number of integration steps in it.
    frictionless
        Parameters that remove dry friction and backlash, for the linearisation.
    refusable
        Whether the chain may refuse the plant, or warn of it.
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
        """Parameters of all units, the same at each call."""
        rng = np.random.default_rng(self.seed)
        return SimpleNamespace(
            **{
                name: value * (1.0 + self.spread.get(name, 0.0) * rng.uniform(-1, 1, self.units))
                for name, value in self.nominal.items()
            }
        )

    def middle(self) -> Parameters:
        """Parameters of the nominal unit, as arrays of one unit."""
        return SimpleNamespace(**{name: np.array([value]) for name, value in self.nominal.items()})

    def linear(self, p: Parameters) -> Parameters:
        """Parameters without dry friction and backlash."""
        changed = {
            name: np.full_like(p.__dict__[name], value) for name, value in self.frictionless.items()
        }
        return SimpleNamespace(**{**p.__dict__, **changed})

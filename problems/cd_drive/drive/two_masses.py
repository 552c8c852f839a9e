"""Two masses on two springs, fitted with the lumped values of one resonance known (eq. 4.18).

The open-loop experiment sees one mass on one spring. Its values are distributed over the masses,
springs and dampers of the fourth-order model (section 4.3.2). Equation and section numbers refer to
E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from workbench.arrays import RealArray
from workbench.heavy_types import Dataset
from workbench.identification import (
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    PeriodicResponse,
)

from .actuator import SERIES_RESISTANCE
from .plants import nominal_parameters
from .tables import Axis, Drive

FITTED = ("m1", "m2", "k1", "k2", "b1", "b2")
"""Parameters of the fourth-order model that the fit determines."""
NORMAL_99 = 2.576
"""Half-width of a 99 % interval in standard deviations."""


@dataclass(frozen=True)
class Lumped:
    """Lumped parameters of a drive, known before the loop is closed.

    R: resistance of the whole circuit [ohm]. Bl: force factor [N/A]. k, b, m: spring [N/m], damper
    [N s/m] and mass [kg] that the first resonance shows. gain: optical gain divided by the assumed
    one. deviation: relative standard deviations of k, b, m and gain.
    """

    R: float
    Bl: float
    k: float
    b: float
    m: float
    gain: float = 1.0
    deviation: tuple[float, float, float, float] = (0.003, 0.015, 0.001, 0.01)

    @classmethod
    def from_open_loop(cls, open_loop: Dataset, mass: float) -> Lumped:
        """Lumped parameters from an open-loop experiment, given the mass [kg].

        The experiment's intervals hold for the lumped model. The deviations are never smaller than
        the error of that model itself.
        """
        value, half = open_loop["estimate"], open_loop["half_width"]
        R, Bl, k, b = (float(value.sel(parameter=name)) for name in ("R", "Bl", "k", "b"))
        spread = {n: float((half / value).sel(parameter=n)) / NORMAL_99 for n in ("k", "b")}
        deviation = (max(spread["k"], 0.001), max(spread["b"], 0.01), 0.001, 0.01)
        return cls(R + SERIES_RESISTANCE, Bl, k, b, mass, deviation=deviation)

    @property
    def data(self) -> KnownQuantities:
        """These values as data of a fit, weighted by their accuracy."""
        return KnownQuantities(lumped_values, (self.k, self.b, self.m, self.gain), self.deviation)

    def drawn(self, rng: np.random.Generator) -> Lumped:
        """These parameters with random errors of k, b and m, as an experiment would find them."""
        k, b, m = (1 + np.array(self.deviation[:3]) * rng.standard_normal(3)).tolist()
        return replace(self, k=k * self.k, b=b * self.b, m=m * self.m)


def lumped(drive: Drive) -> Lumped:
    """The lumped parameters of a drive near its first resonance."""
    k, b, m, _ = lumped_values({name: getattr(drive, name) for name in FITTED} | {"gain": 1.0})
    return Lumped(drive.R + SERIES_RESISTANCE, drive.Bl, k, b, m)


def lumped_values(p: Mapping[str, Any]) -> list[Any]:
    """k, b, m and gain that the fourth-order model with parameters p shows at low frequency.

    There the arm moves by rho = k2 / (k1 + k2) of the lens's displacement.
    """
    rho = p["k2"] / (p["k1"] + p["k2"])
    k = p["k1"] * p["k2"] / (p["k1"] + p["k2"])
    b = p["b1"] * rho**2 + p["b2"] * (1 - rho) ** 2
    return [k, b, p["m1"] + p["m2"] * rho**2, p["gain"]]


@dataclass(frozen=True)
class KnownQuantities:
    """Quantities known beforehand, as data of a fit.

    quantities: function of the parameters that returns them. given: their known values. deviation:
    relative standard deviations of those.
    """

    quantities: Callable[[Mapping[str, Any]], Sequence[Any]]
    given: tuple[float, ...]
    deviation: tuple[float, ...]
    name: ClassVar[str] = "known values"
    degrees: ClassVar[float] = np.inf
    weighted: ClassVar[bool] = True
    size: ClassVar[float] = 0.0

    @property
    def count(self) -> int:
        return len(self.given)

    def _errors(self, p: Mapping[str, Any]) -> list[Any]:
        known = zip(self.quantities(p), self.given, self.deviation, strict=True)
        return [(value / given - 1) / deviation for value, given, deviation in known]

    def residuals(self, values: Mapping[str, float]) -> RealArray:
        return np.array(self._errors(values))

    def expression(self, names: Sequence[str], vector: Any) -> Any:
        import casadi as ca

        return ca.vertcat(*self._errors({name: vector[i] for i, name in enumerate(names)}))


def lens(p: Mapping[str, Any], s: Any, R: float, Bl: float) -> Any:
    """x / coil voltage [m/V] of the specific model (Table 3.2), times the gain."""
    link, arm = p["b2"] * s + p["k2"], p["m2"] * s**2 + (p["b1"] + p["b2"]) * s + p["k1"] + p["k2"]
    force = p["m1"] * s**2 + link - link**2 / arm + s * (Bl**2 / R)
    return p["gain"] * (Bl / R) / force


def two_mass_fit(estimate: PeriodicResponse, known: Lumped, axis: Axis) -> ParameterFit:
    """Fit of the six parameters and the gain to a measured response x / coil voltage [m/V].

    It starts at the nominal drive's parameters. b2 may become negative: a bound at zero would hide
    how little the data tell about it.
    """
    arm = nominal_parameters(axis)
    start = {name: getattr(arm, name) for name in FITTED} | {"gain": known.gain}
    parameters = {
        name: FittedParameter(value, value / 5, value * 5) for name, value in start.items()
    }
    parameters["b2"] = FittedParameter(arm.b2, -20 * arm.b2, 20 * arm.b2)
    measured = MeasuredResponse.of(lambda p, s: lens(p, s, known.R, known.Bl), estimate)
    return ParameterFit([measured, known.data], parameters)

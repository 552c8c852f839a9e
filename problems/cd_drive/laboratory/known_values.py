"""Prior knowledge of a drive and of the bench before the loop is closed, as data of a fit.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench.identification import FittedParameter
from workbench.types import Dataset, RealArray

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.plants import nominal_parameters
from ..drive.tables import ActuatorParameters, Axis
from ..drive.two_masses import LumpedValues, lumped, lumped_values
from .bench_setup import PERIOD
from .unknowns import (
    CORNER_DEVIATION,
    DELAY_DEVIATION,
    MASS_DEVIATION,
    corner_ratio,
)

CONFIDENCE, NORMAL_99 = 0.99, 2.576
"""Probability with which an interval covers the true value, and its half-width in standard
deviations.
"""
MODEL_DEVIATION = {"Bl": 0.001, "k": 0.001, "b": 0.01, "m": 0.001}
"""Errors of the lumped model itself: relative standard deviations of its parameters."""
MASS_POWER = {"R": 0.0, "Bl": 0.5, "k": 1.0, "b": 1.0, "m": 1.0}
"""Powers of the mass with which the lumped parameters scale, if they are found with another mass:
the current shows only k/m, b/m and Bl^2/m.
"""
RATIO_DEVIATION = np.sqrt(2.0) * CORNER_DEVIATION
"""Relative standard deviation of the ratio of two channels' filter corners."""


@dataclass(frozen=True, eq=False)
class KnownQuantities:
    """Quantities known beforehand, as data of a fit.

    quantities: function of the parameters that returns the quantities. given: their known values
    (n,). covariance: covariance of these values (n, n).
    """

    quantities: Callable[[Mapping[str, Any]], Sequence[Any]]
    given: RealArray
    covariance: RealArray
    name: str = "known values"
    degrees: ClassVar[float] = np.inf
    weighted: ClassVar[bool] = True
    size: ClassVar[float] = 0.0

    @property
    def count(self) -> int:
        return len(self.given)

    @cached_property
    def _whitening(self) -> RealArray:
        """Matrix that makes the errors independent, with a standard deviation of one each."""
        found: RealArray = np.linalg.inv(np.linalg.cholesky(self.covariance))
        return found

    def residuals(self, values: Mapping[str, float]) -> RealArray:
        found: RealArray = self._whitening @ (np.array(self.quantities(values)) - self.given)
        return found

    def expression(self, names: Sequence[str], vector: Any) -> Any:
        import casadi as ca

        values = self.quantities({name: vector[i] for i, name in enumerate(names)})
        return ca.mtimes(ca.DM(self._whitening), ca.vertcat(*values) - ca.DM(self.given))


def independent(given: Mapping[str, tuple[float, float]], name: str) -> KnownQuantities:
    """Parameters that are known independently: value and standard deviation of each, by name."""
    values, deviations = np.transpose(list(given.values()))
    return KnownQuantities(
        lambda p: [p[one] for one in given], values, np.diag(deviations**2), name
    )


@dataclass(frozen=True, eq=False)
class Lumped:
    """Lumped parameters of a drive as they are known before the loop is closed.

    R: resistance of the whole circuit [ohm]. values: force factor, spring, damper, mass.
    covariance: covariance of the values (4, 4).
    """

    R: float
    values: LumpedValues
    covariance: RealArray

    @classmethod
    def of(cls, drive: ActuatorParameters) -> Lumped:
        """The true parameters of a drive, known as accurately as the told mass."""
        values = lumped(drive)
        common = MASS_DEVIATION * np.array([MASS_POWER[name] for name in values._fields])
        relative = np.outer(common, common) + _model_covariance()
        return cls(drive.R + SERIES_RESISTANCE, values, relative * np.outer(values, values))

    @classmethod
    def from_open_loop(cls, draw: Dataset) -> Lumped:
        """The parameters that one draw of the open-loop experiment found, with the told mass.

        The experiment's covariance assumes the lumped model; the error of that model is added.
        """
        names = list(LumpedValues._fields)
        R, *found = draw["estimate"].sel(parameter=["R", *names[:-1]]).values.tolist()
        found.append(float(draw["mass"]))
        covariance = draw["covariance"].sel(found=names, other=names).values
        model = _model_covariance() * np.outer(found, found)
        return cls(R + SERIES_RESISTANCE, LumpedValues(*found), covariance + model)

    @property
    def data(self) -> KnownQuantities:
        """These values as data of a fit."""
        return KnownQuantities(lumped_values, np.array(self.values), self.covariance)

    def drawn(self, rng: np.random.Generator) -> Lumped:
        """These values with random errors, as an experiment would find them."""
        found = rng.multivariate_normal(self.values, self.covariance)
        return replace(self, values=LumpedValues(*found.tolist()))


def _model_covariance() -> RealArray:
    return np.diag([MODEL_DEVIATION[name] ** 2 for name in LumpedValues._fields])


CHAIN = {
    "gain": FittedParameter(1.0, lower=0.2, upper=5.0),
    "delay": FittedParameter(1.0, lower=0.5, upper=1.5),
    "corner": FittedParameter(1.0, lower=0.2, upper=5.0),
}
"""Starting values and bounds of the parameters of `chain_ratio`."""


def chain_known(gain_deviation: float) -> KnownQuantities:
    """Prior knowledge of the measurement chain; its gain has this relative standard deviation."""
    deviations = gain_deviation, DELAY_DEVIATION, RATIO_DEVIATION
    given = {name: (1.0, one) for name, one in zip(CHAIN, deviations, strict=True)}
    return independent(given, "measurement chain")


def chain_ratio(p: Mapping[str, Any], s: Any) -> Any:
    """The true measurement chain divided by the told one, from control signal to error.

    gain and corner are the true over the told optical gain, and ratio of both filters' corners.
    delay is the true delay if the told one is 1 sample; an error in it acts as a lag in the error's
    channel.
    """
    lag = np.exp(-s * (PERIOD * (p["delay"] - 1.0)))
    return p["gain"] * lag * corner_ratio(p["corner"], s)


def arm_parameters(axis: Axis, names: Sequence[str]) -> dict[str, FittedParameter]:
    """Starting values and bounds of the fourth-order model's parameters, from the nominal drive.

    b2 may become negative: a bound at zero would hide how little the data say about it.
    """
    arm = nominal_parameters(axis)
    start = {name: getattr(arm, name) for name in names}
    found = {
        name: FittedParameter(value, lower=value / 5, upper=value * 5)
        for name, value in start.items()
    }
    found["b2"] = FittedParameter(arm.b2, lower=-20 * arm.b2, upper=20 * arm.b2)
    return found

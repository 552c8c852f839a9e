"""Plants scaled by functions of frequency, and a descent of the least level over the scalings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.synthesis.h_infinity.levels import EVEN_STEEPNESS, least_level, level_from
from workbench.synthesis.h_infinity.normalised import normalised_plant
from workbench.synthesis.h_infinity.worst_signals import worst_densities
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.gamma import GAMMA_FUNCTION
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import (
    Matrices,
    in_series,
    matrices_of,
    realisation,
    side_by_side,
)
from workbench.systems.standard_plant import standard_plant

DESCENT_LEVEL_TOLERANCE = 1e-6
"""Relative tolerance of levels that a descent compares."""
DESCENT_START_TOLERANCE = 1e-3
"""Relative tolerance of the first level, from which the next ones are found."""
MOST_DESCENT_STEPS, LEAST_DESCENT_FALL = 60, 1e-5
"""Largest number of steps of a descent, and least decrease of the logarithm of the level in a
step.
"""
LARGEST_DESCENT_STEP = 1.0
"""Largest change of a parameter in a step."""
DESCENT_SHARES = tuple(0.4**k for k in range(7))
"""Shares of a step that are tried in turn."""
SUFFICIENT_FALL = 1e-3
"""Least share of the predicted decrease that a step must achieve."""


@dataclass(frozen=True, eq=False)
class Round:
    """Scalings of a round: ``D`` for each block, ``gamma`` for all outputs but the measurements.

    ``target`` is the logarithm of the wanted gamma at the log frequencies ``at``. ``level`` is a
    level that some controller reaches with these scalings (NaN if unknown); the search for the
    least level starts there. ``curvature`` (n, n), positive definite, is a guess of the second
    derivative of the logarithm of the least level by the parameters of D.
    """

    D: tuple[Biquads, RealArray]
    gamma: RealArray
    at: RealArray
    target: RealArray
    level: float
    curvature: RealArray

    @property
    def parameters(self) -> dict[str, RealArray]:
        """Parameters of the scalings by name, including gamma if there is one."""
        return {"D": self.D[1]} | ({"gamma": self.gamma} if self.gamma.any() else {})

    def arrays(self) -> dict[str, RealArray]:
        """All parts as named arrays, for a checkpoint."""
        level = {"level": np.array(self.level), "curvature": self.curvature}
        return {
            "D": self.D[1], "gamma": self.gamma, "at": self.at, "target": self.target, **level
        }  # fmt: skip

    @classmethod
    def restored(cls, arrays: Mapping[str, RealArray]) -> Round:
        """The scalings from the arrays that `arrays` returned."""
        D, gamma, at, target, level, curvature = (
            arrays[name] for name in ("D", "gamma", "at", "target", "level", "curvature")
        )
        return cls((Biquads.of(D), D), gamma, at, target, float(level), curvature)


def scaled_plant(plant: GeneralisedPlant, parameters: Mapping[str, RealArray]) -> GeneralisedPlant:
    """The plant with D at the perturbation outputs, D^-1 at the perturbation inputs, and gamma.

    Gamma multiplies all outputs except the measurements. The ``parameters`` are those of a
    `Round`; without D the plant stays as it is.
    """
    if "D" not in parameters:
        return plant
    assert plant.structure is not None
    x = parameters["D"]
    scalings = Biquads.of(x)
    system, rest = plant.system, plant.measurements
    pairs = zip(plant.structure, scalings.realised(x), strict=True)
    inverses = zip(plant.structure, scalings.realised(scalings.inverse(x)), strict=True)
    out = [d for block, d in pairs for _ in range(block.columns)]
    into = [d for block, d in inverses for _ in range(block.rows)]
    found = with_scalings(plant, into, out)
    if "gamma" in parameters:
        gamma = GAMMA_FUNCTION.realised(parameters["gamma"]) * (system.noutputs - rest)
        found = in_series(found, side_by_side(gamma, system.noutputs))
    return replace(plant, system=realisation(found, 0.0))


def with_scalings(
    plant: GeneralisedPlant, into: Sequence[Matrices], out: Sequence[Matrices]
) -> Matrices:
    """The plant with systems side by side before its first inputs and after its first outputs."""
    system = plant.system
    found = in_series(side_by_side(into, system.ninputs), matrices_of(system))
    return in_series(found, side_by_side(out, system.noutputs))


def level_descent(plant: GeneralisedPlant, used: Round, enough: float = 0.0) -> Round:
    """Scalings with a lower least level, found by a quasi-Newton descent from the given ones.

    The level of the next controller is a smooth function of the parameters of D. Its gradient costs
    no more than the level itself (see `worst_signals`). The first steps use the curvature of the
    fit to the last loop, which limits the change of each parameter. D-K iteration alone descends
    along single directions, and it stops when the bound of its loop is flat over frequency. The
    descent ends when the level is at most ``enough``. The returned scalings contain their least
    level.
    """
    scalings, x = used.D
    low, high = scalings.limits(np.exp(used.at))
    flat = np.clip(x.ravel(), low, high)
    now = _slope(plant, used, flat, used.level) or _slope(plant, used, flat, math.nan)
    curvature, fall = used.curvature, math.inf
    for number in range(MOST_DESCENT_STEPS):
        if now is None or fall < LEAST_DESCENT_FALL or np.exp(now.value) <= enough:
            break
        value, gradient, _ = now
        free = (flat > low) | (gradient < 0.0)
        free &= (flat < high) | (gradient > 0.0)
        step = np.zeros_like(flat)
        step[free] = -np.linalg.solve(curvature[np.ix_(free, free)], gradient[free])
        step *= min(1.0, LARGEST_DESCENT_STEP / float(np.abs(step).max(initial=EPS)))
        trials = [np.clip(flat + share * step, low, high) for share in DESCENT_SHARES]
        try:
            lower = _first_lower(plant, used, flat, now, trials)
        except TimeLimitError:
            if not number:
                raise
            break  # these scalings are better than the given ones
        if lower is None:
            break
        trial, new = lower
        curvature = updated_hessian(curvature, trial - flat, new.gradient - gradient)
        fall, flat, now = value - new.value, trial, new
    level = used.level if now is None else math.exp(now.value)
    return replace(used, D=(scalings, flat.reshape(x.shape)), level=level)


def _first_lower(
    plant: GeneralisedPlant, used: Round, flat: RealArray, now: Slope, trials: Sequence[RealArray]
) -> tuple[RealArray, Slope] | None:
    """The first of the trial parameters whose level is low enough, with its slope."""
    value, gradient, steepness = now
    for trial in trials:
        promised = -float(gradient @ (trial - flat))
        new = _slope(plant, used, trial, math.exp(value), steepness, math.exp(value))
        if new is not None and new.value < value - SUFFICIENT_FALL * promised:
            return trial, new
    return None


class Slope(NamedTuple):
    """Logarithm of the least level, its gradient by the parameters of D, and the steepness.

    The steepness is that of `level_from`; with it the next level is found in fewer steps.
    """

    value: float
    gradient: RealArray
    steepness: float


def _slope(
    plant: GeneralisedPlant,
    used: Round,
    flat: RealArray,
    guess: float,
    steepness: float = EVEN_STEEPNESS,
    most: float = math.inf,
) -> Slope | None:
    """Logarithm of the least level, searched near a guess, and its gradient by the parameters of D.

    The guess may be NaN. The result is None if no level below ``most`` is found.
    """
    assert plant.structure is not None
    scalings, x = used.D
    D, omega = flat.reshape(x.shape), np.exp(used.at)
    try:
        scaled = scaled_plant(plant, used.parameters | {"D": D})
        normal = normalised_plant(standard_plant(scaled))
        if math.isnan(guess):
            guess = least_level(normal.plant, DESCENT_START_TOLERANCE)[1].gamma
    except (InputError, SolverError):
        return None
    found = level_from(normal.plant, guess, DESCENT_LEVEL_TOLERANCE, steepness, most)
    if found is None:
        return None
    level, steepness = found
    w, z = worst_densities(normal, level, omega)
    _, slope = scalings.log_magnitude(D, omega)
    blocks = zip(plant.structure.row_slices, plant.structure.column_slices, strict=True)
    share = np.array([z[:, out].sum(axis=1) - w[:, into].sum(axis=1) for into, out in blocks])
    gradient = np.trapezoid(slope * share[:, None], omega, axis=-1)
    return Slope(math.log(level.gamma), gradient.ravel(), steepness)

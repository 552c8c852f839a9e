"""Plants scaled by functions of frequency, and the descent of their least level by the scalings."""

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
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.synthesis.mu.scalings import Scalings
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import in_series, realisation, side_by_side
from workbench.systems.standard_plant import standard_plant

GAMMA_FUNCTION = Scalings(1, 2)
"""Function that represents gamma of the (mu, D)-K iteration: a gain and two biquads."""
DESCENT_LEVEL_TOLERANCE = 1e-6
"""Relative tolerance of the levels that a descent compares."""
DESCENT_START_TOLERANCE = 1e-3
"""Relative tolerance of the first level, from which the next ones are found."""
MOST_DESCENT_STEPS, LEAST_DESCENT_FALL = 60, 1e-5
"""Most steps of a descent, and the fall of the logarithm of the level by which a step must pay."""
LARGEST_DESCENT_STEP = 1.0
"""Largest change of a parameter in a step."""
DESCENT_SHARES = tuple(0.4**k for k in range(7))
"""Shares of a step that are tried in turn."""
SUFFICIENT_FALL = 1e-3
"""Share of the promised fall that a step must bring."""


@dataclass(frozen=True, eq=False)
class Round:
    """Scalings of a round: ``D`` for each block, ``gamma`` for all outputs but the measurements.

    ``target`` is the logarithm of the wanted gamma at log frequencies ``at``. ``level`` is a level
    that some controller reaches with these scalings; the search for the least one begins there
    (NaN: not known). ``curvature`` (n, n), positive definite, is a guess of the second derivative
    of the logarithm of the least level by the parameters of D.
    """

    D: tuple[Scalings, RealArray]
    gamma: RealArray
    at: RealArray
    target: RealArray
    level: float
    curvature: RealArray

    @property
    def parameters(self) -> dict[str, RealArray]:
        """Parameters of the scalings by name, with gamma where there is one."""
        return {"D": self.D[1]} | ({"gamma": self.gamma} if self.gamma.any() else {})

    def arrays(self) -> dict[str, RealArray]:
        """All parts as arrays by name, for a checkpoint."""
        level = {"level": np.array(self.level), "curvature": self.curvature}
        return {
            "D": self.D[1], "gamma": self.gamma, "at": self.at, "target": self.target, **level
        }  # fmt: skip

    @classmethod
    def restored(cls, arrays: Mapping[str, RealArray]) -> Round:
        """The scalings that `arrays` gave."""
        D, gamma, at, target, level, curvature = (
            arrays[name] for name in ("D", "gamma", "at", "target", "level", "curvature")
        )
        return cls((Scalings.of(D), D), gamma, at, target, float(level), curvature)


def scaled_plant(plant: GeneralisedPlant, used: Round) -> GeneralisedPlant:
    """The plant with D at the perturbation outputs, D^-1 at the perturbation inputs, and gamma.

    Gamma multiplies all outputs except the measurements.
    """
    assert plant.structure is not None
    scalings, x = used.D
    system, rest = plant.system, plant.measurements
    pairs = zip(plant.structure, scalings.realised(x), strict=True)
    inverses = zip(plant.structure, scalings.realised(scalings.inverse(x)), strict=True)
    out = [d for block, d in pairs for _ in range(block.columns)]
    into = [d for block, d in inverses for _ in range(block.rows)]
    found = in_series(side_by_side(into, system.ninputs), (system.A, system.B, system.C, system.D))
    found = in_series(found, side_by_side(out, system.noutputs))
    if used.gamma.any():
        gamma = GAMMA_FUNCTION.realised(used.gamma) * (system.noutputs - rest)
        found = in_series(found, side_by_side(gamma, system.noutputs))
    return replace(plant, system=realisation(found, 0.0))


def level_descent(plant: GeneralisedPlant, used: Round, enough: float = 0.0) -> Round:
    """Scalings of less level, found from those given by a quasi-Newton descent.

    The level of the next controller is a smooth function of the parameters of D, whose gradient
    costs no more than the level itself (see `worst_signals`). The first steps follow the curvature
    of the fit to the last loop, which tells how far each parameter may go. D-K iteration alone
    descends in single directions and stops where the bound of its loop is flat over frequency. The
    descent ends at a level that is ``enough``. The scalings returned have their least level.
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
            lower = _lower(plant, used, flat, now, trials)
        except TimeLimitError:
            if not number:
                raise
            break  # the scalings are better than those given
        if lower is None:
            break
        trial, new = lower
        curvature = updated_hessian(curvature, trial - flat, new.gradient - gradient)
        fall, flat, now = value - new.value, trial, new
    level = used.level if now is None else math.exp(now.value)
    return replace(used, D=(scalings, flat.reshape(x.shape)), level=level)


def _lower(
    plant: GeneralisedPlant, used: Round, flat: RealArray, now: Slope, trials: Sequence[RealArray]
) -> tuple[RealArray, Slope] | None:
    """The first of the flat parameters on trial whose level is low enough, with its slope."""
    value, gradient, steepness = now
    for trial in trials:
        promised = -float(gradient @ (trial - flat))
        new = _slope(plant, used, trial, math.exp(value), steepness, math.exp(value))
        if new is not None and new.value < value - SUFFICIENT_FALL * promised:
            return trial, new
    return None


class Slope(NamedTuple):
    """Logarithm of the least level, its gradient by the parameters of D, and its steepness.

    The steepness is the one of `level_from`, from which the next level is found in fewer steps.
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
    """The logarithm of the least level, near a guess, and its gradient by the parameters of D.

    The guess may be NaN. None where no level below ``most`` is found.
    """
    assert plant.structure is not None
    scalings, x = used.D
    D, omega = flat.reshape(x.shape), np.exp(used.at)
    try:
        normal = normalised_plant(
            standard_plant(scaled_plant(plant, replace(used, D=(scalings, D))))
        )
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

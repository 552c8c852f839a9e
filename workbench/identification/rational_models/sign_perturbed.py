"""Confidence regions of rational models that are exact for finite data: sign-perturbed sums.

For the true model the residuals are the errors of the data. Suppose that these are independent from
one frequency to the next and symmetrically distributed. Then sums of slopes times residuals have
the same distribution with and without random signs, so each of all m sums is equally likely to be
the largest. The region contains the models whose own sum is not among the q largest. It contains
the true model with probability exactly 1 - q / m, for any number of frequencies and any
distribution of the errors.

Source: B. C. Csaji, M. C. Campi and E. Weyer, IEEE Trans. Signal Processing 63(1), 2015.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.optimality import DEPENDENT, model_directions
from workbench.identification.rational_models.structure import ModelStructure
from workbench.input_checks import need_count

COUNT_ROUNDING = 1e-9
"""Distance of a number of sums from a whole number that counts as rounding."""


@dataclass(frozen=True, eq=False)
class SignPerturbedRegion:
    """A confidence region for models of a structure, with exact confidence.

    Unlike an `EstimateRegion`, it is exact for short records, and tells only whether a model
    belongs to it.

    Parameters
    ----------
    structure
        Structure and data. Their covariance is only a weight: a wrong one makes the region larger,
        but the confidence stays exact.
    confidence
        1 - q / m with a whole number q from 1 to m - 1.
    sums
        m, the number of sums, including the one without random signs.
    seed
        Seed of the signs and of the random order that ranks equal sums.

    Raises
    ------
    InputError
        An invalid number of sums, or a confidence that is not such a fraction.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import (
    ...     ResponseEstimate,
    ...     SignPerturbedRegion,
    ...     fit_rational_model,
    ... )
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> variance = np.full((60, 1, 1), 2e-6)
    >>> measured = ResponseEstimate(frequency, (exact + noise)[:, None, None], variance, np.inf)
    >>> found = fit_rational_model(measured, orders=1, excess=1)
    >>> region = SignPerturbedRegion(found.uncertainty.structure, confidence=0.95)
    >>> region.contains(found.model)
    True
    """

    structure: ModelStructure
    _: KW_ONLY
    confidence: float = 0.95
    sums: int = 100
    seed: int = 0

    def __post_init__(self) -> None:
        need_count("sums", self.sums)
        left = (1.0 - self.confidence) * self.sums
        whole = abs(left - round(left)) <= COUNT_ROUNDING * self.sums
        if not (whole and 1 <= round(left) < self.sums):
            raise InputError(
                f"confidence is {self.confidence}; with {self.sums} sums it must be 1 - q / "
                f"{self.sums} for a whole number q from 1 to {self.sums - 1}"
            )

    @cached_property
    def _signs(self) -> RealArray:
        """Signs (m, F), the first row all ones."""
        rng = np.random.default_rng(self.seed)
        signs = rng.choice([-1.0, 1.0], size=(self.sums, self.structure.data.omega.size))
        signs[0] = 1.0
        return signs

    @cached_property
    def _order(self) -> RealArray:
        """A random order (m,) of the sums, which decides between equal ones."""
        return np.random.default_rng([self.seed, 1]).permutation(self.sums).astype(float)

    def rank(self, model: CommonPoleModel) -> int:
        """Number of sums that are smaller than the model's own, from 0 to m - 1."""
        structure, data = self.structure, self.structure.data
        values = model.response(data.omega)
        residual = data.whitened(values - data.response)
        slopes = data.whitened(model_directions(structure, model, values)[0])
        count = slopes.shape[-1]
        parts = [np.stack([each.real, each.imag], axis=1) for each in (slopes, residual)]
        rows = parts[0].reshape(-1, count)
        size = np.linalg.norm(rows, axis=0)
        u, s, _ = np.linalg.svd(rows[:, size > 0] / size[size > 0], full_matrices=False)
        frame = u[:, s > DEPENDENT * s.max(initial=0.0)]
        products = frame.reshape(data.omega.size, -1, frame.shape[1])
        each = np.einsum("frk,fr->fk", products, parts[1].reshape(data.omega.size, -1))
        lengths = np.sum((self._signs @ each) ** 2, axis=1)
        below = lengths < lengths[0]
        below |= (lengths == lengths[0]) & (self._order < self._order[0])
        return int(below.sum())

    def contains(self, model: CommonPoleModel) -> bool:
        """Whether a model is in the region."""
        return self.rank(model) < self.sums - round((1.0 - self.confidence) * self.sums)

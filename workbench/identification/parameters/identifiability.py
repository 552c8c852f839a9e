"""Identifiability: combinations of parameters that the data do not determine, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

DERIVATIVE_ROUNDING = 1e-9
"""A singular value of the Jacobian below this, relative to the largest, counts as rounding."""
NAMED_SHARE = 0.02
"""A parameter is named in a combination if its share, relative to the largest, exceeds this."""


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Singular values of the Jacobian for relative changes of the parameters, with an explanation.

    Parameters
    ----------
    singular_values
        In falling order; the inverse of each is the relative standard deviation of a combination.
    blind
        Sentences on combinations that do not change the residuals, by the structure of the model.
    unseen
        Sentences on these combinations and on those hidden by noise: a change of 100 % changes the
        residuals by less than a standard deviation.
    """

    singular_values: np.ndarray
    blind: tuple[str, ...]
    unseen: tuple[str, ...]

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        if not len(self.singular_values):
            return 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(self.singular_values[0] / self.singular_values[-1])


def identifiability(
    jacobian: np.ndarray, names: Sequence[str], spread: float = 1.0
) -> Identifiability:
    """Identifiability of parameters from the derivatives of the residuals.

    Parameters
    ----------
    jacobian
        Derivatives (N, n) of the residuals with respect to relative changes of the parameters.
    names
        Names of the n parameters.
    spread
        Standard deviation of the residuals.
    """
    if not names:
        return Identifiability(np.empty(0), (), ())
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    blind, weak = s <= DERIVATIVE_ROUNDING * s[0], s <= spread
    return Identifiability(s, _sentences(vt[blind], names), _sentences(vt[blind | weak], names))


def _sentences(directions: np.ndarray, names: Sequence[str]) -> tuple[str, ...]:
    """Sentences on directions (k, n) of relative change, after pivoting makes them sparse."""
    if not len(directions):
        return ()
    _, _, order = linalg.qr(directions, pivoting=True, mode="economic")
    pivots = order[: len(directions)]
    sparse = np.linalg.solve(directions[:, pivots], directions)
    return tuple(_sentence(row, names) for row in sparse)


def _sentence(direction: np.ndarray, names: Sequence[str]) -> str:
    """Sentence on one direction (n,) of relative change that the data do not determine."""
    shares = direction / direction[np.argmax(np.abs(direction))]
    parts = [i for i in range(len(names)) if abs(shares[i]) > NAMED_SHARE]
    if len(parts) == 1:
        return f"{names[parts[0]]} does not show in the data: fix it or add data"
    if shares[parts[0]] < 0:
        shares = -shares
    terms = [_power(names[i], 1 / float(shares[i])) for i in parts]
    together = f"{', '.join(terms[:-1])} and {terms[-1]} scale together"
    return f"{together} and the data cannot tell by how much: fix one of them or add data"


def _power(name: str, exponent: float) -> str:
    """Power of a parameter that changes in proportion to the combination, such as Bl^2 or 1/k."""
    nearest = round(2 * exponent) / 2
    if nearest and abs(exponent - nearest) < 0.02 * abs(exponent):
        exponent = nearest
    power = name if abs(exponent) == 1 else f"{name}^{abs(exponent):.3g}"
    return power if exponent > 0 else f"1/{power}"

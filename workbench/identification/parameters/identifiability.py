"""Which combination of parameters the data cannot see, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

BLIND = 1e-9
"""Singular value, relative to the largest, below which a derivative is rounding."""
SMALL = 0.02
"""Share in a combination below which a parameter is not named."""


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Singular values of the Jacobian to relative changes of the parameters, and what they say.

    Parameters
    ----------
    singular_values
        Falling; one over each is the relative standard deviation of a combination.
    blind
        Sentences on combinations that change nothing: the model's structure hides them.
    unseen
        Sentences on these and on combinations that the data's noise hides: a change by their own
        size stays within a standard deviation.
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
    """Diagnosis from the derivatives of the residuals.

    Parameters
    ----------
    jacobian
        Of residuals to relative changes of the parameters, shape (N, n).
    names
        Of the n parameters.
    spread
        Standard deviation of the residuals.
    """
    if not names:
        return Identifiability(np.empty(0), (), ())
    _, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    blind, weak = s <= BLIND * s[0], s <= spread
    return Identifiability(s, _sentences(vt[blind], names), _sentences(vt[blind | weak], names))


def _sentences(directions: np.ndarray, names: Sequence[str]) -> tuple[str, ...]:
    """Each direction of relative change in words, the directions made as sparse as pivots do."""
    if not len(directions):
        return ()
    _, _, order = linalg.qr(directions, pivoting=True, mode="economic")
    pivots = order[: len(directions)]
    sparse = np.linalg.solve(directions[:, pivots], directions)
    return tuple(_sentence(row, names) for row in sparse)


def _sentence(direction: np.ndarray, names: Sequence[str]) -> str:
    shares = direction / direction[np.argmax(np.abs(direction))]
    parts = [i for i in range(len(names)) if abs(shares[i]) > SMALL]
    if len(parts) == 1:
        return f"{names[parts[0]]} does not show in the data: fix it or add data"
    if shares[parts[0]] < 0:
        shares = -shares
    terms = [_power(names[i], 1 / float(shares[i])) for i in parts]
    together = f"{', '.join(terms[:-1])} and {terms[-1]} scale together"
    return f"{together} and the data cannot tell by how much: fix one of them or add data"


def _power(name: str, exponent: float) -> str:
    """``name`` to a power that rises as the combination does: Bl^2, 1/k."""
    nearest = round(2 * exponent) / 2
    if nearest and abs(exponent - nearest) < 0.02 * abs(exponent):
        exponent = nearest
    power = name if abs(exponent) == 1 else f"{name}^{abs(exponent):.3g}"
    return power if exponent > 0 else f"1/{power}"

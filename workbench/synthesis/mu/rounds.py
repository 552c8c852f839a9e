"""Rounds of an iteration with their controllers and scalings, and their storage as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, StateSpace
from workbench.synthesis.mu.biquads import PARAMETERS
from workbench.systems.realisation import realisation

if TYPE_CHECKING:
    from workbench.executor import Row


ROUND_PREFIX = "round_"
"""Prefix of the variables of a dataset that have a value for each round."""
CONTROLLER_PREFIX, SCALINGS_PREFIX = "controller_", "scalings_"
"""Prefixes of the names of arrays."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """One round of an iteration.

    Unlike a `MuController`, it has numbers that are not proven.

    ``peak`` is the largest mixed bound at the frequencies of the round, or the bound that its
    scalings prove for all frequencies. ``level`` is the level gamma of its H-infinity controller
    (NaN if there is none). ``fit`` is the largest relative miss of the fitted scalings (NaN if
    there are none). ``K`` is the controller. ``scalings`` are the parameters (blocks, P), by name,
    of the scalings fitted to its loop, as in `Biquads`.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import MuSynthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> answer = wb.solve(MuSynthesis(plant, target=0.9), method="dk").answer
    >>> [type(each).__name__ for each in answer.history][:1], answer.history[-1].order > 0
    (['Iterate'], True)
    """

    peak: float
    level: float
    fit: float
    K: StateSpace
    _: KW_ONLY
    scalings: Mapping[str, RealArray] = field(default_factory=dict)

    @property
    def order(self) -> int:
        """Order of the controller."""
        return int(self.K.nstates)

    def row(self, number: int) -> Row:
        """The row of the table of rounds."""
        numbers = {"peak": self.peak, "level": self.level, "order": self.order, "fit": self.fit}
        return {"round": number, **numbers}


def packed(history: Sequence[Iterate]) -> dict[str, NDArray[Any]]:
    """Rounds, at least one, as arrays with a row for each round; NaN fills up smaller matrices.

    ``peak``, ``level``, ``fit`` and ``order`` (R,), ``controller_A`` to ``controller_D`` and
    ``scalings_<name>`` (R, rows, columns).
    """
    found: dict[str, NDArray[Any]] = {
        name: np.array([getattr(each, name) for each in history], dtype=float)
        for name in ("peak", "level", "fit")
    }
    found["order"] = np.array([each.order for each in history])
    for part in "ABCD":
        found[CONTROLLER_PREFIX + part] = _stack_with_nan(
            [getattr(each.K, part) for each in history]
        )
    for name in sorted({name for each in history for name in each.scalings}):
        none = np.zeros((0, 0))
        found[SCALINGS_PREFIX + name] = _stack_with_nan(
            [each.scalings.get(name, none) for each in history]
        )
    return found


def unpacked(arrays: Mapping[str, NDArray[Any]]) -> list[Iterate]:
    """The rounds from arrays that `packed` made."""
    names = [name for name in arrays if name.startswith(SCALINGS_PREFIX)]
    history = []
    for place, order in enumerate(arrays["order"].tolist()):
        A, B, C, D = (arrays[CONTROLLER_PREFIX + part][place] for part in "ABCD")
        K = realisation((A[:order, :order], B[:order], C[:, :order], D), 0.0)
        scalings = {
            name.removeprefix(SCALINGS_PREFIX): x
            for name in names
            if (x := _without_filling(arrays[name][place])).size
        }
        peak, level, fit = (float(arrays[name][place]) for name in ("peak", "level", "fit"))
        history.append(Iterate(peak, level, fit, K, scalings=scalings))
    return history


def _stack_with_nan(matrices: Sequence[RealArray]) -> RealArray:
    """Matrices as one array (R, rows, columns), with NaN beyond their own rows and columns."""
    shape = np.max([matrix.shape for matrix in matrices], axis=0)
    found = np.full((len(matrices), *shape), np.nan)
    for one, matrix in zip(found, matrices, strict=True):
        one[tuple(map(slice, matrix.shape))] = matrix
    return found


def _without_filling(matrix: RealArray) -> RealArray:
    """The rows and columns of a matrix that are not all NaN."""
    known = np.isfinite(matrix)
    return matrix[known.any(axis=1)][:, known.any(axis=0)]


def round_variables(history: tuple[Iterate, ...]) -> dict[str, Any]:
    """Variables of a dataset with the numbers, the controller and the scalings of every round."""
    if not history:
        return {}
    controller = {
        "A": ("round_state", "round_state_"),
        "B": ("round_state", "controller_input"),
        "C": ("controller_output", "round_state"),
        "D": ("controller_output", "controller_input"),
    }
    found: dict[str, Any] = {"round": np.arange(1, len(history) + 1)}
    for name, array in packed(history).items():
        dims: tuple[str, ...] = ()
        about = {"units": "1"}
        kind, _, part = name.partition("_")
        if kind == "controller":
            dims = controller[part]
            about = {"long_name": f"{part} of each round's controller, NaN beyond its order"}
        elif kind == "scalings":
            dims = (f"{part}_block", f"{part}_parameter")
            about |= {"long_name": f"parameters of each round's scalings {part}: {PARAMETERS}"}
        found[ROUND_PREFIX + name] = (("round", *dims), array, about)
    return found


def rounds_of(data: Dataset) -> tuple[Iterate, ...]:
    """The rounds of a dataset with the variables of `round_variables`."""
    arrays = {
        str(name).removeprefix(ROUND_PREFIX): array.values
        for name, array in data.data_vars.items()
        if str(name).startswith(ROUND_PREFIX)
    }
    return tuple(unpacked(arrays)) if arrays else ()

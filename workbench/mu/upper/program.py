"""The D, G upper bound of mixed mu as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench import figures
from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.answer import Answer
from workbench.certificate import Check, counted_quantifier, worst_value
from workbench.certify.mu_bound import (
    SAID_ALLOWANCES,
    certified_bound,
    structured,
    structured_bound,
)
from workbench.errors import InputError
from workbench.figures.panels import along_batch
from workbench.input_checks import matrix_values, need_structure
from workbench.mu.upper.opinion import opinion, witnesses
from workbench.program import Program
from workbench.structure import Structure


@dataclass(frozen=True, repr=False)
class UpperBound(Answer):
    """Upper bounds of mu and the multipliers that prove them, as arrays over the batch.

    ``value`` (...), ``D_left`` (..., c, c), ``D_right`` (..., r, r) and ``G`` (..., r, c), with

        ``Delta`` (..., r, c) are perturbations that make I - M Delta singular, the smallest found,
        for the few matrices that the second opinion tries; NaN for the other matrices. It is None
        before the second opinion.

    ``Delta`` (..., r, c) are perturbations that make I - M Delta singular, as small as were found
    for the few matrices that the second opinion tries; NaN for the others, None before it.
    """

    value: NDArray[np.float64]
    D_left: ComplexArray
    D_right: ComplexArray
    G: ComplexArray
    Delta: ComplexArray | None = field(default=None, kw_only=True)

    def reshaped(self, batch: tuple[int, ...]) -> UpperBound:
        """The bounds of a batch with one axis, reshaped to this shape."""
        value = self.value.reshape(batch)
        parts = (self.D_left, self.D_right, self.G)
        D_left, D_right, G = (part.reshape(*batch, *part.shape[1:]) for part in parts)
        return UpperBound(value, D_left, D_right, G)


@dataclass(frozen=True, eq=False)
class MuUpperBound(Program):
    """The least beta with M^H D_l M + j (G M - M^H G^H) <= beta^2 D_r, for each M of a batch.

    No Delta of the structure with largest singular value below 1 / beta makes I - M Delta
    singular. D_l and D_r are the same multipliers in the two sizes of the blocks: a positive
    definite matrix for a repeated scalar, a positive multiple of the identity for a full block. G
    is Hermitian in the blocks of real scalars and zero elsewhere. The infimum need not be
    attained. The multipliers certify the bound; its distance from the least bound is not certified.

    Parameters
    ----------
    M
        Complex, shape (..., c, r), finite: the matrix that Delta closes, so Delta has c columns
        and r rows. An `xarray.DataArray` names the axes of the figure.
    structure
        Blocks of Delta.

    Raises
    ------
    InputError
        M does not fit the structure or is not finite.

    References
    ----------
    Fan, Tits, Doyle, Robustness in the presence of mixed parametric uncertainty and unmodeled
    dynamics, IEEE Trans. Automatic Control 36 (1991) 25-38. Young, Newlin, Doyle, Computing bounds
    for the mixed mu problem, Int. J. Robust and Nonlinear Control 5 (1995) 573-590.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.mu import MuUpperBound
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> solution = wb.solve(MuUpperBound(M, structure), method="fast")
    >>> solution.certificate.valid
    True
    """

    M: ComplexArray
    structure: Structure
    labels: DataArray | None = field(default=None, init=False, repr=False)

    headline: ClassVar[str] = "largest_bound"
    default_method: ClassVar[str] = "fast"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.mu.upper.fast",
        "workbench.mu.upper.ab13md",
        "workbench.mu.upper.conic",
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", self.M if hasattr(self.M, "dims") else None)
        M = matrix_values(self.M)
        need_structure(self.structure)
        self.structure.check(M)
        bad = np.argwhere(~np.isfinite(M).all((-2, -1)))
        if len(bad):
            place = tuple(int(i) for i in bad[0])
            raise InputError(
                f"M must be finite; {len(bad)} of its matrices are not, the first at {place}"
            )
        M.flags.writeable = False
        object.__setattr__(self, "M", M)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch."""
        return self.M.shape[:-2]

    def place(self, index: tuple[int, ...]) -> str:
        """Name of a place in the batch; empty for a batch without axes."""
        return f"at {', '.join(str(i) for i in index)}" if self.batch else ""

    @property
    def problem_size(self) -> float:
        """Number of entries of all matrices together."""
        return float(self.M.size)

    def objective(self, answer: UpperBound) -> float:
        """The sum of the bounds of all matrices."""
        return float(np.sum(answer.value))

    def objective_rounding(self, answer: UpperBound) -> float:
        """Rounding errors of the bounds: eps of the size of each matrix, times its largest side."""
        sizes = np.linalg.norm(self.M, axis=(-2, -1))
        return float(np.finfo(float).eps * max(self.M.shape[-2:]) * np.sum(sizes))

    @property
    def quantifier(self) -> str:
        return counted_quantifier(math.prod(self.batch), "matrix", "matrices, between them nothing")

    def of_stored(self, data: Dataset) -> MuUpperBound:
        return replace(self, M=data["M"].values)

    def checks(self, answer: UpperBound, tolerance: float) -> list[Check]:
        given = [np.asarray(part) for part in (answer.D_left, answer.D_right, answer.G)]
        nearest = structured(self.structure, *given)
        off, where = worst_value(
            np.max([_apart(*pair) for pair in zip(given, nearest, strict=True)], axis=0),
            self.place,
        )
        proved = certified_bound(self.M, self.structure, *given)
        value = np.asarray(answer.value)
        short = np.where(proved <= value, 0.0, (proved - value) / np.where(value > 0, value, 1.0))
        excess, at = worst_value(short, self.place)
        found = [
            Check(
                "structure",
                "largest entry of D and G outside their structure, relative",
                off,
                1e-12,
                where=where,
            ),
            Check(
                "bound",
                "excess of the bound that D > 0 and G prove over the claimed one, relative",
                excess,
                0.0,
                where=at,
                proven=True,
            ),
        ]
        return found

    def witnessed(self, answer: UpperBound) -> UpperBound:
        return replace(answer, Delta=witnesses(self.M, self.structure, np.asarray(answer.value)))

    def second_opinion(self, answer: UpperBound) -> Sequence[Check]:
        return opinion(self.M, self.structure, answer, self.place)

    def metrics(self, answer: UpperBound) -> dict[str, float]:
        return {"largest_bound": float(np.max(answer.value, initial=0.0))}

    def figures(self, answer: UpperBound) -> dict[str, Figure]:
        if np.size(answer.value) < 2:  # a number is no curve
            return {}
        figure, (panel,) = figures.axes(1, 1)
        along_batch(panel, answer.value, self.labels)
        panel.set_ylabel("upper bound of mu [1]")
        return {"bound": figure}

    def to_dataset(self, answer: UpperBound) -> Dataset:
        import xarray as xr

        batch = tuple(f"batch_{i}" for i in range(len(self.batch)))
        units = {"units": "1"}
        left, right = (*batch, "column", "column_"), (*batch, "row", "row_")
        across = (*batch, "column", "row")
        D = "multiplier of Delta's blocks"
        smallest = (
            "smallest perturbation found that makes I - M Delta singular, NaN: not looked for"
        )
        back = (*batch, "row", "column")
        about = units | {"long_name": smallest}
        Delta = {} if answer.Delta is None else {"Delta": (back, answer.Delta, about)}
        return xr.Dataset(
            {
                "M": (
                    across,
                    self.M,
                    units | {"long_name": "what Delta closes"},
                ),
                "value": (batch, answer.value, units | {"long_name": "upper bound of mu"}),
                "D_left": (left, answer.D_left, units | {"long_name": f"{D}, size of its columns"}),
                "D_right": (right, answer.D_right, units | {"long_name": f"{D}, size of its rows"}),
                "G": (
                    (*batch, "row", "column"),
                    answer.G,
                    units | {"long_name": "multiplier of Delta's real scalars"},
                ),
                **Delta,
                "pairs": (
                    ("block", "size"),
                    np.array(self.structure.to_pairs()),
                    {"long_name": "structure in the two-column integer form"},
                ),
            }
        )

    def from_dataset(self, data: Dataset) -> UpperBound:
        names = ("value", "D_left", "D_right", "G", "Delta")
        return UpperBound(**{name: data[name].values for name in names if name in data})


def proved(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
) -> UpperBound:
    """The upper bounds that multipliers prove on any processor; the method's own claims are not
    used.
    """
    multipliers = structured(structure, D_left, D_right, G)
    value = structured_bound(M, structure, *multipliers, allowances=SAID_ALLOWANCES)
    return UpperBound(value, *multipliers)


def _apart(one: ComplexArray, other: ComplexArray) -> NDArray[np.float64]:
    """Largest difference of the entries of each matrix, relative to its largest entry."""
    size = np.abs(one).max((-2, -1), initial=0.0)
    return np.abs(one - other).max((-2, -1), initial=0.0) / np.where(size > 0, size, 1.0)

"""The lower bound of mixed mu as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.answer import Answer
from workbench.certificate import Check, counted_quantifier, worst_value
from workbench.certify.balls import balls
from workbench.certify.singularity import proven_bound
from workbench.errors import InputError
from workbench.figures.panels import along_batch
from workbench.input_checks import as_matrices
from workbench.program import Program
from workbench.second_opinion.peaks import NEARLY_SINGULAR, regularity
from workbench.structure import Full, Real, Structure

SIZE_ROUNDING = 1e-12
"""Share by which the computed size of Delta may exceed 1 / value: the rounding errors of both. A
largest singular value has fourteen digits. With half of it a true bound of a large matrix may be
refused; double accepts one 2e-12 too large.
"""


@dataclass(frozen=True, repr=False)
class LowerBound(Answer):
    """Proven lower bounds (...,) of mu and the Deltas (..., rows, columns) that prove them.

    Within rounding errors of each Delta lies one that makes I - M Delta exactly singular and is no
    larger than 1 / value. Where nothing was proven, the value is 0 and Delta is NaN.
    """

    value: np.ndarray
    Delta: np.ndarray


@dataclass(frozen=True, eq=False)
class MuLowerBound(Program):
    """The smallest structured Delta found that makes I - M Delta singular; mu is 1 / its size.

    A method proposes a Delta; `workbench.certify.singularity` proves the bound from it in ball
    arithmetic, for exactly the given M. What cannot be proven counts as not found. Only an upper
    bound can tell how far the lower bound is from mu.

    With real blocks only, mu is not continuous in M: where two real eigenvalues meet, a rounding
    error may make them a complex pair, and mu may fall to 0. A proven bound then says little about
    neighbouring matrices, and one real block can be proven for a real M only. To make the question
    well posed, add a little complex uncertainty to each real block.

    Parameters
    ----------
    M
        Complex or real (..., columns, rows), finite. M maps the outputs of Delta to its inputs. The
        results take the names and coordinates of the leading axes of an `xarray.DataArray`.
    structure
        The blocks of Delta.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.mu import MuLowerBound
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> solution = wb.solve(MuLowerBound(M, structure))
    >>> solution.certificate.valid, round(solution.metrics["mu_lower_peak"], 4)
    (True, 0.625)
    """

    M: Any  # an ndarray from here on
    structure: Structure
    labels: DataArray | None = field(default=None, init=False, repr=False)

    default_method: ClassVar[str] = "best"
    methods_in: ClassVar[tuple[str, ...]] = ("workbench.mu.lower.methods",)
    headline: ClassVar[str] = "mu_lower_peak"

    def __post_init__(self) -> None:
        labelled = hasattr(self.M, "dims")
        object.__setattr__(self, "labels", self.M if labelled else None)
        object.__setattr__(self, "M", as_matrices(self.M, self.structure))

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return self.M.shape[:-2]

    @property
    def problem_size(self) -> float:
        """Number of entries of all matrices together."""
        return float(self.M.size)

    def objective(self, answer: LowerBound) -> float:
        """Minus the sum of the bounds of all matrices: large bounds are good."""
        return -float(np.sum(answer.value))

    @property
    def quantifier(self) -> str:
        return counted_quantifier(math.prod(self.batch), "matrix", "matrices, between them nothing")

    def of_stored(self, data: Dataset) -> MuLowerBound:
        return replace(self, M=data["M"].values)

    def checks(self, answer: LowerBound, tolerance: float) -> Sequence[Check]:
        value, Delta = np.asarray(answer.value), np.asarray(answer.Delta)
        wanted = self.batch, (*self.batch, self.structure.rows, self.structure.columns)
        if (value.shape, Delta.shape) != wanted:
            raise InputError(
                f"value and Delta of shapes {wanted[0]} and {wanted[1]} are needed, "
                f"not {value.shape} and {Delta.shape}"
            )
        improper, where = worst_value(~(np.isfinite(value) & (value >= 0)), self.place)
        found = ~(value == 0)
        where = where if improper else ""
        checks = [
            Check(
                "proper",
                "whether a value is not finite, or is negative",
                improper,
                0.0,
                where=where,
            )
        ]
        for name, statement, measure, limit in (
            (
                "structure",
                "number of blocks of another kind, and of nonzero entries outside blocks",
                self._misfit,
                0.0,
            ),
            (
                "norm",
                "largest singular value of Delta times value, less 1",
                self._misnorm,
                SIZE_ROUNDING,
            ),
            (
                "singularity",
                "value over the bound proven from Delta in ball arithmetic, less 1",
                self._excess,
                0.0,
            ),
        ):
            excess = np.zeros(self.batch)
            for index in np.argwhere(found):
                at = tuple(index)
                finite = bool(np.isfinite(Delta[at]).all())
                excess[at] = measure(self.M[at], Delta[at], value[at]) if finite else np.nan
            value_worst, where = worst_value(excess, self.place)
            proven = name == "singularity"
            checks.append(Check(name, statement, value_worst, limit, where=where, proven=proven))
        return checks

    def _misfit(self, M: np.ndarray, Delta: np.ndarray, value: float) -> float:
        """Number of blocks of the wrong kind, plus number of nonzero entries outside blocks."""
        wrong, outside = 0, Delta.copy()
        places = zip(
            self.structure, self.structure.row_slices, self.structure.column_slices, strict=True
        )
        for block, row, column in places:
            part = Delta[row, column]
            outside[row, column] = 0
            if not isinstance(block, Full):
                wrong += bool((part != part[0, 0] * np.eye(len(part))).any())
            if isinstance(block, Real):
                wrong += bool(np.imag(part).any())
        return float(wrong + np.count_nonzero(outside))

    @staticmethod
    def _misnorm(M: np.ndarray, Delta: np.ndarray, value: float) -> float:
        """The norm of Delta times value, less 1."""
        return float(np.linalg.norm(Delta, 2)) * value - 1

    def _excess(self, M: np.ndarray, Delta: np.ndarray, value: float) -> float:
        """The value over the bound that Delta proves, less 1; infinite without a proof."""
        proven = proven_bound(balls(M), self.structure, Delta)
        return value / proven - 1 if proven else np.inf

    def second_opinion(self, answer: LowerBound) -> Sequence[Check]:
        value, Delta = np.asarray(answer.value), np.asarray(answer.Delta)
        distance = np.zeros(self.batch)
        for index in map(tuple, np.argwhere(value > 0)):
            distance[index] = regularity(self.M[index] @ Delta[index])
        largest, where = worst_value(distance, self.place)
        statement = "smallest singular value of I - M Delta, balanced, relative to M Delta"
        return [Check("nearly singular", statement, largest, NEARLY_SINGULAR, where=where)]

    def metrics(self, answer: LowerBound) -> dict[str, float]:
        value = np.asarray(answer.value)
        return {
            "mu_lower_peak": float(np.max(value, initial=0.0)),
            "found": int(np.count_nonzero(value)),
            "matrices": value.size,
        }

    def to_dataset(self, answer: LowerBound) -> Dataset:
        import xarray as xr

        labels = self._labelled()
        dims = labels.dims[:-2]
        coords = {name: c for name, c in labels.coords.items() if set(c.dims) <= set(dims)}
        unit = {"units": "1"}
        long_name = "smallest perturbation proven to make I - M Delta singular, NaN for none"
        return xr.Dataset(
            {
                "M": ((*dims, "input", "output"), self.M, unit | {"long_name": "matrix"}),
                "mu_lower": (dims, answer.value, unit | {"long_name": "lower bound of mu"}),
                "Delta": (
                    (*dims, "output", "input"),
                    answer.Delta,
                    unit | {"long_name": long_name},
                ),
            },
            coords=coords,
        )

    def from_dataset(self, data: Dataset) -> LowerBound:
        return LowerBound(data["mu_lower"].values, data["Delta"].values)

    def figures(self, answer: LowerBound) -> dict[str, Figure]:
        if np.size(answer.value) < 2:  # a number is no curve
            return {}
        figure, (axis,) = figures.axes(1, 1)
        along_batch(axis, answer.value, self.labels)
        axis.set_ylabel("lower bound of mu [1]")
        return {"mu_lower": figure}

    def place(self, index: tuple[int, ...]) -> str:
        """Name of a matrix of the batch, for messages."""
        return f"at matrix {', '.join(map(str, index))}" if self.batch else ""

    def _labelled(self) -> DataArray:
        """The matrices with names of their axes."""
        import xarray as xr

        if self.labels is not None:
            return self.labels
        count = len(self.batch)
        names = [f"matrix_{axis}" for axis in range(count)] if count > 1 else ["matrix"] * count
        return xr.DataArray(self.M, dims=[*names, "input", "output"])

"""The lower bound of mixed mu as a Program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench.errors import InputError
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.input_checks import as_matrices
from workbench.program import Check, Program, worst
from workbench.structure import Full, Real, Structure

SIZE_TOLERANCE = 1e-10
"""Largest relative deviation of the size of Delta from 1 / value that a certificate accepts."""
SINGULARITY_TOLERANCE = 1e-10
"""I - M Delta, balanced, counts as singular if its smallest singular value is below this share of
the norm of M Delta or of 1, whichever is larger."""


@dataclass(frozen=True)
class LowerBound:
    """Lower bounds (...,) of mu and the Deltas (..., rows, columns) that attain them.

    Where the value is 0 nothing destabilising was found, and Delta is NaN.
    """

    value: np.ndarray
    Delta: np.ndarray


@dataclass(frozen=True, eq=False)
class MuLowerBound(Program):
    """The smallest structured Delta found that makes I - M Delta singular; mu is 1 / its size.

    Every such Delta proves a lower bound, so the certificate does not rely on the method. Only an
    upper bound can tell how far the lower bound is from mu.

    With real blocks only, mu is not continuous in M: where two real eigenvalues meet, a rounding
    error may make them a complex pair, and mu may fall to 0. A lower bound then holds for the given
    M up to rounding, but says little about neighbouring matrices. To make the question well posed,
    add a little complex uncertainty to each real block.

    Parameters
    ----------
    M
        Complex or real (..., columns, rows), finite. M maps the outputs of Delta to its inputs. The
        results take the names and coordinates of the leading axes of an `xarray.DataArray`.
    structure
        The blocks of Delta.
    """

    M: Any  # an ndarray from here on
    structure: Structure
    labels: DataArray | None = field(default=None, init=False, repr=False)

    default_method: ClassVar[str] = "best"
    headline: ClassVar[str] = "mu_lower_peak"

    def __post_init__(self) -> None:
        labelled = hasattr(self.M, "dims")
        object.__setattr__(self, "labels", self.M if labelled else None)
        object.__setattr__(self, "M", as_matrices(self.M, self.structure))

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return self.M.shape[:-2]

    def checks(self, answer: LowerBound, tolerance: float) -> Sequence[Check]:
        value, Delta = np.asarray(answer.value), np.asarray(answer.Delta)
        wanted = self.batch, (*self.batch, self.structure.rows, self.structure.columns)
        if (value.shape, Delta.shape) != wanted:
            raise InputError(
                f"value and Delta of shapes {wanted[0]} and {wanted[1]} are needed, "
                f"not {value.shape} and {Delta.shape}"
            )
        improper, where = worst(~(np.isfinite(value) & (value >= 0)), self.place)
        found = ~(value == 0)
        where = where if improper else ""
        checks = [Check("proper", "every value is finite and not negative", improper, 0.0, where)]
        for name, statement, measure, limit in (
            ("structure", "blocks off the structure, exactly", self._misfit, 0.0),
            (
                "norm",
                "largest singular value of Delta times value, less 1",
                self._misnorm,
                SIZE_TOLERANCE,
            ),
            (
                "singularity",
                "smallest singular value of I - M Delta, balanced, relative to M Delta",
                self._regularity,
                SINGULARITY_TOLERANCE,
            ),
        ):
            excess = np.zeros(self.batch)
            for index in np.argwhere(found):
                at = tuple(index)
                finite = bool(np.isfinite(Delta[at]).all())
                excess[at] = measure(self.M[at], Delta[at], value[at]) if finite else np.nan
            value_worst, where = worst(excess, self.place)
            checks.append(Check(name, statement, value_worst, limit, where))
        return checks

    def _misfit(self, M: np.ndarray, Delta: np.ndarray, value: float) -> float:
        """Number of blocks that are not of their kind plus number of entries outside blocks."""
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
        """Deviation of the norm of Delta times value from 1."""
        return abs(float(np.linalg.norm(Delta, 2)) * value - 1)

    @staticmethod
    def _regularity(M: np.ndarray, Delta: np.ndarray, value: float) -> float:
        """Smallest singular value of I - M Delta, balanced, relative to M Delta."""
        from scipy.linalg import matrix_balance

        # A similarity by powers of two keeps the singularity and removes the units of the signals.
        loop = matrix_balance(M @ Delta, permute=False)[0]
        least = np.linalg.svd(np.eye(len(loop)) - loop, compute_uv=False)[-1]
        return float(least / max(1.0, np.linalg.norm(loop, 2)))

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
        long_name = "smallest perturbation found that makes I - M Delta singular, NaN for none"
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
        figure, (axis,) = figures.axes()
        axis.plot(np.ravel(answer.value), ".-")
        axis.set(xlabel="matrix", ylabel="lower bound of mu", title="Lower bound of mu")
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

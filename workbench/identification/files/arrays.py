"""Columns from file formats that hold arrays rather than text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from workbench.identification.files.columns import Columns


def columns_of_arrays(
    path: Path,
    found: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    refused: Mapping[str, str],
    said: str,
) -> Columns:
    """Numeric variables; if there is only one matrix, its columns are named by number too."""
    numbers = {name: v for name, v in found.items() if v.dtype.kind in "biufc" and v.size}
    others = {
        name: "is empty" if not v.size else f"has no numbers: it holds {v.dtype}"
        for name, v in found.items()
        if name not in numbers
    }
    if len(numbers) == 1:
        (name, matrix) = next(iter(numbers.items()))
        if matrix.ndim == 2:
            columns = matrix.T if len(matrix) >= matrix.shape[1] else matrix
            numbers |= {str(j + 1): column for j, column in enumerate(columns)}
            said += f", columns of {name} by number"
    known = {name: unit for name, unit in units.items() if unit and name in numbers}
    return Columns(path, numbers, known, refused=others | dict(refused), said=said)

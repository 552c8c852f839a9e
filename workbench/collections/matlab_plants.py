"""Plants from MATLAB files as generalised plants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.files.matlab import mat_arrays
from workbench.systems.generalised_plant import GeneralisedPlant

TEXTBOOK = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
COMPLEIB = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21", "D22")
"""Names of the matrices in COMPleib: B and C belong to the controller's input and output."""
PERIODS = ("dt", "Ts", "ts")
"""Names of the sampling time [s]; a file without one holds a continuous system."""


def read_plant(
    file: str | PathLike[str], *, measurements: int | None = None, controls: int | None = None
) -> GeneralisedPlant:
    """Read a generalised plant without uncertainty from a MATLAB file.

    The file holds either A, B1, B2, C1, C2, D11, D12, D21, D22, or B and C in place of B2 and C2 as
    in COMPleib; a missing feedthrough is zero. Or it holds A, B, C and D, where the last outputs
    are the measurements and the last inputs the controls.

    Parameters
    ----------
    file
        A MAT file, up to version 7.3.
    measurements, controls
        Their numbers of signals, for a file with A, B, C and D.

    Raises
    ------
    InputError
        The file cannot be read, or a matrix is missing or has another shape; the message names it.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.io import savemat
    >>> from workbench.collections import read_plant
    >>> parts = {"A": -np.eye(2), "B": np.ones((2, 2)), "C": np.ones((3, 2)), "D": np.zeros((3, 2))}
    >>> savemat("plant.mat", parts)
    >>> plant = read_plant("plant.mat", measurements=1, controls=1)
    >>> plant.measurements, plant.controls
    (1, 1)
    """
    known = _Matrices.of(Path(file))
    if "B1" in known.found:
        if (measurements, controls) != (None, None):
            raise InputError(
                f"{file} states how many measurements and controls it has: leave their numbers out"
            )
        names = TEXTBOOK if "B2" in known.found else COMPLEIB
        A, B1, B2, C1, C2 = (known.matrix(name) for name in names[:5])
        rows, columns = (len(C1), len(C2)), (B1.shape[1], B2.shape[1])
        shapes = [(row, column) for row in rows for column in columns]
        D11, D12, D21, D22 = map(known.feedthrough, names[5:], shapes)
        B, C, D = np.hstack([B1, B2]), np.vstack([C1, C2]), np.block([[D11, D12], [D21, D22]])
        return known.plant((A, B, C, D), len(C2), B2.shape[1])
    if measurements is None or controls is None:
        raise InputError(
            f"{file} has no B1 but {', '.join(known.found) or 'no matrix'}: give the numbers of "
            "measurements and controls"
        )
    A, B, C = (known.matrix(name) for name in "ABC")
    D = known.feedthrough("D", (len(C), B.shape[1]))
    return known.plant((A, B, C, D), measurements, controls)


@dataclass(frozen=True, eq=False)
class _Matrices:
    """Real matrices of a file, by name."""

    file: Path
    found: Mapping[str, RealArray]

    @classmethod
    def of(cls, file: Path) -> _Matrices:
        return cls(
            file,
            {
                name: value.astype(float)
                for name, value in mat_arrays(file).items()
                if value is not None and value.dtype.kind in "biuf" and value.ndim == 2
            },
        )

    def matrix(self, name: str) -> RealArray:
        """A matrix with finite entries; raises InputError if it is missing."""
        if name not in self.found:
            raise InputError(
                f"{self.file} has no matrix {name}; it has {', '.join(self.found) or 'none'}"
            )
        value = self.found[name]
        if not np.isfinite(value).all():
            raise InputError(f"{self.file}: {name} is not finite everywhere")
        states = len(self.found["A"])
        rows = states if name[0] in "AB" else len(value)
        columns = states if name[0] in "AC" else value.shape[1]
        if value.shape != (rows, columns):
            raise InputError(f"{self.file}: {name} has shape {value.shape}, A has {states} rows")
        return value

    def feedthrough(self, name: str, shape: tuple[int, int]) -> RealArray:
        """A matrix of this shape; zeros if it is missing, empty, or the number 0."""
        value = self.found.get(name, np.zeros(0))
        if value.size == 0 or (value.size == 1 and not value.any()):
            return np.zeros(shape)
        if value.shape != shape:
            raise InputError(f"{self.file}: {name} has shape {value.shape}, {shape} is needed")
        return value

    def plant(
        self, parts: tuple[RealArray, ...], measurements: int, controls: int
    ) -> GeneralisedPlant:
        import control

        periods = [self.found[name] for name in PERIODS if name in self.found]
        period = float(periods[0].ravel()[0]) if periods else 0.0
        return GeneralisedPlant(control.ss(*parts, period), None, controls, measurements)

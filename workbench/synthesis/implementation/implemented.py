"""A controller as a computer runs it: its coefficients, the bounds of its loop, its C code."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.sampled_sets import SetPeak
from workbench.errors import InputError
from workbench.synthesis.h_infinity.figures import DrawnController
from workbench.synthesis.implementation.c_code.c_fixed_point import fixed_header
from workbench.synthesis.implementation.c_code.export_c import header
from workbench.synthesis.implementation.export import replace_file
from workbench.synthesis.implementation.fixed_point import FixedPoint
from workbench.synthesis.implementation.rounding import Rounding
from workbench.synthesis.implementation.sampled_loop import SampledMargins
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.systems.realisation import in_words

Precision = Literal["double", "float", "fixed"]
"""Number formats."""
BYTES = {"double": 8, "float": 4}
"""Bytes of a number."""
WORD, INTEGER = 8, 4
"""Bytes of a stored signal in fixed point, and of an integer that goes in or out."""


@dataclass(frozen=True, eq=False)
class FixedFormat:
    """Bits of coefficients and of signals, including signs, and full scales of y and of u."""

    bits: int
    signal_bits: int
    y_scale: float
    u_scale: float


@dataclass(frozen=True, eq=False, repr=False)
class ImplementedController(DrawnController):
    """A sampled controller with the coefficients of a number format, and certified bounds of its
    loop.

    Unlike a `StateSpace`, it has the coefficients of a number format, with proven effects of
    rounding.

    ``K`` is used like the given controller, u = sign K y; ``found`` is the method of
    discretisation. ``peak`` holds bounds on mu of the sampled loop for a set of plants.
    ``sensitivity`` is a certified bound on the peak of the loop's sensitivity. ``margins`` has an
    entry for each control signal. ``actuator`` holds the limits that the code enforces, the working
    point, and the filter of the set-points.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import Implementation
    >>> K, G = control.tf([10.0], [1.0], 0.1), control.tf([1.0], [1.0, 1.0])
    >>> answer = wb.solve(Implementation(G, K, dt=0.1)).answer
    >>> answer.precision, "controller_step" in answer.code()
    ('double', True)
    """

    K: StateSpace
    found: str
    precision: Precision
    sensitivity: float
    peak: SetPeak | None
    margins: tuple[SampledMargins, ...]
    rounding: Rounding
    actuator: Actuator | None = field(default=None, kw_only=True)
    fixed: FixedPoint | None = field(default=None, kw_only=True)
    format: FixedFormat | None = field(default=None, kw_only=True)

    @property
    def lti(self) -> StateSpace:
        """The controller."""
        return self.K

    def summary(self) -> str:
        mu = "" if self.peak is None else f"mu of the set at most {self.peak.upper:.4g}, "
        lines = [
            f"ImplementedController, {self.precision}, {self.found}: {in_words(self.K)}",
            f"  {mu}|S| at most {self.sensitivity:.4g}; {self.operations} multiplications and "
            f"{self.memory} bytes a sample",
        ]
        lines += [
            f"  control {number}: gain up to {one.gain[1]:.3g}, phase {one.phase_deg:.3g} degrees, "
            f"delay {one.delay_samples:.3g} samples"
            for number, one in enumerate(self.margins, start=1)
        ]
        return "\n".join(lines)

    @property
    def operations(self) -> int:
        """Number of multiplications in each sample."""
        if self.fixed is not None:
            own = sum(5 * len(one.shifts) for line in self.fixed.cascades for one in line)
        else:
            parts = (self.K.A, self.K.B, self.K.C, self.K.D)
            own = int(sum(np.count_nonzero(part) for part in parts))
        return own + self._filters

    @property
    def memory(self) -> int:
        """Number of bytes of the state."""
        if self.fixed is not None:
            own = sum(4 * WORD * len(one.shifts) for line in self.fixed.cascades for one in line)
            return own + (WORD + INTEGER) * self._filters
        return BYTES[self.precision] * (max(int(self.K.nstates), 1) + 2 * self._filters)

    @property
    def _filters(self) -> int:
        """Number of set-points that are filtered."""
        return 0 if self.actuator is None or self.actuator.approach is None else self.K.ninputs

    def code(self, name: str = "controller") -> str:
        """Text of the C99 header; all its names begin with `name`."""
        if self.precision == "fixed":
            assert self.fixed is not None and self.format is not None
            f = self.format
            return fixed_header(
                self.fixed, f.bits, f.signal_bits, (f.y_scale, f.u_scale), name, self.actuator
            )
        return header(self.K, name, self.precision, self.actuator)

    def export(self, path: str | Path, *, name: str = "controller") -> Path:
        """Write the C99 header to a file, which is replaced as a whole or not at all.

        Raises InputError for a name that is no C identifier, or if the folder is not writable.
        """
        path = Path(path)
        if path.suffix not in (".h", ".c"):
            raise InputError(
                f"{path}: a controller is exported as a C header, .h; export() writes other formats"
            )
        replace_file(path, self.code(name).encode("ascii"))
        return path

"""Multisines of low crest factor: their phases as an optimisation problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench.certificate import Check, worst_value
from workbench.errors import InputError
from workbench.executor.effort import tries
from workbench.identification.experiments.figures import period_figure
from workbench.identification.experiments.multisine import Multisine, as_lines
from workbench.program import Program

CHECK_INSTANTS = 64
"""Instants per period of the highest line in the check; the bound on the peak is 0.12 % above the
largest value there.
"""
FFT_INSTANTS = 50
"""Instants per period of the highest line in the second opinion."""
DRAWN_INSTANTS = 16
"""Instants per period of the highest line in figures."""
MAX_NUMBERS_IN_MEMORY = 1 << 20
"""Largest number of terms that a direct sum holds in memory at once."""


@dataclass(frozen=True, eq=False)
class CrestFactor(Program):
    """Phases of a multisine with given amplitudes that minimise the ratio of peak to rms value.

    The answer is the phases [rad], shape (K,). The problem has many local minima, so no method
    claims to find the best ones. The peak is taken over all time, not only at the samples: with
    P the largest value at M > 2 n equidistant instants, a trigonometric polynomial of degree n is
    nowhere larger than P / cos(pi n / M) (Ehlich and Zeller, Math. Z. 86, 1964).

    Parameters
    ----------
    amplitudes
        Positive peak values, one for all lines or one for each.
    lines
        Harmonic numbers, shape (K,), rising, above 0 and below samples / 2.
    samples
        Samples per period.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import CrestFactor
    >>> program = CrestFactor(1.0, np.arange(1, 6), 64)
    >>> solution = wb.solve(program)
    >>> solution.certificate.valid, bool(program.multisine(solution.answer).crest_factor < 1.8)
    (True, True)
    """

    amplitudes: Any
    lines: Any
    samples: int

    default_method: ClassVar[str] = "ipopt"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.identification.experiments.crest_factor_methods",
    )
    headline: ClassVar[str] = "crest_factor"

    def __post_init__(self) -> None:
        lines, amplitudes = as_lines(self.lines, self.amplitudes, self.samples)
        object.__setattr__(self, "lines", lines)
        object.__setattr__(self, "amplitudes", amplitudes)

    @property
    def rms(self) -> float:
        """Root mean square of the signal."""
        return float(np.sqrt(np.sum(self.amplitudes**2) / 2))

    def multisine(self, phases: np.ndarray) -> Multisine:
        """The signal with given phases (K,) [rad]."""
        return Multisine(self.lines, self.amplitudes, phases, self.samples)

    @property
    def quantifier(self) -> str:
        return f"for these {len(self.lines)} lines"

    @property
    def problem_size(self) -> float:
        """Number of lines."""
        return float(len(self.lines))

    def objective(self, answer: Any) -> float:
        """The crest factor, with a bound on the peak over all time."""
        return self.peak(self._phases(answer))[1] / self.rms

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        phases = self._phases(answer)
        proper = Check(
            "proper", "phases that are not finite", float(np.sum(~np.isfinite(phases))), 0.0
        )
        spectrum = np.fft.rfft(self._sum(phases, self.samples)) * (2 / self.samples)
        asked = np.zeros(len(spectrum))
        asked[self.lines] = self.amplitudes
        error, where = worst_value(
            np.abs(np.abs(spectrum) - asked) / self.amplitudes.max(), lambda i: f"at line {i[0]}"
        )
        amplitudes = Check(
            "amplitudes",
            "amplitude of a sampled line less that asked for, relative to the largest",
            error,
            1e-9,
            where=where,
            over=f"at {len(spectrum)} lines of the spectrum",
        )
        grid, bound = self.peak(phases)
        between = Check(
            "peak",
            "peak allowed for between the instants looked at, relative",
            bound / grid - 1,
            1e-2,
            over="at every instant of the period",
        )
        return [proper, amplitudes, between]

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        phases = self._phases(answer)
        count = tries(FFT_INSTANTS) * int(self.lines[-1])
        spectrum = np.zeros(count // 2 + 1, dtype=complex)
        spectrum[self.lines] = self.amplitudes * np.exp(1j * phases) * count / 2
        signal = np.fft.irfft(spectrum, count)
        above = float(np.abs(signal).max()) / self.peak(phases)[1] - 1
        instants = f"at {count} instants of the period"
        power = abs(float(np.sqrt(np.mean(signal**2))) / self.rms - 1)
        return [
            Check(name, f"{name} by the FFT over {of}, less 1", size, 1e-9, over=instants)
            for name, of, size in (
                ("transformed peak", "the bound", above),
                ("transformed rms", "that of the lines", power),
            )
        ]

    def peak(self, phases: np.ndarray) -> tuple[float, float]:
        """Largest |u| on a fine grid of instants, and an upper bound on |u| over all time.

        `phases` [rad] are those of the lines.
        """
        points = CHECK_INSTANTS * int(self.lines[-1])
        grid = float(np.abs(self._sum(phases, points)).max())
        return grid, grid / float(np.cos(np.pi * self.lines[-1] / points))

    def metrics(self, answer: Any) -> dict[str, float]:
        phases = self._phases(answer)
        factor = self.objective(answer)
        schroeder = self.peak(schroeder_phases(self.lines, self.amplitudes))[1] / self.rms
        return {
            "crest_factor": factor,
            "crest_factor_sampled": self.multisine(phases).crest_factor,
            "crest_factor_schroeder": schroeder,
            "ratio_to_schroeder": factor / schroeder,
            "lines": len(self.lines),
        }

    def figures(self, answer: Any) -> dict[str, Figure]:
        points = DRAWN_INSTANTS * int(self.lines[-1])
        drawn, schroeder = (
            self.multisine(phases).period(points=points) / self.rms
            for phases in (self._phases(answer), schroeder_phases(self.lines, self.amplitudes))
        )
        return {"period": period_figure(drawn, schroeder)}

    def to_dataset(self, answer: Any) -> Dataset:
        import xarray as xr

        phases = self._phases(answer)
        signal = self.multisine(phases).period()
        return xr.Dataset(
            {
                "amplitude": ("line", self.amplitudes, {"units": "1", "long_name": "amplitude"}),
                "phase": ("line", phases, {"units": "rad", "long_name": "phase"}),
                "signal": ("sample", signal, {"units": "1", "long_name": "one period"}),
            },
            coords={"line": ("line", self.lines, {"units": "1", "long_name": "harmonic"})},
        )

    def from_dataset(self, data: Dataset) -> np.ndarray:
        return data["phase"].values

    def _phases(self, answer: Any) -> np.ndarray:
        """The answer as an array of phases (K,), or an `InputError`."""
        phases = np.asarray(answer, dtype=float)
        if phases.shape != self.lines.shape:
            raise InputError(f"{len(self.lines)} phases are needed, not shape {phases.shape}")
        return phases

    def _sum(self, phases: np.ndarray, points: int) -> np.ndarray:
        """One period at equidistant instants, summed term by term; the methods use the FFT."""
        rows = max(1, MAX_NUMBERS_IN_MEMORY // len(self.lines))
        parts = []
        for start in range(0, points, rows):
            instants = np.arange(start, min(start + rows, points))
            # the remainder keeps the cosine's argument small and exact
            turns = np.outer(instants, self.lines) % points / points
            parts.append(np.cos(2 * np.pi * turns + phases) @ self.amplitudes)
        return np.concatenate(parts)


def schroeder_phases(lines: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Phases [rad] of Schroeder's multisine, which sweeps through its lines within a period.

    The sweep stays at each line for a time proportional to its power. Schroeder, IEEE Trans. Inf.
    Theory 16(1), 1970, equation 11, extended to lines with gaps:
    phase_k = -2 pi sum_{j < k} (line_k - line_j) p_j, where p_j is the share of power of line j.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import Multisine, schroeder_phases
    >>> lines, amplitudes = np.arange(1, 17), np.ones(16)
    >>> swept = Multisine(lines, amplitudes, schroeder_phases(lines, amplitudes), 128)
    >>> in_phase = Multisine(lines, amplitudes, np.zeros(16), 128)
    >>> swept.crest_factor < 2 < in_phase.crest_factor
    True
    """
    power = amplitudes**2 / np.sum(amplitudes**2)
    before, moment = np.cumsum(power) - power, np.cumsum(power * lines) - power * lines
    return -2 * np.pi * (lines * before - moment)

"""Multisines of low crest factor: the phases as an optimisation problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench.errors import InputError
from workbench.heavy_types import Dataset, Figure
from workbench.identification.experiments.figures import period_figure
from workbench.identification.experiments.multisine import Multisine, as_lines
from workbench.program import Check, Program, worst

POINTS = 64
"""Instants of the check per period of the highest line: the bound is then 0.12 % above them."""
DRAWN = 16
"""Instants drawn per period of the highest line."""
CHUNK = 1 << 20
"""Numbers that a direct sum holds in memory at once."""


@dataclass(frozen=True, eq=False)
class CrestFactor(Program):
    """Phases of a multisine of given amplitudes with the lowest peak over its rms value.

    The answer is the phases [rad], shape (K,). The problem has many local minima; no method
    claims the best. The peak counts between the samples too: a trigonometric polynomial of degree
    n is nowhere larger than its largest value at M > 2 n equidistant instants over cos(pi n / M)
    (Ehlich and Zeller, Math. Z. 86, 1964).

    Parameters
    ----------
    amplitudes
        Peak values, of all or of each line, positive.
    lines
        Harmonic numbers, shape (K,), rising, above 0 and below samples / 2.
    samples
        Per period.
    """

    amplitudes: Any
    lines: Any
    samples: int

    default_method: ClassVar[str] = "ipopt"
    headline: ClassVar[str] = "crest_factor"

    def __post_init__(self) -> None:
        lines, amplitudes = as_lines(self.lines, self.amplitudes, self.samples)
        object.__setattr__(self, "lines", lines)
        object.__setattr__(self, "amplitudes", amplitudes)

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.sum(self.amplitudes**2) / 2))

    def multisine(self, phases: np.ndarray) -> Multisine:
        """The signal of these phases."""
        return Multisine(self.lines, self.amplitudes, phases, self.samples)

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        phases = self._phases(answer)
        proper = Check(
            "proper", "phases that are not finite", float(np.sum(~np.isfinite(phases))), 0.0
        )
        spectrum = np.fft.rfft(self._sum(phases, self.samples)) * (2 / self.samples)
        asked = np.zeros(len(spectrum))
        asked[self.lines] = self.amplitudes
        error, where = worst(
            np.abs(np.abs(spectrum) - asked) / self.amplitudes.max(), lambda i: f"at line {i[0]}"
        )
        amplitudes = Check(
            "amplitudes",
            "amplitude of a sampled line less that asked for, relative to the largest",
            error,
            1e-9,
            where,
        )
        grid, bound = self.peak(phases)
        between = Check(
            "peak",
            "peak allowed for between the instants looked at, relative",
            bound / grid - 1,
            1e-2,
        )
        return [proper, amplitudes, between]

    def peak(self, phases: np.ndarray) -> tuple[float, float]:
        """Largest |u| over a fine grid, and a bound on it over all time."""
        points = POINTS * int(self.lines[-1])
        grid = float(np.abs(self._sum(phases, points)).max())
        return grid, grid / float(np.cos(np.pi * self.lines[-1] / points))

    def metrics(self, answer: Any) -> dict[str, float]:
        phases = self._phases(answer)
        factor = self.peak(phases)[1] / self.rms
        schroeder = self.peak(schroeder_phases(self.lines, self.amplitudes))[1] / self.rms
        return {
            "crest_factor": factor,
            "crest_factor_sampled": self.multisine(phases).crest_factor,
            "crest_factor_schroeder": schroeder,
            "ratio_to_schroeder": factor / schroeder,
            "lines": len(self.lines),
        }

    def figures(self, answer: Any) -> dict[str, Figure]:
        points = DRAWN * int(self.lines[-1])
        drawn, schroeder = (
            self.multisine(phases).period(points) / self.rms
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
        phases = np.asarray(answer, dtype=float)
        if phases.shape != self.lines.shape:
            raise InputError(f"{len(self.lines)} phases are needed, not shape {phases.shape}")
        return phases

    def _sum(self, phases: np.ndarray, points: int) -> np.ndarray:
        """One period at equidistant instants, summed directly (the methods use the FFT)."""
        rows = max(1, CHUNK // len(self.lines))
        parts = []
        for start in range(0, points, rows):
            instants = np.arange(start, min(start + rows, points))
            # line * instant modulo points keeps the cosine's argument small and exact
            turns = np.outer(instants, self.lines) % points / points
            parts.append(np.cos(2 * np.pi * turns + phases) @ self.amplitudes)
        return np.concatenate(parts)


def schroeder_phases(lines: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Phases whose group delay sweeps the period, each line for as long as its share of power.

    Schroeder, IEEE Trans. Inf. Theory 16(1), 1970, equation 11, for lines that may have gaps:
    phase_k = -2 pi sum_{j < k} (line_k - line_j) p_j, p the share of power.
    """
    power = amplitudes**2 / np.sum(amplitudes**2)
    before, moment = np.cumsum(power) - power, np.cumsum(power * lines) - power * lines
    return -2 * np.pi * (lines * before - moment)

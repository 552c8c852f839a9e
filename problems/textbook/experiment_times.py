"""Mu over the duration of the experiment: equal and designed powers, with limited power or size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, figures, problem, ref, solve
from workbench.executor import Context
from workbench.identification import (
    CommonPoleModel,
    CrestFactor,
    ModelUncertainty,
    RationalModelFit,
)
from workbench.mu import performance_peak
from workbench.study import LEAST_COVERAGE_P, Study, array, check, coverage_p, dim, figure, metric
from workbench.types import DataArray, Figure, RealArray
from workbench.uncertainty import EstimateRegion

from .estimate_to_mu import TRUE_PLANT, weighted_loop
from .experiment_design import BASE, VARIANCE, nominal_controller

SPECTRA = ("equal powers", "designed")
LIMITS = ("power", "size, designed phases", "size, drawn phases")
"""A total power of 1; or |u| at most that of a sine of power 1, with designed or with drawn phases.
"""
PERIODS = (2, 4, 8, 16, 32, 64, 128)
SILENT = 1e-6
"""Power of a line, relative to the largest, below which the line counts as absent."""
LARGEST_SIZE = float(np.sqrt(2.0))
"""Largest |u| of the size-limited inputs: that of a sine of power 1."""
SIZE_ROUNDING = 1e-6
PROOF_WIDTH = 5e-3
"""Largest relative width of the certified interval of a peak."""


@dataclass(frozen=True, eq=False)
class ExperimentTimes(Study):
    """Certified peaks of one loop for the confidence ball of an estimate, by input and number of
    periods.
    """

    design: Run
    confidence: float
    draws: int

    headline: ClassVar[str] = "time_saved"

    @property
    def quantifier(self) -> str:
        return f"for these {len(SPECTRA) * len(LIMITS)} inputs"

    spectrum, limit, bound = dim(*SPECTRA), dim(*LIMITS), dim("lower", "upper")
    periods = dim(PERIODS, unit="1", meaning=f"periods of {2 * np.pi / BASE:.4g} s")
    line = dim(lambda self: np.arange(1, len(self.design.answer.power) + 1))
    draw = dim(lambda self: np.arange(self.draws))

    @array(dims=(spectrum, line), unit="1", meaning="power of a line, all together 1")
    def shape(self) -> RealArray:
        power = self.design.answer.power
        even = np.full(len(power), 1.0 / len(power))
        return np.array([even, np.where(power > SILENT * power.max(), power, 0.0) / power.sum()])

    @array(dims=(spectrum, limit, line), unit="rad", meaning="phases, where the line has any power")
    def phase(self, shape: DataArray, context: Context) -> RealArray:
        found = np.zeros((len(SPECTRA), len(LIMITS), shape.sizes["line"]))
        for i, power in enumerate(shape.values):
            used = power > 0
            lines = np.flatnonzero(used) + 1
            question = CrestFactor(np.sqrt(2.0 * power[used]), lines, 8 * len(power))
            found[i, 1, used] = solve(question).answer
            found[i, 2, used] = np.random.default_rng(0).uniform(0.0, 2 * np.pi, used.sum())
        return found

    @array(dims=(spectrum, limit), unit="1", meaning="factor of the powers that the limit leaves")
    def factor(self, shape: DataArray, phase: DataArray) -> RealArray:
        found = np.ones((len(SPECTRA), len(LIMITS)))
        for i, power in enumerate(shape.values):
            lines = np.flatnonzero(power) + 1
            question = CrestFactor(np.sqrt(2.0 * power[lines - 1]), lines, 8 * len(power))
            for j in (1, 2):
                size = question.peak(phase.values[i, j, lines - 1])[1]
                found[i, j] = (LARGEST_SIZE / size) ** 2
        return found

    @array(
        dims=(spectrum, limit, periods, bound),
        unit="1",
        meaning="certified peak of mu, infinite: not robust",
    )
    def peak(self, shape: DataArray, factor: DataArray, context: Context) -> RealArray:
        found = np.full((len(SPECTRA), len(LIMITS), len(PERIODS), 2), np.inf)
        K = nominal_controller()
        places = list(np.ndindex(found.shape[:3]))
        for i, j, k in context.track(places, "experiments"):
            power = shape.values[i] * factor.values[i, j]
            region = EstimateRegion(
                _estimate_uncertainty(power, PERIODS[k]), confidence=self.confidence
            )
            certified = performance_peak(weighted_loop(region), K)
            if certified is not None:
                found[i, j, k] = certified.lower, certified.upper
        return found

    @array(
        dims=(spectrum, draw),
        unit="1",
        meaning="size of the ball about a noisy estimate that holds the plant",
    )
    def needed(self, shape: DataArray, context: Context) -> RealArray:
        truth, found = CommonPoleModel([[TRUE_PLANT]], np.zeros((1, 1))), []
        for power in shape.values:
            estimates = [
                _estimate_uncertainty(power, PERIODS[-1], draw) for draw in range(self.draws)
            ]
            sizes = [
                np.linalg.norm(EstimateRegion(one, confidence=self.confidence).coordinates(truth))
                for one in estimates
            ]
            found.append(sizes)
        return np.array(found)

    # --- checks -------------------------------------------------------------------------------

    @check(title="size", statement="largest |u| over its limit, less 1", at_most=SIZE_ROUNDING)
    def limited(self, shape: DataArray, phase: DataArray, factor: DataArray) -> DataArray:
        """Computed from the inputs in the time domain, on a grid that the design did not use."""
        found = np.full((len(SPECTRA), len(LIMITS)), -1.0)
        for i, power in enumerate(shape.values):
            count = 16 * power.size
            for j in (1, 2):
                amplitude = np.sqrt(2.0 * power * factor.values[i, j])
                spectrum = np.zeros(count // 2 + 1, complex)
                spectrum[1 : power.size + 1] = amplitude * np.exp(1j * phase.values[i, j])
                signal = np.fft.irfft(spectrum, count) * count / 2
                found[i, j] = np.abs(signal).max() / LARGEST_SIZE - 1.0
        return factor.copy(data=found)

    proven = check(
        title="proofs",
        statement="upper over lower bound of a peak, less 1",
        value=lambda peak: (peak.sel(bound="upper") / peak.sel(bound="lower") - 1.0).fillna(0.0),
        at_most=PROOF_WIDTH,
    )
    designed = check(
        title="designed {limit}",
        statement="largest peak with designed over that with equal powers, less 1",
        value=lambda peak: _ratio(peak) - 1.0,
        at_most=PROOF_WIDTH,
        each="limit",
    )
    falling = check(
        title="longer",
        statement="peak after twice the time over that before, less 1",
        value=lambda peak: _relative_growth(peak),
        at_most=PROOF_WIDTH,
    )
    coverage = check(
        title="coverage, {spectrum}",
        statement=f"{LEAST_COVERAGE_P:g} less the probability that balls hold the truth in no more "
        "draws than here",
        value=lambda self, needed: LEAST_COVERAGE_P - coverage_p(needed <= 1.0, self.confidence),
        at_most=0.0,
        each="spectrum",
    )

    # --- what is told -------------------------------------------------------------------------

    @metric
    def numbers(self, peak: DataArray, factor: DataArray) -> dict[str, float]:
        """Number of periods that reach the peak of equal powers after the longest time, and the
        share of the power that the size limit leaves.
        """
        upper = peak.sel(bound="upper")
        goal = float(upper.sel(spectrum=SPECTRA[0], limit=LIMITS[0])[-1])
        found = {}
        for spectrum in SPECTRA:
            name = spectrum.replace(" ", "_")
            for limit in LIMITS:
                curve = upper.sel(spectrum=spectrum, limit=limit).values
                which = limit.replace(", ", "_").replace(" ", "_")
                reached = _periods_to_reach(curve, goal)
                if reached is not None:
                    found[f"periods_{name}_{which}"] = reached
                found[f"factor_{name}_{which}"] = float(factor.sel(spectrum=spectrum, limit=limit))
        found["time_saved"] = PERIODS[-1] / found["periods_designed_power"]
        return found

    @figure
    def mu(self, peak: DataArray, shape: DataArray) -> Figure:
        """Spectra of the inputs, and the certified peak of mu over the number of periods."""
        drawn, (left, right) = figures.axes(1, 2, size=(9.0, 4.2))
        for spectrum, colour in zip(SPECTRA, (figures.ORANGE, figures.BLUE), strict=True):
            powers = shape.sel(spectrum=spectrum)
            left.vlines(BASE * powers["line"], 0.0, powers, color=colour, linewidth=2,
                        label=spectrum)  # fmt: skip
            for limit, look in zip(LIMITS, ("o-", "s--", "^:"), strict=True):
                curve = peak.sel(spectrum=spectrum, limit=limit, bound="upper")
                shown = curve.where(np.isfinite(curve))
                right.semilogx(curve["periods"], shown, look, color=colour, markersize=4,
                               label=f"{spectrum}: {limit}")  # fmt: skip
        right.axhline(1.0, color="0.4", linewidth=0.8)
        top = float(np.nanmin(peak.where(np.isfinite(peak)).max()))
        right.set_ylim(0.9 * float(peak.min()), min(2.0, 1.05 * top))
        figures.label(left, x="angular frequency of a line [rad/s]", y="power [1]")
        figures.label(right, x="periods of the experiment", y="certified peak of mu [1]")
        left.legend(frameon=False)
        right.legend(frameon=False, fontsize="small")
        return drawn


def _estimate_uncertainty(
    power: RealArray, periods: int, draw: int | None = None
) -> ModelUncertainty:
    """Uncertainty of estimates: around the true plant, or, with `draw`, around one
    noisy estimate.
    """
    used = np.flatnonzero(power)
    omega = BASE * (used + 1.0)
    response = TRUE_PLANT.response(omega)[:, None, None]
    variance = (VARIANCE / (periods * power[used]))[:, None, None]
    if draw is None:
        program = RationalModelFit(omega, response, variance, orders=(2,), excess=2)
        return program.uncertainty(CommonPoleModel([[TRUE_PLANT]], np.zeros((1, 1))))
    parts = np.random.default_rng(draw).standard_normal((2, *response.shape))
    noisy = response + np.sqrt(variance / 2.0) * (parts[0] + 1j * parts[1])
    program = RationalModelFit(omega, noisy, variance, orders=(2,), excess=2)
    return program.uncertainty(solve(program).answer.model)


def _ratio(peak: DataArray) -> DataArray:
    """Ratio of the peak with designed powers to that with equal powers; 0 where both
    are infinite.
    """
    upper = peak.sel(bound="upper")
    even, designed = (upper.sel(spectrum=spectrum) for spectrum in SPECTRA)
    return (designed / even).where(np.isfinite(designed) | np.isfinite(even), 0.0)


def _relative_growth(peak: DataArray) -> DataArray:
    """Relative growth of a peak from one number of periods to the next; it should not
    be positive.
    """
    upper = peak.sel(bound="upper")
    after = upper.isel(periods=slice(1, None))
    before = upper.isel(periods=slice(None, -1)).values
    return (after / before - 1.0).where(np.isfinite(before), -1.0)


def _periods_to_reach(curve: RealArray, goal: float) -> float | None:
    """Number of periods, interpolated, at which a curve falls to a goal; None if it never does."""
    below = np.flatnonzero(curve <= goal)
    if not below.size:
        return None
    k = int(below[0])
    if k == 0 or not np.isfinite(curve[k - 1]):
        return float(PERIODS[k])
    share = (curve[k - 1] - goal) / (curve[k - 1] - curve[k])
    first, last = np.log(PERIODS[k - 1 : k + 1])
    return float(np.exp(first + share * (last - first)))


@problem(
    "textbook/experiment-times", needs={"design": ref("textbook/experiment-design")}, slow=True
)
def experiment_times(
    design: Run,
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95,
    draws: Annotated[int, Field(ge=10, le=2000)] = 40,
) -> ExperimentTimes:
    """How long an experiment must be for a peak of mu, with equal and with designed powers.

    The loop of an oscillator with its H-infinity controller is analysed for the confidence ball of
    the estimate that the experiment gives. The inputs have the same power, or the same largest
    size, with phases of a low crest factor or with drawn ones.

    confidence: probability that the ball holds the true plant. draws: noisy estimates on which that
    probability is tested.
    """
    return ExperimentTimes(design, confidence, draws)

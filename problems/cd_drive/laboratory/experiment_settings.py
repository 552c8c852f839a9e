"""How the settings of both experiments decide their accuracy (sections 4.3 and 4.6.1).

The settings are the series resistor of the open-loop experiment, and size and number of periods of
the excitation in closed loop, with controllers of several bandwidths. Equation and section numbers
refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.identification import IdentificationWarning, SteppedSine, periodic_response
from workbench.study import Study, array, check, dim, figure, identifier, metric, part, table
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

from ..drive.actuator import specific_model
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from ..drive.two_masses import lumped
from .coil_current import DEGREES, DISCARDED, CoilExperiment
from .experiment import Laboratory
from .in_the_loop import PERIODS, Chain, LoopExperiment, excitation
from .open_loop import ERROR_TOLERANCE
from .unknowns import TRUTH, experiment_seeds

RESISTORS = (0.25, 1.25, 5.0)
"""Series resistors [ohm]: a fifth of that of section 4.6.1, that one, and four times as much."""
STEP = {"focus": 2.0, "radial": 4.0}
"""Distance of the frequencies in open loop [Hz]."""
AMPLITUDE = 0.5
"""Amplitude of the excitation in open loop [V]: with 5 ohm, 1 V would saturate the radial
channel.
"""
BANDS = {"all": (100.0, 2000.0), "low": (100.0, 700.0), "high": (700.0, 2000.0)}
"""Bands in closed loop [Hz]: all, and what is below and above the crossover."""
PARAMETERS = ("Bl", "k", "b")
"""Parameters of the motion, which the fit of the lumped model returns after R."""
FREQUENCY = np.arange(100.0, 2001.0, 50.0)
"""Frequencies in closed loop [Hz]."""


@dataclass(frozen=True)
class Setting:
    """Size and number of the periods over the usual ones, and the controller's gain over the
    reference controller's.
    """

    size: float = 1.0
    periods: int = 1
    gain: float = 1.0


SETTINGS = {
    "usual": Setting(),
    "half the size": Setting(size=0.5),
    "four times the periods": Setting(periods=4),
    "less gain": Setting(gain=2**-0.5),
    "more gain": Setting(gain=2**0.5),
}
"""Closed-loop experiments. Each differs from the usual one by one setting, at the same
excitation.
"""


@problem(
    "cd/{axis}/experiment-settings",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def experiment_settings(
    axis: Axis, drive: str = "CD1", draws: Annotated[int, Field(ge=2, le=1000)] = 30
) -> ExperimentSettings:
    """Accuracy of both experiments over resistor, size, periods and bandwidth (sec. 4.3, 4.6.1).

    In open loop the lumped model is fitted to the coil's current with three series resistors.
    Filters and mass are told without errors, so that only noise scatters the parameters. Their bias
    is the mean of their errors over the drive's lumped values. In closed loop a stepped sine, which
    is the same for all controllers, measures the plant on a turning disc: as usual, with half the
    size, with four times the periods, and with the controller's gain 3 dB down and up.

    drive: CD1 ... CD12. draws: number of draws of the noise.
    """
    return ExperimentSettings(Laboratory(axis, drive), draws)


@dataclass(frozen=True)
class ExperimentSettings(Study):
    """Experiments with several settings on one drive."""

    bench: Laboratory
    draws: int

    headline: ClassVar[str] = "scatter_b_0_25_ohm_over_usual"

    @property
    def quantifier(self) -> str:
        return f"for this one drive, in {self.draws} simulated draws"

    resistor = dim(RESISTORS, unit="ohm")
    parameter, setting, band = dim(PARAMETERS), dim(SETTINGS), dim(BANDS)
    draw = dim(lambda self: range(self.draws))

    @array(dims=draw)
    def seed(self, context: Context) -> Any:
        return experiment_seeds(context.rng, "open-loop", self.bench.drive, self.draws)

    coils = part(lambda self: coil_experiments(self.bench))

    @part
    def currents(self, coils: list[CoilExperiment], seed: DataArray, context: Context) -> Any:
        """Responses with their variance, and shares of saturated samples, by resistor and draw."""
        seeds = seed.values.tolist()
        return [[measured(one, k) for k in seeds] for one in context.track(coils, "open loop")]

    @array(dims=(resistor, draw, parameter), unit="1", meaning="error over the lumped value")
    def off(self, coils: list[CoilExperiment], currents: Any) -> Any:
        every = zip(coils, currents, strict=True)
        return [[errors(one, *each[:2]) for each in row] for one, row in every]

    saturated = array(dims=(resistor, draw), unit="1", meaning="share of samples at a limit")(
        lambda currents: [[share for _, _, share in row] for row in currents]
    )
    damping = array(dims=resistor, unit="1/s", meaning="decay of the first resonance")(
        lambda self: [decay(self.bench, r) for r in RESISTORS]
    )
    damping_without = array(dims=(), unit="1/s", meaning="without a resistor")(
        lambda self: decay(self.bench, 0.0)
    )

    @array(dims=(setting, draw, band), unit="1", meaning="rms error of the response over its size")
    def error(self, seed: DataArray, context: Context) -> Any:
        usual = excitation(self.bench.axis, FREQUENCY)
        tried = [experiment(self.bench, usual, one) for one in SETTINGS.values()]
        return [
            [response_errors(one, k) for k in seed.values.tolist()]
            for one in context.track(tried, "closed loop")
        ]

    # --- checks -------------------------------------------------------------------------------

    @check(title="saturation", at_most=0.0)
    def linear(self, saturated: DataArray) -> DataArray:
        """share of samples at a converter's limit, any resistor and draw"""
        return saturated.max()

    @check(title="accuracy", at_most=1.0)
    def accurate(self, off: DataArray) -> DataArray:
        """mean error of a parameter over the accuracy that the thesis states, any resistor"""
        stated = off["parameter"].copy(data=[ERROR_TOLERANCE[name] for name in PARAMETERS])
        return (abs(off.mean("draw")) / stated).max()

    @check(title="back-EMF", at_most=1e-3)
    def by_formula(self, damping: DataArray, damping_without: DataArray) -> float:
        """difference of a decay's change from that of Bl^2 / 2 m (R + r), over the decay"""
        p = self.bench.parameters
        rho = p.k2 / (p.k1 + p.k2)
        half = p.Bl**2 / (2 * (p.m1 + p.m2 * rho**2))
        told = [half * (1 / p.R - 1 / (p.R + r)) for r in RESISTORS]
        changed = float(damping_without) - damping.values
        return float((abs(changed - told) / float(damping_without)).max())

    # --- what is told -------------------------------------------------------------------------

    @metric
    def of_resistors(self, off: DataArray) -> dict[str, Any]:
        """Mean errors, standard deviations by noise, and those over what they are with 1.25 ohm."""
        mean, scatter, found = off.mean("draw"), off.std("draw", ddof=1), {}
        for r in RESISTORS:
            for name in PARAMETERS:
                at, end = {"resistor": r, "parameter": name}, f"{name}_{identifier(r)}_ohm"
                found[f"bias_{end}"], found[f"scatter_{end}"] = mean.sel(at), scatter.sel(at)
                usual = scatter.sel(resistor=RESISTORS[1], parameter=name)
                found[f"scatter_{end}_over_usual"] = scatter.sel(at) / usual
        return found

    @metric
    def of_damping(self, damping: DataArray, damping_without: DataArray) -> dict[str, Any]:
        """Relative change of the first resonance's decay by each resistor."""
        change = 1 - damping / damping_without
        return {f"damping_lost_{identifier(r)}_ohm": change.sel(resistor=r) for r in RESISTORS}

    @metric
    def of_settings(self, error: DataArray) -> dict[str, Any]:
        """Error of each closed-loop experiment by band, mean of the draws, and over the usual
        one.
        """
        mean, found = error.mean("draw"), {}
        for one in SETTINGS:
            for band in BANDS:
                end, usual = f"{identifier(one)}_{band}", mean.sel(setting="usual", band=band)
                found[f"error_{end}"] = mean.sel(setting=one, band=band)
                found[f"error_{end}_over_usual"] = found[f"error_{end}"] / usual
        return found

    @table
    def resistors(self, answer: Dataset) -> Any:
        """Scatter and bias of each parameter, and the damping that the resistor takes away."""
        rows = []
        for r in RESISTORS:
            off = answer["off"].sel(resistor=r)
            cells = [
                f"{float(off.mean('draw').sel(parameter=name)):+.3%} +- "
                f"{float(off.std('draw', ddof=1).sel(parameter=name)):.3%}"
                for name in PARAMETERS
            ]
            lost = 1 - float(answer["damping"].sel(resistor=r) / answer["damping_without"])
            rows.append([f"{r:g}", *cells, f"{lost:.1%}"])
        heads = ["r [ohm]", *(f"{name}, bias and scatter" for name in PARAMETERS)]
        return [*heads, "damping lost"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, (left, right) = figures.axes(1, 2, size=(10.0, 3.8))
        scatter = answer["off"].std("draw", ddof=1)
        for name, colour in zip(PARAMETERS, figures.CYCLE, strict=False):
            one = 100 * scatter.sel(parameter=name)
            left.plot(RESISTORS, one, "o-", color=colour, label=f"scatter of {name}")
        lost = 100 * (1 - answer["damping"] / answer["damping_without"])
        left.plot(RESISTORS, lost, "s--", color=figures.BLACK, label="damping lost")
        figures.label(left, x="series resistor [ohm]", y="[%]", log="xy", title="open loop")
        bands = {"low": ("to 700 Hz", figures.BLUE), "high": ("from 700 Hz", figures.ORANGE)}
        for band, (words, colour) in bands.items():
            errors = 100 * answer["error"].sel(band=band).transpose("setting", "draw").values
            place = np.repeat(np.arange(len(SETTINGS)), self.draws)
            right.plot(errors.ravel(), place, "o", color=colour, markersize=4, label=words)
        right.set_yticks(range(len(SETTINGS)), list(SETTINGS))
        right.invert_yaxis()
        right.legend()
        title = "closed loop"
        figures.label(right, x="rms error of the response [%]", y="", log="x", title=title)
        figures.legend_below(drawn, left, columns=4)
        return {"settings": drawn}


def measured(experiment: CoilExperiment, seed: int) -> tuple[ComplexArray, RealArray, float]:
    """v_r/u (F,) of one draw, its variance (F,), and the share of saturated samples."""
    current = experiment.played(seed)
    raw = periodic_response(experiment.frequency, current.u, current.v, transients=DISCARDED)
    settled = experiment.settled(raw, current, experiment.mass)
    variance = (DEGREES + 2) / DEGREES * settled.variance[:, 0, 0]
    return settled.response[:, 0, 0], variance, current.saturation


def errors(experiment: CoilExperiment, response: ComplexArray, variance: RealArray) -> RealArray:
    """Relative errors (3,) of PARAMETERS that a fit to v_r/u finds."""
    found = experiment.fit(response, variance, DEGREES, experiment.mass)
    true = lumped(experiment.laboratory.parameters)
    values: RealArray = found.values[1:4] / [getattr(true, name) for name in PARAMETERS] - 1
    return values


def decay(bench: Laboratory, series_resistance: float) -> float:
    """Decay of the first resonance [1/s] with a series resistor [ohm]."""
    poles = specific_model(bench.parameters, series_resistance).poles()
    return float(-poles[np.argmin(abs(poles))].real)


def experiment(bench: Laboratory, usual: SteppedSine, setting: Setting) -> LoopExperiment:
    """The closed-loop experiment with a setting, whatever the gain at the same excitation."""
    sine = replace(
        usual, periods=setting.periods * PERIODS, amplitude=setting.size * usual.amplitude
    )
    return LoopExperiment(bench, FREQUENCY, disturbances=True, scale=setting.gain, played_sine=sine)


def response_errors(experiment: LoopExperiment, seed: int) -> list[float]:
    """Rms over the frequencies of BANDS of the relative error of f_en/u_m in one draw."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IdentificationWarning)  # of a weak excitation, as wanted
        measured = experiment.measured(seed, TRUTH).estimate.response[:, 0, 0]
    actuator = experiment.bench.actuator.response(experiment.frequency)
    exact = Chain.told(experiment.bench).response(experiment.frequency) * actuator
    off = abs(measured / exact - 1) ** 2
    inside = [
        (experiment.frequency >= low) & (experiment.frequency <= high)
        for low, high in BANDS.values()
    ]
    return [float(np.sqrt(off[one].mean())) for one in inside]


def coil_experiments(bench: Laboratory) -> list[CoilExperiment]:
    """The open-loop experiment with each resistor."""
    step = STEP[bench.axis]
    return [CoilExperiment(bench, step, AMPLITUDE, series_resistance=r) for r in RESISTORS]

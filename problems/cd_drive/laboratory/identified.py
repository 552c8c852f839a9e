"""Twelve identified drives: the fourth-order model is fitted to all experiments of each drive.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from workbench import Run, figures, problem, ref
from workbench.executor import Context
from workbench.identification import MeasuredResponse, ParameterFit
from workbench.study import (
    LEAST_COVERAGE_P,
    Study,
    array,
    arrays,
    check,
    coverage_p,
    dim,
    figure,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ..drive.actuator import SERIES_RESISTANCE, specific_model, stack
from ..drive.shared_parameters import TABLES, WINDOWS
from ..drive.tables import ActuatorParameters, Axis, Drive, drives
from ..drive.two_masses import lens, lumped_values
from .coil_current import solved
from .drive_experiments import DriveExperiments, drive_experiments
from .known_values import (
    CHAIN,
    CONFIDENCE,
    MASS_POWER,
    RATIO_DEVIATION,
    KnownQuantities,
    arm_parameters,
    chain_known,
    chain_ratio,
    independent,
)
from .open_loop import PARAMETERS
from .unknowns import GAIN_DEVIATION, MASS_DEVIATION, Told, corner_ratio

NAMES = ("R", "Bl", "k1", "k2", "b1", "b2", "m1", "m2")
LOOP_DEGREES = 18.0
"""Degrees of freedom of the closed-loop variances: 2 (M - 1) with M = 10 periods."""
LIMITS = {"R": 0.001, "Bl": 0.01, "k1": 0.01, "k2": 0.08, "b1": 0.05, "m1": 0.01, "m2": 0.08}
"""Largest accepted errors of the parameters, relative to the truth scaled to the fitted mass. b2, a
twentieth of b1, is only reported.
"""
RESPONSE_LIMIT = {"focus": 0.06, "radial": 0.08}
"""Largest accepted error of a response, relative; it includes the errors of the told mass and gain.
A track's width limits the amplitude of the radial experiment to a twentieth of that in focus, while
its noise is a tenth.
"""


@problem(
    "cd/{axis}/identified",
    axis=("focus", "radial"),
    needs={"optical_gains": ref("cd/{axis}/optical-gain")},
    data=(*TABLES, "data/red_book.csv"),
    slow=True,
)
def identified(axis: Axis, optical_gains: Run) -> Identified:
    """Twelve drives identified from all their experiments, against the truth (figure 4.8).

    The fourth-order model is fitted jointly to v_r/u of the open loop and to the displacement of
    the closed loop, one draw of each. The effective mass of the first resonance, the optical gain
    from the scan, the delay and the filters' corners are known as well as an experimenter is told,
    and are fitted too. This removes the bias of the lumped damper, which is not b1 + b2.
    """
    return Identified(axis, optical_gains)


@dataclass(frozen=True, eq=False)
class Identified(Study):
    """Joint fits of twelve drives to their experiments."""

    axis: Axis
    optical_gains: Run

    headline: ClassVar[str] = "worst_response"

    @property
    def quantifier(self) -> str:
        return "for these 12 drives, in one simulated draw of each"

    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    parameter = dim(NAMES)
    lumped = dim(PARAMETERS)

    @dim(unit="Hz", meaning="frequency")
    def frequency(self) -> RealArray:
        windows = WINDOWS[self.axis].values()
        dense = [np.linspace(low, high, 200) for low, high in windows]
        return np.unique(np.concatenate([np.geomspace(10, 2000, 200), *dense]))

    @part
    def experiments(self, context: Context) -> list[DriveExperiments]:
        names = [one.name for one in drives(self.axis)]
        every = context.track(names, "experiments")
        return [drive_experiments(self.axis, name, context.options) for name in every]

    @part
    def fits(self, context: Context, experiments: list[DriveExperiments]) -> list[DriveFit]:
        gains = self.optical_gains.answer["gain"].sel(quantity="K_optn")
        every = zip(drives(self.axis), experiments, strict=True)
        return [
            self._fit(one, float(gains.sel(drive=one.name)), found)
            for one, found in context.track(list(every), "fits")
        ]

    @array(dims=(drive, frequency), unit="m/V")
    def identified(self, value: DataArray, frequency: DataArray) -> Any:
        rows = (dict(zip(NAMES, row, strict=True)) for row in value.values.tolist())
        responses = _responses([ActuatorParameters(**row) for row in rows], frequency)
        return np.asarray(responses, np.complex64)

    @array(dims=(drive, frequency), unit="m/V")
    def true(self, frequency: DataArray) -> Any:
        return np.asarray(_responses(drives(self.axis), frequency), np.complex64)

    @arrays((drive, parameter), value="", half_width="", table="")
    def compared(self, fits: list[DriveFit]) -> dict[str, Any]:
        return {
            "value": np.array([fit.answer[: len(NAMES)] for fit in fits]),
            "half_width": [fit.half_width[: len(NAMES)] for fit in fits],
            "table": [[getattr(drive, name) for name in NAMES] for drive in drives(self.axis)],
        }

    failures = array(
        dims=drive,
        unit="",
        meaning="checks of its experiments that fail",
        value=lambda experiments: [found.failures for found in experiments],
    )

    @arrays((drive, lumped), lumped_value="", lumped_half_width="", lumped_truth="")
    def open_loops(self, experiments: list[DriveExperiments]) -> dict[str, Any]:
        """Lumped parameters from v_r/u alone."""
        every = [found.open_loop for found in experiments]
        return {
            "lumped_value": [one["estimate"][0] for one in every],
            "lumped_half_width": [one["half_width"][0] for one in every],
            "lumped_truth": [one["truth"] for one in every],
        }

    chi_square = array(dims=drive, value=lambda fits: [fit.chi_square for fit in fits])

    hold = check(
        title="experiments",
        statement="checks of a drive's experiments that fail",
        value=lambda failures: failures,
        at_most=0.0,
    )
    coverage = check(
        title="coverage of {lumped}",
        statement="1 - probability that 99 % intervals by the current alone hold the truth in no "
        "more drives than here",
        value=lambda answer: (
            1.0 - coverage_p(_covers_truth(answer).rename(drive="draw"), CONFIDENCE)
        ),
        each="lumped",
        at_most=1.0 - LEAST_COVERAGE_P,
    )
    near_true = check(
        title="{parameter}",
        statement="largest relative error over the drives",
        value=lambda answer: _errors(answer).sel(parameter=list(LIMITS)),
        at_most=LIMITS,
        each="parameter",
        where="of {drive}",
    )

    @check(title="response", at_most=lambda self: RESPONSE_LIMIT[self.axis])
    def responses(self, identified: DataArray, true: DataArray) -> DataArray:
        """largest relative error of a response, over drives and frequencies"""
        return _worst_response(identified, true)

    worst_response = metric(lambda identified, true: _worst_response(identified, true))
    errors = metric("error_{parameter}", value=lambda answer: _errors(answer).max("drive"))

    @metric
    def others(self, answer: Dataset) -> dict[str, DataArray]:
        damping = answer[["value", "table"]].sel(parameter=["b1", "b2"]).sum("parameter")
        return {
            "covered": (abs(answer["value"] - answer["table"]) <= answer["half_width"]).mean(),
            "bias_b_lumped": (answer["lumped_value"].sel(lumped="b") / damping["table"] - 1).mean(),
            "covered_lumped": _covers_truth(answer).mean(),
            "bias_b_joint": (damping["value"] / damping["table"] - 1).mean(),
            "chi_square": answer["chi_square"].max(),
        }

    @table
    def parameters(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        heads = ["drive", *(head for name in NAMES for head in (name, "error"))]
        off = answer["value"] / answer["table"] - 1
        pairs = np.stack([answer["value"], off], axis=-1)
        rows = [
            [name, *(text for v, e in row for text in (f"{v:.4g}", f"{e:+.2%}"))]
            for name, row in zip(answer["drive"].values, pairs, strict=True)
        ]
        return heads, rows

    @figure
    def nyquist(self, answer: Dataset) -> Figure:
        drawn, panels = figures.axes(1, 2, size=(9.5, 5.0))
        fit: Any = {"color": figures.BLUE}
        truth: Any = {"color": figures.ORANGE, "linestyle": "--", "linewidth": 0.9}
        for panel, (caption, (low, high)) in zip(panels, WINDOWS[self.axis].items(), strict=True):
            part = answer.sel(frequency=slice(0.7 * low, 1.3 * high)) * 1e3
            for i in range(part.sizes["drive"]):
                for key, look in (("identified", fit), ("true", truth)):
                    one = part[key][i]
                    panel.plot(one.real, one.imag, label="_" * i + key, **look)
            figures.label(
                panel, x="real part of x/v [mm/V]", title=f"{self.axis}, {caption}, one draw"
            )
            panel.set_aspect("equal", adjustable="datalim")
            panel.locator_params(axis="x", nbins=6)
        panels[0].set_ylabel("imaginary part [mm/V]")
        figures.legend_below(drawn, panels[0])
        return drawn

    def _fit(self, drive: Drive, gain: float, found: DriveExperiments) -> DriveFit:
        """The joint fit of one drive; its optical gain [units/m] is that of the scan."""
        current, motion = found.open_loop, found.closed_loop
        degrees = float(current["variance"].attrs["degrees"])
        mass = float(current["mass"].isel(draw=0))
        # The closed-loop run used the told gain; here it is replaced by that of the scan.
        told = Told.drawn(self.axis, int(motion["seed"].isel(draw=0)))
        scale = told.gain * drive.K_optn / gain
        moved = motion["response"].values * scale
        variance = (motion["radius"].values * scale) ** 2 / stats.f.ppf(0.99, 2, LOOP_DEGREES)
        low, v_r, noise = (current[n].values for n in ("frequency", "response", "variance"))
        high = motion["frequency"].values
        data: list[Any] = [
            MeasuredResponse(_current, low, v_r, variance=noise, degrees=degrees, name="v_r/u"),
            MeasuredResponse(
                _motion, high, moved, variance=variance, degrees=LOOP_DEGREES, name="x/v"
            ),
            KnownQuantities(
                lambda p: [lumped_values(p).m],
                np.array([mass]),
                np.array([[(MASS_DEVIATION * mass) ** 2]]),
                "mass",
            ),
            chain_known(GAIN_DEVIATION[self.axis]),
            independent({"filters": (1.0, RATIO_DEVIATION)}, "filters of the current"),
        ]
        parameters = arm_parameters(self.axis, NAMES) | CHAIN
        program = ParameterFit(data, parameters | {"filters": CHAIN["corner"]})
        answer = solved(program, drive.name)
        return DriveFit(
            answer, program.intervals(answer, confidence=0.99), program.chi_square(answer)[0]
        )


@dataclass(frozen=True)
class DriveFit:
    """Parameters in the order of NAMES, then those of the measurement chain; half-widths of their
    99 % intervals; and chi-square per degree of freedom.
    """

    answer: RealArray
    half_width: RealArray
    chi_square: float


def _current(p: Mapping[str, Any], s: Any) -> Any:
    """v_r/u: the current through the resistor, reduced by the back-EMF of the motion."""
    total = p["R"] + SERIES_RESISTANCE
    moved = lens(p, s, total)
    current = (1 - p["Bl"] * s * moved) * (SERIES_RESISTANCE / total)
    return current * corner_ratio(p["filters"], s)


def _motion(p: Mapping[str, Any], s: Any) -> Any:
    """x/v: the lens's displacement over the coil's voltage, with the measurement chain as it was
    told.
    """
    return lens(p, s, p["R"] + SERIES_RESISTANCE) * chain_ratio(p, s)


def _responses(parameters: Sequence[ActuatorParameters], frequency: DataArray) -> Any:
    """Responses x/v [m/V] (drives, F) at frequencies [Hz]."""
    return stack([specific_model(one) for one in parameters]).response(frequency.values)


def _covers_truth(answer: Dataset) -> DataArray:
    """Whether the interval (drive, lumped) from the current holds the true lumped parameter."""
    off = abs(answer["lumped_value"] - answer["lumped_truth"])
    return off <= answer["lumped_half_width"]


def _errors(answer: Dataset) -> DataArray:
    """Relative errors (drive, parameter), with the truth scaled to the fitted mass."""
    mass = _effective_mass(answer["value"]) / _effective_mass(answer["table"])
    power = [MASS_POWER[name if name in ("R", "Bl") else name[0]] for name in NAMES]
    scaled = answer["table"] * mass ** answer["table"].isel(drive=0).copy(data=power)
    return abs(answer["value"] / scaled - 1)


def _effective_mass(values: DataArray) -> DataArray:
    """Effective mass (drive,) of the first resonance, which both masses determine."""
    return lumped_values({name: values.sel(parameter=name, drop=True) for name in NAMES}).m


def _worst_response(identified: DataArray, true: DataArray) -> DataArray:
    """Largest relative error of the responses, over drives and frequencies."""
    return (abs(identified - true) / abs(true)).max()

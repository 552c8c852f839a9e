"""Open-loop identification: the actuator's parameters from the current in its coil (section 4.3.1).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import figures, problem
from workbench.executor import Context
from workbench.identification import PeriodicResponse, periodic_response
from workbench.study import (
    CLAIM_SHARE,
    LEAST_COVERAGE_P,
    Study,
    array,
    arrays,
    check,
    coverage_p,
    dim,
    draws_summary,
    figure,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from .coil_current import DEGREES, DISCARDED, FOUND, CoilExperiment, Current, LumpedFit
from .experiment import Laboratory
from .figures import open_loop_bode
from .known_values import CONFIDENCE, MASS_POWER
from .unknowns import Told, experiment_seeds

PARAMETERS = {"R": "ohm", "Bl": "N/A", "k": "N/m", "b": "N s/m"}
"""Judged parameters of the lumped model, and their units; they come first in `FOUND`."""
JUDGED = len(PARAMETERS)
ERROR_TOLERANCE = {"R": 0.01, "Bl": 0.01, "k": 0.01, "b": 0.05}
"""Largest accepted relative error of each parameter at the told mass: the accuracies that the
thesis states, where the mass counts as known.
"""
ASSUMPTIONS = ("circular", "normal", "independent")
"""Assumptions of the intervals about the noise, each of which is tested by a p-value."""


@problem("cd/{axis}/open-loop", slow=True, axis=("focus", "radial"), data=TABLES)
def open_loop(
    axis: Axis,
    drive: str = "CD1",
    step: Annotated[float, Field(gt=0, le=5)] = 0.1,
    amplitude: Annotated[float, Field(gt=0, le=10)] = 1.0,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    values: Values = "printed",
) -> OpenLoop:
    """R, Bl, k and b of a drive from its coil's current, by stepped sine (figure 4.4).

    v_r/u is measured from 10 to 50 Hz (focus) or 100 Hz (radial), with 20 periods at each
    frequency, of which the last 10 count. The lumped model of eq. 4.17 is fitted to it, for its
    physical parameters directly, and by eq. 4.20-4.23 from the rational structure of eq. 4.19. The
    current shows only k/m, b/m and Bl^2/m. The experimenter is told the mass with an error of 2 %,
    and the corners of the channels' filters with errors of 2 % (standard deviations), other ones in
    each draw; the intervals include these errors. The parameters are compared with the lumped fit
    to the noise-free response of the same drive.

    drive: CD1 ... CD12. step: distance between the frequencies [Hz]. amplitude: of the excitation
    [V]. draws: number of draws of the noise and of the told values. values: tables "printed" or
    "corrected".
    """
    return OpenLoop(CoilExperiment(Laboratory(axis, drive, values), step, amplitude), draws)


@dataclass(frozen=True, eq=False)
class OpenLoop(Study):
    """Stepped-sine experiments on the coil of a drive, and lumped models fitted to them."""

    experiment: CoilExperiment
    draws: int

    headline: ClassVar[str] = "error_b_mean"

    @property
    def quantifier(self) -> str:
        return f"for this one drive, in {self.draws} simulated draws"

    frequency = dim(lambda self: self.experiment.frequency, unit="Hz", meaning="frequency")
    parameter, assumption = dim(PARAMETERS), dim(ASSUMPTIONS)
    unit = array(dims=parameter, value=lambda: PARAMETERS, coordinate=True)
    found, other = dim(FOUND), dim(FOUND)
    draw = dim(lambda self: range(self.draws))

    @array(dims=draw)
    def seed(self, context: Context) -> Any:
        bench = self.experiment.laboratory
        return experiment_seeds(context.rng, "open-loop", bench.drive, self.draws)

    @part
    def told(self, seed: DataArray) -> list[Told]:
        axis = self.experiment.axis
        return [Told.drawn(axis, one) for one in seed.values.tolist()]

    @part
    def currents(self, context: Context, seed: DataArray, told: list[Told]) -> list[Current]:
        """The signals of each draw, corrected by the told corners of the filters."""
        first, *others = seed.values.tolist()
        found = [self.experiment.played(first)]  # computes the signals that all draws share
        found += context.spread(self.experiment.played, others, "draws")
        pairs = zip(found, told, strict=True)
        return [one.corrected(each, self.experiment.frequency) for one, each in pairs]

    mass = array(
        dims=draw,
        unit="kg",
        meaning="as told",
        value=lambda self, told: [self.experiment.mass * one.mass for one in told],
    )
    raw = part(
        lambda self, currents: [
            periodic_response(self.experiment.frequency, one.u, one.v, transients=DISCARDED)
            for one in currents
        ]
    )

    @part
    def settled(
        self, raw: list[PeriodicResponse], currents: list[Current], mass: DataArray
    ) -> list[PeriodicResponse]:
        """v_r/u of each draw, without the transient of the resonance."""
        every = zip(raw, currents, mass.values.tolist(), strict=True)
        return [self.experiment.settled(*one) for one in every]

    @part
    def fits(
        self, settled: list[PeriodicResponse], mass: DataArray, context: Context
    ) -> list[LumpedFit]:
        every = list(zip(settled, mass.values.tolist(), strict=True))
        return [
            self.experiment.fit(*_with_variance(one), m) for one, m in context.track(every, "fits")
        ]

    # --- the first draw -----------------------------------------------------------------------

    response = array(
        dims=frequency,
        unit="V/V",
        meaning="v_r/u measured",
        value=lambda settled: settled[0].response[:, 0, 0],
    )
    variance = array(
        dims=frequency,
        unit="1",
        value=lambda settled: _with_variance(settled[0])[1],
        degrees=DEGREES,
    )
    radius = array(
        dims=frequency,
        unit="V/V",
        value=lambda variance: np.sqrt(stats.f.ppf(CONFIDENCE, 2, DEGREES) * variance),
    )
    exact = array(
        dims=frequency,
        unit="V/V",
        meaning="v_r/u noise-free",
        value=lambda self: self.experiment.exact(),
    )

    @array(dims=(frequency, "period"), unit="V/V")
    def periods(self, currents: list[Current]) -> Any:
        return (currents[0].v / currents[0].u)[:, DISCARDED:].astype(np.complex64)

    # --- all draws ----------------------------------------------------------------------------

    estimate = array(
        dims=(draw, parameter), value=lambda fits: [one.values[:JUDGED] for one in fits]
    )
    covariance = array(
        dims=(draw, found, other), value=lambda fits: [one.covariance for one in fits]
    )
    half_width = array(
        dims=(draw, parameter),
        unit="",
        meaning="of the 99 % interval",
        value=lambda fits: [one.half_width[:JUDGED] for one in fits],
    )
    chi_square = array(
        dims=draw,
        unit="",
        meaning="of the fit, per degree of freedom",
        value=lambda fits: [one.chi_square for one in fits],
    )

    @array(dims=(draw, parameter))
    def by_equations(self, settled: list[PeriodicResponse], mass: DataArray) -> Any:
        """R, Bl, k, b by equations 4.20-4.23"""
        every = zip(settled, mass.values.tolist(), strict=True)
        return [self.experiment.by_equations(*_with_variance(one)[:2], m) for one, m in every]

    @arrays(
        parameter,
        truth=("", "lumped fit to the noise-free response, true mass"),
        table=("", "printed table, b = b1 + b2"),
    )
    def known(self, exact: DataArray, variance: DataArray) -> dict[str, RealArray]:
        p, one = self.experiment.laboratory.parameters, self.experiment
        return {
            "truth": one.fit(exact.values, variance.values, np.inf, one.mass).values[:JUDGED],
            "table": np.array([p.R, p.Bl, p.k1 * p.k2 / (p.k1 + p.k2), p.b1 + p.b2]),
        }

    assumption_p = array(
        dims=(draw, assumption),
        value=lambda settled: [[getattr(s.assumptions, n) for n in ASSUMPTIONS] for s in settled],
    )
    transient_p = array(dims=draw, value=lambda raw: [one.assumptions.independent for one in raw])
    saturation = array(
        dims=draw, unit="1", value=lambda currents: [one.saturation for one in currents]
    )

    # --- checks -------------------------------------------------------------------------------

    def at_told_mass(self, answer: Dataset) -> DataArray:
        """Relative errors (draw, parameter), with the truth scaled to the told mass."""
        power = answer["truth"].copy(data=[MASS_POWER[name] for name in PARAMETERS])
        told = answer["mass"] / self.experiment.mass
        return abs(answer["estimate"] / (answer["truth"] * told**power) - 1)

    check_errors = check(
        title="error of {parameter}",
        statement="share of draws with a relative error, the mass as told, above the thesis' "
        "accuracy",
        value=lambda self, answer: share_of_draws(
            self.at_told_mass(answer)
            > answer["truth"].copy(data=[ERROR_TOLERANCE[name] for name in PARAMETERS]),
            "parameter",
        ),
        each="parameter",
        at_most=1.0 - CLAIM_SHARE,
    )
    check_coverage = check(
        title="coverage of {parameter}",
        statement="1 - probability that 99 % intervals hold the truth in no more draws than here",
        value=lambda answer: 1.0 - coverage_p(_covers_truth(answer), CONFIDENCE),
        each="parameter",
        at_most=1.0 - LEAST_COVERAGE_P,
    )
    check_equations = check(
        title="equations 4.20-4.23",
        statement="relative distance of their parameters from those of the direct fit, any draw",
        value=lambda by_equations, estimate: abs(by_equations / estimate - 1),
        at_most=1e-4,
    )
    check_saturation = check(
        title="saturation",
        statement="share of samples at a converter's limit, any draw",
        value=lambda saturation: saturation,
        at_most=0.0,
    )

    # --- what is told -------------------------------------------------------------------------

    errors = metric(
        template="error_{parameter}_{summary}",
        value=lambda answer: draws_summary(abs(answer["estimate"] / answer["truth"] - 1)),
    )
    errors_at_told_mass = metric(
        template="error_{parameter}_told_mass_{summary}",
        value=lambda self, answer: draws_summary(self.at_told_mass(answer)),
    )
    covered_each = metric(
        template="covered_{parameter}", value=lambda answer: _covers_truth(answer).mean("draw")
    )
    covered = metric(lambda answer: _covers_truth(answer).mean())
    biases = metric(
        template="bias_{parameter}", value=lambda answer: answer["truth"] / answer["table"] - 1
    )
    tests = metric(
        template="{assumption}_p_{summary}", value=lambda assumption_p: draws_summary(assumption_p)
    )
    ringing = metric(
        template="transient_p_{summary}", value=lambda transient_p: draws_summary(transient_p)
    )
    misfit = metric(
        template="chi_square_{summary}", value=lambda chi_square: draws_summary(chi_square)
    )

    @table
    def parameters(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Parameters of the first draw, and how often the intervals of all draws hold the truth."""
        heads = ["parameter", "estimate", "99 % interval", "by eq. 4.20-4.23", "noise-free fit"]
        held, first, rows = _covers_truth(answer), answer.isel(draw=0), []
        for name, unit in PARAMETERS.items():
            row = first.sel(parameter=name)
            estimate, truth, printed = (float(row[key]) for key in ("estimate", "truth", "table"))
            cells = [f"{estimate:.6g}", f"+- {float(row['half_width']) / estimate:.2%}"]
            cells += [f"{one:.6g}" for one in (float(row["by_equations"]), truth, printed)]
            covered = int(held.sel(parameter=name).sum())
            rows.append(
                [
                    f"{name} [{unit}]",
                    *cells,
                    f"{truth / printed - 1:+.2%}",
                    f"{covered}/{self.draws}",
                ]
            )
        return [*heads, "table", "bias of the lumped model", "intervals that hold"], rows

    @figure
    def bode(self, answer: Dataset) -> Figure:
        bench = self.experiment.laboratory
        drawn = open_loop_bode(answer, f"{bench.drive} {bench.axis}, one record")
        return figures.with_figure_numbers(drawn, "4.4")


def _with_variance(settled: PeriodicResponse) -> tuple[ComplexArray, RealArray, float]:
    """v_r/u (F,), its variance, and the degrees of freedom of the variance."""
    variance = (DEGREES + 2) / DEGREES * settled.variance[:, 0, 0]
    return settled.response[:, 0, 0], variance, DEGREES


def _covers_truth(answer: Dataset) -> DataArray:
    """Whether an interval (draw, parameter) holds the truth."""
    return abs(answer["estimate"] - answer["truth"]) <= answer["half_width"]

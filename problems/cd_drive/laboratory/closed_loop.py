"""The arm's parasitic resonance, measured while the loop holds the focus (sections 4.3.2, 4.6.2).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, problem, ref
from workbench.executor import Context
from workbench.identification import IdentificationWarning
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
    markdown_table,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.types import DataArray, Dataset, Figure

from ..drive.red_book import ACCEPTABLE_ERROR
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from ..drive.two_masses import FITTED, lumped_values
from .experiment import Laboratory
from .figures import closed_loop_bode
from .in_the_loop import RECORDED, LoopExperiment, LoopRecord
from .known_values import CONFIDENCE, Lumped
from .loop_fit import NUMBERS, LoopFit, fit_of_draw
from .printed_noise import Amplitude, Fixed, position_noise
from .unknowns import Told, experiment_seeds

LIMITS = {"m1": 0.008, "m2": 0.12, "k1": 0.015, "k2": 0.12, "b1": 0.06, "b2": 6.0}
"""Largest accepted errors of the parameters over the effective mass, relative, with frequency steps
of FINE_STEP. They grow with the square root of the step. b2 is a twentieth of the damping: the
experiment only shows that it is small.
"""
FINE_STEP = 2.0
"""Frequency step in the thesis [Hz]."""
LEAST_P = 0.01
"""p-value below which a test of the fit rejects the model's order in a draw."""


def experiment(axis: str, drive: str, draws: int, values: str, **_: Any) -> dict[str, Any]:
    """Reference to the open-loop experiment on the same drive, with as many draws."""
    return {"open_loop": ref(f"cd/{axis}/open-loop", drive=drive, draws=draws, values=values)}


@problem(
    "cd/{axis}/closed-loop",
    slow=True,
    axis=("focus", "radial"),
    needs=experiment,
    data=(*TABLES, "data/red_book.csv"),
    added=("delay", "noise", "noise_fixed"),
)
def closed_loop(
    axis: Axis,
    open_loop: Run,
    drive: str = "CD1",
    disturbances: bool = True,
    mismatch: Annotated[float, Field(ge=0, lt=1)] = 0.0,
    step_hz: Annotated[float, Field(ge=1, le=100)] = FINE_STEP,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    values: Values = "printed",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> ClosedLoop:
    """Actuator measured in closed loop, and its two masses on two springs fitted (figure 4.5).

    A stepped sine from 100 to 2000 Hz, designed for the nominal drive, is added to the controller's
    output. The ratio f_en/u_m of two measured signals is the plant's response, whatever the loop
    does. The lumped parameters of the open-loop experiment are then distributed over m1, m2, k1,
    k2, b1, b2 so that the parasitic resonance fits. The experimenter is told effective mass,
    optical gain, delay and filter corners with errors, which differ in each draw (see `unknowns`).
    The confidence intervals include these errors, and the study counts how often they hold the
    truth.

    drive: "CD1" to "CD12", or "nominal". disturbances: whether the disc turns, and wobbles by a
    fifth of what the Red Book allows; measurement noise is always present. mismatch: of the arm's
    halves; above 0 there are two parasitic resonances, one more than the model has. step_hz:
    distance between the frequencies [Hz]. draws: number of draws of the noise and of the told
    values. values: tables "printed" or "corrected". delay [samples]: of the computer. noise,
    noise_fixed: reading of the printed amplitude of 0.15 um (`printed_noise`).
    """
    size = position_noise(axis, drive, noise, noise_fixed)
    bench = Laboratory(axis, drive, values, delay=delay, mismatch=mismatch, noise=size)
    return after_open_loop(open_loop.answer, bench, disturbances, step_hz)


def after_open_loop(
    answer: Dataset, bench: Laboratory, disturbances: bool = True, step_hz: float = FINE_STEP
) -> ClosedLoop:
    """The closed-loop experiment with the lumped parameters that each draw of `answer` found."""
    frequency = np.arange(100.0, 2000.0 + step_hz / 2, step_hz)
    known = tuple(Lumped.from_open_loop(answer.isel(draw=n)) for n in range(answer.sizes["draw"]))
    return ClosedLoop(LoopExperiment(bench, frequency, disturbances), len(known), known)


@dataclass(frozen=True, eq=False)
class ClosedLoop(Study):
    """Stepped sines in the loop of a drive on the bench, and fits of the drive's physical
    parameters.

    lumped: parameters from the open-loop experiment, by draw. With None they are drawn around the
    drive's own values.
    """

    experiment: LoopExperiment
    draws: int
    lumped: tuple[Lumped, ...] | None = None

    headline: ClassVar[str] = "chi_square_mean"

    @property
    def quantifier(self) -> str:
        return f"for this one drive, in {self.draws} simulated draws"

    @property
    def bench(self) -> Laboratory:
        return self.experiment.bench

    @property
    def limits(self) -> dict[str, float]:
        """Largest accepted errors of the parameters for this step of the frequencies, relative."""
        wider = max(1.0, float(np.mean(np.diff(self.experiment.frequency))) / FINE_STEP) ** 0.5
        return {name: limit * wider for name, limit in LIMITS.items()}

    frequency = dim(lambda self: self.experiment.frequency, unit="Hz", meaning="frequency")
    parameter, signal = dim(FITTED), dim(RECORDED)
    draw = dim(lambda self: range(self.draws))

    @array(dims=draw)
    def seed(self, context: Context) -> Any:
        return experiment_seeds(context.rng, "closed-loop", self.bench.drive, self.draws)

    told = part(
        lambda self, seed: [Told.drawn(self.bench.axis, one) for one in seed.values.tolist()]
    )

    @part
    def known(self, seed: DataArray) -> tuple[Lumped, ...]:
        """Lumped parameters that the open-loop experiment found, by draw."""
        if self.lumped is not None:
            return self.lumped
        own = Lumped.of(self.bench.parameters)
        return tuple(own.drawn(np.random.default_rng([one, 2])) for one in seed.values.tolist())

    @part
    def heard(self, context: Context, seed: DataArray, told: list[Told]) -> Any:
        """The records of all draws, and the warnings that estimation gave for them."""
        cells = list(zip(seed.values.tolist(), told, strict=True))
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", IdentificationWarning)
            records = context.spread(
                lambda cell: self.experiment.measured(*cell), cells, "experiments"
            )
        return records, sorted({str(one.message) for one in heard})

    records = part(lambda heard: heard[0])

    @part
    def fits(
        self, context: Context, records: list[LoopRecord], told: list[Told], known: Any
    ) -> list[LoopFit]:
        every = list(zip(records, told, known, strict=True))
        return [
            fit_of_draw(self.experiment, *one, context.options)
            for one in context.track(every, "fits")
        ]

    # --- the first draw -----------------------------------------------------------------------

    shown = arrays(
        frequency,
        lambda fits: fits[0]._asdict(),
        response="m/V", radius="m/V", fitted="m/V",
        exact=("m/V", "without noise, by the measurement chain that is told"),
    )  # fmt: skip
    excitation = array(dims=frequency, unit="V", value=lambda self: self.experiment.sine.amplitude)
    notes = array(value=lambda heard, fits: "\n".join([*heard[1][:1], *fits[0].notes]))

    # --- all draws ----------------------------------------------------------------------------

    value = array(dims=(draw, parameter), value=lambda fits: [one.value for one in fits])
    half_width = array(
        dims=(draw, parameter),
        unit="",
        meaning="of the 99 % interval",
        value=lambda fits: [one.half_width for one in fits],
    )
    table_value = array(
        dims=parameter, value=lambda self: [getattr(self.bench.parameters, name) for name in FITTED]
    )
    numbers = arrays(
        draw,
        lambda fits: {name: [one.numbers[name] for one in fits] for name in NUMBERS},
        **dict.fromkeys(NUMBERS, ""),
    )
    events = array(
        dims=draw, unit="", meaning="", value=lambda records: [one.events for one in records]
    )
    largest_error = array(
        dims=draw,
        unit="m",
        meaning="",
        value=lambda records: [one.largest_error for one in records],
    )
    saturated = array(
        dims=(draw, signal),
        unit="",
        meaning="share of samples",
        value=lambda records: [one.saturated for one in records],
    )
    level = array(
        dims=(draw, signal),
        unit="",
        meaning="largest magnitude over the converter's limit",
        value=lambda records: [one.level for one in records],
    )

    # --- checks -------------------------------------------------------------------------------

    @check()
    def experiments(self, answer: Dataset) -> list[Check]:
        """The loop held within the linear range of diodes and converters, and the fits are
        proven.
        """
        far = share_of_draws(answer["largest_error"] > ACCEPTABLE_ERROR[self.bench.axis])
        lost, failed = (float(answer[name].sum()) for name in ("events", "unproven"))
        most = float(answer["saturated"].max())
        return [
            Check("loop", "times that it was lost or regained, all draws", lost, 0.0),
            Check("saturation", "largest share of saturated samples, any draw", most, 0.0),
            Check("linear range", "share of draws that leave it", float(far), 1.0 - CLAIM_SHARE),
            Check("fit", "checks of a fit that fail, all draws", failed, 0.0),
        ]

    @check(title="{parameter} over mass", each="parameter", at_most=1.0 - CLAIM_SHARE)
    def parameters_close(self, answer: Dataset) -> DataArray | None:
        """share of draws with a relative error above the limit, over the effective mass"""
        if not self._order_is_right:
            return None
        limits = answer["table_value"].copy(data=[self.limits[name] for name in FITTED])
        return share_of_draws(_errors_over_mass(answer) > limits, "parameter")

    @check(title="coverage of {parameter}", each="parameter", at_most=1.0 - LEAST_COVERAGE_P)
    def coverage(self, answer: Dataset) -> DataArray | None:
        """1 - probability that 99 % intervals hold the truth in no more draws than here"""
        return 1.0 - coverage_p(_covers_truth(answer), CONFIDENCE) if self._order_is_right else None

    @check(title="order", at_most=1.0 - LEAST_COVERAGE_P)
    def order(self, chi_square_p: DataArray) -> DataArray | None:
        """1 - probability that chi-square rejects the right order in no fewer draws than here"""
        return 1.0 - _accepted_p(chi_square_p) if self._order_is_right else None

    @check(title="smooth misfit", at_most=1.0 - LEAST_COVERAGE_P)
    def smooth_misfit(self, neighbours_p: DataArray) -> DataArray | None:
        """1 - probability that residuals of the right order look smooth in no fewer draws"""
        return 1.0 - _accepted_p(neighbours_p) if self._order_is_right else None

    @property
    def _order_is_right(self) -> bool:
        """Whether the model has the order of the bench; if not, metrics and notes report it."""
        return self.bench.arms_alike

    # --- what is told -------------------------------------------------------------------------

    errors = metric(
        template="error_{parameter}_{summary}", value=lambda answer: draws_summary(_errors(answer))
    )
    errors_over_mass = metric(
        template="error_{parameter}_over_mass_{summary}",
        value=lambda answer: draws_summary(_errors_over_mass(answer)),
    )
    half_widths = metric(
        template="half_width_{parameter}_{summary}",
        value=lambda half_width, table_value: draws_summary(half_width / table_value),
    )
    covered_each = metric(
        template="covered_{parameter}", value=lambda answer: _covers_truth(answer).mean("draw")
    )
    covered = metric(lambda answer: _covers_truth(answer).mean())
    levels = metric("level_{signal}", value=lambda level: level.max("draw"))
    largest_um = metric(
        template="largest_error_{summary}_um",
        value=lambda largest_error: draws_summary(1e6 * largest_error),
    )

    @metric
    def told_numbers(self, answer: Dataset) -> dict[str, DataArray]:
        found = {name: draws_summary(answer[name]) for name in NUMBERS if name != "unproven"}
        return {
            f"{name}_{end}": one.sel(summary=end)
            for name, one in found.items()
            for end in one["summary"].values
        }

    wrong_order = metric(
        template=lambda chi_square_p, neighbours_p: share_of_draws(
            np.minimum(chi_square_p, neighbours_p) < LEAST_P
        )
    )
    radius_median = metric(lambda radius, exact: (radius / abs(exact)).median())

    @table
    def parameters(self, answer: Dataset) -> str:
        """Parameters of the first draw, and how often the intervals of all draws hold the truth."""
        heads = ["parameter", "fitted", "99 %, +-", "true", "error", "intervals that hold"]
        held, first, rows = _covers_truth(answer), answer.isel(draw=0), []
        for name in FITTED:
            one = first.sel(parameter=name)
            value, half, true = (float(one[key]) for key in ("value", "half_width", "table_value"))
            cells = [f"{value:.4g}", f"{half:.2g}", f"{true:.4g}", f"{value / true - 1:+.2%}"]
            rows.append([name, *cells, f"{int(held.sel(parameter=name).sum())}/{self.draws}"])
        notes = [f"- {note}" for note in str(answer["notes"].values).splitlines()]
        rejected = int(self.draws * self.metrics(answer)["wrong_order"] + 0.5)
        if rejected:
            notes.append(
                f"- in {rejected} of {self.draws} draws the fit misses the data by more than noise "
                "does: the model lacks something, for instance order, and the intervals do not hold"
            )
        return "\n".join([markdown_table(heads, rows), *notes]) + "\n"

    @figure
    def figure_4_5(self, answer: Dataset) -> Figure:
        return closed_loop_bode(answer, f"{self.bench.drive}, {self.bench.axis}, one record")


def _covers_truth(answer: Dataset) -> DataArray:
    """Whether an interval (draw, parameter) holds the truth."""
    return abs(answer["value"] - answer["table_value"]) <= answer["half_width"]


def _errors(answer: Dataset) -> DataArray:
    """Relative errors (draw, parameter) of the fitted parameters."""
    return abs(answer["value"] / answer["table_value"] - 1)


def _errors_over_mass(answer: Dataset) -> DataArray:
    """Relative errors (draw, parameter) of the parameters divided by the effective mass.

    Only these quotients follow from the responses; the mass itself is as accurate as the told
    value.
    """
    over = [answer[key] / _effective_mass(answer[key]) for key in ("value", "table_value")]
    return abs(over[0] / over[1] - 1)


def _effective_mass(values: DataArray) -> DataArray:
    """Effective mass of the first resonance, which both masses determine."""
    return lumped_values({name: values.sel(parameter=name) for name in FITTED} | {"Bl": 0.0}).m


def _accepted_p(p: DataArray) -> DataArray:
    """Probability that a correct model order is accepted in no more draws than these p-values
    accept.
    """
    return coverage_p(p >= LEAST_P, 1.0 - LEAST_P)

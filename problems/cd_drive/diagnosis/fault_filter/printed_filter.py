"""The fault filter that the numbers of section 7.3.2 define (figures 7.12 and 7.13).

Equation, section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, figures, problem, solve
from workbench.certificate import EVERY_FREQUENCY, EVERY_PERTURBATION
from workbench.certify import stability_check
from workbench.diagnosis import FaultFilter, FaultLoop
from workbench.errors import SolverError
from workbench.fitting import Rational, rational_of_system
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.synthesis import approximate
from workbench.systems import bilinear_sampled, response
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace
from workbench.uncertainty import UncertaintyModel

from ...control.control_problem import optical_gain
from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from .defect_estimates import (
    LONGEST,
    SIZE,
    bump,
    converted,
    estimated,
    relative_errors,
    sensitivities,
)
from .loop import fault_loop
from .printed_weights import DESIGNS, least_at_each_frequency, nominal_program, robust_program
from .problem import needs, stadiums_of

STAGES = ("none", "full", "reduced", "sampled")
"""No filter at all; filters of full and of reduced order; the reduced one in the sampled loop."""
ORDER = 10
"""Order of the reduced filter (figure 7.12)."""
LENGTHS = (0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1e3 * LONGEST)
"""Lengths of defects along the track [mm], raised cosines; figure 7.13 prints none."""
SHOWN = (0.4, 0.8)
"""Lengths that the figure shows [mm]."""
LEVEL_ROOM = 5e-3
"""Largest accepted excess of a filter's norm over the level below which none was found."""
AGREES = 1e-3
"""Largest relative difference of a norm or peak that is computed again."""
TOP = 10e3
"""Frequency at which the gain is compared with figure 7.12 [Hz]."""
NAMES = {"channels": "a scaling for each channel", "rows": "both rows"}


@problem(
    "cd/{axis}/printed-filter",
    slow=True,
    axis=("focus", "radial"),
    needs=needs,
    data=TABLES,
    added=("gain", "delay"),
)
def printed_filter(
    axis: Axis,
    covered: Run,
    gain: Gain = "own",
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
) -> PrintedFilter:
    """The fault filter with the scalings 5e-3 and 2e-5 and the weights of section 7.3.2.

    The H-infinity norm of the scaled estimation error is minimised for the nominal drive, by both
    readings of the scalings. The peak of mu over the stadiums follows for each filter, for its
    reduction to tenth order, for that in the sampled loop, and for no filter at all. Bumps of seven
    lengths are estimated in the loops of the twelve drives. The thesis prints the numbers of the
    focus loop only; the radial loop has them too, with its own W_p.

    gain: of the twelve drives. delay: of the sampled loop [samples].
    """
    return PrintedFilter(axis, stadiums_of(covered), gain, delay)


@dataclass(frozen=True, eq=False)
class PrintedFilter(Study):
    """Filters by the printed numbers, and the defects that they estimate."""

    axis: Axis
    model: UncertaintyModel
    gain_of_drives: Gain
    delay: float

    headline: ClassVar[str] = "mu_sampled_rows"

    @property
    def quantifier(self) -> str:
        return "for these filters"

    @cached_property
    def loops(self) -> dict[str, FaultLoop]:
        """The loop in continuous time, and as a computer closes it."""
        import control

        K = control.ss(controller(self.axis))
        return {
            "continuous": fault_loop(self.axis, self.model, K),
            "sampled": fault_loop(self.axis, self.model, K, self.delay),
        }

    design, stage, bound = dim(DESIGNS), dim(STAGES), dim("lower", "upper")
    length = dim(LENGTHS, unit="mm")

    @part
    def found(self) -> dict[str, FaultFilter]:
        """Filters of nearly the least norm for the nominal plant."""
        return {one: least(self.axis, self.loops["continuous"], one) for one in DESIGNS}

    functions = part(lambda found: [rational_of_system(one.K) for one in found.values()])
    zeros = array(
        dims=(design, "zero"), unit="rad/s", value=lambda functions: [F.zeros for F in functions]
    )
    poles = array(
        dims=(design, "pole"), unit="rad/s", value=lambda functions: [F.poles for F in functions]
    )
    gain = array(
        dims=design,
        unit="1",
        meaning="of a filter over the products of s - root",
        value=lambda functions: [F.gain for F in functions],
    )
    level = array(dims=design, unit="1", meaning="norm below which no filter was found")(
        lambda found: [one.least for one in found.values()]
    )
    norm = array(
        dims=(design, bound), unit="1", meaning="certified norm for the nominal plant, full order"
    )(lambda self, functions: [self.nominal_norm(*one) for one in _filters(functions).items()])

    def nominal_norm(self, design: str, F: StateSpace) -> list[float]:
        """Certified bounds of a filter's norm with the nominal plant."""
        found = nominal_program(self.axis, self.loops["continuous"], design).certified_peak(F)
        return [found.lower, found.upper]

    @array(dims=(design, stage, bound), unit="1", meaning="certified bounds of mu")
    def mu(self, functions: list[Rational]) -> Any:
        return [self.peaks(name, F) for name, F in _filters(functions).items()]

    def peaks(self, design: str, full: StateSpace) -> list[list[float]]:
        """Certified bounds of mu on every plant of the stadiums, at each of STAGES."""
        import control

        nothing, reduced = control.ss([], [], [], [[0.0]]), of_low_order(full)
        continuous, sampled = (
            robust_program(self.axis, loop, design) for loop in self.loops.values()
        )
        tried = [(continuous, one) for one in (nothing, full, reduced)] + [(sampled, reduced)]
        found = [program.certified_peak(F) for program, F in tried]
        return [[one.lower, one.upper] for one in found]

    @array(dims=(design, length, "drive"), unit="1", meaning="error of a bump over its size, rms")
    def error(self, functions: list[Rational]) -> Any:
        loops = sensitivities(self.axis, self.delay, self.gain_of_drives)
        seen = [sampled_bump(length) for length in LENGTHS]
        played = [sampled(F) for F in _filters(functions).values()]
        return [[relative_errors(one, estimated(loops, F, one)) for _, one in seen] for F in played]

    def filters(self, answer: Dataset) -> dict[str, StateSpace]:
        """The filters of full order, e [m] -> u_f [m], by design."""
        every = (answer[name].values for name in ("zeros", "poles", "gain"))
        return _filters([Rational(z, p, float(gain)) for z, p, gain in zip(*every, strict=True)])

    # --- checks -------------------------------------------------------------------------------

    @check()
    def stable(self, answer: Dataset) -> list[Check]:
        """Every filter is stable by itself, and the reduced ones have the order that they claim."""
        filters = list(self.filters(answer).values())
        if self.all_stable(answer):
            filters += [of_low_order(F) for F in filters]
        worst = max(stability_check(F).value for F in filters)
        return [
            Check("stable filters", "largest real part of a pole [rad/s]", worst, 0.0),
            Check("order", "states of a reduced filter", float(filters[-1].nstates), ORDER),
        ]

    def all_stable(self, answer: Dataset) -> bool:
        """Whether every filter is stable; of others no peak and no reduction is computed."""
        return all(stability_check(F).holds for F in self.filters(answer).values())

    @check(title="norms again", at_most=AGREES, over=EVERY_FREQUENCY)
    def norms_again(self, answer: Dataset) -> float:
        """largest relative difference of a stored norm from that of the stored filter"""
        return self.furthest(answer, "norm", self.nominal_norm)

    @check(title="mu again", at_most=AGREES, over=EVERY_PERTURBATION)
    def mu_again(self, answer: Dataset) -> float:
        """largest relative difference of a stored peak of mu from that of the stored filter"""
        return self.furthest(answer, "mu", self.peaks)

    def furthest(self, answer: Dataset, name: str, found: Callable[..., Any]) -> float:
        """Largest relative difference of stored bounds from those found again for the filters."""
        if not self.all_stable(answer):
            return math.inf
        again = [found(design, F) for design, F in self.filters(answer).items()]
        return float(abs(np.array(again) / answer[name].values - 1.0).max())

    @check(title="least norm", at_most=LEVEL_ROOM)
    def near(self, norm: DataArray, level: DataArray) -> DataArray:
        """certified norm over the level below which no filter was found, less 1"""
        return norm.sel(bound="upper") / level - 1.0

    @check(title="bound at each frequency", at_most=1.0, over=EVERY_FREQUENCY)
    def bounded(self, norm: DataArray) -> float:
        """norm that no filter gets below, by formula, over the certified one, at most"""
        omega = 2 * np.pi * np.geomspace(1.0, 1e5, 2000)
        least = [least_at_each_frequency(self.axis, one, omega).max() for one in DESIGNS]
        return float((least / norm.sel(bound="upper")).max())

    # --- what is told -------------------------------------------------------------------------

    norms = metric("norm_{design}", value=lambda norm: norm.sel(bound="upper"))
    peaks_of_mu = metric("mu_{stage}_{design}", value=lambda mu: mu.sel(bound="upper"))
    worst_error = metric("error_{length}_mm_{design}", value=lambda error: error.max("drive"))

    @metric
    def gains_and_orders(self, answer: Dataset) -> dict[str, float]:
        """Gain at TOP from normalised error to metres [dB], and the order of each full filter."""
        at: RealArray = 2 * np.pi * np.array([TOP])
        found: dict[str, float] = {}
        for name, F in self.filters(answer).items():
            gain = abs(response(F, at)[0, 0, 0]) / optical_gain(self.axis)
            found |= {f"gain_db_{name}": 20 * np.log10(gain), f"order_{name}": float(F.nstates)}
        return found

    @table
    def designs(self, answer: Dataset) -> Any:
        """Norm, peak of mu with and without the filter, and errors of defects, of each design."""
        rows = []
        for name in DESIGNS:
            one = answer.sel(design=name, bound="upper", drop=True)
            cells = [f"{float(one['norm']):.5f}"]
            cells += [f"{float(one['mu'].sel(stage=stage)):.3f}" for stage in STAGES]
            errors = answer["error"].sel(design=name, length=list(SHOWN))
            cells += [f"{float(e.median()):.2f} to {float(e.max()):.2f}" for e in errors]
            rows.append([NAMES[name], *cells])
        lengths = [f"error of {length} mm, median to worst" for length in SHOWN]
        return ["scalings", "norm", *(f"mu, {stage}" for stage in STAGES), *lengths], rows

    @figure
    def figure_7_12(self, answer: Dataset) -> Figure:
        """The filters over frequency, from normalised error to metres."""
        frequency = np.geomspace(1.0, 0.499 * RATE, 500)
        drawn, (gain, phase) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
        for name, colour in zip(DESIGNS, figures.CYCLE, strict=False):
            for F, dash, words in (
                (self.filters(answer)[name], "-", "full order"),
                (sampled(self.filters(answer)[name]), "--", "sampled, order 10"),
            ):
                values = response(F, 2 * np.pi * frequency)[:, 0, 0] / optical_gain(self.axis)
                label = f"{NAMES[name]}, {words}"
                gain.plot(frequency, 20 * np.log10(abs(values)), dash, color=colour, label=label)
                phase.plot(frequency, figures.phase(values), dash, color=colour)
        gain.axhline(-20 * np.log10(optical_gain(self.axis)), color="0.5", linewidth=0.8)
        figures.label(gain, y="$|K_f|$ [dB re 1 m per unit]", log="x")
        figures.label(phase, x="frequency [Hz]", y=r"$\arg K_f$ [deg]", log="x")
        figures.legend_below(drawn, gain, columns=2)
        return drawn

    @figure
    def figure_7_13(self, answer: Dataset) -> Figure:
        """Two defects and their estimates in the twelve loops, by each filter."""
        drawn, panels = figures.axes(
            len(SHOWN), len(DESIGNS), size=(10.0, 5.6), sharex=True, sharey=True
        )
        loops = sensitivities(self.axis, self.delay, self.gain_of_drives)
        places = ((length, name) for length in SHOWN for name in DESIGNS)
        for panel, (length, name) in zip(panels, places, strict=True):
            time, seen = sampled_bump(length)
            F = sampled(self.filters(answer)[name])
            found = 1e6 * estimated(loops, F, seen)
            panel.plot(1e3 * time, found.T, color=figures.BLUE, linewidth=0.7)
            panel.plot(1e3 * time, 1e6 * seen, color=figures.BLACK, linewidth=1.2)
            panel.set_title(f"{length} mm, {NAMES[name]}", fontsize=9)
            figures.label(
                panel,
                x="time [ms]" if length == SHOWN[-1] else "",
                y=r"defect [$\mu$m]" if name == DESIGNS[0] else "",
            )
        return drawn


def _filters(functions: list[Rational]) -> dict[str, StateSpace]:
    return {name: F.state_space() for name, F in zip(DESIGNS, functions, strict=True)}


def least(axis: Axis, loop: FaultLoop, design: str) -> FaultFilter:
    """The filter of nearly the least norm for the nominal plant, by two Riccati equations.

    Raises SolverError if its certificate does not hold.
    """
    solution = solve(nominal_program(axis, loop, design), method="riccati")
    if solution.answer is None or not (solution.certificate and solution.certificate.holds):
        raise SolverError(f"the filter by the printed numbers, {design}: {solution.message}")
    answer: FaultFilter = solution.answer
    return answer


def of_low_order(F: StateSpace) -> StateSpace:
    """F by balanced truncation to ORDER states."""
    return approximate(F, ORDER, method="balanced")


def sampled(F: StateSpace) -> StateSpace:
    """F of low order, sampled."""
    return bilinear_sampled(of_low_order(F), PERIOD)


def sampled_bump(length: float) -> tuple[RealArray, RealArray]:
    """Times [s] and false displacement [m] of a bump of this length [mm], as converters see it."""
    return converted(lambda time: SIZE * bump(1e-3 * length, time))

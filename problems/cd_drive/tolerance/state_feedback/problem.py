"""State feedback from strategy B's estimates, in place of its controller and switch (section 8.4).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.simulation import discrete_system
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    part,
    share_of_draws,
    table,
    verdict_of_share,
)
from workbench.systems import loop_response
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ...diagnosis.defect_runs import ROTATION
from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.margins import nearest_margins
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ..scenario import Scenario
from ..strategies.runs import ENGAGED, Experiment, StrategyOutcome
from ..strategy_looks import COLOURS
from .law import StateFeedback, crossover, estimated, loop, matched

FEEDBACK = "state feedback"
CASES = ("reference", "B", FEEDBACK)
"""The reference strategy, strategy B, and the state feedback from B's estimates."""
LOOPS = ("K", "B", FEEDBACK)
"""Loops on a clean disc; that of the reference strategy is the loop of K."""
LENGTHS = (1.2e-3, 2.5e-3)
"""Lengths of scratches [m]: that of section 8.6, and the longest that the error correction repairs.
"""
SHADES = {"reference": COLOURS["reference"], "B": COLOURS["B"], FEEDBACK: figures.SKY}
"""Colours of the cases."""
FREQUENCY = np.geomspace(10.0, 17e3, 300)
"""Frequencies [Hz] at which the nominal loops are shown."""
HANDED_OVER = 1.0
"""Number of revolutions after which the state feedback takes over from B. Without B before it the
filter would have no initial estimate, and focus would be lost on a disc that moves by half a
millimetre.
"""
RICCATI_RESIDUAL = 1e-9
"""Largest difference of the gain from that of its own closed loop's cost, relative."""
SAME_CROSSOVER = 1e-3
"""Largest difference of the crossover with known states from that of the reference loop, relative.
"""


@problem(
    "cd/{axis}/state-feedback",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def state_feedback(
    axis: Axis,
    drive_count: Annotated[int, Field(ge=0, le=12)] = 12,
    draws: Annotated[int, Field(ge=1, le=1000)] = 6,
) -> StateFeedbackStudy:
    """State feedback on strategy B's estimates, in place of its controller and switch (8.4).

    The command is u_p, which moves the lens as the disc moves, minus a gain on the states that B's
    Kalman filter estimates; this holds in a defect and on a clean disc alike. The gain minimises a
    weighted sum of the squared error and of (u - u_p)^2. The weight is chosen so that the loop with
    known states has the same crossover as the reference loop. The state feedback takes over from B.
    It is compared with B and the reference strategy in the experiment of `cd/<axis>/strategies`,
    with scratches of 1.2 and 2.5 mm, in the same draws, and by its margins on each drive.

    drive_count: how many of the twelve drives. draws: number of draws on each drive, of noise,
    angle, sign and edge of the scratch.
    """
    return StateFeedbackStudy(axis, drive_count, draws)


@dataclass(frozen=True, eq=False)
class StateFeedbackStudy(Study):
    """The law, its loops, and experiments."""

    axis: Axis
    drive_count: int
    draws: int

    headline: ClassVar[str] = "below_B_1.2mm"

    @property
    def quantifier(self) -> str:
        return f"for {self.drive_count} drives, in {self.draws} simulated draws on each"

    case, loop_of = dim(CASES), dim(LOOPS)
    drive = dim(lambda self: self.names)
    draw = dim(lambda self: range(self.draws))
    length = dim(LENGTHS, unit="m")
    frequency = dim(FREQUENCY, unit="Hz")

    @property
    def names(self) -> list[str]:
        """The nominal drive and the first of the twelve."""
        return ["nominal", *(one.name for one in drives(self.axis)[: self.drive_count])]

    @cached_property
    def reference(self) -> StateSpace:
        """The reference controller, sampled."""
        import control

        return discrete_system(control.ss(controller(self.axis)), PERIOD)

    # --- the law and its loops ----------------------------------------------------------------

    @part
    def law(self) -> StateFeedback:
        return matched(self.axis, ROTATION, self.reference_crossover)

    @cached_property
    def reference_crossover(self) -> float:
        """Crossover [Hz] of the reference loop, nominal drive."""
        return crossover(loop(Laboratory(self.axis, "nominal"), self.reference))

    weight = array(dims=(), unit="um^2/V^2", meaning="of the command", value=lambda law: law.weight)
    gain = array(
        dims="state",
        unit="V per state",
        meaning="plant's states, command",
        value=lambda law: law.gain,
    )

    def controllers(self, law: StateFeedback) -> dict[str, StateSpace]:
        """f_en -> u by LOOPS."""
        made = (self.reference, estimated(self.axis, ROTATION, self.reference), law.controller)
        return dict(zip(LOOPS, made, strict=True))

    @part
    def loops(self, law: StateFeedback) -> list[list[StateSpace]]:
        """Open loops [LOOPS][drives]."""
        benches = [Laboratory(self.axis, name) for name in self.names]
        made = self.controllers(law).values()
        return [[loop(bench, one) for bench in benches] for one in made]

    @arrays((loop_of, drive), gain_margin="dB", phase_margin="deg", growth="1/s", crossover="Hz")
    def judged(self, loops: list[list[StateSpace]]) -> dict[str, Any]:
        """Margins, decay rate of the slowest mode, and crossover."""
        every = [[nearest_margins(one) for one in row] for row in loops]
        return {
            "gain_margin": [[one.gain_db for one in row] for row in every],
            "phase_margin": [[one.phase for one in row] for row in every],
            "growth": [[_growth(one) for one in row] for row in loops],
            "crossover": [[crossover(one) for one in row] for row in loops],
        }

    @part
    def nominal(self, loops: list[list[StateSpace]]) -> Any:
        return np.array([loop_response(row[0], FREQUENCY) for row in loops])

    L_real = array(
        dims=(loop_of, frequency), unit="1", meaning="", value=lambda nominal: nominal.real
    )
    L_imag = array(
        dims=(loop_of, frequency), unit="1", meaning="", value=lambda nominal: nominal.imag
    )

    # --- experiments --------------------------------------------------------------------------

    @array(dims=(drive, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, len(self.names), self.draws)

    def played(self, one: Scenario, law: StateFeedback) -> Record:
        """A scenario in which the state feedback takes over from B, once B's filter has settled."""
        made = one.strategies()
        return one.bench.closed_loop(
            [
                (0.0, made.named("reference")),
                (ENGAGED, made.named("B")),
                (ENGAGED + HANDED_OVER / ROTATION, law.cascade(made)),
            ],
            duration=one.duration,
            disc=one.disc,
            defects=one.defects,
            seed=one.seed,
        )

    def outcomes(self, law: StateFeedback, drive: str, seed: int) -> list[list[StrategyOutcome]]:
        """Outcomes [lengths][cases] of one draw."""
        scratch, found = ScratchDraw.drawn(self.axis, seed), []
        for length in LENGTHS:
            experiment = Experiment(self.axis, length=length)
            records = [experiment.scenario(drive, name, scratch).run() for name in CASES[:-1]]
            records.append(self.played(experiment.scenario(drive, "B", scratch), law))
            found.append([experiment.outcome(one, scratch.angle) for one in records])
        return found

    @part
    def met(self, law: StateFeedback, seed: DataArray, context: Context) -> RealArray:
        """Outcomes (drives, draws, lengths, cases, 4)."""
        cells = [
            (name, one)
            for name, row in zip(self.names, seed.values.tolist(), strict=True)
            for one in row
        ]
        found = context.spread(lambda cell: self.outcomes(law, *cell), cells, "draws")
        return np.reshape(found, (*seed.shape, len(LENGTHS), len(CASES), -1))

    scores = arrays(
        (drive, draw, length, case),
        lambda met: {name: met[..., n] for n, name in enumerate(StrategyOutcome._fields)},
        excursion="m", periodic="m", events="", early_events="",
    )  # fmt: skip

    # --- checks -------------------------------------------------------------------------------

    stable = check(
        title="stable {loop_of}",
        statement="rate of the slowest motion of a drive [1/s]",
        value=lambda growth: growth.max("drive"),
        each="loop_of",
        at_most=0.0,
    )

    @check(title="gain", at_most=RICCATI_RESIDUAL)
    def optimal(self, answer: Dataset) -> float:
        """relative difference of the gain from that of its own closed loop's cost"""
        law = StateFeedback(self.axis, ROTATION, float(answer["weight"]))
        off = abs((law.gain - answer["gain"].values) * law.scale).max()
        return max(law.residual, float(off / abs(law.gain * law.scale).max()))

    @check(title="bandwidth", at_most=SAME_CROSSOVER)
    def same(self, answer: Dataset) -> float:
        """relative difference of the crossover with known states from the reference loop's"""
        law = StateFeedback(self.axis, ROTATION, float(answer["weight"]))
        return abs(crossover(law.target) / self.reference_crossover - 1.0)

    kept = check(
        title="kept",
        statement="share of draws in which B loses focus or track at a defect of 1.2 mm",
        value=lambda events: share_of_draws((events > 0).sel(length=LENGTHS[0], case="B")),
        at_most=1.0 - CLAIM_SHARE,
    )

    # --- what is told -------------------------------------------------------------------------

    def below(self, answer: Dataset, name: str, other: str) -> DataArray:
        """Share of draws in which an excursion is smaller than in another case, by length."""
        one, two = (answer["excursion"].sel(case=each) for each in (name, other))
        return share_of_draws(one < two, "length")

    @metric
    def told(self, answer: Dataset) -> dict[str, float]:
        """Margins of the worst drive, excursions, and shares of draws with the smaller
        excursion.
        """
        found = {"weight": float(answer["weight"])}
        for name in LOOPS:
            one, key = answer.sel(loop_of=name), name.replace(" ", "_")
            found[f"gain_margin_{key}_db"] = float(one["gain_margin"].min())
            found[f"phase_margin_{key}_deg"] = float(one["phase_margin"].min())
            found[f"crossover_{key}_hz"] = float(one["crossover"].sel(drive="nominal"))
            found[f"growth_{key}"] = float(one["growth"].max())
        for length in LENGTHS:
            mm = f"{1e3 * length:.1f}mm"
            for name in CASES:
                key = f"{name.replace(' ', '_')}_{mm}"
                at = {"length": length, "case": name}
                for kind in ("excursion", "periodic"):
                    summary = draws_summary(answer[kind].sel(at), "drive")
                    for which in summary["summary"].values:
                        found[f"{kind}_{key}_{which}"] = float(summary.sel(summary=which))
                found[f"lost_{key}"] = float((answer["events"].sel(at) > 0).mean())
            for other in CASES[:-1]:
                share = self.below(answer, FEEDBACK, other).sel(length=length)
                found[f"below_{other}_{mm}"] = float(share)
        return found

    @table
    def compared(self, answer: Dataset) -> dict[str, str]:
        """Loops, and excursions by length."""
        loops = [
            [
                name,
                *(f"{float(answer[kind].sel(loop_of=name).min()):.1f}" for kind in _MARGINS),
                f"{float(answer['crossover'].sel(loop_of=name, drive='nominal')):.0f}",
                f"{float(answer['growth'].sel(loop_of=name).max()):.1f}",
            ]
            for name in LOOPS
        ]
        heads = ["loop", "gain margin [dB]", "phase margin [deg]", "crossover, nominal [Hz]"]
        rows = []
        for length in LENGTHS:
            for name in CASES:
                at = {"length": length, "case": name}
                cells = [
                    interval_text(draws_summary(1e6 * answer[kind].sel(at), "drive"))
                    for kind in ("excursion", "periodic")
                ]
                lost = f"{float((answer['events'].sel(at) > 0).mean()):.0%}"
                below = ["", ""]
                if name == FEEDBACK:
                    share = float(self.below(answer, FEEDBACK, "B").sel(length=length))
                    below = [f"{share:.0%}", verdict_of_share(share)]
                rows.append([f"{1e3 * length:.1f}", name, *cells, lost, *below])
        columns = ["scratch [mm]", "strategy", "excursion [um]", "periodic error [um]", "lost"]
        return {
            "loops": markdown_table([*heads, "slowest motion [1/s]"], loops),
            "experiments": markdown_table([*columns, "below B", "claim"], rows),
        }

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {"loops": _loops(answer, self.axis), "excursions": _excursions(answer, self.axis)}


_MARGINS = ("gain_margin", "phase_margin")


def _growth(open_loop: StateSpace) -> float:
    """Growth rate [1/s] of the slowest mode of a loop closed with negative feedback."""
    back = 1.0 + open_loop.D[0, 0]
    closed = open_loop.A - open_loop.B @ open_loop.C / back
    return float(np.log(abs(np.linalg.eigvals(closed)).max()) / PERIOD)


def _loops(answer: Dataset, axis: Axis) -> Figure:
    drawn, (gain, phase) = figures.axes(2, 1, size=(7.4, 6.4), sharex=True)
    frequency = answer["frequency"].values
    for name in LOOPS:
        one = answer.sel(loop_of=name)
        L = one["L_real"].values + 1j * one["L_imag"].values
        colour = SHADES["reference" if name == "K" else name]
        gain.plot(frequency, 20 * np.log10(abs(L)), color=colour, label=name)
        phase.plot(frequency, figures.phase(L), color=colour)
    gain.axhline(0.0, color="0.5", linewidth=0.8)
    figures.label(gain, y="gain [dB]", title=f"Open {axis} loops, nominal drive", log="x")
    figures.label(phase, x="frequency [Hz]", y="phase [deg]", log="x")
    figures.legend_below(drawn, gain)
    return drawn


def _excursions(answer: Dataset, axis: Axis) -> Figure:
    drawn, panels = figures.axes(len(LENGTHS), 1, size=(8.4, 6.4), sharex=True)
    for panel, length in zip(panels, LENGTHS, strict=True):
        for k, name in enumerate(CASES):
            one = draws_summary(1e6 * answer["excursion"].sel(length=length, case=name))
            mean, low, high = one.transpose("summary", "drive").values
            places = np.arange(answer.sizes["drive"]) + 0.15 * (k - 1)
            panel.vlines(places, low, high, color=SHADES[name], linewidth=1.2)
            panel.plot(places, mean, "os^"[k], color=SHADES[name], label=name, markersize=4)
        limit = 1e6 * ACCEPTABLE_ERROR[axis]
        panel.axhline(limit, color="0.4", linestyle="--", linewidth=0.9, label="allowed (Red Book)")
        title = f"{axis}, scratch of {1e3 * length:.1f} mm: mean and 90 % of the draws"
        figures.label(panel, x="", y=r"excursion [$\mu$m]", title=title, log="y")
    panels[-1].set_xticks(range(answer.sizes["drive"]), answer["drive"].values)
    figures.label(panels[-1], x="drive")
    figures.legend_below(drawn, panels[0], columns=4)
    return drawn

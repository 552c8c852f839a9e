"""A fast and a slow controller, switched by the quality signal, against each of them alone.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.executor import Context
from workbench.simulation import (
    Cascade,
    Part,
    balloon_size,
    bootstrap_weights,
    group_means,
    linear_controller,
    percentile_interval,
)
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.synthesis import discretise
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import MEASUREMENTS, Laboratory
from ..ensemble import GROUPS, Circumstance, circumstances, groups
from ..playability.runs import (
    SCORE_UNITS,
    SCORES,
    chosen,
    evaluated,
    met,
    sampled_controller,
    scored,
)
from ..playability.search import LARGEST_SENSITIVITY, peak_sensitivity
from ..tactics import Strategies, clean_level

CASES = ("fast", "slow", "switched")
"""Controllers that are compared: each alone, and both switched."""


@problem(
    "cd/{axis}/two-controllers-switched",
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"lower": ref(f"cd/{axis}/lower-bandwidth")},
    data=(*TABLES, "data/red_book.csv"),
)
def two_controllers_switched(
    axis: Axis,
    lower: Run,
    fast_db: Annotated[float, Field(ge=-20, le=6)] = 2.0,
    scenarios: Annotated[int, Field(ge=7, le=100_000)] = 42,
    drives: Annotated[int, Field(ge=1, le=12)] = 3,
    workers: Annotated[int, Field(ge=1, le=256)] = 2,
) -> SwitchedPair:
    """A fast and a slow controller switched by the quality signal, against each alone.

    A high bandwidth resists shocks, a low one surface defects (section 2.5.1). The fast controller
    is the reference one with another gain, the slow one K' of `cd/<axis>/lower-bandwidth`. Alone,
    each gets the measured error of the diodes. Switched, the slow one gives the command while the
    quality is bad, and each follows the other's command while it is not in charge. The ensemble is
    that of `cd/playability`.

    fast_db: gain over the reference controller's [dB]. scenarios: number of circumstances, 7 kinds
    in turn. drives: how many of the twelve. workers: number of threads; the answer does not depend
    on it.
    """
    slow = discretise(lower.answer.K, PERIOD)
    return SwitchedPair(axis, fast_db, slow, scenarios, chosen(drives), workers)


@dataclass(frozen=True, eq=False)
class ControllerPair:
    """Three ways to use two controllers on several drives, as a task for an executor."""

    fast: StateSpace
    slow: StateSpace
    drives: tuple[str, ...]
    duration: float = 1.0

    def cascade(self, case: str, one: Circumstance, level: float) -> Cascade:
        """Controller of one of CASES; ``level`` [V] is that of a clean disc."""
        fast, slow = (10.0 ** (one.gain_db / 20.0) * K for K in (self.fast, self.slow))
        if case == "switched":
            made = Strategies(one.axis, level, one.believed, K=fast, replacement=slow)
            return made.named("K_prime")
        alone = linear_controller(fast if case == "fast" else slow, PERIOD)
        return Cascade(MEASUREMENTS, [Part("K", alone, ["f_en"], outputs=["u"])])

    def error(self, case: str, one: Circumstance, drive: str, refine: int = 1) -> RealArray:
        """True error [m] (N,) in the scored part of a run."""
        bench = Laboratory(one.axis, drive, refine=refine)
        record = bench.closed_loop(
            self.cascade(case, one, clean_level(bench, one.disc.reflectivity)),
            one.excitation(bench, self.duration),
            disc=one.disc,
            defects=one.defects,
            seed=one.noise_seed(drive),
        )
        return evaluated(record)

    def __call__(self, one: Circumstance) -> RealArray:
        """Scores (drives, CASES, SCORES)."""
        return np.array(
            [
                [scored(self.error(case, one, drive), one.axis) for case in CASES]
                for drive in self.drives
            ]
        )


@dataclass(frozen=True, eq=False)
class SwitchedPair(Study):
    """Each controller alone and both switched, in the same circumstances."""

    axis: Axis
    fast_db: float
    slow: StateSpace
    scenarios: int
    drives: tuple[str, ...]
    workers: int

    headline: ClassVar[str] = "balloon_switched"

    @property
    def quantifier(self) -> str:
        return f"for {len(self.drives)} drives, in {self.scenarios} simulated scenarios of each"

    @property
    def pair(self) -> ControllerPair:
        return ControllerPair(sampled_controller(self.axis, self.fast_db), self.slow, self.drives)

    def drawn(self, seed: int) -> list[Circumstance]:
        """The circumstances drawn with a seed."""
        rng = np.random.default_rng([seed, 0])
        return circumstances(self.axis, self.scenarios, self.pair.duration, rng)

    case = dim(CASES)
    drive = dim(lambda self: self.drives)
    group = dim(GROUPS)
    end = dim("low", "high")

    seed = array(dims=(), value=lambda context: int(context.rng.integers(2**31)))
    many = part(lambda self, seed: self.drawn(int(seed)))

    @arrays((case, drive, "circumstance"), **SCORE_UNITS)
    def scores(self, many: list[Circumstance], context: Context) -> dict[str, Any]:
        every = met(self.pair, many, self.workers, context.progress, "circumstances")
        return {name: every[..., n] for n, name in enumerate(SCORES)}

    @part
    def samples(self, out: DataArray, many: list[Circumstance], seed: DataArray) -> Any:
        """Arms of the balloons (cases, groups), and their bootstrap samples."""
        mean, group = out.values.mean(axis=1), groups(many)
        rng = np.random.default_rng([int(seed), 1])
        weight = bootstrap_weights(group, rng)
        return group_means(mean, group), group_means(mean, group, weight=weight)

    arm = array(dims=(case, group), value=lambda samples: samples[0])
    arm_interval = array(
        dims=(end, case, group),
        value=lambda samples: percentile_interval(np.moveaxis(samples[1], 1, -1)),
    )
    sizes = part(lambda samples: tuple(map(balloon_size, samples)))
    balloon = array(dims=case, value=lambda sizes: sizes[0])
    balloon_interval = array(dims=(end, case), value=lambda sizes: percentile_interval(sizes[1]))
    gains = part(lambda sizes: [one[-1] - one for one in sizes])
    gained = array(
        dims=case, unit="", meaning="switched less this one", value=lambda gains: gains[0]
    )
    gained_interval = array(dims=(end, case), value=lambda gains: percentile_interval(gains[1]))

    # --- checks -------------------------------------------------------------------------------

    fast_loop = check(
        title="fast loop",
        statement="largest |S| of the twelve drives",
        value=lambda self: peak_sensitivity(self.axis, self.pair.fast),
        at_most=LARGEST_SENSITIVITY,
    )
    slow_loop = check(
        title="slow loop",
        statement="largest |S| of the twelve drives",
        value=lambda self: peak_sensitivity(self.axis, self.slow),
        at_most=lambda self: CAPTURE[self.axis] / ACCEPTABLE_ERROR[self.axis] * LARGEST_SENSITIVITY,
    )

    @check(title="replay", at_most=0.02)
    def replayed(self, answer: Dataset) -> float:
        """relative change of the rms error at half the step"""
        one, worst = self.drawn(int(answer["seed"]))[0], 0.0
        for case in CASES:
            first = answer.sel(case=case).isel(drive=0, circumstance=0)
            if not float(first["losses"]):  # a lost loop is chaotic
                rms = scored(self.pair.error(case, one, self.drives[0], 2), self.axis)[-1]
                worst = max(worst, abs(rms / float(first["deviation"]) - 1.0))
        return worst

    @check(title="arms", at_most=1e-9)
    def means(self, out: DataArray, arm: DataArray) -> float:
        """largest difference of a share out of spec from the mean of the stored runs [1]"""
        every = [out.isel(circumstance=slice(n, None, len(GROUPS))) for n in range(len(GROUPS))]
        means = [one.mean(["drive", "circumstance"]) for one in every]
        return float(abs(np.transpose(means) - arm).max())

    # --- what is told -------------------------------------------------------------------------

    sizes_of_balloons = metric("balloon_{case}", value=lambda balloon: balloon)
    in_spec = metric(
        template=lambda out: {
            f"in_spec_{case}": 1.0 - float(out.sel(case=case).mean()) for case in CASES
        }
    )
    lost = metric(
        template="lost_{case}", value=lambda losses: (losses > 0).mean(["drive", "circumstance"])
    )
    switched_less = metric(
        template="switched_less_{case}", value=lambda gained: gained.sel(case=["fast", "slow"])
    )
    less_interval = metric(
        template="switched_less_{case}_{end}",
        value=lambda gained_interval: gained_interval.sel(case=["fast", "slow"]),
    )

    @table
    def switched(self, answer: Dataset) -> Any:
        """Scores of each case, and the improvement of switching over it."""
        numbers, rows = self.metrics(answer), []
        for case in CASES:
            shares = f"{numbers[f'in_spec_{case}']:.2%}", f"{numbers[f'lost_{case}']:.1%}"
            low, high = answer["gained_interval"].sel(case=case).values
            gain = f"{float(answer['gained'].sel(case=case)):+.3f} ({low:+.3f} to {high:+.3f})"
            own = "" if case == "switched" else gain
            rows.append([case, *shares, f"{numbers[f'balloon_{case}']:.3f}", own])
        return ["controller", "in spec", "lost", "balloon", "switched less this one, 95 %"], rows

    @figure
    def out_of_spec(self, arm: DataArray, arm_interval: DataArray) -> dict[str, Figure]:
        """Time out of spec of each case, by cause."""
        drawn, (panel,) = figures.axes(1, 1, size=(8.0, 4.4))
        place = np.arange(len(GROUPS))
        for n, case in enumerate(CASES):
            share = 100 * arm.sel(case=case).values
            low, high = 100 * arm_interval.sel(case=case).values
            look: Any = {"yerr": np.maximum([share - low, high - share], 0.0), "capsize": 2}
            beside = place + 0.27 * (n - 1)
            panel.bar(beside, share, 0.25, color=figures.CYCLE[n], label=case, **look)
        panel.set_xticks(place, GROUPS, rotation=25, ha="right")
        panel.set_yscale("symlog", linthresh=0.1, linscale=0.4)
        panel.set_ylim(bottom=0.0)
        figures.label(panel, y="time out of spec, 95 % interval [%]", title=self.axis)
        figures.legend_below(drawn, panel)
        return {"switched": drawn}

"""A fast and a slow controller switched by the quality signal, against each of them alone.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.simulation import Cascade, Part, linear
from workbench.systems.storage import restored

from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import MEASUREMENTS, Laboratory
from ..balloon import BOOTSTRAP, arms, interval, resampled, size
from ..ensemble import GROUPS, Circumstance, circumstances, groups
from ..playability.runs import SCORES, chosen, evaluated, met, sampled_controller, scored
from ..playability.search import LARGEST, peak_sensitivity
from ..tactics import Strategies, clean_level
from .report import figures_of, tables_of

CASES = ("fast", "slow", "switched")


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
    each sees what the diodes say; switched, the slow one has the command while the quality is bad,
    and each follows the other's while it has none. The ensemble is that of `cd/playability`.

    fast_db: gain over the reference controller's [dB]. scenarios: circumstances, 7 kinds in turn.
    drives: how many of the twelve. workers: threads; the answer is the same with any.
    """
    slow = restored(lower.data, "sampled")
    return SwitchedPair(axis, fast_db, slow, scenarios, chosen(drives), workers)


@dataclass(frozen=True, eq=False)
class Pair:
    """Three ways to use two controllers, on several drives: a task for an executor."""

    fast: StateSpace
    slow: StateSpace
    drives: tuple[str, ...]
    duration: float = 1.0

    def cascade(self, case: str, one: Circumstance, level: float) -> Cascade:
        """One of CASES for a clean disc's level [V]."""
        fast, slow = (10.0 ** (one.gain_db / 20.0) * K for K in (self.fast, self.slow))
        if case == "switched":
            made = Strategies(one.axis, level, one.believed, K=fast, replacement=slow)
            return made.named("K_prime")
        alone = linear(fast if case == "fast" else slow, PERIOD)
        return Cascade(MEASUREMENTS, [Part("K", alone, ["f_en"], ["u"])])

    def error(self, case: str, one: Circumstance, drive: str, refine: int = 1) -> RealArray:
        """True error [m] of a run, from when it is scored."""
        bench = Laboratory(one.axis, drive, refine=refine)
        record = bench.closed_loop(
            self.cascade(case, one, clean_level(bench, one.disc.reflectivity)),
            one.excitation(bench, self.duration),
            disc=one.disc,
            defects=one.defects,
            seed=one.seed,
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
    """Each controller alone and both switched, through the same circumstances."""

    axis: Axis
    fast_db: float
    slow: StateSpace
    scenarios: int
    drives: tuple[str, ...]
    workers: int

    headline: ClassVar[str] = "balloon_switched"

    @property
    def pair(self) -> Pair:
        return Pair(sampled_controller(self.axis, self.fast_db), self.slow, self.drives)

    def drawn(self, seed: int) -> list[Circumstance]:
        rng = np.random.default_rng([seed, 0])
        return circumstances(self.axis, self.scenarios, self.pair.duration, rng)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        seed = int(context.rng.integers(2**31))
        many = self.drawn(seed)
        every = met(self.pair, many, self.workers, context.progress, "circumstances")
        group = groups(many)
        weight = resampled(group, BOOTSTRAP, np.random.default_rng([seed, 1]))
        out = every[..., 0].mean(axis=1)
        arm, again = arms(out, group), arms(out, group, weight)
        sizes, samples = size(arm), size(again)
        dims = ("case", "drive", "circumstance")
        units = ("1", "1", "m", "m")
        return xr.Dataset(
            {
                **{
                    name: (dims, every[..., n], {"units": units[n]})
                    for n, name in enumerate(SCORES)
                },
                "arm": (("case", "group"), arm),
                "arm_interval": (("end", "case", "group"), interval(np.moveaxis(again, 1, -1))),
                "balloon": ("case", sizes),
                "balloon_interval": (("end", "case"), interval(samples)),
                "gained": ("case", sizes[-1] - sizes, {"long_name": "switched less this one"}),
                "gained_interval": (("end", "case"), interval(samples[-1] - samples)),
                "seed": seed,
            },
            coords={
                "case": list(CASES),
                "drive": list(self.drives),
                "group": list(GROUPS),
                "end": ["low", "high"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        fast, slow = (peak_sensitivity(self.axis, K) for K in (self.pair.fast, self.slow))
        relaxed = CAPTURE[self.axis] / ACCEPTABLE_ERROR[self.axis]
        one = self.drawn(int(answer["seed"]))[0]
        first = answer.isel(drive=0, circumstance=0)
        kept = [case for case in CASES if not float(first["losses"].sel(case=case))]
        rms = [
            scored(self.pair.error(case, one, self.drives[0], 2), self.axis)[-1] for case in kept
        ]
        off = abs(np.array(rms) / first["deviation"].sel(case=kept).values - 1.0).max(initial=0.0)
        every = [slice(n, None, len(GROUPS)) for n in range(len(GROUPS))]
        means = [
            answer["out"].isel(circumstance=own).mean(["drive", "circumstance"]) for own in every
        ]
        apart = max(
            float(abs(mean - answer["arm"].isel(group=n)).max()) for n, mean in enumerate(means)
        )
        return [
            Check("fast loop", "largest |S| of the twelve drives", fast, LARGEST),
            Check("slow loop", "largest |S| of the twelve drives", slow, relaxed * LARGEST),
            Check("replay", "relative change of the rms error at half the step", float(off), 0.02),
            Check("arms", "off the mean of the stored runs", apart, 1e-9),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers: dict[str, float] = {}
        for case in CASES:
            own = answer.sel(case=case)
            numbers |= {
                f"balloon_{case}": float(own["balloon"]),
                f"in_spec_{case}": 1.0 - float(own["out"].mean()),
                f"lost_{case}": float((own["losses"] > 0).mean()),
                f"switched_less_{case}": float(own["gained"]),
                f"switched_less_{case}_low": float(own["gained_interval"].sel(end="low")),
                f"switched_less_{case}_high": float(own["gained_interval"].sel(end="high")),
            }
        return {key: value for key, value in numbers.items() if "less_switched" not in key}

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer, self.metrics(answer))

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis)

"""Additional gain that immunity against defects permits, and its benefit in shocks (section 9.1).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.simulation import bootstrap_weights, percentile_interval
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    markdown_table,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ..diagnosis.defect_kinds import KINDS
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from .best_gains.cases import Case, Cases
from .ensemble import GROUPS, Circumstance, circumstances
from .playability.runs import chosen, met, sampled_controller, scored
from .playability.search import peak_sensitivity
from .strategy_looks import COLOURS

Name = Literal["reference", "A", "B", "C"]
STRATEGIES: tuple[Name, ...] = get_args(Name)
"""Strategies whose gain is raised."""
GAINS = (0.0, 2.0, 4.0, 6.0, 8.0)
"""Gains of the controller over the reference controller's [dB]."""
CAUSES = ("shocks", "defects")
"""Circumstances with one cause each: shocks, or defects of any one kind."""


@problem("cd/{axis}/immunity", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def immunity(
    axis: Axis,
    scenarios: Annotated[int, Field(ge=14, le=100_000)] = 42,
    drives: Annotated[int, Field(ge=1, le=12)] = 2,
    workers: Annotated[int, Field(ge=1, le=256)] = 2,
) -> Immunity:
    """How much more gain immunity against defects allows, and what shocks gain by it (section 9.1).

    The reference strategy, A, B and C are run at gains of up to 8 dB more, in those circumstances
    of `cd/playability` that contain only shocks or only defects of one kind. A strategy's gain may
    be raised until defects cost it as much time out of spec as they cost the reference strategy at
    its own gain. Its time out of spec in shocks at that gain is compared with that at its own gain.
    Intervals of 95 % are bootstrapped over the circumstances. The largest sensitivity of the twelve
    drives is given for each gain, since it is another limit.

    scenarios: number of circumstances of all 7 kinds in turn, of which 5 kinds are run. drives: how
    many of the twelve. workers: number of threads; the answer does not depend on it.
    """
    cases = Cases(sampled_controller(axis), chosen(drives))
    return Immunity(axis, cases, scenarios, workers)


@dataclass(frozen=True, eq=False)
class Immunity(Study):
    """Every strategy at every gain in the same circumstances."""

    axis: Axis
    cases: Cases
    scenarios: int
    workers: int

    headline: ClassVar[str] = "gain_A_found"

    @property
    def quantifier(self) -> str:
        return f"for {len(self.cases.drives)} drives, in the simulated circumstances"

    strategy, gain, cause = dim(STRATEGIES), dim(GAINS, unit="dB"), dim(CAUSES)
    told = dim("found", "low", "high")

    @part
    def many(self, context: Context) -> list[Circumstance]:
        """Circumstances with shocks only, and with one kind of defect only."""
        rng = np.random.default_rng(context.rng.integers(2**31))
        every = circumstances(self.axis, self.scenarios, self.cases.duration, rng)
        return [one for one in every if one.group == "shocks" or one.group in KINDS]

    group = array(dims="circumstance", value=lambda many: [GROUPS.index(one.group) for one in many])

    @array(
        dims=(strategy, gain, "circumstance"),
        unit="1",
        meaning="share of time out of spec, mean over drives",
    )
    def outside(self, many: list[Circumstance], context: Context) -> RealArray:
        def scores(one: Circumstance) -> RealArray:
            played = [Case(name, gain) for name in STRATEGIES for gain in GAINS]
            return np.array(
                [
                    [scored(self.cases.error(case, one, drive), self.axis) for case in played]
                    for drive in self.cases.drives
                ]
            )

        found = met(scores, many, self.workers, context.progress, "circumstances")
        mean = found[..., 0].mean(axis=1)
        return mean.reshape(len(STRATEGIES), len(GAINS), len(many))

    @part
    def weight(self, group: DataArray, context: Context) -> RealArray:
        """Weights (1 + samples, circumstances): first all equal, then bootstrapped within each
        kind.
        """
        numbers: NDArray[np.int64] = np.unique(group.values, return_inverse=True)[1]
        drawn = bootstrap_weights(numbers, context.rng)
        return np.vstack([np.ones((1, len(numbers))), drawn])

    @part
    def costs(self, outside: DataArray, group: DataArray, weight: RealArray) -> RealArray:
        """Mean time out of spec (samples, causes, strategies, gains)."""
        shocks = group.values == GROUPS.index("shocks")
        found = []
        for part_of in (shocks, ~shocks):
            share = weight[:, part_of]
            share = share / share.sum(axis=1, keepdims=True)
            found.append(np.einsum("wc,sgc->wsg", share, outside.values[..., part_of]))
        return np.stack(found, axis=1)

    @array(dims=(told, cause, strategy, gain), unit="1", meaning="mean time out of spec, with 95 %")
    def cost(self, costs: RealArray) -> RealArray:
        return _told(costs)

    @arrays(
        (told, strategy),
        allowed=("dB", "gain at which defects cost what they cost the reference strategy"),
        shocks=("1", "time out of spec in shocks at that gain over that at the strategy's own"),
    )
    def raised(self, costs: RealArray) -> dict[str, RealArray]:
        shape = costs.shape[0], len(STRATEGIES)
        gains, shocks = np.zeros(shape), np.full(shape, np.nan)
        for sample, one in np.ndindex(shape):
            in_shocks, in_defects = costs[sample, :, one]
            gains[sample, one] = _crossing(in_defects, costs[sample, 1, 0, 0])
            if in_shocks[0] > 0.0:
                there = np.interp(gains[sample, one], GAINS, in_shocks)
                shocks[sample, one] = there / in_shocks[0]
        return {"allowed": _told(gains), "shocks": _told(shocks)}

    sensitivity = array(
        dims=gain,
        unit="1",
        meaning="largest |S| of the twelve drives",
        value=lambda self: [
            peak_sensitivity(self.axis, sampled_controller(self.axis, g)) for g in GAINS
        ],
    )

    # --- checks and what is told --------------------------------------------------------------

    @check(title="shares", at_most=1.0)
    def shares(self, outside: DataArray) -> float:
        """largest share of time"""
        return float(outside.max())

    @check(title="sensitivity", at_most=1e-6)
    def again(self, sensitivity: DataArray) -> float:
        """relative difference of the largest |S| at the controller's own gain, computed again"""
        own = peak_sensitivity(self.axis, sampled_controller(self.axis, GAINS[0]))
        return abs(float(sensitivity.sel(gain=GAINS[0])) / own - 1.0)

    gains = metric("gain_{strategy}_{told}", value=lambda allowed: allowed)
    in_shocks = metric("shocks_{strategy}_{told}", value=lambda shocks: shocks)
    sensitivities = metric(
        template=lambda sensitivity: {
            f"sensitivity_{one:g}_db": float(sensitivity.sel(gain=one)) for one in GAINS
        }
    )

    @table
    def compared(self, answer: Dataset) -> dict[str, str]:
        """Gain that defects permit, and cost of shocks there."""
        rows = []
        for name in STRATEGIES:
            one = answer.sel(strategy=name)
            cost = one["cost"].sel(told="found")
            cells = [
                f"{100 * float(cost.sel(cause=cause, gain=gain)):.2f}"
                for cause in CAUSES
                for gain in (GAINS[0], GAINS[-1])
            ]
            rows.append(
                [name, *(_cell(one[kind].values) for kind in ("allowed", "shocks")), *cells]
            )
        heads = [
            "strategy",
            f"gain allowed by defects, to {GAINS[-1]:g} [dB]",
            "shocks there / own",
        ]
        heads += [f"{cause} at {gain:g} dB [%]" for cause in CAUSES for gain in (0.0, GAINS[-1])]
        return {"immunity": markdown_table(heads, rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn, panels = figures.axes(1, 2, size=(9.5, 4.4), sharex=True)
        for panel, cause in zip(panels, CAUSES, strict=True):
            for n, name in enumerate(STRATEGIES):
                one = 100 * answer["cost"].sel(cause=cause, strategy=name)
                mean, low, high = one.transpose("told", "gain").values
                look: Any = {"color": COLOURS[name], "capsize": 2, "marker": "o", "markersize": 3}
                place = answer["gain"].values + 0.12 * (n - 1.5)
                panel.errorbar(place, mean, [mean - low, high - mean], label=name, **look)
            panel.set_yscale("symlog", linthresh=0.1, linscale=0.4)
            panel.set_ylim(bottom=0.0)
            figures.label(panel, x="gain over the reference controller's [dB]", title=cause)
        figures.label(panels[0], y=f"{self.axis}: time out of spec [%]")
        figures.legend_below(drawn, panels[0], columns=4)
        return {"immunity": drawn}


def _crossing(cost: RealArray, limit: float) -> float:
    """Largest gain [dB] up to which a cost is at or below a limit; linear between gains."""
    above = np.flatnonzero(cost > limit)
    if not len(above):
        return GAINS[-1]
    first = int(above[0])
    if first == 0:
        return GAINS[0]
    before, after = cost[first - 1], cost[first]
    share = (limit - before) / (after - before)
    return float(GAINS[first - 1] + share * (GAINS[first] - GAINS[first - 1]))


def _told(samples: RealArray) -> RealArray:
    """Value found, low and high end (3, ...) of samples (1 + S, ...), of which the first is the
    value found.

    Samples without a value are not counted.
    """
    filled = np.where(np.isnan(samples), samples[:1], samples)
    return np.concatenate([samples[:1], percentile_interval(np.moveaxis(filled[1:], 0, -1))])


def _cell(told: RealArray) -> str:
    found, low, high = told
    return f"{found:.2f} ({low:.2f} to {high:.2f})"

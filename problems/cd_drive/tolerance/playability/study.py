"""The ensemble of `cd/playability`: every strategy, and a tuned one, scored and resampled.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from workbench import Check, Study
from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace

from ...drive.red_book import AXES
from ...drive.tables import Axis
from ..balloon import BOOTSTRAP, LEVEL, arms, interval, resampled, size
from ..ensemble import GROUPS, Circumstance, circumstances, groups
from .checks import checks_of
from .report import figures_of, numbers_of, tables_of
from .runs import SCORES, Design, Player, evaluated, met, played, sampled_controller
from .search import LARGEST, PARAMETERS, Search, peak_sensitivity

UNITS = {"out": "1", "losses": "1", "burst": "m", "deviation": "m"}


@dataclass(frozen=True, eq=False)
class Playability(Study):
    """Every strategy, and the tuned one, through the same circumstances on the same drives."""

    replacements: Mapping[Axis, StateSpace]
    scenarios: int
    drives: tuple[str, ...]
    strategies: tuple[str, ...]
    tuned: str
    training: int
    trials: int
    duration: float
    workers: int

    headline: ClassVar[str] = "in_spec_focus_reference"

    def __post_init__(self) -> None:
        if self.tuned not in self.strategies:
            raise InputError(
                f"tuned is {self.tuned!r}; it must be one of {', '.join(self.strategies)}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.strategies, "tuned")

    @property
    def split(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Drives that are trained on, and the others; one drive alone is both."""
        return self.drives[::2], self.drives[1::2] or self.drives

    def design(self, axis: Axis, name: str) -> Design:
        """A strategy as it is before it is tuned."""
        return Design(name, replacement=self.replacements[axis])

    def drawn(self, axis: Axis, part: str, seed: int) -> list[Circumstance]:
        """The circumstances of a part, "training" or "held-out": no seed is in both."""
        number = 2 * AXES.index(axis) + ("training", "held-out").index(part)
        rng = np.random.default_rng([seed, number])
        count = self.training if part == "training" else self.scenarios
        return circumstances(axis, count, self.duration, rng)

    def scores(
        self,
        context: Context,
        designs: tuple[Design, ...],
        drives: tuple[str, ...],
        many: list[Circumstance],
        what: str,
    ) -> RealArray:
        """SCORES of designs: (designs, drives, circumstances, SCORES)."""
        player = Player(designs, drives, self.duration)
        return met(player, many, self.workers, context.progress, what)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        seed = int(context.rng.integers(2**31))
        every, best, tried, values, traces = [], [], [], [], []
        for axis in AXES:
            training = self.drawn(axis, "training", seed)

            def cost(
                design: Design, axis: Axis = axis, many: list[Circumstance] = training
            ) -> float:
                peak = peak_sensitivity(axis, sampled_controller(axis, design.gain_db))
                if peak > LARGEST:
                    return 1.0 + peak - LARGEST  # worse than any balloon
                found = self.scores(context, (design,), self.split[0], many, f"tuning {axis}")
                return float(size(arms(found[0, ..., 0].mean(axis=0), groups(many))))

            search = Search(self.design(axis, self.tuned), cost, self.trials)
            found, points, costs = search.run()
            best.append([getattr(found, name) for name in PARAMETERS])
            tried.append(points)
            values.append(costs)
            held_out = self.drawn(axis, "held-out", seed)
            designs = (*(self.design(axis, name) for name in self.strategies), found)
            every.append(self.scores(context, designs, self.drives, held_out, f"ensemble {axis}"))
            traces.append(
                evaluated(played(held_out[-1], self.drives[0], designs[0], self.duration))
            )
        scored_runs = np.array(every, np.float32)
        dims = ("axis", "strategy", "drive", "circumstance")
        rng = np.random.default_rng([seed, 99])
        group = groups(self.drawn("focus", "held-out", seed))
        weight = resampled(group, BOOTSTRAP, rng)
        data = {
            name: (dims, scored_runs[..., n], {"units": UNITS[name]})
            for n, name in enumerate(SCORES)
        }
        return xr.Dataset(
            {
                **data,
                **self._balloon(np.array(every)[..., 0], group, weight),
                "best": (("axis", "parameter"), best),
                "peak": (
                    "axis",
                    [
                        peak_sensitivity(axis, sampled_controller(axis, one[0]))
                        for axis, one in zip(AXES, best, strict=True)
                    ],
                    {"long_name": "largest |S| of the twelve drives with the tuned gain"},
                ),
                "tried": (("axis", "trial", "parameter"), tried),
                "cost": (
                    ("axis", "trial"),
                    values,
                    {"long_name": "size of the balloon on training discs"},
                ),
                "trace": (
                    ("axis", "sample"),
                    np.array(traces, np.float32),
                    {"units": "m", "long_name": "true error of the last scenario"},
                ),
                "seed": seed,
            },
            coords={
                "axis": list(AXES),
                "strategy": list(self.names),
                "drive": list(self.drives),
                "group": list(GROUPS),
                "parameter": list(PARAMETERS),
                "end": ["low", "high"],
            },
        )

    def _balloon(self, out: RealArray, group: np.ndarray, weight: RealArray) -> dict[str, object]:
        """Arms and sizes with their intervals, and the tuned strategy's differences."""
        arm, again = (arms(out.mean(axis=2), group, w) for w in (None, weight))
        fresh = [self.drives.index(name) for name in self.split[1]]
        base = self.strategies.index(self.tuned)
        # What is held out for tuning: discs and drives that it has not seen.
        unseen = out[:, [base, -1]][:, :, fresh].mean(axis=2)
        pair, pairs = (arms(unseen, group, w) for w in (None, weight))
        gain = size(pair[:, 1]) - size(pair[:, 0])
        gains = size(pairs[:, 1]) - size(pairs[:, 0])
        share = (unseen[:, 1] - unseen[:, 0]).mean(axis=-1)
        shares = np.einsum("ac,wc->aw", unseen[:, 1] - unseen[:, 0], weight) / len(group)
        known = sorted(set(group.tolist()))
        return {
            "arm": (("axis", "strategy", "known"), arm[..., known]),
            "arm_interval": (
                ("end", "axis", "strategy", "known"),
                interval(np.moveaxis(again, 2, -1))[..., known],
            ),
            "balloon": (("axis", "strategy"), size(arm)),
            "balloon_interval": (("end", "axis", "strategy"), interval(size(again))),
            "known": ("known", [GROUPS[number] for number in known]),
            "gained": (
                ("axis", "measure"),
                np.transpose([gain, share]),
                {"long_name": "tuned less untuned, on discs and drives it was not tuned on"},
            ),
            "gained_interval": (
                ("end", "axis", "measure"),
                np.stack([interval(gains), interval(shares)], axis=-1),
            ),
            "measure": ("measure", ["balloon", "out"]),
        }

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        seed = int(answer["seed"])
        first = {axis: self.drawn(axis, "held-out", seed)[0] for axis in AXES}
        designs = {axis: [self.design(axis, name) for name in self.strategies] for axis in AXES}
        return checks_of(answer, first, self.duration, designs)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        return numbers_of(answer)

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer, self.metrics(answer), self.tuned, LEVEL)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.tuned)

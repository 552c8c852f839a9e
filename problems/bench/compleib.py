"""Fixed-order controllers for plants of COMPleib, against the best published norms."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Check, Options, problem, solve
from workbench.collections import read_plant
from workbench.errors import InputError, WorkbenchError
from workbench.executor import WALL_TIME, Context
from workbench.study import Study, array, check, dim, metric, part, table
from workbench.synthesis import HinfSynthesis
from workbench.types import Array, DataArray

from .compleib_cases import APKARIAN_NOLL, HIFOO, STABLE, TRAN_DINH, UNPUBLISHED, ZERO

Method = Literal["fixed", "bfgs", "smoothed", "evolution", "trust_region"]
Case = tuple[str, int, bool]
"""Name of a plant, order of its controller, and whether the controller must itself be stable."""

PUBLISHED: dict[Case, float] = {
    **{(name, 0, False): norm for name, norm in (TRAN_DINH | ZERO).items()},
    **{(name, order, False): norm for (name, order), norm in (APKARIAN_NOLL | HIFOO).items()},
}
"""Best norm of each case that was published or that HIFOO reached."""
CASES: tuple[Case, ...] = tuple(
    dict.fromkeys(
        (
            *PUBLISHED,
            *((name, order, False) for order, names in UNPUBLISHED.items() for name in names),
            *((name, order, True) for order, names in STABLE.items() for name in names),
        )
    )
)
"""All cases; those with a norm to compare with come first."""
NEAR, WITHIN, OF_ZERO = 5e-3, 5e-2, 1e-3
"""Relative excesses over the published norm that count as near, and the norm that counts as zero.
"""
NEAR_SHARE, WITHIN_SHARE = 0.8, 0.95
"""Shares of the cases that must be within these excesses."""


@problem("bench/compleib", slow=True)
def compleib(
    folder: str = "compleib",
    searches: tuple[Method, ...] = ("fixed",),
    seconds: Annotated[float, Field(gt=0)] = 60.0,
    cases: Annotated[int, Field(ge=1, le=len(CASES))] = len(CASES),
) -> Compleib:
    """Fixed-order H-infinity controllers for plants of COMPleib, against published norms.

    The cases were named before the first of them was run. The collection belongs to its author, so
    the study reads the user's own copy: MAT files AC1.mat and so on, with the matrices that
    COMPleib.m returns. If a file lacks the matrices of a channel, the case counts as having no
    plant.

    The norm and time of the controller of full order are shown besides. No open-source peer that
    installs from Python's index can fix the order or use several plants.

    folder: folder of the MAT files. searches: methods that are compared, with the same settings for
    all cases. seconds: time limit of each search [s]. cases: number of cases, from the first on.
    """
    return Compleib(folder, searches, seconds, cases)


@dataclass(frozen=True)
class Compleib(Study):
    """Norms by case and method, with the published norm and the lower bound for any order."""

    folder: str
    searches: tuple[str, ...]
    seconds: float
    cases: int

    headline: ClassVar[str] = "near_share"

    @property
    def quantifier(self) -> str:
        return "for these plants"

    @dim
    def case(self) -> list[str]:
        return [case_label(each) for each in CASES[: self.cases]]

    @dim
    def method(self) -> list[str]:
        return list(self.searches)

    @part
    def found(self, context: Context) -> Array:
        """Certified norm, lower bound for any order, and processor time [s] (case, method, 3)."""
        result = np.full((self.cases, len(self.searches), 3), np.nan)
        for place, each in enumerate(context.track(CASES[: self.cases], "cases")):
            for column, one in enumerate(self.searches):
                result[place, column] = self._norm_bound_and_time(each, one, context.options.seed)
        return result

    @part
    def of_full_order(self, context: Context) -> Array:
        """Certified norm of a controller of full order, and processor time [s] (case, 2)."""
        names = {name for name, _, _ in CASES[: self.cases]}
        found = {
            name: self._norm_bound_and_time((name, None, False), "riccati", context.options.seed)
            for name in context.track(sorted(names), "controllers of full order")
        }
        return np.array([[found[name][0], found[name][2]] for name, _, _ in CASES[: self.cases]])

    def _norm_bound_and_time(
        self, case: tuple[str, int | None, bool], method: str, seed: int
    ) -> tuple[float, float, float]:
        """Norm, lower bound and time [s]; NaN if there is no plant or no certified controller."""
        name, order, stable = case
        path = Path(self.folder) / f"{name}.mat"
        if not Path(self.folder).is_dir():
            raise InputError(
                f"{self.folder} is no folder: name the folder with your MAT files of COMPleib"
            )
        begun = time.process_time()
        try:
            program = HinfSynthesis(read_plant(path), order=order, stable=stable)
            solution = solve(
                program, method=method, options=Options(time_limit=self.seconds, seed=seed)
            )
        except WorkbenchError:
            return math.nan, math.nan, math.nan
        spent = time.process_time() - begun
        if solution.certificate is None or not solution.certificate.holds:
            return math.nan, math.nan, spent
        return solution.answer.norm, solution.answer.least, spent

    norm = array(
        dims=(case, method), unit="1", meaning="norm of the loop", value=lambda found: found[..., 0]
    )
    least = array(
        dims=case,
        unit="1",
        meaning="least norm of any order",
        value=lambda found: largest(found[..., 1]),
    )
    spent = array(
        dims=(case, method),
        unit="s",
        meaning="processor time",
        value=lambda found: found[..., 2],
        **WALL_TIME,
    )

    full = array(
        dims=case,
        unit="1",
        meaning="norm at full order",
        value=lambda of_full_order: of_full_order[:, 0],
    )
    full_spent = array(
        dims=case,
        unit="s",
        meaning="processor time at full order",
        value=lambda of_full_order: of_full_order[:, 1],
        **WALL_TIME,
    )

    @array(dims=case, unit="1")
    def published(self) -> Array:
        """Best norm that was published or that HIFOO reached; NaN where there is none."""
        return np.array([PUBLISHED.get(each, np.nan) for each in CASES[: self.cases]])

    @check()
    def as_good_as_published(self, norm: DataArray, published: DataArray) -> list[Check]:
        return [
            Check(
                f"{word} as published",
                f"share of cases that are not, by {self.searches[0]}",
                1.0 - share_near(norm, published, far),
                1.0 - wanted,
            )
            for word, far, wanted in (
                ("as good", NEAR, NEAR_SHARE),
                ("nearly as good", WITHIN, WITHIN_SHARE),
            )
        ]

    near_share = metric(
        template="near_share", value=lambda norm, published: share_near(norm, published, NEAR)
    )

    @table
    def norms(
        self,
        norm: DataArray,
        published: DataArray,
        least: DataArray,
        spent: DataArray,
        full: DataArray,
        full_spent: DataArray,
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for each in CASES[: self.cases]:
            at = {"case": case_label(each)}
            row = [
                case_label(each),
                *(f"{float(x.sel(at)):.5g}" for x in (published, least, full, full_spent)),
            ]
            for one in self.searches:
                row += [f"{float(x.sel(at | {'method': one})):.5g}" for x in (norm, spent)]
            rows.append(row)
        columns = [f"{one}{unit}" for one in self.searches for unit in ("", " [s]")]
        head = ["case", "published", "least of any order", "full order", "full order [s]"]
        return [*head, *columns], rows


def case_label(case: Case) -> str:
    """Description of a case in words."""
    name, order, stable = case
    return f"{name}, order {order}{', stable' if stable else ''}"


def largest(levels: Array) -> Array:
    """The largest lower bound of each row; NaN if none is known."""
    known = np.where(np.isnan(levels), -np.inf, levels).max(axis=1)
    return np.where(np.isfinite(known), known, np.nan)


def share_near(norm: DataArray, published: DataArray, far: float) -> float:
    """Share of the published cases in which the first method's norm exceeds the best by `far` at
    most.

    If the published norm is zero, the limit is absolute.
    """
    reached, best = np.asarray(norm)[:, 0], np.asarray(published)
    known = np.isfinite(best)
    limit = np.where(best > 0, (1 + far) * best, OF_ZERO)
    return float((reached[known] <= limit[known]).mean())

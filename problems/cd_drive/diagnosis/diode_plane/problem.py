"""Surface defects in the plane of the two diodes: quality, binary detection, kinds (section 7.3.1).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, Study, problem
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..defect_events import FEATURES
from ..defect_kinds import KINDS
from ..quality import FARTHEST
from .report import figures_of, tables_of
from .runs import CLEAN_TIME, CONDITIONS, DETECTORS, Detectors, isolated

TRAINED = tuple(f"CD{n}" for n in range(1, 7))
HELD_OUT = tuple(f"CD{n}" for n in range(7, 13))
"""Drives whose defects the clusters are made of, and those they are tested on."""
DIST_MIN = {"focus": 0.18, "radial": 0.06}
"""Security margin: five and a half times the noise of dist on the noisiest drive."""
Fraction = Annotated[float, Field(gt=0, lt=1)]


@problem("cd/{axis}/diode-plane", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def diode_plane(
    axis: Axis,
    defects: Annotated[int, Field(ge=4, le=100)] = 12,
    dist_min: Fraction | None = None,
    dist_max: Fraction = 0.5,
    alpha: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0,
    below: Fraction = 0.7,
) -> DiodePlane:
    """Defects in the plane of the diodes, quality signal, kinds (figures 7.5, 7.10, 7.11).

    The reference controller follows discs that wobble by all the Red Book allows at 5.5 Hz, with
    scratches, finger prints, black dots and dropouts. Quality signal (eq. 7.13, 7.14), the sum
    below a level, and the error above one are compared: delays, missed defects, false alarms on a
    disc that stands, one that wobbles, and under shocks. Clusters of features tell the kinds apart;
    they are made on CD1-CD6 and tested on CD7-CD12.

    defects: of each kind on each drive. dist_min (None: 0.18 in focus, 0.06 radially), dist_max,
    alpha: of the quality signal. below: share of the clean level that alarms the binary detector.
    """
    margin = DIST_MIN[axis] if dist_min is None else dist_min
    return DiodePlane(Detectors(axis, margin, dist_max, alpha, below), defects)


@dataclass(frozen=True)
class DiodePlane(Study):
    """Runs on twelve drives, detectors compared on them, clusters made on half of them."""

    detectors: Detectors
    defects: int

    headline: ClassVar[str] = "isolated"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        names = [*TRAINED, *HELD_OUT]
        every = [
            self.detectors.on_drive(name, self.defects, context.rng)
            for name in context.track(names, "drives")
        ]
        labels = np.concatenate([one.labels for one in every])
        delays = np.concatenate([one.delays for one in every], axis=1)
        found = ~np.isnan(delays)
        both = found[0] & found[1]
        of_kind = [labels == k for k in range(len(KINDS))]
        mean = [
            [float(row[hit].mean()) if hit.any() else np.nan for row, hit in zip(*one, strict=True)]
            for one in ((delays[:, own], found[:, own]) for own in of_kind)
        ]
        missed = [1.0 - found[:, own].mean(axis=1) for own in of_kind]
        trained = [point for one in every[: len(TRAINED)] for point in one.points]
        held_out = [point for one in every[len(TRAINED) :] for point in one.points]
        detected, counted = ("kind", "detector"), ("detector", "condition")
        return xr.Dataset(
            {
                **self.detectors.shown(int(context.rng.integers(2**31))),
                **isolated(trained, held_out),
                "delay": (detected, mean, {"units": "s", "long_name": "mean over what was found"}),
                "missed": (detected, missed, {"units": "1"}),
                "lead": ((), float(np.mean(delays[0, both] - delays[1, both])), {"units": "s"}),
                "false_alarms": (counted, sum(one.false_alarms for one in every)),
                "fault_free": ((), CLEAN_TIME * len(every), {"units": "s"}),
                "coupling": (
                    "drive",
                    [one.coupling for one in every],
                    {"long_name": "squared correlation of sum and error under shocks"},
                ),
                "lost": sum(one.lost for one in every),
            },
            coords={
                "kind": list(KINDS),
                "detector": list(DETECTORS),
                "condition": list(CONDITIONS),
                "drive": names,
                "feature": list(FEATURES),
                "diode": ["d1n", "d2n"],
                "found": [*KINDS, "missed"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        sums = answer["false_alarms"].sel(detector=["binary", "quality"])
        felt = answer["false_alarms"].sel(detector="error", condition="shock")
        numbers = self.metrics(answer)
        return [
            Check("loop", "times that it was lost or regained", float(answer["lost"]), 0.0),
            Check("equation 7.13", "largest difference from it", *self._quality_off(answer)),
            Check(
                "triangle", "farthest point outside, clean and traces", self._outside(answer), 0.02
            ),
            Check(
                "clean ellipse",
                "share of the clean points outside the 99 % ellipse",
                self._beyond_ellipse(answer),
                0.02,
            ),
            Check("decoupled", "false alarms of the sum in all", float(sums.sum()), 0.0),
            Check("shocks are felt", "minus the error's alarms under shock", -float(felt), -1.0),
            Check("coupling", "largest squared correlation", float(answer["coupling"].max()), 0.01),
            Check("quality finds all", "share missed", numbers["missed_quality"], 0.0),
            Check("quality is not later", "minus its lead [s]", -float(answer["lead"]), 0.0),
            Check("kinds", "share not isolated", 1.0 - numbers["isolated"], 0.1),
        ]

    def _quality_off(self, answer: Dataset) -> tuple[float, float]:
        """Stored quality against eq. 7.13 of the stored diodes, all samples at once."""
        law = self.detectors
        dist = abs(1.0 - answer["zoom_diodes"].sum("diode").values) * FARTHEST
        ramp = np.clip((law.dist_max - dist) / (law.dist_max - law.dist_min), 0.0, 1.0)
        return float(abs(ramp**law.alpha - answer["zoom_quality"].values).max()), 1e-9

    def _outside(self, answer: Dataset) -> float:
        """How far any point is below d1n = 0 or d2n = 0; the third side is the noise's."""
        return -min(float(answer[name].min()) for name in ("clean", "shaken", "trace"))

    def _beyond_ellipse(self, answer: Dataset) -> float:
        points = answer["clean"].values - answer["clean"].values.mean(axis=0)
        squared = np.sum(points @ np.linalg.inv(np.cov(points.T)) * points, axis=1)
        return float(np.mean(squared > stats.chi2.isf(0.01, 2)))

    def metrics(self, answer: Dataset) -> dict[str, float]:
        counts = answer["confusion"].values
        numbers = {
            "isolated": float(np.trace(counts) / counts.sum()),
            "quality_leads_binary_us": 1e6 * float(answer["lead"]),
            "coupling": float(answer["coupling"].max()),
        }
        for detector in DETECTORS:
            one = answer.sel(detector=detector)
            numbers[f"missed_{detector}"] = float(one["missed"].mean())
            for kind in answer["kind"].values:
                place = f"{detector}_{str(kind).replace(' ', '_')}"
                numbers[f"delay_{place}_us"] = 1e6 * float(one["delay"].sel(kind=kind))
            for condition in CONDITIONS:
                rate = one["false_alarms"].sel(condition=condition) / answer["fault_free"]
                numbers[f"false_alarms_{detector}_{condition.replace(' ', '_')}_per_s"] = float(
                    rate
                )
        width = answer["clean"].std("point")
        for diode in answer["diode"].values:
            numbers[f"clean_deviation_{diode}"] = float(width.sel(diode=diode))
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        law = self.detectors
        return figures_of(answer, law.axis, law.dist_min, law.dist_max)

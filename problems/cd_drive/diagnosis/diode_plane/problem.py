"""Surface defects in the plane of the two diodes: quality, binary detection, kinds (section 7.3.1).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, problem
from workbench.diagnosis.evaluation.quality import FARTHEST
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset
from workbench.study import Study, array, arrays, dim, figure, metric, part, table
from workbench.tables import crossed, markdown

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..defect_events import FEATURES
from ..defect_kinds import KINDS
from . import figures
from .runs import CLEAN_TIME, CONDITIONS, DETECTORS, Detectors, OneDrive, isolated

TRAINED = tuple(f"CD{n}" for n in range(1, 7))
"""Drives whose defects the clusters are made of."""
HELD_OUT = tuple(f"CD{n}" for n in range(7, 13))
"""Drives whose defects the clusters are tested on."""
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

    @property
    def quantifier(self) -> str:
        return "in these simulated records"

    kind, detector, condition = dim(KINDS), dim(DETECTORS), dim(CONDITIONS)
    drive, diode = dim(*TRAINED, *HELD_OUT), dim("d1n", "d2n")
    feature, found = dim(FEATURES), dim(*KINDS, "missed")

    @part
    def every(self, context: Context) -> list[OneDrive]:
        """Findings of the detectors, drive by drive."""
        names = context.track([*TRAINED, *HELD_OUT], "drives")
        return [self.detectors.on_drive(name, self.defects, context.rng) for name in names]

    # What the figures show is seeded after the drives' runs.
    shown = part(lambda self, every, context: self.detectors.shown(context.rng))
    linear = array(value=lambda shown: shown["linear"])
    points = arrays(("point", diode), lambda shown: shown, clean="", shaken="")
    trace = array((kind, "along", diode), value=lambda shown: shown["trace"])
    blocks = arrays("block", lambda shown: shown, block_time="s", block_quality="", block_sum="")
    zooms = arrays("zoom", lambda shown: shown, zoom_time="s", zoom_quality="", zoom_binary="")
    zoom_diodes = array(("zoom", diode), value=lambda shown: shown["zoom_diodes"])

    delays = part(lambda every: np.concatenate([one.delays for one in every], axis=1))

    @arrays((kind, detector), delay=("s", "mean over what was found"), missed="1")
    def detected(self, every: list[OneDrive], delays: Any) -> dict[str, Any]:
        labels = np.concatenate([one.labels for one in every])
        of_kind = [delays[:, labels == k] for k in range(len(KINDS))]
        found = [[row[~np.isnan(row)] for row in own] for own in of_kind]
        return {
            "delay": [[row.mean() if row.size else np.nan for row in own] for own in found],
            "missed": [1.0 - (~np.isnan(own)).mean(axis=1) for own in of_kind],
        }

    @array((), "s")
    def lead(self, delays: Any) -> float:
        both = ~np.isnan(delays[:2]).any(axis=0)
        return float(np.mean(delays[0, both] - delays[1, both]))

    false_alarms = array(
        (detector, condition), value=lambda every: sum(one.false_alarms for one in every)
    )
    fault_free = array((), "s", "", lambda every: CLEAN_TIME * len(every))
    coupling = array(
        drive,
        "",
        "squared correlation of sum and error under shocks",
        lambda every: [one.coupling for one in every],
    )
    lost = array(value=lambda every: sum(one.lost for one in every))

    @part
    def isolation(self, every: list[OneDrive]) -> dict[str, Any]:
        """Clusters of the trained drives' events, and what they say of the held-out ones."""
        points = [one.points for one in every]
        cut = len(TRAINED)
        return isolated(list(chain(*points[:cut])), list(chain(*points[cut:])))

    confusion = array((kind, found), value=lambda isolation: isolation["confusion"])
    features = array(("event", feature), value=lambda isolation: isolation["features"])
    event_kind = array("event", value=lambda isolation: isolation["event_kind"])
    cluster_mean = array((kind, feature), value=lambda isolation: isolation["cluster_mean"])
    cluster_factor = array(
        (kind, feature, "also"), value=lambda isolation: isolation["cluster_factor"]
    )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        alarms, coupling = answer["false_alarms"], float(answer["coupling"].max())
        in_sums = float(alarms.sel(detector=["binary", "quality"]).sum())
        felt = float(alarms.sel(detector="error", condition="shock"))
        missed = float(answer["missed"].sel(detector="quality").mean())
        # The third side of the triangle is the noise's.
        outside = -min(float(answer[name].min()) for name in ("clean", "shaken", "trace"))
        ellipse = "share of the clean points outside the 99 % ellipse"
        return [
            Check("loop", "times that it was lost or regained", float(answer["lost"]), 0.0),
            Check("equation 7.13", "largest difference from it", self._quality_off(answer), 1e-9),
            Check("triangle", "farthest point outside, clean and traces", outside, 0.02),
            Check("clean ellipse", ellipse, _beyond_ellipse(answer), 0.02),
            Check("decoupled", "false alarms of the sum in all", in_sums, 0.0),
            Check("shocks are felt", "minus the error's alarms under shock", -felt, -1.0),
            Check("coupling", "largest squared correlation", coupling, 0.01),
            Check("quality finds all", "share missed", missed, 0.0),
            Check("quality is not later", "minus its lead [s]", -float(answer["lead"]), 0.0),
            Check("kinds", "share not isolated", 1.0 - _share(answer["confusion"]), 0.1),
        ]

    def _quality_off(self, answer: Dataset) -> float:
        """Largest difference of the stored quality from eq. 7.13 of the stored diodes."""
        law = self.detectors
        dist = abs(1.0 - answer["zoom_diodes"].sum("diode").values) * FARTHEST
        ramp = np.clip((law.dist_max - dist) / (law.dist_max - law.dist_min), 0.0, 1.0)
        return float(abs(ramp**law.alpha - answer["zoom_quality"].values).max())

    isolated = metric(lambda confusion: _share(confusion))
    quality_leads_binary_us = metric(lambda lead: 1e6 * lead)
    largest_coupling = metric("coupling", lambda coupling: coupling.max())
    missed_mean = metric("missed_{detector}", lambda missed: missed.mean("kind"))
    delay_us = metric("delay_{detector}_{kind}_us", lambda delay: 1e6 * delay)
    false_alarm_rate = metric(
        "false_alarms_{detector}_{condition}_per_s",
        lambda false_alarms, fault_free: false_alarms / fault_free,
    )
    clean_deviation = metric("clean_deviation_{diode}", lambda clean: clean.std("point"))

    @table
    def all_tables(self, answer: Dataset) -> dict[str, Any]:
        rate = answer["false_alarms"] / answer["fault_free"]
        detection = (
            crossed(1e6 * answer["delay"], "{:.0f}", "delay [us]"),
            crossed(answer["missed"], "{:.1%}", "missed"),
            crossed(rate, "{:.2f}", "false alarms a second"),
        )
        return {
            "confusion": crossed(answer["confusion"]),
            "detection": "\n".join(markdown(*one) for one in detection),
        }

    figure_7_5_7_10 = figure(lambda self, answer: figures.plane(answer, self.detectors))
    figure_7_11, kinds = figure(figures.over_time), figure(figures.clusters)


def _share(confusion: DataArray) -> float:
    """Share of the held-out defects whose kind was told rightly."""
    return float(np.trace(confusion.values) / confusion.values.sum())


def _beyond_ellipse(answer: Dataset) -> float:
    """Share of the clean points outside the 99 % ellipse of their Gaussian."""
    points = answer["clean"].values - answer["clean"].values.mean(axis=0)
    squared = np.sum(points @ np.linalg.inv(np.cov(points.T)) * points, axis=1)
    return float(np.mean(squared > stats.chi2.isf(0.01, 2)))

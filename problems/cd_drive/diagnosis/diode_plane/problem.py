"""Surface defects in the plane of the two diodes: quality, binary detection, kinds (section 7.3.1).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, problem
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    arrays,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.printed_noise import Amplitude
from ..defect_claims import claim_checks, claims_in_words
from ..defect_events import FEATURES
from ..defect_kinds import KINDS
from . import figures
from .claims import CLAIMED, isolated_share, plane_claims
from .runs import (
    CLEAN_TIME,
    CONDITIONS,
    DETECTORS,
    Detectors,
    OneDrive,
    delays_and_missed,
    isolated,
    lead_of_quality,
)

TRAINED = tuple(f"CD{n}" for n in range(1, 7))
"""Drives whose defects form the clusters."""
HELD_OUT = tuple(f"CD{n}" for n in range(7, 13))
"""Drives on whose defects the clusters are tested."""
DIST_MIN = {"focus": 0.18, "radial": 0.06}
"""Security margin: five and a half times the noise of dist on the noisiest drive."""
MOST_LOST = 0.01
"""Largest share of the records in which the loop may be lost. After a loss events may follow
quickly, so a record counts once.
"""
Fraction = Annotated[float, Field(gt=0, lt=1)]


@problem(
    "cd/{axis}/diode-plane",
    slow=True,
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def diode_plane(
    axis: Axis,
    defects: Annotated[int, Field(ge=4, le=100)] = 6,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    dist_min: Fraction | None = None,
    dist_max: Fraction = 0.5,
    alpha: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0,
    below: Fraction = 0.7,
    noise: Amplitude = "rms",
) -> DiodePlane:
    """Defects in the plane of the diodes, quality signal, kinds (figures 7.5, 7.10, 7.11).

    The reference controller follows discs that deviate by all the Red Book allows at 5.5 Hz, with
    scratches, finger prints, black dots and dropouts. The quality signal (eq. 7.13, 7.14), the sum
    below a level, and the error above a level are compared as detectors: delays, missed defects,
    and false alarms on a disc at rest, on a wobbling one, and under shocks. Clusters of features
    distinguish the kinds; they are formed on CD1-CD6 and tested on CD7-CD12.

    Each number is a distribution over draws of noise and defects, and detectors are compared in the
    same draw.

    defects: number of defects of each kind on each drive in a draw. draws: number of draws of
    everything. dist_min (None: 0.18 in focus, 0.06 radially), dist_max, alpha: parameters of the
    quality signal. below: share of the clean level below which the binary detector alarms. noise:
    reading of the printed amplitude of 0.15 um (`printed_noise`).
    """
    margin = DIST_MIN[axis] if dist_min is None else dist_min
    return DiodePlane(Detectors(axis, margin, dist_max, alpha, below, noise), defects, draws)


@dataclass(frozen=True)
class DiodePlane(Study):
    """Runs on twelve drives, detectors compared on them, clusters formed from half of them."""

    detectors: Detectors
    defects: int
    draws: int

    headline: ClassVar[str] = "isolated_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws"

    kind, detector, condition = dim(KINDS), dim(DETECTORS), dim(CONDITIONS)
    drive, diode = dim(*TRAINED, *HELD_OUT), dim("d1n", "d2n")
    feature, found = dim(FEATURES), dim(*KINDS, "missed")
    draw = dim(lambda self: range(self.draws))

    @array(dims=(draw, drive))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.draws, len(TRAINED + HELD_OUT))

    @part
    def every(self, context: Context, seed: DataArray) -> list[list[OneDrive]]:
        """Findings of the detectors on every drive in each draw."""

        def met(place: tuple[int, ...]) -> OneDrive:
            one = seed[place]
            return self.detectors.on_drive(str(one["drive"].values), self.defects, int(one))

        found = context.spread(met, list(np.ndindex(seed.shape)), "drives and draws")
        size = seed.sizes["drive"]
        return [found[n * size : (n + 1) * size] for n in range(self.draws)]

    # The figures show one record of one draw, whose seed comes after the others.
    shown = part(lambda self, every, context: self.detectors.shown(context.rng))
    linear = array(value=lambda shown: shown["linear"])
    points = arrays(("point", diode), lambda shown: shown, clean="", shaken="")
    trace = array(dims=(kind, "along", diode), value=lambda shown: np.float32(shown["trace"]))
    blocks = arrays("block", lambda shown: shown, block_time="s", block_quality="", block_sum="")
    zooms = arrays("zoom", lambda shown: shown, zoom_time="s", zoom_quality="", zoom_binary="")
    zoom_diodes = array(dims=("zoom", diode), value=lambda shown: shown["zoom_diodes"])

    @arrays((draw, kind, detector), delay=("s", "mean over what was found"), missed="1")
    def detected(self, every: list[list[OneDrive]]) -> dict[str, Any]:
        found = [delays_and_missed(draw) for draw in every]
        return {"delay": [one[0] for one in found], "missed": [one[1] for one in found]}

    @array(dims=(kind, detector), unit="s", meaning="of the first draw's defects, without noise")
    def delay_without_noise(self, seed: DataArray) -> Any:
        first = seed.isel(draw=0)
        pairs = zip(first["drive"].values.tolist(), first.values.tolist(), strict=True)
        quiet = [self.detectors.on_drive(n, self.defects, s, noisy=False) for n, s in pairs]
        return delays_and_missed(quiet)[0]

    lead = array(
        dims=draw, unit="s", meaning="", value=lambda every: [lead_of_quality(one) for one in every]
    )
    false_alarms = array(
        dims=(draw, detector, condition),
        value=lambda every: [sum(one.false_alarms for one in row) for row in every],
    )
    fault_free = array(
        dims=(), unit="s", meaning="", value=lambda: CLEAN_TIME * len(TRAINED + HELD_OUT)
    )
    coupling = array(
        dims=(draw, drive),
        unit="",
        meaning="squared correlation of sum and error under shocks",
        value=lambda every: [[one.coupling for one in row] for row in every],
    )
    lost = array(
        dims=draw,
        unit="",
        meaning="records in which the loop was lost",
        value=lambda every: [sum(one.lost for one in row) for row in every],
    )

    @part
    def isolation(self, every: list[list[OneDrive]]) -> list[dict[str, Any]]:
        """Clusters of the events on the training drives, and their decisions on the
        held-out ones.
        """
        cut = len(TRAINED)
        points = [[one.points for one in row] for row in every]
        return [isolated(list(chain(*row[:cut])), list(chain(*row[cut:]))) for row in points]

    confusion = array(
        dims=(draw, kind, found), value=lambda isolation: [one["confusion"] for one in isolation]
    )
    features = array(dims=("event", feature), value=lambda isolation: isolation[0]["features"])
    event_kind = array(dims="event", value=lambda isolation: isolation[0]["event_kind"])
    cluster_mean = array(dims=(kind, feature), value=lambda isolation: isolation[0]["cluster_mean"])
    cluster_factor = array(
        dims=(kind, feature, "also"), value=lambda isolation: isolation[0]["cluster_factor"]
    )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        # The third side of the triangle is limited by noise only.
        outside = -min(float(answer[name].min()) for name in ("clean", "shaken", "trace"))
        ellipse = "share of one record's clean points outside the 99 % ellipse"
        lost = "share of the records in which it was lost"
        quality = "largest difference of the stored quality from that of the equation [1]"
        beyond = "largest distance of a stored point beyond the sides d1n = 0 and d2n = 0 [1]"
        records = answer["seed"].size * (len(CONDITIONS) + 1)
        return [
            Check("loop", lost, float(answer["lost"].sum()) / records, MOST_LOST),
            Check("equation 7.13", quality, self._quality_off(answer), 1e-9),
            Check("triangle", beyond, outside, 0.02),
            Check("clean ellipse", ellipse, _beyond_ellipse(answer), 0.03),
            *claim_checks(plane_claims(answer), CLAIMED),
        ]

    def _quality_off(self, answer: Dataset) -> float:
        """Largest difference of the stored quality from eq. 7.13 for the stored diodes."""
        law = self.detectors
        # distance from the line a + b = 1 in the plane of both diodes
        dist = abs(1.0 - answer["zoom_diodes"].sum("diode").values) / math.sqrt(2.0)
        ramp = np.clip((law.dist_max - dist) / (law.dist_max - law.dist_min), 0.0, 1.0)
        return float(abs(ramp**law.alpha - answer["zoom_quality"].values).max())

    isolated = metric(
        template="isolated_{summary}",
        value=lambda confusion: draws_summary(isolated_share(confusion)),
    )
    lost_share = metric("records_lost_per_draw", value=lambda lost: lost.mean("draw"))
    leads = metric(
        template="quality_leads_binary_{summary}_us", value=lambda lead: draws_summary(1e6 * lead)
    )
    largest_coupling = metric(
        template="coupling_{summary}", value=lambda coupling: draws_summary(coupling.max("drive"))
    )
    missed_mean = metric(
        template="missed_{detector}_{summary}",
        value=lambda missed: draws_summary(missed.mean("kind")),
    )
    delay_us = metric(
        template="delay_{detector}_{kind}_{summary}_us",
        value=lambda delay: draws_summary(1e6 * delay),
    )
    quiet_delay_us = metric(
        template="delay_{detector}_{kind}_without_noise_us",
        value=lambda delay_without_noise: 1e6 * delay_without_noise,
    )
    false_alarm_rate = metric(
        template="false_alarms_{detector}_{condition}_{summary}_per_s",
        value=lambda false_alarms, fault_free: draws_summary(false_alarms / fault_free),
    )
    clean_deviation = metric(
        template="clean_deviation_{diode}", value=lambda clean: clean.std("point")
    )

    claims = table(lambda answer: claims_in_words(plane_claims(answer)))

    @table
    def all_tables(self, answer: Dataset) -> dict[str, Any]:
        rate = answer["false_alarms"] / answer["fault_free"]
        title = f"Mean, and the interval of 90 % of {self.draws} draws.\n\n"
        confusion = answer["confusion"] / answer["confusion"].sum("found")
        detection = (
            _crossed(1e6 * answer["delay"], "{:.0f}", "delay [us]"),
            _crossed(answer["missed"], "{:.3f}", "missed"),
            _crossed(rate, "{:.2f}", "false alarms a second"),
        )
        return {
            "confusion": title + _crossed(confusion, "{:.2f}", "share taken for"),
            "detection": title + "\n".join(detection),
        }

    figure_7_5_7_10 = figure(lambda self, answer: figures.plane(answer, self.detectors))
    figure_7_11, kinds = figure(figures.over_time), figure(figures.clusters)


def _crossed(values: DataArray, form: str, corner: str) -> str:
    """A table of mean and interval over the draws, for two further dimensions."""
    told = draws_summary(values)
    rows, columns = (name for name in values.dims if name != "draw")
    heads = [corner, *map(str, values[columns].values)]
    cells = told.transpose(rows, columns, "summary")
    return markdown_table(
        heads,
        [[str(row[rows].values), *(interval_text(one, form=form) for one in row)] for row in cells],
    )


def _beyond_ellipse(answer: Dataset) -> float:
    """Share of the clean points outside the 99 % ellipse of their Gaussian."""
    points = answer["clean"].values - answer["clean"].values.mean(axis=0)
    squared = np.sum(points @ np.linalg.inv(np.cov(points.T)) * points, axis=1)
    return float(np.mean(squared > stats.chi2.isf(0.01, 2)))

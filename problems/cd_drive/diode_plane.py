"""Surface defects in the plane of the two diodes: quality, binary detection, kinds (section 7.3.1).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy import stats

from workbench import Check, Study, problem
from workbench.diagnosis import (
    UNKNOWN,
    Clusters,
    confusion,
    detection,
    hysteresis,
    quantile_threshold,
)
from workbench.executor import Context
from workbench.simulation import play

from .actuator import Real
from .bench_setup import PERIOD, RATE
from .defect_events import FEATURES, LATE, events, features, matched
from .defect_kinds import KINDS, SHOCK_PEAK, draw
from .defect_runs import ROTATION, DefectRun, run
from .diode_plane_report import figures_of, tables_of
from .laboratory import STILL, Laboratory
from .quality import FARTHEST, binary_detector, quality_signal
from .red_book import ACCEPTABLE_ERROR
from .sets import TABLES
from .tables import Axis

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TRAINED = tuple(f"CD{n}" for n in range(1, 7))
HELD_OUT = tuple(f"CD{n}" for n in range(7, 13))
"""Drives whose defects the clusters are made of, and those they are tested on."""
DETECTORS = ("binary", "quality", "error")
CONDITIONS = ("still disc", "deviation", "shock")
REVOLUTIONS = 5
"""Shown in figure 7.11."""
POINTS = 1500
"""Of a clean record, shown in the plane."""
BLOCK = 35
"""Samples of which the overview keeps the lowest: a millisecond."""
AHEAD, SHOWN = 70, 400
"""Samples shown before a defect, and in all."""
DIST_MIN = {"focus": 0.18, "radial": 0.06}
"""Security margin: five and a half times the noise of dist on the noisiest drive."""
ERROR_ALARMS = 0.01
"""False-alarm rate of the error's threshold on a wobbling disc, per block of ERROR_BLOCK."""
ERROR_BLOCK = 350

CLEAN_TIME = 1.0
"""Of each run without defects [s]."""

Point = tuple[int, Real | None]
"""Kind of a defect and the features of its event; None where it made none."""
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
    return DiodePlane(axis, defects, dist_min or DIST_MIN[axis], dist_max, alpha, below)


class OneDrive(NamedTuple):
    """Of one drive: kind (F,) and delays (detector, F) of its defects, their events, false alarms.

    False alarms (detector, condition) are counted; coupling is the squared correlation of sum and
    error under shocks; lost, how often the loop was lost or regained.
    """

    labels: NDArray[np.int64]
    delays: Real
    points: list[Point]
    false_alarms: Real
    coupling: float
    lost: int


@dataclass(frozen=True)
class DiodePlane(Study):
    """Runs on twelve drives, detectors compared on them, clusters made on half of them."""

    axis: Axis
    defects: int
    dist_min: float
    dist_max: float
    alpha: float
    below: float

    headline: ClassVar[str] = "isolated"

    def quality(self, one: DefectRun) -> Real:
        """Quality, dist and held error of a run (N, 3)."""
        law = quality_signal(one.level, self.dist_min, self.dist_max, self.alpha)
        return play(law, one.measured)

    def binary(self, one: DefectRun) -> Real:
        """Alarm of the binary detector (N,)."""
        release = min(self.below + 0.1, 0.5 * (1.0 + self.below))
        return play(binary_detector(one.level, self.below, release), one.measured)[:, 0]

    def alarms(self, one: DefectRun, error_level: float) -> tuple[ArrayLike, ...]:
        """Alarm of each of DETECTORS (N,)."""
        error = abs(one.record.f_en)[:, None]
        above = play(hysteresis(error_level, 0.5 * error_level), error)[:, 0]
        return self.binary(one), self.quality(one)[:, 0] < 1.0, above

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        names = [*TRAINED, *HELD_OUT]
        every = [self._drive(name, context.rng) for name in context.track(names, "drives")]
        labels = np.concatenate([one.labels for one in every])
        delays = np.concatenate([one.delays for one in every], axis=1)
        found = ~np.isnan(delays)
        both = found[0] & found[1]
        of_kind = [labels == k for k in range(len(KINDS))]
        total = np.where(found, delays, 0.0)
        mean = [
            total[:, own].sum(axis=1) / np.maximum(1, found[:, own].sum(axis=1)) for own in of_kind
        ]
        missed = [1.0 - found[:, own].mean(axis=1) for own in of_kind]
        trained = [point for one in every[: len(TRAINED)] for point in one.points]
        held_out = [point for one in every[len(TRAINED) :] for point in one.points]
        detected, counted = ("kind", "detector"), ("detector", "condition")
        return xr.Dataset(
            {
                **self._shown(int(context.rng.integers(2**31))),
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

    def _drive(self, name: str, rng: np.random.Generator) -> OneDrive:
        """Detectors and events of one drive."""
        bench = Laboratory(self.axis, name)
        *seeds, last = rng.integers(2**31, size=len(CONDITIONS) + 1).tolist()
        still, wobbling, shaken = self._clean(bench, seeds)
        error = abs(wobbling.record.f_en)
        level = quantile_threshold(error, ERROR_ALARMS, block=ERROR_BLOCK).level
        false_alarms = np.zeros((len(DETECTORS), len(CONDITIONS)))
        for c, one in enumerate((still, wobbling, shaken)):
            for d, alarm in enumerate(self.alarms(one, level)):
                false_alarms[d, c] = detection(alarm, [], PERIOD).false_alarms
        labels = rng.permutation(np.repeat(np.arange(len(KINDS)), self.defects))
        drawn = [draw(list(KINDS)[k], rng, self.axis) for k in labels]
        dirty = run(bench, drawn, last)
        delays = [
            detection(a, dirty.faults, PERIOD, LATE).delays for a in self.alarms(dirty, level)
        ]
        dist = self.quality(dirty)[:, 1]
        seen = events(dist, self.dist_min)
        points = [
            (k, features(dirty, dist, seen[i]) if i >= 0 else None)
            for k, i in zip(labels.tolist(), matched(seen, dirty.faults), strict=True)
        ]
        coupling = np.corrcoef(shaken.record.sum, shaken.record.f_en)[0, 1] ** 2
        lost = sum(len(one.record.events) for one in (still, wobbling, shaken, dirty))
        return OneDrive(labels, np.array(delays), points, false_alarms, float(coupling), lost)

    def _clean(self, bench: Laboratory, seeds: list[int]) -> list[DefectRun]:
        """Runs without a defect, by condition."""
        still, wobbling, shaken = seeds
        return [
            run(bench, [], still, duration=CLEAN_TIME, disc=STILL),
            run(bench, [], wobbling, duration=CLEAN_TIME),
            run(bench, [], shaken, SHOCK_PEAK[bench.axis], CLEAN_TIME),
        ]

    def _shown(self, seed: int) -> dict[str, Any]:
        """What the figures show: the nominal drive, a trace of each kind, a scratch passing by."""
        bench, rng = Laboratory(self.axis, "nominal"), np.random.default_rng(seed)
        clean = run(bench, [], seed, duration=1.0).diodes[:: round(RATE / POINTS)]
        shaken = run(bench, [], seed, SHOCK_PEAK[self.axis], 1.0).diodes[:: round(RATE / POINTS)]
        examples = run(bench, [draw(kind, rng, self.axis) for kind in KINDS], seed)
        windows = np.array([np.arange(SHOWN) + start - AHEAD for start, _ in examples.faults])
        scratch = draw("scratch", rng, self.axis)
        turning = run(bench, [scratch] * REVOLUTIONS, seed, spacing=1.0 / ROTATION)
        signal, alarm = self.quality(turning)[:, 0], self.binary(turning)
        total = turning.record.sum / turning.level
        start = turning.faults[1][0] - AHEAD
        zoom = slice(start, start + AHEAD + 100)
        blocks = len(total) // BLOCK

        def lowest(values: Real) -> Real:
            least: Real = values[: blocks * BLOCK].reshape(blocks, BLOCK).min(axis=1)
            return least

        return {
            "linear": bench.parameters.K_optn * ACCEPTABLE_ERROR[self.axis],
            "clean": (("point", "diode"), clean),
            "shaken": (("point", "diode"), shaken),
            "trace": (("kind", "along", "diode"), examples.diodes[windows]),
            "block_time": ("block", np.arange(blocks) * BLOCK * PERIOD, {"units": "s"}),
            "block_quality": ("block", lowest(signal)),
            "block_sum": ("block", lowest(total)),
            "zoom_time": ("zoom", np.arange(zoom.stop - zoom.start) * PERIOD, {"units": "s"}),
            "zoom_quality": ("zoom", signal[zoom]),
            "zoom_binary": ("zoom", alarm[zoom]),
            "zoom_diodes": (("zoom", "diode"), turning.diodes[zoom]),
        }

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
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

    def _quality_off(self, answer: xr.Dataset) -> tuple[float, float]:
        """Stored quality against eq. 7.13 of the stored diodes, all samples at once."""
        dist = abs(1.0 - answer["zoom_diodes"].sum("diode").values) * FARTHEST
        ramp = np.clip((self.dist_max - dist) / (self.dist_max - self.dist_min), 0.0, 1.0)
        return float(abs(ramp**self.alpha - answer["zoom_quality"].values).max()), 1e-9

    def _outside(self, answer: xr.Dataset) -> float:
        """How far any point is below d1n = 0 or d2n = 0; the third side is the noise's."""
        return -min(float(answer[name].min()) for name in ("clean", "shaken", "trace"))

    def _beyond_ellipse(self, answer: xr.Dataset) -> float:
        points = answer["clean"].values - answer["clean"].values.mean(axis=0)
        squared = np.sum(points @ np.linalg.inv(np.cov(points.T)) * points, axis=1)
        return float(np.mean(squared > stats.chi2.isf(0.01, 2)))

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
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

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        return tables_of(answer)

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis, self.dist_min, self.dist_max)


def isolated(trained: list[Point], held_out: list[Point]) -> dict[str, Any]:
    """Clusters of the first events, and what they say of the second."""
    seen = [(k, x) for k, x in trained if x is not None]
    kinds, points = np.array([k for k, _ in seen]), np.array([x for _, x in seen])
    clusters = Clusters.fit(points, kinds, tuple(KINDS))
    seen = [(k, x) for k, x in held_out if x is not None]
    unseen = np.array([k for k, x in held_out if x is None], int)
    true, measured = np.array([k for k, _ in seen]), np.array([x for _, x in seen])
    said = np.append(clusters.classify(measured), np.full(len(unseen), UNKNOWN))
    return {
        "confusion": (("kind", "found"), confusion(np.append(true, unseen), said, len(KINDS))),
        "features": (("event", "feature"), measured),
        "event_kind": ("event", true),
        "cluster_mean": (("kind", "feature"), clusters.means),
        "cluster_factor": (("kind", "feature", "also"), clusters.factors),
    }

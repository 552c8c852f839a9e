"""Surface defects in the plane of the two diodes: quality, binary detection, kinds (section 7.3.1).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, Study, problem
from workbench.diagnosis import Clusters, confusion, detection, hysteresis, quantile_threshold
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

    def alarms(self, one: DefectRun, error_level: float) -> dict[str, Real]:
        """Alarm of each of DETECTORS (N,)."""
        error = abs(one.record.f_en)[:, None]
        return {
            "binary": self.binary(one),
            "quality": self.quality(one)[:, 0] < 1.0,
            "error": play(hysteresis(error_level, 0.5 * error_level), error)[:, 0],
        }

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        kinds, rng = list(KINDS), context.rng
        names = [*TRAINED, *HELD_OUT]
        lost, points, delays = 0, {name: [] for name in (TRAINED, HELD_OUT)}, []
        false = np.zeros((len(DETECTORS), len(CONDITIONS)))
        seconds, coupling = np.zeros(len(CONDITIONS)), []
        for name in context.track(names, "drives"):
            bench = Laboratory(self.axis, name)
            seeds = rng.integers(2**31, size=4).tolist()
            clean = self._clean(bench, seeds[:3])
            wobble = clean["deviation"]
            level = quantile_threshold(abs(wobble.record.f_en), ERROR_ALARMS, block=ERROR_BLOCK)
            for c, one in enumerate(clean.values()):
                for d, alarm in enumerate(self.alarms(one, level.level).values()):
                    false[d, c] += detection(alarm, [], PERIOD).false_alarms
                seconds[c] += len(one.record.time) * PERIOD
                lost += len(one.record.events)
            shaken = clean["shock"].record
            coupling.append(np.corrcoef(shaken.sum, shaken.f_en)[0, 1] ** 2)
            labels = rng.permutation(np.repeat(np.arange(len(kinds)), self.defects))
            drawn = [draw(kinds[k], rng, self.axis) for k in labels]
            dirty = run(bench, drawn, seeds[3])
            lost += len(dirty.record.events)
            found = [
                detection(alarm, dirty.faults, PERIOD, LATE).delays
                for alarm in self.alarms(dirty, level.level).values()
            ]
            delays.append((labels, np.array(found)))
            dist = self.quality(dirty)[:, 1]
            seen = events(dist, self.dist_min)
            group = TRAINED if name in TRAINED else HELD_OUT
            points[group] += [
                (k, features(dirty, dist, seen[i]) if i >= 0 else None)
                for k, i in zip(labels.tolist(), matched(seen, dirty.faults), strict=True)
            ]
        labels = np.concatenate([one[0] for one in delays])
        delay = np.concatenate([one[1] for one in delays], axis=1)
        of_kind = [delay[:, labels == k] for k in range(len(kinds))]
        missed = [[float(np.isnan(row).mean()) for row in rows] for rows in of_kind]
        mean = [[float(np.mean(r[~np.isnan(r)])) if (~np.isnan(r)).any() else np.nan for r in rows]
                for rows in of_kind]  # fmt: skip
        both = ~np.isnan(delay[:2]).any(axis=0)
        detected, counted = ("kind", "detector"), ("detector", "condition")
        return xr.Dataset(
            {
                **self._shown(int(rng.integers(2**31))),
                **self._isolated(points[TRAINED], points[HELD_OUT]),
                "delay": (detected, mean, {"units": "s", "long_name": "mean over what was found"}),
                "missed": (detected, missed, {"units": "1"}),
                "lead": ((), float(np.mean(delay[0, both] - delay[1, both])), {"units": "s"}),
                "false_alarms": (counted, false, {"units": "1"}),
                "fault_free": ("condition", seconds, {"units": "s"}),
                "coupling": (
                    "drive",
                    coupling,
                    {"long_name": "squared correlation, sum and error"},
                ),
                "lost": lost,
            },
            coords={
                "kind": kinds,
                "detector": list(DETECTORS),
                "condition": list(CONDITIONS),
                "drive": names,
                "feature": list(FEATURES),
                "diode": ["d1n", "d2n"],
                "found": [*kinds, "missed"],
            },
        )

    def _clean(self, bench: Laboratory, seeds: list[int]) -> dict[str, DefectRun]:
        """Runs of a second without a defect, by condition."""
        return {
            "still disc": run(bench, [], seeds[0], duration=1.0, disc=STILL),
            "deviation": run(bench, [], seeds[1], duration=1.0),
            "shock": run(bench, [], seeds[2], SHOCK_PEAK[bench.axis], duration=1.0),
        }

    def _isolated(
        self, trained: list[tuple[int, Real | None]], held: list[tuple[int, Real | None]]
    ) -> dict[str, object]:
        """Clusters of the first features, and what they say of the second."""
        train, test = ([(k, x) for k, x in group if x is not None] for group in (trained, held))
        clusters = Clusters.fit(
            np.array([x for _, x in train]), np.array([k for k, _ in train]), tuple(KINDS)
        )
        measured, true = np.array([x for _, x in test]), np.array([k for k, _ in test])
        said = clusters.classify(measured)
        unseen = [k for k, x in held if x is None]
        kinds = np.append(true, np.array(unseen, int))
        counts = confusion(kinds, np.append(said, np.full(len(unseen), -1)), len(KINDS))
        return {
            "confusion": (("kind", "found"), counts),
            "features": (("event", "feature"), measured),
            "event_kind": ("event", true),
            "cluster_mean": (("kind", "feature"), clusters.means),
            "cluster_factor": (("kind", "feature", "also"), clusters.factors),
        }

    def _shown(self, seed: int) -> dict[str, object]:
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
                rate = one["false_alarms"].sel(condition=condition) / answer["fault_free"].sel(
                    condition=condition
                )
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

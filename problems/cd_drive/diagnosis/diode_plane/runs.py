"""Detectors of surface defects on the drives: what they find, when, and when they are wrong.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import RealArray
from workbench.diagnosis import (
    UNKNOWN,
    Clusters,
    confusion,
    detection,
    hysteresis,
    matched_events,
    quantile_threshold,
)
from workbench.simulation import play

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import STILL, Laboratory, measurements
from ..defect_events import LATE, defect_events, features
from ..defect_kinds import KINDS, SHOCK_PEAK, draw
from ..defect_runs import ROTATION, DefectRun, run
from ..quality import dimming_detector, diode_quality

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
ERROR_ALARMS = 0.01
"""False-alarm rate of the error's threshold on a wobbling disc, per block of ERROR_BLOCK."""
ERROR_BLOCK = 350

CLEAN_TIME = 1.0
"""Of each run without defects [s]."""

Point = tuple[int, RealArray | None]
"""Kind of a defect and the features of its event; None where it made none."""


class OneDrive(NamedTuple):
    """Of one drive: kind (F,) and delays (detector, F) of its defects, their events, false alarms.

    False alarms (detector, condition) are counted; coupling is the squared correlation of sum and
    error under shocks; lost, how often the loop was lost or regained.
    """

    labels: NDArray[np.int64]
    delays: RealArray
    points: list[Point]
    false_alarms: RealArray
    coupling: float
    lost: int


@dataclass(frozen=True)
class Detectors:
    """Quality signal and binary detector with their parameters, see `quality`, and the error."""

    axis: Axis
    dist_min: float
    dist_max: float
    alpha: float
    below: float

    def quality(self, one: DefectRun) -> RealArray:
        """Quality, dist and held error of a run (N, 3)."""
        law = diode_quality(one.level, self.dist_min, self.dist_max, self.alpha)
        return play(law, measurements(one.record))

    def binary(self, one: DefectRun) -> RealArray:
        """Alarm of the binary detector (N,)."""
        release = min(self.below + 0.1, 0.5 * (1.0 + self.below))
        law = dimming_detector(one.level, self.below, release)
        return play(law, measurements(one.record))[:, 0]

    def alarms(self, one: DefectRun, error_level: float) -> tuple[ArrayLike, ...]:
        """Alarm of each of DETECTORS (N,)."""
        error = abs(one.record.f_en)[:, None]
        above = play(hysteresis(error_level, 0.5 * error_level), error)[:, 0]
        return self.binary(one), self.quality(one)[:, 0] < 1.0, above

    def on_drive(self, name: str, defects: int, rng: np.random.Generator) -> OneDrive:
        """What they find on a drive: so many defects of each kind, clean discs, shocks."""
        bench = Laboratory(self.axis, name)
        first, *seeds, last = rng.integers(2**31, size=len(CONDITIONS) + 2).tolist()
        error = abs(run(bench, [], first, duration=CLEAN_TIME).record.f_en)
        still, wobbling, shaken = self._clean(bench, seeds)
        level = quantile_threshold(error, ERROR_ALARMS, block=ERROR_BLOCK).level
        false_alarms = np.zeros((len(DETECTORS), len(CONDITIONS)))
        for c, one in enumerate((still, wobbling, shaken)):
            for d, alarm in enumerate(self.alarms(one, level)):
                false_alarms[d, c] = detection(alarm, [], PERIOD).false_alarms
        labels = rng.permutation(np.repeat(np.arange(len(KINDS)), defects))
        drawn = [draw(list(KINDS)[k], rng, self.axis) for k in labels]
        dirty = run(bench, drawn, last)
        delays = [
            detection(a, dirty.faults, PERIOD, LATE).delays for a in self.alarms(dirty, level)
        ]
        dist = self.quality(dirty)[:, 1]
        seen = defect_events(dist, self.dist_min)
        points = [
            (k, features(dirty, dist, seen[i]) if i >= 0 else None)
            for k, i in zip(labels.tolist(), matched_events(seen, dirty.faults, LATE), strict=True)
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

    def shown(self, seed: int) -> dict[str, Any]:
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

        def lowest(values: RealArray) -> RealArray:
            least: RealArray = values[: blocks * BLOCK].reshape(blocks, BLOCK).min(axis=1)
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

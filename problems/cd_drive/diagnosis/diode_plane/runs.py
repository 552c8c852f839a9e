"""Detectors of surface defects on the drives: their detections, delays and false alarms.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.diagnosis import (
    UNKNOWN,
    Clusters,
    confusion_matrix,
    detection,
    hysteresis,
    matched_events,
    quantile_threshold,
)
from workbench.simulation import play
from workbench.types import RealArray

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import STILL, Laboratory, measurements
from ...laboratory.printed_noise import Amplitude, position_noise
from ..defect_events import LATE, defect_events, features
from ..defect_kinds import KINDS, SHOCK_PEAK, draw
from ..defect_runs import ROTATION, DefectRun, run
from ..quality import dimming_detector, diode_quality

DETECTORS = ("binary", "quality", "error")
"""Detectors that are compared."""
CONDITIONS = ("still disc", "deviation", "shock")
"""Conditions without defects in which false alarms are counted."""
REVOLUTIONS = 5
"""Number of revolutions shown in figure 7.11."""
POINTS = 1500
"""Number of points of a clean record shown in the plane."""
OVERVIEW_SAMPLES = 35
"""Number of samples of which the overview keeps the smallest: a millisecond."""
AHEAD, SHOWN = 70, 400
"""Number of samples shown before a defect, and in all."""
ERROR_ALARMS = 0.01
"""False-alarm rate of the error's threshold on a wobbling disc, per block of ERROR_BLOCK samples.
"""
ERROR_BLOCK = 350
"""Number of samples in a block: 10 ms."""
CLEAN_TIME = 1.0
"""Duration of each run without defects [s]."""

EventFeatures = tuple[int, RealArray | None]
"""Kind of a defect and the features of its event, or None if it made no event."""


class OneDrive(NamedTuple):
    """Findings of the detectors on one drive.

    labels (F,): kinds of its defects. delays (detector, F) [s]: NaN if missed. points: events of
    the defects. false_alarms (detector, condition): their number. coupling: squared correlation of
    sum and error under shocks. lost: number of its records in which the loop was lost.
    """

    labels: NDArray[np.int64]
    delays: RealArray
    points: list[EventFeatures]
    false_alarms: RealArray
    coupling: float
    lost: int


@dataclass(frozen=True)
class Detectors:
    """Quality signal and binary detector with their parameters (see `quality`), and the error."""

    axis: Axis
    dist_min: float
    dist_max: float
    alpha: float
    below: float
    noise: Amplitude

    def bench(self, drive: str, **quiet: Any) -> Laboratory:
        """A drive with the asked noise, or without noise."""
        return Laboratory(
            self.axis, drive, **{"noise": position_noise(self.axis, drive, self.noise), **quiet}
        )

    def quality(self, one: DefectRun) -> RealArray:
        """Quality, dist, and the error that is held in defects, of a run (N, 3)."""
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

    def on_drive(self, name: str, defects: int, seed: int, noisy: bool = True) -> OneDrive:
        """Findings on a drive, with this number of defects of each kind, on clean discs and under
        shocks.

        noisy: with noise of the diodes and electronics.
        """
        rng = np.random.default_rng(seed)
        quiet: dict[str, Any] = {} if noisy else {"noise": 0.0, "electronics": 0.0}
        bench = self.bench(name, **quiet)
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
            detection(a, dirty.faults, PERIOD, tail=LATE).delays for a in self.alarms(dirty, level)
        ]
        dist = self.quality(dirty)[:, 1]
        seen = defect_events(dist, self.dist_min)
        points = [
            (k, features(dirty, dist, seen[i]) if i >= 0 else None)
            for k, i in zip(
                labels.tolist(), matched_events(seen, dirty.faults, tail=LATE), strict=True
            )
        ]
        coupling = np.corrcoef(shaken.record.sum, shaken.record.f_en)[0, 1] ** 2
        lost = sum(bool(one.record.events) for one in (still, wobbling, shaken, dirty))
        return OneDrive(labels, np.array(delays), points, false_alarms, float(coupling), lost)

    def _clean(self, bench: Laboratory, seeds: list[int]) -> list[DefectRun]:
        """Runs without a defect, by condition."""
        still, wobbling, shaken = seeds
        return [
            run(bench, [], still, duration=CLEAN_TIME, disc=STILL),
            run(bench, [], wobbling, duration=CLEAN_TIME),
            run(bench, [], shaken, SHOCK_PEAK[bench.axis], CLEAN_TIME),
        ]

    def shown(self, rng: np.random.Generator) -> dict[str, Any]:
        """Data of the nominal drive that the figures show, by the name of its array."""
        seed = int(rng.integers(2**31))
        bench, rng = self.bench("nominal"), np.random.default_rng(seed)
        return self._plane(bench, rng, seed) | self._turning(bench, rng, seed)

    def _plane(self, bench: Laboratory, rng: np.random.Generator, seed: int) -> dict[str, Any]:
        """Clean points, points under shocks and a trace of each kind in the plane of the diodes."""
        clean = run(bench, [], seed, duration=1.0).diodes[:: round(RATE / POINTS)]
        shaken = run(bench, [], seed, SHOCK_PEAK[self.axis], 1.0).diodes[:: round(RATE / POINTS)]
        examples = run(bench, [draw(kind, rng, self.axis) for kind in KINDS], seed)
        windows = np.array([np.arange(SHOWN) + start - AHEAD for start, _ in examples.faults])
        linear = bench.parameters.K_optn * ACCEPTABLE_ERROR[self.axis]
        trace = examples.diodes[windows]
        return {"linear": linear, "clean": clean, "shaken": shaken, "trace": trace}

    def _turning(self, bench: Laboratory, rng: np.random.Generator, seed: int) -> dict[str, Any]:
        """A scratch that passes once a revolution: blocks of the run, and samples of one pass."""
        scratch = draw("scratch", rng, self.axis)
        turning = run(bench, [scratch] * REVOLUTIONS, seed, spacing=1.0 / ROTATION)
        signal = self.quality(turning)[:, 0]
        start = turning.faults[1][0] - AHEAD
        zoom = slice(start, start + AHEAD + 100)
        blocks = len(signal) // OVERVIEW_SAMPLES

        def lowest(values: RealArray) -> RealArray:
            least: RealArray = (
                values[: blocks * OVERVIEW_SAMPLES].reshape(blocks, OVERVIEW_SAMPLES).min(axis=1)
            )
            return least

        return {
            "block_time": np.arange(blocks) * OVERVIEW_SAMPLES * PERIOD,
            "block_quality": lowest(signal),
            "block_sum": lowest(turning.record.sum / turning.level),
            "zoom_time": np.arange(zoom.stop - zoom.start) * PERIOD,
            "zoom_quality": signal[zoom],
            "zoom_binary": self.binary(turning)[zoom],
            "zoom_diodes": turning.diodes[zoom],
        }


def delays_and_missed(drives: list[OneDrive]) -> tuple[RealArray, RealArray]:
    """Mean delay [s] of the detected defects, and share of missed ones, over all drives: (kinds,
    detectors).
    """
    labels = np.concatenate([one.labels for one in drives])
    delays = np.concatenate([one.delays for one in drives], axis=1)
    of_kind = [delays[:, labels == k] for k in range(len(KINDS))]
    found = [[row[~np.isnan(row)] for row in own] for own in of_kind]
    mean = [[row.mean() if row.size else np.nan for row in own] for own in found]
    return np.array(mean), np.array([np.isnan(own).mean(axis=1) for own in of_kind])


def lead_of_quality(drives: list[OneDrive]) -> float:
    """Mean time [s] by which the quality is earlier than the binary detector, where both detect."""
    delays = np.concatenate([one.delays[:2] for one in drives], axis=1)
    both = delays[:, ~np.isnan(delays).any(axis=0)]
    return float(np.mean(both[0] - both[1]))


def isolated(trained: list[EventFeatures], held_out: list[EventFeatures]) -> dict[str, Any]:
    """Clusters of the first events, and their decisions on the second, by the name of the array."""
    points, kinds, _ = _split(trained)
    measured, true, unseen = _split(held_out)
    clusters = Clusters.fit(points, kinds, tuple(KINDS))
    said = np.append(clusters.classify(measured), np.full(len(unseen), UNKNOWN))
    return {
        "confusion": confusion_matrix(np.append(true, unseen), said, len(KINDS)),
        "features": measured,
        "event_kind": true,
        "cluster_mean": clusters.means,
        "cluster_factor": clusters.factors,
    }


def _split(points: list[EventFeatures]) -> tuple[RealArray, NDArray[np.int64], NDArray[np.int64]]:
    """Features (E, 4) and kinds (E,) of the events, and kinds of the defects without an event."""
    seen = [(k, x) for k, x in points if x is not None]
    unseen = np.array([k for k, x in points if x is None], int)
    return np.array([x for _, x in seen]), np.array([k for k, _ in seen]), unseen
